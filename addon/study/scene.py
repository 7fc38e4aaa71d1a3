# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as plain arrays: what extraction hands to the study. No bpy in here."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

Float32Array: TypeAlias = npt.NDArray[np.float32]
Float64Array: TypeAlias = npt.NDArray[np.float64]
UInt32Array: TypeAlias = npt.NDArray[np.uint32]
Color: TypeAlias = tuple[float, float, float]  # linear RGB
Mapping: TypeAlias = tuple[tuple[float, float, float], tuple[float, float, float]]

WrapName: TypeAlias = Literal["repeat", "extend", "clip", "mirror"]
ChannelName: TypeAlias = Literal["rgb", "red", "green", "blue", "alpha", "luminance"]
ModelName: TypeAlias = Literal[
    "principled", "diffuse", "glossy", "glass", "refraction", "translucent", "transparent"
]


@dataclass
class Camera:
    """A view of the scene.

    ``to_world`` is (4, 4) float64 without scale; the camera looks along its -Z with +Y up.
    ``window`` is (left, right, bottom, top): at distance 1 for ``perspective``, in world units for
    ``orthographic``; lens shift and sensor fit are folded in. ``clip_start``, ``lens_radius`` (0:
    all is sharp) and ``focus_distance`` (along -Z) are in world units.
    """

    name: str
    kind: Literal["perspective", "orthographic"]
    to_world: Float64Array
    window: tuple[float, float, float, float]
    clip_start: float = 0.0
    lens_radius: float = 0.0
    focus_distance: float = 1.0

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
    color: Color
    size_x: float = 0.0
    size_y: float = 0.0
    shape: Literal["rectangle", "disk"] = "rectangle"
    spot_angle: float = 3.141592653589793
    spot_blend: float = 0.0


@dataclass
class Texture:
    """A picture that materials or the world look up: a file's, or ``pixels`` of its own.

    Exactly one of ``path`` and ``pixels`` is given; ``pixels`` is (H, W) or (H, W, 1, 3 or 4),
    uint8 or float32, top row first. ``srgb``: colours are encoded with the sRGB curve.
    ``closest``: texels are not interpolated.
    """

    name: str
    path: str = ""
    pixels: npt.NDArray[Any] | None = None
    srgb: bool = False
    wrap: WrapName = "repeat"
    closest: bool = False


@dataclass(frozen=True)
class Lookup:
    """A value that varies over a surface: ``offset + scale * texel(mapping @ (u, v, 1))``.

    ``texture`` indexes ``Scene.textures``; a single ``channel`` fills all three of a colour.
    """

    texture: int
    channel: ChannelName = "rgb"
    scale: Color = (1.0, 1.0, 1.0)
    offset: Color = (0.0, 0.0, 0.0)
    mapping: Mapping = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


@dataclass
class Component:
    """One way in which a material scatters; the fields mean what Blender's node of ``model`` says.

    ``specular`` is the factor of a principled coat's normal reflectance, which ``ior`` gives.
    """

    model: ModelName = "diffuse"
    weight: float | Lookup = 1.0
    color: Color | Lookup = (0.8, 0.8, 0.8)
    roughness: float | Lookup = 0.5
    metallic: float | Lookup = 0.0
    transmission: float | Lookup = 0.0
    ior: float = 1.45
    specular: float = 1.0


@dataclass
class Material:
    """What a surface does with light: the sum of at most four components, and emitted radiance."""

    name: str
    components: list[Component] = field(default_factory=lambda: [Component()])
    emission: Color | Lookup = (0.0, 0.0, 0.0)

    @property
    def emits(self) -> bool:
        """Whether it may emit light."""
        return isinstance(self.emission, Lookup) or max(self.emission) > 0.0


@dataclass
class World:
    """The background: ``color``, or the equirectangular texture of that index times ``color``.

    ``to_texture`` (3, 3) turns directions in the world into the picture's: its Z is up and its
    centre lies at +X.
    """

    color: Color = (0.0, 0.0, 0.0)
    texture: int | None = None
    to_texture: Float64Array = field(default_factory=lambda: np.eye(3))


@dataclass
class Scene:
    """Triangles in world space with what the picture needs.

    ``vertices`` (V, 3) float32, ``triangles`` (T, 3) uint32, ``material_index`` (T,) uint32 into
    ``materials``. ``uvs`` (T, 3, 2) float32 and ``normals`` (T, 3, 3) float32, unit length, belong
    to the triangles' corners; None where no material looks a texture up, or where all is flat.
    ``notes`` says, a sentence each, what was added, approximated or left out.
    """

    name: str
    vertices: Float32Array
    triangles: UInt32Array
    material_index: UInt32Array
    materials: list[Material]
    cameras: list[Camera]
    lights: list[Light]
    world: World
    geometry: Literal["viewport", "render", "mesh file"]
    textures: list[Texture] = field(default_factory=list)
    uvs: Float32Array | None = None
    normals: Float32Array | None = None
    source: str = ""
    frame: int = 0
    notes: list[str] = field(default_factory=list)

    def digest(self) -> str:
        """SHA-256 of vertices and triangles, hexadecimal: the same hash means the same geometry."""
        sha = hashlib.sha256()
        sha.update(np.ascontiguousarray(self.vertices).data)
        sha.update(np.ascontiguousarray(self.triangles).data)
        return sha.hexdigest()
