# SPDX-License-Identifier: GPL-3.0-or-later
"""A long random search for counterexamples of what is proven of the default tests.

The bounds are those of the box padding, the clamp to the triangle's own box and the float filter
(native/trace/intersect.h), of the padding of spatial splits (native/build/clip.h) and of the steps
of compressed nodes: where one is too small, a ray that grazes an edge gets a wrong answer.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from stability_examples import EXAMPLE_BYTES, check
from stability_measure import Judge, disagreeing, trees

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "blender_scenes"))

from hard_cases_base import (
    Mesh,
    Problem,
    aimed,
    box,
    join,
    nudged,
    soup,
    sphere,
    targets_on,
    turned,
)

RAYS = 600
# Splits wherever they can be, so that hits rest on the padding of the parts.
SPLITTING = {"alpha": 0.0, "max_references": 8.0}


@dataclass
class Found:
    """What a search saw. ``failures``: a sentence each, with what repeats it."""

    examples: int = 0
    batches: int = 0
    rays: int = 0
    hits: int = 0
    largest_t_ulps: float = 0.0  # where well-conditioned
    largest_uv: float = 0.0
    float_ties: int = 0
    seconds: float = 0.0
    failures: list[str] = field(default_factory=list)


def search(core: Any, seconds: float, seed: int = 1) -> Found:
    """Half the time each for small arbitrary examples and for grazing rays."""
    found = Found()
    start = time.monotonic()
    while time.monotonic() - start < seconds:
        for _ in range(200):
            search_example(core, seed, found)
        for _ in range(20):
            search_grazing(core, seed, found)
    found.seconds = time.monotonic() - start
    return found


def search_example(core: Any, seed: int, found: Found) -> None:
    data = np.random.default_rng([seed, found.examples]).bytes(EXAMPLE_BYTES)
    try:
        check(core, data)
    except AssertionError as error:
        found.failures.append(f"example [{seed}, {found.examples}]: {error}")
    found.examples += 1


def search_grazing(core: Any, seed: int, found: Found) -> None:
    label = f"grazing [{seed}, {found.batches}]"
    problem = grazing_problem(seed, found.batches)
    found.batches += 1
    judge = Judge(core, problem)
    first = None
    for builder, params in (("sbvh", SPLITTING), ("lbvh", {})):
        tree = core.build_tree(judge.mesh, builder, params=params)
        for name, bvh in trees(core, tree):
            hits = core.trace(bvh, *problem.rays())
            first = first or hits
            if away := disagreeing(first, hits):
                found.failures.append(f"{label}: {builder} {name} differs for {away} rays")
    errors = judge.errors(first)
    found.rays += len(problem.origins)
    found.hits += int(first.occluded.sum())
    found.float_ties += errors.wrong_triangles
    found.largest_t_ulps = max(found.largest_t_ulps, errors.t_ulps[errors.well].max(initial=0.0))
    found.largest_uv = max(found.largest_uv, errors.uv[errors.well].max(initial=0.0))
    wrong = errors.false_misses + errors.false_hits + errors.invalid
    if wrong:
        found.failures.append(f"{label}: {wrong} wrong hits or misses")
    if errors.t_ulps[errors.well].max(initial=0.0) > 4:
        found.failures.append(f"{label}: t is off by more than 4 ulp")
    if errors.wrong_ulps > 1:
        found.failures.append(f"{label}: a triangle {errors.wrong_ulps:.3g} ulp nearer was passed")


def grazing_problem(seed: int, batch: int) -> Problem:
    """A few dozen triangles of any size anywhere, and rays at or beside their corners and edges."""
    random = np.random.default_rng([seed, batch, 7])
    vertices, triangles = shape(random)
    size = 10 ** random.uniform(-8, 8)
    away = size * 10 ** random.uniform(-1, 6.5) * random.normal(size=3) * random.integers(0, 2, 3)
    vertices = (size * vertices + away).astype(np.float32).astype(float)
    mesh = vertices, triangles
    starts = vertices.mean(axis=0) + size * random.choice([0.1, 1, 10]) * random.normal(
        size=(RAYS, 3)
    )
    starts[: RAYS // 4] = targets_on(mesh, RAYS // 4, random)  # on the surface
    ends = targets_on(mesh, RAYS, random)[random.permutation(RAYS)]
    straight = random.random((RAYS, 3)) < random.choice([0.0, 0.5])
    ends = np.where(straight, starts.astype(np.float32), ends)  # some components 0
    origins, directions = aimed(starts, ends)
    beside = random.random(RAYS) < 0.5
    directions[beside] = nudged(directions[beside], int(random.integers(1, 5)), random)
    directions[(directions == 0).all(axis=1)] = (1, 0, 0)
    return Problem(vertices, triangles, origins, directions)


def shape(random: np.random.Generator) -> Mesh:
    """One of a few shapes of about the size 1."""
    kind = random.integers(0, 5)
    if kind == 0:
        return sphere(int(random.integers(3, 7)))
    if kind == 1:
        return soup(int(random.integers(1, 60)), 10 ** random.uniform(-3, 0.5), random)
    if kind == 2:
        lows = random.integers(-3, 3, (4, 3)) / 2
        return join(*(box(low, low + random.integers(1, 4, 3) / 2) for low in lows))
    if kind == 3:  # long and thin, in any direction
        vertices, triangles = soup(40, 1.0, random)
        return turned((vertices * (1, 1e-2, 10 ** random.uniform(-7, -2)), triangles), random)
    vertices, triangles = box((-1, -1, -1), (1, 1, 1))
    return turned((vertices, triangles), random)
