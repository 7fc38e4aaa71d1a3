# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials: shader trees as components."""

from __future__ import annotations

import math
import unittest

import bpy
import numpy as np
from blender_support import EmptySceneTest, add_cube, add_material, link


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


class Values(MaterialTest):
    """Constants that nodes compute, against what Cycles' nodes are documented to do."""

    def base_color(self) -> tuple[float, float, float]:
        color = self.material().components[0].color
        self.assertEqual(self.lost(), [])
        return color

    def test_rgb_through_gamma_and_reroute(self) -> None:
        rgb, gamma, reroute = self.new("RGB"), self.new("Gamma"), self.tree.nodes.new("NodeReroute")
        rgb.outputs[0].default_value = (0.5, 0.25, 1, 1)
        gamma.inputs["Gamma"].default_value = 2
        self.link(rgb, reroute, 0)
        self.link(reroute, gamma, 0)
        self.link(gamma, self.principled, "Base Color")
        np.testing.assert_allclose(self.base_color(), (0.25, 0.0625, 1))

    def test_loose_reroute_feeds_nothing(self) -> None:
        self.principled.inputs["Base Color"].default_value = (0.5, 0.25, 1, 1)
        self.link(self.tree.nodes.new("NodeReroute"), self.principled, "Base Color")
        self.assertEqual(self.base_color(), (0.5, 0.25, 1))

    def test_math_mix_and_conversions(self) -> None:
        value, math_node, mix = self.new("Value"), self.new("Math"), self.new("MixRGB")
        value.outputs[0].default_value = 0.5
        math_node.operation = "POWER"
        self.link(value, math_node, 0)
        math_node.inputs[1].default_value = 2
        self.link(math_node, mix, 0)
        mix.blend_type = "MULTIPLY"
        mix.inputs[1].default_value, mix.inputs[2].default_value = (1, 0.5, 1, 1), (0, 1, 0.5, 1)
        self.link(mix, self.principled, "Base Color")
        np.testing.assert_allclose(self.base_color(), (0.75, 0.5, 0.875))
        self.link(mix, self.principled, "Roughness")
        self.assertAlmostEqual(
            self.material().components[0].roughness,
            0.2126 * 0.75 + 0.7152 * 0.5 + 0.0722 * 0.875,
            places=5,
        )

    def test_ramp_and_curve(self) -> None:
        ramp, curve = self.new("ValToRGB", Fac=0.25), self.new("RGBCurve")
        ramp.color_ramp.elements[1].color = (1, 0.5, 0, 1)
        combined = curve.mapping.curves[3]
        combined.points[1].location = (1, 0.5)
        curve.mapping.update()
        self.link(ramp, curve, 1)
        self.link(curve, self.principled, "Base Color")
        np.testing.assert_allclose(self.base_color(), (0.125, 0.0625, 0), atol=1e-4)

    def test_combined_and_separated(self) -> None:
        combine, separate = (
            self.new("CombineColor", Red=0.1, Green=0.2, Blue=0.3),
            self.new("SeparateColor"),
        )
        self.link(combine, separate, 0)
        self.tree.links.new(separate.outputs["Green"], self.principled.inputs["Roughness"])
        self.material()
        self.assertAlmostEqual(self.material().components[0].roughness, 0.2, places=6)

    def test_group(self) -> None:
        """Inside a group, what its inputs feed has the value of the group node's sockets."""
        group = bpy.data.node_groups.new("Paint", "ShaderNodeTree")
        add_socket(group, "Tint", "NodeSocketColor", "INPUT")
        add_socket(group, "Shine", "NodeSocketFloat", "INPUT")
        add_socket(group, "Paint", "NodeSocketShader", "OUTPUT")
        start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
        inner = group.nodes.new("ShaderNodeBsdfPrincipled")
        group.links.new(start.outputs["Tint"], inner.inputs["Base Color"])
        group.links.new(start.outputs["Shine"], inner.inputs["Roughness"])
        group.links.new(inner.outputs[0], end.inputs["Paint"])
        node = self.tree.nodes.new("ShaderNodeGroup")
        node.node_tree = group
        node.inputs["Tint"].default_value = (0.5, 0.25, 0, 1)
        value = self.new("Value")
        value.outputs[0].default_value = 0.75
        self.link(value, node, "Shine")
        self.show(node)
        (part,) = self.material().components
        self.assertEqual((part.color, part.roughness), ((0.5, 0.25, 0.0), 0.75))
        self.assertEqual(self.lost(), [])

    def test_not_a_number_is_named(self) -> None:
        self.principled.inputs["Base Color"].default_value = (math.nan, 0.5, 0.5, 1)
        self.assertEqual(self.material().components[0].color, (0.0, 0.5, 0.5))
        self.assertEqual(
            self.lost(), ["Left out: a colour or number that is not finite counts as 0"]
        )

    def test_means(self) -> None:
        """Factors that depend on the angle become their mean, weighted by the cosine."""
        from bvh_lab.blender.node_functions import fresnel_mean

        self.assertAlmostEqual(fresnel_mean(1.5), 0.0918, places=3)
        self.assertEqual(fresnel_mean(1.0), 0.0)
        self.link(self.new("LayerWeight"), self.principled, "Roughness")
        self.tree.links.new(
            self.tree.nodes["Layer Weight"].outputs["Facing"], self.principled.inputs["Roughness"]
        )
        self.assertAlmostEqual(self.material().components[0].roughness, 1 / 3, places=5)

    def test_blackbody(self) -> None:
        from bvh_lab.blender.node_functions import blackbody

        np.testing.assert_allclose(blackbody(6504), (1, 1, 1), atol=0.06)
        warm = blackbody(3000)
        self.assertGreater(warm[0], warm[1])
        self.assertGreater(warm[1], warm[2])
        self.assertAlmostEqual(float(np.dot(warm, (0.2126, 0.7152, 0.0722))), 1.0, places=3)


def add_socket(group: bpy.types.NodeTree, name: str, kind: str, in_out: str) -> None:
    if hasattr(group, "interface"):  # Blender 4.0
        group.interface.new_socket(name, in_out=in_out, socket_type=kind)
    else:
        (group.inputs if in_out == "INPUT" else group.outputs).new(kind, name)


class Lost(MaterialTest):
    """One feature after another that changes the picture and is not modelled: each is named."""

    def test_principled_inputs(self) -> None:
        for said, names, value in (
            ("Left out: anisotropy", ("Anisotropic",), 0.5),
            ("Left out: sheen", ("Sheen Weight", "Sheen"), 0.5),
            ("Left out: coat", ("Coat Weight", "Clearcoat"), 0.5),
            (
                "Approximated by plain diffuse: subsurface scattering",
                ("Subsurface Weight", "Subsurface"),
                0.5,
            ),
            ("Left out: thin film", ("Thin Film Thickness",), 300.0),
            ("Approximated by plain diffuse: Oren-Nayar roughness", ("Diffuse Roughness",), 0.5),
            ("Left out: specular tint", ("Specular Tint",), None),
        ):
            if not any(name in self.principled.inputs for name in names):
                continue
            with self.subTest(feature=said):
                socket = self.input(*names)
                before = socket.default_value[:] if socket.type == "RGBA" else socket.default_value
                socket.default_value = (
                    value if value is not None else (1, 0, 0, 1) if socket.type == "RGBA" else 0.5
                )
                self.assertEqual(self.lost(), [said])
                socket.default_value = before
        self.assertEqual(self.lost(), [])

    def test_shaders(self) -> None:
        for said, kind, inputs in (
            ("Approximated by plain diffuse: sheen", "BsdfSheen", {}),
            ("Approximated by plain diffuse: velvet", "BsdfVelvet", {}),
            ("Approximated by plain diffuse: toon shading", "BsdfToon", {}),
            ("Approximated by plain diffuse: hair shading", "BsdfHairPrincipled", {}),
            ("Approximated by plain diffuse: subsurface scattering", "SubsurfaceScattering", {}),
            ("Approximated by plain diffuse: shader node 'Holdout'", "Holdout", {}),
            (
                "Approximated by plain diffuse: Oren-Nayar roughness",
                "BsdfDiffuse",
                {"Roughness": 1},
            ),
            ("Left out: anisotropy", "BsdfAnisotropic", {"Anisotropy": 0.5}),
            ("Approximated: Beckmann distribution by GGX", "BsdfRefraction", {"Roughness": 0.5}),
            ("Left out: edge tint of metal", "BsdfMetallic", {}),
        ):
            if not hasattr(bpy.types, "ShaderNode" + kind):
                continue
            with self.subTest(kind=kind):
                shader = self.new(kind, **inputs)
                if kind == "BsdfAnisotropic":
                    shader.distribution = "MULTI_GGX"
                self.show(shader)
                self.assertEqual(self.lost(), [said])

    def test_single_scattering(self) -> None:
        said = "Approximated: GGX as Multiscatter GGX, which keeps all light"
        for kind in ("BsdfAnisotropic", "BsdfGlass", "BsdfPrincipled"):
            with self.subTest(kind=kind):
                shader = self.new(kind, Roughness=0.5)
                shader.distribution = "GGX"
                if kind == "BsdfAnisotropic":
                    shader.inputs["Anisotropy"].default_value = 0
                self.show(shader)
                if kind == "BsdfPrincipled" and bpy.app.version < (4, 0, 0):
                    self.assertEqual(self.lost(), [])
                    fact = (
                        "Approximated: the Principled BSDF of this Blender as that of Blender 4.0."
                    )
                    self.assertIn(fact, self.scene.notes)
                    continue
                self.assertEqual(self.lost(), [said])
                shader.inputs["Roughness"].default_value = 0
                self.assertEqual(self.lost(), [])

    def test_normals_displacement_and_volume(self) -> None:
        output = self.tree.nodes["Material Output"]
        for said, kind in (
            ("Left out: normal map", "NormalMap"),
            ("Left out: bump", "Bump"),
            ("Left out: changed normals", "NewGeometry"),
        ):
            with self.subTest(kind=kind):
                node = self.new(kind)
                self.tree.links.new(node.outputs["Normal"], self.principled.inputs["Normal"])
                self.assertEqual(self.lost(), [said])
                self.tree.nodes.remove(node)
        for said, kind in (
            ("Left out: displacement", "Displacement"),
            ("Left out: volume", "VolumeAbsorption"),
        ):
            with self.subTest(kind=kind):
                node = self.new(kind)
                self.link(node, output, said.split()[-1].capitalize())
                self.assertEqual(self.lost(), [said])
                self.tree.nodes.remove(node)

    def test_volume_alone_has_a_clear_surface(self) -> None:
        output = self.tree.nodes["Material Output"]
        self.tree.nodes.remove(self.principled)
        self.link(self.new("VolumeAbsorption"), output, "Volume")
        (part,) = self.material().components
        self.assertEqual((part.model, part.color), ("transparent", (1.0, 1.0, 1.0)))

    def test_values(self) -> None:
        for said, kind, output in (
            ("Approximated: node 'Noise Texture' by a constant", "TexNoise", 0),
            ("Approximated: node 'Checker Texture' by its mean", "TexChecker", 0),
            ("Approximated: node 'Color Attribute' by a constant", "VertexColor", 0),
            ("Approximated: Fresnel factor by its mean", "Fresnel", 0),
            ("Approximated: Layer Weight by its mean", "LayerWeight", 1),
            ("Approximated: Light Path as for a ray of the camera", "LightPath", 0),
            ("Approximated: node 'Ambient Occlusion' as unoccluded", "AmbientOcclusion", 0),
        ):
            with self.subTest(kind=kind):
                node = self.new(kind)
                self.tree.links.new(node.outputs[output], self.principled.inputs["Roughness"])
                self.assertEqual(self.lost(), [said])
                self.tree.nodes.remove(node)

    def test_index_below_one_and_negative_emission(self) -> None:
        self.show(self.new("BsdfGlass", IOR=0.8))
        self.assertAlmostEqual(self.material().components[0].ior, 1.25, places=5)
        self.assertEqual(
            self.lost(), ["Approximated: index of refraction below 1 by its reciprocal"]
        )
        self.show(self.new("Emission", Strength=-1))
        self.assertEqual(self.material().emission, (0.0, 0.0, 0.0))
        self.assertEqual(self.lost(), ["Left out: negative emission counts as 0"])


if __name__ == "__main__":
    unittest.main()
