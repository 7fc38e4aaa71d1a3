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
FIELD_OF_VIEW = 45.0  # degrees, vertical


def paper_camera(scene: Scene, name: str, position: Any, direction: Any) -> Camera:
    """A camera of the paper: Y up, position in the normalised scene."""
    used = scene.vertices[np.unique(scene.triangles)].astype(np.float64)
    lower, upper = used.min(axis=0), used.max(axis=0)
    backward = -np.asarray(direction) / np.linalg.norm(direction)
    right = np.cross((0.0, 1.0, 0.0), backward)
    right /= np.linalg.norm(right)
    to_world = np.eye(4)
    to_world[:3, :3] = np.stack((right, np.cross(backward, right), backward), axis=1)
    to_world[:3, 3] = lower + np.asarray(position) * (upper - lower).max()
    top = float(np.tan(np.radians(FIELD_OF_VIEW) / 2))
    return Camera(name, "perspective", to_world, (-top * 4 / 3, top * 4 / 3, -top, top))


def load_scene(path: Path) -> Scene:
    """The mesh with the paper's cameras, or with our own where it has none."""
    scene = load_mesh_file(path, up="z" if path.stem in Z_UP else "y")
    if path.stem in PAPER_VIEWS:
        scene.cameras = [
            paper_camera(scene, f"paper {i + 1}", *view)
            for i, view in enumerate(PAPER_VIEWS[path.stem])
        ]
    return scene
