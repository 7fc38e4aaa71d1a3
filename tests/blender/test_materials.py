# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials: shader trees as components."""

from __future__ import annotations

import math
import unittest

import bpy
import numpy as np
from blender_support import add_material, link
from material_support import MaterialTest


class Slots(MaterialTest):
    def colored(self, name: str, color: tuple[float, float, float]) -> bpy.types.Material:
        material = add_material(name)
        principled = material.node_tree.nodes["Principled BSDF"]
        principled.inputs["Base Color"].default_value = (*color, 1)
        return material

    def names(self) -> list[str]:
        scene = self.extract()
        return [scene.materials[index].name for index in scene.material_index]

    def test_index_of_each_triangle(self) -> None:
        self.cube.data.materials.append(self.colored("Green", (0, 1, 0)))
        for polygon in self.cube.data.polygons:
            polygon.material_index = polygon.index % 2
        self.assertEqual(self.names(), ["M", "M", "Green", "Green"] * 3)

    def test_slot_of_the_object_wins(self) -> None:
        twin = link(bpy.data.objects.new("Twin", self.cube.data))
        twin.material_slots[0].link = "OBJECT"
        twin.material_slots[0].material = self.colored("Blue", (0, 0, 1))
        self.assertEqual(sorted(set(self.names())), ["Blue", "M"])
        self.assertEqual(self.names().count("Blue"), 12)

    def test_missing_slot_and_index_beyond_the_slots(self) -> None:
        self.cube.data.materials.clear()
        self.assertEqual(set(self.names()), {"(default)"})
        self.cube.data.materials.append(None)
        self.cube.data.materials.append(self.colored("Last", (0, 1, 0)))
        self.cube.data.polygons[0].material_index = 7
        self.assertEqual(self.names(), ["Last"] * 2 + ["(default)"] * 10)

    def test_material_of_a_curve(self) -> None:
        bpy.ops.object.text_add()
        bpy.context.object.data.materials.append(self.colored("Ink", (0, 0, 0)))
        self.cube.hide_set(True)
        self.assertEqual(set(self.names()), {"Ink"})


class Principled(MaterialTest):
    def part(self):
        components = self.material().components
        self.assertEqual(len(components), 1)
        return components[0]

    def test_defaults_are_a_coat_of_four_percent(self) -> None:
        part = self.part()
        self.assertEqual((part.model, part.weight, part.metallic), ("principled", 1.0, 0.0))
        np.testing.assert_allclose(part.color, (0.8, 0.8, 0.8), rtol=1e-6)
        self.assertAlmostEqual(part.roughness, 0.5)
        self.assertAlmostEqual(part.ior, 1.5, places=5)
        self.assertAlmostEqual(part.specular, 1.0)
        self.assertEqual(self.lost(), [])

    def test_specular_level(self) -> None:
        level = self.input("Specular IOR Level", "Specular")
        level.default_value = 1.0
        self.input("IOR").default_value = 1.5
        root = math.sqrt(0.08)
        self.assertAlmostEqual(self.part().ior, (1 + root) / (1 - root), places=4)
        level.default_value = 0.0
        self.assertAlmostEqual(self.part().ior, 1.0)

    def test_transmission_keeps_its_index(self) -> None:
        self.input("Transmission Weight", "Transmission").default_value = 1.0
        self.input("IOR").default_value = 1.33
        self.input("Specular IOR Level", "Specular").default_value = 1.0
        part = self.part()
        self.assertEqual(part.transmission, 1.0)
        self.assertAlmostEqual(part.ior, 1.33, places=5)
        own = (0.33 / 2.33) ** 2
        wanted = 2 * own if "Specular IOR Level" in self.principled.inputs else 0.08
        self.assertAlmostEqual(part.specular, min(wanted / own, 2.0), places=4)

    def test_metal(self) -> None:
        self.input("Metallic").default_value = 1.0
        self.input("Roughness").default_value = 0.25
        part = self.part()
        self.assertEqual((part.metallic, part.roughness), (1.0, 0.25))

    def test_alpha_is_a_share_of_transparency(self) -> None:
        self.input("Alpha").default_value = 0.25
        solid, clear = self.material().components
        self.assertEqual((solid.model, solid.weight), ("principled", 0.25))
        self.assertEqual(
            (clear.model, clear.weight, clear.color), ("transparent", 0.75, (1.0,) * 3)
        )

    def test_emission(self) -> None:
        self.input("Emission Color", "Emission").default_value = (1, 1, 0, 1)
        self.input("Emission Strength").default_value = 2
        self.input("Alpha").default_value = 0.5
        self.assertEqual(self.material().emission, (1.0, 1.0, 0.0))


class Shaders(MaterialTest):
    def test_each_model(self) -> None:
        for kind, model, inputs, expected in (
            ("BsdfDiffuse", "diffuse", {"Color": (0.5, 0.25, 0, 1)}, {"color": (0.5, 0.25, 0)}),
            ("BsdfTranslucent", "translucent", {"Color": (1, 0, 0, 1)}, {"color": (1, 0, 0)}),
            ("BsdfTransparent", "transparent", {"Color": (1, 0, 0, 1)}, {"color": (1, 0, 0)}),
            (
                "BsdfAnisotropic",
                "glossy",
                {"Roughness": 0.25, "Anisotropy": 0},
                {"roughness": 0.25},
            ),
            ("BsdfGlass", "glass", {"Roughness": 0, "IOR": 1.75}, {"roughness": 0, "ior": 1.75}),
            ("BsdfRefraction", "refraction", {"IOR": 1.25}, {"ior": 1.25}),
        ):
            with self.subTest(kind=kind):
                shader = self.new(kind, **inputs)
                if kind == "BsdfAnisotropic":
                    shader.distribution = "MULTI_GGX"
                self.show(shader)
                (part,) = self.material().components
                self.assertEqual(part.model, model)
                for name, value in expected.items():
                    self.assertEqual(getattr(part, name), value)
                self.assertEqual(self.lost(), [])

    def test_sharp_glossy(self) -> None:
        if bpy.app.version >= (4, 0, 0):
            self.skipTest("no sharp distribution since Blender 4.0")
        glossy = self.new("BsdfGlossy", Roughness=0.5)
        glossy.distribution = "SHARP"
        self.show(glossy)
        self.assertEqual(self.material().components[0].roughness, 0.0)

    def test_metallic_shader(self) -> None:
        if bpy.app.version < (4, 3, 0):
            self.skipTest("no Metallic BSDF before Blender 4.3")
        metal = self.new("BsdfMetallic", Base_Color=(1, 0.5, 0.25, 1), Roughness=0.25)
        metal.inputs["Edge Tint"].default_value = (1, 1, 1, 1)
        self.show(metal)
        (part,) = self.material().components
        self.assertEqual((part.model, part.metallic), ("principled", 1.0))
        self.assertEqual((part.color, part.roughness), ((1.0, 0.5, 0.25), 0.25))
        self.assertEqual(self.lost(), [])
        metal.fresnel_type = "PHYSICAL_CONDUCTOR"
        metal.inputs["IOR"].default_value = (1, 1, 1)
        metal.inputs["Extinction"].default_value = (2, 0, 2)
        np.testing.assert_allclose(self.material().components[0].color, (0.5, 0, 0.5), atol=1e-6)

    def test_emission(self) -> None:
        self.show(self.new("Emission", Color=(1, 0.5, 0.25, 1), Strength=4))
        material = self.material()
        self.assertEqual((material.components, material.emission), ([], (4.0, 2.0, 1.0)))
        self.assertEqual(self.scene.world.color, (0.0, 0.0, 0.0))

    def test_mixed_diffuse_shaders_are_one(self) -> None:
        mix = self.new("MixShader")
        mix.inputs[0].default_value = 0.25
        self.link(self.new("BsdfDiffuse", Color=(1, 0, 0, 1)), mix, 1)
        self.link(self.new("BsdfDiffuse", Color=(0, 1, 0, 1)), mix, 2)
        self.show(mix)
        (part,) = self.material().components
        self.assertEqual(part.weight, 1.0)
        np.testing.assert_allclose(part.color, (0.75, 0.25, 0))

    def test_mix_and_add_multiply_out(self) -> None:
        mix, both = self.new("MixShader"), self.new("AddShader")
        mix.inputs[0].default_value = 0.75
        self.link(self.new("BsdfDiffuse"), mix, 1)
        self.link(both, mix, 2)
        self.link(self.new("BsdfGlass"), both, 0)
        self.link(self.new("Emission", Color=(1, 1, 1, 1), Strength=2), both, 1)
        self.show(mix)
        material = self.material()
        self.assertEqual(
            [(part.model, part.weight) for part in material.components],
            [("diffuse", 0.25), ("glass", 0.75)],
        )
        self.assertEqual(material.emission, (1.5, 1.5, 1.5))

    def test_nothing_linked_is_black(self) -> None:
        self.tree.nodes.remove(self.principled)
        self.assertEqual(self.material().components, [])

    def test_muted_nodes_let_their_first_input_through(self) -> None:
        mix = self.new("MixShader")
        self.link(self.new("BsdfDiffuse"), mix, 1)
        self.link(self.new("BsdfGlass"), mix, 2)
        self.show(mix)
        mix.mute = True
        bpy.context.view_layer.update()
        expected = [link.from_socket.node.bl_idname for link in mix.internal_links]
        self.assertEqual([part.model for part in self.material().components], ["diffuse"], expected)

    def test_most_components(self) -> None:
        shader = self.new("BsdfDiffuse")
        for step in range(5):
            mix = self.new("MixShader")
            mix.inputs[0].default_value = 0.5 if step else 0.01
            self.link(shader, mix, 1)
            self.link(self.new("BsdfGlass", IOR=1.25 + 0.25 * step), mix, 2)
            shader = mix
        self.show(shader)
        components = self.material().components
        self.assertEqual(len(components), 4)
        self.assertAlmostEqual(sum(part.weight for part in components), 1.0, places=5)
        self.assertEqual(self.lost(), ["Approximated: 6 shaders by the heaviest 4"])

    def test_old_material_without_nodes(self) -> None:
        if bpy.app.version >= (5, 0, 0):
            self.skipTest("every material has nodes since Blender 5.0")
        material = bpy.data.materials["M"]
        material.use_nodes, material.diffuse_color = False, (0.5, 0.25, 0.125, 1)
        self.assertEqual(self.material().components[0].color, (0.5, 0.25, 0.125))


if __name__ == "__main__":
    unittest.main()
