# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays and pictures through Python: shapes, closed forms, equality of variants, refused input."""

from __future__ import annotations

import math
import threading
import time
from typing import Any

import numpy as np
import pytest
from bvh_lab.native import core

IDENTITY = np.eye(4)
WINDOW = (-1.0, 1.0, -0.75, 0.75)
MISS = 0xFFFFFFFF


def placed(x: float, y: float, z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def soup(count: int = 2000) -> Any:
    random = np.random.default_rng(3)
    corners = random.random((count, 1, 3)) + random.uniform(-0.1, 0.1, (count, 3, 3))
    return core.Mesh(
        corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count).reshape(count, 3)
    )


def plane() -> Any:
    corners = np.array([(-50, -50, 0), (50, -50, 0), (50, 50, 0), (-50, 50, 0)], np.float32)
    return core.Mesh(corners, [(0, 1, 2), (0, 2, 3)])


def grey_scene(mesh: Any, lights: list[Any], world: tuple[float, float, float]) -> Any:
    index = np.zeros(len(mesh.triangles), np.uint32)
    material = core.Material([core.Component(color=(0.8, 0.5, 0.2))])
    return core.Scene(mesh, [material], index, lights, core.World(world))


CAMERA = core.Camera("perspective", placed(0.5, 0.5, 3), WINDOW, 0.1)
LAMP = core.Light("point", placed(0.3, 0.6, 2), (50, 40, 30), size_x=0.1)


# --- rays ----------------------------------------------------------------------------------------


def test_camera_rays_are_row_major_from_the_top_left() -> None:
    origins, directions = core.camera_rays(core.Camera("perspective", IDENTITY, WINDOW, 0.5), 4, 3)
    assert origins.shape == directions.shape == (12, 3)
    assert origins.dtype == directions.dtype == np.float32
    x, y = np.meshgrid([-0.75, -0.25, 0.25, 0.75], [0.5, 0.0, -0.5])
    through = np.stack([x.ravel(), y.ravel(), np.full(12, -1.0)], axis=1)
    np.testing.assert_allclose(origins, 0.5 * through, atol=1e-7)
    expected = through / np.linalg.norm(through, axis=1, keepdims=True)
    np.testing.assert_allclose(directions, expected, atol=1e-7)


def test_orthographic_rays_are_parallel() -> None:
    camera = core.Camera("orthographic", placed(1, 2, 3), WINDOW, 0.5)
    origins, directions = core.camera_rays(camera, 2, 2)
    assert (directions == (0, 0, -1)).all()
    assert (origins[:, 2] == 2.5).all()
    np.testing.assert_allclose(origins[0, :2], (0.5, 2.375))


def test_samples_and_seeds_move_rays_within_their_pixel() -> None:
    camera = core.Camera("orthographic", IDENTITY, (0, 8, 0, 4))
    seen = [core.camera_rays(camera, 8, 4, sample=1, seed=seed)[0] for seed in (0, 1, 1)]
    assert not np.array_equal(seen[0], seen[1])
    np.testing.assert_array_equal(seen[1], seen[2])
    np.testing.assert_array_equal(np.floor(seen[0][:8, 0]), np.arange(8))


def test_path_rays_are_those_that_rendering_traces() -> None:
    scene = grey_scene(soup(), [LAMP], (0.1, 0.1, 0.1))
    bvh = core.build(scene.mesh, "lbvh", branching=4)
    rays = core.path_rays(bvh, scene, CAMERA, 64, 48, depth=3, shadow_rays=2, seed=2)
    expected = core.render(bvh, scene, CAMERA, 64, 48, depth=3, shadow_rays=2, seed=2).rays
    assert len(rays.primary[0]) == 64 * 48 == expected["primary"]
    assert len(rays.secondary) == 3 and len(rays.shadow) == 4
    counts = [len(origins) for origins, _ in rays.secondary]
    assert counts == sorted(counts, reverse=True) and sum(counts) == expected["secondary"]
    assert sum(len(origins) for origins, _, _ in rays.shadow) == expected["shadow"]

    hit = core.trace(bvh, *rays.primary)
    points = (rays.primary[0] + hit.t[:, None] * rays.primary[1])[hit.triangle != MISS]
    starts, towards = rays.secondary[0]
    assert starts.shape == towards.shape == (len(points), 3)
    np.testing.assert_allclose(starts, points, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(towards, axis=1), 1, atol=1e-6)
    assert core.trace(bvh, starts, towards).t.min() > 1e-6
    for _, directions, t_max in rays.shadow:
        near = t_max < 1
        np.testing.assert_allclose(np.linalg.norm(directions[~near], axis=1), 1, atol=1e-6)
        assert near.any() and np.isinf(t_max[~near]).all()
    starts, towards, t_max = rays.shadow[0]
    away = np.linalg.norm((starts + towards)[t_max < 1] - (0.3, 0.6, 2), axis=1)
    assert away.max() <= 0.1 + 1e-5


def test_path_rays_meet_embree_and_ours_alike() -> None:
    if not core.embree()["available"]:
        pytest.skip(core.embree()["reason"])
    scene = grey_scene(soup(), [], (1, 1, 1))
    bvh = core.build(scene.mesh, "lbvh")
    starts, towards, t_max = core.path_rays(bvh, scene, CAMERA, 64, 48, depth=0).shadow[0]
    ours = core.trace(bvh, starts, towards, t_max=t_max, any_hit=True).occluded
    theirs = core.EmbreeScene(scene.mesh, "medium").trace(
        starts, towards, t_max=t_max, any_hit=True
    )
    assert 0.05 < ours.mean() < 0.95
    assert (ours != theirs.occluded).sum() <= 4  # edges that single precision decides otherwise


# --- pictures ------------------------------------------------------------------------------------


def test_white_world_on_a_plane_shows_its_base_color() -> None:
    scene = grey_scene(plane(), [], (1, 1, 1))
    bvh = core.build(scene.mesh, "lbvh")
    picture = core.render(bvh, scene, CAMERA, 8, 6, samples=2, depth=1)
    assert picture.pixels.shape == (6, 8, 3) and picture.pixels.dtype == np.float32
    np.testing.assert_allclose(
        picture.pixels, np.broadcast_to((0.8, 0.5, 0.2), (6, 8, 3)), rtol=1e-6
    )
    rays = 8 * 6 * 2
    assert picture.rays == {"primary": rays, "secondary": rays, "last": 0, "shadow": 2 * rays}
    assert picture.samples == 2 and picture.passes == {}
    assert picture.seconds >= picture.trace_seconds > 0
    assert picture.trace_seconds <= sum(picture.stage_seconds.values()) <= picture.seconds


def test_point_light_follows_the_inverse_square() -> None:
    lamp = core.Light("point", placed(0.5, 0.5, 2), (50, 50, 50))
    scene = grey_scene(plane(), [lamp], (0, 0, 0))
    picture = core.render(core.build(scene.mesh, "lbvh"), scene, CAMERA, 1, 1)
    expected = np.array([0.8, 0.5, 0.2]) / math.pi * 50 / (4 * math.pi) / 4
    np.testing.assert_allclose(picture.pixels[0, 0], expected, rtol=1e-5)


def test_passes_show_what_the_camera_sees() -> None:
    scene = grey_scene(plane(), [], (1, 1, 1))
    bvh = core.build(scene.mesh, "lbvh")
    passes = core.render(bvh, scene, CAMERA, 3, 3, passes=True).passes
    assert {name: array.shape for name, array in passes.items()} == {
        "normal": (3, 3, 3),
        "depth": (3, 3),
        "albedo": (3, 3, 3),
        "node_visits": (3, 3),
        "triangle_tests": (3, 3),
    }
    assert all(array.dtype == np.float32 for array in passes.values())
    np.testing.assert_array_equal(passes["normal"][1, 1], (0, 0, 1))
    np.testing.assert_allclose(passes["albedo"][1, 1], (0.8, 0.5, 0.2))
    assert passes["depth"][1, 1] == np.float32(2.9)
    assert passes["triangle_tests"][1, 1] >= 1


def test_every_variant_gives_the_same_picture() -> None:
    sun = core.Light("sun", IDENTITY, (1, 1, 1), size_x=0.1)
    scene = grey_scene(soup(), [LAMP, sun], (0.1, 0.2, 0.3))
    pictures = [
        core.render(
            core.build(scene.mesh, builder, branching=branching),
            scene,
            CAMERA,
            40,
            30,
            samples=3,
            reorder=reorder,
            threads=threads,
        ).pixels
        for builder in ("lbvh", "sah")
        for branching in (2, 4, 8)
        for threads, reorder in ((1, False), (2, True), (0, "two_point"))
    ]
    assert pictures[0].std() > 0.01
    for other in pictures[1:]:
        np.testing.assert_array_equal(other, pictures[0])


def cancel_soon(token: Any, stage: str) -> list[float]:
    """Cancels 0.2 s after that stage began; the list receives the time."""
    called_at: list[float] = []

    def cancel() -> None:
        while token.stage != stage:
            time.sleep(0.001)
        time.sleep(0.2)
        called_at.append(time.monotonic())
        token.cancel()

    threading.Thread(target=cancel).start()
    return called_at


def test_cancel_stops_a_render_soon_and_keeps_what_it_has() -> None:
    scene = grey_scene(soup(), [LAMP], (1, 1, 1))
    bvh = core.build(scene.mesh, "lbvh")
    renderer = core.Renderer(bvh, scene, CAMERA, 256, 256)
    renderer.render(1)
    one = renderer.picture()
    token = core.Token()
    called_at = cancel_soon(token, "rendering")
    with pytest.raises(core.Cancelled):
        renderer.render(100_000, token)
    assert time.monotonic() - called_at[0] < 1.0  # 0.1 s on an idle machine
    picture = renderer.picture()
    assert picture.rays["primary"] > one.rays["primary"] == 256 * 256
    assert picture.samples == renderer.samples >= 1
    assert np.isfinite(picture.pixels).all() and (picture.pixels > 0).any(axis=2).mean() > 0.9


def test_a_renderer_adds_up_to_the_same_picture() -> None:
    scene = grey_scene(soup(), [LAMP], (1, 1, 1))
    bvh = core.build(scene.mesh, "lbvh")
    renderer = core.Renderer(bvh, scene, CAMERA, 24, 16, seed=5)
    for _ in range(3):
        renderer.render(1)
    del bvh
    at_once = core.render(core.build(scene.mesh, "sah"), scene, CAMERA, 24, 16, samples=3, seed=5)
    np.testing.assert_array_equal(renderer.picture().pixels, at_once.pixels)
    assert renderer.samples == 3


# --- refused input -------------------------------------------------------------------------------


def test_cameras_that_make_no_sense_are_refused() -> None:
    for arguments, words in (
        (("fisheye", IDENTITY, WINDOW), "unknown camera kind 'fisheye'"),
        (("perspective", np.eye(3), WINDOW), r"to_world must be numbers of shape \(4, 4\)"),
        (("perspective", 2 * IDENTITY, WINDOW), "to_world"),
        (("perspective", np.diag([2, 2, 2, 1]), WINDOW), "without scale"),
        (("perspective", np.full((4, 4), np.nan), WINDOW), "finite"),
        (("perspective", IDENTITY, (1, 1, 0, 1)), "no extent"),
        (("perspective", IDENTITY, (0, 1, 0)), "window must be numbers of shape"),
        (("perspective", IDENTITY, "wide"), "window must be numbers of shape"),
        (("perspective", IDENTITY, WINDOW, -1.0), "clip_start"),
    ):
        with pytest.raises(ValueError, match=words):
            core.Camera(*arguments)


def test_lights_that_make_no_sense_are_refused() -> None:
    for arguments, words in (
        ({"kind": "laser"}, "unknown light kind 'laser'"),
        ({"color": (1, -1, 1)}, r"color is \(1, -1, 1\)"),
        ({"color": (1, math.nan, 1)}, "finite"),
        ({"color": (1, 1)}, "color must be numbers of shape"),
        ({"size_x": -1}, "size"),
        ({"kind": "sun", "size_x": 4}, "angular diameter"),
        ({"shape": "star"}, "unknown light shape 'star'"),
        ({"spot_angle": 0}, "spot_angle"),
        ({"spot_blend": 2}, "spot_blend"),
        ({"kind": "spot", "to_world": np.diag([1, 1, 0, 1])}, "no direction"),
    ):
        with pytest.raises(ValueError, match=words):
            core.Light(**{"kind": "point", "to_world": IDENTITY, "color": (1, 1, 1), **arguments})


def test_pictures_that_make_no_sense_are_refused() -> None:
    scene = grey_scene(plane(), [], (1, 1, 1))
    bvh = core.build(scene.mesh, "lbvh")
    for change, words in (
        ({"width": 0}, "width must be 1 to 65535, not 0"),
        ({"height": -5}, "height must be 1 to 65535, not -5"),
        ({"width": 70000}, "width must be 1 to 65535"),
        ({"width": 65535, "height": 65535}, "GiB"),
        ({"samples": 0}, "samples must be 1 to"),
        ({"depth": -1}, "depth must be 0 to 1024, not -1"),
        ({"shadow_rays": 65}, "shadow_rays must be 0 to 64"),
        ({"reorder": "costa"}, "costa"),
        ({"reorder": 3}, "reorder must be"),
        ({"seed": -1}, "seed must be 0 to"),
        ({"threads": -1}, "threads must be"),
    ):
        with pytest.raises(ValueError, match=words):
            core.render(bvh, scene, CAMERA, **{"width": 4, "height": 4, **change})
    with pytest.raises(ValueError, match="different meshes"):
        core.render(core.build(plane(), "lbvh"), scene, CAMERA, 4, 4)
    with pytest.raises(ValueError, match="paths of 60000 x 60000 pixels take"):
        core.path_rays(bvh, scene, CAMERA, 60000, 60000)
    with pytest.raises(ValueError, match="sample must be 0 to"):
        core.path_rays(bvh, scene, CAMERA, 4, 4, sample=-1)
