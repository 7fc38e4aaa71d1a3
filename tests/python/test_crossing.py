# SPDX-License-Identifier: GPL-3.0-or-later
"""The measures of errors are measured: core.crossing and core.exact_tie against fractions."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from bvh_lab.native import core

Vector = tuple[Fraction, ...]


def vector(row: np.ndarray) -> Vector:
    return tuple(Fraction(float(value)) for value in row)


def minus(a: Vector, b: Vector) -> Vector:
    return tuple(x - y for x, y in zip(a, b, strict=True))


def products(x: Vector, y: Vector, z: Vector) -> list[Fraction]:
    """The six products of det(x, y, z), with their signs."""
    signs = ((0, 1, 2), 1), ((1, 2, 0), 1), ((2, 0, 1), 1), ((0, 2, 1), -1), ((2, 1, 0), -1)
    return [s * x[i] * y[j] * z[k] for (i, j, k), s in (*signs, ((1, 0, 2), -1))]


def truth(corners: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> dict[str, Fraction]:
    """t, u, v, margin and condition by fractions; empty where the determinant is 0."""
    o, d = vector(origin), vector(direction)
    a, b, c = (minus(vector(corner), o) for corner in corners)
    edges = [products(d, p, q) for p, q in ((b, c), (c, a), (a, b))]
    numerator, determinant = products(a, b, c), [x for edge in edges for x in edge]
    n, det = sum(numerator), sum(determinant)
    if det == 0:
        return {}
    w, u, v = (sum(edge) / det for edge in edges)
    result = {"t": n / det, "u": u, "v": v, "margin": min(w, u, v)}
    if n != 0:
        parts = [
            sum(map(abs, terms)) / abs(total)
            for terms, total in ((numerator, n), (determinant, det))
        ]
        result["condition"] = sum(parts)
    return result


def cases() -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Corners (N, 3, 3), origins and directions (N, 3) of some families, all float32."""
    random = np.random.default_rng(1)
    n = 150
    soup = random.normal(size=(n, 3, 3))
    share = random.random((n, 1))
    at_edge = soup[:, 0] * share + soup[:, 1] * (1 - share)
    origins = 3 * random.normal(size=(n, 3))
    whole = random.integers(-2, 3, (n, 3, 3)).astype(float)
    mixed = 10 ** random.uniform(-18, 18, (n, 5, 3)) * random.choice([-1, 1], (n, 5, 3))
    families = {
        "soup": (soup, origins, soup.mean(axis=1) - origins),
        "edges": (soup, origins, at_edge - origins),
        "far": (soup + 1e6, origins + 1e6, soup.mean(axis=1) - origins),
        "whole": (whole, random.integers(-2, 3, (n, 3)), random.integers(-1, 2, (n, 3)) * 2 + 1),
        "tiny": (soup * 1e-40, origins * 1e-40, soup.mean(axis=1) - origins),
        "mixed": (mixed[:, :3], mixed[:, 3], mixed[:, 4]),
    }
    return {name: tuple(np.asarray(a, np.float32) for a in f) for name, f in families.items()}


def near(value: float, exact: Fraction) -> bool:
    ulps = 4 * Fraction(math.ulp(float(exact)))
    return abs(Fraction(float(value)) - exact) <= ulps


@pytest.mark.parametrize("family", list(cases()))
def test_crossings_are_those_of_fractions(family: str) -> None:
    corners, origins, directions = cases()[family]
    n = len(corners)
    mesh = core.Mesh(corners.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3))
    found = core.crossing(mesh, origins, directions, np.arange(n))
    crossed = 0
    for i in range(n):
        exact = truth(corners[i], origins[i], directions[i])
        if not exact:
            assert not found.meets[i] and found.margin[i] == -math.inf
            assert math.isnan(found.t[i]) and found.condition[i] == math.inf
            continue
        crossed += 1
        assert found.meets[i] == (exact["margin"] >= 0)
        assert all(near(getattr(found, name)[i], exact[name]) for name in ("t", "u", "v")), i
        # 1 - u - v is within 4 ulp of itself, and so is the least of three such numbers.
        assert near(found.margin[i], exact["margin"])
        if "condition" in exact:
            assert found.condition[i] == pytest.approx(float(exact["condition"]), rel=1e-14)
        else:
            assert found.t[i] == 0 and found.condition[i] == math.inf
    assert crossed > n // 2
    if family == "whole":  # edges, corners, origins in the plane, triangles without area
        assert crossed < n and (found.margin == 0).any() and (found.t == 0).any()


def test_ties_are_those_of_fractions() -> None:
    """Triangles that share a corner, an edge or their plane, met there or elsewhere."""
    random = np.random.default_rng(2)
    points = random.integers(0, 3, (12, 3)).astype(np.float32)
    triangles = np.array(list(itertools.combinations(range(12), 3)), np.uint32)
    mesh = core.Mesh(points, triangles)
    n = 1500
    origins = random.integers(-2, 5, (n, 3)).astype(np.float32)
    directions = points[random.integers(0, 12, n)] - origins
    directions[(directions == 0).all(axis=1)] = (0, 0, 1)
    first, second = random.integers(0, len(triangles), (2, n))
    ties = core.exact_tie(mesh, origins, directions, first, second)
    assert ties.dtype == bool
    for i in range(n):
        exact = [
            truth(points[triangles[index]], origins[i], directions[i])
            for index in (first[i], second[i])
        ]
        expected = all(e and e["margin"] >= 0 for e in exact) and exact[0]["t"] == exact[1]["t"]
        assert ties[i] == expected, i
    assert 50 < ties.sum() < n - 50
    assert not core.exact_tie(mesh, [[0, 0, 9]], [[0, 0, 1e-9]], [0], [1])[0]


def test_a_tie_is_no_matter_of_ulps() -> None:
    """Two planes that differ by less than double can tell apart at this distance."""
    corners = np.array([[0, 0, 1], [1, 0, 1], [0, 1, 1]] * 2, np.float32)
    corners[5, 2] = 1 + 2**-23
    mesh = core.Mesh(corners, [[0, 1, 2], [3, 4, 5]])
    origin, direction = [[0, 2**-140, 0]], [[0.25, 0, 1]]
    both = [core.crossing(mesh, origin, direction, [i]) for i in (0, 1)]
    assert both[0].meets[0] and both[1].meets[0]
    assert both[0].t[0] == both[1].t[0]
    assert not core.exact_tie(mesh, origin, direction, [0], [1])[0]


@pytest.mark.parametrize(
    ("triangle", "sentence"),
    [
        ([0], r"triangle must have shape \(2,\): one triangle a ray"),
        ([0.0, 1.0], "triangle must be an array of integers"),
        ([0, 2], "ray 1: triangle is 2, but there are 2 triangles"),
        ([0, -1], "ray 1: triangle is -1"),
        (np.array([0xFFFFFFFF, 0], np.uint32), "ray 0: triangle is that of a miss"),
    ],
)
def test_bad_triangles_are_named(triangle: object, sentence: str) -> None:
    mesh = core.Mesh(np.eye(3), [[0, 1, 2], [2, 1, 0]])
    rays = np.zeros((2, 3)), np.ones((2, 3))
    with pytest.raises(ValueError, match=sentence):
        core.crossing(mesh, *rays, triangle)
    with pytest.raises(ValueError, match=sentence.replace("triangle ", "second ", 1)):
        core.exact_tie(mesh, *rays, [0, 0], triangle)


def test_crossing_takes_no_rays_and_can_be_cancelled() -> None:
    mesh = core.Mesh(np.eye(3), [[0, 1, 2]])
    none = np.zeros((0, 3))
    assert core.crossing(mesh, none, none, np.zeros(0, int)).t.shape == (0,)
    token = core.Token()
    token.cancel()
    with pytest.raises(core.Cancelled):
        core.crossing(mesh, [[0, 0, 0]], [[1, 1, 1]], [0], token=token)
