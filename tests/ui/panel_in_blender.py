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
from ui_support import (
    BUILD,
    override,
    play,
    screenshot,
    scroll_to_end,
    seen,
    wait_for,
    window_region,
)

sys.path.insert(0, str(BUILD))
import bvh_lab
from bvh_lab.blender import panels, store, summary
from bvh_lab.study.precision import BOX_TESTS, TRIANGLE_TESTS


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
    with override(area=area, region=area.regions[-1]):
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
        with override(window=bpy.context.window, area=area, region=region):
            if bpy.ops.ui.copy_python_command_button.poll():
                bpy.ops.ui.copy_python_command_button()
                if command in bpy.context.window_manager.clipboard:
                    return (x, y)
    raise AssertionError(f"no button runs {command}")


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

    position = yield from find_button(properties, "column='BUILD'", 0.46)
    click(*position)
    panel = bpy.context.window_manager.bvh_lab
    yield from wait_for("the table is sorted by build time", lambda: panel.sort_column == "BUILD")
    yield from screenshot("5_sorted.png")
    yield from precision_steps(properties)


def open_panels(*closed: type[bpy.types.Panel]) -> list[type[bpy.types.Panel]]:
    """Show the contents of panels that are closed at first: no call of Blender opens one."""
    opened = []
    for order, panel in enumerate(closed):
        shown = type(
            f"BVHLAB_PT_shown_{order}",
            (panels.RenderPanel, bpy.types.Panel),
            {"bl_label": f"{panel.bl_label}, opened", "bl_order": order, "draw": panel.draw},
        )
        bpy.utils.register_class(shown)
        opened.append(shown)
    return opened


def precision_steps(properties: bpy.types.Area) -> Iterator[None]:
    """All layouts and tests of one tree."""
    settings = bpy.context.scene.bvh_lab
    for builder in settings.builders():
        setattr(settings, f"use_{builder}", builder == "lbvh")
    settings.use_2 = settings.use_4 = settings.embree = False
    for name in TRIANGLE_TESTS:
        setattr(settings, f"triangle_{name}", True)
    for name in BOX_TESTS:
        setattr(settings, f"box_{name}", True)
    seen["precise_variants"] = settings.variants()
    yield
    position = yield from find_button(properties, "bpy.ops.bvhlab.compare")
    click(*position)
    yield from wait_for("the precise comparison runs", lambda: store.running is not None)
    yield from wait_for("it ends", lambda: store.running is None)
    study = store.study_of(bpy.context.scene)
    rows = study.result.rows
    seen["precise_rows"] = [row.name for row in rows]
    seen["precise_titles"] = [summary.short_title(row) for row in rows]
    seen["precise_failures"] = [row.error for row in study.result.failed()]
    seen["precise_pictured"] = sorted({name for name, _ in study.pictures})
    bpy.context.window_manager.bvh_lab.select(store.scene_key(bpy.context.scene), rows[-1].name)
    yield from scroll_to_end(properties)
    yield from screenshot("6_precision.png")
    opened = open_panels(
        panels.BVHLAB_PT_advanced, panels.BVHLAB_PT_settings, panels.BVHLAB_PT_details
    )
    for _ in range(3):  # back to the top
        region = window_region(properties)
        with override(window=bpy.context.window, area=properties, region=region):
            if bpy.ops.view2d.scroll_up.poll():
                bpy.ops.view2d.scroll_up(deltay=2000)
        properties.tag_redraw()
        yield
    yield from screenshot("7_settings.png")
    for panel in opened:
        bpy.utils.unregister_class(panel)


prepare()
play(steps(), bvh_lab.unregister)
