# SPDX-License-Identifier: GPL-3.0-or-later
"""core.render on a device: one picture from all trees, and the CPU's but for the last bits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from bvh_lab.native import core
from bvh_lab.study.core_scene import core_camera, core_scene
from opencl_support import first_device
from study_samples import sample_scene

SIZE = {"width": 48, "height": 36}


@pytest.fixture(scope="module")
def parts() -> tuple[Any, Any, Any]:
    """Mesh, core.Scene and camera."""
    scene = sample_scene()
    mesh = core.Mesh(scene.vertices, scene.triangles)
    made, _ = core_scene(core, mesh, scene)
    return mesh, made, core_camera(core, scene.cameras[0])


def test_all_trees_and_orders_give_one_picture(parts: tuple[Any, Any, Any]) -> None:
    mesh, scene, camera = parts
    pictures = set()
    for builder, branching, reorder in (("lbvh", 2, False), ("sah", 4, True), ("ploc", 8, False)):
        bvh = core.build(mesh, builder, branching)
        picture = core.render(
            bvh, scene, camera, **SIZE, samples=2, depth=3, reorder=reorder, device="opencl"
        )
        assert picture.device == first_device() and picture.samples == 2
        pictures.add(picture.pixels.tobytes())
    assert len(pictures) == 1


def test_the_picture_is_nearly_the_cpus(parts: tuple[Any, Any, Any]) -> None:
    mesh, scene, camera = parts
    bvh = core.build(mesh, "sah", 4)
    ours, theirs = (
        core.render(bvh, scene, camera, **SIZE, samples=4, depth=3, passes=True, device=device)
        for device in ("opencl", "cpu")
    )
    assert theirs.device == "cpu" and float(theirs.pixels.max()) > 0.0
    assert ours.rays == theirs.rays
    # A path that just misses an edge on one of them may hit on the other: few pixels may differ.
    near = np.isclose(ours.pixels, theirs.pixels, rtol=1e-4, atol=1e-6).all(axis=2)
    assert near.mean() > 0.99
    assert ours.pixels.mean(dtype=np.float64) == pytest.approx(
        theirs.pixels.mean(dtype=np.float64), rel=1e-3
    )
    assert set(ours.passes) == set(theirs.passes)
    assert np.allclose(ours.passes["depth"], theirs.passes["depth"], rtol=1e-5)


def test_samples_may_be_added_one_by_one(parts: tuple[Any, Any, Any]) -> None:
    mesh, scene, camera = parts
    bvh = core.build(mesh, "lbvh", 8)
    renderer = core.Renderer(bvh, scene, camera, **SIZE, depth=2, device="opencl")
    assert renderer.device == first_device()
    for _ in range(3):
        renderer.render(1)
    whole = core.render(bvh, scene, camera, **SIZE, samples=3, depth=2, device="opencl")
    assert renderer.picture().pixels.tobytes() == whole.pixels.tobytes()


def test_cancel_and_unknown_devices(parts: tuple[Any, Any, Any]) -> None:
    mesh, scene, camera = parts
    bvh, token = core.build(mesh, "lbvh"), core.Token()
    token.cancel()
    with pytest.raises(core.Cancelled):
        core.render(bvh, scene, camera, **SIZE, device="opencl", token=token)
    with pytest.raises(ValueError, match="unknown device 'gpu'; there are: cpu"):
        core.render(bvh, scene, camera, **SIZE, device="gpu")
