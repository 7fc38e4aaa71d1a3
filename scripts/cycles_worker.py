#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles in a process of its own, for bench_cycles.py: one JSON order a line on stdin, one answer
a line on stdout.

    python cycles_worker.py scene.blend '{"width": 240, "height": 135, "camera": "court", ...}'
    {"samples": 4, "seed": 1, "pixels": "picture.npy"}  ->  {"seconds": 0.52}

Cycles path traces on the CPU as BVH Lab does: the same bounces of every kind, every sample drawn
(no adaptive sampling), nothing clamped, smoothed or denoised, a box filter of one pixel. The scene
stays loaded from one order to the next (persistent data).
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ANSWERS = os.fdopen(os.dup(1), "w")  # Blender prints to stdout itself, also when it is imported
os.dup2(2, 1)

import bpy
import numpy as np
from blender_scene import open_for_render


def set_up(settings: dict[str, Any]) -> None:
    """Make Cycles do what our path tracer does."""
    import addon_utils

    if not addon_utils.check("cycles")[1] and addon_utils.enable("cycles") is None:
        raise RuntimeError("this Blender has no Cycles")
    scene, depth = bpy.context.scene, settings["depth"]
    cycles, render = scene.cycles, scene.render
    render.engine = "CYCLES"
    render.threads_mode, render.threads = "FIXED", settings["threads"]
    render.use_persistent_data = True
    render.use_compositing = render.use_sequencer = render.film_transparent = False
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    cycles.device = "CPU"
    cycles.use_denoising = cycles.use_adaptive_sampling = cycles.use_guiding = False
    cycles.use_auto_tile = cycles.use_fast_gi = False
    cycles.pixel_filter_type, cycles.film_exposure = "BOX", 1.0
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = depth
    cycles.transmission_bounces, cycles.transparent_max_bounces = depth, max(depth, 8)
    cycles.volume_bounces = 0
    cycles.min_light_bounces = cycles.min_transparent_bounces = 0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.blur_glossy = cycles.light_sampling_threshold = 0.0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    for light in bpy.data.lights:
        light.cycles.max_bounces = 1024
    if scene.world:
        scene.world.cycles.sampling_method = "AUTOMATIC"
        scene.world.cycles.max_bounces = 1024


def render_picture(samples: int, seed: int, pixels: str) -> float:
    """Render and give the seconds, writing of the file included; keep the picture as .npy."""
    scene = bpy.context.scene
    scene.cycles.samples, scene.cycles.seed = samples, seed
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "picture.exr")
        start = time.perf_counter()
        bpy.ops.render.render(write_still=True)
        seconds = time.perf_counter() - start
        if pixels:
            np.save(pixels, read_exr(scene.render.filepath))
    return seconds


def read_exr(path: str) -> np.ndarray:
    """(H, W, 3) float32, linear, top row first."""
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    values = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return np.ascontiguousarray(values.reshape(height, width, 4)[::-1, :, :3])


def main() -> int:
    settings = json.loads(sys.argv[2])
    open_for_render(
        Path(sys.argv[1]),
        settings["width"],
        settings["height"],
        settings["camera"],
        settings["diffuse"],
    )
    set_up(settings)
    print(json.dumps({"version": bpy.app.version_string}), file=ANSWERS, flush=True)
    for line in sys.stdin:
        order = json.loads(line)
        seconds = render_picture(order["samples"], order["seed"], order.get("pixels", ""))
        print(json.dumps({"seconds": seconds}), file=ANSWERS, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
