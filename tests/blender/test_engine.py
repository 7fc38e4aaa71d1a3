# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine: pictures, passes, borders, errors, cancel."""

from __future__ import annotations

import subprocess
import time
import unittest
from pathlib import Path
from unittest import mock

import bpy
import numpy as np
from blender_support import BUILD
from engine_support import EVERY_PASS, HEIGHT, WIDTH, EngineTest, our_threads, read_exr


class FinalRender(EngineTest):
    def test_combined_is_the_cores_picture(self) -> None:
        found = self.render()
        self.assertEqual(set(found), {"ViewLayer.Combined"})
        combined, expected = found["ViewLayer.Combined"], self.picture().pixels
        self.assertGreater(expected.std(), 0.05)
        np.testing.assert_array_equal(combined[..., :3], expected)
        np.testing.assert_array_equal(combined[..., 3], 1.0)
        self.assertEqual(our_threads(), [])

    def test_settings_reach_the_core(self) -> None:
        self.settings.seed, self.settings.depth, self.settings.shadow_rays = 7, 0, 1
        self.settings.builder, self.settings.branching, self.settings.reorder = "ploc", "4", "aila"
        expected = self.picture(seed=7, depth=0, shadow_rays=1).pixels
        np.testing.assert_array_equal(self.render()["ViewLayer.Combined"][..., :3], expected)
        self.assertFalse(np.array_equal(expected, self.picture().pixels))

    def test_passes(self) -> None:
        self.ask_for_passes(bpy.context.view_layer)
        self.settings.builder, self.settings.branching = "lbvh", "2"
        found = {name.split(".")[1]: pixels for name, pixels in self.render().items()}
        self.assertEqual(set(found), EVERY_PASS)
        expected = self.picture()
        np.testing.assert_array_equal(found["Combined"][..., :3], expected.pixels)
        np.testing.assert_array_equal(found["Normal"], expected.passes["normal"])
        np.testing.assert_array_equal(found["Albedo"], expected.passes["albedo"])
        for name, key in (("Traversal Steps", "node_visits"), ("Triangle Tests", "triangle_tests")):
            np.testing.assert_array_equal(found[name][..., 0], expected.passes[key])
            self.assertGreater(found[name].max(), 1.0)

    def test_depth_is_along_the_view_and_far_without_a_hit(self) -> None:
        self.ask_for_passes(bpy.context.view_layer)
        camera = self.scene.camera
        camera.location, camera.rotation_euler = (0, 0, 5), (0, 0, 0)
        for kind in ("PERSP", "ORTHO"):
            with self.subTest(kind=kind):
                camera.data.type, camera.data.ortho_scale = kind, 12.0
                depth = self.render()["ViewLayer.Depth"][..., 0]
                far = depth == np.float32(1e10)
                top = np.isclose(depth, 4.0, rtol=1e-6)  # of the cube
                floor = np.isclose(depth, 6.0, rtol=1e-6)
                self.assertTrue((far | top | floor).all())
                self.assertTrue(top.any() and floor.any())
                self.assertEqual(far.any(), kind == "ORTHO")

    def test_border(self) -> None:
        self.ask_for_passes(bpy.context.view_layer)
        whole = self.render()["ViewLayer.Depth"][..., 0]
        render = self.scene.render
        render.use_border = True
        render.border_min_x, render.border_max_x = 0.26, 0.8
        render.border_min_y, render.border_max_y = 0.13, 0.7
        columns = slice(int(0.26 * WIDTH), int(0.8 * WIDTH))
        rows = slice(HEIGHT - int(0.7 * HEIGHT), HEIGHT - int(0.13 * HEIGHT))
        part = self.render()
        inside = np.zeros((HEIGHT, WIDTH), bool)
        inside[rows, columns] = True
        np.testing.assert_array_equal(part["ViewLayer.Combined"][..., 3] == 1.0, inside)
        np.testing.assert_allclose(part["ViewLayer.Depth"][..., 0][inside], whole[inside], 1e-5)
        render.use_crop_to_border = True
        cropped = self.render()["ViewLayer.Depth"][..., 0]
        np.testing.assert_allclose(cropped, whole[rows, columns], 1e-5)

    def test_two_view_layers(self) -> None:
        second = self.scene.view_layers.new("Second")
        hidden = bpy.data.collections.new("Hidden")
        self.scene.collection.children.link(hidden)
        hidden.objects.link(self.cube)
        self.scene.collection.objects.unlink(self.cube)
        second.layer_collection.children["Hidden"].exclude = True
        self.ask_for_passes(second)
        found = self.render()
        self.assertEqual(
            {name for name in found if name.startswith("ViewLayer.")}, {"ViewLayer.Combined"}
        )
        self.assertEqual(
            len([name for name in found if name.startswith("Second.")]), len(EVERY_PASS)
        )
        red, grey = (found[f"{layer}.Combined"] for layer in ("ViewLayer", "Second"))
        self.assertGreater((red[..., 0] - red[..., 1]).max(), 0.1)
        self.assertLess(np.abs(grey[..., 0] - grey[..., 1]).max(), 1e-6)

    def test_animation(self) -> None:
        self.scene.frame_start, self.scene.frame_end = 1, 2
        for frame, x in ((1, 0.0), (2, 3.0)):
            self.cube.location.x = x
            self.cube.keyframe_insert("location", frame=frame)
        self.scene.render.filepath = str(self.folder / "frame_")
        bpy.ops.render.render(animation=True)
        frames = [read_exr(self.folder / f"frame_000{frame}.exr") for frame in (1, 2)]
        pictures = [frame["ViewLayer.Combined"] for frame in frames]
        self.assertGreater(np.abs(pictures[0] - pictures[1]).mean(), 0.01)
        self.scene.frame_set(2)
        np.testing.assert_array_equal(pictures[1][..., :3], self.picture().pixels)

    def test_cancel_keeps_what_there_is(self) -> None:
        from bvh_lab.blender import engine_final

        self.settings.samples = 1 << 24
        start = time.monotonic()

        def late(engine: bpy.types.RenderEngine) -> bool:
            return time.monotonic() - start > 1.0

        with mock.patch.object(engine_final, "stopped", late):
            found = self.render()["ViewLayer.Combined"]
        self.assertLess(time.monotonic() - start, 5.0)
        np.testing.assert_allclose(found[..., :3], self.picture(samples=64).pixels, atol=0.3)
        self.assertEqual(our_threads(), [])

    def test_notes_are_kept(self) -> None:
        from bvh_lab.blender import engine_final, store

        self.scene.render.film_transparent = True
        self.render()
        notes = engine_final.notes_of[store.scene_key(self.scene)]
        self.assertIn("Left out: transparent film, alpha is 1 everywhere.", notes)


class Errors(EngineTest):
    def assert_fails(self, reason: str) -> None:
        with self.assertRaisesRegex(RuntimeError, reason):
            bpy.ops.render.render()
        self.assertEqual(our_threads(), [])

    def test_no_camera(self) -> None:
        self.scene.camera = None
        self.assert_fails("camera")

    def test_nothing_to_see(self) -> None:
        for obj in list(self.scene.objects):
            if obj.type == "MESH":
                obj.hide_render = True
        self.assert_fails("no renderable surface")

    def test_missing_core(self) -> None:
        from bvh_lab.blender import engine_final
        from bvh_lab.native import NativeMissing

        with mock.patch.object(engine_final, "load", side_effect=NativeMissing("no core here")):
            self.assert_fails("No core here")

    def test_what_the_core_refuses(self) -> None:
        from bvh_lab.blender import engine_scene

        with mock.patch.object(engine_scene, "load") as load:
            load().build.side_effect = ValueError("too large: choose less")
            self.assert_fails("Too large: choose less")

    def test_our_bugs_are_not_swallowed(self) -> None:
        from bvh_lab.blender import engine_final

        with (
            mock.patch.object(engine_final, "render_view_layer", side_effect=KeyError("oh")),
            mock.patch("traceback.print_exc"),
        ):
            self.assert_fails("BVH Lab has a bug: KeyError")

    @unittest.skipIf(getattr(bpy.app, "module", False), "the bpy module has no command line")
    def test_batch(self) -> None:
        """`blender -b file -E BVHLAB -f 1` writes the picture, or fails."""
        path = self.folder / "scene.blend"
        self.scene.render.engine = "BLENDER_WORKBENCH"
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
        register = (
            f"import sys; sys.path.insert(0, {str(BUILD)!r}); import bvh_lab; bvh_lab.register()"
        )
        hide = "; import bpy; bpy.ops.object.select_all(action='SELECT'); bpy.ops.object.delete()"
        for script, code in ((register, 0), (register + hide, 1)):
            output = self.folder / f"batch_{code}_"
            command = [bpy.app.binary_path, "--background", "--factory-startup", str(path)]
            command += ["--python-expr", script, "-E", "BVHLAB", "-o", str(output), "-f", "1"]
            run = subprocess.run(command, capture_output=True, text=True, timeout=120)
            self.assertEqual(run.returncode, code, run.stdout + run.stderr)
            self.assertEqual(Path(f"{output}0001.exr").is_file(), code == 0)


class Settings(EngineTest):
    def test_every_builder_can_be_chosen(self) -> None:
        from bvh_lab.blender.engine_settings import BRANCHINGS, BUILDERS, REORDERS
        from bvh_lab.native import core
        from bvh_lab.study import plan

        self.assertEqual({item[0] for item in BUILDERS}, {each["id"] for each in core.builders()})
        self.assertEqual({int(item[0]) for item in BRANCHINGS}, set(plan.BRANCHINGS))
        self.assertEqual([item[0] for item in REORDERS], list(plan.REORDERS))
        for items in (BUILDERS, BRANCHINGS, REORDERS):
            self.assertEqual(len({item[3] for item in items}), len(items))

    def test_stock_panels_hold_with_the_engine_while_it_is_there(self) -> None:
        import bvh_lab

        def with_us() -> set[str]:
            return {
                panel.__name__
                for panel in bpy.types.Panel.__subclasses__()
                if "BVHLAB" in getattr(panel, "COMPAT_ENGINES", ())
                and not panel.__name__.startswith("BVHLAB")
            }

        expected = {"RENDER_PT_format", "DATA_PT_lens", "DATA_PT_camera_dof", "MATERIAL_PT_preview"}
        self.assertLessEqual(expected, with_us())
        self.assertNotIn("DATA_PT_light", with_us())
        bvh_lab.unregister()
        self.assertEqual(with_us(), set())
        bvh_lab.register()


if __name__ == "__main__":
    unittest.main()
