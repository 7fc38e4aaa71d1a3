# SPDX-License-Identifier: GPL-3.0-or-later
"""Drives the panel in a Blender with a window, by mouse and keyboard, and writes down what it saw.

blender --factory-startup --enable-event-simulate --python panel_in_blender.py -- BUILD OUT

Writes OUT/seen.json and screenshots.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from ui_support import BUILD, play, screenshot, seen, wait_for, window_region

sys.path.insert(0, str(BUILD))
import bvh_lab
from bvh_lab.blender import store, summary


def prepare() -> None:
    """A scene worth a few seconds, an Image Editor on the left and our panel on the right."""
    bpy.context.preferences.view.show_splash = False
    bvh_lab.register()
    bpy.ops.object.select_all(action="SELECT")
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.ops.mesh.primitive_monkey_add()
    modifier = bpy.context.object.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels = 3
    for name in ("A", "B"):
        camera = bpy.data.objects["Camera"].copy()
        camera.name = name
        bpy.context.scene.collection.objects.link(camera)


def split_screen() -> tuple[bpy.types.Area, bpy.types.Area]:
    area = next(area for area in bpy.context.screen.areas if area.type == "VIEW_3D")
    before = list(bpy.context.screen.areas)
    with bpy.context.temp_override(area=area, region=area.regions[-1]):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.52)
    other = next(area for area in bpy.context.screen.areas if area not in before)
    left, right = sorted((area, other), key=lambda area: area.x)
    left.ui_type, right.ui_type = "IMAGE_EDITOR", "PROPERTIES"
    return left, right


def move_mouse(x: int, y: int) -> None:
    bpy.context.window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)


def click(x: int, y: int) -> None:
    for value in ("PRESS", "RELEASE"):
        bpy.context.window.event_simulate("LEFTMOUSE", value, x=x, y=y)


def find_button(area: bpy.types.Area, command: str, share: float = 0.5) -> Iterator[None]:
    """Slide the mouse down the panel until the button under it is the one that runs ``command``."""
    region = window_region(area)
    x = region.x + int(region.width * share)
    for y in range(region.y + region.height - 8, region.y + 4, -16):
        move_mouse(x, y)
        yield
        with bpy.context.temp_override(window=bpy.context.window, area=area, region=region):
            if bpy.ops.ui.copy_python_command_button.poll():
                bpy.ops.ui.copy_python_command_button()
                if command in bpy.context.window_manager.clipboard:
                    return (x, y)
    raise AssertionError(f"no button runs {command}")


def scroll_to_end(area: bpy.types.Area) -> Iterator[None]:
    region = window_region(area)
    for _ in range(3):
        with bpy.context.temp_override(window=bpy.context.window, area=area, region=region):
            if bpy.ops.view2d.scroll_down.poll():
                bpy.ops.view2d.scroll_down(deltay=2000)
        area.tag_redraw()
        yield


def steps() -> Iterator[None]:
    image_editor, properties = split_screen()
    for _ in range(10):  # the editor knows its tabs once it was drawn
        yield
    properties.spaces.active.context = "RENDER"
    settings = bpy.context.scene.bvh_lab
    yield
    yield from scroll_to_end(properties)
    yield from screenshot("1_before.png")

    settings.resolution, settings.ray_resolution, settings.repeats = 1024, 512, 100
    position = yield from find_button(properties, "bpy.ops.bvhlab.compare")
    click(*position)
    yield from wait_for("the comparison runs", lambda: store.running is not None)
    yield from wait_for("a row is measured", lambda: len(store.running.rows) >= 2)
    seen["progress"] = store.running.job.fraction
    yield from screenshot("2_running.png")
    pressed = time.monotonic()
    bpy.context.window.event_simulate("ESC", "PRESS", x=position[0], y=position[1])
    bpy.context.window.event_simulate("ESC", "RELEASE", x=position[0], y=position[1])
    yield from wait_for("ESC stops it", lambda: store.running is None)
    study = store.study_of(bpy.context.scene)
    seen["seconds_to_stop"] = time.monotonic() - pressed
    seen["cancelled"] = study.result.cancelled
    seen["rows_kept"] = len(study.result.rows)
    yield from scroll_to_end(properties)
    yield from screenshot("3_stopped.png")

    yield from scroll_to_end(properties)
    settings.resolution, settings.repeats, settings.views = 128, 3, 2
    settings.judged_rays, settings.samples, settings.depth = 64, 1, 1
    settings.ray_resolution = 64
    settings.geometry, scenes = "render", len(bpy.data.scenes)
    position = yield from find_button(properties, "bpy.ops.bvhlab.compare")
    click(*position)
    yield from wait_for("the comparison runs again", lambda: store.running is not None)
    yield from wait_for("it ends", lambda: store.running is None)
    study = store.study_of(bpy.context.scene)
    seen["rows"] = [row.name for row in study.result.rows]
    seen["failures"] = [row.error for row in study.result.failed()]
    seen["said"] = summary.winner(study.result.rows, "primary")
    seen["geometry"] = study.result.subject.geometry
    seen["scenes_left_over"] = len(bpy.data.scenes) - scenes
    image = image_editor.spaces.active.image
    seen["image"] = [image.name, *image.size] if image else None
    yield from scroll_to_end(properties)
    yield from screenshot("4_results.png")

    position = yield from find_button(properties, "column='BUILD'", 0.38)
    click(*position)
    panel = bpy.context.window_manager.bvh_lab
    yield from wait_for("the table is sorted by build time", lambda: panel.sort_column == "BUILD")
    yield from screenshot("5_sorted.png")


prepare()
play(steps(), bvh_lab.unregister)
