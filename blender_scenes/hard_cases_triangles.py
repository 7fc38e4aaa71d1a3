# SPDX-License-Identifier: GPL-3.0-or-later
"""Hard cases, groups 3 and 4: degenerate and coincident triangles."""

from __future__ import annotations

from functools import partial

import numpy as np
from hard_cases_base import (
    Case,
    Problem,
    aimed,
    count_of_rays,
    from_inside,
    grid,
    in_ball,
    join,
    seen_from_around,
    soup,
    sphere,
    spindle,
    targets_on,
)

DEGENERATE = "3 degenerate triangles"
COINCIDENT = "4 coincident triangles"
EXACT = "as the exact answer"
NONE_MISSES = "no ray misses"


# --- 3: degenerate --------------------------------------------------------------------------------


def no_area(large: bool) -> Problem:
    """A sphere among 1000 points and segments that count as triangles, and copies of its faces."""
    random = np.random.default_rng(301)
    closed = sphere(24 if large else 10)
    points = random.uniform(-1, 1, (1000, 3, 3))
    points[:, 2] = points[:, 1]  # segments
    points[::2, 1:] = points[::2, :1]  # points
    nothing = points.reshape(-1, 3), np.arange(3000).reshape(-1, 3)
    copies = closed[1][random.integers(0, len(closed[1]), 1000)]
    vertices, triangles = join(nothing, closed)
    repeated = triangles[-100:, [0, 0, 1]]  # the same index twice
    triangles = np.concatenate([triangles, copies + 3000, repeated])
    inside = from_inside(closed, (0, 0, 0), 0.4, count_of_rays(large), 301)
    return Problem(vertices, triangles, inside.origins, inside.directions, must_hit=True)


def collinear(large: bool) -> Problem:
    """Triangles whose corners are on one line, exactly or but for rounding, in a closed sphere."""
    random = np.random.default_rng(302)
    closed = sphere(24 if large else 10)
    start, step = random.integers(-512, 512, (2, 500, 1, 3)) / 1024
    exact = start + step * np.array([0, 0.5, 1])[:, None]
    nearly = random.normal(size=(500, 1, 3)) * 0.2
    nearly = nearly + random.normal(size=(500, 1, 3)) * random.random((500, 3, 1)) * 0.2
    points = np.concatenate([exact, nearly]).reshape(-1, 3)
    lines = points, np.arange(3000).reshape(-1, 3)
    both = join(closed, lines)
    at_sphere = from_inside(closed, (0, 0, 0), 0.4, count_of_rays(large) // 2, 302)
    starts = 0.4 * in_ball(count_of_rays(large) // 2, random)
    origins, directions = aimed(starts, targets_on(lines, len(starts), random))
    return Problem(
        *both,
        np.concatenate([at_sphere.origins, origins]),
        np.concatenate([at_sphere.directions, directions]),
        must_hit=True,
    )


def needles(large: bool) -> Problem:
    """A closed double pyramid 10^8 times as long as wide."""
    mesh = spindle(64 if large else 8, 1e8)
    random = np.random.default_rng(303)
    count = count_of_rays(large)
    starts = 0.3 * in_ball(count, random) * (1, 1, 1e8)
    origins, directions = aimed(starts, targets_on(mesh, count, random))
    return Problem(*mesh, origins, directions, must_hit=True)


def few_denormals(large: bool) -> Problem:
    """A sphere of forty times the least float."""
    least = 2.0**-149
    return from_inside(sphere(8, radius=40 * least), (0, 0, 0), 10 * least, 1000, 304)


def mixed_sizes(large: bool) -> Problem:
    """Corners of 10^-30 to 10^18 in one triangle."""
    random = np.random.default_rng(305)
    count = 300 if large else 200  # few: nearly every answer needs exact arithmetic
    size = 10 ** random.uniform(-30, 18, (3 * count, 3)) * random.choice([-1, 1], (3 * count, 3))
    mesh = size, np.arange(3 * count).reshape(-1, 3)
    rays = 300 if large else 200
    starts = 10 ** random.uniform(-30, 18, (rays, 3)) * random.choice([-1, 1], (rays, 3))
    return Problem(*mesh, *aimed(starts, targets_on(mesh, rays, random)))


def single(large: bool) -> Problem:
    mesh = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), np.array([[0, 1, 2]])
    return seen_from_around(mesh, count_of_rays(large), 306)


def spoilt(value: float, large: bool) -> Problem:
    """A sphere and ten triangles with a vertex that is no number."""
    vertices, triangles = join(sphere(10), soup(10, 0.1, np.random.default_rng(307)))
    vertices[-30::3, 1] = value
    return Problem(vertices, triangles, np.zeros((1, 3)), np.ones((1, 3)))


def empty(large: bool) -> Problem:
    return Problem(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((1, 3)), np.ones((1, 3)))


# --- 4: coincident --------------------------------------------------------------------------------


def identical(large: bool) -> Problem:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    triangles = np.broadcast_to([0, 1, 2], (100_000 if large else 10_000, 3))
    targets = np.array([[0.25, 0.25, 0], [0.5, 0.5, 0]])  # within, and on the edges of all
    origins, directions = aimed(np.full((2, 3), 0.75), targets)
    return Problem(corners, triangles, origins, directions, must_hit=True)


def coplanar(large: bool) -> Problem:
    """Overlapping triangles with whole coordinates: in z = 0, and exactly in x + y + z = 60."""
    random = np.random.default_rng(402)
    count = 1000 if large else 150
    flat = random.integers(0, 21, (2 * count, 3, 3)).astype(float)
    flat[:, :, 2] = 0
    flat[count:, :, 2] = 60 - flat[count:, :, :2].sum(axis=2)
    mesh = flat.reshape(-1, 3), np.arange(6 * count).reshape(-1, 3)
    rays = count_of_rays(large) // 2
    origins = random.integers(-20, 41, (rays, 3)) + np.array([0, 0, 100])
    targets = mesh[0][random.integers(0, len(mesh[0]), rays)]
    vertical = np.arange(rays) % 2 == 0
    origins[vertical, :2] = targets[vertical, :2]
    return Problem(*mesh, *aimed(origins, targets))


def twice(large: bool) -> Problem:
    """The same sphere twice."""
    closed = sphere(24 if large else 8)
    inside = from_inside(closed, (0, 0, 0), 0.5, count_of_rays(large), 403)
    return Problem(*join(closed, closed), inside.origins, inside.directions, must_hit=True)


def doubled(large: bool) -> Problem:
    """Each face of a sphere again, turned around."""
    vertices, triangles = sphere(24 if large else 8)
    inside = from_inside((vertices, triangles), (0, 0, 0), 0.5, count_of_rays(large), 404)
    both = np.stack([triangles, triangles[:, ::-1]], axis=1).reshape(-1, 3)
    return Problem(vertices, both, inside.origins, inside.directions, must_hit=True)


def thin_walls(large: bool) -> Problem:
    """Eight walls one float step apart at z = 1, from up to 1000 away: t cannot tell them apart."""
    random = np.random.default_rng(405)
    walls = [grid(3, 3) for _ in range(8)]
    for i, (vertices, _) in enumerate(walls):
        vertices[:, 2] = 1 + (7 - i) * 2.0**-23
    mesh = join(*walls)
    count = count_of_rays(large) // 2
    starts = random.uniform(0.1, 2.9, (count, 3))
    starts[:, 2] = -(10 ** random.uniform(-3, 3, count))
    targets = random.uniform(0.1, 2.9, (count, 3))
    targets[:, 2] = 1
    return Problem(*mesh, *aimed(starts, targets), must_hit=True)


CASES = [
    Case(
        "no_area",
        DEGENERATE,
        "a closed sphere with points, segments and duplicates as triangles",
        NONE_MISSES,
        no_area,
    ),
    Case(
        "collinear",
        DEGENERATE,
        "triangles with corners on a line, exactly or nearly, in a sphere",
        NONE_MISSES,
        collinear,
    ),
    Case("needles", DEGENERATE, "a closed surface of aspect 10^8", NONE_MISSES, needles),
    Case("few_denormals", DEGENERATE, "a sphere of 40 denormal steps", NONE_MISSES, few_denormals),
    Case(
        "mixed_sizes", DEGENERATE, "corners of 10^-30 to 10^18 in one triangle", EXACT, mixed_sizes
    ),
    Case("single", DEGENERATE, "a mesh of one triangle", EXACT, single),
    Case(
        "nan_vertex",
        DEGENERATE,
        "a vertex that is NaN",
        "refused, naming the vertex",
        partial(spoilt, np.nan),
        "madmann91/bvh v2",
        refused=r"vertex \d+ is",
    ),
    Case(
        "infinite_vertex",
        DEGENERATE,
        "a vertex at infinity",
        "refused, naming the vertex",
        partial(spoilt, np.inf),
        "tinybvh 1.6.7 (all rays miss, or a crash), madmann91/bvh v2, obvhs (CWBVH aborts)",
        refused=r"vertex \d+ is",
    ),
    Case(
        "empty",
        DEGENERATE,
        "a mesh without triangles",
        "refused in a sentence",
        empty,
        "tinybvh 1.6.7 (exits or crashes)",
        refused="no triangles",
    ),
    Case(
        "identical",
        COINCIDENT,
        "100 000 times the same triangle",
        "built in seconds, the lowest index is hit",
        identical,
        "tinybvh 1.6.7 (8-wide crashes), obvhs (hangs)",
    ),
    Case("coplanar", COINCIDENT, "overlapping triangles in one plane", EXACT, coplanar),
    Case("twice", COINCIDENT, "two meshes in the same place", NONE_MISSES, twice),
    Case("doubled", COINCIDENT, "each face twice, facing both ways", NONE_MISSES, doubled),
    Case(
        "thin_walls",
        COINCIDENT,
        "walls one float step apart, seen from afar",
        NONE_MISSES,
        thin_walls,
    ),
]
