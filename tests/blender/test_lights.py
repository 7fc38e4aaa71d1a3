# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps, world and materials: constants in Blender's units."""

from __future__ import annotations

import math
import unittest

import bpy
import numpy as np
from blender_support import EmptySceneTest, add_cube, add_light, add_material, link, use_nodes


class Lights(EmptySceneTest):
    def setUp(self) -> None:
        super().setUp()
        add_cube()

    def light(self):
        return self.extract().lights[0]

    def test_point(self) -> None:
        obj = add_light("POINT")
        obj.location, obj.data.energy, obj.data.color, obj.data.shadow_soft_size = (
            (1, 2, 3),
            100,
            (1, 0.5, 0),
            0.25,
        )
        light = self.light()
        self.assertEqual(
            (light.kind, light.color, light.size_x), ("point", (100.0, 50.0, 0.0), 0.25)
        )
        np.testing.assert_allclose(light.to_world[:3, 3], (1, 2, 3))

    def test_sun(self) -> None:
        data = add_light("SUN").data
        data.energy, data.angle = 3.0, 0.2
        light = self.light()
        self.assertEqual((light.kind, light.color), ("sun", (3.0, 3.0, 3.0)))
        self.assertAlmostEqual(light.size_x, 0.2, places=6)

    def test_spot(self) -> None:
        data = add_light("SPOT").data
        data.energy, data.spot_size, data.spot_blend = 10, math.radians(40), 0.5
        light = self.light()
        self.assertEqual(light.kind, "spot")
        self.assertAlmostEqual(light.spot_angle, math.radians(40), places=6)
        self.assertEqual(light.spot_blend, 0.5)

    def test_area_shapes_follow_the_scale(self) -> None:
        obj = add_light("AREA")
        obj.scale, obj.data.energy, obj.data.size, obj.data.size_y = (2, 3, 5), 7, 0.5, 0.25
        for shape, kind, width, height in (
            ("SQUARE", "rectangle", 1.0, 1.5),
            ("RECTANGLE", "rectangle", 1.0, 0.75),
            ("DISK", "disk", 1.0, 1.5),
            ("ELLIPSE", "disk", 1.0, 0.75),
        ):
            with self.subTest(shape=shape):
                obj.data.shape = shape
                light = self.light()
                self.assertEqual((light.kind, light.shape), ("area", kind))
                # Before Blender 4.0 an area lamp of 7 W emitted pi / 4 of that.
                watts = 7.0 if bpy.app.version >= (4, 0, 0) else 7.0 * math.pi / 4.0
                np.testing.assert_allclose(light.color, (watts,) * 3, rtol=1e-6)
                self.assertAlmostEqual(light.size_x, width, places=6)
                self.assertAlmostEqual(light.size_y, height, places=6)

    def test_exposure_and_normalize(self) -> None:
        data = add_light("AREA").data
        if not hasattr(data, "normalize"):
            self.skipTest("lamps have no exposure before Blender 4.5")
        data.energy, data.exposure, data.normalize, data.shape = 10, 1.0, False, "RECTANGLE"
        data.size, data.size_y = 2.0, 0.5
        np.testing.assert_allclose(self.light().color, (20, 20, 20), rtol=1e-6)

    def test_point_without_normalize_is_divided_by_its_sphere(self) -> None:
        data = add_light("POINT").data
        if not hasattr(data, "normalize"):
            self.skipTest("lamps are always normalised before Blender 4.5")
        data.energy, data.normalize, data.shadow_soft_size = 20, False, 0.3
        expected = 20 * 4 * math.pi * 0.3**2
        np.testing.assert_allclose(self.light().color, (expected,) * 3, rtol=1e-6)

    def test_light_nodes(self) -> None:
        data = add_light("POINT").data
        data.energy, data.use_nodes = 10, True
        emission = data.node_tree.nodes["Emission"]
        emission.inputs["Color"].default_value, emission.inputs["Strength"].default_value = (
            (1, 0.5, 0, 1),
            3,
        )
        self.assertEqual(self.light().color, (30.0, 15.0, 0.0))

    def test_hidden_and_dark_lamps_are_left_out(self) -> None:
        add_light("POINT", "Dark").data.energy = 0
        add_light("POINT", "Hidden").hide_render = True
        add_light("POINT", "Lit").data.energy = 1
        self.assertEqual([light.name for light in self.extract("render").lights], ["Lit"])

    def test_instanced_lamp(self) -> None:
        lamp = add_light("POINT")
        lamp.data.energy = 1
        collection = bpy.data.collections.new("Lamps")
        collection.objects.link(lamp)
        bpy.context.scene.collection.objects.unlink(lamp)
        for _ in range(3):
            empty = link(bpy.data.objects.new("Instance", None))
            empty.instance_type, empty.instance_collection = "COLLECTION", collection
        self.assertEqual(len(self.extract().lights), 3)


class Worlds(EmptySceneTest):
    def setUp(self) -> None:
        super().setUp()
        add_cube()

    def world(self) -> bpy.types.World:
        world = bpy.data.worlds.new("World")
        use_nodes(world)
        bpy.context.scene.world = world
        add_light("POINT").data.energy = 1
        return world

    def test_background_node(self) -> None:
        background = self.world().node_tree.nodes["Background"]
        background.inputs["Color"].default_value, background.inputs["Strength"].default_value = (
            (0.5, 0.25, 1, 1),
            2,
        )
        self.assertEqual(self.extract().world, (1.0, 0.5, 2.0))

    def test_texture_is_said(self) -> None:
        world = self.world()
        tree = world.node_tree
        tree.links.new(
            tree.nodes.new("ShaderNodeTexEnvironment").outputs[0],
            tree.nodes["Background"].inputs["Color"],
        )
        scene = self.extract()
        self.assertEqual(scene.world, (0.5, 0.5, 0.5))
        self.assertTrue(any("texture of world 'World'" in note for note in scene.notes))

    def test_no_world_is_black(self) -> None:
        add_light("POINT").data.energy = 1
        self.assertEqual(self.extract().world, (0.0, 0.0, 0.0))

    def test_no_light_is_a_white_world(self) -> None:
        scene = self.extract()
        self.assertEqual(scene.world, (1.0, 1.0, 1.0))
        self.assertTrue(any("white world" in note for note in scene.notes))


class Materials(EmptySceneTest):
    def setUp(self) -> None:
        super().setUp()
        self.cube = add_cube()

    def material(self, name: str, color: tuple[float, float, float]) -> bpy.types.Material:
        material = add_material(name)
        principled = material.node_tree.nodes["Principled BSDF"]
        principled.inputs["Base Color"].default_value = (*color, 1)
        return material

    def test_index_of_each_triangle(self) -> None:
        self.cube.data.materials.append(self.material("Red", (1, 0, 0)))
        self.cube.data.materials.append(self.material("Green", (0, 1, 0)))
        for polygon in self.cube.data.polygons:
            polygon.material_index = polygon.index % 2
        scene = self.extract()
        names = [scene.materials[index].name for index in scene.material_index]
        self.assertEqual(names, ["Red", "Red", "Green", "Green"] * 3)
        self.assertEqual(scene.materials[scene.material_index[0]].base_color, (1.0, 0.0, 0.0))

    def test_slot_of_the_object_wins(self) -> None:
        self.cube.data.materials.append(self.material("Red", (1, 0, 0)))
        twin = link(bpy.data.objects.new("Twin", self.cube.data))
        twin.material_slots[0].link = "OBJECT"
        twin.material_slots[0].material = self.material("Blue", (0, 0, 1))
        scene = self.extract()
        names = [scene.materials[index].name for index in scene.material_index]
        self.assertEqual(sorted(set(names)), ["Blue", "Red"])
        self.assertEqual(names.count("Blue"), 12)

    def test_missing_slot_and_index_beyond_the_slots(self) -> None:
        scene = self.extract()
        self.assertEqual(
            {scene.materials[index].name for index in scene.material_index}, {"(default)"}
        )
        self.cube.data.materials.append(None)
        self.cube.data.materials.append(self.material("Last", (0, 1, 0)))
        self.cube.data.polygons[0].material_index = 7
        scene = self.extract()
        names = [scene.materials[index].name for index in scene.material_index]
        self.assertEqual(names[:2], ["Last", "Last"])
        self.assertEqual(set(names[2:]), {"(default)"})

    def test_material_of_a_curve(self) -> None:
        bpy.ops.object.text_add()
        bpy.context.object.data.materials.append(self.material("Ink", (0, 0, 0)))
        self.cube.hide_set(True)
        scene = self.extract()
        self.assertEqual({scene.materials[index].name for index in scene.material_index}, {"Ink"})

    def test_emission_lights_the_scene(self) -> None:
        material = self.material("Lamp", (0.5, 0.5, 0.5))
        tree = material.node_tree
        emission = tree.nodes.new("ShaderNodeEmission")
        emission.inputs["Color"].default_value, emission.inputs["Strength"].default_value = (
            (1, 0.5, 0.25, 1),
            4,
        )
        tree.links.new(emission.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        self.cube.data.materials.append(material)
        scene = self.extract()
        self.assertEqual(scene.materials[scene.material_index[0]].emission, (4.0, 2.0, 1.0))
        self.assertEqual(scene.world, (0.0, 0.0, 0.0))

    def test_principled_emission(self) -> None:
        material = self.material("Lamp", (0.5, 0.5, 0.5))
        inputs = material.node_tree.nodes["Principled BSDF"].inputs
        inputs["Emission Color" if "Emission Color" in inputs else "Emission"].default_value = (
            1,
            1,
            0,
            1,
        )
        inputs["Emission Strength"].default_value = 2
        self.cube.data.materials.append(material)
        self.assertEqual(self.extract().materials[1].emission, (2.0, 2.0, 0.0))

    def test_mixed_shaders(self) -> None:
        tree = self.material("Mixed", (1, 0, 0)).node_tree
        mix, diffuse = (
            tree.nodes.new("ShaderNodeMixShader"),
            tree.nodes.new("ShaderNodeBsdfDiffuse"),
        )
        mix.inputs[0].default_value, diffuse.inputs["Color"].default_value = 0.25, (0, 1, 0, 1)
        tree.links.new(tree.nodes["Principled BSDF"].outputs[0], mix.inputs[1])
        tree.links.new(diffuse.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
        self.cube.data.materials.append(bpy.data.materials["Mixed"])
        np.testing.assert_allclose(self.extract().materials[1].base_color, (0.75, 0.25, 0))

    def test_what_is_lost_is_said(self) -> None:
        material = self.material("Mirror", (1, 1, 1))
        material.node_tree.nodes["Principled BSDF"].inputs["Metallic"].default_value = 1
        self.cube.data.materials.append(material)
        self.assertTrue(
            any("metallic" in note and "Mirror" in note for note in self.extract().notes)
        )


if __name__ == "__main__":
    unittest.main()
