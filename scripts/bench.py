#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""`make bench`: builders and tracing against Embree and mathutils.bvhtree, on the same rays.

Machines are shared and noisy, so every figure is a ratio to Embree within one round, the median
over rounds with the quartiles; contenders take turns within a round. For the first scene the
precision choices are compared (bench_precision.py). At the end comes what a feature of the renderer
costs where no surface uses it (bench_features.py).
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import bench_features
import bpy
import numpy as np
from bench_build import bench_builds
from bench_precision import precision_lines
from bench_ratios import ratio_text, speed_ratios
from bench_scenes import SHARED, load_scene
from bvh_lab.native import core
from bvh_lab.study.core_scene import core_scene
from bvh_lab.study.machine import describe_machine
from bvh_lab.study.plan import BUILDERS, QUICK_PARAMS, Plan
from bvh_lab.study.precision import LAYOUTS, width_text
from bvh_lab.study.rays import choose_views, generate_rays
from bvh_lab.study.results import KINDS, Result
from bvh_lab.study.run import compare
from bvh_lab.study.scene import Scene
from bvh_lab.study.spreadsheet import rows_csv

SLOW_RAYS = 20_000  # for mathutils.bvhtree, which takes one ray per Python call

# --- tracing -------------------------------------------------------------------------------------


def trace_lines(result: Result, slow: dict[str, float]) -> list[str]:
    """Lines of the table of tracing speeds, as ratios to robust and to fast Embree."""
    lines = [
        f"Speed / Embree high robust in the same round, {result.plan.repeats} rounds: "
        "median [quartiles];",
        "wrong hits of the rays judged by brute force; nodes visited and triangles tested",
        "per secondary ray",
        f"{'':22s}"
        + "".join(f"{kind:>20s}" for kind in KINDS)
        + "  wrong hits     nodes  triangles",
    ]
    robust = result.row("embree_high_robust")
    for row in result.rows:
        if row.error:
            lines.append(f"{row.label:22s} failed: {row.error}")
            continue
        name = (
            f"{row.label} {width_text(row.branching, row.layout)}" if row.branching else row.label
        )
        cells = "".join(f"{ratio_text(speed_ratios(row, robust, kind)):>20s}" for kind in KINDS)
        errors = row.errors()
        counts = [
            row.per_ray(counter, "secondary") for counter in ("node_visits", "triangle_tests")
        ]
        shown = "".join(
            f"{count:10.2f}" if count is not None else f"{'-':>10s}" for count in counts
        )
        lines.append(f"{name:22s}{cells}  {errors.wrong:4d} of {errors.judged:d}{shown}")
    cells = "".join(
        f"{slow[kind] / robust_speed.median:>14.4f}{'':6s}"
        if (robust_speed := robust.speed(kind))
        else ""
        for kind in KINDS
    )
    lines.append(
        f"{'mathutils.bvhtree':22s}{cells}  (one thread, one ray per call, {SLOW_RAYS} rays)"
    )
    speeds = ", ".join(
        f"{kind} {speed.median:.2f}" for kind in KINDS if (speed := robust.speed(kind))
    )
    lines.append(f"Embree high robust itself, MRays/s: {speeds}")
    return lines


def mathutils_speed(scene: Scene, plan: Plan) -> dict[str, float]:
    """MRays/s by kind of what a Blender user has today, on the first rays of the first view."""
    from mathutils.bvhtree import BVHTree

    tree = BVHTree.FromPolygons(
        scene.vertices.tolist(), scene.triangles.tolist(), all_triangles=True
    )
    mesh = core.Mesh(scene.vertices, scene.triangles)
    view = choose_views(core, scene, plan)[0]
    bvh = core.build(mesh, "lbvh")
    made, _ = core_scene(core, mesh, scene)
    generate_rays(core, made, view, bvh, plan, core.Token())
    speeds: dict[str, float] = {}
    for rays in view.sets:
        if rays.kind in speeds:  # of further bounces
            continue
        chosen = np.random.default_rng(0).permutation(len(rays))[:SLOW_RAYS]
        origins, directions = rays.origins[chosen].tolist(), rays.directions[chosen].tolist()
        far = np.broadcast_to(np.minimum(rays.t_max, 1e30), len(rays))[chosen].tolist()
        start = time.perf_counter()
        for origin, direction, distance in zip(origins, directions, far, strict=True):
            tree.ray_cast(origin, direction, distance)
        speeds[rays.kind] = 1e-6 * len(chosen) / (time.perf_counter() - start)
    return speeds


def bench(path: Path, out: Path, arguments: argparse.Namespace) -> None:
    scene = load_scene(path)
    mesh = core.Mesh(scene.vertices, scene.triangles)
    plan = Plan.from_preset("paper")
    for builder, settings in QUICK_PARAMS.items():  # the full annealing takes minutes: `make paper`
        plan.params.setdefault(builder, {}).update(settings)
    plan.builders = arguments.builders
    plan.width, plan.height = arguments.resolution
    plan.repeats, plan.build_repeats, plan.pictures = arguments.repeats, 1, False
    plan.judged_rays, plan.reorders, plan.depth = 256, ["off"], 2
    plan.layouts = list(LAYOUTS)
    large = len(scene.triangles) > 1_000_000
    machine = describe_machine(core, f"bpy {bpy.app.version_string}")
    lines = [
        f"{path.stem}: {len(scene.triangles)} triangles, views: "
        + ", ".join(camera.name for camera in scene.cameras),
        f"{machine.cpu}, {machine.cores} cores, {core.devices()[0]['simd']}, "
        f"Embree {machine.embree}, {plan.width}x{plan.height}",
        "",
        *bench_builds(path, mesh, plan, min(3, arguments.repeats) if large else arguments.repeats),
        "",
    ]
    print("\n".join(lines), flush=True)
    out.mkdir(parents=True, exist_ok=True)
    (out / f"{path.stem}_builds.txt").write_text("\n".join(lines))
    if arguments.builds_only:
        return
    result = compare(scene, plan).result
    traced = trace_lines(result, mathutils_speed(scene, plan))
    print("\n".join(traced), flush=True)
    if arguments.precision and path == arguments.scenes[0]:
        precise = ["", *precision_lines(scene, plan, out / f"{path.stem}_precision")]
        print("\n".join(precise), flush=True)
        traced += precise
    text = "\n".join([*lines, *traced]) + "\n"
    (out / f"{path.stem}.txt").write_text(text)
    (out / f"{path.stem}.csv").write_text(rows_csv(result))
    (out / f"{path.stem}.json").write_text(result.to_json())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "scenes", nargs="*", type=Path, help="mesh files; default: crytek_sponza and crown"
    )
    parser.add_argument("--out", type=Path, default=Path("out/bench"))
    parser.add_argument("--builders", default=",".join(BUILDERS), help="e.g. lbvh,sbvh")
    parser.add_argument("--builds-only", action="store_true", help="trace nothing")
    parser.add_argument(
        "--no-precision",
        dest="precision",
        action="store_false",
        help="leave bench_precision.py out, which takes the first scene",
    )
    parser.add_argument(
        "--no-features", dest="features", action="store_false", help="leave bench_features.py out"
    )
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--resolution", default="640x480")
    arguments = parser.parse_args()
    arguments.builders = arguments.builders.split(",")
    arguments.resolution = [int(side) for side in arguments.resolution.split("x")]
    arguments.scenes = arguments.scenes or [SHARED / "crytek_sponza.npz", SHARED / "crown.npz"]
    missing = [str(path) for path in arguments.scenes if not path.is_file()]
    if missing:
        print(f"bench: error: there is no file {missing[0]}", file=sys.stderr)
        return 2
    for path in arguments.scenes:
        bench(path, arguments.out, arguments)
    if arguments.features and not arguments.builds_only:
        print(flush=True)
        return bench_features.main(["--out", str(arguments.out)])
    return 0


if __name__ == "__main__":
    sys.exit(main())
