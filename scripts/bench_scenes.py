# SPDX-License-Identifier: GPL-3.0-or-later
"""The scenes of the benchmarks, seen as in the paper where it says from where."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from bvh_lab.study.load import load_mesh_file
from bvh_lab.study.scene import Camera, Scene

SHARED = Path(__file__).resolve().parents[2] / "shared" / "scenes"
Z_UP = ("sibenik",)

# The paper's three views, in coordinates where the scene's longest side is 1: position, direction.
PAPER_VIEWS = {
    "crytek_sponza": [
        ((0.26, 0.06, 0.32), (1.0, 0.0, 0.0)),
        ((0.26, 0.06, 0.32), (0.82, 0.32, 0.47)),
        ((0.76, 0.07, 0.31), (1.0, 0.07, 0.01)),
    ],
    "crown": [
        ((0.15, 0.04, 0.22), (0.76, 0.2, 0.62)),
        ((0.34, 0.07, 0.22), (0.47, 0.34, 0.81)),
        ((0.46, 0.1, 0.33), (0.18, 0.14, 0.97)),
    ],
}
# Ours, in the same coordinates: rooms are seen from inside.
OUR_VIEWS = {
    "sibenik": [
        ((0.12, 0.21, 0.1), (1.0, 0.0, 0.12)),
        ((0.7, 0.28, 0.1), (-1.0, -0.3, 0.25)),
        ((0.45, 0.12, 0.35), (0.5, 0.6, -0.35)),
    ],
    "bathroom": [
        ((0.55, 0.4, 0.4), (-0.8, -0.4, -0.6)),
        ((0.8, 0.3, 0.3), (-1.0, -0.3, -0.2)),
        ((0.45, 0.3, 0.1), (-0.8, -0.35, 0.7)),
    ],
}
FIELD_OF_VIEW = 45.0  # degrees, vertical


def normalised_camera(
    scene: Scene, name: str, position: Any, direction: Any, up: tuple[float, float, float]
) -> Camera:
    """A camera as the paper describes it, position in the normalised scene."""
    used = scene.vertices[np.unique(scene.triangles)].astype(np.float64)
    lower, upper = used.min(axis=0), used.max(axis=0)
    backward = -np.asarray(direction) / np.linalg.norm(direction)
    right = np.cross(up, backward)
    right /= np.linalg.norm(right)
    to_world = np.eye(4)
    to_world[:3, :3] = np.stack((right, np.cross(backward, right), backward), axis=1)
    to_world[:3, 3] = lower + np.asarray(position) * (upper - lower).max()
    top = float(np.tan(np.radians(FIELD_OF_VIEW) / 2))
    return Camera(name, "perspective", to_world, (-top * 4 / 3, top * 4 / 3, -top, top))


def load_scene(path: Path) -> Scene:
    """The mesh with the paper's cameras, with ours inside a room, else with three from outside."""
    z_up = path.stem in Z_UP
    scene = load_mesh_file(path, up="z" if z_up else "y")
    whose = "paper" if path.stem in PAPER_VIEWS else "inside"
    if views := PAPER_VIEWS.get(path.stem) or OUR_VIEWS.get(path.stem):
        scene.cameras = [
            normalised_camera(
                scene, f"{whose} {i + 1}", *view, (0.0, 0.0, 1.0) if z_up else (0.0, 1.0, 0.0)
            )
            for i, view in enumerate(views)
        ]
    return scene
