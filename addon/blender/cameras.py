# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender cameras as rigid transform plus window."""

from __future__ import annotations

import bpy
import numpy as np

from ..study.scene import Camera, Float64Array
from .notes import Notes


def read_cameras(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, notes: Notes
) -> list[Camera]:
    """All cameras of the scene: the active one first, then by name."""
    objects = [obj for obj in scene.objects if obj.type == "CAMERA"]
    if scene.camera and scene.camera.type == "CAMERA" and scene.camera not in objects:
        objects.append(scene.camera)
    objects.sort(key=lambda obj: (obj != scene.camera, obj.name))
    return [read_camera(obj.evaluated_get(depsgraph), scene, notes) for obj in objects]


def read_camera(obj: bpy.types.Object, scene: bpy.types.Scene, notes: Notes) -> Camera:
    """One camera. Sensor fit, lens shift and the render settings' aspect end up in ``window``."""
    data = obj.data
    if data.type not in {"PERSP", "ORTHO"}:
        notes.add("approximated: panoramic camera treated as perspective", obj.name)
    if data.dof.use_dof:
        notes.add("left out: depth of field", obj.name)
    # The frame's four corners in camera space, at some depth in front of the camera.
    corners = np.array([tuple(corner) for corner in data.view_frame(scene=scene)])
    if data.type != "ORTHO":
        corners = corners / -corners[:, 2:]
    left, bottom = corners[:, :2].min(axis=0)
    right, top = corners[:, :2].max(axis=0)
    return Camera(
        name=obj.name,
        kind="orthographic" if data.type == "ORTHO" else "perspective",
        to_world=without_scale(np.array(obj.matrix_world)),
        window=(float(left), float(right), float(bottom), float(top)),
        clip_start=float(data.clip_start),
    )


def without_scale(matrix: Float64Array) -> Float64Array:
    """The matrix with unit axes, as Blender looks through a scaled camera; zero axes stay zero."""
    unit = matrix.astype(np.float64)
    lengths = np.linalg.norm(unit[:3, :3], axis=0)
    unit[:3, :3] /= np.where(lengths > 0.0, lengths, 1.0)
    return unit
