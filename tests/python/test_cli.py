# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line outside of Blender: results, exit codes, one line for everything that is bad."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from bvh_lab import cli
from bvh_lab.native import NativeMissing, core
from bvh_lab.study import run
from bvh_lab.study.results import Result
from study_samples import grid_of_boxes

QUICK = [
    *["--builders", "lbvh", "--branching", "2", "--views", "1", "--resolution", "32"],
    *[
        "--ray-resolution",
        "0",
        "--samples",
        "1",
        "--repeats",
        "3",
        "--build-repeats",
        "1",
        "--judged-rays",
        "16",
    ],
    "--no-embree",
]


@pytest.fixture
def mesh_file(tmp_path: Path) -> str:
    vertices, triangles = grid_of_boxes()
    path = tmp_path / "boxes.npz"
    np.savez(path, vertices=vertices, triangles=triangles)
    return str(path)


def bvh_lab(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "bvh_lab", *words], capture_output=True, text=True, timeout=120
    )


def one_line(capsys: pytest.CaptureFixture[str]) -> str:
    """The error line; asserts that there is nothing else."""
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("bvh_lab: error: ") and said.err.count("\n") == 1
    return said.err


def test_compare_prints_the_table(mesh_file: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compare", mesh_file, *QUICK]) == 0
    said = capsys.readouterr()
    assert said.out.startswith("Scene boxes: 768 triangles (mesh file geometry), 1 views (auto_1).")
    assert "\nLBVH " in said.out and "three cameras look at it from outside" in said.out
    assert "error" not in said.err


def test_compare_writes_the_folder(mesh_file: str, tmp_path: Path) -> None:
    done = bvh_lab("compare", mesh_file, *QUICK, "--out", str(tmp_path / "out"))
    assert done.returncode == 0 and "Traceback" not in done.stderr
    assert f"bvh_lab: wrote {tmp_path / 'out'}\n" in done.stderr
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {
        "table.txt",
        "results.csv",
        "rays.csv",
        "results.json",
        "index.html",
        "pictures",
    }


def test_json_on_stdout_is_json_alone(mesh_file: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compare", mesh_file, *QUICK, "--json", "-"]) == 0
    result = Result.from_json(capsys.readouterr().out)
    assert [row.name for row in result.rows] == ["lbvh_2"]


def test_json_into_a_file(mesh_file: str, tmp_path: Path) -> None:
    assert cli.main(["compare", mesh_file, *QUICK, "--json", str(tmp_path / "r.json")]) == 0
    assert Result.from_json((tmp_path / "r.json").read_text()).rows


def test_builders_lists_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["builders"]) == 0
    said = capsys.readouterr().out
    for builder in core.builders():
        assert f"{builder['id']:<10}{builder['label']}" in said
        for parameter in builder["parameters"]:
            assert f"{builder['id']}.{parameter['name']} = " in said
    assert cli.main(["builders", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == core.builders()


def test_devices_lists_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["devices"]) == 0
    lines = capsys.readouterr().out.splitlines()
    for line, name in zip(lines, [d["id"] for d in core.devices()] + ["embree"], strict=True):
        assert line.startswith(f"{name} ")
    assert cli.main(["devices", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["devices"] == core.devices()


def test_precisions_lists_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["precisions"]) == 0
    lines = capsys.readouterr().out.splitlines()
    offered = core.precisions()
    assert [line.split()[1] for line in lines] == [
        choice["id"] for name in ("layout", "triangle_test", "box_test") for choice in offered[name]
    ]
    assert cli.main(["precisions", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == offered


def test_help_is_no_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compare", "--help"]) == 0
    assert "--judged-rays" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("", "the following arguments are required: compare | builders | devices | precisions"),
        ("measure", "invalid choice: 'measure'"),
        ("compare", "compare needs a scene file: .blend, .npz, .obj or .ply"),
        ("compare MESH --builders nope", "unknown builder 'nope'; there are: lbvh, hlbvh, "),
        ("compare MESH --branching 3", "branching 3 is not known; it is 2, 4 or 8"),
        ("compare MESH --branching two", "--branching: 'two' is not a whole number"),
        ("compare MESH --device gpu", "unknown device 'gpu'; there are: cpu"),
        ("compare MESH --repeats 1", "repeats is 1; it must be from 3 to 1000"),
        ("compare MESH --samples x", "argument --samples: invalid int value: 'x'"),
        ("compare MESH --param sbvh.nope=1", "builder 'sbvh' has no parameter 'nope'"),
        ("compare MESH --reorder maybe", "unknown reorder 'maybe'; there are: off, aila, "),
        ("compare MESH --layouts tiny", "unknown layout 'tiny'; there are: full, cwbvh"),
        ("compare MESH --box-tests x", "unknown box test 'x'; there are: conservative, plain"),
        ("compare MESH --nope", "unrecognized arguments: --nope"),
    ],
)
def test_bad_usage(
    words: str, said: str, mesh_file: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([mesh_file if word == "MESH" else word for word in words.split()]) == 2
    assert said in one_line(capsys)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("none.npz", None, "there is no file "),
        ("none.blend", None, "there is no file "),
        ("bad.npz", b"hello", "is not a readable .npz file"),
        ("bad.ply", b"ply\n", "is not a readable .ply file"),
        ("bad.obj", b"v 0 0 0\n", "bad.obj has no triangles"),
        ("bad.blend", b"hello", "bad.blend is not a .blend file"),
        ("bad.blend", b"BLENDER-v304 but", ".blend file that Blender opens: "),
        ("empty.blend", b"", "empty.blend is not a .blend file"),
        ("scene.xyz", b"hello", "scene.xyz is not a .blend file"),
    ],
)
def test_bad_files(name: str, content: bytes | None, said: str, tmp_path: Path) -> None:
    path, out = tmp_path / name, tmp_path / "out"
    if content is not None:
        path.write_bytes(content)
    done = bvh_lab("compare", str(path), "--out", str(out))
    assert done.returncode == 1
    # Blender may speak before us, and newer ones log to stdout: "00:00.181  blend ...".
    assert not re.sub(r"^\d+:\d+\.\d+ .*\n", "", done.stdout, flags=re.MULTILINE)
    line = done.stderr.splitlines()[-1]
    assert line.startswith("bvh_lab: error: ") and said in line and str(path) in line
    assert "Traceback" not in done.stderr
    assert not [other for other in tmp_path.iterdir() if other != path]


def test_bad_arrays_end_before_the_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vertices, triangles = grid_of_boxes()
    vertices[5, 1] = np.nan
    np.savez(tmp_path / "bad.npz", vertices=vertices, triangles=triangles)
    assert cli.main(["compare", str(tmp_path / "bad.npz"), *QUICK]) == 1
    assert "bad.npz: vertex 5 is not finite" in one_line(capsys)


def test_unknown_view(mesh_file: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["compare", mesh_file, *QUICK, "--views", "Nave"]) == 1
    assert "unknown view 'Nave'; there are: auto_1, auto_2, auto_3" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--out", "--json"])
def test_unwritable_output_ends_before_the_work(
    option: str, mesh_file: str, capsys: pytest.CaptureFixture[str]
) -> None:
    place = f"{mesh_file}/below" if option == "--out" else "/proc/results.json"
    start = time.perf_counter()
    assert cli.main(["compare", mesh_file, option, place]) == 1
    assert time.perf_counter() - start < 2.0
    assert f"{option} {place} cannot be written: " in one_line(capsys)


def test_missing_core(
    mesh_file: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def no_core() -> ModuleType:
        raise NativeMissing("The compiled core is missing: looked for\n_core.so")

    monkeypatch.setattr(cli, "load", no_core)
    assert cli.main(["compare", mesh_file, *QUICK]) == 1
    assert one_line(capsys).endswith("The compiled core is missing: looked for _core.so\n")


def test_missing_blender_module(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.blend").touch()
    monkeypatch.setitem(sys.modules, "bpy", None)
    for name in [name for name in sys.modules if name.startswith("bvh_lab.blender.")]:
        monkeypatch.delitem(sys.modules, name)
    assert cli.main(["compare", str(tmp_path / "a.blend")]) == 1
    assert "install the Python package bpy" in one_line(capsys)


def test_a_failed_variant_is_an_exit_code(
    mesh_file: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class NoEmbree:
        def __getattr__(self, name: str) -> object:
            return getattr(core, name)

        def embree(self) -> dict[str, object]:
            return {"available": False, "version": "", "reason": "no libembree here"}

    monkeypatch.setattr(run, "load", NoEmbree)
    words = [word for word in QUICK if word != "--no-embree"]
    assert cli.main(["compare", mesh_file, *words]) == 1
    said = capsys.readouterr()
    assert "\nLBVH " in said.out and "FAILED" in said.out
    assert "Embree is missing: no libembree here; leave it out with --no-embree" in said.err
    assert cli.main(["compare", mesh_file, *QUICK]) == 0


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_keeps_the_rows_measured(signum: signal.Signals, mesh_file: str) -> None:
    out = Path(mesh_file).parent / "out"
    words = [*QUICK, "--builders", "lbvh,sah", "--repeats", "1000", "--no-pictures", "--resolution"]
    process = subprocess.Popen(
        [sys.executable, "-m", "bvh_lab", "compare", mesh_file, *words, "96", "--out", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    process.stderr.readline()  # the study runs once progress is shown
    time.sleep(1.0)
    process.send_signal(signum)
    start = time.perf_counter()
    stdout, stderr = process.communicate(timeout=30)
    assert time.perf_counter() - start < 3.0
    assert process.returncode == 128 + signum and "Traceback" not in stderr
    assert "Stopped early: rows hold what was measured until then." in stdout
    result = Result.from_json((out / "results.json").read_text())
    assert result.cancelled and [row.name for row in result.rows] == ["lbvh_2", "sah_2"]
    assert result.rows[0].speed("primary")


def test_run_by_path_as_blender_does(mesh_file: str, tmp_path: Path) -> None:
    installed = tmp_path / "addons" / "bvh_lab"
    package = Path(cli.__file__).parent
    shutil.copytree(package, installed, ignore=shutil.ignore_patterns("__pycache__"))
    words = [sys.executable, str(installed / "cli.py"), "scene.blend", "--", "compare", mesh_file]
    environment = {name: v for name, v in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run([*words, *QUICK], capture_output=True, text=True, env=environment)
    assert done.returncode == 0 and "\nLBVH " in done.stdout


def test_run_by_path_without_a_build(tmp_path: Path) -> None:
    (tmp_path / "addon").mkdir()
    script = Path(shutil.copy(Path(cli.__file__), tmp_path / "addon"))
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True)
    missing = tmp_path / "build" / "bvh_lab"
    assert done.returncode == 1
    assert done.stderr == f"bvh_lab: error: there is no {missing}; run `make build`\n"
