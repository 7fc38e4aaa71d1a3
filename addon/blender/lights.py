# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender lamps and world as plain lights, in Blender's units: watts, and W/m2 for a sun."""

from __future__ import annotations

import math

import bpy
import numpy as np

from ..study.scene import Light
from .cameras import without_scale
from .materials import Color, constant_color, constant_value, linked_node, node_tree
from .notes import Notes

KINDS = {"POINT": "point", "SUN": "sun", "SPOT": "spot", "AREA": "area"}
TEXTURED_WORLD = (0.5, 0.5, 0.5)


def read_lights(depsgraph: bpy.types.Depsgraph, notes: Notes) -> list[Light]:
    """Every visible lamp, instances included, that emits anything."""
    lights = []
    for instance in depsgraph.object_instances:
        obj = instance.object
        if obj.type == "LIGHT" and instance.show_self:
            if getattr(getattr(obj.data, "cycles", None), "is_portal", False):
                notes.add("left out: light portals", obj.name)
                continue
            light = read_light(obj.name, obj.data, np.array(instance.matrix_world), notes)
            if max(light.color) > 0.0:
                lights.append(light)
    return lights


def read_light(name: str, data: bpy.types.Light, matrix: np.ndarray, notes: Notes) -> Light:
    """One lamp under ``matrix`` (4, 4)."""
    size_x, size_y = _size(data, matrix)
    strength = _strength(name, data, size_x, size_y, notes)
    if data.type == "AREA" and getattr(data, "spread", math.pi) < math.pi - 1e-4:
        notes.add("approximated: area light spread ignored", name)
    return Light(
        name=name,
        kind=KINDS[data.type],
        to_world=without_scale(matrix),
        color=tuple(max(0.0, float(channel)) for channel in strength),
        size_x=size_x,
        size_y=size_y,
        shape="disk" if data.type == "AREA" and data.shape in {"DISK", "ELLIPSE"} else "rectangle",
        spot_angle=float(data.spot_size) if data.type == "SPOT" else math.pi,
        spot_blend=float(data.spot_blend) if data.type == "SPOT" else 0.0,
    )


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
    name: str, data: bpy.types.Light, size_x: float, size_y: float, notes: Notes
) -> np.ndarray:
    color = np.array(data.color[:], np.float64) * data.energy
    if data.type == "AREA" and bpy.app.version < (4, 0, 0):
        color *= (
            math.pi / 4.0
        )  # what such a lamp emitted before Blender took its watts at their word
    color *= 2.0 ** getattr(data, "exposure", 0.0)  # Blender 4.5 and later
    if getattr(data, "use_temperature", False):
        color *= np.array(data.temperature_color[:])
    if not getattr(data, "normalize", True):
        color *= _emitting_area(data, size_x, size_y)
    if data.use_nodes and data.node_tree:
        color *= _node_factor(name, data.node_tree, notes)
    return color


def _emitting_area(data: bpy.types.Light, size_x: float, size_y: float) -> float:
    """The area by which Blender divides a normalised light: m2, for a sun as cosines; 1 if none."""
    if data.type == "AREA":
        area = size_x * size_y
        return area * math.pi / 4.0 if data.shape in {"DISK", "ELLIPSE"} else area
    if data.type == "SUN":
        return math.pi * math.sin(size_x / 2.0) ** 2 or 1.0
    return 4.0 * math.pi * size_x * size_x or 1.0


def _node_factor(name: str, tree: bpy.types.NodeTree, notes: Notes) -> np.ndarray:
    """The constant emission by which a light's nodes multiply it; anything cleverer counts as 1."""
    output = tree.get_output_node("ALL") or tree.get_output_node("CYCLES")
    shader = linked_node(output.inputs["Surface"]) if output else None
    if shader is None or shader.type != "EMISSION":
        notes.add("approximated: light nodes ignored", name)
        return np.ones(3)
    color, exact = constant_color(shader.inputs["Color"])
    strength, strength_exact = constant_value(shader.inputs["Strength"])
    if not (exact and strength_exact):
        notes.add("approximated: light nodes ignored", name)
        return np.ones(3)
    return np.array(color) * strength


def read_world(world: bpy.types.World | None, notes: Notes) -> Color:
    """Constant radiance: colour times strength of the Background node, else the plain colour."""
    if world is None:
        return (0.0, 0.0, 0.0)
    tree = node_tree(world)
    if tree is None:
        return tuple(float(channel) for channel in world.color)
    output = tree.get_output_node("ALL") or tree.get_output_node("CYCLES")
    shader = linked_node(output.inputs["Surface"]) if output else None
    if shader is None:
        return (0.0, 0.0, 0.0)
    if shader.type != "BACKGROUND":
        notes.fact(
            f"approximated: the nodes of world '{world.name}' are replaced by its plain colour"
        )
        return tuple(float(channel) for channel in world.color)
    color, exact = constant_color(shader.inputs["Color"])
    strength, strength_exact = constant_value(shader.inputs["Strength"])
    if not (exact and strength_exact):
        notes.fact(
            f"approximated: the texture of world '{world.name}' is replaced by mid grey "
            "times its strength"
        )
    if not exact:
        color = TEXTURED_WORLD
    return tuple(max(0.0, channel * strength) for channel in color)
