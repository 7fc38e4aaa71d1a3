# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that others made: not part of this repository, and skipped where they are not at hand."""

from __future__ import annotations

import unittest

import bpy
import numpy as np
from blender_support import SHARED_BLENDS

TRIANGLES = {  # evaluated in the viewport
    "player": 108_800,
    "egyptcat": 16_040,
    "particle_emitter": 42_604,
    "cornell": 32,
    "living_room": 5_088,
    "robot": 3_238,
}


@unittest.skipUnless(
    SHARED_BLENDS.is_dir(), f"no folder {SHARED_BLENDS.parent.name}/{SHARED_BLENDS.name} here"
)
class SharedBlends(unittest.TestCase):
    def test_every_file(self) -> None:
        from bvh_lab.blender.extract import extract_scene

        for name, triangles in TRIANGLES.items():
            for geometry in ("viewport", "render"):
                with self.subTest(file=name, geometry=geometry):
                    bpy.ops.wm.open_mainfile(filepath=str(SHARED_BLENDS / f"{name}.blend"))
                    scene = extract_scene(bpy.context, geometry)
                    if geometry == "viewport":
                        self.assertEqual(len(scene.triangles), triangles)
                    self.assertGreater(len(scene.triangles), 0)
                    self.assertLess(int(scene.triangles.max()), len(scene.vertices))
                    self.assertLess(int(scene.material_index.max()), len(scene.materials))
                    self.assertTrue(np.isfinite(scene.vertices).all())
                    self.assertGreater(len(scene.cameras), 0)
                    self.assertTrue(scene.name.startswith(name))


if __name__ == "__main__":
    unittest.main()
