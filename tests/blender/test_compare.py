# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators in the background, on a tiny scene, from Compare to Export."""

from __future__ import annotations

import json
import tempfile
import unittest
from pathlib import Path

import bpy
import numpy as np
from blender_support import EmptySceneTest, add_camera, add_cube, add_light

# Every builder but those that take minutes on a scene of usual size.
SWITCHED_ON = (
    "lbvh",
    "hlbvh",
    "ploc",
    "atrbvh",
    "prbvh",
    "prbvh_s",
    "sah",
    "sbvh",
    "trbvh",
    "hybrid",
)


class Compare(EmptySceneTest):
    def setUp(self) -> None:
        super().setUp()
        import bvh_lab

        bvh_lab.register()
        self.addCleanup(bvh_lab.unregister)
        add_cube().modifiers.new("Subdivision", "SUBSURF").levels = 3
        camera = add_camera()
        camera.location = (0, 0, 6)
        bpy.context.scene.camera = camera
        add_light("POINT").location = (3, 3, 6)
        settings = bpy.context.scene.bvh_lab
        settings.resolution, settings.samples, settings.views = 48, 1, 1
        settings.repeats, settings.judged_rays, settings.ray_resolution = 3, 64, 48

    def study(self):
        from bvh_lab.blender import store

        return store.study_of(bpy.context.scene)

    def test_every_variant(self) -> None:
        self.assertEqual(bpy.ops.bvhlab.compare(), {"FINISHED"})
        result = self.study().result
        ours = [row for row in result.rows if row.system == "bvh_lab"]
        self.assertEqual(
            [row.name for row in ours],
            [f"{builder}_{k}" for builder in SWITCHED_ON for k in (2, 4, 8, "8_cwbvh")],
        )
        self.assertEqual([row.error for row in result.rows if row.error], [])
        self.assertEqual(result.failed(), [])
        self.assertEqual({row.errors().wrong for row in ours}, {0})
        self.assertEqual({row.picture_difference() for row in ours}, {0.0})
        self.assertEqual(result.subject.geometry, "viewport")

    def test_picture(self) -> None:
        bpy.ops.bvhlab.compare()
        image = bpy.data.images["BVH Lab Camera"]
        (pixels,) = {id(picture): picture for picture in self.study().pictures.values()}.values()
        self.assertEqual(tuple(image.size), pixels.shape[1::-1])
        shown = np.empty(4 * pixels.shape[0] * pixels.shape[1], np.float32)
        image.pixels.foreach_get(shown)
        np.testing.assert_array_equal(shown.reshape(*pixels.shape[:2], 4)[::-1, :, :3], pixels)
        self.assertGreater(float(pixels.max()), 0.0)
        bpy.context.scene.bvh_lab.resolution = 32
        bpy.ops.bvhlab.compare()
        self.assertEqual(max(image.size), 32)

    def test_choices_reach_the_plan(self) -> None:
        from bvh_lab.blender import summary

        settings = bpy.context.scene.bvh_lab
        for builder in SWITCHED_ON[1:]:
            setattr(settings, f"use_{builder}", False)
        settings.use_2 = settings.use_4 = False
        settings.use_reordering, settings.reorder_key = True, "octahedron"
        settings.geometry, settings.embree = "render", False
        settings.target_error = 0.25
        settings.layout_cwbvh, settings.triangle_moller_trumbore = False, True
        self.assertEqual(settings.plan().target_error, 0.25)
        settings.pictures = False  # and so no error that could be judged
        bpy.ops.bvhlab.compare()
        result = self.study().result
        names = ["lbvh_8", "lbvh_8_octahedron"]
        names += ["lbvh_8_moller_trumbore", "lbvh_8_moller_trumbore_octahedron"]
        self.assertEqual([row.name for row in result.rows], names)
        self.assertEqual(settings.variants(), len(names))
        self.assertIn("otherwise than exactly", dict(summary.details(result.rows[2]))[""])
        cell = summary.cells(result.rows[2], "primary", None)["WRONG"]
        self.assertRegex(cell, r"^\d+( \(\d+\))?$")
        self.assertEqual(summary.short_title(result.rows[3]), "LBVH 8 MT sorted")
        self.assertEqual(result.subject.geometry, "render")
        self.assertEqual(self.study().pictures, {})

    def test_invoked_in_the_background_it_waits(self) -> None:
        settings = bpy.context.scene.bvh_lab
        settings.use_sah = settings.use_sbvh = False
        self.assertEqual(bpy.ops.bvhlab.compare("INVOKE_DEFAULT"), {"FINISHED"})
        self.assertIsNotNone(self.study())

    def test_nothing_chosen(self) -> None:
        settings = bpy.context.scene.bvh_lab
        settings.use_2 = settings.use_4 = settings.use_8 = False
        with self.assertRaisesRegex(RuntimeError, "at least one builder"):
            bpy.ops.bvhlab.compare()
        settings.use_2, settings.layout_full = True, False  # compressed nodes are 8-wide
        with self.assertRaisesRegex(RuntimeError, "compressed nodes need the branching factor 8"):
            bpy.ops.bvhlab.compare()
        settings.use_8 = True
        self.assertEqual(settings.variants(), len(SWITCHED_ON))
        settings.preset = "paper"
        self.assertEqual(settings.plan().layouts, ["full"])

    def test_empty_scene_is_one_sentence(self) -> None:
        bpy.data.objects["Cube"].hide_set(True)
        with self.assertRaisesRegex(RuntimeError, "has no visible surface") as caught:
            bpy.ops.bvhlab.compare()
        self.assertNotIn("Traceback", str(caught.exception))
        self.assertIsNone(self.study())

    def test_export(self) -> None:
        self.assertFalse(bpy.ops.bvhlab.export.poll())
        bpy.ops.bvhlab.compare()
        with tempfile.TemporaryDirectory() as folder:
            for form in ("csv", "json", "txt", "folder"):
                path = Path(folder, f"results.{form}")
                self.assertEqual(
                    bpy.ops.bvhlab.export(format=form, filepath=str(path)), {"FINISHED"}
                )
                self.assertTrue(path.exists())
            rows = json.loads(Path(folder, "results.json").read_text(encoding="utf-8"))["rows"]
            self.assertGreaterEqual(len(rows), 9)
            self.assertTrue(Path(folder, "results.folder", "index.html").is_file())
            with self.assertRaisesRegex(RuntimeError, "cannot be written"):
                bpy.ops.bvhlab.export(format="csv", filepath=str(Path(folder, "no", "such.csv")))
            self.assertEqual(
                sorted(path.name for path in Path(folder).iterdir()),
                ["results.csv", "results.folder", "results.json", "results.txt"],
            )

    def test_results_belong_to_their_scene(self) -> None:
        bpy.ops.bvhlab.compare()
        other = bpy.data.scenes.new("Other")
        from bvh_lab.blender import store

        self.assertIsNone(store.study_of(other))
        bpy.context.scene.bvh_lab.use_sah = False
        bpy.ops.bvhlab.compare()
        names = [row.name for row in bpy.context.window_manager.bvh_lab.rows]
        self.assertEqual(len(names), len(set(names)))
        self.assertNotIn("sah_2", names)

    def test_summary(self) -> None:
        from bvh_lab.blender import summary

        bpy.ops.bvhlab.compare()
        result = self.study().result
        best = summary.fastest(result.rows, "primary")
        self.assertEqual(best.system, "bvh_lab")
        said = summary.winner(result.rows, "primary")
        self.assertRegex(said[0], r"^Fastest: .*-wide( compressed)?, 0 wrong hits of \d+$")
        pictures = f"All {4 * len(SWITCHED_ON)} pictures are equal, pixel for pixel"
        self.assertEqual(summary.pictures(result), pictures)
        self.assertEqual(summary.cells(best, "primary", best)["RATIO"], "1.00×")


if __name__ == "__main__":
    unittest.main()
