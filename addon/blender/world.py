# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender worlds: a constant radiance, or an environment texture."""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np

from ..study.scene import World
from . import coordinates
from .nodes import Input, Output, linked, node_tree
from .notes import Notes
from .shaders import ShaderReader
from .textures import Textures
from .unmodelled import say_world
from .values import BLACK, WHITE, Texel, Value, constant

SKY = (0.5, 0.5, 0.5)


class WorldReader(ShaderReader):
    """Reads a world, where an Environment Texture is looked up by direction."""

    def _evaluate(self, at: Input) -> tuple[Value, str]:
        found = linked(at)
        if found is not None and found.node.type == "TEX_ENVIRONMENT":
            return self._environment(found), "RGBA"
        if found is not None and found.node.type == "TEX_SKY":
            self.lost.add("approximated: sky texture by mid grey")
            return constant(SKY), "RGBA"
        if found is not None and found.node.type == "TEX_IMAGE":
            self.lost.add("approximated: image texture by mid grey")
            return constant(SKY), "RGBA"
        return super()._evaluate(at)

    def _environment(self, found: Output) -> Value:
        node = found.node
        if node.image is None:
            self.lost.add("missing texture is magenta: no image in node 'Environment Texture'")
            return constant((1.0, 0.0, 1.0))
        if node.projection != "EQUIRECTANGULAR":
            self.lost.add("approximated: mirror ball by mid grey")
            return constant(SKY)
        rotation = coordinates.world_rotation(found, self.lost)
        request = self.textures.request(node.image, interpolation=node.interpolation)
        rows = tuple(tuple(row) for row in rotation.tolist())
        return Value(BLACK, WHITE, Texel(request, bounded=not node.image.is_float, rotation=rows))


def read_world(world: bpy.types.World | None, textures: Textures, notes: Notes) -> World:
    """What the nodes at the world's output emit, or the plain colour of a world without nodes."""
    if world is None:
        return World()
    reader = WorldReader(textures)
    radiance = _radiance(world, reader)
    made = _world(radiance, reader)
    if made.texture is not None or max(made.color) > 0.0:
        say_world(world, notes)
    for kind in sorted(reader.lost):
        notes.add(kind, f"world {world.name}")
    return made


def _radiance(world: bpy.types.World, reader: WorldReader) -> Value:
    tree = node_tree(world)
    if tree is None:
        return constant(tuple(float(channel) for channel in world.color))
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    if output is None:
        return constant(BLACK)
    at = {socket.identifier: Input(socket) for socket in output.inputs}
    if linked(at["Volume"]) is not None:
        reader.lost.add("left out: volume")
    surface = reader.surface(at["Surface"])
    if surface.parts:
        reader.lost.add("left out: shaders that do not emit")
    return surface.emission


def _world(radiance: Value, reader: WorldReader) -> World:
    texel = radiance.texel
    if texel is not None and texel.channel != "rgb":
        reader.lost.add("approximated: single channel of an environment texture by its colour")
        texel = replace(texel, channel="rgb")
    if texel is not None and max(map(abs, radiance.offset)) > 0.0:
        reader.lost.add("approximated: colour added to an environment texture left out")
    color = radiance.offset if texel is None else radiance.scale
    if min(color) < 0.0:
        reader.lost.add("left out: negative emission counts as 0")
    red, green, blue = (max(channel, 0.0) for channel in color)
    if texel is None or max(red, green, blue) == 0.0:
        return World((red, green, blue))
    return World((red, green, blue), reader.textures.index(texel.request), np.array(texel.rotation))
