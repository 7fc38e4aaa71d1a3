# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights shine as in Cycles: extraction and picture together, on a plane under one light."""

from __future__ import annotations

import math
import tempfile
import unittest
from pathlib import Path

import bpy
import numpy as np
from blender_support import (
    EmptySceneTest,
    add_camera,
    add_light,
    add_material,
    add_mesh,
    use_nodes,
)

SIDE = 16
SAMPLES = 64


def cycles_picture() -> np.ndarray:
    """(SIDE, SIDE, 3): the scene by Cycles on the CPU, direct light only, without denoising."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples, scene.cycles.max_bounces = SAMPLES, 0
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    if scene.world:
        scene.world.cycles.sampling_method = "MANUAL"  # light from a constant world too is direct
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "cycles.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        image.colorspace_settings.name = "Non-Color"
        pixels = np.empty(SIDE * SIDE * 4, np.float32)
        image.pixels.foreach_get(pixels)
        bpy.data.images.remove(image)
    return pixels.reshape(SIDE, SIDE, 4)[::-1, :, :3]


class AgainstCycles(EmptySceneTest):
    def setUp(self) -> None:
        super().setUp()
        import addon_utils  # found only once bpy is imported

        if not addon_utils.check("cycles")[1] and addon_utils.enable("cycles") is None:
            self.skipTest("this Blender has no Cycles")
        corners = [(-50, -50, 0), (50, -50, 0), (50, 50, 0), (-50, 50, 0)]
        floor = add_mesh("Floor", corners, [(0, 1, 2, 3)])
        floor.data.materials.append(self.diffuse((0.8, 0.5, 0.2)))
        camera = add_camera()
        camera.location = (0, 0, 10)
        camera.data.type, camera.data.ortho_scale = "ORTHO", 2
        scene = bpy.context.scene
        scene.camera = camera
        scene.render.resolution_x = scene.render.resolution_y = SIDE
        scene.render.resolution_percentage = 100

    def diffuse(self, color: tuple[float, float, float]) -> bpy.types.Material:
        material = add_material("Diffuse")
        tree = material.node_tree
        tree.nodes.clear()
        shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
        shader.inputs["Color"].default_value = (*color, 1)
        output = tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(shader.outputs[0], output.inputs["Surface"])
        return material

    def lamp(self, kind: str, energy: float, size: float) -> bpy.types.Light:
        lamp = add_light(kind)
        lamp.location, lamp.rotation_euler = (0.3, 0.2, 2), (0.2, 0.1, 0)
        lamp.data.energy, lamp.data.color = energy, (1, 0.8, 0.6)
        setattr(lamp.data, {"SUN": "angle", "AREA": "size"}.get(kind, "shadow_soft_size"), size)
        return lamp.data

    def our_picture(self) -> np.ndarray:
        from bvh_lab.native import core
        from bvh_lab.study.rays import core_scene

        found = self.extract("render")
        mesh = core.Mesh(found.vertices, found.triangles)
        view = found.cameras[0]
        return core.render(
            core.build(mesh, "lbvh"),
            core_scene(core, mesh, found),
            core.Camera(view.kind, view.to_world, view.window, view.clip_start),
            SIDE,
            SIDE,
            samples=SAMPLES,
        ).pixels

    def check(self) -> None:
        ours, theirs = self.our_picture().mean((0, 1)), cycles_picture().mean((0, 1))
        self.assertGreater(theirs.min(), 0.005)
        np.testing.assert_allclose(ours, theirs, rtol=0.005)

    def test_point(self) -> None:
        self.lamp("POINT", 100, 0.5)
        self.check()

    def test_sun(self) -> None:
        self.lamp("SUN", 3, 0.02)
        self.check()

    def test_spot(self) -> None:
        if bpy.app.version < (4, 0, 0):
            self.skipTest("older Cycles dims spots by the cosine to their axis")
        lamp = self.lamp("SPOT", 100, 0.3)
        lamp.spot_size, lamp.spot_blend = math.radians(50), 0.4
        self.check()

    def test_area_rectangle(self) -> None:
        lamp = self.lamp("AREA", 100, 1.5)
        lamp.shape, lamp.size_y = "RECTANGLE", 0.5
        self.check()

    def test_area_ellipse(self) -> None:
        lamp = self.lamp("AREA", 100, 1.5)
        lamp.shape, lamp.size_y = "ELLIPSE", 0.7
        self.check()

    def test_emitting_mesh(self) -> None:
        shade = add_mesh("Lamp", [(0, 0, 1.5), (1, 0, 2), (0, 1, 2)], [(0, 1, 2)])
        material = add_material("Emission")
        tree = material.node_tree
        tree.nodes.clear()
        shader = tree.nodes.new("ShaderNodeEmission")
        shader.inputs["Strength"].default_value = 5
        output = tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(shader.outputs[0], output.inputs["Surface"])
        shade.data.materials.append(material)
        bpy.context.scene.camera.data.clip_start = 9  # the camera looks from below it
        self.check()

    def test_world(self) -> None:
        world = bpy.context.scene.world = bpy.data.worlds.new("World")
        use_nodes(world)
        world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.7, 0.6, 0.5, 1)
        self.lamp("SUN", 0.1, 0.02)  # without any lamp, extraction makes the world white
        self.check()


if __name__ == "__main__":
    unittest.main()
