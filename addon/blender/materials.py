# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender materials as diffuse stand-ins: constants from the sockets of the shader at the output.

Whatever a constant diffuse reflectance and emission cannot hold is named in the notes.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy

from ..study.scene import Material
from .notes import Notes

Color = tuple[float, float, float]
BLACK: Color = (0.0, 0.0, 0.0)
DEFAULT = Material("(default)")
MAX_DEPTH = 32  # nested shaders; deeper trees count as unknown

# Shaders of one colour: what a diffuse stand-in gets wrong about them, None where nothing.
COLORED_SHADERS = {
    "BSDF_DIFFUSE": None,
    "BSDF_GLOSSY": "glossy",
    "BSDF_ANISOTROPIC": "glossy",
    "BSDF_METALLIC": "metallic",
    "BSDF_GLASS": "transmission",
    "BSDF_REFRACTION": "transmission",
    "BSDF_TRANSLUCENT": "translucency",
    "BSDF_TRANSPARENT": "transparency",
    "BSDF_VELVET": "sheen",
    "BSDF_SHEEN": "sheen",
    "BSDF_TOON": "toon shading",
    "SUBSURFACE_SCATTERING": "subsurface scattering",
    "EEVEE_SPECULAR": "glossy",
}


@dataclass
class Surface:
    """What a shader comes to: reflectance, emitted radiance, and the features that are lost."""

    base: Color = BLACK
    emission: Color = BLACK
    lost: set[str] = field(default_factory=set)


def read_material(material: bpy.types.Material | None, notes: Notes) -> Material:
    """The stand-in for one material; None gives Blender's default grey."""
    if material is None:
        return DEFAULT
    tree = node_tree(material)
    if tree is None:
        return Material(material.name, _reflectance(material.diffuse_color[:3]))
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    surface = _shader(output.inputs["Surface"], 0) if output else Surface()
    for feature in sorted(surface.lost):
        notes.add(f"approximated by plain diffuse: {feature}", material.name)
    if output and output.inputs["Displacement"].is_linked:
        notes.add("left out: displacement", material.name)
    return Material(material.name, _reflectance(surface.base), _radiance(surface.emission))


def node_tree(block: bpy.types.Material | bpy.types.World) -> bpy.types.NodeTree | None:
    """The node tree in use; from Blender 5.0 on it always is, and the switch is deprecated."""
    if bpy.app.version < (5, 0, 0) and not block.use_nodes:
        return None
    return block.node_tree


def linked_node(socket: bpy.types.NodeSocket) -> bpy.types.Node | None:
    """The node that feeds ``socket``, through reroutes; None when nothing does."""
    source = linked_socket(socket)
    return source.node if source else None


def linked_socket(socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket | None:
    """The output that feeds ``socket``, through reroutes."""
    for _ in range(MAX_DEPTH):
        if not socket.is_linked or socket.links[0].is_muted:
            return None
        source = socket.links[0].from_socket
        if source.node.type != "REROUTE":
            return source
        socket = source.node.inputs[0]
    return None


def constant_color(socket: bpy.types.NodeSocket) -> tuple[Color, bool]:
    """The socket's colour, and whether that is the whole truth (no texture feeds it)."""
    node = linked_node(socket)
    if node is not None and node.type == "RGB":
        return _rgb(node.outputs[0].default_value), True
    return _rgb(socket.default_value), node is None


def constant_value(socket: bpy.types.NodeSocket) -> tuple[float, bool]:
    """The socket's number, and whether that is the whole truth."""
    node = linked_node(socket)
    if node is not None and node.type == "VALUE":
        return float(node.outputs[0].default_value), True
    return float(socket.default_value), node is None


def _shader(socket: bpy.types.NodeSocket, depth: int) -> Surface:
    """What the shader linked to ``socket`` comes to; black when nothing is linked."""
    source = linked_socket(socket)
    if source is None:
        return Surface()
    node = source.node
    if depth > MAX_DEPTH:
        return Surface(lost={"deeply nested shaders"})
    if node.type == "BSDF_PRINCIPLED":
        return _principled(node)
    if node.type == "EMISSION":
        return _emission(node.inputs["Color"], node.inputs["Strength"])
    if node.type in COLORED_SHADERS:
        return _colored(node)
    if node.type == "MIX_SHADER":
        return _mix(node, depth)
    if node.type == "ADD_SHADER":
        return _weighted(
            _shader(node.inputs[0], depth + 1), 1.0, _shader(node.inputs[1], depth + 1), 1.0
        )
    if node.type == "GROUP" and node.node_tree:
        return _group(node, source, depth)
    return Surface((0.8, 0.8, 0.8), lost={f"shader node '{node.bl_label}'"})


def _principled(node: bpy.types.Node) -> Surface:
    base, exact = constant_color(node.inputs["Base Color"])
    emission = _emission(
        _input(node, "Emission Color", "Emission"), node.inputs["Emission Strength"]
    )
    lost = emission.lost | (set() if exact else {"textured colour"})
    for feature, names, neutral in (
        ("metallic", ("Metallic",), 0.0),
        ("transmission", ("Transmission Weight", "Transmission"), 0.0),
        ("subsurface scattering", ("Subsurface Weight", "Subsurface"), 0.0),
        ("transparency", ("Alpha",), 1.0),
    ):
        value, exact = constant_value(_input(node, *names))
        if value != neutral or not exact:
            lost.add(feature)
    return Surface(base, emission.emission, lost)


def _emission(color_socket: bpy.types.NodeSocket, strength_socket: bpy.types.NodeSocket) -> Surface:
    color, color_exact = constant_color(color_socket)
    strength, strength_exact = constant_value(strength_socket)
    lost = set() if color_exact and strength_exact else {"textured emission"}
    return Surface(BLACK, _scaled(color, strength), lost)


def _colored(node: bpy.types.Node) -> Surface:
    color, exact = constant_color(_input(node, "Color", "Base Color"))
    feature = COLORED_SHADERS[node.type]
    lost = ({feature} if feature else set()) | (set() if exact else {"textured colour"})
    return Surface(color, BLACK, lost)


def _mix(node: bpy.types.Node, depth: int) -> Surface:
    factor, exact = constant_value(node.inputs[0])
    factor = min(max(factor, 0.0), 1.0)
    first, second = _shader(node.inputs[1], depth + 1), _shader(node.inputs[2], depth + 1)
    mixed = _weighted(first, 1.0 - factor, second, factor)
    if not exact:
        mixed.lost.add("textured mix of shaders")
    return mixed


def _group(node: bpy.types.Node, source: bpy.types.NodeSocket, depth: int) -> Surface:
    """Look inside the group; what its inputs feed is read as the constants inside, and said."""
    outputs = [
        inner
        for inner in node.node_tree.nodes
        if inner.type == "GROUP_OUTPUT" and inner.is_active_output
    ]
    inner = next(
        (
            socket
            for out in outputs
            for socket in out.inputs
            if socket.identifier == source.identifier
        ),
        None,
    )
    surface = _shader(inner, depth + 1) if inner else Surface((0.8, 0.8, 0.8))
    surface.lost.add(f"node group '{node.node_tree.name}'")
    return surface


def _weighted(first: Surface, weight: float, second: Surface, other: float) -> Surface:
    def mix(one: Color, two: Color) -> Color:
        return tuple(weight * a + other * b for a, b in zip(one, two, strict=True))

    return Surface(
        mix(first.base, second.base), mix(first.emission, second.emission), first.lost | second.lost
    )


def _input(node: bpy.types.Node, *names: str) -> bpy.types.NodeSocket:
    """The first input that exists: Blender 4.0 renamed several."""
    return next(node.inputs[name] for name in names if name in node.inputs)


def _rgb(value: bpy.types.bpy_prop_array) -> Color:
    return (float(value[0]), float(value[1]), float(value[2]))


def _scaled(color: Color, factor: float) -> Color:
    return (color[0] * factor, color[1] * factor, color[2] * factor)


def _reflectance(color: Color) -> Color:
    return tuple(min(max(float(channel), 0.0), 1.0) for channel in color)


def _radiance(color: Color) -> Color:
    return tuple(max(float(channel), 0.0) for channel in color)
