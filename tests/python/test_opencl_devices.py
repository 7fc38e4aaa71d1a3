# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenCL devices as users meet them: named, listed, broken, missing, too small."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from bvh_lab.native import core
from opencl_support import answer_of, first_device, random_rays, same_bits, soup

DEVICES = """
import json
from bvh_lab.native import core
devices = core.devices()
try:
    core.build(core.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), "lbvh", device="opencl")
    error = ["", ""]
except Exception as raised:
    error = [type(raised).__name__, str(raised)]
bvh = core.build(core.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), "lbvh")
hit = core.trace(bvh, [[0.2, 0.2, 1]], [[0, 0, -1]])
print(json.dumps({"devices": devices, "error": error, "cpu hit": bool(hit.occluded[0])}))
"""


def devices_with(**environment: str) -> tuple[str, str]:
    """The one reason why there is no OpenCL, and what building with it raised.

    Nothing is raised by asking, and the cpu works whatever OpenCL does.
    """
    answer = answer_of(DEVICES, **environment)
    assert answer["cpu hit"]
    cpu, *others = answer["devices"]
    assert cpu["id"] == "cpu" and cpu["available"]
    assert [device["available"] for device in others] == [False]
    assert others[0]["id"] == "opencl" and others[0]["reason"]
    kind, text = answer["error"]
    assert kind == "RuntimeError" and others[0]["reason"] in text, answer["error"]
    return others[0]["reason"], text


def test_devices_are_described() -> None:
    cpu, *others = core.devices()
    assert cpu["id"] == "cpu" and cpu["simd"] and not cpu["is_gpu"]
    usable = [device for device in others if device["available"]]
    assert usable
    for device in usable:
        assert device["id"].startswith(f"opencl:{device['platform']}/{device['name']}")
        assert device["driver"] and device["threads"] >= 1 and device["memory"] > 2**20
        assert device["reason"] == "" and device["simd"] == ""
    assert all(set(device) == set(cpu) for device in others)


def test_opencl_is_the_first_device_and_results_have_its_full_name() -> None:
    mesh, full = soup(50), first_device()
    for name in ("opencl", full):
        tree = core.build_tree(mesh, "lbvh", device=name)
        bvh = tree.collapse(4)
        assert tree.device == bvh.device == bvh.stats["device"] == full
        assert bvh.stats["tree_device"] == full
        assert core.trace(bvh, *random_rays(5), device=name).device == full
    assert core.build(mesh, "lbvh").device == "cpu"
    assert core.trace(bvh, *random_rays(5)).device == "cpu"


def test_unknown_devices_are_answered_with_those_there_are() -> None:
    mesh = soup(5)
    bvh = core.build(mesh, "lbvh")
    for name in ("gpu", "", "opencl:nobody/nothing", "CPU"):
        for call in (
            lambda name=name: core.build(mesh, "lbvh", device=name),
            lambda name=name: core.trace(bvh, *random_rays(2), device=name),
        ):
            with pytest.raises(ValueError, match=f"unknown device '{name}'; there are: cpu, ") as e:
                call()
            assert first_device() in str(e.value)


def test_tests_to_compare_with_are_refused_on_devices() -> None:
    bvh = core.build(soup(5), "lbvh")
    for arguments in ({"triangle_test": "woop_affine"}, {"box_test": "plain"}):
        with pytest.raises(ValueError, match="cpu"):
            core.trace(bvh, *random_rays(2), device="opencl", **arguments)


# --- broken installations ------------------------------------------------------------------------


def test_no_driver(tmp_path: Path) -> None:
    reason, _ = devices_with(OCL_ICD_VENDORS=str(tmp_path))
    assert reason == "the OpenCL loader finds no platform; install a driver"


def test_a_driver_that_is_not_there(tmp_path: Path) -> None:
    (tmp_path / "gone.icd").write_text("libnobody.so.7\n")
    reason, _ = devices_with(OCL_ICD_VENDORS=str(tmp_path))
    assert "finds no platform" in reason


@pytest.mark.parametrize("content", ["", "no library", "\x7fELF and nothing more"])
def test_a_driver_that_is_no_library(tmp_path: Path, content: str) -> None:
    (tmp_path / "text.so").write_text(content)
    (tmp_path / "text.icd").write_text(f"{tmp_path / 'text.so'}\n")
    reason, _ = devices_with(OCL_ICD_VENDORS=str(tmp_path))
    assert "finds no platform" in reason


def compiled(source: str, library: Path) -> Path:
    command = ["g++", "-shared", "-fPIC", "-x", "c++", "-", "-o", str(library), "-ldl"]
    subprocess.run(command, input=source, text=True, check=True)
    return library


@pytest.fixture(scope="module")
def redirect(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library that, loaded first, opens $LOADER in the place of the OpenCL loader.

    LD_LIBRARY_PATH would not do: other libraries need the true one to be loaded themselves.
    """
    source = """
        #include <dlfcn.h>
        #include <stdlib.h>
        #include <string.h>
        extern "C" void* dlopen(const char* name, int flags) {
            static auto* const next = (void* (*)(const char*, int))dlsym(RTLD_NEXT, "dlopen");
            const bool loader = name && strcmp(name, "libOpenCL.so.1") == 0;
            return next(loader ? getenv("LOADER") : name, flags);
        }
    """
    return compiled(source, tmp_path_factory.mktemp("redirect") / "redirect.so")


def test_no_loader(redirect: Path) -> None:
    reason, _ = devices_with(LD_PRELOAD=str(redirect), LOADER="libOpenCL-gone.so.1")
    assert reason.startswith("there is no OpenCL loader: libOpenCL-gone.so.1: cannot open")


def test_a_loader_that_is_no_library(redirect: Path, tmp_path: Path) -> None:
    (tmp_path / "text.so").write_text("no library\n" * 1000)
    reason, _ = devices_with(LD_PRELOAD=str(redirect), LOADER=str(tmp_path / "text.so"))
    assert reason.startswith("there is no OpenCL loader: ") and "invalid ELF header" in reason


def test_a_loader_without_the_functions(redirect: Path, tmp_path: Path) -> None:
    empty = compiled('extern "C" int clNothing() { return 0; }', tmp_path / "empty.so")
    reason, _ = devices_with(LD_PRELOAD=str(redirect), LOADER=str(empty))
    assert "the OpenCL loader has no function cl" in reason and "1.2 is needed" in reason


# --- threads and memory of PoCL ------------------------------------------------------------------

ANSWERS = """
import hashlib, json, sys
sys.path.insert(0, {folder!r})
from opencl_support import random_rays, soup
from bvh_lab.native import core
mesh, rays = soup(3000), random_rays(5000)
answers = {{"units": [d["threads"] for d in core.devices() if d["id"] != "cpu"]}}
for builder in {builders!r}:
    for branching, layout in ((2, "full"), (4, "full"), (8, "full"), (8, "cwbvh")):
        bvh = core.build(mesh, builder, branching, device="opencl", layout=layout)
        sha = hashlib.sha256()
        for part in bvh.memory:
            sha.update(part)
        for reorder in (False, True):
            hit = core.trace(bvh, *rays, device="opencl", reorder=reorder)
            for part in (hit.t, hit.u, hit.v, hit.triangle):
                sha.update(part)
        answers[f"{{builder}} {{branching}} {{layout}}"] = sha.hexdigest()
print(json.dumps(answers))
"""


def test_the_same_trees_and_hits_from_one_and_two_threads() -> None:
    program = ANSWERS.format(folder=str(Path(__file__).parent), builders=["lbvh", "ploc", "prbvh"])
    one = answer_of(program, POCL_MAX_PTHREAD_COUNT="1")
    two = answer_of(program, POCL_MAX_PTHREAD_COUNT="2")
    assert one.pop("units") == [1] and two.pop("units") == [2]
    assert one == two


MESH_TOO_LARGE = """
import json
import numpy as np
from bvh_lab.native import core
vertices = np.zeros((30_000_000, 3), np.float32)
vertices[:3] = np.eye(3)
try:
    core.build(core.Mesh(vertices, [[0, 1, 2]]), "lbvh", device="opencl")
    print(json.dumps(["", ""]))
except Exception as error:
    print(json.dumps([type(error).__name__, str(error)]))
"""

# Many triangles of few vertices, each a leaf of its own: a test costs much more than a box.
TREE_TOO_LARGE = """
import json
import numpy as np
from bvh_lab.native import core
corners = np.random.default_rng(1).random((1000, 3)).astype(np.float32)
triangles = np.random.default_rng(2).integers(0, 1000, (1_800_000, 3)).astype(np.uint32)
bvh = core.build(core.Mesh(corners, triangles), "lbvh", 2, intersection=1e5)
try:
    core.trace(bvh, [[0, 0, 0]], [[1, 1, 1]], device="opencl")
    answer = ["", ""]
except Exception as error:
    answer = [type(error).__name__, str(error)]
print(json.dumps([bvh.stats, *answer]))
"""


def test_a_mesh_that_does_not_fit_says_how_much_it_needs() -> None:
    kind, text = answer_of(MESH_TOO_LARGE, POCL_MEMORY_LIMIT="1")
    assert kind == "MemoryError"
    assert text.startswith("LBVH of 1 triangles does not fit: device 'opencl:"), text
    assert "344 MiB are needed" in text


def test_a_tree_that_does_not_fit_says_how_much_it_needs() -> None:
    size, kind, text = answer_of(TREE_TOO_LARGE, POCL_MEMORY_LIMIT="1")
    assert kind == "MemoryError"
    assert f"a tree of {size['node_bytes'] >> 20} MiB of nodes and" in text, text
    assert f"{size['leaf_bytes'] >> 20} MiB of leaves does not fit: device 'opencl:" in text, text
    assert "are needed" in text


def test_a_tree_is_copied_to_the_device_once() -> None:
    bvh, rays = core.build(soup(200_000), "lbvh", 8), random_rays(10)
    first = core.trace(bvh, *rays, device="opencl")
    then = min(core.trace(bvh, *rays, device="opencl").transfer_seconds for _ in range(3))
    assert 0.0 < then < first.transfer_seconds
    assert same_bits(first, core.trace(bvh, *rays))


def test_times_say_what_they_are() -> None:
    stats = core.build(soup(2000), "lbvh", device="opencl").stats
    assert stats["transfer_seconds"] > 0.0 and stats["program_seconds"] >= 0.0
    assert {"collapsing", "layout"} <= set(stats["kernel_seconds"])
    assert sum(stats["kernel_seconds"].values()) > 0.0
    tree = core.build_tree(soup(2000), "lbvh", device="opencl")
    for kernel in [*tree.kernels, *tree.collapse(8).collapse_kernels]:
        assert kernel["kernel"] and kernel["launches"] >= 1 and kernel["seconds"] >= 0.0
    on_cpu = core.build(soup(20), "lbvh").stats
    assert on_cpu["kernel_seconds"] == {} and on_cpu["transfer_seconds"] == 0.0


def test_cancel_before_and_after() -> None:
    token = core.Token()
    token.cancel()
    bvh = core.build(soup(100), "lbvh")
    with pytest.raises(core.Cancelled):
        core.build(soup(100), "lbvh", device="opencl", token=token)
    with pytest.raises(core.Cancelled):
        core.trace(bvh, *random_rays(10), device="opencl", token=token)
    assert np.array_equal(
        core.trace(bvh, *random_rays(10), device="opencl").triangle,
        core.trace(bvh, *random_rays(10)).triangle,
    )
