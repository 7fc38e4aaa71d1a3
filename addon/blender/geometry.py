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

from ..study.scene import Float32Array, Float64Array, UInt32Array
from .corners import CornerParts, normals_to_world
from .local_mesh import LocalMesh, read_object
from .materials import Materials
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
    local_meshes: dict[tuple[int, tuple[str, ...]], LocalMesh] = {}
    parts = _Parts()
    for instance in depsgraph.object_instances:
        obj = instance.object
        if not instance.show_self or not _has_surface(obj, viewport, notes):
            continue
        slots = _slot_numbers(obj, materials)
        by_slot = [materials.uv_layer(number) for number in slots.tolist()]
        layers = tuple(dict.fromkeys(layer for layer in by_slot if layer is not None))
        key = (obj.data.as_pointer(), layers)
        if key not in local_meshes:
            local_meshes[key] = read_object(obj, layers)
        local = local_meshes[key]
        if len(local.triangles):
            _place(parts, local, np.array(instance.matrix_world), slots, by_slot, obj.name)
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
        meshes=len({key[0] for key, mesh in local_meshes.items() if len(mesh.triangles)}),
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


def _slot_numbers(obj: bpy.types.Object, materials: Materials) -> UInt32Array:
    """Scene-wide material number of each slot of ``obj``; number 0 stands for an empty slot."""
    slots, own = obj.material_slots, obj.data.materials
    found = []
    for index in range(max(len(slots), len(own), 1)):
        material = own[index] if index < len(own) else None
        # The mesh's own list wins, which geometry nodes may have replaced, unless the slot belongs
        # to the object.
        beyond = index >= len(own)
        if index < len(slots) and (beyond or slots[index].link == "OBJECT"):
            material = slots[index].material
        found.append(materials.number(material))
    return np.array(found, np.uint32)


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
    # A face whose index lies beyond the last slot takes the last slot, as in Cycles.
    slot = np.clip(local.slots, 0, len(slots) - 1)
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
