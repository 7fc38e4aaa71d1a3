# SPDX-License-Identifier: GPL-3.0-or-later
"""What every test in Blender starts from.

bpy comes first: the native module must bind to Blender's own oneTBB.
"""

from __future__ import annotations

import os
import sys
import unittest
from pathlib import Path

import bpy
import numpy as np

REPOSITORY = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get("BVHLAB_BUILD", REPOSITORY / "build"))
SHARED_BLENDS = REPOSITORY.parent / "shared" / "blends"
if str(BUILD) not in sys.path:
    sys.path.insert(0, str(BUILD))


class EmptySceneTest(unittest.TestCase):
    """Every test starts in a factory-fresh file without objects."""

    def setUp(self) -> None:
        bpy.ops.wm.read_factory_settings(use_empty=True)

    def extract(self, geometry: str = "viewport"):
        from bvh_lab.blender.extract import extract_scene

        return extract_scene(bpy.context, geometry)


def add_mesh(name: str, vertices: list, faces: list) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    return link(bpy.data.objects.new(name, mesh))


def add_cube(name: str = "Cube") -> bpy.types.Object:
    """A cube from -1 to 1 with outward faces: 8 vertices, 12 triangles, volume 8."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return add_mesh(name, corners, faces)


def link(obj: bpy.types.Object) -> bpy.types.Object:
    bpy.context.scene.collection.objects.link(obj)
    return obj


def add_material(name: str) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    use_nodes(material)
    return material


def use_nodes(block: bpy.types.Material | bpy.types.World) -> None:
    if bpy.app.version < (5, 0, 0):  # later every material and world has nodes
        block.use_nodes = True


def add_camera(name: str = "Camera") -> bpy.types.Object:
    return link(bpy.data.objects.new(name, bpy.data.cameras.new(name)))


def add_light(kind: str, name: str = "Light") -> bpy.types.Object:
    return link(bpy.data.objects.new(name, bpy.data.lights.new(name, kind)))


def signed_volume(scene) -> float:
    """Volume of a closed surface; negative where the faces look inwards."""
    corners = scene.vertices.astype(np.float64)[scene.triangles]
    return float(
        np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    )


def surface_area(scene) -> float:
    corners = scene.vertices.astype(np.float64)[scene.triangles]
    return float(
        np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        ).sum()
        / 2
    )
