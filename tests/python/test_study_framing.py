# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras for scenes without one, and windows for pictures of another shape."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from bvh_lab.study.framing import auto_cameras
from bvh_lab.study.rays import fit_window
from bvh_lab.study.scene import Camera
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

coordinates = st.floats(-1e6, 1e6, width=32)


def in_window(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Points as (x, y, depth) in the window's units."""
    local = (points - camera.to_world[:3, 3]) @ camera.to_world[:3, :3]
    depth = -local[:, 2]
    return np.stack([local[:, 0] / depth, local[:, 1] / depth, depth], axis=1)


@given(arrays(np.float32, (5, 3), elements=coordinates), st.sampled_from(["y", "z"]))
def test_every_vertex_is_in_every_picture(vertices: np.ndarray, up: Literal["y", "z"]) -> None:
    cameras = auto_cameras(vertices, 3, up)
    assert [camera.name for camera in cameras] == ["auto_1", "auto_2", "auto_3"]
    for camera in cameras:
        left, right, bottom, top = camera.window
        x, y, depth = in_window(camera, vertices.astype(np.float64)).T
        assert (depth > 0).all()
        assert (x >= left).all() and (x <= right).all() and (y >= bottom).all() and (y <= top).all()


@pytest.mark.parametrize(("up", "axis"), [("y", 1), ("z", 2)])
def test_cameras_are_upright_and_look_down(up: Literal["y", "z"], axis: int) -> None:
    for camera in auto_cameras(np.eye(3, dtype=np.float32), 3, up):
        rotation = camera.to_world[:3, :3]
        assert rotation.T @ rotation == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        assert rotation[axis, 0] == pytest.approx(0.0, abs=1e-12)  # the horizon is level
        assert rotation[axis, 1] > 0.0  # up is up
        assert -rotation[axis, 2] < 0.0  # looks down


def test_pixels_stay_square() -> None:
    assert fit_window((-1.0, 1.0, -0.5, 0.5), 4.0) == (-1.0, 1.0, -0.25, 0.25)
    assert fit_window((-1.0, 1.0, 0.0, 1.0), 1.0) == (-1.0, 1.0, -0.5, 1.5)
    assert fit_window((-0.5, 0.5, -1.0, 1.0), 0.25) == (-0.25, 0.25, -1.0, 1.0)
    assert fit_window((-2.0, 2.0, -1.0, 1.0), 2.0) == (-2.0, 2.0, -1.0, 1.0)
