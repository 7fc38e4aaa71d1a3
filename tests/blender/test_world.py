# SPDX-License-Identifier: GPL-3.0-or-later
"""Worlds: a constant radiance, or an environment texture and how it is turned."""

from __future__ import annotations

import math
import unittest

import bpy
import numpy as np
from blender_support import EmptySceneTest, add_cube, add_light, use_nodes


class Worlds(EmptySceneTest):
    def setUp(self) -> None:
        super().setUp()
        add_cube()

    def world(self) -> bpy.types.NodeTree:
        world = bpy.data.worlds.new("World")
        use_nodes(world)
        bpy.context.scene.world = world
        add_light("POINT").data.energy = 1
        return world.node_tree

    def environment(self) -> tuple[bpy.types.NodeTree, bpy.types.Node]:
        """A world with a picture of 4 x 2 in it."""
        tree = self.world()
        node = tree.nodes.new("ShaderNodeTexEnvironment")
        node.image = bpy.data.images.new("Sky", 4, 2, float_buffer=True)
        tree.links.new(node.outputs[0], tree.nodes["Background"].inputs["Color"])
        return tree, node

    def mapping(self, tree: bpy.types.NodeTree, node: bpy.types.Node) -> bpy.types.Node:
        coordinates, mapping = (
            tree.nodes.new("ShaderNodeTexCoord"),
            tree.nodes.new("ShaderNodeMapping"),
        )
        tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs[0], node.inputs["Vector"])
        return mapping

    def test_background_node(self) -> None:
        background = self.world().nodes["Background"]
        background.inputs["Color"].default_value, background.inputs["Strength"].default_value = (
            (0.5, 0.25, 1, 1),
            2,
        )
        world = self.extract().world
        self.assertEqual((world.color, world.texture), ((1.0, 0.5, 2.0), None))

    def test_mixed_backgrounds(self) -> None:
        tree = self.world()
        mix, other = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBackground")
        mix.inputs[0].default_value = 0.25
        tree.nodes["Background"].inputs["Color"].default_value = (1, 0, 0, 1)
        other.inputs["Color"].default_value = (0, 1, 0, 1)
        tree.links.new(tree.nodes["Background"].outputs[0], mix.inputs[1])
        tree.links.new(other.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], tree.nodes["World Output"].inputs["Surface"])
        self.assertEqual(self.extract().world.color, (0.75, 0.25, 0.0))

    def test_environment_texture(self) -> None:
        tree, _ = self.environment()
        tree.nodes["Background"].inputs["Strength"].default_value = 3
        scene = self.extract()
        self.assertEqual((scene.world.color, scene.world.texture), ((3.0, 3.0, 3.0), 0))
        np.testing.assert_array_equal(scene.world.to_texture, np.eye(3))
        self.assertEqual(scene.textures[0].pixels.shape, (2, 4, 4))
        self.assertIsNone(scene.uvs)
        self.assertIn("Modelled: environment texture, lamps.", scene.notes)

    def test_environment_turned_and_stretched(self) -> None:
        tree, node = self.environment()
        mapping = self.mapping(tree, node)
        mapping.inputs["Rotation"].default_value = (0.1, 0.2, 0.7)
        mapping.inputs["Scale"].default_value = (2, 2, 2)
        scene = self.extract()
        from mathutils import Euler

        expected = np.array(Euler((0.1, 0.2, 0.7), "XYZ").to_matrix())
        np.testing.assert_allclose(scene.world.to_texture, expected, atol=1e-6)
        self.assertFalse([note for note in scene.notes if "environment texture is only" in note])
        mapping.inputs["Scale"].default_value = (2, 1, 1)
        scene = self.extract()
        self.assertTrue([note for note in scene.notes if "environment texture is only" in note])
        turned = scene.world.to_texture
        np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-9)

    def test_what_is_approximated(self) -> None:
        tree, node = self.environment()
        node.projection = "MIRROR_BALL"
        scene = self.extract()
        self.assertEqual(scene.world.color, (0.5, 0.5, 0.5))
        self.assertIn("Approximated: mirror ball by mid grey: world World.", scene.notes)
        sky = tree.nodes.new("ShaderNodeTexSky")
        tree.links.new(sky.outputs[0], tree.nodes["Background"].inputs["Color"])
        scene = self.extract()
        self.assertEqual(scene.world.color, (0.5, 0.5, 0.5))
        self.assertIn("Approximated: sky texture by mid grey: world World.", scene.notes)

    def test_no_image_and_missing_image_are_magenta(self) -> None:
        _, node = self.environment()
        node.image = None
        scene = self.extract()
        self.assertEqual(scene.world.color, (1.0, 0.0, 1.0))
        self.assertTrue([note for note in scene.notes if note.startswith("Missing texture is mag")])

    def test_not_a_number(self) -> None:
        self.world().nodes["Background"].inputs["Strength"].default_value = math.nan
        scene = self.extract()
        self.assertEqual(scene.world.color, (0.0, 0.0, 0.0))
        self.assertTrue([note for note in scene.notes if "not finite" in note])

    def test_no_world_is_black(self) -> None:
        add_light("POINT").data.energy = 1
        self.assertEqual(self.extract().world.color, (0.0, 0.0, 0.0))

    def test_no_light_is_a_white_world(self) -> None:
        scene = self.extract()
        self.assertEqual(scene.world.color, (1.0, 1.0, 1.0))
        self.assertTrue(any("lit by a white one" in note for note in scene.notes))

    def test_no_light_in_a_render_is_said(self) -> None:
        from bvh_lab.blender.extract import extract_as_is

        scene = extract_as_is(bpy.context.evaluated_depsgraph_get(), "viewport")
        self.assertEqual(scene.world.color, (0.0, 0.0, 0.0))
        self.assertTrue(any("the picture is black" in note for note in scene.notes))

    def test_a_world_is_light_enough(self) -> None:
        world = bpy.data.worlds.new("World")
        use_nodes(world)
        bpy.context.scene.world = world
        world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.5, 0.25, 0.125, 1)
        self.assertEqual(self.extract().world.color, (0.5, 0.25, 0.125))


if __name__ == "__main__":
    unittest.main()
