# SPDX-License-Identifier: GPL-3.0-or-later
"""Smooth shading: a normal for each corner of each triangle."""

from __future__ import annotations

import math
import unittest

import bpy
import numpy as np
from blender_support import EmptySceneTest, add_cube, add_mesh


def add_ball(smooth: bool = True) -> bpy.types.Object:
    """About a unit sphere, of 320 triangles."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3, radius=1)
    ball = bpy.context.object
    for polygon in ball.data.polygons:
        polygon.use_smooth = smooth
    return ball


def geometric(scene) -> np.ndarray:
    a, b, c = np.moveaxis(scene.vertices.astype(np.float64)[scene.triangles], 1, 0)
    normals = np.cross(b - a, c - a)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def vertex_normals(scene, obj: bpy.types.Object) -> np.ndarray:
    """(T, 3, 3): Blender's own normals of an object's vertices, in its space."""
    normals = np.array([vertex.normal[:] for vertex in obj.data.vertices])
    return normals[scene.triangles]


class Smooth(EmptySceneTest):
    def test_flat_scene_has_none(self) -> None:
        add_cube()
        scene = self.extract()
        self.assertIsNone(scene.normals)
        self.assertFalse([note for note in scene.notes if "smooth" in note])

    def test_sphere(self) -> None:
        ball = add_ball()
        scene = self.extract()
        self.assertEqual((scene.normals.dtype, scene.normals.shape), (np.float32, (320, 3, 3)))
        np.testing.assert_allclose(scene.normals, vertex_normals(scene, ball), atol=1e-4)
        np.testing.assert_allclose(scene.normals, scene.vertices[scene.triangles], atol=0.02)
        self.assertTrue([note for note in scene.notes if "smooth shading" in note])

    def test_flat_triangles_of_a_smooth_scene_have_their_own(self) -> None:
        add_ball()
        add_cube().location.x = 5
        scene = self.extract()
        is_cube = scene.vertices[scene.triangles][:, 0, 0] > 3
        expected = geometric(scene)[is_cube][:, None]
        np.testing.assert_allclose(
            scene.normals[is_cube], np.broadcast_to(expected, (12, 3, 3)), atol=1e-6
        )

    def test_mixed_faces_of_one_mesh(self) -> None:
        cube = add_cube()
        cube.data.polygons[2].use_smooth = True
        scene = self.extract()
        is_smooth = np.isin(np.arange(12), (4, 5))
        np.testing.assert_allclose(
            scene.normals[~is_smooth],
            np.broadcast_to(geometric(scene)[~is_smooth][:, None], (10, 3, 3)),
            atol=1e-6,
        )
        # Since Blender 4.1 a smooth face does not mix its normals with those of flat neighbours.
        corner = 1 / math.sqrt(3) if bpy.app.version < (4, 1, 0) else 1.0
        np.testing.assert_allclose(
            np.einsum("tci,ti->tc", scene.normals, geometric(scene))[is_smooth], corner, atol=1e-6
        )

    def test_stretched_sheared_and_mirrored(self) -> None:
        """A normal n becomes inverse(transpose(M)) n, and stays outside."""
        ball = add_ball()
        for scale in ((2, 0.5, 1), (-2, 0.5, 1), (-1e-6, -2e-6, -1e-6), (1e6, 2e6, 1e6)):
            with self.subTest(scale=scale):
                ball.scale, ball.rotation_euler = scale, (0.3, 0.2, 0.1)
                scene = self.extract()
                matrix = np.array(ball.matrix_world)[:3, :3]
                expected = vertex_normals(scene, ball) @ np.linalg.inv(matrix)
                expected /= np.linalg.norm(expected, axis=2, keepdims=True)
                np.testing.assert_allclose(scene.normals, expected, atol=3e-4)
                agree = np.einsum("tci,ti->tc", scene.normals, geometric(scene))
                self.assertGreater(agree.min(), 0.5)
                lengths = np.linalg.norm(scene.normals.astype(np.float64), axis=2)
                np.testing.assert_allclose(lengths, 1.0, atol=1e-6)

    def test_collapsed_object(self) -> None:
        add_ball().scale = (1, 1, 0)
        scene = self.extract()
        np.testing.assert_allclose(np.abs(scene.normals[:, :, 2]), 1.0, atol=1e-5)
        add_ball().scale = (0, 0, 0)
        lengths = np.linalg.norm(self.extract().normals.astype(np.float64), axis=2)
        np.testing.assert_allclose(lengths, 1.0, atol=1e-6)

    def test_custom_normals(self) -> None:
        square = add_mesh("Leaf", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2, 3)])
        square.data.polygons[0].use_smooth = True
        wanted = np.array([(0.6, 0, 0.8), (0, 0.6, 0.8), (-0.6, 0, 0.8), (0, -0.6, 0.8)])
        if hasattr(square.data, "use_auto_smooth"):
            square.data.use_auto_smooth = True
        square.data.normals_split_custom_set(wanted.tolist())
        scene = self.extract()
        np.testing.assert_allclose(scene.normals, wanted[scene.triangles], atol=2e-4)

    def test_sharp_edges_split(self) -> None:
        cube = add_cube()
        for polygon in cube.data.polygons:
            polygon.use_smooth = True
        for edge in cube.data.edges:
            edge.use_edge_sharp = True
        if hasattr(cube.data, "use_auto_smooth"):
            cube.data.use_auto_smooth, cube.data.auto_smooth_angle = True, math.pi
        scene = self.extract()
        expected = np.broadcast_to(geometric(scene)[:, None], (12, 3, 3))
        np.testing.assert_allclose(scene.normals, expected, atol=1e-4)

    def test_edit_mode(self) -> None:
        ball = bpy.context.view_layer.objects.active = add_ball()
        bpy.ops.object.mode_set(mode="EDIT")
        scene = self.extract()
        bpy.ops.object.mode_set(mode="OBJECT")
        np.testing.assert_allclose(scene.normals, vertex_normals(scene, ball), atol=1e-4)


if __name__ == "__main__":
    unittest.main()
