# SPDX-License-Identifier: GPL-3.0-or-later
"""A final render: one view layer at one frame, in passes that get longer as the picture settles."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import bpy
import numpy as np

from ..native import load
from ..study.core_scene import core_camera
from ..study.scene import Camera, Float32Array
from . import engine_passes, engine_scene
from .cameras import read_camera, say_far_clipping
from .engine_scene import Prepared, Settings
from .engine_thread import AtWork, call_aside
from .extract import ExtractError, extract_as_is
from .notes import Notes
from .store import scene_key
from .unmodelled import say_passes

MEBIBYTE = 1024.0 * 1024.0
# Seconds that a pass may take: long enough that showing it costs little, short enough to watch.
SHORTEST_PASS, LONGEST_PASS = 0.5, 5.0
STATUS_SECONDS = 0.5  # between two status lines; in the background each is a line of the console
BACKGROUND_STATUS_SECONDS = 2.0

notes_of: dict[str, list[str]] = {}  # of the last render, by scene
at_work = AtWork()  # Blender's threads that are in `render_view_layer`


@dataclass
class Frame:
    """What is rendered: ``size`` (width, height) in pixels, through ``camera`` of ``object``."""

    size: tuple[int, int]
    camera: Camera
    object: bpy.types.Object


@dataclass
class Clock:
    """When the render began, and when its status was told last."""

    start: float = field(default_factory=time.monotonic)
    told: float = -1e9

    @property
    def seconds(self) -> float:
        return time.monotonic() - self.start

    def due(self) -> bool:
        """Whether it is time for another status line; if so the next one is due later."""
        pause = BACKGROUND_STATUS_SECONDS if bpy.app.background else STATUS_SECONDS
        if time.monotonic() - self.told < pause:
            return False
        self.told = time.monotonic()
        return True


def render_view_layer(engine: bpy.types.RenderEngine, depsgraph: bpy.types.Depsgraph) -> None:
    """Render into Blender's result, until all samples are there or the user stops it.

    What was rendered until then stays. Raises ValueError, RuntimeError (ExtractError and
    NativeMissing among them) and MemoryError, one sentence each.
    """
    core = load()
    scene, layer = depsgraph.scene, depsgraph.view_layer
    settings = engine_scene.final_settings(scene, engine.is_preview)
    notes = Notes()
    frame = read_frame(engine, depsgraph, notes)
    engine.update_stats("", "Reading the scene")
    extracted = extract_as_is(depsgraph, "render")
    say_far_clipping(frame.object, extracted.vertices, notes)
    say_passes(scene, layer, notes)
    if frame.camera.lens_radius > 0.0:
        notes.fact("modelled: depth of field")

    clock, token = Clock(), core.Token()

    def tick() -> bool:
        if clock.due():
            engine.update_stats("", f"{token.stage.capitalize()}: {token.fraction:.0%}")
        return stopped(engine)

    try:
        prepared = call_aside(lambda: engine_scene.prepare(extracted, settings, token), token, tick)
    except core.Cancelled:
        return
    all_notes = extracted.notes + notes.sentences() + prepared.notes
    _keep_notes(scene, all_notes, engine.is_preview)
    label = f"{settings.label}, {_count(len(extracted.triangles))} triangles"
    if lost := engine_scene.losses(all_notes):
        label += f" | {len(lost)} approximation{'s' * (len(lost) > 1)}: see the panel"
    Progress(engine, layer, frame, prepared, settings, clock, label).run()


class Progress:
    """The passes of one render into one result."""

    def __init__(
        self,
        engine: bpy.types.RenderEngine,
        layer: bpy.types.ViewLayer,
        frame: Frame,
        prepared: Prepared,
        settings: Settings,
        clock: Clock,
        label: str,
    ) -> None:
        self.engine, self.settings, self.clock, self.label = engine, settings, clock, label
        wanted = {each.name for each in engine_passes.wanted_passes(layer)}
        self.depth: Float32Array | None = None
        if "Depth" in wanted:
            self.depth = engine_passes.depth_factors(
                frame.camera, frame.size, settings.seed, settings.threads
            )
        camera = core_camera(load(), frame.camera)
        self.renderer = engine_scene.renderer(
            prepared, camera, frame.size, settings, passes=wanted != {"Combined"}
        )
        self.bytes, self.size, self.layer = prepared.bytes, frame.size, layer.name
        self.began = time.monotonic()
        self.speed = ""
        self.pixel_bytes = 0

    def run(self) -> None:
        """Render to the end, or until the user stops it; the result is handed over either way."""
        core, done, total = load(), 0, self.settings.samples
        result = self.engine.begin_result(0, 0, *self.size, layer=self.layer)
        try:
            self._check_size(result)
            while done < total:
                self._pass(min(self._pass_length(done), total - done))
                done = self.renderer.samples
                self._show(result)
                if done < total:
                    self.engine.update_result(result)
        except core.Cancelled:
            self._show(result)
        finally:
            self.engine.end_result(result)

    def _check_size(self, result: bpy.types.RenderResult) -> None:
        """Whether Blender counts the border's pixels as we do."""
        if (result.resolution_x, result.resolution_y) != self.size:
            raise RuntimeError(
                f"Blender wants {result.resolution_x} x {result.resolution_y} pixels, but the "
                f"border holds {self.size[0]} x {self.size[1]}"
            )

    def _pass_length(self, done: int) -> int:
        """Samples of the next pass: as many as there are already, within bounds of time."""
        if done == 0:
            return 1
        elapsed = time.monotonic() - self.began
        seconds = min(max(elapsed, SHORTEST_PASS), LONGEST_PASS)
        return max(1, min(done, int(seconds * done / elapsed)))

    def _pass(self, samples: int) -> None:
        token = load().Token()
        done = self.renderer.samples

        def tick() -> bool:
            self._tell(done + token.fraction * samples)
            return stopped(self.engine)

        call_aside(lambda: self.renderer.render(samples, token), token, tick)

    def _show(self, result: bpy.types.RenderResult) -> None:
        picture = self.renderer.picture()
        if picture.seconds > 0.0:
            self.speed = f"{sum(picture.rays.values()) / picture.seconds / 1e6:.2f} MRays/s"
        arrays = engine_passes.pass_arrays(picture, self.depth)
        self.pixel_bytes = sum(array.nbytes for array in arrays.values())
        for layer in result.layers:
            engine_passes.fill(layer, arrays)

    def _tell(self, done: float) -> None:
        total = self.settings.samples
        self.engine.update_progress(done / total)
        if not self.clock.due():
            return
        parts = [f"Sample {min(int(done) + 1, total)}/{total}", self.speed]
        if done >= 1.0:
            left = (time.monotonic() - self.began) / done * (total - done)
            parts.append(f"{_minutes(left)} left")
        self.engine.update_stats("", " | ".join([part for part in parts if part] + [self.label]))
        used = (self.bytes + self.pixel_bytes) / MEBIBYTE
        self.engine.update_memory_stats(memory_used=used, memory_peak=used)


def stopped(engine: bpy.types.RenderEngine) -> bool:
    """Whether the user, Ctrl-C in the background, or the end of the add-on stops the render."""
    return at_work.stopping or bool(engine.test_break())


def read_frame(
    engine: bpy.types.RenderEngine, depsgraph: bpy.types.Depsgraph, notes: Notes
) -> Frame:
    """The camera and the pixels that the render settings ask for, within the border if one is used.

    Raises ExtractError where there is no camera.
    """
    scene, render = depsgraph.scene, depsgraph.scene.render
    camera = engine.camera_override or scene.camera
    if camera is None or camera.type != "CAMERA":
        raise ExtractError(f"Scene '{scene.name}' has no camera: add one and make it active.")
    width, height = engine.resolution_x, engine.resolution_y
    camera = camera.evaluated_get(depsgraph)
    found = read_camera(camera, scene, notes)
    if not render.use_border or engine.is_preview:
        return Frame((width, height), found, camera)
    columns = _pixels(render.border_min_x, render.border_max_x, width)
    rows = _pixels(render.border_min_y, render.border_max_y, height)
    left, right, bottom, top = found.window
    across, upwards = (right - left) / width, (top - bottom) / height
    window = (
        left + columns[0] * across,
        left + columns[1] * across,
        bottom + rows[0] * upwards,
        bottom + rows[1] * upwards,
    )
    size = (columns[1] - columns[0], rows[1] - rows[0])
    if min(size) < 1:
        raise ExtractError("The render border is less than a pixel: draw a larger one.")
    return Frame(size, replace(found, window=window), camera)


def _pixels(first: float, last: float, count: int) -> tuple[int, int]:
    """The pixels between two shares of a side; Blender rounds down, in single precision."""
    low, high = (int(np.float32(share) * np.float32(count)) for share in (first, last))
    return low, high


def _keep_notes(scene: bpy.types.Scene, notes: list[str], preview: bool) -> None:
    """For the panel; in the background on the console."""
    if preview:
        return
    notes_of[scene_key(scene)] = notes
    if bpy.app.background:
        for note in notes:
            print(f"BVH Lab: {note}", flush=True)


def _count(number: int) -> str:
    if number < 10_000:
        return f"{number:,}"
    thousands = round(number / 1000)
    return f"{thousands:,} thousand" if thousands < 10_000 else f"{number / 1e6:.1f} million"


def _minutes(seconds: float) -> str:
    whole = round(seconds)
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02}:{whole % 60:02}" if hours else f"{minutes:02}:{whole % 60:02}"
