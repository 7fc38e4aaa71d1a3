# SPDX-License-Identifier: GPL-3.0-or-later
"""Hard cases, group 6: meshes on which trees grow deep, wide or bad."""

from __future__ import annotations

from functools import partial

import numpy as np
from hard_cases_base import (
    Case,
    Problem,
    aimed,
    box,
    count_of_rays,
    grid,
    in_ball,
    join,
    seen_from_around,
    soup,
    spindle,
    targets_on,
    turned,
)

TREES = "6 hard on trees"
EXACT = "as the exact answer"
NONE_MISSES = "no ray misses"
FAST_BUILDERS = ("lbvh", "hlbvh", "ploc", "sah")


def chain(links: int, growth: float, large: bool) -> Problem:
    """Triangles of exponentially growing size along a line, each aimed at from nearby."""
    random = np.random.default_rng(601)
    x = 1e-18 * growth ** np.arange(links)
    corners = x[:, None, None] * np.array([[1, 0, 0], [1.01, 0.02, 0], [1.02, 0, 0.02]])
    mesh = corners.reshape(-1, 3), np.arange(3 * links).reshape(-1, 3)
    chosen = random.integers(0, links, min(links, count_of_rays(large)))
    targets = np.einsum("j,ijk->ik", [0.3, 0.35, 0.35], corners[chosen])
    away = np.array([-0.0004, -0.0003, 0.0002]) + 1e-4 * in_ball(len(chosen), random)
    origins, directions = aimed(targets + 10 * x[chosen, None] * away, targets)
    return Problem(*mesh, origins, directions, must_hit=True)


def huge_over_small(small: int, fewer: int, large: bool) -> Problem:
    """One triangle over a hundred thousand or a million: every box along it is the whole scene."""
    random = np.random.default_rng(602)
    side = round(((small if large else fewer) / 2) ** 0.5)
    height = random.random((side + 1, side + 1))
    field = grid(side, side, height)
    cover = np.array([[-side, -side, 3], [3 * side, -side, 2], [-side, 3 * side, 4.0]])
    mesh = join(field, (cover, np.array([[0, 1, 2]])))
    count = count_of_rays(large) // 2
    starts = random.uniform(0.1, side - 0.1, (count, 3))
    starts[:, 2] = random.choice([-5.0, 1.7], count)
    ends = random.uniform(0.1, side - 0.1, (count, 3))
    ends[:, 2] = np.where(starts[:, 2] < 0, 1.7, random.choice([-5.0, 9.0], count))
    return Problem(*mesh, *aimed(starts, ends), must_hit=True)


def diagonals(large: bool) -> Problem:
    """Closed, long, thin spindles in random directions: spatial splits cut them many times."""
    random = np.random.default_rng(603)
    parts, starts = [], []
    rays = max(1, count_of_rays(large) // (60 if large else 12))
    for _ in range(60 if large else 12):
        vertices, triangles = spindle(12, 60.0)
        turn = turned((np.eye(3), triangles), random)[0]
        place = random.uniform(-30, 30, 3)
        parts.append((vertices @ turn + place, triangles))
        along = random.uniform(-50, 50, rays)[:, None] * (0, 0, 1)
        starts.append((along + 0.05 * in_ball(rays, random)) @ turn + place)
    mesh = join(*parts)
    own = [targets_on(part, rays, random) for part in parts]
    return Problem(*mesh, *aimed(np.concatenate(starts), np.concatenate(own)), must_hit=True)


def stairs(large: bool) -> Problem:
    """Thin closed steps turned about the z axis, as of a winding staircase."""
    random = np.random.default_rng(604)
    parts, starts = [], []
    steps = 200 if large else 30
    rays = max(1, count_of_rays(large) // steps)
    for i in range(steps):
        low, high = np.array([0.3, -0.15, 0.2 * i]), np.array([2.0, 0.15, 0.2 * i + 0.03])
        vertices, triangles = box(low, high)
        angle = 0.21 * i
        turn = np.array(
            [[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
        )
        parts.append((vertices @ turn, triangles))
        starts.append(random.uniform(low + 0.01, high - 0.01, (rays, 3)) @ turn)
    mesh = join(*parts)
    ends = targets_on(mesh, len(starts) * rays, random)
    return Problem(*mesh, *aimed(np.concatenate(starts), ends), must_hit=True)


def one_cell(large: bool) -> Problem:
    """All triangles but one in a single cell of the Morton code."""
    random = np.random.default_rng(605)
    near = soup(4000 if large else 500, 0.1, random)
    mesh = join((1e-3 * near[0], near[1]), (1e5 + near[0][:3], np.array([[0, 1, 2]])))
    count = count_of_rays(large)
    starts = 1e-3 * random.uniform(-1, 2, (count, 3))
    targets = targets_on((mesh[0][:-3], mesh[1][:-1]), count, random)
    return Problem(*mesh, *aimed(starts, targets))


def clusters(large: bool) -> Problem:
    """Clusters of triangles whose leaves reinsertion moves and merges: ranges must stay whole."""
    random = np.random.default_rng(606)
    centres = random.random((40, 1, 3))
    count = 100 if large else 25
    corners = centres + 0.02 * random.normal(size=(40, count, 3))
    corners = corners.reshape(-1, 1, 3) + 0.03 * random.normal(size=(40 * count, 3, 3))
    mesh = corners.reshape(-1, 3), np.arange(120 * count).reshape(-1, 3)
    return seen_from_around(mesh, count_of_rays(large), 606, 0.7)


def thin_parts(large: bool) -> Problem:
    """Flat and thin closed boxes beside large ones: coarse steps of a compressed node lose them."""
    random = np.random.default_rng(607)
    parts, starts = [], []
    count = 300 if large else 60
    rays = max(1, count_of_rays(large) // count)
    for i in range(count):
        low = np.round(random.uniform(0, 1000, 3), 2)
        size = np.array([0.001, 50.0, 20.0])[random.permutation(3)] * (1 if i % 2 else 0.01)
        low, high = (np.asarray(x, np.float32).astype(float) for x in (low, low + size))
        parts.append(box(low, high))
        starts.append(random.uniform(low, high, (rays, 3)) - 30 * (random.random((rays, 1)) < 0.5))
    mesh = join(*parts)
    own = np.concatenate([targets_on(part, rays, random) for part in parts])
    return Problem(*mesh, *aimed(np.concatenate(starts), own))


CASES = [
    Case(
        "growing_chain",
        TREES,
        "2000 triangles, each 1.05 times as large as the last",
        NONE_MISSES,
        partial(chain, 2000, 1.05),
        "Embree 4.4.1 (also robust), tinybvh 1.6.7 (also crashes), madmann91/bvh v2, obvhs",
    ),
    Case(
        "deep_chain",
        TREES,
        "4000 triangles that grow by 1.02: trees thousands of levels deep",
        NONE_MISSES,
        partial(chain, 4000, 1.02),
    ),
    Case(
        "huge_over_small",
        TREES,
        "one huge triangle over 40 000 small ones",
        NONE_MISSES,
        partial(huge_over_small, 40_000, 1_000),
    ),
    Case(
        "huge_over_million",
        TREES,
        "one huge triangle over a million small ones",
        NONE_MISSES,
        partial(huge_over_small, 1_000_000, 2_000),
        builders=FAST_BUILDERS,
    ),
    Case(
        "diagonals", TREES, "long, thin, closed diagonals (spatial splits)", NONE_MISSES, diagonals
    ),
    Case(
        "stairs",
        TREES,
        "thin closed steps of a winding staircase (spatial splits)",
        NONE_MISSES,
        stairs,
        "tinybvh 1.6.7 (spatial splits lose triangles)",
    ),
    Case("one_cell", TREES, "all but one triangle in one Morton cell", EXACT, one_cell),
    Case(
        "clusters",
        TREES,
        "clusters whose leaves an optimiser moves and merges",
        EXACT,
        clusters,
        "tinybvh 1.6.7 (4 % wrong after Optimize)",
    ),
    Case(
        "thin_parts",
        TREES,
        "thin boxes in a wide scene: coarse steps of compressed nodes",
        EXACT,
        thin_parts,
        "obvhs (CWBVH)",
    ),
]
