# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenes of blender_scenes/: what they hold, how large they are, and that they never change.

These tests read the evaluated scene themselves: they need neither the add-on nor its native module.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import math
import sys
import tempfile
import unittest
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

SCENES = Path(__file__).resolve().parents[2] / "blender_scenes"
ATRIUM = SCENES / "atrium.blend"
MAXIMUM_BYTES = 2_000_000

if str(SCENES) not in sys.path:
    sys.path.insert(0, str(SCENES))

import make_scenes


@dataclass
class Census:
    """The evaluated scene in numbers: triangles and a hash of every vertex, index and matrix."""

    triangles: int
    digest: str
    low: np.ndarray
    high: np.ndarray
    areas: np.ndarray  # of all triangles, instances included
    parts: dict[str, int]  # triangles by object name


def take_census() -> Census:
    sha = hashlib.sha256()
    read: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    parts: dict[str, int] = {}
    corners_of_all, areas = [], []
    bpy.context.view_layer.update()
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        item = instance.object
        if item.type != "MESH":  # a curve shows a second time as the mesh it evaluates to
            continue
        if item.name_full not in read:
            read[item.name_full] = read_mesh(item.data)
            for array in read[item.name_full]:
                sha.update(array)
        vertices, triangles = read[item.name_full]
        matrix = np.ascontiguousarray(instance.matrix_world, np.float64)
        sha.update(matrix)
        world = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        a, b, c = (world[triangles[:, i]] for i in range(3))
        areas.append(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)
        corners_of_all.append(np.array([world.min(axis=0), world.max(axis=0)]))
        parts[item.name_full] = parts.get(item.name_full, 0) + len(triangles)
    bounds = np.array(corners_of_all)
    low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    all_areas = np.concatenate(areas)
    return Census(len(all_areas), sha.hexdigest(), low, high, all_areas, parts)


def read_mesh(mesh: bpy.types.Mesh) -> tuple[np.ndarray, np.ndarray]:
    mesh.calc_loop_triangles()
    vertices = np.empty(3 * len(mesh.vertices), np.float32)
    triangles = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.vertices.foreach_get("co", vertices)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3)


def objects_of(kind: str) -> list[bpy.types.Object]:
    return [item for item in bpy.context.scene.objects if item.type == kind]


def depths_seen(camera: bpy.types.Object, columns: int = 16, rows: int = 12) -> list[float]:
    """Return the distances to what a raster of rays from a camera hits; infinity for a miss."""
    scene, graph = bpy.context.scene, bpy.context.evaluated_depsgraph_get()
    frame = camera.data.view_frame(scene=scene)
    right, left = frame[0].x, frame[2].x
    top, bottom = frame[0].y, frame[2].y
    rotation = camera.matrix_world.to_quaternion()
    distances = []
    for j in range(rows):
        for i in range(columns):
            x = left + (right - left) * (i + 0.5) / columns
            y = bottom + (top - bottom) * (j + 0.5) / rows
            direction = rotation @ Vector((x, y, frame[0].z)).normalized()
            origin = camera.matrix_world.translation
            hit, point, *_ = scene.ray_cast(graph, origin, direction)
            distances.append((point - origin).length if hit else math.inf)
    return distances


class SceneTest(unittest.TestCase):
    def check_setting(self, cameras: list[str], materials: int) -> None:
        """Check what every scene has: views, lights, sky, and plain Principled materials."""
        scene = bpy.context.scene
        self.assertEqual((scene.render.resolution_x, scene.render.resolution_y), (1024, 768))
        self.assertCountEqual([camera.name for camera in objects_of("CAMERA")], cameras)
        self.assertEqual(scene.camera.name, cameras[0])
        kinds = {light.data.type for light in objects_of("LIGHT")}
        self.assertLessEqual({"AREA", "SUN"}, kinds)
        self.assertTrue(all(light.data.energy > 0 for light in objects_of("LIGHT")))
        background = next(n for n in scene.world.node_tree.nodes if n.type == "BACKGROUND")
        self.assertGreater(min(background.inputs["Color"].default_value[:3]), 0.05)
        self.assertGreaterEqual(len(bpy.data.materials), materials)
        colors = set()
        for material in bpy.data.materials:
            shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
            self.assertFalse(shader.inputs["Base Color"].is_linked, material.name)
            colors.add(tuple(shader.inputs["Base Color"].default_value))
        self.assertGreaterEqual(len(colors), materials)

    def check_views(self, nearest: float) -> None:
        """Check that no camera stares into a wall or into the sky."""
        for camera in objects_of("CAMERA"):
            with self.subTest(camera=camera.name):
                distances = sorted(depths_seen(camera))
                seen = [distance for distance in distances if distance < math.inf]
                self.assertGreater(len(seen), 0.4 * len(distances))
                self.assertGreater(seen[len(seen) // 2], nearest)


class Atrium(SceneTest):
    @classmethod
    def setUpClass(cls) -> None:
        bpy.ops.wm.open_mainfile(filepath=str(ATRIUM))
        cls.census = take_census()

    def setUp(self) -> None:
        if Path(bpy.data.filepath) != ATRIUM:
            bpy.ops.wm.open_mainfile(filepath=str(ATRIUM))

    def test_is_small_and_opens_in_every_blender_from_3_4(self) -> None:
        self.assertLess(ATRIUM.stat().st_size, MAXIMUM_BYTES)
        self.assertEqual(tuple(bpy.data.version)[:2], (3, 4))

    def test_setting(self) -> None:
        self.check_setting(["court", "gallery", "arcade"], materials=15)

    def test_views(self) -> None:
        self.check_views(nearest=3.0)

    def test_triangles_are_many_and_of_all_sizes(self) -> None:
        self.assertGreater(self.census.triangles, 140_000)
        self.assertLess(self.census.triangles, 180_000)
        small, large = np.quantile(self.census.areas[self.census.areas > 0], [0.05, 0.999])
        self.assertGreater(large / small, 1000)

    def test_render_and_viewport_geometry_are_one(self) -> None:
        for item in bpy.data.objects:
            for modifier in item.modifiers:
                if modifier.type == "SUBSURF":
                    self.assertEqual(modifier.levels, modifier.render_levels)
                if modifier.type == "SCREW":
                    self.assertEqual(modifier.steps, modifier.render_steps)
                self.assertTrue(modifier.show_viewport and modifier.show_render)

    def test_the_committed_file_is_what_the_script_makes(self) -> None:
        make_scenes.make("atrium")
        made = take_census()
        self.assertEqual(made.parts, self.census.parts)
        np.testing.assert_allclose(made.low, self.census.low, atol=1e-4)
        np.testing.assert_allclose(made.high, self.census.high, atol=1e-4)
        self.assertAlmostEqual(made.areas.sum(), self.census.areas.sum(), delta=0.01)
        self.assertEqual(make_scenes.triangle_count(), made.triangles)


class Hairball(SceneTest):
    def test_strands_setting_and_determinism(self) -> None:
        make_scenes.make("hairball", strands=130)
        self.check_setting(["front", "close", "above"], materials=5)
        first = take_census()
        strands = sum(n for name, n in first.parts.items() if name.startswith("tuft"))
        self.assertEqual(strands, 130 * 48 * 8)  # 48 pieces with four sides
        make_scenes.make("hairball", strands=130)
        self.assertEqual(take_census().digest, first.digest)
        make_scenes.make("hairball", strands=131)
        self.assertNotEqual(take_census().digest, first.digest)

    def test_one_strand(self) -> None:
        make_scenes.make("hairball", strands=1)
        parts = take_census().parts
        self.assertEqual(sum(n for name, n in parts.items() if name.startswith("tuft")), 48 * 8)


class City(SceneTest):
    def test_triangles_setting_views_and_determinism(self) -> None:
        make_scenes.make("city")
        self.check_setting(["skyline", "avenue", "aerial"], materials=15)
        self.check_views(nearest=30.0)
        first = take_census()
        self.assertGreater(first.triangles, 450_000)
        self.assertLess(first.triangles, 650_000)
        make_scenes.make("city")
        self.assertEqual(take_census().digest, first.digest)


class CommandLine(unittest.TestCase):
    def run_main(self, *argv: str) -> tuple[int, str]:
        """Run make_scenes as if from a shell; return its exit code and what it printed."""
        before, printed = sys.argv, io.StringIO()
        sys.argv = ["make_scenes.py", "--", *argv]
        try:
            with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
                return make_scenes.main(), printed.getvalue()
        except SystemExit as exit_request:
            return int(exit_request.code or 0), printed.getvalue()
        finally:
            sys.argv = before

    def test_saves_small_files_that_open_again(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            for name, extra in (("hairball", ("--strands", "60")), ("city", ())):
                code, printed = self.run_main(name, "--out", folder, *extra)
                self.assertEqual(code, 0, printed)
                path = Path(folder) / f"{name}.blend"
                self.assertLess(path.stat().st_size, MAXIMUM_BYTES)
                before = take_census()
                bpy.ops.wm.open_mainfile(filepath=str(path))
                self.assertEqual(take_census().digest, before.digest)
            self.assertCountEqual(
                [p.name for p in Path(folder).iterdir()], ["hairball.blend", "city.blend"]
            )

    def test_bad_arguments_are_named(self) -> None:
        for argv, named in (
            (("cathedral",), "cathedral"),
            (("hairball", "--strands", "0"), "--strands"),
            (("hairball", "--strands", "many"), "many"),
        ):
            code, printed = self.run_main(*argv)
            self.assertNotEqual(code, 0)
            self.assertIn(named, printed)
            self.assertNotIn("Traceback", printed)

    def test_unwritable_folder_leaves_nothing(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            obstacle = Path(folder) / "file"
            obstacle.write_text("in the way")
            code, printed = self.run_main("hairball", "--strands", "1", "--out", str(obstacle))
            self.assertEqual(code, 1)
            self.assertIn("cannot write", printed)
            self.assertEqual(list(Path(folder).iterdir()), [obstacle])


if __name__ == "__main__":
    unittest.main()
