# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles of an evaluated depsgraph in world space.

Winding: a triangle's geometric normal, ``cross(v1 - v0, v2 - v0)``, points where Blender's face
normal does. A mirrored transform (negative determinant) would turn it round, so such an instance
has its second and third corner swapped; triangle order and vertex order stay as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np
import numpy.typing as npt

from ..study.scene import Float32Array, Float64Array, UInt32Array
from .corners import CornerParts, normals_to_world
from .local_mesh import LocalMesh, read_object, read_uvs
from .materials import Materials
from .notes import Notes
from .unmodelled import say_object

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
class Geometry:
    """All triangles in world space, as in `Scene`.

    ``objects`` counts the placed instances, ``meshes`` the distinct meshes among them.
    """

    vertices: Float32Array
    triangles: UInt32Array
    material_index: UInt32Array
    uvs: Float32Array | None = None
    normals: Float32Array | None = None
    objects: int = 0
    meshes: int = 0


@dataclass
class _Parts:
    vertices: list[Float32Array] = field(default_factory=list)
    triangles: list[UInt32Array] = field(default_factory=list)
    material_index: list[UInt32Array] = field(default_factory=list)
    corners: CornerParts = field(default_factory=CornerParts)
    vertex_count: int = 0


def gather(
    depsgraph: bpy.types.Depsgraph, viewport: bool, materials: Materials, notes: Notes
) -> Geometry:
    """Collect the triangles of every visible instance; a mesh is read once however often it stands.

    Raises ExtractError for a non-finite vertex and for more vertices than uint32 counts.
    """
    local_meshes: dict[int, LocalMesh] = {}
    has_surface: dict[tuple[int, str], bool] = {}  # a curve is there as such and as a mesh
    parts = _Parts()
    for instance in depsgraph.object_instances:
        obj = instance.object
        if not instance.show_self:
            continue
        key = (obj.original.as_pointer(), obj.type)
        if key not in has_surface:
            has_surface[key] = _has_surface(obj, viewport, notes)
        if not has_surface[key]:
            continue
        pointer = obj.data.as_pointer()
        if pointer not in local_meshes:
            local_meshes[pointer] = read_object(obj)
        local = local_meshes[pointer]
        if not len(local.triangles):
            continue
        slots = _slot_numbers(obj, local, materials)
        layers = [materials.uv_layer(number) for number in slots.tolist()]
        read_uvs(obj, local, layers)
        _place(parts, local, np.array(instance.matrix_world), slots, layers, obj.name)
    if not parts.triangles:
        return Geometry(
            np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32), np.zeros(0, np.uint32)
        )
    vertices, triangles = np.concatenate(parts.vertices), np.concatenate(parts.triangles)
    return Geometry(
        vertices,
        triangles,
        np.concatenate(parts.material_index),
        parts.corners.uvs(len(triangles)) if materials.any_texture else None,
        parts.corners.normals(vertices, triangles),
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
    if viewport and obj.display_type in {"WIRE", "BOUNDS"}:
        notes.add("left out: drawn as wire or bounds in the viewport", obj.name)
        return False
    say_object(obj, notes)
    return True


def _slot_numbers(obj: bpy.types.Object, local: LocalMesh, materials: Materials) -> UInt32Array:
    """Scene-wide material number of each slot of ``obj``, 0 for an empty slot.

    And 0 for a slot that no triangle has: its material is not read.
    """
    slots, own = obj.material_slots, obj.data.materials
    count = max(len(slots), len(own), 1)
    numbers = np.zeros(count, np.uint32)
    for index in sorted(set(_slots_of(local.distinct_slots, count).tolist())):
        material = own[index] if index < len(own) else None
        # The mesh's own list wins, which geometry nodes may have replaced, unless the slot belongs
        # to the object.
        beyond = index >= len(own)
        if index < len(slots) and (beyond or slots[index].link == "OBJECT"):
            material = slots[index].material
        numbers[index] = materials.number(material)
    return numbers


def _slots_of(indices: npt.NDArray[np.int32], count: int) -> npt.NDArray[np.int32]:
    """A face whose index lies beyond the last of so many slots takes the last one, as in Cycles."""
    return np.clip(indices, 0, count - 1)


def _place(
    parts: _Parts,
    local: LocalMesh,
    matrix: Float64Array,
    slots: UInt32Array,
    layers: list[str | None],
    name: str,
) -> None:
    """Append ``local`` under ``matrix``: transformed in float64 and rounded once to float32."""
    linear, offset = matrix[:3, :3], matrix[:3, 3]
    with np.errstate(over="ignore", invalid="ignore"):
        world = (local.vertices.astype(np.float64) @ linear.T + offset).astype(np.float32)
    _check_finite(world, name)
    mirrored = np.linalg.det(linear) < 0.0
    corners = [0, 2, 1] if mirrored else [0, 1, 2]
    slot = _slots_of(local.slots, len(slots))
    uvs = local.uvs_by_slot(slot, layers)
    parts.corners.add(
        len(local.triangles),
        uvs[:, corners] if uvs is not None else None,
        local.smooth,
        normals_to_world(local.normals[:, corners], linear) if local.normals is not None else None,
    )
    triangles = local.triangles + np.uint32(parts.vertex_count)
    parts.vertices.append(world)
    parts.triangles.append(triangles[:, corners] if mirrored else triangles)
    parts.material_index.append(slots[slot])
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
