# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of a study as Blender images."""

from __future__ import annotations

import bpy
import numpy as np

from ..study.run import Study
from ..study.scene import Float32Array


def show_picture(context: bpy.types.Context, study: Study, variant: str, view: str = "") -> str:
    """Put one variant's picture of a view into an image, and into an open Image Editor.

    Without ``view`` it is the first one. The image is reused by name. Returns its name, or "" where
    the variant has no picture.
    """
    views = [of_view for name, of_view in study.pictures if name == variant]
    if not views:
        return ""
    chosen = view if view in views else views[0]
    image = _image(f"BVH Lab {chosen}", study.pictures[variant, chosen])
    if not bpy.app.background:
        _open(context, image)
    return str(image.name)


def _image(name: str, pixels: Float32Array) -> bpy.types.Image:
    """A float image of ``pixels`` (H, W, 3), linear, top row first; packed, so that it is saved."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.get(name)
    if image is None:
        image = bpy.data.images.new(name, width, height, float_buffer=True)
    elif tuple(image.size) != (width, height):
        image.scale(width, height)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels[::-1]  # Blender's first row is the lowest
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    image.pack()
    return image


def _open(context: bpy.types.Context, image: bpy.types.Image) -> None:
    """Show it in the first open Image Editor that shows no pinned or rendered picture."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            space = area.spaces.active
            if area.type == "IMAGE_EDITOR" and space.mode == "VIEW" and not space.use_image_pin:
                space.image = image
                area.tag_redraw()
                return
