# SPDX-License-Identifier: GPL-3.0-or-later
"""All kernels under Oclgrind, which runs them item by item and sees bad accesses and data races."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from bvh_lab.native import core

OCLGRIND = shutil.which("oclgrind") or "/usr/bin/oclgrind"
LIBRARY = Path(OCLGRIND).resolve().parents[1] / "lib/oclgrind/liboclgrind-rt-icd.so"
BUILDERS = [entry["id"] for entry in core.builders()]
MADE_BY_THE_CPU = {"sah", "hybrid"}  # as sbvh, which stands for them: collapse and tracing

pytestmark = pytest.mark.skipif(
    not LIBRARY.exists(), reason="oclgrind is missing (Debian 13 has none)"
)

PROGRAM = """
import sys
sys.path.insert(0, {folder!r})
from bvh_lab.native import core
from opencl_support import random_rays, same_bits, same_tree, soup
name, builder = "opencl:Oclgrind/Oclgrind Simulator", {builder!r}
few = builder[:2] in ("pr", "at", "tr")  # those that work in iterations
params = {{"iterations": 3.0}} if few else {{}}
mesh, rays = soup(24), random_rays(20)
tree = core.build_tree(mesh, builder, device=name, params=params)
for branching, layout in ((2, "full"), (8, "full"), (8, "cwbvh")):
    bvh = tree.collapse(branching, layout)
    cpu = core.build(mesh, builder, branching, layout=layout, params=params)
    assert same_tree(bvh, cpu), (branching, layout)
    for shape in {shapes!r}[branching, layout]:
        hit = core.trace(bvh, *rays, device=name, reorder=True, shape=shape)
        assert same_bits(hit, core.trace(cpu, *rays)), shape
"""
SHAPES = {  # of kernels that trace; with one builder only
    (2, "full"): ["single", "persistent"],
    (8, "full"): ["single", "lanes"],
    (8, "cwbvh"): ["single", "octant"],
}


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("oclgrind")
    (folder / "oclgrind.icd").write_text(f"{LIBRARY}\n")
    checks = {"OCLGRIND_CHECK_API": "1", "OCLGRIND_DATA_RACES": "1"}
    caches = {"XDG_CACHE_HOME": str(folder / "cache")}
    return {**os.environ, **checks, **caches, "OCL_ICD_VENDORS": str(folder)}


@pytest.mark.parametrize("builder", [name for name in BUILDERS if name not in MADE_BY_THE_CPU])
def test_kernels_of_a_builder(builder: str, environment: dict[str, str], tmp_path: Path) -> None:
    shapes = SHAPES if builder == "lbvh" else {key: [] for key in SHAPES}
    folder = str(Path(__file__).parent)
    program = PROGRAM.format(folder=folder, builder=builder, shapes=shapes)
    log = tmp_path / "log"
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**environment, "OCLGRIND_LOG": str(log)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert log.read_text()[:3000] == ""


def test_it_does_see_a_race(environment: dict[str, str], tmp_path: Path) -> None:
    """The check can fail: four work-items write to one place."""
    kernel = "kernel void race(global int* out) { out[0] = (int)get_global_id(0); }\n"
    (tmp_path / "race.cl").write_text(kernel)
    (tmp_path / "race.sim").write_text("race.cl\nrace\n4 1 1\n4 1 1\n<size=4 fill=0>\n")
    done = subprocess.run(
        [f"{OCLGRIND}-kernel", "--data-races", "race.sim"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "data race" in done.stdout + done.stderr
