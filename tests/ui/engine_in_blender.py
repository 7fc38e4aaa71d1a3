# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders with the engine in a Blender with a window, by F12 and in the viewport.

blender --factory-startup --python engine_in_blender.py -- BUILD OUT

Writes OUT/seen.json and screenshots.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy
from mathutils import Quaternion

sys.path.insert(0, str(Path(__file__).parent))
from real_key import ESCAPE, press
from ui_support import BUILD, play, screenshot, seen, wait_for, window_region

sys.path.insert(0, str(BUILD))
import bvh_lab
from bvh_lab.blender import engine_final, viewport

VIEWPORT_SAMPLES = 2


def prepare() -> None:
    """A red monkey on the default cube's place."""
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.render_display_type = "AREA"
    bvh_lab.register()
    material = bpy.data.materials["Material"]
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (0.8, 0.1, 0.05, 1.0)
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.ops.mesh.primitive_monkey_add()
    bpy.context.object.data.materials.append(material)
    scene = bpy.context.scene
    scene.render.engine = "BVHLAB"
    scene.render.resolution_x, scene.render.resolution_y = 320, 180
    scene.bvh_lab_render.viewport_samples = VIEWPORT_SAMPLES


def view3d() -> bpy.types.Area:
    screen = bpy.context.window_manager.windows[0].screen  # a timer has no screen after a load
    return next(area for area in screen.areas if area.type == "VIEW_3D")


def rendering() -> bool:
    return bpy.app.is_job_running("RENDER")


def at_work() -> bool:
    return engine_final.at_work._count > 0


def our_threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if "bvh_lab" in thread.name]


def worker():
    return next(iter(viewport._open))._worker


def settled() -> bool:
    """Whether the viewport shows its last sample of what was ordered last."""
    if len(viewport._open) != 1 or next(iter(viewport._open)).wants_drawing():
        return False
    at_work = worker()
    done = at_work.shown is not None and at_work.shown.samples == VIEWPORT_SAMPLES
    size = at_work._order.view.size if at_work._order else None
    return done and at_work._order is at_work._begun and at_work.shown.pixels.shape[1::-1] == size


def see(name: str, change: Callable[[], object]) -> Iterator[None]:
    """Change something, wait for the viewport's picture of it and take a screenshot."""
    before = worker().shown if viewport._open else None
    change()
    start = time.monotonic()
    yield from wait_for(
        f"the viewport shows {name}",
        lambda: settled() and worker().shown is not before,
    )
    seen[f"seconds_{name}"] = time.monotonic() - start
    yield from screenshot(f"{name}.png")


def steps() -> Iterator[None]:
    settings = bpy.context.scene.bvh_lab_render
    properties = next(area for area in bpy.context.screen.areas if area.type == "PROPERTIES")
    for _ in range(5):
        yield
    properties.spaces.active.context = "RENDER"
    yield from f12_steps(settings)
    yield from viewport_steps()


def f12_steps(settings: bpy.types.PropertyGroup) -> Iterator[None]:
    settings.samples = 1 << 20
    bpy.ops.render.render("INVOKE_DEFAULT")  # what F12 does
    yield from wait_for("F12 renders", lambda: rendering() and bool(engine_final.notes_of))
    end = time.monotonic() + 1.0
    yield from wait_for("there is a picture", lambda: time.monotonic() > end)
    yield from screenshot("1_rendering.png")
    start = time.monotonic()
    press(ESCAPE)
    yield from wait_for("ESC stops it", lambda: not rendering())
    seen["seconds_to_stop"] = time.monotonic() - start
    seen["threads_after_stop"] = our_threads()
    yield from screenshot("2_stopped.png")

    bpy.ops.render.render("INVOKE_DEFAULT")  # what F12 does
    yield from wait_for("F12 renders once more", lambda: rendering() and at_work())
    bvh_lab.unregister()
    seen["at_work_after_unregister"] = at_work()
    yield from wait_for("the render ends", lambda: not rendering())
    bvh_lab.register()
    bpy.context.scene.render.engine = "BVHLAB"

    settings = bpy.context.scene.bvh_lab_render
    settings.samples = 4
    bpy.ops.render.render("INVOKE_DEFAULT")  # what F12 does
    yield from wait_for("F12 renders again", lambda: bool(engine_final.notes_of))
    yield from wait_for("it ends", lambda: not rendering())
    yield from screenshot("3_rendered.png")


def viewport_steps() -> Iterator[None]:
    max(bpy.context.screen.areas, key=lambda area: area.width * area.height).type = "VIEW_3D"
    yield
    space, monkey = view3d().spaces.active, bpy.context.object
    region = window_region(view3d())
    seen["region"] = [region.x, region.y, region.width, region.height]
    turn = Quaternion((0.0, 0.0, 1.0), 0.8)
    view = space.region_3d

    def set_rendered() -> None:
        space.shading.type = "RENDERED"
        space.overlay.show_overlays = False

    yield from see("4_viewport", set_rendered)
    yield from see("5_turned", lambda: setattr(view, "view_rotation", view.view_rotation @ turn))
    yield from see("6_moved", lambda: setattr(monkey.location, "x", 2.0))
    yield from see("7_hidden", lambda: monkey.hide_set(True) or add_tetrahedron())
    yield from see("8_camera", lambda: setattr(view, "view_perspective", "CAMERA"))
    extracted = worker()._order.scene
    bpy.data.objects["Light"].select_set(True)  # no surface changes with it
    for _ in range(20):
        yield
    seen["read_again_for_a_selection"] = worker()._order.scene is not extracted
    space.shading.type = "SOLID"
    yield from wait_for("the viewport's thread ends", lambda: not our_threads())
    space.shading.type = "RENDERED"
    yield from wait_for("it renders again", lambda: bool(our_threads()) and settled())
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    yield from wait_for("opening a file ends the thread", lambda: not our_threads())
    bpy.context.scene.render.engine = "BVHLAB"
    bpy.context.scene.bvh_lab_render.viewport_samples = VIEWPORT_SAMPLES
    view3d().spaces.active.shading.type = "RENDERED"
    yield from wait_for("the new file is rendered", lambda: bool(our_threads()) and settled())


def add_tetrahedron() -> None:
    mesh = bpy.data.meshes.new("Tetrahedron")
    mesh.from_pydata(
        [(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)],
        [],
        [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)],
    )
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Tetrahedron", mesh))


def unregister_while_rendered() -> None:
    bvh_lab.unregister()
    seen["threads_after_unregister"] = our_threads()


prepare()
play(steps(), unregister_while_rendered)
