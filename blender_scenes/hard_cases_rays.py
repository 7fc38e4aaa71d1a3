# SPDX-License-Identifier: GPL-3.0-or-later
"""Hard cases, group 5: rays whose origins, directions or intervals are special numbers."""

from __future__ import annotations

from functools import partial

import numpy as np
from hard_cases_base import (
    INFINITY,
    Array,
    Case,
    Problem,
    aimed,
    box,
    from_inside,
    grid,
    in_ball,
    sphere,
    targets_on,
)

RAYS = "5 rays"
EXACT = "as the exact answer"
NONE_MISSES = "no ray misses"
LEAST = 2.0**-149  # the least float


def side_of(large: bool) -> int:
    return 64 if large else 24


def signed_zeros(count: int) -> Array:
    """0 and -0 by turns."""
    return np.where(np.arange(count) % 2 == 0, 0.0, -0.0)


def flat_grid(large: bool) -> Problem:
    """Straight down on the corners of a grid in z = 0."""
    side = side_of(large)
    mesh = grid(side, side)
    origins = mesh[0] + (0, 0, 7.5)
    directions = np.zeros_like(origins)
    directions[:, 0] = signed_zeros(len(origins))
    directions[:, 1] = -signed_zeros(len(origins))[::-1]
    directions[:, 2] = -1
    return Problem(*mesh, origins, directions, must_hit=True)


def in_box_planes(large: bool) -> Problem:
    """In the planes y = whole number, that of boxes' faces, at 45 degrees onto a grid in z = 0."""
    side = side_of(large)
    mesh = grid(side, side)
    random = np.random.default_rng(502)
    count = 20 * side
    height = random.integers(1, 9, count)
    x = random.integers(0, 4 * side + 1, count) / 4
    origins = np.stack([x - height, random.integers(0, side + 1, count), height], axis=1)
    directions = np.stack([np.ones(count), signed_zeros(count), -np.ones(count)], axis=1)
    return Problem(*mesh, origins, directions, must_hit=True)


def height_field(large: bool) -> Problem:
    """Straight down on corners and edges of a height field of whole numbers."""
    side = side_of(large)
    random = np.random.default_rng(503)
    mesh = grid(side, side, random.integers(0, 4, (side + 1, side + 1)))
    x, y = np.meshgrid(np.arange(2 * side + 1) / 2, np.arange(2 * side + 1) / 2)
    origins = np.stack([x.ravel(), y.ravel(), np.full(x.size, 100.0)], axis=1)
    directions = np.broadcast_to([0.0, -0.0, -1.0], origins.shape)
    return Problem(*mesh, origins, directions, must_hit=True)


def axis_rays(large: bool) -> Problem:
    """Along the axes inside a sphere, other components 0, -0 or denormal."""
    random = np.random.default_rng(504)
    count = 8_000 if large else 1_200
    directions = random.choice([0.0, -0.0, LEAST, -LEAST, 1e-40, -1e-38], (count, 3))
    directions[np.arange(count), random.integers(0, 3, count)] = random.choice([-1, 1], count)
    origins = np.round(0.5 * in_ball(count, random) * 16) / 16
    return Problem(*sphere(16), origins, directions, must_hit=True)


def denormal_directions(large: bool) -> Problem:
    """Directions of denormals alone, in a sphere so small that t is finite."""
    random = np.random.default_rng(505)
    count = 8_000 if large else 1_200
    directions = LEAST * random.integers(-40, 41, (count, 3))
    directions[(directions == 0).all(axis=1)] = (0, -LEAST, 0)
    origins = 1e-9 * in_ball(count, random)
    return Problem(*sphere(16, radius=2e-9), origins, directions, must_hit=True)


def lengths(large: bool) -> Problem:
    """Directions of lengths 1e-37 to 1e38 in a sphere."""
    problem = from_inside(sphere(16), (0, 0, 0), 0.5, 8_000 if large else 1_200, 506)
    random = np.random.default_rng(506)
    unit = problem.directions.astype(float)
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    lengths = 10 ** random.uniform(-37, 38, (len(unit), 1))
    problem.directions = (unit * lengths).astype(np.float32)
    return problem


def overflowing_t(large: bool) -> Problem:
    """Hits at a t beyond the largest float: there is a hit, and its t is infinite."""
    problem = from_inside(sphere(12, radius=1e6), (0, 0, 0), 4e5, 600, 507)
    unit = problem.directions.astype(float)
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    problem.directions = (unit * 1e-36).astype(np.float32)
    return problem


def on_the_surface(large: bool) -> Problem:
    """Origins on corners, edges and faces of a closed box of whole numbers: t = 0 is a hit.

    A ray within the face it starts on does not meet that face, but the next one at its edge.
    """
    random = np.random.default_rng(508)
    mesh = box((0, 0, 0), (8, 4, 2))
    count = 8_000 if large else 1_200
    origins = np.round(random.uniform((0, 0, 0), (8, 4, 2), (count, 3)) * 4) / 4
    axis = random.integers(0, 3, count)
    face = random.integers(0, 2, count) * np.array([8, 4, 2])[axis]
    origins[np.arange(count), axis] = face
    directions = np.where(
        np.arange(count)[:, None] % 2 == 0,
        random.normal(size=(count, 3)),
        random.integers(-2, 3, (count, 3)),
    )
    directions[(directions == 0).all(axis=1)] = (1, 0, 0)
    return Problem(*mesh, origins, directions, must_hit=True)


def from_vertices(large: bool) -> Problem:
    """From a corner of a sphere to other corners: the start is a hit, at t = 0; and past it."""
    random = np.random.default_rng(509)
    mesh = sphere(24 if large else 10)
    corners = np.asarray(mesh[0], np.float32)
    count = 8_000 if large else 1_200
    ends = random.integers(0, len(corners), (2, count))
    ends = ends[:, ends[0] != ends[1]]
    first = np.arange(ends.shape[1]) % 2 == 0
    rays = aimed(corners[ends[0]], corners[ends[1]])
    return Problem(*mesh, *rays, t_min=np.where(first, 0, 0.25), must_hit=first)


def one_point(large: bool) -> Problem:
    """t_min = t_max: exactly at the hit, and one float step before and behind it."""
    random = np.random.default_rng(510)
    side = side_of(large)
    mesh = grid(side, side)
    count = 8_000 if large else 1_200
    origins = random.uniform(0.01, side - 0.01, (count, 3))
    origins[:, 2] = random.integers(1, 4096, count) / 64
    speed = 2.0 ** random.integers(-20, 20, count)
    directions = np.stack([signed_zeros(count), signed_zeros(count), -speed], axis=1)
    t = (origins[:, 2] / speed).astype(np.float32)  # exact
    kind = np.arange(count) % 3
    t[kind == 1] = np.nextafter(t[kind == 1], np.float32(0))
    t[kind == 2] = np.nextafter(t[kind == 2], INFINITY)
    return Problem(
        *mesh, origins, directions, t_min=t, t_max=t, must_hit=kind == 0, must_miss=kind != 0
    )


def interval_ends(large: bool) -> Problem:
    """Intervals that end within four float steps of the hit, on either side, t_max or t_min."""
    random = np.random.default_rng(511)
    side = side_of(large)
    mesh = grid(side, side)
    count = 8_000 if large else 1_200
    starts = random.uniform(0.1, side - 0.1, (count, 3))
    ends = random.uniform(0.1, side - 0.1, (count, 3))
    starts[:, 2], ends[:, 2] = random.uniform(0.1, 90, count), random.uniform(-0.5, 0, count)
    origins, directions = aimed(starts, ends)
    fall, height = -directions[:, 2].astype(float), origins[:, 2].astype(float)
    t = (height / fall).astype(np.float32)
    t += (random.integers(-4, 5, count) * np.spacing(t)).astype(np.float32)
    beyond = t.astype(float) * fall - height  # t times the fall has 48 bits: exact
    first = np.arange(count) % 2 == 0
    return Problem(
        *mesh,
        origins,
        directions,
        t_min=np.where(first, 0, t),
        t_max=np.where(first, t, INFINITY),
        must_hit=np.where(first, beyond >= 0, beyond <= 0),
        must_miss=np.where(first, beyond < 0, beyond > 0),
    )


def largest_t_max(large: bool) -> Problem:
    """t_max infinite, the largest float, and 0 from a point on the surface."""
    problem = on_the_surface(large)
    count = len(problem.origins)
    largest = np.finfo(np.float32).max
    rows = np.arange(count) % 3
    problem.t_max = np.choose(rows, [INFINITY, largest, np.float32(0)]).astype(np.float32)
    problem.must_hit = rows < 2
    return problem


def outward(large: bool) -> Problem:
    """Origins one float step outside a box, rays away from it or within that plane: all miss."""
    random = np.random.default_rng(513)
    low, high = np.array([1.0, -2.0, 0.5]), np.array([3.0, 5.0, 4.0])
    count = 8_000 if large else 1_200
    rows = np.arange(count)
    origins = random.uniform(low, high, (count, 3)).astype(np.float32)
    directions = random.normal(size=(count, 3))
    axis, up = random.integers(0, 3, count), random.integers(0, 2, count)
    face = np.where(up == 1, high[axis], low[axis]).astype(np.float32)
    origins[rows, axis] = np.nextafter(face, np.where(up == 1, INFINITY, -INFINITY))
    away = np.abs(directions[rows, axis]) * random.integers(0, 2, count)
    directions[rows, axis] = np.where(up == 1, away, -away)
    mesh = box(low, high)
    return Problem(*mesh, origins, directions, must_miss=True)


def bad(kind: str, large: bool) -> Problem:
    """One ray among good ones that is no ray."""
    mesh = box((-1, -1, -1), (1, 1, 1))
    random = np.random.default_rng(514)
    origins, directions = aimed(np.zeros((9, 3)), targets_on(mesh, 9, random))
    problem = Problem(*mesh, origins, directions)
    if kind == "zero":
        problem.directions[4] = 0
    elif kind == "origin":
        problem.origins[4, 1] = np.inf
    else:
        problem.directions[4, 2] = float(kind)
    return problem


FAST_MISSES = "madmann91/bvh v2 (fast: nearly all miss)"

CASES = [
    Case(
        "flat_grid",
        RAYS,
        "axis-parallel rays with 0 and -0 onto the corners of an axis-parallel grid",
        NONE_MISSES,
        flat_grid,
        FAST_MISSES + ", obvhs (CWBVH: half)",
    ),
    Case(
        "in_box_planes",
        RAYS,
        "rays within the planes of boxes' faces",
        NONE_MISSES,
        in_box_planes,
        FAST_MISSES,
    ),
    Case(
        "height_field",
        RAYS,
        "vertical rays onto corners and edges of a height field of whole numbers",
        NONE_MISSES,
        height_field,
        FAST_MISSES,
    ),
    Case("axis_rays", RAYS, "axis-parallel but for 0, -0 and denormals", NONE_MISSES, axis_rays),
    Case(
        "denormal_directions",
        RAYS,
        "directions of denormals alone",
        NONE_MISSES,
        denormal_directions,
    ),
    Case("lengths", RAYS, "directions of lengths 10^-37 to 10^38", NONE_MISSES, lengths),
    Case(
        "overflowing_t",
        RAYS,
        "hits at a t beyond the largest float",
        "no ray misses, t is infinite",
        overflowing_t,
    ),
    Case(
        "on_the_surface",
        RAYS,
        "origins on faces, edges and corners of a box",
        "no ray misses; t = 0 where the start is met",
        on_the_surface,
    ),
    Case("from_vertices", RAYS, "from corner to corner of a sphere", EXACT, from_vertices),
    Case(
        "one_point",
        RAYS,
        "t_min = t_max at the hit and one float step beside it",
        "a hit there, a miss beside it",
        one_point,
    ),
    Case(
        "interval_ends",
        RAYS,
        "t_min or t_max within four float steps of the hit",
        EXACT,
        interval_ends,
    ),
    Case(
        "largest_t_max",
        RAYS,
        "t_max infinite, the largest float, or 0",
        NONE_MISSES,
        largest_t_max,
    ),
    Case("outward", RAYS, "one float step outside a box, and away", "every ray misses", outward),
    *(
        Case(
            f"{name}_ray",
            RAYS,
            f"a ray with {what}",
            "refused, naming the ray",
            partial(bad, kind),
            "tinybvh 1.6.7 (exits), Debian's Embree 3.13.5 (aborts)" if kind == "nan" else "",
            refused="ray 4",
        )
        for name, kind, what in (
            ("nan", "nan", "a NaN in its direction"),
            ("infinite", "inf", "an infinite direction"),
            ("zero", "zero", "a zero direction"),
            ("nowhere", "origin", "an infinite origin"),
        )
    ),
]
