# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures: where on them each corner of a triangle lies."""

from __future__ import annotations

import math
import unittest

import bpy
import numpy as np
from blender_support import add_camera, add_material, add_mesh, link
from texture_support import TextureTest, uv_square


class Coordinates(TextureTest):
    def test_uv_of_each_corner(self) -> None:
        self.image()
        self.part()
        scene = self.scene
        self.assertEqual((scene.uvs.dtype, scene.uvs.shape), (np.float32, (2, 3, 2)))
        corners = scene.vertices[scene.triangles][:, :, :2]
        np.testing.assert_allclose(scene.uvs, (corners + 1) / 2, atol=1e-6)

    def test_mirrored_object_keeps_corners_together(self) -> None:
        self.image()
        self.square.scale = (-1, 1, 1)
        self.part()
        corners = self.scene.vertices[self.scene.triangles][:, :, :2] * (-1, 1)
        np.testing.assert_allclose(self.scene.uvs, (corners + 1) / 2, atol=1e-6)

    def test_only_where_textures_are(self) -> None:
        self.part()
        self.assertIsNone(self.scene.uvs)
        self.assertEqual(self.scene.textures, [])
        self.image()
        plain = uv_square("Plain", 1.0)
        plain.data.materials.append(add_material("Plain"))
        self.part()
        np.testing.assert_array_equal(self.scene.uvs[2:], 0)

    def test_mesh_without_a_map(self) -> None:
        self.image()
        bare = add_mesh("Bare", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
        bare.data.materials.append(bpy.data.materials["M"])
        self.square.hide_set(True)
        self.part()
        np.testing.assert_array_equal(self.scene.uvs, np.zeros((1, 3, 2)))
        self.core_scene()

    def test_named_and_rendered_maps(self) -> None:
        other = self.square.data.uv_layers.new(name="Other")
        for loop in other.data:
            loop.uv = (0.25, 0.75)
        node = self.image()
        uv_map = self.new("UVMap")
        uv_map.uv_map = "Other"
        self.tree.links.new(uv_map.outputs[0], node.inputs["Vector"])
        self.part()
        np.testing.assert_array_equal(self.scene.uvs[0, 0], (0.25, 0.75))
        uv_map.uv_map = ""
        self.part()
        self.assertEqual(float(self.scene.uvs.max()), 1.0)
        self.square.data.uv_layers["Other"].active_render = True
        self.part()
        np.testing.assert_array_equal(self.scene.uvs[0, 0], (0.25, 0.75))
        uv_map.uv_map = "UVMap"
        second = self.image(to="Roughness")
        self.part()
        self.assertTrue(self.said("Approximated: several UV maps by the first: M"))
        self.assertEqual(second.type, "TEX_IMAGE")

    def test_mapping(self) -> None:
        node, mapping, uv_map = self.image(), self.new("Mapping"), self.new("UVMap")
        self.tree.links.new(uv_map.outputs[0], mapping.inputs["Vector"])
        self.tree.links.new(mapping.outputs[0], node.inputs["Vector"])
        mapping.inputs["Location"].default_value = (0.5, 0.25, 3)
        mapping.inputs["Rotation"].default_value = (0, 0, math.pi / 2)
        mapping.inputs["Scale"].default_value = (2, 4, 1)
        np.testing.assert_allclose(
            self.part().color.mapping, [[0, -4, 0.5], [2, 0, 0.25]], atol=1e-6
        )
        mapping.vector_type = "TEXTURE"  # the inverse: moved back, turned back, shrunk
        np.testing.assert_allclose(
            self.part().color.mapping, [[0, 0.5, -0.125], [-0.25, 0, 0.125]], atol=1e-6
        )
        mapping.vector_type = "VECTOR"
        np.testing.assert_allclose(self.part().color.mapping, [[0, -4, 0], [2, 0, 0]], atol=1e-6)

    def test_other_coordinates_are_said(self) -> None:
        node, coordinates = self.image(), self.new("TexCoord")
        self.tree.links.new(coordinates.outputs["Object"], node.inputs["Vector"])
        self.part()
        self.assertTrue(self.said("Approximated: texture coordinates 'Object' by the UV map: M"))
        self.tree.links.new(coordinates.outputs["UV"], node.inputs["Vector"])
        node.projection = "BOX"
        self.part()
        self.assertTrue(self.said("Approximated: box projection by a flat one: M"))

    def test_instances_with_other_materials_have_other_maps(self) -> None:
        other = self.square.data.uv_layers.new(name="Other")
        for loop in other.data:
            loop.uv = (0.25, 0.75)
        self.image()
        material = add_material("N")
        tree = material.node_tree
        node, uv_map = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeUVMap")
        node.image, uv_map.uv_map = bpy.data.images["Test"], "Other"
        tree.links.new(uv_map.outputs[0], node.inputs["Vector"])
        tree.links.new(node.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
        twin = link(bpy.data.objects.new("Twin", self.square.data))
        twin.material_slots[0].link, twin.material_slots[0].material = "OBJECT", material
        self.part()
        self.assertIn("2 objects and instances, 1 distinct", self.scene.notes[0])
        is_twin = self.scene.material_index == next(
            index for index, found in enumerate(self.scene.materials) if found.name == "N"
        )
        np.testing.assert_array_equal(
            self.scene.uvs[is_twin], np.broadcast_to((0.25, 0.75), (2, 3, 2))
        )
        self.assertEqual(float(self.scene.uvs[~is_twin].max()), 1.0)

    def test_render_geometry_has_them_too(self) -> None:
        add_camera()
        self.image()
        scene = self.extract("render")
        self.assertEqual(float(scene.uvs.max()), 1.0)


if __name__ == "__main__":
    unittest.main()
