# SPDX-License-Identifier: GPL-3.0-or-later
"""Hard cases as objects in Blender, and a scene of those that can be looked at.

Needs bpy, unlike the generators.
"""

from __future__ import annotations

import bpy
from common import (
    Shape,
    add_camera,
    add_material,
    add_object,
    add_sun,
    empty_scene,
    new_collection,
    set_world,
)
from hard_cases_base import Array, Case
from mathutils import Matrix, Vector

# Cases that show something once they are brought to one size; names of hard_cases.CASES.
SHOWN = (
    "sphere_vertices", "slivers", "crumpled", "no_area", "collinear", "coplanar", "twice",
    "doubled", "thin_walls", "height_field", "growing_chain", "huge_over_small", "diagonals",
    "stairs", "clusters", "thin_parts",
)  # fmt: skip
SIZE, GAP, COLUMNS = 2.0, 1.0, 4  # metres


def add_case(case: Case, collection: bpy.types.Collection, large: bool = False) -> bpy.types.Object:
    """Put the mesh of a case into a collection as an object named after it, as it is.

    What it tries is kept as the object's property "tries". Raises ValueError for a case whose mesh
    no Blender file can hold.
    """
    problem = case.make(large)
    if case.refused and "ray" not in case.refused:
        raise ValueError(f"the hard case {case.name} is no mesh: {case.expected}")
    shape = Shape()
    shape.add(problem.vertices.tolist(), problem.triangles.tolist(), "case")
    if "case" not in bpy.data.materials:
        add_material("case", (0.6, 0.6, 0.6))
    item = add_object(case.name, shape, collection)
    item["tries"] = case.tries
    return item


def placed(vertices: Array, place: Vector) -> Matrix:
    """Brings a mesh to SIZE, standing on the ground at ``place``."""
    low, high = Vector(vertices.min(axis=0)), Vector(vertices.max(axis=0))
    scale = SIZE / max(high - low)
    foot = Vector(((low.x + high.x) / 2, (low.y + high.y) / 2, low.z))
    return Matrix.Translation(place) @ Matrix.Scale(scale, 4) @ Matrix.Translation(-foot)


def make(cases: list[Case]) -> None:
    """Start a new file with the cases of SHOWN side by side on a floor."""
    scene = empty_scene("hard cases")
    set_world((0.5, 0.55, 0.6))
    add_material("floor", (0.35, 0.35, 0.35))
    shown = [case for case in cases if case.name in SHOWN]
    rows = -(-len(shown) // COLUMNS)
    step = SIZE + GAP
    for i, case in enumerate(shown):
        collection = new_collection(case.name)
        item = add_case(case, collection)
        corners = case.make(False).vertices
        column, row = i % COLUMNS, i // COLUMNS
        item.matrix_world = placed(corners, Vector((step * column, step * row, 0.0)))
    floor = Shape()
    floor.box((-step, -step, -0.2), (step * COLUMNS, step * rows, -0.02), "floor")
    add_object("floor", floor, scene.collection)
    middle = Vector((step * (COLUMNS - 1) / 2, step * (rows - 1) / 2, 0.0))
    add_sun("sun", (4.0, -6.0, 9.0), 3.0, (1.0, 0.96, 0.9), 0.02)
    eye = middle + Vector((2.0, -3.8 * step, 3.2 * step))
    scene.camera = add_camera("overview", tuple(eye), tuple(middle), 30.0)
