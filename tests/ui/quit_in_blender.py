# SPDX-License-Identifier: GPL-3.0-or-later
"""Quits a Blender with a window in the middle of something.

blender --factory-startup --python quit_in_blender.py -- BUILD OUT compare|render|viewport

Writes OUT/seen.json, with the time at which it quits.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from ui_support import BUILD, REST, override, play, seen, wait_for

sys.path.insert(0, str(BUILD))
import bvh_lab
from bvh_lab.blender import engine_final, store, viewport

ENDLESS = 1 << 20  # samples


def steps() -> Iterator[None]:
    window = bpy.context.window_manager.windows[0]
    scene = window.scene
    scene.render.engine = "BVHLAB"
    yield
    if "compare" in REST:
        scene.bvh_lab.repeats = 1000
        with override(window=window):
            bpy.ops.bvhlab.compare("INVOKE_DEFAULT")
        yield from wait_for("it measures", lambda: len(store.running.rows) >= 2)
    if "render" in REST:
        bpy.context.preferences.view.render_display_type = "NONE"
        scene.bvh_lab_render.samples = ENDLESS
        bpy.ops.render.render("INVOKE_DEFAULT")
        yield from wait_for("it renders", lambda: bool(engine_final.notes_of))
    if "viewport" in REST:
        scene.bvh_lab_render.viewport_samples = ENDLESS
        area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
        area.spaces.active.shading.type = "RENDERED"
        yield from wait_for("it is drawn", lambda: bool(viewport._open))
        worker = next(iter(viewport._open))._worker
        yield from wait_for("there is a picture", lambda: worker.shown is not None)
    seen["quits_at"] = time.time()


bpy.context.preferences.view.show_splash = False
bvh_lab.register()
play(steps(), lambda: None)
