# SPDX-License-Identifier: GPL-3.0-or-later
"""What tests of textures share: a picture, a square with a UV map, a material with both."""

from __future__ import annotations

import bpy
import numpy as np
from blender_support import EmptySceneTest, add_material, add_mesh


def picture(
    name: str, width: int, height: int, float_buffer: bool = False, opaque: bool = False
) -> bpy.types.Image:
    """A generated image of which no texel is like another, opaque in the lower left half or all."""
    image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=float_buffer)
    rows, columns = np.mgrid[0:height, 0:width]
    texels = np.ones((height, width, 4), np.float32)
    texels[:, :, 0] = (columns + 1) / width
    texels[:, :, 1] = (rows + 1) / height
    texels[:, :, 2] = ((columns + 2 * rows) % 3) / 2
    texels[:, :, 3] = opaque | (columns / width + rows / height < 0.75)
    if not float_buffer:
        texels = np.rint(texels * 255) / 255
    image.pixels.foreach_set(texels.ravel())
    image.update()
    return image


def uv_square(name: str, size: float) -> bpy.types.Object:
    """A square in the XY plane whose UV map is the unit square."""
    half = size / 2
    corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
    square = add_mesh(name, corners, [(0, 1, 2, 3)])
    layer = square.data.uv_layers.new(name="UVMap")
    for loop, uv in zip(layer.data, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
        loop.uv = uv
    return square


class TextureTest(EmptySceneTest):
    """A square with a principled material 'M'."""

    def setUp(self) -> None:
        super().setUp()
        self.square = uv_square("Square", 2.0)
        self.tree = add_material("M").node_tree
        self.square.data.materials.append(bpy.data.materials["M"])
        self.inputs = self.tree.nodes["Principled BSDF"].inputs

    def new(self, kind: str) -> bpy.types.Node:
        return self.tree.nodes.new("ShaderNode" + kind)

    def image(self, image: bpy.types.Image | None = None, to: str = "Base Color"):
        node = self.new("TexImage")
        node.image = image or picture("Test", 3, 2)
        self.tree.links.new(node.outputs[0], self.inputs[to])
        return node

    def part(self):
        self.scene = self.extract()
        material = next(material for material in self.scene.materials if material.name == "M")
        return material.components[0]

    def said(self, text: str) -> bool:
        return any(text in note for note in self.scene.notes)

    def core_scene(self):
        """The scene in the core, and what was said about missing textures."""
        from bvh_lab.native import core
        from bvh_lab.study.core_scene import core_scene

        self.scene = self.extract()
        return core_scene(core, core.Mesh(self.scene.vertices, self.scene.triangles), self.scene)
