# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as plain arrays: what extraction hands to the study. No bpy in here."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

Float32Array = npt.NDArray[np.float32]
Float64Array = npt.NDArray[np.float64]
UInt32Array = npt.NDArray[np.uint32]


@dataclass
class Camera:
    """A view of the scene.

    ``to_world`` is (4, 4) float64 without scale; the camera looks along its -Z with +Y up.
    ``window`` is (left, right, bottom, top): at distance 1 for ``perspective``, in world units for
    ``orthographic``; lens shift and sensor fit are folded in. ``clip_start`` is in world units.
    """

    name: str
    kind: Literal["perspective", "orthographic"]
    to_world: Float64Array
    window: tuple[float, float, float, float]
    clip_start: float = 0.0

    @property
    def aspect(self) -> float:
        """Width over height of the picture that the window frames."""
        left, right, bottom, top = self.window
        return (right - left) / (top - bottom)


@dataclass
class Light:
    """A lamp in Blender's units.

    ``color`` is linear RGB times power (W; W/m2 for a sun). ``size_x`` is the radius (point,
    spot), the angular diameter in radians (sun) or the width (area); ``size_y`` the height of an
    area light.
    """

    name: str
    kind: Literal["point", "sun", "spot", "area"]
    to_world: Float64Array
    color: tuple[float, float, float]
    size_x: float = 0.0
    size_y: float = 0.0
    shape: Literal["rectangle", "disk"] = "rectangle"
    spot_angle: float = 3.141592653589793
    spot_blend: float = 0.0


@dataclass
class Material:
    """A diffuse stand-in for a material: linear RGB reflectance in [0, 1] and emitted radiance."""

    name: str
    base_color: tuple[float, float, float] = (0.8, 0.8, 0.8)
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass
class Scene:
    """Triangles in world space with what the picture needs.

    ``vertices`` (V, 3) float32, ``triangles`` (T, 3) uint32, ``material_index`` (T,) uint32 into
    ``materials``. ``notes`` says, a sentence each, what was added, approximated or left out.
    """

    name: str
    vertices: Float32Array
    triangles: UInt32Array
    material_index: UInt32Array
    materials: list[Material]
    cameras: list[Camera]
    lights: list[Light]
    world: tuple[float, float, float]
    geometry: Literal["viewport", "render", "mesh file"]
    source: str = ""
    frame: int = 0
    notes: list[str] = field(default_factory=list)

    def digest(self) -> str:
        """SHA-256 of vertices and triangles, hexadecimal: the same hash means the same geometry."""
        sha = hashlib.sha256()
        sha.update(np.ascontiguousarray(self.vertices).data)
        sha.update(np.ascontiguousarray(self.triangles).data)
        return sha.hexdigest()
