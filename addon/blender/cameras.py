# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender cameras as rigid transform plus window."""

from __future__ import annotations

import bpy
import numpy as np

from ..study.scene import Camera, Float32Array, Float64Array
from .notes import Notes


def read_cameras(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, vertices: Float32Array, notes: Notes
) -> list[Camera]:
    """All cameras of the scene: the active one first, then by name.

    ``vertices``, (V, 3), are all that there is to see.
    """
    objects = [obj for obj in scene.objects if obj.type == "CAMERA"]
    if scene.camera and scene.camera.type == "CAMERA" and scene.camera not in objects:
        objects.append(scene.camera)
    objects.sort(key=lambda obj: (obj != scene.camera, obj.name))
    cameras = []
    for obj in objects:
        evaluated = obj.evaluated_get(depsgraph)
        cameras.append(read_camera(evaluated, scene, notes))
        say_far_clipping(evaluated, vertices, notes)
    return cameras


def say_far_clipping(obj: bpy.types.Object, vertices: Float32Array, notes: Notes) -> None:
    """Say that nothing is cut off, where the camera's far plane would cut something off."""
    matrix = without_scale(np.array(obj.matrix_world))
    position, ahead = matrix[:3, 3], -matrix[:3, 2]
    farthest = (vertices @ ahead.astype(np.float32)).max()
    if float(farthest) - float(position @ ahead) > obj.data.clip_end:
        notes.add("approximated: far clipping is ignored, all is seen however far", obj.name)


def read_camera(obj: bpy.types.Object, scene: bpy.types.Scene, notes: Notes) -> Camera:
    """One camera. Sensor fit, lens shift and the render settings' aspect end up in ``window``."""
    data = obj.data
    if data.type not in {"PERSP", "ORTHO"}:
        kind = "panoramic" if data.type == "PANO" else "custom"
        notes.add(f"approximated: {kind} camera treated as perspective", obj.name)
    # The frame's four corners in camera space, at some depth in front of the camera.
    corners = np.array([tuple(corner) for corner in data.view_frame(scene=scene)])
    if data.type != "ORTHO":
        corners = corners / -corners[:, 2:]
    left, bottom = corners[:, :2].min(axis=0)
    right, top = corners[:, :2].max(axis=0)
    lens_radius, focus_distance = read_lens(obj, notes)
    return Camera(
        name=obj.name,
        kind="orthographic" if data.type == "ORTHO" else "perspective",
        to_world=without_scale(np.array(obj.matrix_world)),
        window=(float(left), float(right), float(bottom), float(top)),
        clip_start=float(data.clip_start),
        lens_radius=lens_radius,
        focus_distance=focus_distance,
    )


def read_lens(obj: bpy.types.Object, notes: Notes) -> tuple[float, float]:
    """Radius of the aperture and distance of what is sharp; radius 0 where all is.

    The focal length is in millimetres, whatever the scene's unit; an orthographic camera's aperture
    goes by one of 1 m, as in Cycles.
    """
    data, dof = obj.data, obj.data.dof
    if not dof.use_dof:
        return 0.0, 1.0
    distance = float(dof.focus_distance)
    if dof.focus_object:
        distance = _focus_on(obj, dof)
    if not (distance > 0.0 and np.isfinite(distance)):
        notes.add("left out: depth of field focused on the camera itself", obj.name)
        return 0.0, 1.0
    if dof.aperture_blades:
        notes.add("approximated: aperture blades, the aperture is round", obj.name)
    if dof.aperture_ratio != 1.0:
        notes.add("approximated: anamorphic bokeh, the aperture is round", obj.name)
    focal_length = 1.0 if data.type == "ORTHO" else data.lens * 1e-3
    return float(focal_length / (2.0 * max(dof.aperture_fstop, 1e-5))), distance


def _focus_on(obj: bpy.types.Object, dof: bpy.types.CameraDOFSettings) -> float:
    """Distance along the camera's axis of the object, or of one of its bones, in focus."""
    target = np.array(dof.focus_object.matrix_world)
    if dof.focus_object.type == "ARMATURE" and dof.focus_subtarget:
        bone = dof.focus_object.pose.bones.get(dof.focus_subtarget)
        if bone is not None:
            target = target @ np.array(bone.matrix)
    camera = without_scale(np.array(obj.matrix_world))
    return abs(float(camera[:3, 2] @ (target[:3, 3] - camera[:3, 3])))


def without_scale(matrix: Float64Array) -> Float64Array:
    """The matrix with unit axes, as Blender looks through a scaled camera; zero axes stay zero."""
    unit = matrix.astype(np.float64)
    lengths = np.linalg.norm(unit[:3, :3], axis=0)
    unit[:3, :3] /= np.where(lengths > 0.0, lengths, 1.0)
    return unit
