# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the open scene by Cycles and by us, and their comparison."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np
from blender_support import EmptySceneTest, add_camera, add_material


def cycles_picture(side: int, samples: int, depth: int) -> np.ndarray:
    """(side, side, 3) by Cycles on the CPU: no denoising, clamping or other shortcut."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    settings = scene.cycles
    settings.device = "CPU"
    settings.samples, settings.max_bounces = samples, depth
    for kind in ("diffuse", "glossy", "transmission"):
        setattr(settings, f"{kind}_bounces", depth)
    settings.transparent_max_bounces = 32
    settings.use_denoising = settings.use_adaptive_sampling = False
    settings.blur_glossy = settings.light_sampling_threshold = 0.0
    settings.sample_clamp_direct = settings.sample_clamp_indirect = 0.0
    settings.pixel_filter_type = "BOX"  # each pixel its own mean, as ours
    if scene.world:
        # Light from a constant world too is direct.
        scene.world.cycles.sampling_method, scene.world.cycles.sample_map_resolution = (
            "MANUAL",
            256,
        )
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "cycles.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        image.colorspace_settings.name = "Non-Color"
        pixels = np.empty(side * side * 4, np.float32)
        image.pixels.foreach_get(pixels)
        bpy.data.images.remove(image)
    return pixels.reshape(side, side, 4)[::-1, :, :3]


def our_picture(found, side: int, samples: int, depth: int) -> np.ndarray:
    """(side, side, 3): the extracted scene through its first camera."""
    from bvh_lab.native import core
    from bvh_lab.study.core_scene import core_camera, core_scene

    mesh = core.Mesh(found.vertices, found.triangles)
    scene, notes = core_scene(core, mesh, found)
    assert not notes, notes
    camera = core_camera(core, found.cameras[0])
    tree = core.build(mesh, "lbvh")
    return core.render(
        tree, scene, camera, side, side, samples=samples, depth=depth, threads=2
    ).pixels


class CyclesTest(EmptySceneTest):
    """Both pictures of a square view."""

    side, samples, depth = 16, 64, 0

    def setUp(self) -> None:
        super().setUp()
        import addon_utils  # found only once bpy is imported

        if not addon_utils.check("cycles")[1] and addon_utils.enable("cycles") is None:
            self.skipTest("this Blender has no Cycles")
        scene = bpy.context.scene
        scene.render.resolution_x = scene.render.resolution_y = self.side
        scene.render.resolution_percentage = 100

    def look_down(self, size: float, height: float = 10.0) -> bpy.types.Object:
        """An orthographic camera that sees ``size`` x ``size`` around the origin from above."""
        camera = bpy.context.scene.camera = add_camera()
        camera.location = (0, 0, height)
        camera.data.type, camera.data.ortho_scale = "ORTHO", size
        return camera

    def shader(self, kind: str, **inputs: object) -> tuple[bpy.types.Material, bpy.types.Node]:
        """A material of one shader node; ``inputs`` by name, with _ for a space."""
        material = add_material(kind)
        tree = material.node_tree
        tree.nodes.clear()
        shader = tree.nodes.new("ShaderNode" + kind)
        for name, value in inputs.items():
            shader.inputs[name.replace("_", " ")].default_value = value
        output = tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(shader.outputs[0], output.inputs["Surface"])
        return material, shader

    def pictures(self) -> tuple[np.ndarray, np.ndarray]:
        """Ours and Cycles'."""
        found = self.extract("render")
        ours = our_picture(found, self.side, self.samples, self.depth)
        return ours, cycles_picture(self.side, self.samples, self.depth)
