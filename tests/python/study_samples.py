# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes and plans that the study's tests share."""

from __future__ import annotations

from typing import Any

import numpy as np
from bvh_lab.study.framing import auto_cameras
from bvh_lab.study.plan import Plan
from bvh_lab.study.scene import Component, Light, Material, Scene, World


def grid_of_boxes(side: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """side^3 separate boxes, 12 triangles each, in the unit cube."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    box = np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))], np.uint32)
    places = np.array([[x, y, z] for x in range(side) for y in range(side) for z in range(side)])
    vertices = (places[:, None, :] + 0.6 * corners[None]) / side
    triangles = box[None] + 8 * np.arange(len(places), dtype=np.uint32)[:, None, None]
    return vertices.reshape(-1, 3).astype(np.float32), triangles.reshape(-1, 3)


def sample_scene(**changes: Any) -> Scene:
    """Boxes in two colours with a lamp above and three cameras around."""
    vertices, triangles = grid_of_boxes()
    lamp = np.eye(4)
    lamp[:3, 3] = (0.3, 0.4, 3.0)
    fields: dict[str, Any] = {
        "name": "boxes",
        "vertices": vertices,
        "triangles": triangles,
        "material_index": (np.arange(len(triangles)) % 2).astype(np.uint32),
        "materials": [
            Material("red", [Component(color=(0.8, 0.1, 0.1))]),
            Material("grey", [Component(color=(0.5, 0.5, 0.5))]),
        ],
        "cameras": auto_cameras(vertices),
        "lights": [Light("Lamp", "point", lamp, (300.0, 300.0, 300.0), size_x=0.1)],
        "world": World((0.1, 0.1, 0.1)),
        "geometry": "viewport",
        "notes": ["A note of the extraction."],
    }
    return Scene(**{**fields, **changes})


def small_plan(**changes: Any) -> Plan:
    """A plan that takes about a second."""
    fields: dict[str, Any] = {
        "builders": ["lbvh", "sah"],
        "branchings": [2, 8],
        "layouts": ["full"],
        "views": 2,
        "long_side": 48,
        "samples": 1,
        "ray_long_side": 0,
        "repeats": 3,
        "build_repeats": 1,
        "judged_rays": 64,
    }
    return Plan(**{**fields, **changes})
