# SPDX-License-Identifier: GPL-3.0-or-later
"""Small meshes and rays of arbitrary numbers, made of bytes, and what must hold for each of them.

`tests/python/test_properties.py` lets hypothesis choose the bytes, `make stability` takes random
ones for as long as it is told to.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from stability_measure import (
    MISS,
    choices,
    disagreeing,
    precision_choices,
    ulps,
    well_conditioned,
)

Array = Any

EXAMPLE_BYTES = 320
RAYS = 6
LARGEST_COORDINATE = np.float32(1e37)  # of a mesh; larger ones are refused
LEAST = np.float32(2.0**-149)

# Numbers that meet each other: equal, opposite, neighbours, and far apart.
PALETTE = np.concatenate(
    [
        [0, -0.0, 1, -1, 0.5, -0.5, 2, 3, -3, 4, 0.1, 0.2, 0.3, 1 / 3, 0.7, 10, 100, 1000],
        [1 + 2**-23, 1 - 2**-24, 2 - 2**-23, 1000 + 2**-14, 2**24, 2**24 + 2, 1e6, -1e6],
        [2.0**-149, -(2.0**-149), 1e-40, -1e-40, 2.0**-126, 1e-38, 1e-30, 1e-20, -1e-20, 1e-10],
        [1e10, 1e18, -1e18, 1e30, 1e36, -1e36],
    ]
).astype(np.float32)
SPOILT = np.array([np.nan, np.inf, -np.inf, 3e38, -3e38, 1.1e37], np.float32)


@dataclass
class Example:
    """Arguments of core.Mesh and core.trace, some of which it must refuse; choices by number."""

    vertices: Array
    triangles: Array
    origins: Array
    directions: Array
    interval: int
    builder: int
    layout: int
    precision: int


class Reader:
    """Hands out the bytes of an example; zeros once they are used up."""

    def __init__(self, data: bytes) -> None:
        self.data, self.place = data, 0

    def bytes(self, count: int) -> Array:
        part = self.data[self.place : self.place + count]
        self.place += count
        return np.frombuffer(part + bytes(count - len(part)), np.uint8)

    def number(self, below: int) -> int:
        return int(self.bytes(1)[0]) % below

    def floats(self, count: int, style: int) -> Array:
        """Float32 numbers of a kind that ``style`` chooses."""
        if style == 0:  # any bits, but most of them in range
            bits = self.bytes(4 * count).view(np.uint32).copy()
            bits[(bits >> 23) % 256 >= 250] ^= 0x40000000
            return bits.view(np.float32)
        codes = self.bytes(count)
        if style == 1:
            return PALETTE[codes % len(PALETTE)]
        if style == 2:  # a small lattice
            return (codes % 5).astype(np.float32) - 2
        if style == 3:  # a small lattice far from the origin
            return (codes % 4).astype(np.float32) / 4 + np.float32(4e5)
        if style == 4:  # neighbours of one number
            return (np.float32(0.3).view(np.uint32) + codes % 4).astype(np.uint32).view(np.float32)
        return (codes % 16).astype(np.float32) * LEAST  # a few steps of the least float


def example_of(data: bytes) -> Example:
    """The example that the bytes stand for; every string of bytes is one."""
    reader = Reader(data)
    style = reader.number(7)
    style = style if style < 6 else 1
    spoil = reader.number(32)
    triangles, shared = 1 + reader.number(10), reader.number(2)
    interval, builder, layout, precision = (reader.number(n) for n in (6, 251, 4, 61))
    aim = reader.number(4)
    corners = 3 + triangles // 2 if shared else 3 * triangles
    indices = np.arange(3 * triangles)
    if shared:
        indices = reader.bytes(3 * triangles) % corners
    origins = reader.floats(3 * RAYS, style).reshape(RAYS, 3)
    directions = reader.floats(3 * RAYS, style if aim else 1).reshape(RAYS, 3)
    vertices = reader.floats(3 * corners, style).reshape(corners, 3)
    if spoil < 3:
        target = (vertices, origins, directions)[spoil]
        target = target.copy()
        target.flat[reader.number(target.size)] = SPOILT[reader.number(len(SPOILT))]
        vertices, origins, directions = (
            target if i == spoil else array
            for i, array in enumerate((vertices, origins, directions))
        )
    triangles = indices.reshape(-1, 3).astype(np.uint32)
    with np.errstate(all="ignore"):
        if aim == 1:  # at corners
            directions = vertices[np.arange(RAYS) % corners] - origins
        elif aim == 2:  # at middles of edges and faces
            ends = vertices[triangles[np.arange(RAYS) % len(triangles)]]
            weights = np.array([[0.5, 0.5, 0], [0.25, 0.25, 0.5], [1, 0, 0]] * RAYS, np.float32)
            directions = np.einsum("ij,ijk->ik", weights[:RAYS], ends) - origins
        elif aim == 3:  # from a corner
            origins = vertices[np.arange(RAYS) % corners]
    return Example(
        vertices, triangles, origins, directions.astype(np.float32), interval, builder, layout,
        precision,
    )  # fmt: skip


@cache
def builder_ids(core: Any) -> tuple[str, ...]:
    return tuple(entry["id"] for entry in core.builders())


def fast_params(builder: str) -> dict[str, float]:
    """Few iterations for the annealing builders."""
    return {"iterations": 20.0} if builder in ("prbvh_a", "prbvh_sa") else {}


def build(core: Any, mesh: Any, builder: str, layout: int) -> Any:
    """The mesh's tree in one of its four forms: 2-, 4-, 8-wide, and 8-wide compressed."""
    tree = core.build_tree(mesh, builder, params=fast_params(builder))
    if layout < 3:
        return tree.collapse(2 << layout)
    others = choices(core, "layout")[1:]
    return tree.collapse(8, layout=others[0]) if others else tree.collapse(8)


def refused(call: Any) -> bool:
    """Whether the call raises ValueError."""
    try:
        call()
    except ValueError as error:
        assert str(error)
        return True
    return False


def intervals(kind: int, truth: Any) -> tuple[Array, Array]:
    """(t_min, t_max) of a kind, some of them at the hits of ``truth``."""
    zero, infinity = np.zeros(RAYS, np.float32), np.full(RAYS, np.inf, np.float32)
    with np.errstate(over="ignore"):
        at = np.where(truth.occluded, truth.t, 1).astype(np.float32)
        at = np.minimum(at, np.finfo(np.float32).max)
        beyond = np.minimum(np.nextafter(at, infinity), np.finfo(np.float32).max)
    if kind == 0:
        return zero, infinity
    if kind == 1:
        return at, at
    if kind == 2:
        return zero, np.nextafter(at, zero)
    if kind == 3:
        return beyond, infinity
    if kind == 4:
        return zero, at
    return np.full(RAYS, LEAST), np.full(RAYS, np.finfo(np.float32).max)


def check(core: Any, data: bytes) -> int:
    """Raise AssertionError where something does not hold for the example; its hits, -1: refused."""
    example = example_of(data)
    bad_vertices = ~(np.abs(example.vertices[example.triangles]) <= LARGEST_COORDINATE).all()
    used_or_not = ~(np.abs(example.vertices) <= LARGEST_COORDINATE).all()
    if refused(lambda: core.Mesh(example.vertices, example.triangles)):
        assert used_or_not, "a good mesh was refused"
        return -1
    assert not bad_vertices, "a bad mesh was taken"
    mesh = core.Mesh(example.vertices, example.triangles)
    names = builder_ids(core)
    bvh = build(core, mesh, names[example.builder % len(names)], example.layout)
    bvh.validate()
    assert bvh.cost() >= 0 and np.isfinite(bvh.cost())

    rays = example.origins, example.directions
    bad_rays = not np.isfinite(rays).all() or (example.directions == 0).all(axis=1).any()
    assert refused(lambda: core.trace(bvh, *rays)) == bad_rays
    assert refused(lambda: core.brute_force(mesh, *rays)) == bad_rays
    if bad_rays:
        return -1
    rays = (*rays, *intervals(example.interval, core.brute_force(mesh, *rays)))
    hits = core.trace(bvh, *rays)
    truth = core.brute_force(mesh, *rays)
    assert np.array_equal(hits.occluded, truth.occluded), "hit or miss is not the exact answer"
    assert np.array_equal(core.trace(bvh, *rays, any_hit=True).occluded, hits.occluded)
    other = build(core, mesh, "lbvh", 0)
    assert disagreeing(core.trace(other, *rays), hits) == 0, "two trees disagree"
    check_triangles(core, mesh, rays, hits, truth)
    check_choice(core, bvh, rays, example.precision)
    return int(hits.occluded.sum())


def check_triangles(core: Any, mesh: Any, rays: Any, hits: Any, truth: Any) -> None:
    """The triangle is the nearest but for the rounding of t; t, u and v are near the exact ones."""
    assert (hits.triangle[~hits.occluded] == MISS).all()
    found = np.flatnonzero(hits.occluded)
    if not len(found):
        return
    origins, directions = rays[0][found], rays[1][found]
    answered = core.crossing(mesh, origins, directions, hits.triangle[found])
    assert answered.meets.all(), "the answered triangle is not met"
    well = well_conditioned(mesh, origins, directions, answered)
    exact = truth.t[found]
    t = hits.t[found]
    assert (t >= rays[2][found]).all() and (t <= rays[3][found]).all(), "t is not in its interval"
    assert (ulps(t, answered.t)[well] <= 4).all(), "t is off"
    nearest = core.crossing(mesh, origins, directions, truth.triangle[found])
    well &= well_conditioned(mesh, origins, directions, nearest)
    assert (ulps(answered.t, exact)[well] <= 1).all(), "a nearer triangle was passed over"
    for ours, exact_ones in ((hits.u, answered.u), (hits.v, answered.v)):
        assert (np.abs(ours[found] - exact_ones)[well] <= 2.0**-24).all(), "u or v is off"


def check_choice(core: Any, bvh: Any, rays: Any, number: int) -> None:
    """Any other precision choice may be wrong, but answers with a triangle in the interval."""
    options = precision_choices(core)[1:]
    if not options:
        return
    hits = core.trace(bvh, *rays, **options[number % len(options)].arguments())
    hit = hits.triangle != MISS
    assert np.array_equal(hit, hits.occluded)
    assert (hits.triangle[hit] < len(bvh.mesh.triangles)).all()
    assert (hits.t[hit] >= rays[2][hit]).all() and (hits.t[hit] <= rays[3][hit]).all()
    assert not np.isnan([hits.u, hits.v]).any()
