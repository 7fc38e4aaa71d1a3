# SPDX-License-Identifier: GPL-3.0-or-later
"""A material whose nodes a test sets up."""

from __future__ import annotations

import bpy
from blender_support import EmptySceneTest, add_cube, add_material


class MaterialTest(EmptySceneTest):
    """A cube with a material 'M', whose nodes the tests set up."""

    def setUp(self) -> None:
        super().setUp()
        self.cube = add_cube()
        self.tree = add_material("M").node_tree
        self.cube.data.materials.append(bpy.data.materials["M"])
        self.principled = self.tree.nodes["Principled BSDF"]

    def new(self, kind: str, **inputs: object) -> bpy.types.Node:
        """A new node; ``inputs`` by name, with _ for a space."""
        node = self.tree.nodes.new("ShaderNode" + kind)
        for name, value in inputs.items():
            node.inputs[name.replace("_", " ")].default_value = value
        return node

    def link(self, source: bpy.types.Node, target: bpy.types.Node, name: str | int) -> None:
        self.tree.links.new(source.outputs[0], target.inputs[name])

    def show(self, shader: bpy.types.Node) -> None:
        self.link(shader, self.tree.nodes["Material Output"], "Surface")

    def input(self, *names: str) -> bpy.types.NodeSocket:
        """The principled shader's first input of these names, which differ between versions."""
        inputs = self.principled.inputs
        return inputs[next(name for name in names if name in inputs)]

    def material(self):
        self.scene = self.extract()
        return next(material for material in self.scene.materials if material.name == "M")

    def lost(self) -> list[str]:
        """What is said about the material."""
        self.material()
        return sorted(note[: -len(": M.")] for note in self.scene.notes if note.endswith(": M."))
