# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenCL devices inside Blender: drivers bring compilers beside Blender's own libraries."""

from __future__ import annotations

import unittest
from unittest import mock

import bpy
import numpy as np
from blender_support import EmptySceneTest, add_camera, add_cube, add_light


def soup(count: int):
    from bvh_lab.native import core

    random = np.random.default_rng(1)
    corners = random.random((count, 1, 3)) + 0.1 * (random.random((count, 3, 3)) - 0.5)
    vertices = corners.reshape(-1, 3).astype(np.float32)
    return core.Mesh(vertices, np.arange(3 * count, dtype=np.uint32).reshape(-1, 3))


class Devices(unittest.TestCase):
    def test_hits_are_those_of_the_cpu(self) -> None:
        from bvh_lab.native import core

        random = np.random.default_rng(2)
        origins, directions = random.random((2, 3000, 3)).astype(np.float32) - np.float32(0.25)
        bvh = core.build(soup(2000), "lbvh", 4, device="opencl")
        ours = core.trace(bvh, origins, directions, device="opencl")
        theirs = core.trace(bvh, origins, directions)
        self.assertTrue(ours.device.startswith("opencl:"))
        self.assertGreater(int(theirs.occluded.sum()), 100)
        for name in ("t", "u", "v", "triangle"):
            self.assertEqual(getattr(ours, name).tobytes(), getattr(theirs, name).tobytes(), name)


class Panel(EmptySceneTest):
    def setUp(self) -> None:
        super().setUp()
        import bvh_lab
        from bvh_lab.blender import store

        store.devices.cache_clear()
        self.addCleanup(store.devices.cache_clear)
        bvh_lab.register()
        self.addCleanup(bvh_lab.unregister)

    def offered(self) -> list[str]:
        from bvh_lab.blender import properties

        return [item[0] for item in properties._device_items(bpy.context.scene.bvh_lab, None)]

    def test_the_list_with_opencl(self) -> None:
        from bvh_lab.blender import panels
        from bvh_lab.native import core

        there = [device["id"] for device in core.devices() if device["available"]]
        self.assertEqual(self.offered(), there)
        self.assertGreater(len(there), 1)
        settings = bpy.context.scene.bvh_lab
        self.assertEqual(settings.plan().devices, ["cpu"])
        settings.device = there[1]
        self.assertEqual(settings.plan().devices, [there[1]])
        left_out = [device for device in core.devices() if not device["available"]]
        self.assertEqual(len(panels.devices_left_out("cpu")), len(left_out))
        self.assertIn("not here", panels.devices_left_out("")[0])

    def test_the_list_without_opencl(self) -> None:
        from bvh_lab.blender import panels, store

        cpu = store.devices()[0]
        lost = dict(cpu, id="opencl", name="OpenCL", available=False, reason="there is no loader")
        with mock.patch.object(store, "devices", lambda: [cpu, lost]):
            self.assertEqual(self.offered(), ["cpu"])
            self.assertEqual(panels.devices_left_out("cpu"), ["OpenCL: there is no loader"])

    def test_compare_on_a_device(self) -> None:
        from bvh_lab.blender import store

        add_cube().modifiers.new("Subdivision", "SUBSURF").levels = 3
        camera = add_camera()
        camera.location = (0, 0, 6)
        bpy.context.scene.camera = camera
        add_light("POINT").location = (3, 3, 6)
        settings = bpy.context.scene.bvh_lab
        settings.resolution, settings.samples, settings.views = 48, 1, 1
        settings.repeats, settings.judged_rays, settings.ray_resolution = 3, 64, 48
        for builder in store.builders():
            setattr(settings, f"use_{builder['id']}", builder["id"] == "lbvh")
        settings.device = self.offered()[1]
        self.assertEqual(bpy.ops.bvhlab.compare(), {"FINISHED"})
        result = store.study_of(bpy.context.scene).result
        ours = [row for row in result.rows if row.system == "bvh_lab"]
        self.assertEqual([row.error for row in ours], [""] * 4)
        self.assertEqual({row.device for row in ours}, {settings.device})
        self.assertEqual({row.errors().wrong for row in ours}, {0})
        self.assertEqual({row.differing_rays() for row in ours}, {0})
