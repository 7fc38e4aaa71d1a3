# SPDX-License-Identifier: GPL-3.0-or-later
"""What a renderer renders: the native scene and its tree, and the settings to do it with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy

from ..native import load
from ..study.core_scene import core_scene
from ..study.scene import Scene
from . import preferences
from .engine_settings import bvh_label

LOSSES = ("approximated", "left out", "missing")  # how notes on what is not as asked begin
PREVIEW_SAMPLES = 16


@dataclass(frozen=True)
class Settings:
    """The engine's settings as plain values, for one render or one viewport."""

    samples: int
    seed: int
    depth: int
    shadow_rays: int
    builder: str
    branching: int
    reorder: str
    threads: int

    @property
    def label(self) -> str:
        """The tree in words."""
        return bvh_label(self.builder, str(self.branching))


@dataclass
class Prepared:
    """Native objects to make a `core.Renderer` of; ``bytes`` is what they and the arrays take."""

    bvh: Any
    scene: Any
    notes: list[str]
    bytes: int


def final_settings(scene: bpy.types.Scene, preview: bool = False) -> Settings:
    """Of a final render; a material preview takes few samples and a tree that is built at once."""
    chosen = scene.bvh_lab_render
    samples = min(chosen.samples, PREVIEW_SAMPLES) if preview else chosen.samples
    return _settings(scene, samples, chosen.viewport_builder if preview else chosen.builder)


def viewport_settings(scene: bpy.types.Scene) -> Settings:
    """Of a rendered viewport."""
    chosen = scene.bvh_lab_render
    return _settings(scene, chosen.viewport_samples, chosen.viewport_builder)


def _settings(scene: bpy.types.Scene, samples: int, builder: str) -> Settings:
    chosen, render = scene.bvh_lab_render, scene.render
    fixed = render.threads_mode == "FIXED"
    return Settings(
        samples=samples,
        seed=chosen.seed,
        depth=chosen.depth,
        shadow_rays=chosen.shadow_rays,
        builder=builder,
        branching=int(chosen.branching),
        reorder=chosen.reorder,
        threads=render.threads if fixed else preferences.threads(),
    )


def prepare(scene: Scene, settings: Settings, token: Any) -> Prepared:
    """Hand the scene to the core and build its tree; in any thread.

    Raises what the core raises: ValueError, RuntimeError, MemoryError, Cancelled.
    """
    core = load()
    mesh = core.Mesh(scene.vertices, scene.triangles)
    made, notes = core_scene(core, mesh, scene)
    bvh = core.build(
        mesh,
        settings.builder,
        branching=settings.branching,
        threads=settings.threads,
        token=token,
    )
    arrays = [scene.vertices, scene.triangles, scene.material_index, scene.uvs, scene.normals]
    taken = sum(array.nbytes for array in arrays if array is not None)
    return Prepared(bvh, made, notes, taken + int(bvh.stats["bytes"]))


def renderer(
    prepared: Prepared,
    camera: Any,
    size: tuple[int, int],
    settings: Settings,
    passes: bool = False,
) -> Any:
    """A `core.Renderer` of ``size`` (width, height) through a `core.Camera`."""
    return load().Renderer(
        prepared.bvh,
        prepared.scene,
        camera,
        *size,
        seed=settings.seed,
        depth=settings.depth,
        shadow_rays=settings.shadow_rays,
        reorder=settings.reorder,
        passes=passes,
        threads=settings.threads,
    )


def losses(notes: list[str]) -> list[str]:
    """Those of the extraction's notes that say what is not as the scene has it."""
    return [note for note in notes if note.lower().startswith(LOSSES)]
