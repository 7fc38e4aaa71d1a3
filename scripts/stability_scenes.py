# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed against error on real meshes."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from stability_cases import (
    SPEED_BUILDER,
    CaseRow,
    SpeedRow,
    Variant,
    embree_scenes,
    measure_speed,
)
from stability_measure import Judge, disagreeing, precision_choices, trees

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared" / "scenes" / "crytek_sponza.npz"
ATRIUM = ROOT / "blender_scenes" / "atrium.blend"

sys.path.insert(0, str(ROOT / "blender_scenes"))

from hard_cases_base import Problem, aimed, targets_on


@dataclass
class SceneResult:
    """Errors and speeds on one mesh and kind of ray, by variant."""

    scene: str
    rays: str
    errors: list[CaseRow]
    speeds: list[SpeedRow]


def load_mesh(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a scene file."""
    if path.suffix == ".blend":
        from bvh_lab.blender.session import open_scene  # here: the rest needs no Blender

        scene = open_scene(path, "render")
    else:
        from bvh_lab.study.load import load_mesh_file

        scene = load_mesh_file(path, up="y")
    return scene.vertices, scene.triangles


def ray_sets(vertices: np.ndarray, triangles: np.ndarray, count: int) -> dict[str, Problem]:
    """Rays from points of the mesh's box: in random directions, and at corners and edges."""
    random = np.random.default_rng(1)
    used = vertices[np.unique(triangles)].astype(float)
    low, high = used.min(axis=0), used.max(axis=0)
    origins = low + random.random((count, 3)) * (high - low)
    targets = targets_on((vertices, triangles), 3 * count // 2, random)[:count]  # no faces
    at_edges = aimed(origins, targets[random.permutation(count)])
    return {
        "random": Problem(vertices, triangles, origins, random.normal(size=(count, 3))),
        "at edges and corners": Problem(vertices, triangles, *at_edges),
    }


def measure_scene(
    core: Any, path: Path, count: int, rounds: int, tests: float
) -> list[SceneResult]:
    """Errors and speeds of all precision choices; ``tests``: ray-triangle tests to judge by."""
    vertices, triangles = load_mesh(path)
    results = []
    for name, problem in ray_sets(vertices, triangles, count).items():
        judge = Judge(core, problem, tests)
        results.append(
            SceneResult(
                path.stem,
                name,
                scene_errors(core, f"{path.stem}, rays {name}", judge),
                measure_speed(core, path.stem, judge.mesh, problem.rays(), rounds),
            )
        )
    return results


def scene_errors(core: Any, label: str, judge: Judge) -> list[CaseRow]:
    """Errors of all choices on the trees of one builder, and of Embree."""
    rays = judge.problem.rays()
    rows = []
    first: dict[Any, Any] = {}
    for tree, bvh in trees(core, core.build_tree(judge.mesh, SPEED_BUILDER)):
        for precision in precision_choices(core):
            hits = core.trace(bvh, *rays, **precision.arguments())
            any_hit = core.trace(bvh, *rays, any_hit=True, **precision.arguments())
            differs = int((any_hit.occluded != hits.occluded).sum())
            away = disagreeing(first.setdefault(precision, hits), hits)
            variant = Variant(SPEED_BUILDER, tree, precision)
            rows.append(CaseRow(label, variant, judge.errors(hits).summary, away, differs))
    for name, scene in embree_scenes(core, judge.mesh).items():
        hits, any_hit = scene.trace(*rays), scene.trace(*rays, any_hit=True)
        differs = int((any_hit.occluded != hits.occluded).sum())
        rows.append(CaseRow(label, Variant(name), judge.errors(hits).summary, 0, differs))
    return rows
