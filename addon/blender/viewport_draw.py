# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws a picture over a region. `gpu` is imported on use: a batch job must not touch it."""

from __future__ import annotations

from typing import Any

import bpy

from .viewport_worker import Shown

CORNERS = ((0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1))  # of two triangles


class Picture:
    """The picture on the graphics card; uploaded anew when another one is drawn."""

    def __init__(self) -> None:
        self._shown: Shown | None = None
        self._texture: Any = None

    def draw(
        self,
        engine: bpy.types.RenderEngine,
        scene: bpy.types.Scene,
        region: bpy.types.Region,
        shown: Shown,
    ) -> None:
        """Stretch it over the region; Blender turns linear into display colours."""
        import gpu
        from gpu_extras.batch import batch_for_shader

        if shown is not self._shown:
            self._upload(shown)
        name = "2D_IMAGE" if bpy.app.version < (4, 0, 0) else "IMAGE"
        shader = gpu.shader.from_builtin(name)
        places = [(x * region.width, y * region.height) for x, y in CORNERS]
        batch = batch_for_shader(shader, "TRIS", {"pos": places, "texCoord": CORNERS})
        gpu.state.blend_set("NONE")
        engine.bind_display_space_shader(scene)
        shader.bind()
        shader.uniform_sampler("image", self._texture)
        batch.draw(shader)
        engine.unbind_display_space_shader()

    def _upload(self, shown: Shown) -> None:
        import gpu

        height, width = shown.pixels.shape[:2]
        data = gpu.types.Buffer("FLOAT", shown.pixels.size, shown.pixels.ravel())
        self._texture = gpu.types.GPUTexture((width, height), format="RGBA32F", data=data)
        self._shown = shown
