# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tests of the render engine and of its viewport start from."""

from __future__ import annotations

import struct
import tempfile
import threading
from pathlib import Path

import bpy
import numpy as np
from blender_support import (
    EmptySceneTest,
    add_camera,
    add_cube,
    add_light,
    add_material,
    add_mesh,
)

WIDTH, HEIGHT, SAMPLES = 24, 16, 3
EVERY_PASS = {"Combined", "Depth", "Normal", "Albedo", "Traversal Steps", "Triangle Tests"}


def read_exr(path: Path) -> dict[str, np.ndarray]:
    """An uncompressed float OpenEXR file: (H, W, C) by layer and pass, e.g. "ViewLayer.Combined".

    Channels come in the order R G B A or X Y Z. The format: openexr.com, "File Layout".
    """
    data = path.read_bytes()
    attributes, at = {}, 8
    while data[at]:
        name, kind, rest = data[at:].split(b"\0", 2)
        at += len(name) + len(kind) + 2
        (size,) = struct.unpack_from("<i", data, at)
        attributes[name.decode()] = data[at + 4 : at + 4 + size]
        at += 4 + size
    assert attributes["compression"] == b"\0", "not written uncompressed"
    names, channels = [], attributes["channels"]
    while channels[0]:
        name, rest = channels.split(b"\0", 1)
        assert rest[:4] == b"\2\0\0\0", "not float"
        names.append(name.decode())
        channels = rest[16:]
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    lines = np.frombuffer(data, np.uint8, offset=at + 1 + 8 * height)
    lines = lines.reshape(height, 8 + 4 * width * len(names))[:, 8:].copy()
    planes = lines.view("<f4").reshape(height, len(names), width)
    found: dict[str, dict[str, np.ndarray]] = {}
    for number, name in enumerate(names):
        layer, _, channel = name.rpartition(".")
        found.setdefault(layer, {})[channel] = planes[:, number]
    order = "RGBAXYZ"
    return {
        layer: np.stack([parts[key] for key in sorted(parts, key=order.index)], axis=2)
        for layer, parts in found.items()
    }


def our_threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if "bvh_lab" in thread.name]


class EngineTest(EmptySceneTest):
    """A red cube on a grey floor under a lamp, seen from above at an angle."""

    def setUp(self) -> None:
        super().setUp()
        import bvh_lab

        bvh_lab.register()
        self.addCleanup(bvh_lab.unregister)
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        red = add_material("Red")
        red.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.8, 0, 0, 1)
        self.cube = add_cube()
        self.cube.data.materials.append(red)
        add_mesh("Floor", [(-4, -4, -1), (4, -4, -1), (4, 4, -1), (-4, 4, -1)], [(0, 1, 2, 3)])
        lamp = add_light("POINT")
        lamp.location, lamp.data.energy = (3, -2, 5), 800
        camera = add_camera()
        camera.location, camera.rotation_euler = (0, -6, 5), (0.9, 0, 0)
        self.scene = bpy.context.scene
        self.scene.camera = camera
        render = self.scene.render
        render.engine = "BVHLAB"
        render.resolution_x, render.resolution_y = WIDTH, HEIGHT
        render.resolution_percentage = 100
        render.filepath = str(self.folder / "picture")
        image = render.image_settings
        if hasattr(image, "media_type"):  # Blender 5.0
            image.media_type = "MULTI_LAYER_IMAGE"
            image.use_exr_interleave = True
        image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR_MULTILAYER", "32", "NONE"
        self.settings = self.scene.bvh_lab_render
        self.settings.samples = SAMPLES

    def render(self) -> dict[str, np.ndarray]:
        """What F12 writes, by name of layer and pass."""
        bpy.ops.render.render(write_still=True)
        return read_exr(self.folder / "picture.exr")

    def picture(self, **changes):
        """The same by the core alone."""
        from bvh_lab.native import core
        from bvh_lab.study.core_scene import core_camera, core_scene

        scene = self.extract("render")
        mesh = core.Mesh(scene.vertices, scene.triangles)
        made, _ = core_scene(core, mesh, scene)
        bvh = core.build(mesh, "lbvh", branching=2)
        camera = core_camera(core, scene.cameras[0])
        options = {"samples": SAMPLES, "passes": True, **changes}
        return core.render(bvh, made, camera, WIDTH, HEIGHT, **options)

    def ask_for_passes(self, layer: bpy.types.ViewLayer) -> None:
        layer.use_pass_z = layer.use_pass_normal = True
        for name in ("albedo", "traversal_steps", "triangle_tests"):
            setattr(layer.bvh_lab, f"use_pass_{name}", True)
