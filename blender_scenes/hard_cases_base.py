# SPDX-License-Identifier: GPL-3.0-or-later
"""What the hard cases are made of: the record of a case, shapes, and rays aimed at them.

Needs numpy alone. The same call gives the same arrays. Coordinates are computed in double and
rounded to float32 once; what is said of a case holds for the rounded numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Mesh = tuple[Array, Array]  # vertices (V, 3), triangles (T, 3)

INFINITY = np.float32(np.inf)


@dataclass
class Problem:
    """A mesh, rays, and what is known of the answers without tracing.

    ``vertices`` (V, 3) float32, ``triangles`` (T, 3) uint32, ``origins`` and ``directions`` (N, 3)
    float32, ``t_min`` and ``t_max`` () or (N,) float32, ``must_hit`` and ``must_miss`` (N,) bool.
    """

    vertices: Array
    triangles: Array
    origins: Array
    directions: Array
    t_min: Array = field(default_factory=lambda: np.float32(0))
    t_max: Array = field(default_factory=lambda: INFINITY)
    must_hit: Array = field(default_factory=lambda: np.bool_(False))
    must_miss: Array = field(default_factory=lambda: np.bool_(False))

    def __post_init__(self) -> None:
        self.vertices = np.ascontiguousarray(self.vertices, np.float32)
        self.triangles = np.ascontiguousarray(self.triangles, np.uint32)
        self.origins = np.ascontiguousarray(self.origins, np.float32)
        self.directions = np.ascontiguousarray(self.directions, np.float32)
        self.t_min, self.t_max = np.float32(self.t_min), np.float32(self.t_max)
        count = len(self.origins)
        self.must_hit = np.broadcast_to(self.must_hit, count)
        self.must_miss = np.broadcast_to(self.must_miss, count)

    def rays(self) -> tuple[Array, Array, Array, Array]:
        """The arguments of core.trace."""
        return self.origins, self.directions, self.t_min, self.t_max


@dataclass(frozen=True)
class Case:
    """A hard case. ``make(large)`` gives its problem: a second's work, or all of it.

    ``seen_in`` names ray tracers that were seen to fail it, with their versions. ``refused`` is a
    part of the sentence by which the mesh or the rays must be refused, empty where they must not.
    ``builders``: all, or those that build the large mesh in seconds.
    """

    name: str
    group: str
    tries: str
    expected: str
    make: Callable[[bool], Problem]
    seen_in: str = ""
    refused: str = ""
    builders: tuple[str, ...] = ()


# --- shapes ---------------------------------------------------------------------------------------


def sphere(rows: int, centre: Any = (0.0, 0.0, 0.0), radius: float = 1.0) -> Mesh:
    """A closed sphere of ``rows`` x 2 ``rows`` quads, the first and last row of triangles."""
    columns = 2 * rows
    theta = np.pi * np.arange(1, rows)[:, None] / rows
    phi = np.pi * np.arange(columns)[None] / rows
    rings = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi], axis=2
    )
    points = np.concatenate([[[0, 0, 1]], rings.reshape(-1, 3), [[0, 0, -1]]])
    here = 1 + np.arange(columns)
    there = 1 + (np.arange(columns) + 1) % columns
    last = len(points) - 1
    parts = [np.stack([0 * here, here, there], axis=1)]
    for row in range(rows - 2):
        a, b = here + row * columns, there + row * columns
        parts += [np.stack([a, a + columns, b + columns], axis=1)]
        parts += [np.stack([a, b + columns, b], axis=1)]
    below = (rows - 2) * columns
    parts += [np.stack([here + below, np.full_like(here, last), there + below], axis=1)]
    return np.asarray(centre) + radius * points, np.concatenate(parts)


def spindle(sides: int, length: float) -> Mesh:
    """A closed double pyramid around the z axis: a ring of radius 1, tips at +-length."""
    phi = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=1)
    i = np.arange(sides)
    above = np.stack([i, (i + 1) % sides, np.full_like(i, sides)], axis=1)
    below = np.stack([(i + 1) % sides, i, np.full_like(i, sides + 1)], axis=1)
    return np.concatenate([ring, [[0, 0, length], [0, 0, -length]]]), np.concatenate([above, below])


def box(low: Any, high: Any) -> Mesh:
    """A closed box of twelve triangles."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    low, high = np.asarray(low, float), np.asarray(high, float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return low + corners * (high - low), np.array(triangles)


def grid(columns: int, rows: int, height: Array | float = 0.0) -> Mesh:
    """A height field on the whole numbers 0 .. columns, 0 .. rows."""
    x, y = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1), indexing="ij")
    points = np.stack([x, y, np.broadcast_to(height, x.shape)], axis=2).reshape(-1, 3)
    corner = (np.arange(columns)[:, None] * (rows + 1) + np.arange(rows)).ravel()
    step = rows + 1
    first = np.stack([corner, corner + step, corner + step + 1], axis=1)
    second = np.stack([corner, corner + step + 1, corner + 1], axis=1)
    return points.astype(float), np.concatenate([first, second])


def soup(count: int, size: float, random: np.random.Generator) -> Mesh:
    """Separate triangles in the unit cube with sides of about ``size``."""
    corners = random.random((count, 1, 3)) + size * (random.random((count, 3, 3)) - 0.5)
    return corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def join(*meshes: Mesh) -> Mesh:
    """One mesh of several, in the order given."""
    firsts = np.cumsum([0] + [len(vertices) for vertices, _ in meshes[:-1]])
    vertices = np.concatenate([vertices for vertices, _ in meshes])
    parts = [triangles + first for (_, triangles), first in zip(meshes, firsts, strict=True)]
    return vertices, np.concatenate(parts)


def turned(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """The mesh turned at random about the origin."""
    q, r = np.linalg.qr(random.normal(size=(3, 3)))
    return mesh[0] @ (q * np.sign(np.diag(r))), mesh[1]


# --- rays -----------------------------------------------------------------------------------------


def targets_on(mesh: Mesh, count: int, random: np.random.Generator) -> Array:
    """Points on a mesh, a third each: corners, points of edges, points of faces."""
    vertices, triangles = np.asarray(mesh[0], np.float32).astype(float), mesh[1]
    corners = vertices[triangles[random.integers(0, len(triangles), count)]]
    weights = random.dirichlet((1, 1, 1), count)
    weights[: count // 3] = (1, 0, 0)
    weights[count // 3 : 2 * count // 3, 2] = 0
    weights /= weights.sum(axis=1, keepdims=True)
    return np.einsum("ij,ijk->ik", weights, corners)


def aimed(origins: Array, targets: Array) -> tuple[Array, Array]:
    """Float32 origins, and directions towards the targets as closely as float32 can say."""
    origins = np.asarray(origins, np.float32)
    directions = (np.asarray(targets, float) - origins.astype(float)).astype(np.float32)
    directions[(directions == 0).all(axis=1)] = (0, 0, 1)
    return origins, directions


def nudged(directions: Array, units: int, random: np.random.Generator) -> Array:
    """Each component moved by up to so many units in the last place of the longest."""
    longest = np.abs(directions).max(axis=1, keepdims=True)
    steps = random.integers(-units, units + 1, directions.shape)
    return (directions + steps * np.spacing(longest.astype(np.float32))).astype(np.float32)


def in_ball(count: int, random: np.random.Generator) -> Array:
    """Points in the unit ball."""
    points = random.normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return points * random.random((count, 1)) ** (1 / 3)


def from_inside(mesh: Mesh, centre: Any, room: float, count: int, seed: int) -> Problem:
    """Rays at corners, edges and faces of a closed surface from points inside: none may get out.

    ``room``: radius of a ball around ``centre`` that is inside, after rounding, too. A third of the
    directions are moved beside their aim by units in the last place, a third scaled to length 1.
    """
    random = np.random.default_rng(seed)
    starts = np.asarray(centre) + room * in_ball(count, random)
    origins, directions = aimed(starts, targets_on(mesh, count, random))
    order = random.permutation(count)
    beside, unit = order[: count // 3], order[count // 3 : 2 * count // 3]
    directions[beside] = nudged(directions[beside], 3, random)
    long = directions[unit].astype(float)
    directions[unit] = long / np.linalg.norm(long, axis=1, keepdims=True)
    directions[(directions == 0).all(axis=1)] = (0, 0, 1)
    return Problem(*mesh, origins, directions, must_hit=np.bool_(True))


def count_of_rays(large: bool) -> int:
    """Rays of a case."""
    return 10_000 if large else 1_000


def seen_from_around(mesh: Mesh, count: int, seed: int, far: float = 1.5) -> Problem:
    """Rays at corners, edges and faces from points around the mesh."""
    random = np.random.default_rng(seed)
    low, high = mesh[0].min(axis=0), mesh[0].max(axis=0)
    starts = (low + high) / 2 + far * (high - low).max() * random.uniform(-0.5, 0.5, (count, 3))
    return Problem(*mesh, *aimed(starts, targets_on(mesh, count, random)))
