# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles of an evaluated depsgraph in world space.

Winding: a triangle's geometric normal, ``cross(v1 - v0, v2 - v0)``, points where Blender's face
normal does. A mirrored transform (negative determinant) would turn it round, so such an instance
has its second and third vertex swapped; triangle order and vertex order stay as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np
import numpy.typing as npt

from ..study.scene import Float32Array, Float64Array, UInt32Array
from .notes import Notes

LEFT_OUT = {
    "VOLUME": "volumes",
    "CURVES": "hair curves",
    "POINTCLOUD": "point clouds",
    "GPENCIL": "grease pencil drawings",
    "GREASEPENCIL": "grease pencil drawings",
}
MAX_VERTICES = 2**32 - 1  # triangle corners are uint32


class ExtractError(ValueError):
    """The scene cannot be turned into arrays; the text is one sentence that names the object."""


@dataclass
class LocalMesh:
    """One mesh in its own space.

    ``vertices`` (V, 3) float32, ``triangles`` (T, 3) uint32, ``slots`` (T,) int32: material slots.
    """

    vertices: Float32Array
    triangles: UInt32Array
    slots: npt.NDArray[np.int32]
    materials: list[bpy.types.Material | None]


@dataclass
class Geometry:
    """All triangles in world space, as in `Scene`.

    ``materials[0]`` is None: the default material of an empty slot. ``objects`` counts the placed
    instances, ``meshes`` the distinct meshes among them.
    """

    vertices: Float32Array
    triangles: UInt32Array
    material_index: UInt32Array
    materials: list[bpy.types.Material | None]
    objects: int = 0
    meshes: int = 0


@dataclass
class _Parts:
    vertices: list[Float32Array] = field(default_factory=list)
    triangles: list[UInt32Array] = field(default_factory=list)
    material_index: list[UInt32Array] = field(default_factory=list)
    vertex_count: int = 0


def gather(depsgraph: bpy.types.Depsgraph, viewport: bool, notes: Notes) -> Geometry:
    """Collect the triangles of every visible instance; a mesh is read once however often it stands.

    Raises ExtractError for a non-finite vertex and for more vertices than uint32 counts.
    """
    local_meshes: dict[int, LocalMesh] = {}
    numbers: dict[int, int] = {0: 0}
    materials: list[bpy.types.Material | None] = [None]
    parts = _Parts()
    for instance in depsgraph.object_instances:
        obj = instance.object
        if not instance.show_self or not _has_surface(obj, viewport, notes):
            continue
        key = obj.data.as_pointer()
        if key not in local_meshes:
            local_meshes[key] = _read_object(obj)
        local = local_meshes[key]
        if len(local.triangles):
            slots = _slot_numbers(obj, local, numbers, materials)
            _place(parts, local, np.array(instance.matrix_world), slots, obj.name)
    if not parts.triangles:
        return Geometry(
            np.zeros((0, 3), np.float32),
            np.zeros((0, 3), np.uint32),
            np.zeros(0, np.uint32),
            [None],
        )
    return Geometry(
        np.concatenate(parts.vertices),
        np.concatenate(parts.triangles),
        np.concatenate(parts.material_index),
        materials,
        objects=len(parts.triangles),
        meshes=sum(len(mesh.triangles) > 0 for mesh in local_meshes.values()),
    )


def _has_surface(obj: bpy.types.Object, viewport: bool, notes: Notes) -> bool:
    """Whether the object is a mesh to trace; what is left out or ignored goes to the notes.

    The depsgraph lists a curve, text, surface or metaball twice: as itself and, as an instance of
    type MESH, as the mesh it evaluates to. So meshes are all there is to read.
    """
    if obj.type in LEFT_OUT:
        notes.add(f"left out: {LEFT_OUT[obj.type]}", obj.name)
    if obj.type != "MESH":
        return False
    systems = [system.settings for system in obj.particle_systems]
    if any(system.type == "HAIR" and system.render_type == "PATH" for system in systems):
        notes.add("left out: particle hair", obj.name)
    if viewport and obj.display_type in {"WIRE", "BOUNDS"}:
        notes.add("left out: drawn as wire or bounds in the viewport", obj.name)
        return False
    if not (obj.visible_camera and obj.visible_shadow and obj.visible_diffuse):
        notes.add("approximated: ray visibility is ignored, every ray sees these", obj.name)
    return True


def _read_object(obj: bpy.types.Object) -> LocalMesh:
    if not obj.data.is_editmode:
        return _read_mesh(obj.data)
    try:  # in Edit Mode the evaluated mesh may be a shell around the edited one
        return _read_mesh(obj.to_mesh())
    finally:
        obj.to_mesh_clear()


def _read_mesh(mesh: bpy.types.Mesh) -> LocalMesh:
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    vertices = np.empty(3 * len(mesh.vertices), np.float32)
    triangles = np.empty(3 * count, np.int32)
    slots = np.empty(count, np.int32)
    mesh.vertices.foreach_get("co", vertices)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    mesh.loop_triangles.foreach_get("material_index", slots)
    corners = triangles.view(np.uint32).reshape(-1, 3)
    return LocalMesh(vertices.reshape(-1, 3), corners, slots, list(mesh.materials))


def _slot_numbers(
    obj: bpy.types.Object,
    local: LocalMesh,
    numbers: dict[int, int],
    materials: list[bpy.types.Material | None],
) -> UInt32Array:
    """Scene-wide material number of each slot of ``obj``; number 0 stands for an empty slot."""
    slots = obj.material_slots
    found = []
    for index in range(max(len(slots), len(local.materials), 1)):
        material = local.materials[index] if index < len(local.materials) else None
        # The mesh's own list wins, which geometry nodes may have replaced, unless the slot belongs
        # to the object.
        beyond = index >= len(local.materials)
        if index < len(slots) and (beyond or slots[index].link == "OBJECT"):
            material = slots[index].material
        pointer = material.original.as_pointer() if material else 0
        if pointer not in numbers:
            numbers[pointer] = len(materials)
            materials.append(material)
        found.append(numbers[pointer])
    return np.array(found, np.uint32)


def _place(
    parts: _Parts, local: LocalMesh, matrix: Float64Array, slots: UInt32Array, name: str
) -> None:
    """Append ``local`` under ``matrix``: transformed in float64 and rounded once to float32."""
    linear, offset = matrix[:3, :3], matrix[:3, 3]
    with np.errstate(over="ignore", invalid="ignore"):
        world = (local.vertices.astype(np.float64) @ linear.T + offset).astype(np.float32)
    _check_finite(world, name)
    triangles = local.triangles + np.uint32(parts.vertex_count)
    if np.linalg.det(linear) < 0.0:
        triangles = triangles[:, [0, 2, 1]]
    parts.vertices.append(world)
    parts.triangles.append(triangles)
    # A face whose index lies beyond the last slot takes the last slot, as in Cycles.
    parts.material_index.append(slots[np.clip(local.slots, 0, len(slots) - 1)])
    parts.vertex_count += len(world)
    if parts.vertex_count > MAX_VERTICES:
        raise ExtractError(
            f"Object '{name}' takes the scene beyond 2^32 vertices: hide some objects."
        )


def _check_finite(vertices: Float32Array, name: str) -> None:
    finite = np.isfinite(vertices).all(axis=1)
    if not finite.all():
        vertex = int(np.argmin(finite))
        place = tuple(vertices[vertex].tolist())
        raise ExtractError(
            f"Object '{name}' has a vertex that is not finite: vertex {vertex} is at {place}."
        )
