# SPDX-License-Identifier: GPL-3.0-or-later
"""The thread that renders a viewport: always the newest order, better the longer it stands.

It touches nothing of Blender's, so it cannot outlive what it works on.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..native import load
from ..study.core_scene import core_camera
from ..study.scene import Camera, Float32Array, Scene
from . import engine_scene
from .engine_scene import Prepared, Settings
from .text import sentence

COARSE = (1, 2, 4, 8)  # of the first picture: a pixel of it stands for so many on a side
UNKNOWN_COARSE = 4  # before it is known how fast this scene renders
COARSE_SECONDS = 0.1  # that the first picture may take
PASS_SECONDS = 0.5  # between two pictures


@dataclass(frozen=True)
class View:
    """What a region of ``size`` (width, height) pixels shows; comparable, so a tuple of rows."""

    size: tuple[int, int]
    camera: Camera

    def __eq__(self, other: object) -> bool:
        return isinstance(other, View) and self._key() == other._key()

    def _key(self) -> tuple[Any, ...]:
        camera = self.camera
        lens = (camera.clip_start, camera.lens_radius, camera.focus_distance)
        return (self.size, camera.kind, camera.window, lens, camera.to_world.tobytes())


@dataclass(frozen=True)
class Order:
    """A picture to be rendered. Another ``scene`` object is another scene."""

    scene: Scene
    view: View
    settings: Settings

    def same(self, other: Order | None) -> bool:
        """Whether both lead to the same picture."""
        return (
            other is not None
            and self.scene is other.scene
            and self.view == other.view
            and self.settings == other.settings
        )


@dataclass(frozen=True)
class Shown:
    """A picture: ``pixels`` (H, W, 4) float32, linear, lowest row first."""

    pixels: Float32Array
    samples: int


class Worker:
    """One thread; every method may be called from another one and returns at once."""

    def __init__(self) -> None:
        core = load()
        self._changed = threading.Condition()
        self._order: Order | None = None
        self._begun: Order | None = None
        self._closed = False
        self._scene_token, self._view_token = core.Token(), core.Token()
        self._prepared: tuple[Scene, Settings, Prepared] | None = None
        self._pixel_seconds = 0.0  # that a sample of a pixel takes; 0: not known
        self.shown: Shown | None = None
        self.status = ""
        self.news = False  # set here, cleared by who has drawn it
        self._thread = threading.Thread(target=self._run, name="bvh_lab viewport", daemon=True)
        self._thread.start()

    def submit(self, order: Order) -> None:
        """Render this from now on; nothing happens where it is what is being rendered."""
        with self._changed:
            if order.same(self._order):
                return
            core = load()
            old, self._order = self._order, order
            self._view_token.cancel()
            self._view_token = core.Token()
            if old is None or not _same_tree(old, order):
                self._scene_token.cancel()
                self._scene_token = core.Token()
            self._changed.notify()

    def close(self) -> None:
        """End the thread, within about 0.1 s, and wait for it."""
        with self._changed:
            self._closed = True
            self._view_token.cancel()
            self._scene_token.cancel()
            self._changed.notify()
        if threading.current_thread() is not self._thread:
            self._thread.join()
        self._prepared = self.shown = None

    def _run(self) -> None:
        while True:
            with self._changed:
                while self._order is self._begun and not self._closed:
                    self._changed.wait()
                if self._closed:
                    return
                order = self._begun = self._order
                tokens = self._scene_token, self._view_token
            assert order is not None
            try:
                self._render(order, *tokens)
            except load().Cancelled:
                continue
            except Exception as error:  # shown in the viewport; the next order may do better
                self._tell(sentence(error))

    def _render(self, order: Order, scene_token: Any, view_token: Any) -> None:
        prepared = self._prepare(order, scene_token)
        size = order.view.size
        for coarse in sorted({self._first_coarse(size), 1}, reverse=True):
            small = (max(1, size[0] // coarse), max(1, size[1] // coarse))
            camera = core_camera(load(), order.view.camera)
            renderer = engine_scene.renderer(prepared, camera, small, order.settings)
            target = 1 if coarse > 1 else order.settings.samples
            while renderer.samples < target:
                self._pass(renderer, small, target, view_token)
                label = f"Sample {renderer.samples}/{order.settings.samples}"
                self._show(renderer, label if coarse == 1 else "Sample 0, coarse")

    def _prepare(self, order: Order, token: Any) -> Prepared:
        """The tree and the native scene, made anew where it is not that of the last order."""
        if self._prepared is not None:
            scene, settings, prepared = self._prepared
            if _same_tree(replace(order, scene=scene, settings=settings), order):
                return prepared
        self._tell(f"Building {order.settings.label}")
        self._prepared = None  # frees the old one's memory first
        prepared = engine_scene.prepare(order.scene, order.settings, token)
        self._prepared = (order.scene, order.settings, prepared)
        return prepared

    def _first_coarse(self, size: tuple[int, int]) -> int:
        """How coarse the first picture has to be to come at once."""
        if self._pixel_seconds == 0.0:
            return UNKNOWN_COARSE
        seconds = size[0] * size[1] * self._pixel_seconds
        return next((each for each in COARSE if seconds / each**2 <= COARSE_SECONDS), COARSE[-1])

    def _pass(self, renderer: Any, size: tuple[int, int], target: int, token: Any) -> None:
        """Double the samples, but take no longer than `PASS_SECONDS` for it."""
        pixels = size[0] * size[1]
        done = renderer.samples
        fitting = int(PASS_SECONDS / max(pixels * self._pixel_seconds, 1e-9))
        count = max(1, min(done, fitting, target - done))
        start = time.monotonic()
        renderer.render(count, token)
        self._pixel_seconds = (time.monotonic() - start) / (pixels * count)

    def _show(self, renderer: Any, status: str) -> None:
        pixels = renderer.picture().pixels[::-1]
        rgba = np.ones((*pixels.shape[:2], 4), np.float32)
        rgba[..., :3] = pixels
        self.shown = Shown(rgba, renderer.samples)
        self._tell(status)

    def _tell(self, status: str) -> None:
        self.status = status
        self.news = True


def _same_tree(first: Order, second: Order) -> bool:
    """Whether both orders are rendered with one tree."""
    return first.scene is second.scene and (
        (first.settings.builder, first.settings.branching)
        == (second.settings.builder, second.settings.branching)
    )
