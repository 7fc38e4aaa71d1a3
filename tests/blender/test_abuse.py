# SPDX-License-Identifier: GPL-3.0-or-later
"""What happens to Blender's data while a comparison runs, and to results afterwards."""

from __future__ import annotations

import os
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import bpy
from blender_support import EmptySceneTest, add_camera, add_cube, add_light, add_material
from engine_support import our_threads


class RunningTest(EmptySceneTest):
    """A cube whose comparison would take minutes."""

    def setUp(self) -> None:
        super().setUp()
        import bvh_lab

        bvh_lab.register()
        self.addCleanup(bvh_lab.unregister)
        add_cube().data.materials.append(add_material("Paint"))
        add_light("POINT").location.z = 5
        bpy.context.scene.camera = add_camera()
        bpy.context.scene.camera.location.z = 6
        self.set_up(bpy.context.scene)
        bpy.ops.ed.undo_push(message="set up")

    def set_up(self, scene: bpy.types.Scene, repeats: int = 1000) -> None:
        settings = scene.bvh_lab
        settings.resolution = settings.ray_resolution = 256
        settings.repeats, settings.judged_rays = repeats, 16
        settings.embree = settings.pictures = False
        for builder in settings.builders():
            setattr(settings, f"use_{builder}", builder == "lbvh")

    def start(self):
        """What the operator does when it is invoked in a window."""
        from bvh_lab.blender import store
        from bvh_lab.study.job import Job

        settings = bpy.context.scene.bvh_lab
        job = Job(self.extract(), settings.plan(), "test")
        running = store.start(bpy.context.scene, job, settings.variants())
        while not running.rows:
            self.assertTrue(job.running)
            job.wait(0.02)
            running.poll()
        return store

    def finish(self, store):
        store.running.job.cancel()
        return store.finish()


class DuringARun(RunningTest):
    def test_undo_and_redo(self) -> None:
        bpy.data.objects["Cube"].location.x = 3
        bpy.ops.ed.undo_push(message="moved")
        store = self.start()
        for step, x in ((bpy.ops.ed.undo, 0.0), (bpy.ops.ed.redo, 3.0), (bpy.ops.ed.undo, 0.0)):
            step()
            self.assertEqual(bpy.data.objects["Cube"].location.x, x)
            self.assertTrue(store.running.job.running)
            self.assertTrue(store.is_running(bpy.context.scene))
        study = self.finish(store)
        self.assertIs(store.study_of(bpy.context.scene), study)
        bpy.ops.ed.redo()
        self.assertIs(store.study_of(bpy.context.scene), study)
        self.assertEqual(bpy.data.objects["Cube"].location.x, 3.0)

    def test_everything_is_deleted(self) -> None:
        store = self.start()
        for name in ("objects", "meshes", "materials", "lights", "cameras", "worlds", "images"):
            for block in list(getattr(bpy.data, name)):
                getattr(bpy.data, name).remove(block)
        self.assertTrue(store.running.job.running)
        study = self.finish(store)
        self.assertEqual(study.result.failed(), [])
        self.assertGreater(len(study.result.rows), 0)

    def test_another_file_is_opened(self) -> None:
        store = self.start()
        self.assertNotEqual(our_threads(), [])
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.assertIsNone(store.running)
        self.assertEqual((our_threads(), store.studies), ([], {}))

    def test_the_add_on_goes(self) -> None:
        import bvh_lab

        store = self.start()
        bvh_lab.unregister()
        self.assertEqual((our_threads(), store.running), ([], None))
        bvh_lab.register()
        self.assertEqual(store.rows_of(bpy.context.scene), [])

    def test_a_scene_that_is_deleted_leaves_nothing(self) -> None:
        scene = bpy.context.scene
        other = bpy.data.scenes.new("Other")
        store = self.start()
        bpy.context.window.scene = other
        bpy.data.scenes.remove(scene)
        self.assertTrue(store.is_deleted(store.running.scene))
        self.finish(store)
        self.assertEqual(store.studies, {})


class Scenes(RunningTest):
    """Results belong to their scene."""

    def compare(self, scene: bpy.types.Scene):
        from bvh_lab.blender import store

        bpy.context.window.scene = scene
        self.set_up(scene, repeats=3)
        scene.bvh_lab.resolution = scene.bvh_lab.ray_resolution = 16
        self.assertEqual(bpy.ops.bvhlab.compare(), {"FINISHED"})
        return store

    def test_two_scenes(self) -> None:
        first = bpy.context.scene
        second = first.copy()
        store = self.compare(first)
        self.assertEqual(store.rows_of(second), [])
        kept = store.study_of(first)
        self.compare(second)
        self.assertIs(store.study_of(first), kept)
        self.assertIsNot(store.study_of(second), kept)
        panel = bpy.context.window_manager.bvh_lab
        for scene in (first, second):
            names = [row.name for row in panel.rows if row.scene == store.scene_key(scene)]
            self.assertEqual(names, [row.name for row in store.rows_of(scene)])

    def test_a_renamed_scene_keeps_them_and_a_new_one_has_none(self) -> None:
        scene = bpy.context.scene
        store = self.compare(scene)
        kept = store.study_of(scene)
        scene.name = "Renamed"
        self.assertIs(store.study_of(scene), kept)
        self.assertEqual(store.rows_of(bpy.data.scenes.new("Scene")), [])
        bpy.ops.ed.undo_push(message="renamed")
        bpy.ops.ed.undo()
        self.assertIs(store.study_of(bpy.context.scene), kept)

    def test_those_of_a_deleted_scene_are_dropped(self) -> None:
        scene, other = bpy.context.scene, bpy.data.scenes.new("Other")
        store = self.compare(scene)
        bpy.context.window.scene = other
        bpy.data.scenes.remove(scene)
        bpy.context.view_layer.update()
        self.assertEqual(store.studies, {})
        for number in range(20):  # may get the address of the one that is gone
            self.assertIsNone(store.study_of(bpy.data.scenes.new(f"New {number}")))


class Status(unittest.TestCase):
    """The status bar of every workspace is cleared that showed our text."""

    def test_workspaces(self) -> None:
        from bvh_lab.blender.operators import Watch

        first, second = mock.Mock(), mock.Mock()
        first.name, second.name = "First", "Second"
        watch = Watch()
        with mock.patch("bvh_lab.blender.operators.bpy") as blender:
            blender.data.workspaces = {"First": first, "Second": second}
            watch.show(first, "10 %")
            watch.show(second, "20 %")
            self.assertEqual(first.status_text_set.call_args, mock.call(None))
            watch.stop()
            self.assertEqual(second.status_text_set.call_args, mock.call(None))


class Libraries(EmptySceneTest):
    """A file with a linked object, a linked collection instanced, a linked material."""

    def setUp(self) -> None:
        super().setUp()
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.library = Path(folder.name, "library.blend")
        alone = add_cube("Alone")
        alone.data.materials.append(add_material("Paint"))
        collection = bpy.data.collections.new("Crate")
        bpy.context.scene.collection.children.link(collection)
        inner = add_cube("Inner")
        bpy.context.scene.collection.objects.unlink(inner)
        collection.objects.link(inner)
        bpy.ops.wm.save_as_mainfile(filepath=str(self.library))
        bpy.ops.wm.read_factory_settings(use_empty=True)
        with bpy.data.libraries.load(str(self.library), link=True) as (_, wanted):
            wanted.objects, wanted.collections = ["Alone"], ["Crate"]
        here = bpy.context.scene.collection
        here.objects.link(wanted.objects[0])
        instance = bpy.data.objects.new("Instance", None)
        instance.instance_type, instance.instance_collection = "COLLECTION", wanted.collections[0]
        instance.location.x = 5
        here.objects.link(instance)
        own = add_cube("Own")
        own.location.x = 10
        own.data.materials.append(bpy.data.materials["Paint"])
        self.file = Path(folder.name, "file.blend")
        bpy.ops.wm.save_as_mainfile(filepath=str(self.file))

    def test_what_is_linked_is_there(self) -> None:
        scene = self.extract()
        self.assertEqual(len(scene.triangles), 3 * 12)
        self.assertEqual([material.name for material in scene.materials], ["(default)", "Paint"])
        self.assertFalse([note for note in scene.notes if "library" in note.lower()])

    def test_library_override(self) -> None:
        linked = next(obj for obj in bpy.data.objects if obj.name == "Alone")
        local = linked.override_create(remap_local_usages=True)
        local.location.z = 20
        scene = self.extract()
        self.assertEqual(len(scene.triangles), 3 * 12)
        self.assertEqual(float(scene.vertices[:, 2].max()), 21.0)

    def test_a_missing_library_is_named(self) -> None:
        os.rename(self.library, self.library.with_suffix(".away"))
        bpy.ops.wm.open_mainfile(filepath=str(self.file))
        scene = self.extract()
        self.assertEqual(len(scene.triangles), 12)
        said = "Missing library, what is linked from it is left out: //library.blend."
        self.assertIn(said, scene.notes)

    def test_a_scene_of_nothing_else_says_so(self) -> None:
        bpy.data.objects.remove(bpy.data.objects["Own"])
        bpy.ops.wm.save_mainfile()
        os.rename(self.library, self.library.with_suffix(".away"))
        bpy.ops.wm.open_mainfile(filepath=str(self.file))
        with self.assertRaisesRegex(ValueError, "library.blend"):
            self.extract()


if __name__ == "__main__":
    unittest.main()
