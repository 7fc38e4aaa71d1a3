# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures: which pictures are looked up, and how."""

from __future__ import annotations

import tempfile
import unittest
from pathlib import Path

import bpy
import numpy as np
from texture_support import TextureTest, picture


class Images(TextureTest):
    def test_generated_image(self) -> None:
        self.image()
        lookup = self.part().color
        self.assertEqual((lookup.texture, lookup.channel), (0, "rgb"))
        (texture,) = self.scene.textures
        self.assertEqual((texture.name, texture.srgb, texture.wrap), ("Test", True, "repeat"))
        self.assertEqual((texture.pixels.dtype, texture.pixels.shape), (np.uint8, (2, 3, 3)))
        # The top row comes first: green grows upwards, but for what is transparent.
        np.testing.assert_array_equal(texture.pixels[:, 0, 1], (255, 128))
        np.testing.assert_array_equal(texture.pixels[1, :, 0], (85, 170, 255))

    def test_colour_is_multiplied_by_an_alpha_that_is_not_used(self) -> None:
        """As in Cycles: where alpha is used too, it is not."""
        node = self.image()
        self.tree.links.new(node.outputs["Alpha"], self.inputs["Alpha"])
        self.part()
        np.testing.assert_array_equal(
            self.scene.textures[0].pixels[0],
            [(85, 255, 255, 255), (170, 255, 0, 0), (255, 255, 128, 0)],
        )
        self.image(node.image, "Roughness")
        part = self.part()
        self.assertEqual([part.color.texture, part.roughness.texture], [0, 1])
        np.testing.assert_array_equal(
            self.scene.textures[1].pixels[0],
            [(85, 255, 255), (0, 0, 0), (0, 0, 0)],
        )

    def test_alpha_that_is_no_alpha(self) -> None:
        """A channel packed image's colour has nothing to do with its alpha."""
        node = self.image()
        self.tree.links.new(node.outputs["Alpha"], self.inputs["Metallic"])
        node.image.alpha_mode = "CHANNEL_PACKED"
        part = self.part()
        color, alpha = (
            self.scene.textures[lookup.texture].pixels[0] for lookup in (part.color, part.metallic)
        )
        np.testing.assert_array_equal(color, [(85, 255, 255), (170, 255, 0), (255, 255, 128)])
        np.testing.assert_array_equal(alpha, [(255,) * 4, (0,) * 4, (0,) * 4])
        node.image.alpha_mode = "NONE"
        part = self.part()
        self.assertEqual(part.metallic, 1.0)
        self.assertEqual(self.scene.textures[0].pixels.shape, (2, 3, 3))

    def test_file_is_handed_over_by_its_path(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "test.png"
            image = picture("Test", 3, 2, opaque=True)
            image.filepath_raw, image.file_format = str(path), "PNG"
            image.save()
            self.image(bpy.data.images.load(str(path)))
            made, notes = self.core_scene()
            (texture,) = self.scene.textures
            self.assertEqual((Path(texture.path), texture.pixels), (path, None))
            self.assertEqual(notes, [])
            self.assertTrue(made.features["textures"])
            read, given = self.texture_in_core(texture), self.texture_in_core_of(image)
            np.testing.assert_allclose(read.average, given.average, rtol=1e-6)

    def texture_in_core(self, texture):
        from bvh_lab.native import core

        return core.Texture.read(texture.path, srgb=texture.srgb)

    def texture_in_core_of(self, image: bpy.types.Image):
        from bvh_lab.blender.textures import read_pixels
        from bvh_lab.native import core

        return core.Texture(read_pixels(image), srgb=True)

    def test_path_relative_to_the_file(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            image = picture("Test", 3, 2, opaque=True)
            image.filepath_raw, image.file_format = str(Path(folder) / "test.png"), "PNG"
            image.save()
            self.image(bpy.data.images.load(image.filepath_raw))
            bpy.ops.wm.save_as_mainfile(filepath=str(Path(folder) / "scene.blend"))
            bpy.data.images["test.png"].filepath = "//test.png"
            self.part()
            self.assertEqual(Path(self.scene.textures[0].path), Path(folder) / "test.png")

    def test_packed_and_float_images(self) -> None:
        packed = picture("Packed", 3, 2)
        packed.pack()
        node = self.image(packed)
        self.part()
        self.assertEqual(self.scene.textures[0].pixels.shape, (2, 3, 3))
        node.image = picture("Float", 3, 2, float_buffer=True)
        self.part()
        (texture,) = self.scene.textures
        self.assertEqual((texture.pixels.dtype, texture.srgb), (np.float32, False))
        self.assertAlmostEqual(float(texture.pixels[1, 0, 0]), 1 / 3, places=6)

    def test_same_image_twice_is_one_texture(self) -> None:
        image = picture("Test", 3, 2)
        self.image(image)
        again = self.image(image, "Roughness")
        self.part()
        self.assertEqual(len(self.scene.textures), 1)
        again.extension = "CLIP"
        part = self.part()
        self.assertEqual([texture.wrap for texture in self.scene.textures], ["repeat", "clip"])
        self.assertEqual((part.color.texture, part.roughness.texture), (0, 1))

    def test_settings_of_the_node(self) -> None:
        node = self.image()
        node.extension, node.interpolation = "EXTEND", "Closest"
        node.image.colorspace_settings.name = "Non-Color"
        self.part()
        (texture,) = self.scene.textures
        self.assertEqual((texture.wrap, texture.closest, texture.srgb), ("extend", True, False))
        node.interpolation = "Cubic"
        self.part()
        self.assertTrue(self.said("cubic interpolation of a texture by linear: Test"))

    def test_other_colour_space_is_said(self) -> None:
        image = picture("Test", 3, 2)
        names = image.colorspace_settings.bl_rna.properties["name"].enum_items.keys()
        name = next(name for name in names if "Filmic" in name or "XYZ" in name)
        image.colorspace_settings.name = name
        self.image(image)
        self.part()
        self.assertTrue(self.said(f"Approximated: colour space {name} read as sRGB: Test"))

    def test_missing_file_is_magenta_and_named(self) -> None:
        image = picture("Lost", 3, 2)
        with tempfile.TemporaryDirectory() as folder:
            image.filepath_raw, image.file_format = str(Path(folder) / "lost.png"), "PNG"
            image.save()
            image = bpy.data.images.load(image.filepath_raw)
        self.image(image)
        _, notes = self.core_scene()
        self.assertEqual(len(notes), 1)
        self.assertIn("Missing texture 'lost.png' is magenta", notes[0])

    def test_image_without_data(self) -> None:
        image = bpy.data.images.new("Nothing", 4, 4)
        image.source = "FILE"  # of no name, and so without pixels
        node = self.image(image)
        self.part()
        self.assertTrue(self.said("Missing texture is magenta: Nothing"))
        np.testing.assert_array_equal(self.scene.textures[0].pixels, [[[1, 0, 1]]])
        node.image = None
        self.assertEqual(self.part().color, (1.0, 0.0, 1.0))
        self.assertTrue(self.said("no image in node 'Image Texture': M"))

    def test_every_extension_reaches_the_core(self) -> None:
        node = self.image()
        for item in node.bl_rna.properties["extension"].enum_items:
            node.extension = item.identifier
            made, notes = self.core_scene()
            self.assertEqual((made.features["textures"], notes), (True, []))


class Lookups(TextureTest):
    def test_channels(self) -> None:
        node = self.image()
        self.tree.links.new(node.outputs["Color"], self.inputs["Roughness"])
        self.tree.links.new(node.outputs["Alpha"], self.inputs["Metallic"])
        separate = self.new("SeparateColor")
        self.tree.links.new(node.outputs["Color"], separate.inputs[0])
        alpha = self.inputs["Alpha"]
        self.tree.links.new(separate.outputs["Blue"], alpha)
        part = self.part()
        self.assertEqual(
            [part.roughness.channel, part.metallic.channel, part.weight.channel],
            ["luminance", "alpha", "blue"],
        )
        clear = self.scene.materials[1].components[1]
        self.assertEqual((clear.model, clear.weight.channel), ("transparent", "blue"))
        self.assertEqual((clear.weight.scale[0], clear.weight.offset[0]), (-1.0, 1.0))

    def test_textured_mix_of_shaders(self) -> None:
        node, mix, diffuse = self.image(), self.new("MixShader"), self.new("BsdfDiffuse")
        self.tree.links.new(node.outputs["Alpha"], mix.inputs[0])
        self.tree.links.new(self.tree.nodes["Principled BSDF"].outputs[0], mix.inputs[1])
        self.tree.links.new(diffuse.outputs[0], mix.inputs[2])
        self.tree.links.new(mix.outputs[0], self.tree.nodes["Material Output"].inputs[0])
        first = self.part().weight
        second = self.scene.materials[1].components[1].weight
        self.assertEqual((first.scale[0], first.offset[0]), (-1.0, 1.0))
        self.assertEqual((second.scale[0], second.offset[0]), (1.0, 0.0))

    def test_textured_emission(self) -> None:
        name = "Emission Color" if "Emission Color" in self.inputs else "Emission"
        self.image(to=name)
        self.inputs["Emission Strength"].default_value = 4
        self.part()
        material = self.scene.materials[1]
        self.assertEqual(material.emission.scale, (4.0, 4.0, 4.0))
        self.assertTrue(material.emits)

    def test_product_and_mix_with_a_constant_are_exact(self) -> None:
        node, mix = self.image(), self.new("MixRGB")
        mix.blend_type, mix.inputs[0].default_value = "MULTIPLY", 0.5
        self.tree.links.new(node.outputs[0], mix.inputs[1])
        mix.inputs[2].default_value = (0.5, 1, 0, 1)
        self.tree.links.new(mix.outputs[0], self.inputs["Base Color"])
        self.assertEqual(self.part().color.scale, (0.75, 1.0, 0.5))
        mix.blend_type = "MIX"
        lookup = self.part().color
        self.assertEqual((lookup.scale, lookup.offset), ((0.5,) * 3, (0.25, 0.5, 0.0)))
        self.assertFalse([note for note in self.scene.notes if note.endswith(": M.")])

    def test_linear_nodes_are_exact(self) -> None:
        node, invert, bright = self.image(), self.new("Invert"), self.new("BrightContrast")
        self.tree.links.new(node.outputs[0], invert.inputs["Color"])
        self.tree.links.new(invert.outputs[0], bright.inputs["Color"])
        bright.inputs[1].default_value = 0.25
        self.tree.links.new(bright.outputs[0], self.inputs["Base Color"])
        lookup = self.part().color
        self.assertEqual((lookup.scale, lookup.offset), ((-1.0,) * 3, (1.25,) * 3))
        ramp = self.new("ValToRGB")
        ramp.color_ramp.elements[0].color = (1, 0, 0, 1)
        ramp.color_ramp.elements[1].color = (0, 0.5, 0, 1)
        self.tree.links.new(node.outputs["Alpha"], ramp.inputs[0])
        self.tree.links.new(ramp.outputs[0], self.inputs["Base Color"])
        lookup = self.part().color
        self.assertEqual((lookup.channel, lookup.offset), ("alpha", (1.0, 0.0, 0.0)))
        np.testing.assert_allclose(lookup.scale, (-1, 0.5, 0))
        self.assertFalse([note for note in self.scene.notes if note.endswith(": M.")])

    def test_what_passes_through_is_said(self) -> None:
        node = self.image()
        for kind, said, values in (
            ("Gamma", "gamma of a texture ignored", {"Gamma": 2.2}),
            ("HueSaturation", "hue and saturation of a texture unchanged", {"Saturation": 0.5}),
            ("RGBCurve", "curves of a texture ignored", {}),
        ):
            with self.subTest(kind=kind):
                between = self.new(kind)
                for name, value in values.items():
                    between.inputs[name].default_value = value
                self.tree.links.new(node.outputs[0], between.inputs["Color"])
                self.tree.links.new(between.outputs[0], self.inputs["Base Color"])
                self.assertEqual(self.part().color.scale, (1.0, 1.0, 1.0))
                self.assertTrue(self.said(f"Approximated: {said}: M"))
        other = self.image(picture("Other", 2, 2))
        mix = self.new("MixRGB")
        mix.blend_type = "MULTIPLY"
        self.tree.links.new(node.outputs[0], mix.inputs[1])
        self.tree.links.new(other.outputs[0], mix.inputs[2])
        self.tree.links.new(mix.outputs[0], self.inputs["Base Color"])
        self.part()
        self.assertTrue(self.said("Approximated: product of two textures: M"))


if __name__ == "__main__":
    unittest.main()
