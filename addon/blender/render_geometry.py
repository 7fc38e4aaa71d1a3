# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry as a final render sees it.

Blender evaluates modifiers at their render level, and follows the camera icons, only in the
dependency graph that it hands to a render engine. So a private engine is registered for the length
of one call, and a copy of the scene is rendered with it: 4 x 4 pixels, no compositor, no sequencer,
nothing written. The user's scene and its settings are never touched: nothing is to be restored.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import bpy

Result = TypeVar("Result")
ENGINE = "BVHLAB_GEOMETRY"


def with_render_depsgraph(
    scene: bpy.types.Scene,
    view_layer: bpy.types.ViewLayer,
    work: Callable[[bpy.types.Depsgraph], Result],
) -> Result:
    """Call ``work`` with the render dependency graph of one view layer and return what it returns.

    Runs in the calling (main) thread, with or without a window; a window waits for it.
    ``work`` must not use ``bpy.context`` or ``bpy.ops``. What ``work`` raises is raised here.
    """
    outcome: dict[str, Any] = {}
    engine = _engine_class(outcome, work)
    bpy.utils.register_class(engine)
    copy = camera = camera_data = None
    try:
        copy = scene.copy()
        camera_data = bpy.data.cameras.new(
            "BVH Lab"
        )  # a render needs a camera; the scene may have none
        camera = bpy.data.objects.new("BVH Lab", camera_data)
        _prepare(copy, camera)
        bpy.ops.render.render(scene=copy.name, layer=view_layer.name)
    finally:
        if copy is not None:
            bpy.data.scenes.remove(copy)
        for block, blocks in ((camera, bpy.data.objects), (camera_data, bpy.data.cameras)):
            if block is not None:
                blocks.remove(block)
        bpy.utils.unregister_class(engine)
    if "error" in outcome:
        raise outcome["error"]
    if "result" not in outcome:
        raise RuntimeError(f"Blender did not evaluate view layer '{view_layer.name}' for a render.")
    return outcome["result"]


def _engine_class(outcome: dict[str, Any], work: Callable[[bpy.types.Depsgraph], Result]) -> type:
    class BvhLabGeometry(bpy.types.RenderEngine):
        bl_idname = ENGINE
        bl_label = "BVH Lab (reading geometry)"

        def render(self, depsgraph: bpy.types.Depsgraph) -> None:
            # An exception here would be swallowed by Blender, so it is carried out by hand.
            try:
                outcome["result"] = work(depsgraph)
            except Exception as error:
                outcome["error"] = error

    return BvhLabGeometry


def _prepare(copy: bpy.types.Scene, camera: bpy.types.Object) -> None:
    """Make the copied scene as cheap to render as can be."""
    copy.camera = camera
    copy.timeline_markers.clear()  # markers may switch the camera
    render = copy.render
    render.engine = ENGINE
    render.resolution_x = render.resolution_y = 4
    render.resolution_percentage = 100
    render.use_compositing = render.use_sequencer = render.use_freestyle = False
    render.use_multiview = render.use_border = render.use_motion_blur = False
    render.use_persistent_data = False
