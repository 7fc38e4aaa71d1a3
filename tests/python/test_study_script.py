# SPDX-License-Identifier: GPL-3.0-or-later
"""`make study` and the benchmark against Cycles, each in a process of its own on a tiny .blend."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

# Not imported here: other tests of this process are about what works without bpy.
pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("bpy") is None, reason="the study of .blend files needs the bpy module"
)
SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"

BOX = """
import sys
import bpy
bpy.ops.wm.read_factory_settings()
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[1], compress=True)
"""


def run(script: str, *words: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(SCRIPTS / script), *map(str, words)],
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, "XDG_CACHE_HOME": str(Path(words[-1]).parent / "cache")},
    )


@pytest.fixture(scope="module")
def cube(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Blender's first scene: a cube, a camera, a lamp."""
    path = tmp_path_factory.mktemp("study") / "cube.blend"
    subprocess.run([sys.executable, "-c", BOX, str(path)], check=True, capture_output=True)
    return path


QUICK = (
    *("--builders", "lbvh,sah", "--branching", "2", "--repeats", "3"),
    *("--ray-resolution", "16", "--judged-rays", "8", "--sheet-samples", "1"),
    *("--curves", "lbvh_2,sah_2", "--curve-side", "16", "--curve-samples", "4"),
    *("--curve-repeats", "2", "--sheet-side", "32", "--reference-samples", "32", "--threads", "2"),
)


def test_study_writes_tables_and_figures(cube: Path) -> None:
    out = cube.parent / "out"
    broken = cube.parent / "broken.blend"
    broken.write_bytes(b"no scene")
    done = run("study.py", broken, cube, *QUICK, "--out", out)
    assert done.returncode == 1, done.stderr  # for the broken one, which stops nothing
    assert f"study: {broken} failed: " in done.stderr
    assert "1 of 2 scenes" in done.stderr
    assert "Table 1." in done.stdout
    assert "Figure 1." in done.stdout
    assert (out / "tables.txt").read_text() == done.stdout
    figures = ("figure1", "figure2", "build_time_secondary", "build_time_shadow", "error_cube")
    written = {path.name for path in out.iterdir()}
    assert written == {
        "cube",
        "tables.txt",
        "tables.csv",
        "figure1.csv",
        "error_cube.csv",
        "error_cube.txt",
        *(f"{name}{suffix}" for name in figures for suffix in (".svg", ".png")),
    }
    assert "time to relMSE 0.05" in (out / "error_cube.txt").read_text()
    assert (out / "cube" / "results.json").is_file()


def test_bad_usage_is_named(tmp_path: Path) -> None:
    done = run("study.py", "--curves", "sbvh_3", "--out", tmp_path / "out")
    assert done.returncode == 2
    assert "--curves takes variants like sbvh_8 and sbvh_8_cwbvh, not 'sbvh_3'" in done.stderr


def test_cycles_agrees_on_the_cube(cube: Path) -> None:
    out = cube.parent / "bench"
    done = run(
        "bench_cycles.py",
        cube,
        *("--resolution", "24x16", "--depth", "2", "--samples", "16", "--repeats", "1"),
        *("--reference-samples", "256", "--builder", "sah", "--threads", "2", "--out", out),
    )
    assert done.returncode == 0, done.stdout + done.stderr  # 1 where the means differ by 1%
    assert "samples per second, ours / Cycles: " in done.stdout
    assert "converged pictures of 256 samples, ours minus Cycles'" in done.stdout
    assert {path.name for path in out.iterdir()} == {
        "cube_cycles.txt",
        "cube_cycles.csv",
        *(f"cube_cycles_{name}{end}" for name in ("error", "residual") for end in (".svg", ".png")),
    }
