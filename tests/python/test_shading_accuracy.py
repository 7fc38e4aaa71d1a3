# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays that leave surfaces: none meets the surface it left, none gets out of a closed room, and
lamps are hidden by what is before them alone. Counted on the rays that rendering traces."""

from __future__ import annotations

import importlib.util
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bvh_lab.native import core
from hypothesis import given, settings
from hypothesis import strategies as st

MISS = 0xFFFFFFFF
SCRIPTS = Path(__file__).parents[2] / "scripts"
PLACES = [(1.0, 0.0), (1.0, 1e3), (1.0, 1e5), (1e-6, 0.0), (1e6, 1e6)]


def shading() -> Any:
    """The script that `make stability` runs, as a module."""
    spec = importlib.util.spec_from_file_location("shading", SCRIPTS / "stability_shading.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["shading"] = module  # dataclasses look it up
    spec.loader.exec_module(module)
    return module


cases = shading()
GREY = core.Material([core.Component()])


def rays_of(mesh: Any, camera: Any, side: int = 24, **scene: Any) -> tuple[Any, Any]:
    """The rays of one sample of side x side pixels, and a tree to trace them in."""
    materials = scene.pop("materials", [GREY])
    index = scene.pop("material_index", np.zeros(len(mesh.triangles), np.uint32))
    bvh = core.build(mesh, "sah", branching=2)
    described = core.Scene(mesh, materials, index, **scene)
    return core.path_rays(bvh, described, camera, side, side, depth=2, sample=1), bvh


def test_no_case_has_a_self_hit_or_a_leak() -> None:
    rows = cases.run(core, 40, 0.0)
    assert {row["case"] for row in rows} >= {"self-intersection", "closed box", "two walls",
                                              "grazing light", "terminator"}  # fmt: skip
    for row in rows:
        if "moved by 1e+07" in row["what"]:
            continue  # a box of two float steps: there is no room in it to start a ray
        assert row["rays"] > 0 and row["self_hits"] == 0 and row["leaks"] == 0, row
        if row["case"] == "grazing light":
            assert row["light_error"] < 1e-6, row


@pytest.mark.parametrize(("scale", "distance"), PLACES)
def test_lamps_and_emitters_in_a_plane_are_not_hidden_by_it(scale: float, distance: float) -> None:
    """A lamp let into the ceiling, and a ceiling that glows, light all of the floor."""
    offset = distance * np.array([1.0, 0.7, -0.4])
    floor = cases.quad(8 * scale, 8 * scale, 0.0) + offset
    ceiling = cases.quad(8 * scale, 8 * scale, 0.25 * scale)[::-1] + offset
    mesh = core.Mesh(
        np.concatenate([floor, ceiling]).astype(np.float32),
        np.concatenate([cases.QUAD, cases.QUAD + 4]).astype(np.uint32),
    )
    height = float(mesh.vertices[4, 2])
    start = offset + scale * np.array([0.1, 0.2, 0.2])
    camera = cases.looking(core, start, offset + scale * np.array([3.0, 2.0, 0.0]))
    matrix = np.eye(4)
    matrix[:3, 3] = (*(offset[:2] + 0.3 * scale), height)
    lamp = core.Light("area", matrix, (1.0,) * 3, size_x=scale, size_y=2 * scale)
    glow = core.Material([core.Component()], emission=(1, 1, 1))
    for light in (
        {"lights": [lamp]},
        {"materials": [GREY, glow], "material_index": np.array([0, 0, 1, 1], np.uint32)},
    ):
        rays, bvh = rays_of(mesh, camera, **light)
        starts, ways, t_max = rays.shadow[0]
        assert len(starts) > 500
        assert not core.trace(bvh, starts, ways, t_max=t_max, any_hit=True).occluded.any()


numbers = st.floats(-1, 1, allow_nan=False).map(lambda x: round(x, 6))
exponents = st.integers(-6, 6)


@settings(max_examples=150, deadline=None)
@given(
    corners=st.lists(st.tuples(numbers, numbers, numbers), min_size=3, max_size=3),
    squeeze=st.integers(0, 6),
    scale=exponents,
    away=st.integers(-2, 5),
    seed=st.integers(0, 2**31),
)
def test_rays_from_any_triangle_never_meet_it(
    corners: list[tuple[float, float, float]], squeeze: int, scale: int, away: int, seed: int
) -> None:
    """Slivers of aspect up to 10^6, sizes 1e-6 to 1e6, up to 10^5 sizes from the origin."""
    shape = np.array(corners) * (1.0, 1.0, 10.0**-squeeze)
    random = np.random.default_rng(seed)
    size = 10.0**scale
    placed = size * (shape @ cases.rotation(random).T + 10.0**away * random.normal(size=3))
    placed = placed.astype(np.float32)
    a, b, c = placed.astype(float)
    normal = np.cross(b - a, c - a)
    if not np.linalg.norm(normal) > 0:
        return
    mesh = core.Mesh(placed, [(0, 1, 2)])
    middle = placed.astype(float).mean(axis=0)
    back = normal / np.linalg.norm(normal)
    right = (b - a) / np.linalg.norm(b - a) if (b != a).any() else (c - a) / np.linalg.norm(c - a)
    up = np.cross(back, right)
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, up, back, middle + size * back], axis=1)
    local = (placed.astype(float) - middle) @ np.stack([right, up], axis=1)
    low, high = local.min(axis=0), local.max(axis=0)
    camera = core.Camera("orthographic", matrix, (low[0], high[0], low[1], high[1]))
    rays, bvh = rays_of(mesh, camera, 16, world=core.World((1.0,) * 3))
    for origins, directions in rays.secondary:
        if len(origins):
            assert (core.trace(bvh, origins, directions).triangle == MISS).all()
    for origins, directions, t_max in rays.shadow:
        if len(origins):
            hit = core.trace(bvh, origins, directions, t_max=t_max, any_hit=True)
            assert not hit.occluded.any()


@settings(max_examples=60, deadline=None)
@given(
    sides=st.tuples(*[st.floats(0.05, 1.0)] * 3),
    scale=exponents,
    away=st.integers(-3, 4),
    seed=st.integers(0, 2**31),
)
def test_no_ray_leaves_a_closed_room(
    sides: tuple[float, float, float], scale: int, away: int, seed: int
) -> None:
    random = np.random.default_rng(seed)
    turned = cases.rotation(random)
    corners, triangles = cases.cube()
    offset = 10.0 ** (scale + away) * random.normal(size=3) * min(sides)
    placed = (10.0**scale * corners * sides) @ turned.T + offset
    mesh = core.Mesh(placed.astype(np.float32), triangles.astype(np.uint32))
    # Into a corner, where origins could come to lie beyond another wall.
    corner = offset + 10.0**scale * turned @ np.array(sides)
    camera = cases.looking(core, offset, corner, wide=max(1e-6, 10.0 ** (away - 6)))
    sun = core.Light("sun", np.eye(4), (10.0,) * 3, size_x=0.01)
    rays, bvh = rays_of(mesh, camera, lights=[sun], world=core.World((1.0,) * 3))
    assert (core.trace(bvh, *rays.primary).triangle != MISS).all()
    for origins, directions in rays.secondary:
        assert (core.trace(bvh, origins, directions).triangle != MISS).all()
    for origins, directions, t_max in rays.shadow:
        if len(origins):
            assert core.trace(bvh, origins, directions, t_max=t_max, any_hit=True).occluded.all()


def test_walls_as_thin_as_rounding_still_hide_the_lamp_behind() -> None:
    """What is 10 micrometres before a lamp hides it, what is flush with it does not."""
    wall = cases.quad(2.0, 2.0, 0.0)
    floor = np.array([(-2, -2, 0), (2, -2, 0), (2, -2, 4), (-2, -2, 4)], float)
    mesh = core.Mesh(
        np.concatenate([wall, floor]).astype(np.float32),
        np.concatenate([cases.QUAD, cases.QUAD[:, ::-1] + 4]).astype(np.uint32),
    )
    camera = cases.looking(core, np.array([0.2, 1.0, 3.0]), np.array([0.0, -2.0, 1.0]), 0.3)
    for gap, hidden in ((1e-5, True), (0.0, False)):
        matrix = np.diag([1.0, -1.0, -1.0, 1.0])  # shines along +Z
        matrix[2, 3] = -gap
        lamp = core.Light("area", matrix, (math.pi,) * 3, size_x=1.0, size_y=1.0)
        rays, bvh = rays_of(mesh, camera, lights=[lamp])
        starts, ways, t_max = rays.shadow[0]
        assert len(starts) > 100
        occluded = core.trace(bvh, starts, ways, t_max=t_max, any_hit=True).occluded
        assert occluded.all() if hidden else not occluded.any()
