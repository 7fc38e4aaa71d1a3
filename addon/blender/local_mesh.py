# SPDX-License-Identifier: GPL-3.0-or-later
"""One mesh in its own space, as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np
import numpy.typing as npt

from ..study.scene import Float32Array, UInt32Array


@dataclass
class LocalMesh:
    """Arrays of T triangles.

    ``vertices`` (V, 3) float32, ``triangles`` (T, 3) uint32, ``slots`` (T,) int32: material slots.
    ``smooth`` (T,) bool and ``normals``, (S, 3, 3) float32, of the corners of the S smooth
    triangles; None where all are flat. ``uvs``: (T, 3, 2) float32 by UV map; "" is the one that
    renders, and a map that the mesh lacks is missing.
    """

    vertices: Float32Array
    triangles: UInt32Array
    slots: npt.NDArray[np.int32]
    smooth: npt.NDArray[np.bool_] | None = None
    normals: Float32Array | None = None
    uvs: dict[str, Float32Array] = field(default_factory=dict)

    def uvs_by_slot(
        self, slot: npt.NDArray[np.int32], layers: list[str | None]
    ) -> Float32Array | None:
        """(T, 3, 2): of each triangle those of its slot's UV map, (0, 0) where there is none.

        None where no slot has a map.
        """
        wanted = {layer for layer in layers if layer is not None and layer in self.uvs}
        if not wanted:
            return None
        if len(wanted) == 1 and None not in layers and len(set(layers)) == 1:
            return self.uvs[wanted.pop()]
        uvs = np.zeros((len(self.triangles), 3, 2), np.float32)
        for layer in wanted:
            chosen = np.array([name == layer for name in layers])[slot]
            uvs[chosen] = self.uvs[layer][chosen]
        return uvs


def read_object(obj: bpy.types.Object, layers: tuple[str, ...]) -> LocalMesh:
    """The evaluated object's mesh, with these UV maps."""
    if not obj.data.is_editmode:
        return _read_mesh(obj.data, layers)
    try:  # in Edit Mode the evaluated mesh may be a shell around the edited one
        return _read_mesh(obj.to_mesh(), layers)
    finally:
        obj.to_mesh_clear()


def _read_mesh(mesh: bpy.types.Mesh, layers: tuple[str, ...]) -> LocalMesh:
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    vertices = np.empty(3 * len(mesh.vertices), np.float32)
    triangles = np.empty(3 * count, np.int32)
    slots = np.empty(count, np.int32)
    mesh.vertices.foreach_get("co", vertices)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    mesh.loop_triangles.foreach_get("material_index", slots)
    local = LocalMesh(vertices.reshape(-1, 3), triangles.view(np.uint32).reshape(-1, 3), slots)
    smooth = np.empty(count, np.bool_)
    mesh.loop_triangles.foreach_get("use_smooth", smooth)
    if not smooth.any() and not layers:
        return local
    loops = np.empty(3 * count, np.int32)
    mesh.loop_triangles.foreach_get("loops", loops)
    loops = loops.reshape(-1, 3)
    if smooth.any():
        local.smooth = smooth
        local.normals = _loop_normals(mesh)[loops[smooth]]
    for layer in layers:
        uvs = _loop_uvs(mesh, layer)
        if uvs is not None:
            local.uvs[layer] = uvs[loops]
    return local


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
