# SPDX-License-Identifier: GPL-3.0-or-later
"""Pulls the ground from under a comparison, a render and a viewport, in a Blender with a window.

blender --factory-startup --python abuse_in_blender.py -- BUILD OUT compare|render

Writes OUT/seen.json and screenshots.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))
from ui_support import BUILD, REST, override, play, screenshot, scroll_to_end, seen, wait_for

sys.path.insert(0, str(BUILD))
import bvh_lab
from bvh_lab.blender import engine_final, operators, store, viewport

ENDLESS = 1 << 20  # samples
BUILDERS = {"lbvh", "ploc"}


def window() -> bpy.types.Window:
    return bpy.context.window_manager.windows[0]


def scene() -> bpy.types.Scene:
    return window().scene


def areas(kind: str) -> list[bpy.types.Area]:
    return [area for area in window().screen.areas if area.type == kind]


def our_threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if "bvh_lab" in thread.name]


def compares() -> bool:
    return store.running is not None


def renders() -> bool:
    return bpy.app.is_job_running("RENDER")


def new_file() -> Iterator[None]:
    """A monkey and a panel that fills most of the window; a comparison that would take minutes."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    for _ in range(2):
        yield
    max(window().screen.areas, key=lambda area: area.width * area.height).type = "PROPERTIES"
    yield
    for area in areas("PROPERTIES"):
        area.spaces.active.context = "RENDER"
    with override(window=window()):
        bpy.ops.mesh.primitive_monkey_add()
    set_up(scene())
    yield


def set_up(scene: bpy.types.Scene) -> None:
    scene.render.engine = "BVHLAB"
    scene.render.resolution_x = scene.render.resolution_y = 64
    scene.bvh_lab_render.samples = scene.bvh_lab_render.viewport_samples = ENDLESS
    settings = scene.bvh_lab
    settings.resolution = settings.ray_resolution = 64
    settings.judged_rays, settings.repeats = 16, 1000
    settings.embree = settings.pictures = False
    for builder in settings.builders():
        setattr(settings, f"use_{builder}", builder in BUILDERS)


def compare(where: bpy.types.Window | None = None) -> Iterator[None]:
    with override(window=where or window()):
        bpy.ops.bvhlab.compare("INVOKE_DEFAULT")
    yield from wait_for("it measures", lambda: compares() and len(store.running.rows) >= 2)


def stop() -> Iterator[None]:
    bpy.ops.bvhlab.stop()
    yield from wait_for("it stops", lambda: not compares())


def see(name: str) -> Iterator[None]:
    yield from scroll_to_end(max(areas("PROPERTIES"), key=lambda area: area.width))
    yield from screenshot(name)


def undo_steps() -> Iterator[None]:
    """Undo and redo while a comparison runs, and after it."""
    yield from new_file()
    key = store.scene_key(scene())
    with override(window=window()):
        bpy.ops.ed.undo_push(message="before")
        bpy.context.view_layer.objects.active.location.x = 1.0
        bpy.ops.ed.undo_push(message="moved")
    yield from compare()
    for number, step in enumerate((bpy.ops.ed.undo, bpy.ops.ed.undo, bpy.ops.ed.redo)):
        with override(window=window()):
            step()
        yield
        seen[f"runs_after_undo_{number}"] = compares() and key == store.scene_key(scene())
    yield from see("1_undone.png")
    yield from stop()
    seen["rows_after_undo"] = len(store.rows_of(scene()))
    with override(window=window()):
        bpy.ops.ed.undo()
    yield
    seen["rows_after_later_undo"] = len(store.rows_of(scene()))


def delete_steps() -> Iterator[None]:
    """All of the scene's data go while it is compared."""
    yield from new_file()
    yield from compare()
    with override(window=window()):
        bpy.ops.object.select_all(action="SELECT")
        bpy.ops.object.delete()
        scene().world = None
        bpy.ops.outliner.orphans_purge(do_recursive=True)
    seen["blocks_left"] = len(bpy.data.meshes) + len(bpy.data.worlds)
    yield
    seen["runs_after_delete"] = compares()
    yield from stop()
    seen["rows_after_delete"] = len(store.rows_of(scene()))
    yield from see("2_deleted.png")


def scene_steps() -> Iterator[None]:
    """Another scene is shown while one is compared, which then is deleted."""
    yield from new_file()
    first = scene()
    yield from compare()
    second = first.copy()
    window().scene = second
    yield
    seen["rows_of_other_scene"] = len(store.rows_of(second))
    yield from see("3_other_scene.png")
    bpy.data.scenes.remove(first)
    yield from wait_for("it stops with its scene", lambda: not compares())
    seen["studies_of_deleted"] = len(store.studies)
    yield from see("4_scene_deleted.png")
    yield from compare()
    yield from stop()
    seen["rows_of_second"] = len(store.rows_of(second))
    second.name = "Renamed"
    yield
    seen["rows_of_renamed"] = len(store.rows_of(second))
    bpy.data.scenes.new("Second")
    seen["rows_of_new_scene"] = len(store.rows_of(bpy.data.scenes["Second"]))


def disable_steps() -> Iterator[None]:
    """The add-on goes and comes ten times, while a comparison, a render or a viewport runs."""
    yield from new_file()
    left = []
    for turn in range(10):
        if turn % 3 == 0:
            yield from compare()
        if turn % 3 == 1:
            bpy.ops.render.render("INVOKE_DEFAULT")
            yield from wait_for("it renders", lambda: engine_final.at_work._count > 0)
        if turn % 3 == 2:
            show_viewport()
            yield from wait_for("the viewport is drawn", lambda: bool(our_threads()))
        bvh_lab.unregister()
        left += our_threads()
        if operators.watch._timer or operators.watch._workspace:
            left.append(f"watch {turn}")
        yield from wait_for("no render is left", lambda: not renders())
        if turn == 0:
            yield from see("5_disabled.png")
        bvh_lab.register()
        set_up(scene())
        for area in areas("VIEW_3D"):
            area.type = "PROPERTIES"
        yield
    seen["left_after_disable"] = left
    yield from see("6_enabled.png")


def render_steps() -> Iterator[None]:
    """Undo, deletions and another file, while F12 and a viewport render."""
    seen["survived"] = survived = []
    for name, abuse in (
        ("undo", undo),
        ("delete", lambda: bpy.data.objects.remove(bpy.data.objects["Suzanne"])),
        ("scene", delete_scene),
        ("load", lambda: bpy.ops.wm.read_homefile(use_factory_startup=True)),
    ):
        yield from new_file()
        show_viewport()
        yield from wait_for("the viewport is drawn", lambda: bool(viewport._open))
        bpy.ops.render.render("INVOKE_DEFAULT")
        yield from wait_for("it renders", lambda: bool(engine_final.notes_of))
        abuse()
        for _ in range(5):
            yield
        seen[f"threads_after_{name}"] = our_threads()
        yield from screenshot(f"7_{name}.png")
        bvh_lab.unregister()  # ends what still renders
        yield from wait_for("no render is left", lambda: not renders())
        bvh_lab.register()
        survived.append(name)


def undo() -> None:
    with override(window=window()):
        bpy.ops.ed.undo_push(message="before")
        bpy.data.objects["Suzanne"].location.x = 1.0
        bpy.ops.ed.undo_push(message="moved")
        bpy.ops.ed.undo()


def delete_scene() -> None:
    """As the button does, which first ends what renders it; a script would crash Blender here."""
    bpy.data.scenes.new("Other")
    with bpy.context.temp_override(window=window()):  # waits for the thread's end: no gate here
        bpy.ops.scene.delete()


def show_viewport() -> None:
    area = min(areas("PROPERTIES"), key=lambda area: area.width)
    area.type = "VIEW_3D"
    area.spaces.active.shading.type = "RENDERED"


def window_steps() -> Iterator[None]:
    """The window closes in which a comparison was started."""
    yield from new_file()
    bpy.ops.wm.window_new()
    second = bpy.context.window_manager.windows[1]
    yield from compare(second)
    with override(window=second):
        bpy.ops.wm.window_close()
    for _ in range(5):
        yield
    seen["runs_after_close"] = compares() or bool(our_threads() or operators.watch._timer)


def load_steps() -> Iterator[None]:
    """Another file opens while one is compared."""
    yield from new_file()
    yield from compare()
    yield from new_file()
    seen["runs_after_load"] = compares() or bool(our_threads() or store.studies)
    yield from see("8_loaded.png")


def steps() -> Iterator[None]:
    parts = {
        "compare": (undo_steps, delete_steps, scene_steps, window_steps, load_steps),
        "render": (disable_steps, render_steps),
    }
    for part in parts[REST[0]]:
        yield from part()


bpy.context.preferences.view.show_splash = False
bpy.context.preferences.view.render_display_type = "NONE"
bvh_lab.register()
play(steps(), bvh_lab.unregister)
