# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender materials as components: the shader tree at the output, multiplied out.

Whatever the components cannot hold is named in the notes.
"""

from __future__ import annotations

from dataclasses import replace

import bpy

from ..study.scene import Color, Component, Lookup, Material
from .nodes import Input, linked, node_tree
from .notes import Notes
from .shaders import Part, ShaderReader, Surface
from .textures import Textures
from .value_nodes import Evaluator
from .values import Value, constant

DEFAULT = Material("(default)")
MOST_COMPONENTS = 4
LAMBERTIAN = {"diffuse", "translucent", "transparent"}


class Materials:
    """The materials of a scene in the order in which they were met; the first is the default."""

    def __init__(self, textures: Textures, notes: Notes) -> None:
        self.found: list[Material] = [DEFAULT]
        self._layers: list[str | None] = [None]
        self._numbers: dict[int, int] = {0: 0}
        self._textures, self._notes = textures, notes

    def number(self, material: bpy.types.Material | None) -> int:
        """Its number, 0 for None; it is read when met first."""
        pointer = material.original.as_pointer() if material else 0
        if pointer not in self._numbers:
            self._numbers[pointer] = len(self.found)
            read, layer = read_material(material, self._textures, self._notes)
            self.found.append(read)
            self._layers.append(layer)
        return self._numbers[pointer]

    def uv_layer(self, number: int) -> str | None:
        """The UV map that the material looks its textures up with, "" for the one that renders.

        None where it looks nothing up.
        """
        return self._layers[number]

    @property
    def any_texture(self) -> bool:
        """Whether any of them looks a texture up."""
        return any(layer is not None for layer in self._layers)


def read_material(
    material: bpy.types.Material, textures: Textures, notes: Notes
) -> tuple[Material, str | None]:
    """The material, and the UV map that it needs as in `Materials.uv_layer`."""
    reader = ShaderReader(textures)
    surface = _surface(material, reader)
    parts = _limited(_merged([_sane(part) for part in surface.parts]), reader)
    values = [value for part in parts for value in _values(part)] + [surface.emission]
    layers = {value.texel.layer: None for value in values if value.texel is not None}
    if len(layers) > 1:
        reader.lost.add("approximated: several UV maps by the first")
    read = Material(
        material.name,
        [_component(part, textures) for part in parts],
        _emission(surface.emission, reader),
    )
    for kind in sorted(reader.lost):
        notes.add(kind, material.name)
    return read, next(iter(layers), None)


def _surface(material: bpy.types.Material, reader: ShaderReader) -> Surface:
    tree = node_tree(material)
    if tree is None:
        color = tuple(float(channel) for channel in material.diffuse_color[:3])
        return Surface([Part("diffuse", color=constant(color))])
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    if output is None:
        return Surface()
    at = {socket.identifier: Input(socket) for socket in output.inputs}
    if linked(at["Displacement"]) is not None:
        reader.lost.add("left out: displacement")
    if linked(at["Volume"]) is not None:
        reader.lost.add("left out: volume")
        if linked(at["Surface"]) is None:
            return Surface([Part("transparent", color=constant(1.0))])
    return reader.surface(at["Surface"])


def _values(part: Part) -> tuple[Value, ...]:
    return (part.weight, part.color, part.roughness, part.metallic, part.transmission)


def _sane(part: Part) -> Part:
    """Constants in their range, and of the inputs only those that the model has."""
    clamped = replace(
        part,
        weight=part.weight.clamped(),
        color=part.color.clamped(),
        roughness=part.roughness.clamped(),
        metallic=part.metallic.clamped(),
        transmission=part.transmission.clamped(),
    )
    if part.model in LAMBERTIAN:
        return replace(clamped, roughness=constant(0.5))
    return clamped


def _merged(parts: list[Part]) -> list[Part]:
    """Without parts of no weight; Lambertian ones of constants come together."""
    merged: list[Part] = []
    for part in parts:
        if part.weight.is_constant(0.0):
            continue
        for index, other in enumerate(merged):
            if part.model in LAMBERTIAN and part.model == other.model and _fit(part, other):
                merged[index] = _together(part, other)
                break
        else:
            merged.append(part)
    return merged


def _fit(one: Part, two: Part) -> bool:
    constants = (one.weight, one.color, two.weight, two.color)
    if not all(value.is_constant() for value in constants):
        return False
    return one.weight.number + two.weight.number <= 1.0 + 1e-6


def _together(one: Part, two: Part) -> Part:
    whole = one.weight.number + two.weight.number
    pairs = zip(one.color.offset, two.color.offset, strict=True)
    shares = (one.weight.number / whole, two.weight.number / whole)
    color = tuple(shares[0] * a + shares[1] * b for a, b in pairs)
    return replace(one, weight=constant(min(whole, 1.0)), color=constant(color))


def _limited(parts: list[Part], reader: Evaluator) -> list[Part]:
    """At most four: the heaviest, which share the weight of those left out."""
    if len(parts) <= MOST_COMPONENTS:
        return parts
    reader.lost.add(f"approximated: {len(parts)} shaders by the heaviest {MOST_COMPONENTS}")
    kept = sorted(parts, key=lambda part: -part.weight.typical().number)[:MOST_COMPONENTS]
    kept_weight = sum(part.weight.typical().number for part in kept)
    whole = sum(part.weight.typical().number for part in parts)
    factor = whole / kept_weight if kept_weight > 0.0 else 1.0
    return [
        replace(part, weight=part.weight.times((factor,) * 3).clamped())
        for part in parts
        if part in kept
    ]


def _component(part: Part, textures: Textures) -> Component:
    return Component(
        part.model,
        _number_input(part.weight, textures),
        _color_input(part.color, textures),
        _number_input(part.roughness, textures),
        _number_input(part.metallic, textures),
        _number_input(part.transmission, textures),
        part.ior,
        part.specular,
    )


def _number_input(value: Value, textures: Textures) -> float | Lookup:
    return value.number if value.texel is None else _lookup(value, textures)


def _color_input(value: Value, textures: Textures) -> Color | Lookup:
    return value.offset if value.texel is None else _lookup(value, textures)


def _lookup(value: Value, textures: Textures) -> Lookup:
    assert value.texel is not None
    return value.lookup(textures.index(value.texel.request))


def _emission(value: Value, reader: Evaluator) -> Color | Lookup:
    """Radiance, which cannot be negative."""
    if value.texel is not None:
        return _lookup(value, reader.textures)
    if min(value.offset) < 0.0:
        reader.lost.add("left out: negative emission counts as 0")
    red, green, blue = (max(channel, 0.0) for channel in value.offset)
    return (red, green, blue)
