# SPDX-License-Identifier: GPL-3.0-or-later
"""Register and unregister leave nothing behind, whatever goes wrong between."""

from __future__ import annotations

import importlib
import os
import sys
import tempfile
import threading
import unittest
from collections.abc import Callable
from itertools import pairwise
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
    for name in dir(bpy.app.handlers):
        handlers = getattr(bpy.app.handlers, name)
        if isinstance(handlers, list):
            found += [f"handler {name}" for each in handlers if "bvh_lab" in each.__module__]
    keys = bpy.context.window_manager.keyconfigs.addon
    for keymap in keys.keymaps if keys else ():
        found += [item.idname for item in keymap.keymap_items if "bvhlab" in item.idname]
    found += [thread.name for thread in threading.enumerate() if "bvh_lab" in thread.name]
    return found


def native_threads() -> int:
    """Threads of this process, in whichever language."""
    return len(list(Path("/proc/self/task").iterdir()))


def start_viewport_and_study() -> Callable[[], float | None]:
    """Both at work, as in the middle of a session; returns the viewport's timer."""
    from bvh_lab.blender import store, viewport
    from bvh_lab.blender.extract import extract_scene
    from bvh_lab.study.job import Job

    bpy.ops.wm.read_factory_settings(use_empty=True)
    add_cube()
    scene = bpy.context.scene
    scene.bvh_lab.repeats = 1000
    store.start(scene, Job(extract_scene(bpy.context), scene.bvh_lab.plan(), "test"), 1)
    viewport.start(type("Engine", (), {}))  # of which only is asked whether it is still there
    (timer,) = viewport._timers
    return timer


class Registration(unittest.TestCase):
    def tearDown(self) -> None:
        self.assertEqual(left_behind(), [])

    def test_ten_times(self) -> None:
        import bvh_lab

        threads = []
        for _ in range(10):
            bvh_lab.register()
            self.assertIn("BVHLAB_PT_compare", left_behind())
            self.assertIn("Scene.bvh_lab", left_behind())
            self.assertIn("handler load_pre", left_behind())
            timer = start_viewport_and_study()
            self.assertTrue(bpy.app.timers.is_registered(timer))
            bvh_lab.unregister()
            self.assertEqual(left_behind(), [])
            self.assertFalse(bpy.app.timers.is_registered(timer))
            threads.append(native_threads())
        # oneTBB's own stay, and it starts them when it needs them; one of ours left behind each
        # time would make every count larger than the one before.
        self.assertTrue(any(after <= before for before, after in pairwise(threads[1:])), threads)

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
