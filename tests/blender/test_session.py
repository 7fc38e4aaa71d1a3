# SPDX-License-Identifier: GPL-3.0-or-later
"""What the command line asks of Blender."""

from __future__ import annotations

import tempfile
import unittest
from pathlib import Path

import bpy
from blender_support import EmptySceneTest, add_cube


class Session(EmptySceneTest):
    def test_program(self) -> None:
        from bvh_lab.blender import session

        name, version = session.program().split(maxsplit=1)
        self.assertIn(name, {"Blender", "bpy"})
        self.assertTrue(version.startswith(".".join(map(str, bpy.app.version))))

    def test_file_and_open_scene(self) -> None:
        from bvh_lab.blender import session

        add_cube()
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "one cube.blend")
            bpy.ops.wm.save_as_mainfile(filepath=str(path))
            bpy.ops.wm.read_factory_settings(use_empty=True)
            scene = session.open_scene(path, "viewport")
            self.assertEqual((scene.name, len(scene.triangles)), ("one cube", 12))
            self.assertEqual(scene.source, str(path))
            self.assertEqual(len(session.open_scene(None, "render").triangles), 12)

    def test_no_blend(self) -> None:
        from bvh_lab.blender import session

        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "text.blend")
            path.write_text("this is no .blend")
            with self.assertRaisesRegex(ValueError, "text.blend is not a .blend file") as caught:
                session.open_scene(path, "viewport")
            self.assertNotIn("\n", str(caught.exception))


if __name__ == "__main__":
    unittest.main()
