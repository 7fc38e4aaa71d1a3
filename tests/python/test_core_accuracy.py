# SPDX-License-Identifier: GPL-3.0-or-later
"""Hits are those of real arithmetic on the given floats, also on edges and corners.

The traversal and the judge are both held against Python's fractions; t differs by rounding alone.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from builder_params import fast_params
from bvh_lab.native import core


def edge_margin(corners: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> Fraction | int:
    """How far inside its triangle the ray passes, exactly: the least edge volume over the sum.

    0 on an edge, negative outside; in units of barycentric coordinates.
    """
    exact = [[Fraction(float(x)) for x in point] for point in (*corners, origin, direction)]
    a, b, c = ([p - o for p, o in zip(corner, exact[3], strict=True)] for corner in exact[:3])
    d = exact[4]

    def volume(p: list[Fraction], q: list[Fraction]) -> Fraction:
        return (
            d[0] * (p[1] * q[2] - p[2] * q[1])
            + d[1] * (p[2] * q[0] - p[0] * q[2])
            + d[2] * (p[0] * q[1] - p[1] * q[0])
        )

    volumes = [volume(b, c), volume(c, a), volume(a, b)]
    total = sum(volumes)
    return min(v / total for v in volumes) if total else -1


def rays_at_edges(count: int, seed: int, offset: float) -> tuple[np.ndarray, ...]:
    """Triangles, and rays aimed at points of their edges, the scene moved by ``offset``."""
    random = np.random.default_rng(seed)
    corners = (random.random((count, 3, 3)) + offset).astype(np.float32)
    along = random.random((count, 1))
    targets = (1 - along) * corners[:, 0] + along * corners[:, 1]
    origins = (random.normal(size=(count, 3)) * 3 + offset).astype(np.float32)
    return corners, origins, (targets - origins).astype(np.float32)


@pytest.mark.parametrize("offset", [0.0, 1e3, 1e6])
def test_hits_at_edges_are_the_exact_ones(offset: float) -> None:
    corners, origins, directions = rays_at_edges(3000, seed=7, offset=offset)
    on_an_edge = 0
    for corner, origin, direction in zip(corners, origins, directions, strict=True):
        mesh = core.Mesh(corner, np.array([[0, 1, 2]], np.uint32))
        bvh = core.build(mesh, "lbvh", branching=2)
        hit = core.trace(bvh, origin[None], direction[None])
        judge = core.brute_force(mesh, origin[None], direction[None])
        margin = edge_margin(corner, origin, direction)
        on_an_edge += margin == 0
        # Rays run towards their triangles, so t is positive and the margin decides.
        assert bool(judge.occluded[0]) == (margin >= 0)
        assert bool(hit.occluded[0]) == (margin >= 0)
        if hit.occluded[0]:
            assert abs(hit.t[0] - judge.t[0]) <= 2 * np.spacing(np.float32(judge.t[0]))
    assert on_an_edge or offset < 1e5  # there, where coordinates are coarse, it happens


def test_no_ray_aimed_at_a_vertex_or_edge_of_a_closed_mesh_gets_through() -> None:
    random = np.random.default_rng(3)
    # A subdivided octahedron with bumps: closed, irregular.
    vertices = np.array(
        [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64
    )
    triangles = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4)]
    triangles += [(b, a, 5) for a, b, _ in triangles]
    points = [tuple(v) for v in vertices]
    for _ in range(4):
        middle: dict[tuple[int, int], int] = {}
        finer = []
        for a, b, c in triangles:
            mid = []
            for i, j in ((a, b), (b, c), (c, a)):
                key = (min(i, j), max(i, j))
                if key not in middle:
                    middle[key] = len(points)
                    point = np.add(points[i], points[j])
                    points.append(tuple(point / np.linalg.norm(point)))
                mid.append(middle[key])
            ab, bc, ca = mid
            finer += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        triangles = finer
    bumpy = np.array(points) * (1 + 0.2 * random.random((len(points), 1)))
    for offset in (0.0, 1e4):
        moved = (bumpy + offset).astype(np.float32)
        faces = np.array(triangles, np.uint32)
        mesh = core.Mesh(moved, faces)
        targets = np.concatenate([moved, *(moved[faces].mean(axis=1, keepdims=False),)])
        edges = (moved[faces[:, 0]] + moved[faces[:, 1]]) / 2
        targets = np.concatenate([targets, edges])
        origin = np.full((len(targets), 3), offset, np.float32)
        directions = targets - origin
        for builder in [entry["id"] for entry in core.builders()]:
            for branching in (2, 4, 8):
                bvh = core.build(mesh, builder, branching, params=fast_params(builder))
                assert core.trace(bvh, origin, directions).occluded.all()
                assert core.trace(bvh, origin, directions, any_hit=True).occluded.all()
