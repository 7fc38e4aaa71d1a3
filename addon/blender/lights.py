# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender lamps as plain lights, in Blender's units: watts, and W/m2 for a sun."""

from __future__ import annotations

import math

import bpy
import numpy as np

from ..study.scene import Light
from .cameras import without_scale
from .nodes import Input
from .notes import Notes
from .shaders import ShaderReader
from .textures import Textures

KINDS = {"POINT": "point", "SUN": "sun", "SPOT": "spot", "AREA": "area"}
RAY_VISIBILITY = ("visible_diffuse", "visible_glossy", "visible_transmission")


def read_lights(depsgraph: bpy.types.Depsgraph, textures: Textures, notes: Notes) -> list[Light]:
    """Every visible lamp, instances included, that emits anything."""
    lights = []
    for instance in depsgraph.object_instances:
        obj = instance.object
        if obj.type == "LIGHT" and instance.show_self:
            if getattr(getattr(obj.data, "cycles", None), "is_portal", False):
                notes.add("left out: light portals", obj.name)
                continue
            _say_settings(obj, notes)
            matrix = np.array(instance.matrix_world)
            light = read_light(obj.name, obj.data, matrix, textures, notes)
            if light is not None:
                lights.append(light)
    return lights


def read_light(
    name: str, data: bpy.types.Light, matrix: np.ndarray, textures: Textures, notes: Notes
) -> Light | None:
    """One lamp under ``matrix`` (4, 4); None for one that gives no light."""
    size_x, size_y = _size(data, matrix)
    if data.type == "AREA" and not size_x * size_y > 0.0:
        notes.add("left out: area light without area", name)
        return None
    strength = _strength(name, data, size_x, size_y, textures, notes)
    if not np.isfinite(strength).all():
        notes.add("left out: light whose strength is not a finite number", name)
        return None
    if strength.min() < 0.0:
        notes.add("left out: negative light counts as 0", name)
    color = tuple(max(0.0, float(channel)) for channel in strength)
    if max(color) == 0.0:
        return None
    return Light(
        name=name,
        kind=KINDS[data.type],
        to_world=without_scale(matrix),
        color=color,
        size_x=size_x,
        size_y=size_y,
        shape="disk" if data.type == "AREA" and data.shape in {"DISK", "ELLIPSE"} else "rectangle",
        spot_angle=float(data.spot_size) if data.type == "SPOT" else math.pi,
        spot_blend=float(data.spot_blend) if data.type == "SPOT" else 0.0,
    )


def _say_settings(obj: bpy.types.Object, notes: Notes) -> None:
    """Name what the lamp has and no light of ours does."""
    data, linking = obj.data, getattr(obj, "light_linking", None)
    if data.type == "AREA" and getattr(data, "spread", math.pi) < math.pi - 1e-4:
        notes.add("approximated: area light spread ignored", obj.name)
    if data.type == "SPOT" and bpy.app.version < (4, 0, 0):
        notes.add("approximated: spot light without the cosine of older Cycles", obj.name)
    if not all(getattr(obj, name) for name in RAY_VISIBILITY):
        notes.add("approximated: ray visibility is ignored, every ray sees these", obj.name)
    if linking and (linking.receiver_collection or linking.blocker_collection):
        notes.add("approximated: light linking is ignored, these light everything", obj.name)
    casts = getattr(data, "use_shadow", True) and getattr(
        getattr(data, "cycles", None), "cast_shadow", True
    )
    if not casts:
        notes.add("approximated: light without shadows casts them", obj.name)


def _size(data: bpy.types.Light, matrix: np.ndarray) -> tuple[float, float]:
    """Radius; angular diameter; or width and height, which alone follow the object's scale."""
    if data.type == "SUN":
        return float(data.angle), 0.0
    if data.type != "AREA":
        return float(data.shadow_soft_size), 0.0
    height = data.size_y if data.shape in {"RECTANGLE", "ELLIPSE"} else data.size
    scale = np.linalg.norm(matrix[:3, :2], axis=0)
    return float(data.size * scale[0]), float(height * scale[1])


def _strength(
    name: str,
    data: bpy.types.Light,
    size_x: float,
    size_y: float,
    textures: Textures,
    notes: Notes,
) -> np.ndarray:
    color = np.array(data.color[:], np.float64) * data.energy
    if data.type == "AREA" and bpy.app.version < (4, 0, 0):
        # What such a lamp emitted before Blender took its watts at their word.
        color *= math.pi / 4.0
    color *= 2.0 ** getattr(data, "exposure", 0.0)  # Blender 4.5 and later
    if getattr(data, "use_temperature", False):
        color *= np.array(data.temperature_color[:])
    if not getattr(data, "normalize", True):
        color *= _emitting_area(data, size_x, size_y)
    if data.use_nodes and data.node_tree:
        color *= _node_factor(name, data.node_tree, textures, notes)
    return color


def _emitting_area(data: bpy.types.Light, size_x: float, size_y: float) -> float:
    """The area by which Blender divides a normalised light: m2, for a sun as cosines; 1 if none."""
    if data.type == "AREA":
        area = size_x * size_y
        return area * math.pi / 4.0 if data.shape in {"DISK", "ELLIPSE"} else area
    if data.type == "SUN":
        return math.pi * math.sin(size_x / 2.0) ** 2 or 1.0
    return 4.0 * math.pi * size_x * size_x or 1.0


def _node_factor(
    name: str, tree: bpy.types.NodeTree, textures: Textures, notes: Notes
) -> np.ndarray:
    """The emission by which a light's nodes multiply it; a texture counts as a constant."""
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    if output is None:
        return np.zeros(3)
    reader = ShaderReader(textures)
    emission = reader.surface(Input(output.inputs["Surface"])).emission
    if not emission.is_constant():
        reader.lost.add("approximated: textured light by a constant")
    for kind in sorted(reader.lost):
        notes.add(kind, name)
    return np.array(emission.typical().offset)
