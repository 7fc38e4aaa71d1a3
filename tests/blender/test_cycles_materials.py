# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials, textures, worlds and lenses look as in Cycles: extraction and picture together.

Compared are the means of blocks of pixels, so that a texture that is turned or a highlight that is
displaced shows.
"""

from __future__ import annotations

import math
import unittest

import bpy
import numpy as np
from blender_support import add_camera, add_light, use_nodes
from cycles_support import CyclesTest
from texture_support import picture, uv_square

BLOCKS = 4


def block_means(picture: np.ndarray) -> np.ndarray:
    """(BLOCKS, BLOCKS, 3)."""
    side = len(picture) // BLOCKS
    return picture.reshape(BLOCKS, side, BLOCKS, side, 3).mean((1, 3))


class MaterialsAgainstCycles(CyclesTest):
    side, samples, depth = 32, 64, 4

    def check(self, mean: float, block: float) -> None:
        """Relative tolerances: of the picture's mean, and of any block's to the brightest one."""
        ours, theirs = self.pictures()
        self.assertGreater(theirs.mean(), 0.01)
        self.assertLess(abs(ours.mean() / theirs.mean() - 1.0), mean)
        one, two = block_means(ours), block_means(theirs)
        self.assertLess(float(np.abs(one - two).max() / two.max()), block)

    def sky(self, color: tuple[float, float, float], strength: float = 1.0) -> bpy.types.NodeTree:
        world = bpy.context.scene.world = bpy.data.worlds.new("World")
        use_nodes(world)
        background = world.node_tree.nodes["Background"]
        background.inputs["Color"].default_value = (*color, 1)
        background.inputs["Strength"].default_value = strength
        return world.node_tree

    def lamp(self) -> None:
        lamp = add_light("AREA")
        lamp.location, lamp.rotation_euler = (1.5, -1, 3), (0.3, 0.4, 0)
        lamp.data.energy, lamp.data.size = 150, 1.0

    def ball(self, material: bpy.types.Material, segments: int = 24) -> bpy.types.Object:
        bpy.ops.mesh.primitive_uv_sphere_add(
            segments=segments, ring_count=segments // 2, radius=0.8
        )
        ball = bpy.context.object
        for polygon in ball.data.polygons:
            polygon.use_smooth = True
        ball.data.materials.append(material)
        return ball

    def floor(self, z: float = -0.8) -> None:
        square = uv_square("Floor", 6.0)
        square.location.z = z
        square.data.materials.append(self.shader("BsdfDiffuse", Color=(0.6, 0.4, 0.2, 1))[0])

    def image_node(
        self, material: bpy.types.Material, image: bpy.types.Image, target: bpy.types.NodeSocket
    ) -> bpy.types.Node:
        node = material.node_tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        material.node_tree.links.new(node.outputs[0], target)
        return node

    def test_textured_plane(self) -> None:
        """Orientation, colour space, wrap and mapping, under a white sky: hardly any noise."""
        self.look_down(2)
        self.sky((1, 1, 1))
        material, shader = self.shader("BsdfDiffuse")
        node = self.image_node(material, picture("Test", 5, 3), shader.inputs["Color"])
        uv_square("Square", 2.0).data.materials.append(material)
        mapping = material.node_tree.nodes.new("ShaderNodeMapping")
        coordinates = material.node_tree.nodes.new("ShaderNodeTexCoord")
        material.node_tree.links.new(coordinates.outputs["UV"], mapping.inputs["Vector"])
        material.node_tree.links.new(mapping.outputs[0], node.inputs["Vector"])
        mapping.inputs["Rotation"].default_value = (0.2, 0, 0.5)
        mapping.inputs["Scale"].default_value = (1.7, 1.3, 1)
        mapping.inputs["Location"].default_value = (-0.3, -0.2, 0.1)
        self.samples = 16
        for extension, interpolation, kind in (
            ("REPEAT", "Linear", "POINT"),
            ("EXTEND", "Closest", "TEXTURE"),
            ("CLIP", "Linear", "POINT"),
            ("MIRROR", "Linear", "VECTOR"),
        ):
            if extension == "MIRROR" and bpy.app.version < (3, 5, 0):
                continue
            with self.subTest(extension=extension, interpolation=interpolation, kind=kind):
                node.extension, node.interpolation = extension, interpolation
                mapping.vector_type = kind
                self.check(mean=0.005, block=0.01)

    def test_smooth_diffuse_ball(self) -> None:
        self.look_down(2)
        self.lamp()
        self.sky((0.3, 0.4, 0.5))
        self.ball(self.shader("BsdfDiffuse", Color=(0.8, 0.5, 0.3, 1))[0]).scale = (1, 0.6, -1)
        self.floor()
        self.check(mean=0.01, block=0.02)

    def test_principled_plastic_and_metal(self) -> None:
        """Ours keeps the light that single scattering between microfacets loses.

        Before Blender 4.0 the coat did not take from the diffuse base what it reflects.
        """
        self.look_down(2)
        self.lamp()
        self.sky((0.3, 0.4, 0.5))
        self.floor()
        material, shader = self.shader("BsdfPrincipled", Roughness=0.3)
        shader.inputs["Base Color"].default_value = (0.7, 0.2, 0.1, 1)
        self.ball(material)
        older = bpy.app.version < (4, 0, 0)
        for metallic, mean in ((0.0, 0.05 if older else 0.01), (1.0, 0.02)):
            with self.subTest(metallic=metallic):
                shader.inputs["Metallic"].default_value = metallic
                self.check(mean=mean, block=0.08 if older else 0.04)

    def test_glass_ball(self) -> None:
        self.look_down(2)
        self.sky((0.3, 0.4, 0.5))
        self.floor()
        self.ball(self.shader("BsdfGlass", IOR=1.45)[0])
        self.depth = 8
        self.check(mean=0.01, block=0.04)

    def test_alpha_cut_out(self) -> None:
        self.look_down(2)
        self.lamp()
        self.floor(-0.5)
        material, shader = self.shader("BsdfPrincipled")
        node = self.image_node(material, picture("Leaf", 5, 3), shader.inputs["Base Color"])
        material.node_tree.links.new(node.outputs["Alpha"], shader.inputs["Alpha"])
        if hasattr(material, "blend_method"):
            material.blend_method = "HASHED"
        uv_square("Leaf", 1.5).data.materials.append(material)
        self.check(mean=0.01, block=0.03)

    def test_environment(self) -> None:
        """Seen directly, by a wide camera that looks off the axes, and turned."""
        uv_square("Speck", 1e-3).location.z = -50
        camera = bpy.context.scene.camera = add_camera()
        camera.data.lens, camera.rotation_euler = 10, (1.2, 0.3, 0.8)
        tree = self.sky((1, 1, 1), 1.5)
        node = tree.nodes.new("ShaderNodeTexEnvironment")
        node.image = picture("Sky", 8, 4)
        tree.links.new(node.outputs[0], tree.nodes["Background"].inputs["Color"])
        self.samples = 16
        self.check(mean=0.005, block=0.02)
        mapping = tree.nodes.new("ShaderNodeMapping")
        coordinates = tree.nodes.new("ShaderNodeTexCoord")
        tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs[0], node.inputs["Vector"])
        mapping.inputs["Rotation"].default_value = (0.3, -0.4, 1.1)
        self.check(mean=0.005, block=0.02)

    def test_light_of_an_environment(self) -> None:
        self.look_down(2)
        tree = self.sky((1, 1, 1))
        node = tree.nodes.new("ShaderNodeTexEnvironment")
        node.image = picture("Sky", 8, 4)
        tree.links.new(node.outputs[0], tree.nodes["Background"].inputs["Color"])
        self.floor()
        self.ball(self.shader("BsdfDiffuse")[0])
        self.check(mean=0.01, block=0.03)

    def test_depth_of_field(self) -> None:
        """A sharp edge far out of focus, where the lens is all there is to see."""
        self.sky((1, 1, 1))
        material, shader = self.shader("BsdfDiffuse")
        self.image_node(
            material, picture("Test", 5, 3), shader.inputs["Color"]
        ).interpolation = "Closest"
        uv_square("Square", 2.0).data.materials.append(material)
        for kind, stop in (("PERSP", 0.05), ("ORTHO", 2.0)):
            if kind == "ORTHO" and bpy.app.version < (4, 0, 0):
                continue  # older Cycles blurs parallel rays a little less
            with self.subTest(kind=kind):
                camera = bpy.context.scene.camera = add_camera()
                camera.location = (0.2, -0.4, 3)
                camera.rotation_euler = (math.atan2(0.4, 3), math.atan2(0.2, 3), 0)
                camera.data.type, camera.data.ortho_scale = kind, 2
                camera.data.dof.use_dof, camera.data.dof.focus_distance = True, 2.0
                camera.data.dof.aperture_fstop = stop
                self.check(mean=0.01, block=0.02)


if __name__ == "__main__":
    unittest.main()
