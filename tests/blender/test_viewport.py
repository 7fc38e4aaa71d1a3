# SPDX-License-Identifier: GPL-3.0-or-later
"""The rendered viewport without a window: its thread, and its camera."""

from __future__ import annotations

import time
import unittest
from dataclasses import replace
from types import SimpleNamespace
from unittest import mock

import bpy
import numpy as np
from engine_support import HEIGHT, SAMPLES, WIDTH, EngineTest, our_threads


class ViewportWorker(EngineTest):
    """What the thread renders, and that it ends."""

    def setUp(self) -> None:
        super().setUp()
        from bvh_lab.blender.viewport_worker import Worker

        self.worker = Worker()
        self.addCleanup(self.worker.close)
        self.geometry = self.extract("viewport")

    def order(self, size: tuple[int, int] = (WIDTH, HEIGHT), **changes):
        from bvh_lab.blender.engine_scene import viewport_settings
        from bvh_lab.blender.viewport_worker import Order, View

        self.settings.viewport_samples = SAMPLES
        settings = replace(viewport_settings(self.scene), **changes)
        return Order(self.geometry, View(size, self.geometry.cameras[0]), settings)

    def wait(self, size: tuple[int, int], samples: int) -> np.ndarray:
        end = time.monotonic() + 20.0
        while time.monotonic() < end:
            shown = self.worker.shown
            if shown and shown.pixels.shape[1::-1] == size and shown.samples == samples:
                return shown.pixels
            time.sleep(0.01)
        self.fail(f"no picture: {self.worker.status}")

    def test_it_comes_to_the_cores_picture(self) -> None:
        self.worker.submit(self.order())
        pixels = self.wait((WIDTH, HEIGHT), SAMPLES)
        np.testing.assert_array_equal(pixels[::-1, :, :3], self.picture().pixels)
        self.assertEqual(self.worker.status, f"Sample {SAMPLES}/{SAMPLES}")
        self.assertTrue(self.worker.news)

    def test_the_newest_order_counts(self) -> None:
        for width in range(300, 400, 5):  # as while a window's border is dragged
            self.worker.submit(self.order((width, 200), samples=1 << 20))
        self.worker.submit(self.order())
        self.wait((WIDTH, HEIGHT), SAMPLES)
        tree = self.worker._prepared[2]
        self.worker.submit(self.order((12, 8)))
        self.wait((12, 8), SAMPLES)
        self.assertIs(self.worker._prepared[2], tree)

    def test_an_error_is_told_and_the_next_order_works(self) -> None:
        self.worker.submit(self.order(branching=3))
        end = time.monotonic() + 10.0
        while "ranching must be" not in self.worker.status and time.monotonic() < end:
            time.sleep(0.01)
        self.assertIn("ranching must be", self.worker.status)
        self.worker.submit(self.order())
        self.wait((WIDTH, HEIGHT), SAMPLES)

    def test_it_ends_at_once(self) -> None:
        self.worker.submit(self.order((1000, 800), samples=1 << 20))
        time.sleep(0.2)
        start = time.monotonic()
        self.worker.close()
        self.assertLess(time.monotonic() - start, 1.0)
        self.assertEqual(our_threads(), [])


class ViewportView(EngineTest):
    def test_camera_view_is_the_cameras(self) -> None:
        """Blender's matrices lead to the window that extraction reads from the camera."""
        from bvh_lab.blender.viewport_view import read_view

        camera = self.scene.camera
        camera.data.shift_x, camera.data.shift_y = 0.1, -0.2
        camera.data.dof.use_dof, camera.data.dof.focus_distance = True, 3.0
        for kind in ("PERSP", "ORTHO"):
            with self.subTest(kind=kind):
                camera.data.type = kind
                depsgraph = bpy.context.evaluated_depsgraph_get()
                context = SimpleNamespace(
                    region=SimpleNamespace(width=WIDTH, height=HEIGHT),
                    region_data=SimpleNamespace(
                        view_matrix=camera.matrix_world.inverted(),
                        window_matrix=camera.calc_matrix_camera(depsgraph, x=WIDTH, y=HEIGHT),
                        view_perspective="CAMERA",
                    ),
                    space_data=SimpleNamespace(camera=camera),
                    scene=self.scene,
                    preferences=bpy.context.preferences,
                )
                view, expected = read_view(context, depsgraph), self.extract().cameras[0]
                self.assertEqual(view.size, (WIDTH, HEIGHT))
                self.assertEqual(view.camera.kind, expected.kind)
                np.testing.assert_allclose(view.camera.window, expected.window, 1e-5)
                ahead = -expected.to_world[:3, 2]
                start = expected.to_world[:3, 3] + ahead * expected.clip_start
                found = view.camera.to_world[:3, 3] + ahead * view.camera.clip_start
                np.testing.assert_allclose(found, start, atol=1e-4)
                np.testing.assert_allclose(
                    view.camera.to_world[:3, :3], expected.to_world[:3, :3], atol=1e-6
                )
                sharp = (view.camera.lens_radius, view.camera.focus_distance)
                if kind == "PERSP":
                    self.assertEqual(sharp, (expected.lens_radius, 3.0))


class MissingCore(EngineTest):
    def test_it_is_said(self) -> None:
        from bvh_lab.blender import viewport
        from bvh_lab.blender.engine import BVHLAB_RE_engine
        from bvh_lab.native import NativeMissing

        said = []
        engine = SimpleNamespace(_viewport=None, update_stats=lambda *texts: said.append(texts))
        with mock.patch.object(viewport, "Worker", side_effect=NativeMissing("no core here")):
            self.assertFalse(BVHLAB_RE_engine._has_viewport(engine))
        self.assertEqual(said, [("", "No core here")])


if __name__ == "__main__":
    unittest.main()
