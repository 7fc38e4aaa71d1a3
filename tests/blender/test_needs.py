# SPDX-License-Identifier: GPL-3.0-or-later
"""Only what the scene needs: without a feature its data is neither read nor kept.

And what a scene has but does not use changes no bit of the picture.
"""

from __future__ import annotations

import unittest
from collections import Counter
from unittest import mock

import bpy
import numpy as np
from blender_support import EmptySceneTest, add_camera, add_light, add_material, add_mesh, use_nodes

GLOSSY = "BsdfGlossy" if bpy.app.version < (4, 0, 0) else "BsdfAnisotropic"
PLAIN = {"lamps"}  # what the scene of these tests uses


def add_plane(name: str = "Plane") -> bpy.types.Object:
    plane = add_mesh(name, [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], [(0, 1, 2, 3)])
    plane.data.uv_layers.new(name="UVMap")
    return plane


class NeedsTest(EmptySceneTest):
    """A grey diffuse plane with a UV map, under a lamp, before a camera."""

    def setUp(self) -> None:
        super().setUp()
        self.plane = add_plane()
        self.tree = add_material("Paint").node_tree
        self.plane.data.materials.append(bpy.data.materials["Paint"])
        self.show("BsdfDiffuse")
        lamp = add_light("POINT")
        lamp.location, lamp.data.energy = (0, 0, 3), 100
        camera = add_camera()
        camera.location.z = 6
        bpy.context.scene.camera = camera

    def show(self, kind: str, tree: bpy.types.NodeTree | None = None) -> bpy.types.Node:
        tree = tree or self.tree
        node = tree.nodes.new("ShaderNode" + kind)
        output = next(each for each in tree.nodes if each.type.startswith("OUTPUT"))
        tree.links.new(node.outputs[0], output.inputs["Surface"])
        return node

    def texture(self, tree: bpy.types.NodeTree, target: bpy.types.NodeSocket) -> bpy.types.Node:
        image = bpy.data.images.new("Picture", 4, 4)
        image.pixels[:] = np.random.default_rng(5).random(64).tolist()
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        tree.links.new(node.outputs[0], target)
        return node

    def count(self) -> tuple[Counter, object]:
        """How often extraction reads what not every scene needs, and the scene."""
        from bvh_lab.blender import lights, local_mesh, materials, textures, world

        calls: Counter = Counter()

        def counted(module, name):
            original = getattr(module, name)

            def call(*args, **kwargs):
                calls[name] += 1
                return original(*args, **kwargs)

            return mock.patch.object(module, name, call)

        with (
            counted(local_mesh, "_loop_uvs"),
            counted(local_mesh, "_loop_normals"),
            counted(textures, "read_pixels"),
            counted(textures.Textures, "_read"),
            counted(materials, "read_material"),
            counted(lights, "read_light"),
            counted(world, "_radiance"),
        ):
            scene = self.extract()
        return calls, scene

    def native(self, scene):
        from bvh_lab.native import core
        from bvh_lab.study.core_scene import core_scene

        mesh = core.Mesh(scene.vertices, scene.triangles)
        return mesh, core_scene(core, mesh, scene)[0]

    def features(self, scene) -> set[str]:
        return {name for name, used in self.native(scene)[1].features.items() if used}

    def picture(self) -> np.ndarray:
        from bvh_lab.native import core
        from bvh_lab.study.core_scene import core_camera

        scene = self.extract()
        mesh, made = self.native(scene)
        bvh = core.build(mesh, "sah")
        camera = core_camera(core, scene.cameras[0])
        return core.render(bvh, made, camera, 24, 24, samples=4).pixels


class Unused(NeedsTest):
    def test_a_plain_scene(self) -> None:
        calls, scene = self.count()
        self.assertEqual(calls, {"read_material": 1, "read_light": 1})
        self.assertEqual((scene.uvs, scene.normals, scene.textures), (None, None, []))
        self.assertEqual(self.features(scene), PLAIN)
        held = self.native(scene)[1].bytes
        empty = {name for name, size in held.items() if size == 0}
        self.assertEqual(empty, {"lookups", "textures", "uvs", "normals"})

    def test_each_feature_brings_its_own(self) -> None:
        """Only where a feature is used is its data read, and then it is held."""
        for change, feature, reads, kept in (
            (self.use_texture, "textures", {"_loop_uvs", "_read"}, {"textures", "uvs", "lookups"}),
            (self.use_smooth, "smooth", {"_loop_normals"}, {"normals"}),
            (lambda: self.show(GLOSSY), "gloss", set(), set()),
            (lambda: self.show("BsdfTranslucent"), "transmission", set(), set()),
            (lambda: self.show("BsdfTransparent"), "transparency", set(), set()),
            (lambda: self.show("Emission"), "emitters", set(), set()),
            (self.use_world, "world", {"_radiance"}, set()),
            (self.use_environment, "environment", {"_radiance", "_read"}, {"textures"}),
        ):
            with self.subTest(feature=feature):
                self.setUp()
                change()
                calls, scene = self.count()
                expected = dict.fromkeys({"read_material", "read_light", *reads}, 1)
                calls.pop("read_pixels", None)  # a picture that only Blender has
                self.assertEqual(calls, expected)
                self.assertIn(feature, self.features(scene))
                if feature not in {"gloss", "transmission", "environment"}:  # these imply others
                    self.assertEqual(self.features(scene), PLAIN | {feature})
                held = self.native(scene)[1].bytes
                optional = {"lookups", "textures", "uvs", "normals"}
                self.assertEqual({name for name in optional if held[name]}, kept)

    def use_texture(self) -> None:
        self.texture(self.tree, self.show("BsdfDiffuse").inputs["Color"])

    def use_smooth(self) -> None:
        for polygon in self.plane.data.polygons:
            polygon.use_smooth = True

    def use_world(self) -> bpy.types.Node:
        bpy.context.scene.world = bpy.data.worlds.new("World")
        use_nodes(bpy.context.scene.world)
        return self.show("Background", bpy.context.scene.world.node_tree)

    def use_environment(self) -> None:
        background = self.use_world()
        tree = bpy.context.scene.world.node_tree
        node = tree.nodes.new("ShaderNodeTexEnvironment")
        node.image = bpy.data.images.new("Surroundings", 4, 2)
        tree.links.new(node.outputs[0], background.inputs["Color"])

    def test_a_sharp_camera_has_no_lens(self) -> None:
        self.assertEqual(self.extract().cameras[0].lens_radius, 0.0)


class Unseen(NeedsTest):
    """What is there but not used: as if it were not."""

    def assert_as_before(self, change) -> None:
        before, (calls_before, scene_before) = self.picture(), self.count()
        change()
        calls, scene = self.count()
        self.assertEqual(calls, calls_before)
        self.assertEqual(scene.textures, [])
        self.assertEqual(self.features(scene), self.features(scene_before))
        self.assertEqual(scene.notes, scene_before.notes)
        np.testing.assert_array_equal(self.picture(), before)
        self.assertGreater(before.std(), 0.0)

    def textured(self, name: str = "Unused") -> bpy.types.Material:
        material = add_material(name)
        tree = material.node_tree
        self.texture(tree, tree.nodes["Principled BSDF"].inputs["Base Color"])
        return material

    def test_a_textured_material_in_a_slot_that_no_face_has(self) -> None:
        self.assert_as_before(lambda: self.plane.data.materials.append(self.textured()))

    def test_a_second_uv_map_and_images_that_no_node_looks_up(self) -> None:
        def change() -> None:
            self.plane.data.uv_layers.new(name="Second")
            self.tree.nodes.new("ShaderNodeTexImage").image = bpy.data.images.new("Loose", 8, 8)

        self.assert_as_before(change)

    def test_a_texture_times_nothing(self) -> None:
        def change() -> None:
            tree = self.tree
            emission, add = (
                tree.nodes.new("ShaderNodeEmission"),
                tree.nodes.new("ShaderNodeAddShader"),
            )
            emission.inputs["Strength"].default_value = 0.0
            self.texture(tree, emission.inputs["Color"])
            diffuse = next(node for node in tree.nodes if node.type == "BSDF_DIFFUSE")
            tree.links.new(diffuse.outputs[0], add.inputs[0])
            tree.links.new(emission.outputs[0], add.inputs[1])
            tree.links.new(add.outputs[0], tree.nodes["Material Output"].inputs["Surface"])

        self.assert_as_before(change)

    def test_a_world_whose_picture_does_not_shine(self) -> None:
        def change() -> None:
            world = bpy.data.worlds.new("Night")
            use_nodes(world)
            bpy.context.scene.world = world
            tree = world.node_tree
            node = tree.nodes.new("ShaderNodeTexEnvironment")
            node.image = bpy.data.images.new("Surroundings", 4, 2)
            tree.links.new(node.outputs[0], tree.nodes["Background"].inputs["Color"])
            tree.nodes["Background"].inputs["Strength"].default_value = 0.0

        bpy.context.scene.world = None
        before = self.picture()
        change()
        scene = self.extract()
        self.assertEqual((scene.textures, scene.world.texture), ([], None))
        np.testing.assert_array_equal(self.picture(), before)

    def test_hidden_objects_bring_nothing(self) -> None:
        def change() -> None:
            hidden = add_plane("Hidden")
            hidden.data.materials.append(self.textured())
            hidden.data.polygons[0].use_smooth = True
            hidden.hide_set(True)

        self.assert_as_before(change)


if __name__ == "__main__":
    unittest.main()
