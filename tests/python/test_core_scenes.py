# SPDX-License-Identifier: GPL-3.0-or-later
"""The core on real meshes: the paper's costs, and one answer from all variants.

BVHLAB_TEST_RAYS sets the number of random rays a scene (`make test-scenes` takes a million).
"""

from __future__ import annotations

import itertools
import os
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bvh_lab.native import core

SCENES = Path(__file__).resolve().parents[3] / "shared" / "scenes"
NAMES = (
    "bathroom",
    "crown",
    "crytek_sponza",
    "dabrovic_sponza",
    "legocar",
    "sibenik",
    "stanford_bunny",
    "transparent_machines_542",
    "veach_ajar",
)
RAYS = int(os.environ.get("BVHLAB_TEST_RAYS", "50000"))
# Brute force takes rays x triangles tests; this many keep a scene under a few seconds.
BRUTE_FORCE_TESTS = 1_000_000_000
LARGE = 1_500_000  # triangles above which a short run leaves SBVH out

# Paper, Tables 3 to 5: cost at branching 2, 4, 8 with c_T = 3, c_I = 2.
PAPER_COSTS = {"lbvh": (268, 163, 176), "sah": (198, 131, 136), "sbvh": (168, 113, 130)}


@cache
def load(name: str) -> Any:
    path = SCENES / f"{name}.npz"
    if not path.exists():
        pytest.skip(f"{path.name} is not in ../shared/scenes")
    arrays = np.load(path)
    return core.Mesh(arrays["vertices"], arrays["triangles"])


def random_rays(mesh: Any, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from points in the bounds: half in random directions, half towards random vertices."""
    random = np.random.default_rng(seed)
    lower, upper = mesh.bounds
    origins = (lower + random.random((count, 3)) * (upper - lower)).astype(np.float32)
    directions = random.normal(size=(count, 3)).astype(np.float32)
    targets = mesh.vertices[random.integers(0, len(mesh.vertices), count // 2)]
    directions[: count // 2] = targets - origins[: count // 2]
    directions[(directions == 0).all(axis=1)] = (0, 0, 1)
    return origins, directions


@pytest.mark.parametrize(("builder", "branching"), list(itertools.product(PAPER_COSTS, (2, 4, 8))))
def test_costs_are_the_papers(builder: str, branching: int) -> None:
    bvh = core.build(load("crytek_sponza"), builder, branching=branching)
    paper = PAPER_COSTS[builder][(2, 4, 8).index(branching)]
    assert bvh.cost(3.0, 2.0) == pytest.approx(paper, rel=0.02)


def count_different(a: Any, b: Any) -> int:
    """Rays whose closest hits differ in any bit."""
    different = a.triangle != b.triangle
    for field in ("t", "u", "v"):
        different |= getattr(a, field).view(np.uint32) != getattr(b, field).view(np.uint32)
    return int(different.sum())


@pytest.mark.parametrize("name", NAMES)
def test_all_variants_give_the_same_hits(name: str) -> None:
    mesh = load(name)
    origins, directions = random_rays(mesh, RAYS, seed=1)
    builders = [entry["id"] for entry in core.builders()]
    if len(mesh.triangles) > LARGE and RAYS < 1_000_000:
        builders.remove("sbvh")
    first = None
    for builder, branching in itertools.product(builders, (2, 4, 8)):
        bvh = core.build(mesh, builder, branching=branching)
        bvh.validate()
        for reorder in (False, True):
            hit = core.trace(bvh, origins, directions, reorder=reorder)
            first = first or hit
            assert count_different(first, hit) == 0, f"{builder} {branching} reorder={reorder}"
        any_hit = core.trace(bvh, origins, directions, any_hit=True)
        assert np.array_equal(any_hit.occluded, first.occluded), f"{builder} {branching} any hit"
    judge_sample(mesh, first, origins, directions)


def judge_sample(mesh: Any, hit: Any, origins: np.ndarray, directions: np.ndarray) -> None:
    """Compares an even sample of the rays with brute force, exact up to ties in t."""
    sample = np.arange(
        0, len(origins), max(1, len(origins) * len(mesh.triangles) // BRUTE_FORCE_TESTS)
    )
    judge = core.brute_force(mesh, origins[sample], directions[sample])
    assert np.array_equal(hit.occluded[sample], judge.occluded)
    found = judge.occluded
    t, exact = hit.t[sample][found], judge.t[found].astype(np.float32)
    other = hit.triangle[sample][found] != judge.triangle[found]
    # Another triangle is right only where it is met at the same t, to the last rounding.
    assert (np.abs(t - exact)[other] <= 2 * np.spacing(exact[other])).all()
    assert (np.abs(t - exact) <= 4 * np.spacing(exact)).all()
