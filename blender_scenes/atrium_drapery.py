# SPDX-License-Identifier: GPL-3.0-or-later
"""The drapery of the atrium: curtains in the arches, sails over the court, banners."""

from __future__ import annotations

import math

import bpy
from atrium_bay import BAY, HALF_X, HALF_Y, UPPER_FLOOR
from common import (
    Point,
    Shape,
    add_instance,
    add_object,
    cable,
    mirror,
    new_collection,
    smoothstep,
    subdivide,
)
from mathutils import Matrix, Vector


def make_curtain(cloth: str) -> bpy.types.Collection:
    """Make a pair of curtains on a rod in a lower arch, each gathered to its column by a band."""
    curtain = new_collection(f"curtain {cloth}", visible=False)
    top, tie, bottom = 2.72, 1.25, 0.03

    def fold(u: float, v: float) -> Point:
        z = top + (bottom - top) * v
        # The cloth is wide at the rod, narrow at the band, and opens again below it.
        gather = smoothstep(top, tie + 0.1, z) - 0.42 * smoothstep(tie, bottom, z)
        inner = -0.03 + gather * (-0.78 - 0.12 * gather)
        outer = -1.17 + 0.10 * gather
        # Above the band the inner edge hangs in a curve, as cloth that is pulled aside does.
        droop = 0.16 * u * math.sin(math.pi * min(1.0, v / 0.56))
        depth = 0.035 + 0.035 * gather + 0.015 * math.sin(5 * u + 3 * v)
        phase = 2 * math.pi * 5.5 * u + 0.8 * math.sin(3 * v + 2 * u)
        return (outer + (inner - outer) * u, depth * math.sin(phase), z - droop)

    shape = Shape()
    shape.grid(fold, 22, 9, cloth)
    cloth_item = add_object("curtain", shape, curtain)
    subdivide(cloth_item, 1)
    mirror(cloth_item)

    band = Shape()

    def around(u: float, v: float) -> Point:
        angle = 2 * math.pi * u
        return (
            -0.99 + 0.15 * math.cos(angle),
            0.09 * math.sin(angle),
            tie - 0.03 + 0.08 * v + 0.05 * math.cos(angle),
        )

    band.grid(around, 16, 1, "gold", closed=True)
    mirror(add_object("curtain band", band, curtain))
    rod = Shape()
    rod.tube(
        [Vector((-1.25, 0, top + 0.02)), Vector((1.25, 0, top + 0.02))], [0.025, 0.025], 8, "bronze"
    )
    add_object("curtain rod", rod, curtain)
    return curtain


def add_curtains() -> None:
    """Hang curtains in some of the lower arches."""
    hung = new_collection("curtains")
    kinds = {cloth: make_curtain(f"{cloth} cloth") for cloth in ("crimson", "saffron", "teal")}
    for cloth, x, y in (
        ("teal", -1.5, HALF_Y),
        ("saffron", -4.5, -HALF_Y),
        ("crimson", 1.5, -HALF_Y),
        ("teal", 7.5, -HALF_Y),
    ):
        add_instance(kinds[cloth], hung, Matrix.Translation((x, y, 0)))
    for y in (-BAY, BAY):
        matrix = Matrix.Translation((HALF_X, y, 0)) @ Matrix.Rotation(math.pi / 2, 4, "Z")
        add_instance(kinds["saffron"], hung, matrix)


def add_sail(x: float, cloth: str, phase: float, collection: bpy.types.Collection) -> None:
    """Sling a strip of cloth across the court, gathered at its ends and hanging in the middle."""
    reach, height, sag = HALF_Y - 0.55, 7.75, 1.5

    def hang(u: float, v: float) -> Point:
        s = 2 * v - 1
        width = 0.26 + 0.50 * (1 - abs(s) ** 2.2)
        across = 2 * u - 1
        # Folds are tight at the ends; the belly of the cloth sags between its edges.
        ripple = (0.02 + 0.055 * abs(s) ** 2) * math.sin(2 * math.pi * 3 * u + phase + 1.3 * s)
        belly = -0.22 * (1 - across**2) * (1 - s**2)
        z = height - sag * (1 - s**2) + ripple + belly
        return (x + width * across + 0.10 * math.sin(2.2 * s + phase), reach * s, z)

    shape = Shape()
    shape.grid(hang, 10, 22, cloth)
    subdivide(add_object(f"sail {cloth}", shape, collection), 1)
    ropes = []
    for side in (-1, 1):
        for offset in (-0.3, 0.3):
            ropes.append(
                [
                    (x + offset * 0.9, side * reach, height),
                    (x + offset * 2.5, side * (HALF_Y + 0.1), 8.0),
                ]
            )
    cable("sail ropes", ropes, 0.012, "rope", 0, collection)


def add_banner(matrix: Matrix, cloth: str, collection: bpy.types.Collection) -> None:
    """Hang a banner with a pointed foot over the balustrade."""

    def hang(u: float, v: float) -> Point:
        across = 2 * u - 1
        length = 2.35 - 0.45 * abs(across)
        sway = 0.05 * v * math.sin(2 * math.pi * u * 1.5 + 0.6) + 0.03 * math.sin(7 * v + 2 * u) * v
        return (0.5 * across, -0.47 - sway, UPPER_FLOOR + 0.9 - length * v)

    shape = Shape()
    shape.grid(hang, 6, 10, cloth)
    subdivide(add_object(f"banner {cloth}", shape, collection, matrix), 1)
    pole = Shape()
    pole.tube([Vector((-0.6, -0.47, 5.66)), Vector((0.6, -0.47, 5.66))], [0.02, 0.02], 8, "gold")
    for x in (-0.45, 0.45):
        pole.beam((x, -0.5, 5.66), (x, 0.0, 5.6), 0.025, "bronze")
    add_object("banner pole", pole, collection, matrix)


def add_drapery() -> None:
    """Hang all drapery."""
    add_curtains()
    cloths = new_collection("cloths")
    for x, cloth, phase in (
        (-3.0, "saffron cloth", 0.3),
        (0.6, "ivory cloth", 1.7),
        (4.2, "crimson cloth", 2.9),
    ):
        add_sail(x, cloth, phase, cloths)
    for quarter, along, cloth in (
        (0, -4.5, "teal"),
        (0, 1.5, "crimson"),
        (2, 4.5, "crimson"),
        (2, -1.5, "teal"),
    ):
        turn = Matrix.Rotation(math.pi / 2 * quarter, 4, "Z")
        add_banner(turn @ Matrix.Translation((along, HALF_Y, 0)), f"{cloth} cloth", cloths)
    for y, cloth in ((-BAY, "crimson"), (0.0, "ivory"), (BAY, "crimson")):
        turn = Matrix.Rotation(-math.pi / 2, 4, "Z")
        add_banner(turn @ Matrix.Translation((y, HALF_X, 0)), f"{cloth} cloth", cloths)
