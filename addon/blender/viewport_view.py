# SPDX-License-Identifier: GPL-3.0-or-later
"""What a 3D viewport looks at, as a camera of ours."""

from __future__ import annotations

import bpy
import numpy as np

from ..study.scene import Camera
from .cameras import read_lens, without_scale
from .notes import Notes
from .viewport_worker import View

SHARP_SCREEN, FINE_SCREEN = 1, 2  # screen pixels to a picture's on a usual and on a fine screen
FINE_SCALE = 1.5  # interface scale from which a screen counts as fine


def read_view(context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> View:
    """The region's view: perspective, orthographic or through the camera, with its zoom and shift.

    Depth of field shows through the camera only, as in Cycles.
    """
    region, region_data, space = context.region, context.region_data, context.space_data
    to_world = np.array(region_data.view_matrix.inverted(), np.float64)
    projection = np.array(region_data.window_matrix, np.float64)
    perspective = projection[3, 2] != 0.0
    window, clip_start = _window(projection, perspective)
    if not perspective:
        # The near plane of an orthographic view lies behind the viewer.
        to_world[:3, 3] -= to_world[:3, 2] * clip_start
        clip_start = 0.0
    lens_radius, focus_distance = 0.0, 1.0
    camera = space.camera if region_data.view_perspective == "CAMERA" else None
    if camera is not None and camera.type == "CAMERA" and perspective:
        lens_radius, focus_distance = read_lens(camera.evaluated_get(depsgraph), Notes())
    scale = _screen_pixels(context)
    return View(
        (max(1, region.width // scale), max(1, region.height // scale)),
        Camera(
            "viewport",
            "perspective" if perspective else "orthographic",
            without_scale(to_world),
            window,
            clip_start,
            lens_radius,
            focus_distance,
        ),
    )


def _window(
    projection: np.ndarray, perspective: bool
) -> tuple[tuple[float, float, float, float], float]:
    """(left, right, bottom, top) as in `Camera`, and the near plane's distance, of OpenGL's matrix.

    Perspective: x of the screen, -1 to 1, is p00 * x - p02 at distance 1; orthographic: p00 * x +
    p03; y likewise. The near plane is where the third row gives -1.
    """
    column, sign = (2, 1.0) if perspective else (3, -1.0)
    edges = []
    for axis in (0, 1):
        for screen in (-1.0, 1.0):
            edges.append((screen + sign * projection[axis, column]) / projection[axis, axis])
    slope, offset = projection[2, 2], projection[2, 3]
    near = offset / (slope - 1.0) if perspective else (offset + 1.0) / slope
    left, right, bottom, top = (float(edge) for edge in edges)
    return (left, right, bottom, top), float(near)


def _screen_pixels(context: bpy.types.Context) -> int:
    """Screen pixels along the side of a rendered one, as the scene's performance settings ask."""
    chosen = context.scene.render.preview_pixel_size
    if chosen != "AUTO":
        return int(chosen)
    return FINE_SCREEN if context.preferences.system.ui_scale >= FINE_SCALE else SHARP_SCREEN
