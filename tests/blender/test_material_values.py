# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of sockets as nodes and groups make them, and what materials lose: each is named."""

from __future__ import annotations

import math
import unittest

import bpy
import numpy as np
from material_support import MaterialTest


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
