# SPDX-License-Identifier: GPL-3.0-or-later
"""One mesh in its own space, as arrays."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property

import bpy
import numpy as np
import numpy.typing as npt

from ..study.scene import Float32Array, UInt32Array


@dataclass
class LocalMesh:
    """Arrays of T triangles.

    ``vertices`` (V, 3) float32, ``triangles`` (T, 3) uint32, ``slots`` (T,) int32: material slots.
    ``smooth`` (T,) bool and ``normals``, (S, 3, 3) float32, of the corners of the S smooth
    triangles; None where all are flat. ``uvs``, those that were asked for with `read_uvs`:
    (T, 3, 2) float32 by UV map, None where the mesh lacks it; "" is the one that renders.
    """

    vertices: Float32Array
    triangles: UInt32Array
    slots: npt.NDArray[np.int32]
    smooth: npt.NDArray[np.bool_] | None = None
    normals: Float32Array | None = None
    uvs: dict[str, Float32Array | None] = field(default_factory=dict)

    @cached_property
    def distinct_slots(self) -> npt.NDArray[np.int32]:
        """The material slots that a triangle has, ascending."""
        return np.unique(self.slots)

    def uvs_by_slot(
        self, slot: npt.NDArray[np.int32], layers: list[str | None]
    ) -> Float32Array | None:
        """(T, 3, 2): of each triangle those of its slot's UV map, (0, 0) where there is none.

        None where no slot has a map.
        """
        wanted = {layer for layer in layers if layer is not None and self.uvs[layer] is not None}
        if not wanted:
            return None
        if len(wanted) == 1 and None not in layers and len(set(layers)) == 1:
            return self.uvs[wanted.pop()]
        uvs = np.zeros((len(self.triangles), 3, 2), np.float32)
        for layer in wanted:
            chosen = np.array([name == layer for name in layers])[slot]
            uvs[chosen] = self.uvs[layer][chosen]
        return uvs


def read_object(obj: bpy.types.Object) -> LocalMesh:
    """The evaluated object's mesh, without UV maps."""
    with _mesh(obj) as mesh:
        return _read_mesh(mesh)


def read_uvs(obj: bpy.types.Object, local: LocalMesh, layers: Iterable[str | None]) -> None:
    """Add UV maps to what was read of the same object's mesh, where they are not there yet."""
    missing = {layer for layer in layers if layer is not None and layer not in local.uvs}
    if not missing:
        return
    with _mesh(obj) as mesh:
        loops = _triangle_loops(mesh)
        for layer in missing:
            uvs = _loop_uvs(mesh, layer)
            local.uvs[layer] = uvs[loops] if uvs is not None else None


@contextmanager
def _mesh(obj: bpy.types.Object) -> Iterator[bpy.types.Mesh]:
    """The mesh with its triangles; in Edit Mode the evaluated one may be a shell around another."""
    is_shell = obj.data.is_editmode
    mesh = obj.to_mesh() if is_shell else obj.data
    try:
        mesh.calc_loop_triangles()
        yield mesh
    finally:
        if is_shell:
            obj.to_mesh_clear()


def _read_mesh(mesh: bpy.types.Mesh) -> LocalMesh:
    count = len(mesh.loop_triangles)
    vertices = np.empty(3 * len(mesh.vertices), np.float32)
    triangles = np.empty(3 * count, np.int32)
    slots = np.empty(count, np.int32)
    smooth = np.empty(count, np.bool_)
    mesh.vertices.foreach_get("co", vertices)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    mesh.loop_triangles.foreach_get("material_index", slots)
    mesh.loop_triangles.foreach_get("use_smooth", smooth)
    local = LocalMesh(vertices.reshape(-1, 3), triangles.view(np.uint32).reshape(-1, 3), slots)
    if smooth.any():
        local.smooth = smooth
        local.normals = _loop_normals(mesh)[_triangle_loops(mesh)[smooth]]
    return local


def _triangle_loops(mesh: bpy.types.Mesh) -> npt.NDArray[np.int32]:
    """(T, 3): the face corners of each triangle."""
    loops = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("loops", loops)
    return loops.reshape(-1, 3)


def _loop_normals(mesh: bpy.types.Mesh) -> Float32Array:
    """(L, 3): the normal of each face corner, split and custom normals included."""
    normals = np.empty(3 * len(mesh.loops), np.float32)
    if hasattr(mesh, "corner_normals"):  # Blender 4.1
        mesh.corner_normals.foreach_get("vector", normals)
    else:
        mesh.calc_normals_split()
        mesh.loops.foreach_get("normal", normals)
    return normals.reshape(-1, 3)


def _loop_uvs(mesh: bpy.types.Mesh, name: str) -> Float32Array | None:
    """(L, 2) of a UV map, what is not finite as 0; None where the mesh has no such map."""
    layers = [layer for layer in mesh.uv_layers if name in ("", layer.name)]
    layer = next((layer for layer in layers if name or layer.active_render), None)
    if layer is None:
        return None
    uvs = np.empty(2 * len(mesh.loops), np.float32)
    if hasattr(layer, "uv"):  # Blender 3.5
        layer.uv.foreach_get("vector", uvs)
    else:
        layer.data.foreach_get("uv", uvs)
    return np.nan_to_num(uvs, copy=False, nan=0.0, posinf=0.0, neginf=0.0).reshape(-1, 2)
