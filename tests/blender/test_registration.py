# SPDX-License-Identifier: GPL-3.0-or-later
"""Register and unregister leave nothing behind, whatever goes wrong between."""

from __future__ import annotations

import importlib
import os
import sys
import tempfile
import threading
import unittest
from pathlib import Path
from unittest import mock

import bpy
from blender_support import REPOSITORY, EmptySceneTest, add_cube


def left_behind() -> list[str]:
    """Everything of ours that Blender still knows."""
    found = [name for name in dir(bpy.types) if name.startswith("BVHLAB_")]
    for base in (bpy.types.PropertyGroup, bpy.types.AddonPreferences, bpy.types.RenderEngine):
        ours = [cls for cls in base.__subclasses__() if "bvh_lab" in cls.__module__]
        found += [cls.__name__ for cls in ours if cls.is_registered]
    found += [f"bpy.ops.bvhlab.{name}" for name in dir(bpy.ops.bvhlab)]
    for owner in (bpy.types.Scene, bpy.types.ViewLayer, bpy.types.WindowManager):
        if hasattr(owner, "bvh_lab"):
            found.append(f"{owner.__name__}.bvh_lab")
    if hasattr(bpy.types.Scene, "bvh_lab_render"):
        found.append("Scene.bvh_lab_render")
    found += [
        f"handler {handler}" for handler in bpy.app.handlers.load_pre if "bvh" in repr(handler)
    ]
    found += [thread.name for thread in threading.enumerate() if "bvh_lab" in thread.name]
    return found


class Registration(unittest.TestCase):
    def tearDown(self) -> None:
        self.assertEqual(left_behind(), [])

    def test_three_times(self) -> None:
        import bvh_lab

        for _ in range(3):
            bvh_lab.register()
            self.assertIn("BVHLAB_PT_compare", left_behind())
            self.assertIn("Scene.bvh_lab", left_behind())
            bvh_lab.unregister()
            self.assertEqual(left_behind(), [])

    def test_a_failure_is_undone(self) -> None:
        import bvh_lab
        from bvh_lab.blender import registration

        for module in registration.MODULES:
            with (
                self.subTest(module=module.__name__),
                mock.patch.object(module, "register", side_effect=RuntimeError("no luck")),
            ):
                with self.assertRaisesRegex(RuntimeError, "no luck"):
                    bvh_lab.register()
                self.assertEqual(left_behind(), [])

    def test_opening_a_file_forgets_results(self) -> None:
        import bvh_lab
        from bvh_lab.blender import store

        bvh_lab.register()
        try:
            store.studies["Scene"] = object()
            bpy.ops.wm.read_factory_settings(use_empty=True)
            self.assertEqual(store.studies, {})
        finally:
            bvh_lab.unregister()


class MissingCore(EmptySceneTest):
    """A copy of the package without its compiled module."""

    NAME = "bvh_lab_without_core"

    def setUp(self) -> None:
        super().setUp()
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        package = Path(folder.name, self.NAME)
        package.mkdir()
        for path in (REPOSITORY / "addon").iterdir():
            os.symlink(path, package / path.name)
        sys.path.insert(0, folder.name)
        self.addCleanup(sys.path.remove, folder.name)
        self.package = importlib.import_module(self.NAME)
        self.package.register()
        self.addCleanup(self.forget)

    def forget(self) -> None:
        self.package.unregister()
        for name in [name for name in sys.modules if name.split(".")[0] == self.NAME]:
            del sys.modules[name]

    def test_the_reason_is_said_and_nothing_runs(self) -> None:
        add_cube()
        store = importlib.import_module(f"{self.NAME}.blender.store")
        self.assertIn("_core", store.native_reason())
        self.assertFalse(bpy.ops.bvhlab.compare.poll())
        with self.assertRaisesRegex(RuntimeError, "_core"):
            bpy.ops.bvhlab.compare()


if __name__ == "__main__":
    unittest.main()
