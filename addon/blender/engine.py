# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine `BVH Lab`: what Blender calls, and what becomes of errors."""

from __future__ import annotations

import atexit
import traceback

import bpy
from bpy.app.handlers import persistent

from ..native import NativeMissing
from . import engine_final, engine_passes, viewport
from .engine_guard import WriteGuard
from .text import sentence

ENGINE = "BVHLAB"


class BVHLAB_RE_engine(bpy.types.RenderEngine):
    """One instance renders one picture, or one viewport for as long as it is shown."""

    bl_idname = ENGINE
    bl_label = "BVH Lab"
    bl_use_preview = True
    bl_use_postprocess = True
    bl_use_shading_nodes_custom = False  # materials are Blender's own nodes
    bl_use_eevee_viewport = True  # for material preview, which is not ours

    _viewport: viewport.Viewport | None = None

    def update_render_passes(
        self,
        scene: bpy.types.Scene | None = None,
        renderlayer: bpy.types.ViewLayer | None = None,
    ) -> None:
        for each in engine_passes.wanted_passes(renderlayer):
            channels = len(each.channels)
            self.register_pass(scene, renderlayer, each.name, channels, each.channels, each.kind)

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        with WriteGuard():
            self._render(depsgraph)

    def _render(self, depsgraph: bpy.types.Depsgraph) -> None:
        try:
            with engine_final.at_work:
                engine_final.render_view_layer(self, depsgraph)
        except (ValueError, RuntimeError, MemoryError) as error:
            self._fail(sentence(error))
        except Exception as error:  # Blender would print it and go on as if all were well
            traceback.print_exc()
            self._fail(f"BVH Lab has a bug: {type(error).__name__}: {sentence(error)}")

    def _fail(self, text: str) -> None:
        """The report fails a batch job, the other shows in the picture."""
        self.report({"ERROR"}, text)
        self.error_set(text)

    def view_update(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        if self._has_viewport():
            self._viewport.update(depsgraph)

    def view_draw(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        if self._has_viewport():
            self._viewport.draw(self, context, depsgraph)

    def _has_viewport(self) -> bool:
        """Whether a viewport is there, made with the first call; without a core it says why not."""
        if self._viewport is None:
            try:
                self._viewport = viewport.start(self)
            except NativeMissing as error:
                self.update_stats("", sentence(error))
        return self._viewport is not None


@persistent
def _forget(*_: object) -> None:
    viewport.close_all()
    viewport.stop_timers()
    engine_final.notes_of.clear()


def register() -> None:
    """Add the engine; its threads end before another file opens, and at exit."""
    bpy.utils.register_class(BVHLAB_RE_engine)
    bpy.app.handlers.load_pre.append(_forget)
    atexit.register(viewport.close_all)


def unregister() -> None:
    """Stop what it does and take it away."""
    engine_final.at_work.stop()
    _forget()
    bpy.app.handlers.load_pre.remove(_forget)
    atexit.unregister(viewport.close_all)
    bpy.utils.unregister_class(BVHLAB_RE_engine)
