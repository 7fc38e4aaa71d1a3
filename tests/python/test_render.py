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
    return core.Scene(mesh, [(0.8, 0.5, 0.2)], [(0, 0, 0)], index, lights, world)


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


def primary(scene: Any) -> tuple[Any, np.ndarray, np.ndarray, Any]:
    bvh = core.build(scene.mesh, "lbvh", branching=4)
    origins, directions = core.camera_rays(CAMERA, 64, 48)
    return bvh, origins, directions, core.trace(bvh, origins, directions)


def test_secondary_rays_start_at_hits_only() -> None:
    scene = grey_scene(soup(), [LAMP], (0, 0, 0))
    bvh, origins, directions, hit = primary(scene)
    hits = int((hit.triangle != MISS).sum())
    assert 0 < hits < len(origins)

    starts, towards, t_max = core.shadow_rays(scene, origins, directions, hit, seed=2)
    assert starts.shape == towards.shape == (hits, 3) and t_max.shape == (hits,)
    assert (t_max < 1).all() and (t_max > 0.99).all()
    away = np.linalg.norm(starts + towards - (0.3, 0.6, 2), axis=1)
    assert away.max() <= 0.1 + 1e-5
    points = origins + hit.t[:, None] * directions
    np.testing.assert_allclose(starts, points[hit.triangle != MISS], atol=1e-5)

    starts, towards = core.diffuse_rays(scene, origins, directions, hit, seed=2)
    assert starts.shape == (hits, 3)
    np.testing.assert_allclose(np.linalg.norm(towards, axis=1), 1, atol=1e-6)
    assert core.trace(bvh, starts, towards).t.min() > 1e-6


def test_secondary_rays_meet_embree_and_ours_alike() -> None:
    if not core.embree()["available"]:
        pytest.skip(core.embree()["reason"])
    scene = grey_scene(soup(), [], (1, 1, 1))
    bvh, origins, directions, hit = primary(scene)
    starts, towards, t_max = core.shadow_rays(scene, origins, directions, hit)
    assert np.isinf(t_max).all()
    ours = core.trace(bvh, starts, towards, t_max=t_max, any_hit=True).occluded
    theirs = core.EmbreeScene(scene.mesh, "medium").trace(
        starts, towards, t_max=t_max, any_hit=True
    )
    assert 0.05 < ours.mean() < 0.95
    assert (ours != theirs.occluded).sum() <= 2  # edges that single precision decides otherwise


# --- pictures ------------------------------------------------------------------------------------


def test_white_world_on_a_plane_shows_its_base_color() -> None:
    scene = grey_scene(plane(), [], (1, 1, 1))
    picture = core.render(core.build(scene.mesh, "lbvh"), scene, CAMERA, 8, 6, samples=2)
    assert picture.pixels.shape == (6, 8, 3) and picture.pixels.dtype == np.float32
    np.testing.assert_allclose(picture.pixels, np.broadcast_to((0.8, 0.5, 0.2), (6, 8, 3)))
    assert picture.rays == 8 * 6 * 2 * 2
    assert picture.seconds >= picture.trace_seconds > 0


def test_point_light_follows_the_inverse_square() -> None:
    lamp = core.Light("point", placed(0.5, 0.5, 2), (50, 50, 50))
    scene = grey_scene(plane(), [lamp], (0, 0, 0))
    picture = core.render(core.build(scene.mesh, "lbvh"), scene, CAMERA, 1, 1)
    expected = np.array([0.8, 0.5, 0.2]) / math.pi * 50 / (4 * math.pi) / 4
    np.testing.assert_allclose(picture.pixels[0, 0], expected, rtol=1e-5)


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
            threads=threads,
        ).pixels
        for builder in ("lbvh", "sah")
        for branching in (2, 4, 8)
        for threads in (1, 2)
    ]
    assert pictures[0].std() > 0.01
    for other in pictures[1:]:
        np.testing.assert_array_equal(other, pictures[0])


def test_cancel_stops_a_render_soon() -> None:
    scene = grey_scene(soup(), [LAMP], (1, 1, 1))
    bvh = core.build(scene.mesh, "lbvh")
    token = core.Token()
    called_at: list[float] = []

    def cancel() -> None:
        while token.stage != "rendering":
            time.sleep(0.001)
        time.sleep(0.2)
        called_at.append(time.monotonic())
        token.cancel()

    canceller = threading.Thread(target=cancel)
    canceller.start()
    with pytest.raises(core.Cancelled):
        core.render(bvh, scene, CAMERA, 1024, 1024, samples=1024, token=token)
    took = time.monotonic() - called_at[0]
    canceller.join()
    assert took < 1.0  # 0.1 s on an idle machine


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


def test_scenes_that_make_no_sense_are_refused() -> None:
    mesh = plane()
    good = {
        "base_color": [(0.8, 0.8, 0.8)],
        "emission": [(0, 0, 0)],
        "material_index": np.zeros(2, np.uint32),
        "lights": [],
        "world": (0, 0, 0),
    }
    core.Scene(mesh, **good)
    for change, words in (
        ({"base_color": [(2, 0, 0)]}, "material 0 has base_color"),
        ({"base_color": np.zeros((0, 3)), "emission": np.zeros((0, 3))}, "at least one material"),
        ({"emission": [(0, math.inf, 0)]}, "material 0 has emission"),
        ({"emission": np.zeros((2, 3))}, r"emission must have shape \(1, 3\)"),
        ({"material_index": np.array([0, 1])}, "triangle 1 has material 1"),
        ({"material_index": np.array([-1, 0])}, "triangle 0 has material -1"),
        ({"material_index": np.zeros(3, int)}, "3 entries for 2 triangles"),
        ({"material_index": np.zeros(2)}, "material_index must be integers"),
        ({"world": (0, 0, -1)}, "world"),
        ({"world": None}, "world must be numbers"),
    ):
        with pytest.raises(ValueError, match=words):
            core.Scene(mesh, **{**good, **change})


def test_pictures_that_make_no_sense_are_refused() -> None:
    scene = grey_scene(plane(), [], (1, 1, 1))
    bvh = core.build(scene.mesh, "lbvh")
    for change, words in (
        ({"width": 0}, "width must be 1 to 65535, not 0"),
        ({"height": -5}, "height must be 1 to 65535, not -5"),
        ({"width": 70000}, "width must be 1 to 65535"),
        ({"width": 65535, "height": 65535}, "GiB"),
        ({"samples": 0}, "samples must be 1 to"),
        ({"seed": -1}, "seed must be 0 to"),
        ({"threads": -1}, "threads must be"),
    ):
        with pytest.raises(ValueError, match=words):
            core.render(bvh, scene, CAMERA, **{"width": 4, "height": 4, **change})
    with pytest.raises(ValueError, match="different meshes"):
        core.render(core.build(plane(), "lbvh"), scene, CAMERA, 4, 4)


def test_hits_that_do_not_fit_are_refused() -> None:
    scene = grey_scene(soup(), [], (1, 1, 1))
    bvh, origins, directions, hit = primary(scene)
    with pytest.raises(ValueError, match="answers for 10 rays"):
        core.diffuse_rays(scene, origins[:10], directions[:10], hit)
    with pytest.raises(ValueError, match="closest-hit"):
        shadow = core.trace(bvh, origins, directions, any_hit=True)
        core.diffuse_rays(scene, origins, directions, shadow)
    with pytest.raises(ValueError, match="but the scene has only 2"):
        core.shadow_rays(grey_scene(plane(), [], (1, 1, 1)), origins, directions, hit)
