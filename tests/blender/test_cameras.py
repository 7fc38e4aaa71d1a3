# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras: the window against Blender's own projection."""

from __future__ import annotations

import itertools
import unittest

import bpy
import numpy as np
from blender_support import EmptySceneTest, add_camera, add_cube
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector


class Cameras(EmptySceneTest):
    def setUp(self) -> None:
        super().setUp()
        add_cube()

    def test_window_is_blenders_projection(self) -> None:
        obj = add_camera()
        obj.location, obj.rotation_euler, obj.scale = (3, -7, 5), (1.0, 0.2, 0.4), (2, 2, 2)
        render = bpy.context.scene.render
        render.resolution_x, render.resolution_y = 640, 360
        for kind, fit, shift, pixel in itertools.product(
            ("PERSP", "ORTHO"),
            ("AUTO", "HORIZONTAL", "VERTICAL"),
            ((0, 0), (0.3, -0.2)),
            (1.0, 2.5),
        ):
            with self.subTest(kind=kind, fit=fit, shift=shift, pixel=pixel):
                data = obj.data
                data.type, data.sensor_fit, (data.shift_x, data.shift_y) = kind, fit, shift
                data.sensor_height, render.pixel_aspect_y = 20, pixel
                self.check_against_blender(obj)

    def check_against_blender(self, obj: bpy.types.Object) -> None:
        render = bpy.context.scene.render
        depsgraph = bpy.context.evaluated_depsgraph_get()
        camera = self.extract().cameras[0]
        projection = np.array(
            obj.calc_matrix_camera(
                depsgraph, x=render.resolution_x, y=render.resolution_y,
                scale_x=render.pixel_aspect_x, scale_y=render.pixel_aspect_y,
            )
        )  # fmt: skip
        np.testing.assert_allclose(
            _window(projection, camera.kind), camera.window, rtol=0, atol=2e-6
        )
        axes = camera.to_world[:3, :3]
        np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-6)
        for point in ((0.3, 0.1, -0.2), (1.5, 2.0, 0.7)):
            seen = world_to_camera_view(bpy.context.scene, obj, Vector(point))
            # world_to_camera_view leaves the scale on the camera: only the ray is the same.
            local = np.linalg.inv(camera.to_world) @ np.array([*point, 1.0])
            plane = local[:2] / -local[2] if camera.kind == "perspective" else local[:2]
            left, right, bottom, top = camera.window
            expected = ((plane[0] - left) / (right - left), (plane[1] - bottom) / (top - bottom))
            if camera.kind == "perspective":
                np.testing.assert_allclose(seen[:2], expected, atol=1e-5)

    def test_order_and_clip(self) -> None:
        for name in ("C", "A", "B"):
            add_camera(name)
        bpy.context.scene.camera = bpy.data.objects["B"]
        bpy.data.objects["B"].data.clip_start = 0.5
        scene = self.extract()
        self.assertEqual([camera.name for camera in scene.cameras], ["B", "A", "C"])
        self.assertEqual(scene.cameras[0].clip_start, 0.5)

    def test_depth_of_field(self) -> None:
        obj, target = add_camera(), add_cube("Target")
        obj.location, obj.rotation_euler, obj.scale = (1, 2, 3), (0.5, 0.25, 1), (2, 2, 2)
        data = obj.data
        data.lens, data.dof.aperture_fstop, data.dof.focus_distance = 50, 2.0, 7.5
        camera = self.extract().cameras[0]
        self.assertEqual(camera.lens_radius, 0.0)
        data.dof.use_dof = True
        camera = self.extract().cameras[0]
        self.assertAlmostEqual(camera.lens_radius, 0.0125, places=7)
        self.assertEqual(camera.focus_distance, 7.5)
        data.dof.focus_object, target.location = target, (4, -3, 1)
        camera = self.extract().cameras[0]
        local = np.linalg.inv(camera.to_world) @ (4, -3, 1, 1)
        self.assertAlmostEqual(camera.focus_distance, abs(local[2]), places=5)
        data.type = "ORTHO"
        self.assertAlmostEqual(self.extract().cameras[0].lens_radius, 0.25, places=7)
        self.assertTrue([note for note in self.extract().notes if "depth of field" in note])

    def test_lens_that_is_not_modelled_is_said(self) -> None:
        dof = add_camera("Lens").data.dof
        dof.use_dof, dof.aperture_blades, dof.aperture_ratio = True, 6, 2.0
        notes = self.extract().notes
        self.assertIn("Approximated: aperture blades, the aperture is round: Lens.", notes)
        self.assertIn("Approximated: anamorphic bokeh, the aperture is round: Lens.", notes)
        dof.focus_distance = 0
        scene = self.extract()
        self.assertEqual(scene.cameras[0].lens_radius, 0.0)
        self.assertIn("Left out: depth of field focused on the camera itself: Lens.", scene.notes)

    def test_panorama_is_said(self) -> None:
        add_camera("Dome").data.type = "PANO"
        scene = self.extract()
        self.assertEqual(scene.cameras[0].kind, "perspective")
        self.assertTrue(any("panoramic" in note and "Dome" in note for note in scene.notes))

    def test_no_camera_gets_three_that_see_the_scene(self) -> None:
        scene = self.extract()
        self.assertEqual(len(scene.cameras), 3)
        self.assertTrue(any("No camera" in note for note in scene.notes))
        for camera in scene.cameras:
            local = (
                np.linalg.inv(camera.to_world)
                @ np.append(scene.vertices, np.ones((8, 1)), axis=1).T
            )[:3]
            plane = local[:2] / -local[2]
            left, right, bottom, top = camera.window
            self.assertTrue((local[2] < -camera.clip_start).all(), camera.name)
            self.assertTrue((plane[0] > left).all() and (plane[0] < right).all(), camera.name)
            self.assertTrue((plane[1] > bottom).all() and (plane[1] < top).all(), camera.name)


def _window(projection: np.ndarray, kind: str) -> tuple[float, float, float, float]:
    """Left, right, bottom, top out of an OpenGL projection matrix; a perspective at distance 1."""
    width, height = 2.0 / projection[0, 0], 2.0 / projection[1, 1]
    if kind == "perspective":
        x, y = projection[0, 2] * width / 2.0, projection[1, 2] * height / 2.0
    else:
        x, y = -projection[0, 3] * width / 2.0, -projection[1, 3] * height / 2.0
    return (x - width / 2.0, x + width / 2.0, y - height / 2.0, y + height / 2.0)


if __name__ == "__main__":
    unittest.main()
