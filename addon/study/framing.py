# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras for a scene that has none."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import numpy.typing as npt

from .scene import Camera, Float64Array

ELEVATION = math.radians(25.0)  # of the cameras above the horizon
FIRST_AZIMUTH = math.radians(-60.0)  # from +X towards +Y; Blender's own first camera stands there
HALF_WIDTH, HALF_HEIGHT = 0.4, 0.3  # of the window at distance 1: 44 degrees wide, 4:3
MARGIN = 1.05  # distance over the tightest that shows the whole box


def auto_cameras(
    vertices: npt.NDArray[np.float32], count: int = 3, up: Literal["y", "z"] = "z"
) -> list[Camera]:
    """``count`` perspective cameras, evenly around the bounding box, each showing all of it.

    ``vertices`` is (V, 3) with V > 0; ``up`` is the axis that points up in the pictures. The
    cameras stand outside of the box, so an interior shows its outer walls.
    """
    low = vertices.min(axis=0).astype(np.float64)
    high = vertices.max(axis=0).astype(np.float64)
    turns = (FIRST_AZIMUTH + 2.0 * math.pi * i / count for i in range(count))
    return [_camera(f"auto_{i + 1}", low, high, turn, up) for i, turn in enumerate(turns)]


def _camera(
    name: str, low: Float64Array, high: Float64Array, azimuth: float, up: Literal["y", "z"]
) -> Camera:
    level = math.cos(ELEVATION)
    back = np.array(
        [level * math.cos(azimuth), level * math.sin(azimuth), math.sin(ELEVATION)]
    )  # from the box to the camera, Z up
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    axes = np.stack([right, np.cross(back, right), back], axis=1)
    if up == "y":
        axes = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]) @ axes
    to_world = np.eye(4)
    to_world[:3, :3] = axes
    to_world[:3, 3] = (low + high) / 2.0 + axes[:, 2] * _distance(low, high, axes)
    window = (-HALF_WIDTH, HALF_WIDTH, -HALF_HEIGHT, HALF_HEIGHT)
    return Camera(name, "perspective", to_world, window)


def _distance(low: Float64Array, high: Float64Array, axes: Float64Array) -> float:
    """How far from the box's centre the camera must stand to see all eight corners."""
    corners = np.array(
        [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64
    )
    right, above, back = (((corners - 0.5) * (high - low)) @ axes).T
    needed = np.maximum(np.abs(right) / HALF_WIDTH, np.abs(above) / HALF_HEIGHT) + back
    return MARGIN * float(needed.max()) or 1.0
