# SPDX-License-Identifier: GPL-3.0-or-later
"""Hard cases, groups 1 and 2: closed surfaces, here and far from the origin, small and large.

Why every ray from inside must hit: the surface is a sphere, moved by rounding by less than its
distance from the ray's origin; so it still winds around that point once, whatever has become of
single triangles, and each ray meets one of those with area or their edges.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from hard_cases_base import (
    Case,
    Problem,
    aimed,
    box,
    from_inside,
    in_ball,
    join,
    nudged,
    soup,
    sphere,
    spindle,
    targets_on,
)

WATERTIGHT = "1 watertightness"
FAR = "2 far from the origin"
NONE_MISSES = "no ray misses"


def rows_and_rays(large: bool) -> tuple[int, int]:
    return (40, 20_000) if large else (12, 1_500)


# --- 1: watertightness ----------------------------------------------------------------------------


def sphere_random(large: bool) -> Problem:
    rows, count = rows_and_rays(large)
    random = np.random.default_rng(101)
    mesh = sphere(rows)
    origins = 0.5 * in_ball(count, random)
    return Problem(*mesh, origins, random.normal(size=(count, 3)), must_hit=True)


def sphere_vertices(large: bool) -> Problem:
    """From the centre and from outside at each corner; from outside at those that face the eye."""
    rows, _ = rows_and_rays(large)
    random = np.random.default_rng(102)
    mesh = sphere(rows)
    corners = np.asarray(mesh[0], np.float32).astype(float)
    eyes = corners + 0.7 * random.normal(size=corners.shape)
    eyes *= 3 / np.linalg.norm(eyes, axis=1, keepdims=True)
    faces_eye = ((eyes / 3) * corners).sum(axis=1) > 0.6  # 53 degrees at most: well off the rim
    origins, directions = aimed(
        np.concatenate([0 * corners, eyes[faces_eye]]),
        np.concatenate([corners, corners[faces_eye]]),
    )
    return Problem(*mesh, origins, directions, must_hit=True)


def sphere_edges(large: bool, units: int = 0) -> Problem:
    """From inside at points of each edge."""
    rows, count = rows_and_rays(large)
    random = np.random.default_rng(103)
    mesh = sphere(rows)
    corners = np.asarray(mesh[0], np.float32).astype(float)[mesh[1]]
    share = random.random((len(corners), 3, 1))
    points = (share * corners + (1 - share) * np.roll(corners, 1, axis=1)).reshape(-1, 3)
    points = points[random.permutation(len(points))[:count]]
    origins, directions = aimed(0.3 * in_ball(len(points), random), points)
    if units:
        directions = nudged(directions, units, random)
    return Problem(*mesh, origins, directions, must_hit=True)


def slivers(large: bool) -> Problem:
    """A double pyramid of so many sides that each triangle is hundreds of times as long as wide."""
    mesh = spindle(6_000 if large else 600, 1.0)
    return from_inside(mesh, (0, 0, 0), 0.3, rows_and_rays(large)[1], 104)


def crumpled(large: bool) -> Problem:
    """A sphere whose corners were moved in and out at random: no two normals alike."""
    rows, count = rows_and_rays(large)
    random = np.random.default_rng(105)
    points, triangles = sphere(rows)
    points = points * random.uniform(0.7, 1.3, (len(points), 1))
    return from_inside((points, triangles), (0, 0, 0), 0.25, count, 105)


# --- 2: far from the origin, small and large ------------------------------------------------------


def moved(distance: float, large: bool) -> Problem:
    """A sphere at least two hundred float steps in radius, so that rounding leaves it closed."""
    rows, count = rows_and_rays(large)
    radius = max(1.0, 200 * float(np.spacing(np.float32(distance))))
    centre = np.float32(distance) * np.array([1, -0.75, 0.5])
    return from_inside(sphere(rows, centre, radius), centre, 0.4 * radius, count, 201)


def scaled(size: float, large: bool) -> Problem:
    # The steps of compressed nodes are 2^-126 at least: boxes of denormal size all look alike
    # there, and time is linear in the triangles.
    rows, count = rows_and_rays(large and size > 1e-37)
    return from_inside(sphere(rows, radius=size), (0, 0, 0), 0.4 * size, count, 202)


def small_in_large(room: float, place: tuple[float, ...], radius: float, large: bool) -> Problem:
    """A ball in a closed room with loose triangles; rays in the ball, to it, across the room."""
    rows, count = rows_and_rays(large)
    random = np.random.default_rng(203)
    ball = sphere(rows, place, radius)
    walls = box((-room,) * 3, (room,) * 3)
    loose, faces = soup(rows * rows, 0.1, random)
    mesh = join(ball, walls, (room * (1.6 * loose - 0.8), faces))
    third = count // 3
    inside = from_inside(ball, place, 0.3 * radius, third, 204)
    starts = room * random.uniform(-0.9, 0.9, (2 * third, 3))
    ends = np.concatenate(
        [targets_on(ball, third, random), room * random.uniform(-1, 1, (third, 3))]
    )
    origins, directions = aimed(starts, ends)
    return Problem(
        *mesh,
        np.concatenate([inside.origins, origins]),
        np.concatenate([inside.directions, directions]),
        must_hit=True,
    )


def small_triangles(large: bool) -> Problem:
    """Triangles of a millimetre and less, metres away: an epsilon in metres takes them for none."""
    rows, count = rows_and_rays(large)
    centre = np.array([1.5, -2.0, 0.75])
    return from_inside(sphere(2 * rows, centre, 0.004), centre, 0.001, count, 205)


RIVALS_FAR = "Embree 4.4.1 (fast), tinybvh 1.6.7, madmann91/bvh v2 (fast)"
RIVALS_SCALE = "Embree 4.4.1, tinybvh 1.6.7, madmann91/bvh v2, obvhs 0.3"

CASES = [
    Case(
        "sphere_random",
        WATERTIGHT,
        "random rays inside a closed sphere",
        NONE_MISSES,
        sphere_random,
        "tinybvh 1.6.7",
    ),
    Case(
        "sphere_vertices",
        WATERTIGHT,
        "rays at the corners of a closed sphere, from inside and outside",
        NONE_MISSES,
        sphere_vertices,
        "Embree 4.4.1 (also robust), tinybvh 1.6.7, madmann91/bvh v2 (also robust), obvhs",
    ),
    Case(
        "sphere_edges",
        WATERTIGHT,
        "rays at points of all edges of a closed sphere",
        NONE_MISSES,
        sphere_edges,
        "Embree 4.4.1 (fast), tinybvh 1.6.7, madmann91/bvh v2 (also robust), obvhs",
    ),
    Case(
        "beside_edges",
        WATERTIGHT,
        "the same, moved beside the edge by units in the last place",
        NONE_MISSES,
        partial(sphere_edges, units=2),
    ),
    Case("slivers", WATERTIGHT, "a closed fan of very thin triangles", NONE_MISSES, slivers),
    Case("crumpled", WATERTIGHT, "a closed, crumpled surface", NONE_MISSES, crumpled),
    *(
        Case(
            f"moved_1e{exponent}",
            FAR,
            f"a closed sphere 10^{exponent} from the origin",
            NONE_MISSES,
            partial(moved, 10.0**exponent),
            RIVALS_FAR if exponent >= 5 else "",
        )
        for exponent in range(3, 8)
    ),
    *(
        Case(
            f"scaled_1e{exponent:+d}",
            FAR,
            f"a closed sphere of radius 10^{exponent}",
            NONE_MISSES,
            partial(scaled, 10.0**exponent),
            RIVALS_SCALE if abs(exponent) == 18 else "",
        )
        for exponent in (-40, -36, -30, -18, -6, -3, 3, 6, 18, 30, 36)
    ),
    Case(
        "beyond_range",
        FAR,
        "a closed sphere of radius 10^38",
        "refused, naming the vertex",
        partial(scaled, 1e38),
        refused=r"vertex \d+ is .* at most 1e37",
    ),
    Case(
        "ball_in_stadium",
        FAR,
        "a ball of 5 cm in a hall of 300 m",
        NONE_MISSES,
        partial(small_in_large, 150.0, (31.0, -17.0, 2.0), 0.05),
    ),
    Case(
        "ball_on_planet",
        FAR,
        "a ball of 50 m in a room the size of the Earth, at its wall",
        NONE_MISSES,
        partial(small_in_large, 6.4e6, (6.3e6, -6.2e6, 6.1e6), 50.0),
    ),
    Case(
        "small_triangles",
        FAR,
        "triangles of 0.1 mm, metres from the origin",
        NONE_MISSES,
        small_triangles,
        "tinybvh 1.6.7 (absolute determinant epsilon)",
    ),
]
