# SPDX-License-Identifier: GPL-3.0-or-later
"""The rendered viewport: notices what changed, orders a picture of it, draws what has come."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable

import bpy

from ..study.scene import Scene
from . import engine_scene
from .extract import ExtractError, extract_as_is
from .viewport_draw import Picture
from .viewport_view import read_view
from .viewport_worker import Order, Worker

POLL_SECONDS = 0.03
# While something moves the scene is read over and over in the main thread. After each time it
# rests for as long as it took, times this, so that the interface keeps most of the time.
REST = 1.5

_open: weakref.WeakSet[Viewport] = weakref.WeakSet()
_timers: set[Callable[[], float | None]] = set()


class Viewport:
    """One viewport's state. All methods in the main thread; a worker renders."""

    def __init__(self) -> None:
        self._worker = Worker()
        self._picture = Picture()
        self._scene: Scene | None = None
        self._error = ""
        self._stale = True
        self._visible: frozenset[str] | None = None
        self._read_again_at = 0.0

    def update(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Something changed: read the scene again with the next drawing, if need be."""
        if changes_surfaces(depsgraph) or visible_objects(depsgraph) != self._visible:
            self._stale = True

    def draw(
        self,
        engine: bpy.types.RenderEngine,
        context: bpy.types.Context,
        depsgraph: bpy.types.Depsgraph,
    ) -> None:
        """Draw the newest picture, and order another one where scene, view or settings changed."""
        worker, scene = self._worker, context.scene
        worker.news = False
        if self._stale and time.monotonic() >= self._read_again_at:
            self._read(depsgraph)
        if self._scene is None:
            engine.update_stats("", self._error)
            return
        view = read_view(context, depsgraph)
        worker.submit(Order(self._scene, view, engine_scene.viewport_settings(scene)))
        if worker.shown is not None:
            self._picture.draw(engine, scene, context.region, worker.shown)
        lost = len(engine_scene.losses(self._scene.notes))
        note = f" | {lost} approximation{'s' * (lost > 1)}" if lost else ""
        engine.update_stats("", worker.status + note)

    def wants_drawing(self) -> bool:
        """Whether there is something new to draw."""
        due = self._stale and time.monotonic() >= self._read_again_at
        return self._worker.news or due

    def close(self) -> None:
        """End the worker; it has ended when this returns."""
        _open.discard(self)
        self._worker.close()

    def _read(self, depsgraph: bpy.types.Depsgraph) -> None:
        start = time.monotonic()
        self._stale = False
        self._visible = visible_objects(depsgraph)
        try:
            self._scene, self._error = extract_as_is(depsgraph, "viewport"), ""
        except ExtractError as error:
            self._scene, self._error = None, str(error)
        seconds = time.monotonic() - start
        self._read_again_at = start + seconds * (1.0 + REST)


def start(engine: bpy.types.RenderEngine) -> Viewport:
    """A viewport for an engine's instance: redrawn when there is news, closed when it goes.

    Not closed by its ``__del__``: by then Blender has cut it off from its attributes.
    """
    made = Viewport()
    _open.add(made)
    weakref.finalize(engine, made.close)
    engine_reference, viewport_reference = weakref.ref(engine), weakref.ref(made)

    def poll() -> float | None:
        owner, ours = engine_reference(), viewport_reference()
        if owner is None or ours is None or ours not in _open:
            _timers.discard(poll)
            return None
        if ours.wants_drawing():
            owner.tag_redraw()
        return POLL_SECONDS

    _timers.add(poll)
    bpy.app.timers.register(poll, first_interval=POLL_SECONDS)
    return made


def close_all() -> None:
    """End every viewport: another file opens, or the add-on or Blender goes."""
    for each in list(_open):
        each.close()


def stop_timers() -> None:
    """Take away what looks for news; not at exit, when Blender's timers are gone already."""
    for poll in list(_timers):
        if bpy.app.timers.is_registered(poll):
            bpy.app.timers.unregister(poll)
    _timers.clear()


def visible_objects(depsgraph: bpy.types.Depsgraph) -> frozenset[str]:
    """Names of the objects that are shown; to hide one is told apart from selecting it by this."""
    layer = depsgraph.view_layer
    return frozenset(obj.name_full for obj in layer.objects if obj.visible_get(view_layer=layer))


def changes_surfaces(depsgraph: bpy.types.Depsgraph) -> bool:
    """Whether an update can change triangles, materials, lights or the world.

    Cameras and selection do not; the view itself is read with every drawing.
    """
    return any(_matters(update) for update in depsgraph.updates)


def _matters(update: bpy.types.DepsgraphUpdate) -> bool:
    block = update.id
    if isinstance(block, (bpy.types.Camera, bpy.types.Scene, bpy.types.Screen)):
        return False
    if isinstance(block, bpy.types.Object) and block.type == "CAMERA":
        return False
    if isinstance(block, (bpy.types.Object, bpy.types.Collection)):
        return bool(
            update.is_updated_geometry or update.is_updated_transform or update.is_updated_shading
        )
    return True
