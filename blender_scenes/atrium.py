# SPDX-License-Identifier: GPL-3.0-or-later
"""The atrium: a two-storey colonnade around an open court, after the Sponza scene of the paper.

The court lies on the XY plane with its long side along X. Its ring is made of the bays, columns and
corners of atrium_bay.py; atrium_drapery.py and atrium_decor.py furnish it.
"""

from __future__ import annotations

import math

from atrium_bay import (
    BAY,
    BAYS_X,
    BAYS_Y,
    HALF_X,
    HALF_Y,
    make_bay,
    make_column,
    make_corner,
)
from atrium_decor import add_decor
from atrium_drapery import add_drapery
from common import (
    Shape,
    add_area,
    add_camera,
    add_instance,
    add_material,
    add_object,
    add_sun,
    empty_scene,
    new_collection,
    set_world,
)
from mathutils import Matrix

MATERIALS = {
    "limestone": (0.66, 0.58, 0.46),
    "marble": (0.78, 0.75, 0.70),
    "plaster": (0.72, 0.55, 0.33),
    "dado": (0.36, 0.09, 0.06),
    "fresco blue": (0.07, 0.16, 0.34),
    "fresco red": (0.44, 0.10, 0.06),
    "timber": (0.36, 0.20, 0.10),
    "roof tile": (0.50, 0.17, 0.08),
    "floor cream": (0.64, 0.55, 0.42),
    "floor rose": (0.44, 0.19, 0.13),
    "floor slate": (0.13, 0.15, 0.17),
    "crimson cloth": (0.50, 0.025, 0.03),
    "saffron cloth": (0.80, 0.36, 0.04),
    "teal cloth": (0.02, 0.23, 0.26),
    "ivory cloth": (0.78, 0.70, 0.55),
    "bronze": (0.25, 0.14, 0.06),
    "gold": (0.72, 0.46, 0.12),
    "rope": (0.42, 0.30, 0.17),
    "terracotta": (0.52, 0.22, 0.12),
    "glaze": (0.05, 0.18, 0.36),
    "leaf": (0.07, 0.20, 0.035),
    "orange": (0.85, 0.27, 0.02),
    "bark": (0.16, 0.10, 0.06),
    "water": (0.06, 0.24, 0.28),
}


def add_ring() -> None:
    """Show bays, columns and corners around the court."""
    ring = new_collection("ring")
    bays = [make_bay("bay blue", "fresco blue"), make_bay("bay red", "fresco red")]
    column, corner = make_column(), make_corner()
    for quarter in range(4):
        turn = Matrix.Rotation(math.pi / 2 * quarter, 4, "Z")
        along, away = (HALF_X, HALF_Y) if quarter % 2 == 0 else (HALF_Y, HALF_X)
        count = BAYS_X if quarter % 2 == 0 else BAYS_Y
        for i in range(count):
            middle = BAY * (i + 0.5) - along
            add_instance(bays[i % 2], ring, turn @ Matrix.Translation((middle, away, 0)))
            if i > 0:
                add_instance(column, ring, turn @ Matrix.Translation((middle - BAY / 2, away, 0)))
        add_instance(corner, ring, turn @ Matrix.Translation((along, away, 0)))


def add_court_floor() -> None:
    """Pave the court with large tiles: two triangles each."""
    shape = Shape()
    size = 0.75
    half_x, half_y = HALF_X - 0.5, HALF_Y - 0.5
    columns, rows = round(2 * half_x / size), round(2 * half_y / size)
    for i in range(columns):
        for j in range(rows):
            low = (-half_x + 2 * half_x * i / columns, -half_y + 2 * half_y * j / rows)
            high = (-half_x + 2 * half_x * (i + 1) / columns, -half_y + 2 * half_y * (j + 1) / rows)
            edge = i in (0, columns - 1) or j in (0, rows - 1)
            material = "floor slate" if edge else ("floor cream", "floor rose")[(i + j) % 2]
            shape.add(
                [(*low, -0.15), (high[0], low[1], -0.15), (*high, -0.15), (low[0], high[1], -0.15)],
                [(0, 1, 2, 3)],
                material,
            )
    add_object("court floor", shape, new_collection("floor"))


def add_lights() -> None:
    """Add the sun, the sky over the court as an area light, and warm lamps in two galleries."""
    set_world((0.42, 0.54, 0.72))
    add_sun("sun", (-5.0, -3.6, 8.0), 3.6, (1.0, 0.90, 0.74), math.radians(0.6))
    add_area("skylight", (0, 0, 14), (0, 0, 0), (18, 9), 1050, (0.80, 0.88, 1.0))
    warm = (1.0, 0.76, 0.50)
    add_area("lamp east", (HALF_X + 0.6, 0, 4.0), (HALF_X + 1.8, 0, 1.2), (0.8, 1.2), 90, warm)
    add_area("lamp south", (0, -HALF_Y - 1.5, 4.1), (0, -HALF_Y - 1.5, 0), (12.0, 1.0), 260, warm)


def make() -> None:
    """Build the atrium in an empty file."""
    scene = empty_scene("atrium")
    for name, color in MATERIALS.items():
        add_material(
            name, color, roughness=0.4 if name in {"bronze", "gold", "glaze", "water"} else 0.8
        )
    add_material("lamp glass", (1.0, 0.72, 0.40), glow=0.9)
    add_ring()
    add_court_floor()
    add_drapery()
    add_decor()
    add_lights()
    scene.camera = add_camera("court", (-8.0, 1.9, 1.75), (4.0, -0.7, 2.9), 20.0)
    add_camera("gallery", (-9.62, 0.8, 6.45), (4.0, -1.4, 3.3), 20.0)
    add_camera("arcade", (-8.0, -6.3, 1.65), (4.0, -5.2, 2.0), 22.0)
