# SPDX-License-Identifier: GPL-3.0-or-later
"""Render passes: which a view layer asks for, and their pixels as Blender takes them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from ..native import load
from ..study.core_scene import core_camera
from ..study.scene import Camera, Float32Array

FAR = 1e10  # depth where nothing is hit, as Cycles has it


@dataclass(frozen=True)
class Pass:
    """A pass with what the channels are called, and its switch on the view layer."""

    name: str
    channels: str
    kind: str
    wanted: Callable[[bpy.types.ViewLayer], bool]


PASSES = (
    Pass("Combined", "RGBA", "COLOR", lambda layer: True),
    Pass("Depth", "Z", "VALUE", lambda layer: layer.use_pass_z),
    Pass("Normal", "XYZ", "VECTOR", lambda layer: layer.use_pass_normal),
    Pass("Albedo", "RGB", "COLOR", lambda layer: layer.bvh_lab.use_pass_albedo),
    Pass("Traversal Steps", "X", "VALUE", lambda layer: layer.bvh_lab.use_pass_traversal_steps),
    Pass("Triangle Tests", "X", "VALUE", lambda layer: layer.bvh_lab.use_pass_triangle_tests),
)


def wanted_passes(layer: bpy.types.ViewLayer) -> list[Pass]:
    """The passes that a view layer asks for, Combined always among them."""
    return [each for each in PASSES if each.wanted(layer)]


def pass_arrays(picture: Any, distance_to_depth: Float32Array | None) -> dict[str, Float32Array]:
    """A `core.Picture` by name of pass, (H, W, C) float32 each, top row first.

    ``distance_to_depth`` is what `depth_factors` gives; None without a Depth pass.
    """
    pixels = picture.pixels
    arrays = {"Combined": np.concatenate([pixels, np.ones_like(pixels[..., :1])], axis=2)}
    if not picture.passes:
        return arrays
    arrays["Normal"], arrays["Albedo"] = picture.passes["normal"], picture.passes["albedo"]
    arrays["Traversal Steps"] = picture.passes["node_visits"][..., None]
    arrays["Triangle Tests"] = picture.passes["triangle_tests"][..., None]
    if distance_to_depth is not None:
        start, slope = distance_to_depth
        distance = picture.passes["depth"]
        depth = np.where(np.isfinite(distance), start + slope * distance, FAR)
        arrays["Depth"] = depth.astype(np.float32)[..., None]
    return arrays


def depth_factors(camera: Camera, size: tuple[int, int], seed: int, threads: int) -> Float32Array:
    """(2, H, W): where the first ray of each pixel starts and how fast it goes, along the view.

    The core measures along the ray, Cycles along the view: its depth at distance t on the ray is
    the first of these plus t times the second.
    """
    core, (width, height) = load(), size
    origins, directions = core.camera_rays(
        core_camera(core, camera), width, height, seed=seed, threads=threads
    )
    to_world = camera.to_world
    ahead = -to_world[:3, 2]
    start = (origins.astype(np.float64) - to_world[:3, 3]) @ ahead
    slope = directions.astype(np.float64) @ ahead
    return np.stack([start, slope]).reshape(2, height, width).astype(np.float32)


def fill(layer: bpy.types.RenderLayer, arrays: dict[str, Float32Array]) -> None:
    """Copy the arrays into the passes of a result's layer; of every view, if it has views."""
    for render_pass in layer.passes:
        if render_pass.name in arrays:
            _fill(render_pass, arrays[render_pass.name])


def _fill(render_pass: bpy.types.RenderPass, values: Float32Array) -> None:
    flat = np.ascontiguousarray(
        values[::-1], np.float32
    ).ravel()  # Blender's first row is the lowest
    try:
        render_pass.rect.foreach_set(flat)
    except TypeError:  # Blender 3.4 wants one row a pixel
        render_pass.rect.foreach_set(flat.reshape(-1, values.shape[2]))
