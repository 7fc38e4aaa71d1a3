# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps: constants in Blender's units."""

from __future__ import annotations

import math
import unittest

import bpy
import numpy as np
from blender_support import EmptySceneTest, add_cube, add_light, link


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


class BadLights(EmptySceneTest):
    """What gives no light is left out and named."""

    def setUp(self) -> None:
        super().setUp()
        add_cube()
        add_light("POINT", "Good").data.energy = 1

    def check_left_out(self, said: str) -> None:
        scene = self.extract()
        self.assertEqual([light.name for light in scene.lights], ["Good"])
        self.assertEqual([note for note in scene.notes if note == said], [said])

    def test_negative_power(self) -> None:
        add_light("SPOT", "Dark").data.energy = -5
        self.check_left_out("Left out: negative light counts as 0: Dark.")

    def test_area_without_area(self) -> None:
        obj = add_light("AREA", "Flat")
        obj.data.energy, obj.scale = 5, (0, 1, 1)
        self.check_left_out("Left out: area light without area: Flat.")

    def test_strength_not_a_number(self) -> None:
        data = add_light("POINT", "Broken").data
        data.energy = math.nan
        self.check_left_out("Left out: light whose strength is not a finite number: Broken.")

    def test_portal(self) -> None:
        data = add_light("AREA", "Window").data
        if getattr(data, "cycles", None) is None:
            self.skipTest("this Blender has no Cycles")
        data.cycles.is_portal = True
        self.check_left_out("Left out: light portals: Window.")

    def test_settings_that_are_ignored(self) -> None:
        obj = add_light("AREA", "Odd")
        obj.data.energy, obj.data.spread, obj.visible_glossy = 1, 1.0, False
        notes = self.extract().notes
        self.assertIn("Approximated: area light spread ignored: Odd.", notes)
        self.assertIn("Approximated: ray visibility is ignored, every ray sees these: Odd.", notes)

    def test_textured_nodes(self) -> None:
        data = add_light("POINT", "Slide").data
        data.energy, data.use_nodes = 10, True
        tree = data.node_tree
        noise = tree.nodes.new("ShaderNodeTexNoise")
        tree.links.new(noise.outputs[0], tree.nodes["Emission"].inputs["Strength"])
        scene = self.extract()
        self.assertEqual(scene.lights[1].color, (5.0, 5.0, 5.0))
        self.assertIn("Approximated: node 'Noise Texture' by a constant: Slide.", scene.notes)


if __name__ == "__main__":
    unittest.main()
