# SPDX-License-Identifier: GPL-3.0-or-later
"""Extraction of geometry: known shapes in, known arrays out."""

from __future__ import annotations

import math
import unittest

import bpy
import numpy as np
from blender_support import (
    EmptySceneTest,
    add_camera,
    add_cube,
    add_mesh,
    link,
    signed_volume,
    surface_area,
)


class Shapes(EmptySceneTest):
    def test_cube(self) -> None:
        add_cube().location = (10, 0, 0)
        scene = self.extract()
        self.assertEqual((scene.vertices.dtype, scene.vertices.shape), (np.float32, (8, 3)))
        self.assertEqual((scene.triangles.dtype, scene.triangles.shape), (np.uint32, (12, 3)))
        self.assertEqual(
            (scene.material_index.dtype, scene.material_index.shape), (np.uint32, (12,))
        )
        np.testing.assert_array_equal(scene.vertices.min(axis=0), (9, -1, -1))
        np.testing.assert_array_equal(scene.vertices.max(axis=0), (11, 1, 1))
        self.assertAlmostEqual(signed_volume(scene), 8.0)

    def test_mirrored_cube_still_faces_outwards(self) -> None:
        add_cube().scale = (-1, 2, 3)
        self.assertAlmostEqual(signed_volume(self.extract()), 48.0, places=4)

    def test_mirroring_keeps_triangle_order(self) -> None:
        cube = add_cube()
        plain = self.extract()
        cube.scale = (-1, 1, 1)
        mirrored = self.extract()
        np.testing.assert_array_equal(mirrored.triangles, plain.triangles[:, [0, 2, 1]])

    def test_transform_is_rounded_once(self) -> None:
        obj = add_mesh("Tri", [(0.1, 0.2, 0.3), (1.1, 0.2, 0.3), (0.1, 1.7, 0.3)], [(0, 1, 2)])
        obj.location, obj.rotation_euler, obj.scale = (
            (1234.5, -77.7, 3.3),
            (0.3, 1.1, -2.0),
            (1.3, 0.7, 2.9),
        )
        bpy.context.view_layer.update()
        matrix = np.array(obj.matrix_world)
        local = np.array([vertex.co[:] for vertex in obj.data.vertices])
        expected = (local @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)
        np.testing.assert_array_equal(self.extract().vertices, expected)

    def test_filled_curve(self) -> None:
        bpy.ops.curve.primitive_bezier_circle_add(radius=2)
        curve = bpy.context.object.data
        curve.dimensions, curve.fill_mode, curve.resolution_u = "2D", "FRONT", 64
        self.assertAlmostEqual(surface_area(self.extract()), math.pi * 4, delta=0.02)

    def test_text(self) -> None:
        bpy.ops.object.text_add()
        bpy.context.object.data.body = "BVH"
        scene = self.extract()
        size = scene.vertices.max(axis=0) - scene.vertices.min(axis=0)
        self.assertGreater(size[0], size[1])
        self.assertEqual(size[2], 0.0)

    def test_nurbs_surface(self) -> None:
        bpy.ops.surface.primitive_nurbs_surface_sphere_add(radius=1)
        self.assertGreater(len(self.extract().triangles), 100)

    def test_metaballs_of_a_family_are_read_once(self) -> None:
        bpy.ops.object.metaball_add(type="BALL", location=(0, 0, 0))
        alone = self.extract()
        bpy.ops.object.metaball_add(type="BALL", location=(50, 0, 0))
        both = self.extract()
        self.assertEqual(len(both.triangles), 2 * len(alone.triangles))
        self.assertAlmostEqual(
            surface_area(both), 2 * surface_area(alone), delta=1e-2 * surface_area(alone)
        )

    def test_what_becomes_a_mesh_is_read_once(self) -> None:
        for add in (
            bpy.ops.object.text_add,
            bpy.ops.object.metaball_add,
            bpy.ops.surface.primitive_nurbs_surface_sphere_add,
        ):
            with self.subTest(operator=add.idname()):
                bpy.ops.wm.read_factory_settings(use_empty=True)
                add()
                evaluated = bpy.context.object.evaluated_get(bpy.context.evaluated_depsgraph_get())
                area = sum(polygon.area for polygon in evaluated.to_mesh().polygons)
                evaluated.to_mesh_clear()
                scene = self.extract()
                self.assertAlmostEqual(surface_area(scene) / area, 1.0, delta=1e-2)

    def test_text_in_collection_instances(self) -> None:
        bpy.ops.object.text_add()
        text = bpy.context.object
        alone = self.extract()
        collection = bpy.data.collections.new("Letters")
        collection.objects.link(text)
        bpy.context.scene.collection.objects.unlink(text)
        for _ in range(3):
            empty = link(bpy.data.objects.new("Instance", None))
            empty.instance_type, empty.instance_collection = "COLLECTION", collection
        self.assertEqual(len(self.extract().triangles), 3 * len(alone.triangles))

    def test_edit_mode(self) -> None:
        cube = add_cube()
        bpy.context.view_layer.objects.active = cube
        bpy.ops.object.mode_set(mode="EDIT")
        scene = self.extract()
        bpy.ops.object.mode_set(mode="OBJECT")
        self.assertAlmostEqual(signed_volume(scene), 8.0)

    def test_loose_edges_and_empties_are_no_surface(self) -> None:
        add_cube()
        add_mesh("Edges", [(0, 0, 0), (9, 9, 9)], [])
        link(bpy.data.objects.new("Empty", None))
        self.assertEqual(len(self.extract().vertices), 8)


class Instances(EmptySceneTest):
    def test_collection_instances(self) -> None:
        collection = bpy.data.collections.new("Parts")
        cube = add_cube()
        bpy.context.scene.collection.objects.unlink(cube)
        collection.objects.link(cube)
        for number in range(5):
            empty = link(bpy.data.objects.new("Instance", None))
            empty.instance_type, empty.instance_collection = "COLLECTION", collection
            empty.location.x = 4.0 * number
        scene = self.extract()
        self.assertEqual(len(scene.triangles), 60)
        self.assertAlmostEqual(signed_volume(scene), 40.0, places=3)
        self.assertEqual(float(scene.vertices[:, 0].max()), 17.0)
        self.assertIn("5 objects and instances, 1 distinct", scene.notes[0])

    def test_instances_on_vertices_hide_the_instancer(self) -> None:
        parent, child = (
            add_mesh("Points", [(0, 0, 0), (10, 0, 0), (20, 0, 0)], [(0, 1, 2)]),
            add_cube(),
        )
        child.parent = parent
        parent.instance_type = "VERTS"
        parent.show_instancer_for_viewport = False
        scene = self.extract()
        self.assertAlmostEqual(
            signed_volume(scene), 32.0, places=4
        )  # the child itself stays, as in Blender

    def test_particles(self) -> None:
        child = add_cube("Particle")
        child.location.z = 100
        bpy.ops.mesh.primitive_plane_add()
        plane = bpy.context.object
        plane.modifiers.new("Particles", "PARTICLE_SYSTEM")
        settings = plane.particle_systems[0].settings
        settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 7, 1, 1, 500
        settings.physics_type = "NO"
        settings.render_type, settings.instance_object, settings.particle_size = (
            "OBJECT",
            child,
            0.1,
        )
        bpy.context.scene.frame_set(2)
        scene = self.extract()
        self.assertEqual(len(scene.triangles), 2 + 12 + 7 * 12)

    def test_geometry_nodes(self) -> None:
        child = add_cube("Instanced")
        child.hide_set(True)
        host = add_mesh("Host", [(0, 0, 0), (10, 0, 0), (0, 10, 0)], [(0, 1, 2)])
        host.modifiers.new("Nodes", "NODES").node_group = _instance_on_points(child)
        scene = self.extract()
        self.assertEqual(len(scene.triangles), 36)
        self.assertAlmostEqual(signed_volume(scene), 24.0, places=3)

    def test_two_objects_share_one_mesh_but_not_modifiers(self) -> None:
        first = add_cube()
        second = link(bpy.data.objects.new("Second", first.data))
        second.modifiers.new("Array", "ARRAY").count = 3
        self.assertEqual(len(self.extract().triangles), 12 * 4)


class TenThousand(EmptySceneTest):
    """Instances of each kind are the same triangles as as many objects."""

    PLACES = tuple((3.0 * (i % 100), 3.0 * (i // 100), 0.0) for i in range(10_000))

    def check(self, scene, beside: int = 0) -> None:
        """All cubes are there, each where it should be; ``beside``: triangles of other objects."""
        self.assertEqual(len(scene.triangles) - beside, 12 * len(self.PLACES))
        cubes = scene.vertices[: 8 * len(self.PLACES)].reshape(-1, 8, 3)
        centres = cubes.mean(axis=1)
        order = np.lexsort((centres[:, 0], centres[:, 1]))
        np.testing.assert_array_equal(centres[order], np.array(self.PLACES, np.float32))
        corners = cubes - centres[:, None]
        np.testing.assert_array_equal(corners, np.broadcast_to(corners[0], corners.shape))

    def test_objects_and_collection_instances(self) -> None:
        cube = add_cube()
        for place in self.PLACES[1:]:
            copy = link(cube.copy())
            copy.location = place
        real = self.extract()
        self.check(real)
        bpy.ops.wm.read_factory_settings(use_empty=True)
        collection = bpy.data.collections.new("Parts")
        cube = add_cube()
        bpy.context.scene.collection.objects.unlink(cube)
        collection.objects.link(cube)
        for place in self.PLACES:
            empty = link(bpy.data.objects.new("Instance", None))
            empty.instance_type, empty.instance_collection = "COLLECTION", collection
            empty.location = place
        instanced = self.extract()
        self.check(instanced)
        np.testing.assert_array_equal(_sorted(instanced), _sorted(real))
        self.assertEqual(len(instanced.triangles), len(real.triangles))

    def test_geometry_nodes(self) -> None:
        child = add_cube("Instanced")
        child.hide_set(True)
        host = add_mesh("Host", list(self.PLACES), [])
        host.modifiers.new("Nodes", "NODES").node_group = _instance_on_points(child)
        self.check(self.extract())

    def test_particles(self) -> None:
        child = add_cube("Particle")
        child.hide_set(True)
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=100, y_subdivisions=100, size=300)
        grid = bpy.context.object
        grid.modifiers.new("Particles", "PARTICLE_SYSTEM")
        settings = grid.particle_systems[0].settings
        settings.count, settings.frame_start, settings.frame_end = len(self.PLACES), 1, 1
        settings.lifetime, settings.physics_type = 500, "NO"
        settings.emit_from, settings.use_emit_random = "FACE", False
        settings.render_type, settings.instance_object = "OBJECT", child
        settings.particle_size = 0.1
        bpy.context.scene.frame_set(2)
        scene = self.extract()
        self.assertEqual(len(scene.triangles), 2 * 100 * 100 + 12 * len(self.PLACES))
        self.assertIn("10001 objects and instances, 2 distinct", scene.notes[0])


def _sorted(scene) -> np.ndarray:
    return scene.vertices[np.lexsort(scene.vertices.T)]


def _instance_on_points(child: bpy.types.Object) -> bpy.types.NodeTree:
    tree = bpy.data.node_groups.new("Instances", "GeometryNodeTree")
    if hasattr(tree, "interface"):  # Blender 4.0
        tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
        tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    else:
        tree.inputs.new("NodeSocketGeometry", "Geometry")
        tree.outputs.new("NodeSocketGeometry", "Geometry")
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    info, scatter = (
        tree.nodes.new("GeometryNodeObjectInfo"),
        tree.nodes.new("GeometryNodeInstanceOnPoints"),
    )
    info.inputs["Object"].default_value = child
    tree.links.new(start.outputs[0], scatter.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], scatter.inputs["Instance"])
    tree.links.new(scatter.outputs[0], end.inputs[0])
    return tree


class ViewportAndRender(EmptySceneTest):
    def test_modifier_levels(self) -> None:
        modifier = add_cube().modifiers.new("Subdivision", "SUBSURF")
        modifier.levels, modifier.render_levels = 1, 3
        viewport, render = self.extract("viewport"), self.extract("render")
        self.assertEqual((len(viewport.triangles), viewport.geometry), (6 * 4 * 2, "viewport"))
        self.assertEqual((len(render.triangles), render.geometry), (6 * 4**3 * 2, "render"))

    def test_visibility(self) -> None:
        for number, name in enumerate(("both", "viewport only", "render only", "eye closed")):
            add_cube(name).location.x = 10 * number
        objects = bpy.data.objects
        objects["viewport only"].hide_render = True
        objects["render only"].hide_viewport = True
        objects["eye closed"].hide_set(True)
        self.assertEqual(_places(self.extract("viewport")), {0, 10})
        self.assertEqual(_places(self.extract("render")), {0, 20, 30})

    def test_wire_in_the_viewport_is_a_surface_in_the_render(self) -> None:
        add_cube()
        cutter = add_cube("Cutter")
        cutter.location.x, cutter.display_type = 10, "WIRE"
        viewport = self.extract("viewport")
        self.assertEqual(_places(viewport), {0})
        self.assertTrue(any("wire" in note and "Cutter" in note for note in viewport.notes))
        self.assertEqual(_places(self.extract("render")), {0, 10})

    def test_render_leaves_no_trace(self) -> None:
        add_cube()
        scene = bpy.context.scene
        before = _state()
        self.extract("render")
        self.assertEqual(_state(), before)
        self.assertEqual(bpy.context.scene, scene)

    def test_render_works_with_a_camera_and_keeps_its_aspect(self) -> None:
        add_cube()
        bpy.context.scene.camera = add_camera()
        bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = 300, 100
        scene = self.extract("render")
        self.assertEqual([camera.name for camera in scene.cameras], ["Camera"])
        self.assertAlmostEqual(scene.cameras[0].aspect, 3.0, places=5)

    def test_errors_leave_the_render_call(self) -> None:
        from bvh_lab.blender.extract import ExtractError

        add_cube().hide_render = True
        before = _state()
        with self.assertRaisesRegex(ExtractError, "no renderable surface"):
            self.extract("render")
        self.assertEqual(_state(), before)


def _places(scene) -> set[int]:
    return {round(float(x)) for x in scene.vertices.reshape(-1, 8, 3)[:, :, 0].mean(axis=1)}


def _state() -> tuple:
    render = bpy.context.scene.render
    return (
        [scene.name for scene in bpy.data.scenes],
        [obj.name for obj in bpy.data.objects],
        [camera.name for camera in bpy.data.cameras],
        render.engine,
        render.resolution_x,
        render.use_compositing,
        [
            engine.__name__
            for engine in bpy.types.RenderEngine.__subclasses__()
            if engine.is_registered
        ],
    )


class BadScenes(EmptySceneTest):
    def test_empty_scene(self) -> None:
        from bvh_lab.blender.extract import ExtractError

        with self.assertRaisesRegex(ExtractError, "Scene 'Scene' has no visible surface"):
            self.extract()

    def test_non_finite_vertex(self) -> None:
        from bvh_lab.blender.extract import ExtractError

        add_cube("Broken").data.vertices[5].co.y = math.nan
        with self.assertRaisesRegex(ExtractError, "Object 'Broken'.*vertex 5 "):
            self.extract()

    def test_unknown_geometry(self) -> None:
        from bvh_lab.blender.extract import ExtractError

        add_cube()
        with self.assertRaisesRegex(ExtractError, "not 'final'"):
            self.extract("final")

    def test_collapsed_object_is_kept(self) -> None:
        add_cube().scale = (0, 0, 0)
        self.assertEqual(len(self.extract().triangles), 12)


if __name__ == "__main__":
    unittest.main()
