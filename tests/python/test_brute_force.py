# SPDX-License-Identifier: GPL-3.0-or-later
"""The judge is judged: brute force against the same question in Python's exact fractions."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from bvh_lab.native import core

MISS = 0xFFFFFFFF

Vector = tuple[Fraction, Fraction, Fraction]
Hit = tuple[Fraction, Fraction, Fraction, int]


def exact(row: np.ndarray) -> Vector:
    x, y, z = (Fraction(float(value)) for value in row)
    return x, y, z


def minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def dot(a: Vector, b: Vector) -> Fraction:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def closest(corners: list[list[Vector]], origin: Vector, direction: Vector) -> Hit | None:
    """(t, u, v, triangle) by Möller and Trumbore's formula, which has no rounding in fractions."""
    best: Hit | None = None
    for index, (a, b, c) in enumerate(corners):
        edge_b, edge_c = minus(b, a), minus(c, a)
        normal_part = cross(direction, edge_c)
        determinant = dot(edge_b, normal_part)
        if determinant == 0:
            continue
        seen = minus(origin, a)
        other_part = cross(seen, edge_b)
        u = dot(seen, normal_part) / determinant
        v = dot(direction, other_part) / determinant
        t = dot(edge_c, other_part) / determinant
        if u < 0 or v < 0 or u + v > 1 or t < 0:
            continue
        if best is None or t < best[0]:
            best = t, u, v, index
    return best


def near(value: float, truth: Fraction) -> bool:
    return abs(Fraction(float(value)) - truth) <= 4 * Fraction(math.ulp(float(truth)))


def judge(vertices: np.ndarray, triangles: np.ndarray, rays: np.ndarray) -> int:
    """Compare all rays (N, 2, 3) of brute force with the fractions; the number of hits."""
    origins = np.ascontiguousarray(rays[:, 0], np.float32)
    directions = np.ascontiguousarray(rays[:, 1], np.float32)
    mesh = core.Mesh(vertices, triangles)
    found = core.brute_force(mesh, origins, directions)
    assert found.t.dtype == found.u.dtype == found.v.dtype == np.float64
    any_hit = core.brute_force(mesh, origins, directions, any_hit=True)
    assert any_hit.t is None
    assert (any_hit.occluded == found.occluded).all()
    corners = [[exact(vertices[corner]) for corner in triangle] for triangle in triangles]
    hits = 0
    for i in range(len(rays)):
        truth = closest(corners, exact(origins[i]), exact(directions[i]))
        assert found.occluded[i] == (truth is not None), i
        if truth is None:
            assert found.triangle[i] == MISS and found.t[i] == math.inf
            continue
        hits += 1
        assert found.triangle[i] == truth[3], i
        answers = found.t[i], found.u[i], found.v[i]
        assert all(near(a, b) for a, b in zip(answers, truth[:3], strict=True)), i
    return hits


def aim(origins: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Rays that start at origins and pass the targets, as closely as float32 can say."""
    origins = np.asarray(origins, np.float32)
    return np.stack([origins, np.asarray(targets, np.float32) - origins], axis=1)


def grid(size: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A height field on whole numbers, whose inner edges all have two triangles."""
    x, y = np.meshgrid(np.arange(size), np.arange(size), indexing="ij")
    vertices = np.stack([x, y, random.integers(0, 3, x.shape)], axis=2).reshape(-1, 3)
    corner = (np.arange(size - 1)[:, None] * size + np.arange(size - 1)).ravel()
    first = np.stack([corner, corner + size, corner + size + 1], axis=1)
    second = np.stack([corner, corner + size + 1, corner + 1], axis=1)
    return vertices.astype(np.float32), np.concatenate([first, second]).astype(np.uint32)


def test_random_triangles() -> None:
    random = np.random.default_rng(1)
    vertices = random.random((150, 3), np.float32)
    triangles = np.arange(150, dtype=np.uint32).reshape(-1, 3)
    rays = aim(random.uniform(-1, 2, (200, 3)), random.random((200, 3)))
    assert judge(vertices, triangles, rays) > 100


def test_edges_and_corners_of_a_grid() -> None:
    """Rays on whole numbers meet corners, edges and diagonals exactly, and tie there."""
    random = np.random.default_rng(2)
    vertices, triangles = grid(6, random)
    targets = np.concatenate(
        [vertices, (vertices[triangles[:, 0]] + vertices[triangles[:, 1]]) / 2]
    )
    origins = random.integers(-3, 9, targets.shape) + np.array([0, 0, 8])
    assert judge(vertices, triangles, aim(origins, targets)) > 60


def test_edges_that_rounding_decides() -> None:
    """Rays aimed at corners and edges that float32 cannot say: off by the last place or so."""
    random = np.random.default_rng(3)
    vertices, triangles = grid(6, random)
    vertices = (vertices * np.float32(0.1) + random.random(3, np.float32)).astype(np.float32)
    share = random.random((len(triangles), 1), np.float32)
    on_edges = vertices[triangles[:, 0]] * share + vertices[triangles[:, 1]] * (1 - share)
    targets = np.concatenate([vertices, on_edges])
    origins = random.uniform(-1, 2, targets.shape) + np.array([0, 0, 3])
    assert judge(vertices, triangles, aim(origins, targets)) > 60


@pytest.mark.parametrize("exponent", [-36, -12, 12, 30])
def test_any_scale(exponent: int) -> None:
    random = np.random.default_rng(4)
    vertices, triangles = grid(4, random)
    vertices = (vertices.astype(np.float64) * 10.0**exponent).astype(np.float32)
    targets = vertices[triangles].mean(axis=1)
    origins = targets + random.uniform(-3, 3, targets.shape) * 10.0**exponent
    assert judge(vertices, triangles, aim(origins, targets)) > 10


def test_mixed_scales() -> None:
    """Coordinates from 1e-20 to 1e20 in one triangle, where double alone loses everything."""
    random = np.random.default_rng(5)
    signs = random.choice([-1, 1], (90, 3))
    vertices = (signs * 10.0 ** random.uniform(-20, 20, (90, 3))).astype(np.float32)
    triangles = np.arange(90, dtype=np.uint32).reshape(-1, 3)
    origins = (10.0 ** random.uniform(-20, 20, (100, 3))).astype(np.float32)
    targets = np.resize(vertices[triangles].astype(np.float64).mean(axis=1), (100, 3))
    assert judge(vertices, triangles, aim(origins, targets)) > 10
