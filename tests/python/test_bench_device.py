# SPDX-License-Identifier: GPL-3.0-or-later
"""`make bench DEVICE=opencl`: what it measures on a small scene, and the command itself."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bvh_lab.native import core
from bvh_lab.study.devices import short_name
from bvh_lab.study.plan import BUILDERS
from opencl_support import first_device
from study_samples import grid_of_boxes, sample_scene, small_plan

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
sys.path.insert(0, str(SCRIPTS))
import bench_device
import bench_device_builds as builds
import bench_device_rays as tracing
import bench_device_text as text
import bench_scenes

# --- on the device -------------------------------------------------------------------------------


def test_trees_and_rays_are_the_cpu_cores() -> None:
    device, token = first_device(), core.Token()
    mesh = core.Mesh(*grid_of_boxes())
    build = builds.measure_build(mesh, "lbvh", {}, device, True, 3, token)
    assert (build.error, build.made_by, build.differing_bytes) == ("", device, 0)
    assert build.device.median_kernels() and len(build.ratios()) == len(build.device.tree) == 3
    scene, plan = sample_scene(), small_plan(long_side=32, depth=1)
    rays = tracing.make_rays(scene, core.build(mesh, "sah"), plan, token)
    found = tracing.measure_traces(build.tree, ("lbvh", "LBVH"), None, rays, device, 1, 3, token)
    assert [(t.branching, t.layout) for t in found] == list(tracing.SHAPES)
    first = rays.views[0].name
    for of in found:
        assert not of.error and of.kernel and of.differing == 0
        assert set(of.device) == set(of.cpu) == set(tracing.COLUMNS)
        for (kind, _), ours in of.device.items():
            assert sum(ours.rays.values()) == rays.counts()[kind]
            assert list(of.cpu[kind, False].rays) == [first] != list(ours.rays)
            assert all(len(seconds) == 3 for seconds in ours.seconds.values())
    binary = found[0].device["shadow", False].over(found[0].base["shadow", False])
    assert binary == pytest.approx((1.0, 1.0, 1.0))


def test_other_answers_and_other_trees_are_counted() -> None:
    device, token = first_device(), core.Token()
    vertices, triangles = grid_of_boxes()
    mesh = core.Mesh(vertices, triangles)
    moved = core.Mesh(vertices + np.float32(0.125), triangles)
    rays = tracing.make_rays(
        sample_scene(), core.build(mesh, "sah"), small_plan(long_side=16, depth=0), token
    )
    build = builds.measure_build(moved, "lbvh", {}, device, True, 1, token)
    found = tracing.measure_traces(build.tree, ("lbvh", "LBVH"), None, rays, device, 3, 3, token)
    assert all(of.device["primary", False].differing > 0 for of in found)
    assert all(of.cpu["primary", False].differing > 0 for of in found)
    tree, other = core.build(mesh, "lbvh"), core.build(moved, "lbvh")
    assert builds.differing_bytes(tree, tree) == 0 < builds.differing_bytes(tree, other)


def test_what_fails_fails_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken:
        def __getattr__(self, name: str) -> Any:
            return getattr(core, name)

        def trace(self, bvh: Any, *rays: Any, **settings: Any) -> Any:
            if bvh.stats["branching"] == 4 and settings["device"] != "cpu":
                raise RuntimeError("device lost")
            return core.trace(bvh, *rays, **settings)

        def build_tree(self, *_: Any, **__: Any) -> Any:
            raise MemoryError("LBVH does not fit")

    device, token = first_device(), core.Token()
    mesh = core.Mesh(*grid_of_boxes())
    tree = core.build_tree(mesh, "lbvh", device=device)
    plan = small_plan(long_side=16, depth=0)
    rays = tracing.make_rays(sample_scene(), core.build(mesh, "sah"), plan, token)
    monkeypatch.setattr(tracing, "core", Broken())
    monkeypatch.setattr(builds, "core", Broken())
    found = tracing.measure_traces(tree, ("lbvh", "LBVH"), None, rays, device, 0, 3, token)
    assert [of.error for of in found] == ["", "device lost", "", ""]
    assert found[2].device["primary", False].speed()
    build = builds.measure_build(mesh, "lbvh", {}, device, True, 3, token)
    assert build.error == "LBVH does not fit" and build.tree is None


@pytest.mark.parametrize("name", bench_scenes.OUR_VIEWS)
def test_rooms_are_seen_from_inside(name: str) -> None:
    if not (path := bench_scenes.SHARED / f"{name}.npz").is_file():
        pytest.skip(f"{path} is not there")
    scene = bench_scenes.load_scene(path)
    low, high = scene.vertices.min(axis=0), scene.vertices.max(axis=0)
    assert len(scene.cameras) == 3
    for camera in scene.cameras:
        assert ((low < camera.to_world[:3, 3]) & (camera.to_world[:3, 3] < high)).all()


# --- the command ---------------------------------------------------------------------------------


def settings(monkeypatch: pytest.MonkeyPatch, is_gpu: bool, *words: str) -> bench_device.Settings:
    monkeypatch.setattr(sys, "argv", ["bench_device.py", *words])
    entry = {"id": first_device(), "is_gpu": is_gpu}
    return bench_device.settings_of(bench_device.parse(), entry)


def test_a_gpu_is_measured_as_in_the_paper(monkeypatch: pytest.MonkeyPatch) -> None:
    gpu, processor = (settings(monkeypatch, is_gpu) for is_gpu in (True, False))
    assert (gpu.plan.width, gpu.plan.height, gpu.plan.depth, gpu.seconds) == (1024, 768, 8, 0.0)
    assert gpu.builders == gpu.traced == list(BUILDERS)
    assert gpu.cpu_views == 1 and gpu.params["prbvh_a"]["iterations"] == 200
    assert (processor.plan.depth, processor.cpu_views, processor.seconds) == (2, 3, 0.5)
    assert set(processor.builders) == {*bench_device.KERNELS, *bench_device.FEW}
    assert processor.traced == list(bench_device.FEW)
    chosen = settings(monkeypatch, False, "--builders", "sah,lbvh", "--resolution", "64x48")
    assert (chosen.builders, chosen.traced, chosen.seconds) == (["lbvh", "sah"], ["sah", "lbvh"], 0)
    alone = settings(monkeypatch, False, "--builders", "ploc", "--traced", "", "--no-cpu")
    assert (alone.builders, alone.traced, alone.cpu, alone.cpu_views) == (["ploc"], [], False, 0)


def test_what_would_take_too_long_is_left_out_and_said(monkeypatch: pytest.MonkeyPatch) -> None:
    chosen = settings(monkeypatch, False, "--builders", "lbvh", "--traced", "", "--no-cpu")
    bench = bench_device.Bench(chosen, core.Token(), lambda: None)
    scene = sample_scene()
    for slowness, left_out in ((0.0, False), (1.0, True)):
        bench.slowness["lbvh"] = slowness or bench.slowness.get("lbvh", 0.0)
        result = text.SceneResult("boxes", len(scene.triangles), [])
        bench.scene(scene, result)
        assert bool(result.builds) != left_out == bool(result.left_out)
    assert result.left_out == [
        "LBVH: would take about 768 s by what it took before (--longest-build 768 takes it)"
    ]


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    vertices, triangles = grid_of_boxes()
    path = tmp_path / "boxes.npz"
    np.savez(path, vertices=vertices, triangles=triangles)
    return path


def command(*words: str | Path) -> list[str]:
    return [sys.executable, str(SCRIPTS / "bench_device.py"), *map(str, words)]


def test_a_run_writes_text_and_csv(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ("--builders", "lbvh", "--resolution", "16x12", "--rounds", "3", "--out", out)
    done = subprocess.run(command(scene, *words), capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    (page,) = out.glob("*.md")
    assert page.read_text() == done.stdout
    name = short_name(first_device())
    assert done.stdout.startswith(f"# {name}\n") and first_device() in done.stdout
    assert "NOT COMPLETE" not in done.stdout and "driver" in done.stdout
    assert "## boxes: 768 triangles, 3 views" in done.stdout and "## All scenes" in done.stdout
    assert "boxes: tracing LBVH" in done.stderr
    assert {path.name.removeprefix(page.stem) for path in out.iterdir()} == {
        ".md",
        *(f"_{table}.csv" for table in ("builds", "kernels", "rays")),
    }


def test_a_stopped_run_leaves_what_was_measured(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ("--builders", "lbvh,sah", "--seconds", "0.0001", "--rounds", "1000", "--out", out)
    with subprocess.Popen(
        command(scene, *words),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if "tracing LBVH" in line:
                process.send_signal(signal.SIGINT)
                break
        stdout, stderr = process.communicate(timeout=120)
    assert process.returncode == 1, stderr
    assert "not complete: stopped at boxes: tracing LBVH" in stderr
    assert "**NOT COMPLETE: stopped at boxes: tracing LBVH.**" in stdout
    (page,) = out.glob("*.md")
    assert page.read_text() == stdout
    assert re.search(r"^\| LBVH +\| device +\|", stdout, re.MULTILINE)
    assert "MRays/s on the device" not in stdout


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("nowhere.npz",), "there is no file nowhere.npz"),
        (("--device", "opencl:none"), "unknown device 'opencl:none'; there are: cpu"),
        (("--device", "cpu"), "the CPU core is what is compared with: choose an OpenCL"),
        (("--builders", "qbvh"), "unknown builder 'qbvh'"),
        (("--resolution", "640"), "--resolution takes 640x480 and the like, not 640"),
        (("--rounds", "1"), "repeats is 1; it must be from 3"),
    ],
)
def test_bad_usage_is_named(
    words: tuple[str, ...],
    said: str,
    scene: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    given = words if words[0].endswith(".npz") else (*words, str(scene))
    monkeypatch.setattr(sys, "argv", ["bench_device.py", *given, "--out", str(scene.parent)])
    assert bench_device.main() == 2
    assert f"bench: error: {said}" in capsys.readouterr().err
