# SPDX-License-Identifier: GPL-3.0-or-later
"""Build times as ratios to our LBVH and to Embree, and the memory that a build takes."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bench_ratios import ratio_text
from bvh_lab.native import core
from bvh_lab.study.load import load_mesh_file
from bvh_lab.study.plan import Plan
from bvh_lab.study.results import spread

BRANCHING = 8
SLOW_SECONDS = 10.0  # a builder that takes longer is timed once, without a warm-up
RIVALS = ("LBVH", "Embree low", "Embree high")  # what the ratios are of


def bench_builds(path: Path, mesh: Any, plan: Plan, repeats: int) -> list[str]:
    """Lines of the table of build times; contenders take turns within a round."""
    contenders = build_contenders(mesh, plan)
    seconds: dict[str, list[float]] = {name: [] for name in contenders}
    slow = set()
    for repeat in range(repeats + 1):
        for name, build in contenders.items():
            if name in slow:
                continue
            measured = build()
            if measured > SLOW_SECONDS:
                slow.add(name)
            if repeat or name in slow:  # the first round warms up
                seconds[name].append(measured)
    lines = [
        f"Build time, {BRANCHING}-wide (binary tree, collapse and layout), {repeats} rounds:",
        "median [quartiles] of the ratios within a round; memory: the most that the process held",
        "beyond the mesh, per triangle",
        f"{'':14s} {'ms':>10s} {'cost':>7s} "
        + " ".join(f"{'/ ' + rival:>21s}" for rival in RIVALS)
        + f" {'bytes/triangle':>15s}",
    ]
    labels = {entry["label"]: entry["id"] for entry in core.builders()}
    for name, own in seconds.items():
        ratios = [
            ratio_text([a / b for a, b in zip(own, seconds[rival], strict=False)])
            for rival in RIVALS
        ]
        line = f"{name:14s} {1e3 * spread(own).median:10.1f} "
        cost, memory = "", ""
        if name in labels:
            cost, peak = cost_and_peak(path, labels[name], plan)
            memory = f"{peak / len(mesh.triangles):.0f}"
        lines.append(
            f"{line}{cost:>7s} " + " ".join(f"{r:>21s}" for r in ratios) + f" {memory:>15s}"
        )
    return lines


def build_contenders(mesh: Any, plan: Plan) -> dict[str, Callable[[], float]]:
    """Name to a function that builds once and gives the seconds."""

    def ours(builder: str) -> Callable[[], float]:
        params = plan.params.get(builder, {})
        return lambda: float(
            core.build(mesh, builder, BRANCHING, params=params).stats["build_seconds"]
        )

    def embree(quality: str) -> Callable[[], float]:
        return lambda: float(core.EmbreeScene(mesh, quality=quality, robust=False).build_seconds)

    contenders = {f"Embree {quality}": embree(quality) for quality in ("low", "medium", "high")}
    labels = {entry["id"]: entry["label"] for entry in core.builders()}
    for builder in dict.fromkeys(["lbvh", *plan.builders]):
        contenders[labels[builder]] = ours(builder)
    return contenders


def cost_and_peak(path: Path, builder: str, plan: Plan) -> tuple[str, int]:
    """The tree's cost as text, and the build's peak of memory in bytes, in a process of its own."""
    params = json.dumps(plan.params.get(builder, {}))
    command = [sys.executable, __file__, str(path), builder, params]
    run = subprocess.run(command, check=True, capture_output=True, text=True)
    cost, peak = json.loads(run.stdout)
    return f"{cost:.1f}", peak


def _build_alone(path: Path, builder: str, params: dict[str, float]) -> tuple[float, int]:
    scene = load_mesh_file(path, up="y")
    mesh = core.Mesh(scene.vertices, scene.triangles)
    Path("/proc/self/clear_refs").write_text("5")  # forget the peak so far
    before = _memory("VmRSS")
    bvh = core.build(mesh, builder, BRANCHING, params=params)
    return bvh.cost(), _memory("VmHWM") - before


def _memory(name: str) -> int:
    """A field of /proc/self/status in bytes."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith(f"{name}:"))


if __name__ == "__main__":
    print(json.dumps(_build_alone(Path(sys.argv[1]), sys.argv[2], json.loads(sys.argv[3]))))
