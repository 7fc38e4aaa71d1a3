# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes wrong around us: full disks, signals, broken modules, too little memory, cancels.

Files are there whole or not at all, what was there stays, and one sentence says what happened.
"""

from __future__ import annotations

import contextlib
import resource
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builder_params import fast_params
from bvh_lab import native
from bvh_lab.native import core
from study_samples import grid_of_boxes

ADDON = Path(__file__).parents[2] / "addon"
QUICK = ["--builders", "lbvh", "--branching", "2", "--views", "1", "--resolution", "32",
         "--ray-resolution", "0", "--samples", "1", "--repeats", "3", "--build-repeats", "1",
         "--judged-rays", "16", "--no-embree"]  # fmt: skip


@pytest.fixture
def mesh_file(tmp_path: Path) -> str:
    vertices, triangles = grid_of_boxes()
    np.savez(tmp_path / "boxes.npz", vertices=vertices, triangles=triangles)
    return str(tmp_path / "boxes.npz")


def python(program: str, *words: str, **how: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", program, *words],
        capture_output=True, text=True, timeout=120, **how,
    )  # fmt: skip


def one_sentence(stderr: str) -> str:
    """The error; asserts that there is one alone, and no traceback."""
    errors = [line for line in stderr.splitlines() if "error" in line.lower()]
    assert len(errors) == 1 and errors[0].startswith("bvh_lab: error: "), stderr
    assert "Traceback" not in stderr
    return errors[0]


def left_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()} - {"boxes.npz"}


# --- full disks ----------------------------------------------------------------------------------

# Files may grow to a limit, as on a disk that fills up (Python ignores SIGXFSZ).
LIMITED = """
import resource, sys
limit = int(sys.argv.pop(1))
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
from bvh_lab.cli import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.parametrize("limit", [0, 2000, 6000])
def test_a_full_disk_leaves_no_half_written_report(
    limit: int, mesh_file: str, tmp_path: Path
) -> None:
    """At once, under a table, and under a picture."""
    done = python(LIMITED, str(limit), "compare", mesh_file, *QUICK, "--out", str(tmp_path / "out"))
    assert done.returncode == 1 and left_in(tmp_path) == set()
    said = one_sentence(done.stderr)
    assert f"--out {tmp_path / 'out'} cannot be written: " in said
    assert "\nLBVH " in done.stdout  # the results are not lost


def test_a_full_disk_keeps_what_was_there(mesh_file: str, tmp_path: Path) -> None:
    out, table = tmp_path / "out", tmp_path / "table.json"
    out.mkdir()
    for file in (table, out / "results.json"):
        file.write_text("of the last run")
    words = [*QUICK, "--out", str(out), "--json", str(table)]
    done = python(LIMITED, "100", "compare", mesh_file, *words)
    assert done.returncode == 1 and "Traceback" not in done.stderr
    for option, path in (("--json", table), ("--out", out)):
        said = next(line for line in done.stderr.splitlines() if f"error: {option} " in line)
        assert f"{option} {path} cannot be written: " in said and said.endswith("File too large")
    assert table.read_text() == (out / "results.json").read_text() == "of the last run"
    assert left_in(tmp_path) == {"out", "table.json"} and left_in(out) == {"results.json"}


def test_output_that_cannot_be_printed_is_still_written(mesh_file: str, tmp_path: Path) -> None:
    words = [sys.executable, "-m", "bvh_lab", "compare", mesh_file, *QUICK]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [*words, "--out", str(tmp_path / "out")],
            stdout=full, stderr=subprocess.PIPE, text=True, timeout=120,
        )  # fmt: skip
    assert done.returncode == 1 and (tmp_path / "out" / "results.json").is_file()
    assert "the standard output cannot be written: No space left" in one_sentence(done.stderr)


@pytest.mark.parametrize("word", ["builders", "devices"])
def test_a_listing_into_a_full_disk(word: str) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "bvh_lab", word],
            stdout=full, stderr=subprocess.PIPE, text=True, timeout=60,
        )  # fmt: skip
    assert done.returncode == 1
    assert "the standard output cannot be written: No space left" in one_sentence(done.stderr)


@pytest.mark.skipif(not core.features()["image"], reason="this build has no OpenImageIO")
def test_pictures_that_cannot_be_written_are_os_errors(tmp_path: Path) -> None:
    pixels = np.zeros((4, 4, 3), np.float32)
    with pytest.raises(OSError, match="there is no folder"):
        core.write_image(str(tmp_path / "none" / "a.png"), pixels)
    (tmp_path / "a.exr").write_text("of the last run")
    program = (
        "import numpy, resource, sys\nfrom bvh_lab.native import core\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (50, 50))\n"
        "try:\n    core.write_image(sys.argv[1], numpy.zeros((9, 9, 3), numpy.float32))\n"
        "except OSError as error:\n    print(error)\n"
    )
    done = python(program, str(tmp_path / "a.exr"))
    assert done.stdout == f"cannot write {tmp_path / 'a.exr'}: File too large\n"
    assert (tmp_path / "a.exr").read_text() == "of the last run"
    assert left_in(tmp_path) == {"a.exr"}


# --- signals -------------------------------------------------------------------------------------

# A shell without a terminal lets what it starts in the background ignore SIGINT.
HEARS_SIGINT = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"

# Says when it has written half of the report, and waits there; in short sleeps, as a signal just
# before one begins is seen after it only.
HALF_WRITTEN = """
import sys, time
import bvh_lab.cli as cli
fill = cli.fill_report
def fill_half(result, pictures, folder):
    fill(result, pictures, folder)
    (folder / "results.json").write_text("half")
    print("half written", flush=True)
    for _ in range(600):
        time.sleep(0.1)
cli.fill_report = fill_half
sys.exit(cli.main(sys.argv[1:]))
"""

# Says that it reads the scene, and waits there.
READING = """
import sys, time
import bvh_lab.cli as cli
def read(path, up):
    print("reading", flush=True)
    for _ in range(600):
        time.sleep(0.1)
cli.load_mesh_file = read
sys.exit(cli.main(sys.argv[1:]))
"""


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
@pytest.mark.parametrize("program", [READING, HALF_WRITTEN])
def test_a_signal_leaves_nothing_half_written(
    program: str, signum: signal.Signals, mesh_file: str, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "results.json").write_text("of the last run")
    command = ["compare", mesh_file, *QUICK, "--out", str(out)]
    process = subprocess.Popen(
        [sys.executable, "-c", HEARS_SIGINT + program, *command],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    while process.stdout.readline() not in ("half written\n", "reading\n", ""):
        pass
    process.send_signal(signum)
    _, stderr = process.communicate(timeout=30)
    assert (out / "results.json").read_text() == "of the last run" and len(left_in(out)) == 1
    if signum == signal.SIGKILL:  # which lets nobody clean up: a hidden folder stays
        assert all(name == "out" or name.endswith(".partial") for name in left_in(tmp_path))
        return
    assert process.returncode == 128 + signum and left_in(tmp_path) == {"out"}
    assert one_sentence(stderr) == "bvh_lab: error: stopped"


# --- the compiled module -------------------------------------------------------------------------


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the add-on without the core."""
    ignore = shutil.ignore_patterns("__pycache__", "_core*")
    return Path(shutil.copytree(ADDON, tmp_path / "bvh_lab", ignore=ignore))


def import_core(package: Path) -> str:
    """The text of the NativeMissing that importing the core raises; the process must live."""
    program = (
        "import bvh_lab.native as native\ntry:\n    native.load()\n"
        "except native.NativeMissing as error:\n    print(error)\n"
    )
    done = python(program, cwd=package.parent, env={"PYTHONPATH": str(package.parent)})
    assert done.returncode == 0 and done.stdout.count("\n") == 1, done.stderr
    return done.stdout


@pytest.mark.parametrize("share", [0.0, 1e-4, 0.1, 0.5, 0.9, 0.9999])
def test_a_module_cut_short_is_refused(share: float, package: Path) -> None:
    whole = Path(native.load().__file__).read_bytes()
    (package / f"_core{EXTENSION_SUFFIXES[0]}").write_bytes(whole[: int(share * len(whole))])
    said = import_core(package)
    assert ("is cut short" in said or "does not load" in said) and "make build" in said


def test_another_module_of_that_name_is_refused(package: Path) -> None:
    (package / "_core.py").write_text("answer = 42\n")
    assert "is not the core of BVH Lab" in import_core(package)


def test_a_module_without_its_entry_is_refused(package: Path) -> None:
    other = next(Path(np.__file__).parent.rglob(f"*{EXTENSION_SUFFIXES[0]}"))
    shutil.copy(other, package / f"_core{EXTENSION_SUFFIXES[0]}")
    assert "does not load" in import_core(package)


# --- memory --------------------------------------------------------------------------------------

# Ever more memory until a build succeeds; meshes grow, as memory that is free again is used first.
# (tests/native/memory fails single allocations of every builder.)
STARVED = """
import resource, sys
import numpy as np
from bvh_lab.native import core

def with_limit(mebibytes, call):
    used = int(open("/proc/self/statm").read().split()[0]) * 4096
    resource.setrlimit(resource.RLIMIT_AS, (used + (mebibytes << 20), resource.RLIM_INFINITY))
    try:
        return call() is not None
    except MemoryError:
        return False
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY,) * 2)

random = np.random.default_rng(1)
corners = random.random((90000, 1, 3)) + random.uniform(-.01, .01, (90000, 3, 3))
rows, ends = corners.reshape(-1, 3), np.arange(270000).reshape(-1, 3)
assert not with_limit(1, lambda: core.Mesh(rows, ends))  # converted from float64
for count, builder in ((30000, "lbvh"), (50000, "hlbvh"), (70000, "ploc"), (90000, "trbvh")):
    mesh = core.Mesh(rows[:3 * count], ends[:count])
    build = lambda: core.build(mesh, builder, threads=1)
    enough = [with_limit(size, build) for size in (0, 1, 2, 4, 8)]
    assert not enough[0], builder
    bvh = build()
    assert bvh.cost() == build().cost()
    bvh.validate()
origins = np.zeros((3000000, 3), np.float32)
trace = lambda: core.trace(bvh, origins, origins + 1, threads=1)
assert not with_limit(8, trace)
core.trace(bvh, origins[:10], origins[:10] + 1)
print("done")
"""


def test_too_little_memory_is_a_memory_error_and_the_next_build_works() -> None:
    done = python(STARVED)
    assert done.stdout == "done\n", done.stderr


# --- cancels -------------------------------------------------------------------------------------


def soup(count: int) -> Any:
    random = np.random.default_rng(2)
    corners = random.random((count, 1, 3)) + random.uniform(-0.02, 0.02, (count, 3, 3))
    return core.Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


MESH = soup(4000)
RANDOM = np.random.default_rng(3)
ORIGINS = RANDOM.random((20000, 3)).astype(np.float32)
DIRECTIONS = RANDOM.normal(size=(20000, 3)).astype(np.float32)
TREE = core.build_tree(MESH, "sah")
BVH = TREE.collapse(4)
SCENE = core.Scene(
    MESH, [core.Material([core.Component()])], np.zeros(4000, np.uint32), [], core.World((1, 1, 1))
)
PLACE = np.eye(4)
PLACE[:3, 3] = 0.5, 0.5, 3.0
CAMERA = core.Camera("perspective", PLACE, (-0.3, 0.3, -0.3, 0.3))


def picture(token: Any) -> bytes:
    renderer = core.Renderer(BVH, SCENE, CAMERA, 48, 48, depth=2)
    renderer.render(2, token=token)
    return bytes(renderer.picture().pixels.tobytes())


STAGES: dict[str, Callable[[Any], Any]] = {
    **{
        builder["id"]: lambda token, name=builder["id"]: core.build(
            MESH, name, 8, params=fast_params(name), token=token
        ).cost()
        for builder in core.builders()
    },
    "collapse": lambda token: TREE.collapse(8, token=token).cost(),
    "trace": lambda token: core.trace(BVH, ORIGINS, DIRECTIONS, token=token).t.tobytes(),
    "reorder": lambda token: core.trace(
        BVH, ORIGINS, DIRECTIONS, reorder=True, token=token
    ).t.tobytes(),
    "judge": lambda token: core.brute_force(
        MESH, ORIGINS[:300], DIRECTIONS[:300], token=token
    ).t.tobytes(),
    "metrics": lambda token: core.metrics(BVH, token=token)["epo"],
    "render": picture,
}


@pytest.mark.parametrize("stage", STAGES)
def test_a_cancel_at_any_time_leaves_a_clean_state(stage: str) -> None:
    """Cancelled before, and at six moments of the run: it ends soon, and the next run is right."""
    run = STAGES[stage]
    start = time.perf_counter()
    expected = run(core.Token())
    whole = time.perf_counter() - start
    cancelled = 0
    for moment in [None, *np.linspace(0.0, 0.9, 6)]:
        token = core.Token()
        timer = threading.Timer(0.0 if moment is None else moment * whole, token.cancel)
        timer.start()
        if moment is None:
            timer.join()
        try:
            assert run(token) == expected
        except core.Cancelled:
            cancelled += 1
        timer.join()
    assert cancelled >= 1
    assert run(core.Token()) == expected


def test_a_cancelled_picture_goes_on_to_the_same_one() -> None:
    expected = core.render(BVH, SCENE, CAMERA, 64, 64, samples=6, depth=2).pixels
    renderer = core.Renderer(BVH, SCENE, CAMERA, 64, 64, depth=2)
    while renderer.samples < 6:
        token = core.Token()
        timer = threading.Timer(0.003, token.cancel)
        timer.start()
        with contextlib.suppress(core.Cancelled):
            renderer.render(6 - renderer.samples, token=token)
        timer.join()
        token = core.Token()
        if renderer.samples < 6:
            renderer.render(1, token=token)
    np.testing.assert_array_equal(renderer.picture().pixels, expected)


def test_limits_of_this_process_are_not_changed() -> None:
    """What the tests above limit, they limit in processes of their own."""
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[1] == resource.RLIM_INFINITY
