# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights shine as in Cycles: extraction and picture together, on a plane under one light."""

from __future__ import annotations

import math
import unittest

import bpy
import numpy as np
from blender_support import add_light, add_mesh, use_nodes
from cycles_support import CyclesTest


class AgainstCycles(CyclesTest):
    def setUp(self) -> None:
        super().setUp()
        corners = [(-50, -50, 0), (50, -50, 0), (50, 50, 0), (-50, 50, 0)]
        floor = add_mesh("Floor", corners, [(0, 1, 2, 3)])
        floor.data.materials.append(self.shader("BsdfDiffuse", Color=(0.8, 0.5, 0.2, 1))[0])
        self.look_down(2)

    def lamp(self, kind: str, energy: float, size: float) -> bpy.types.Light:
        lamp = add_light(kind)
        lamp.location, lamp.rotation_euler = (0.3, 0.2, 2), (0.2, 0.1, 0)
        lamp.data.energy, lamp.data.color = energy, (1, 0.8, 0.6)
        setattr(lamp.data, {"SUN": "angle", "AREA": "size"}.get(kind, "shadow_soft_size"), size)
        return lamp.data

    def check(self) -> None:
        ours, theirs = (picture.mean((0, 1)) for picture in self.pictures())
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
        shade.data.materials.append(self.shader("Emission", Strength=5)[0])
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
