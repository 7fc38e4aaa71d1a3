# SPDX-License-Identifier: GPL-3.0-or-later
"""The architecture of the atrium: a bay, a corner and a column of its ring.

A bay spans X from column to column, with the court at -Y and the gallery at +Y; the corner has its
gallery at +X, +Y. Both are collections that only instances show.
"""

from __future__ import annotations

import math

import bpy
from common import Shape, add_object, lathe, new_collection, repeat
from mathutils import Matrix

BAY = 3.0  # width of a bay, and depth of the gallery
BAYS_X, BAYS_Y = 6, 3
HALF_X, HALF_Y = BAY * BAYS_X / 2, BAY * BAYS_Y / 2
SPRING = 2.9  # height at which the lower arches start
UPPER_FLOOR = 4.75
UPPER_SPRING = 6.75
EAVE = 8.2
ROOF_SLOPE = 0.38
ROOF_REACH = (-0.6, 3.3)  # of the roof, from the court to beyond the outer wall
COURT_FLOOR = -0.15


def add_arch(
    shape: Shape,
    centre: float,
    half_width: float,
    radius: float,
    spring: float,
    top: float,
    segments: int,
    mouldings: tuple[int, ...],
) -> None:
    """Append a wall 0.5 m thick with a round opening.

    ``mouldings`` lists the faces with a moulding around it: -1 the court's, 1 the gallery's.
    """
    half = 0.25
    angles = [math.pi * (1 - i / segments) for i in range(segments + 1)]
    ring = [(centre + radius * math.cos(a), spring + radius * math.sin(a)) for a in angles]
    for y, turn in ((-half, 1), (half, -1)):
        vertices = [(x, y, z) for x, z in ring] + [(x, y, top) for x, _ in ring]
        above = segments + 1
        faces = [(i, i + 1, above + i + 1, above + i)[::turn] for i in range(segments)]
        shape.add(vertices, faces, "limestone")
    soffit = [(x, y, z) for y in (-half, half) for x, z in ring]
    shape.add(
        soffit,
        [(i, segments + 1 + i, segments + 2 + i, i + 1) for i in range(segments)],
        "limestone",
    )
    for side in (-1, 1):
        inner, outer = sorted((centre + side * radius, centre + side * half_width))
        shape.box((inner, -half, spring), (outer, half, top), "limestone")

    section = [(0.0, 0.0), (0.0, 0.05), (0.10, 0.05), (0.13, 0.02), (0.17, 0.02), (0.19, 0.0)]
    for face in mouldings:

        def moulding(u: float, v: float, face: int = face) -> tuple[float, float, float]:
            out, lift = section[round(v * (len(section) - 1))]
            angle = math.pi * (1 - u if face < 0 else u)
            r = radius + out * min(1.0, radius / 1.2 + 0.25)
            return (
                centre + r * math.cos(angle),
                face * (half + lift),
                spring + r * math.sin(angle),
            )

        shape.grid(moulding, segments, len(section) - 1, "marble", smooth=False)


def make_column() -> bpy.types.Collection:
    """Make a lower column: turned base, fluted shaft, bell capital with two rows of leaves."""
    column = new_collection("column", visible=False)
    base = [
        (0.40, 0.1),
        (0.42, 0.14),
        (0.42, 0.19),
        (0.38, 0.23),
        (0.34, 0.25),
        (0.34, 0.29),
        (0.36, 0.32),
        (0.30, 0.37),
    ]
    lathe("column base", base, 24, "marble", column)
    bell = [
        (0.235, 2.28),
        (0.27, 2.30),
        (0.27, 2.33),
        (0.235, 2.35),
        (0.25, 2.60),
        (0.31, 2.74),
        (0.38, 2.78),
    ]
    lathe("column capital", bell, 24, "marble", column)

    shape = Shape()
    shape.box((-0.44, -0.44, 0.0), (0.44, 0.44, 0.1), "marble")
    shape.box((-0.40, -0.40, 2.78), (0.40, 0.40, 2.84), "marble")
    shape.box((-0.36, -0.36, 2.84), (0.36, 0.36, SPRING), "marble")
    flutes = 16

    def shaft(u: float, v: float) -> tuple[float, float, float]:
        ridge = round(u * flutes * 3) % 3 == 0
        radius = (0.295 - 0.055 * v**1.6) * (1.0 if ridge else 0.93)
        angle = 2 * math.pi * u
        return (radius * math.cos(angle), radius * math.sin(angle), 0.37 + 1.92 * v)

    shape.grid(shaft, flutes * 3, 4, "limestone", smooth=False, closed=True)
    for row, (count, low, high, reach) in enumerate(((8, 2.34, 2.58, 0.10), (8, 2.40, 2.74, 0.15))):
        for i in range(count):
            turn = 2 * math.pi * (i + 0.5 * row) / count

            def leaf(
                u: float,
                v: float,
                turn: float = turn,
                low: float = low,
                high: float = high,
                reach: float = reach,
            ):
                width = 0.085 * (1 - v**3) + 0.012
                curl = reach * v**3
                out = 0.25 + 0.03 * v + curl - 0.02 * abs(2 * u - 1)
                z = low + (high - low) * (v - 0.22 * max(0.0, v - 0.7) / 0.3)
                side = width * (2 * u - 1)
                return (
                    out * math.cos(turn) - side * math.sin(turn),
                    out * math.sin(turn) + side * math.cos(turn),
                    z,
                )

            shape.grid(leaf, 2, 4, "marble")
    add_object("column shaft", shape, column)
    return column


def add_upper_column(collection: bpy.types.Collection, x: float) -> None:
    """Add a slim turned column of the upper storey."""
    z = UPPER_FLOOR
    profile = [
        (0.17, 0.06),
        (0.18, 0.10),
        (0.15, 0.14),
        (0.125, 0.17),
        (0.13, 0.6),
        (0.105, 1.66),
        (0.125, 1.68),
    ]
    profile += [(0.125, 1.71), (0.105, 1.73), (0.12, 1.80), (0.17, 1.90)]
    matrix = Matrix.Translation((x, 0, z))
    lathe("upper column", profile, 12, "marble", collection, matrix)
    shape = Shape()
    shape.box((-0.20, -0.20, 0.0), (0.20, 0.20, 0.06), "marble")
    shape.box((-0.21, -0.25, 1.90), (0.21, 0.25, 2.0), "marble")
    add_object("upper column ends", shape, collection, matrix)


def add_balustrade(collection: bpy.types.Collection) -> None:
    """Add the balustrade of one bay: a rail, and turned balusters by an array."""
    z = UPPER_FLOOR
    shape = Shape()
    for x in (-0.75, 0.75):
        shape.box((x - 0.58, -0.11, z), (x + 0.58, 0.11, z + 0.1), "marble")
        shape.box((x - 0.60, -0.13, z + 0.78), (x + 0.60, 0.13, z + 0.88), "marble")
    add_object("rail", shape, collection)
    profile = [
        (0.06, 0.1),
        (0.06, 0.14),
        (0.035, 0.18),
        (0.075, 0.34),
        (0.06, 0.46),
        (0.03, 0.6),
        (0.055, 0.72),
        (0.055, 0.78),
    ]
    for x in (-0.75, 0.75):
        baluster = lathe(
            "baluster", profile, 8, "marble", collection, Matrix.Translation((x - 0.48, 0, z))
        )
        repeat(baluster, 3, (0.48, 0, 0))


def vault_height(x: float, y: float) -> float:
    """Return the groin vault over a bay, x and y in -1..1 from its middle."""
    return SPRING + BAY / 2 * math.sqrt(max(0.0, 1 - min(abs(x), abs(y)) ** 2))


def vault_sectors(pieces: int) -> list[list[tuple[float, float]]]:
    """Cut the square -1..1 into cells with edges along both diagonals, the creases of the vault."""
    steps = [-math.cos(math.pi * i / pieces) for i in range(pieces + 1)]
    cells: list[list[tuple[float, float]]] = []
    for i in range(pieces):
        for j in range(pieces):
            low_x, high_x, low_y, high_y = steps[i], steps[i + 1], steps[j], steps[j + 1]
            a, b, c, d = (low_x, low_y), (high_x, low_y), (high_x, high_y), (low_x, high_y)
            if i == j:
                cells += [[a, b, c], [a, c, d]]
            elif i + j == pieces - 1:
                cells += [[a, b, d], [b, c, d]]
            else:
                cells.append([a, b, c, d])
    return cells


def add_gallery(shape: Shape, low_x: float, low_y: float, panel: str) -> None:
    """Append floor, vault and upper floor of one gallery bay, BAY wide from ``low_x``.

    The floor starts at ``low_y``, under the arcade; ``panel`` is the material of its lozenge.
    """
    middle, middle_y = low_x + BAY / 2, (low_y + BAY) / 2
    for face in vault_sectors(12):
        shape.add(
            [(middle + x * BAY / 2, (y + 1) * BAY / 2, vault_height(x, y)) for x, y in face],
            [range(len(face))],
            "plaster",
            smooth=False,
        )
    shape.box((low_x, 0, UPPER_FLOOR - 0.15), (low_x + BAY, BAY, UPPER_FLOOR), "floor cream")
    corners = [(low_x, low_y, 0), (low_x + BAY, low_y, 0), (low_x + BAY, BAY, 0), (low_x, BAY, 0)]
    lozenge = [
        (middle, low_y + 0.3, 0),
        (low_x + BAY - 0.3, middle_y, 0),
        (middle, BAY - 0.3, 0),
        (low_x + 0.3, middle_y, 0),
    ]
    shape.add(
        corners + lozenge, [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)], "floor cream"
    )
    shape.add(lozenge, [(0, 1, 2, 3)], panel)


def add_outer_wall(shape: Shape, low_x: float, high_x: float, panel: str) -> None:
    """Append the outer wall of both storeys along X, with dado, a framed fresco above and below."""
    y = BAY
    shape.box((low_x, y, -0.15), (high_x, y + 0.3, EAVE + 1.2), "plaster")
    for floor in (0.0, UPPER_FLOOR):
        shape.box((low_x, y - 0.03, floor), (high_x, y, floor + 0.95), "dado")
        shape.box((low_x, y - 0.06, floor + 0.95), (high_x, y, floor + 1.02), "limestone")
        shape.box((low_x, y - 0.05, floor), (high_x, y, floor + 0.12), "floor slate")
        left, right, low, high = low_x + 0.65, high_x - 0.65, floor + 1.3, floor + 2.7
        shape.box((left, y - 0.02, low), (right, y, high), panel)
        for frame_low, frame_high in (
            ((left, low), (right, low + 0.08)),
            ((left, high - 0.08), (right, high)),
            ((left, low + 0.08), (left + 0.08, high - 0.08)),
            ((right - 0.08, low + 0.08), (right, high - 0.08)),
        ):
            shape.box(
                (frame_low[0], y - 0.06, frame_low[1]),
                (frame_high[0], y - 0.02, frame_high[1]),
                "marble",
            )
        if floor == 0.0:
            add_star(shape, ((left + right) / 2, y - 0.03, (low + high) / 2))


def add_star(shape: Shape, centre: tuple[float, float, float]) -> None:
    """Append the painted ornament of a fresco: a gold star in a ring."""
    x, y, z = centre

    def on_circle(radius: float, index: int) -> tuple[float, float, float]:
        angle = math.pi * index / 16
        return (x + radius * math.sin(angle), y, z + radius * math.cos(angle))

    points = [on_circle((0.40, 0.12, 0.26, 0.12)[i % 4], 2 * i) for i in range(16)]
    shape.add([centre, *points], [(0, i + 1, (i + 1) % 16 + 1) for i in range(16)], "gold")
    for radius, width in ((0.44, 0.05), (0.52, 0.015)):
        ring = [on_circle(r, i) for i in range(32) for r in (radius, radius + width)]
        faces = [(2 * i, 2 * i + 1, (2 * i + 3) % 64, (2 * i + 2) % 64) for i in range(32)]
        shape.add(ring, faces, "gold" if width > 0.02 else "ivory cloth")


def roof_point(x: float, y: float, lift: float = 0.0) -> tuple[float, float, float]:
    """Return a point on the roof plane of a bay."""
    return (x, y, EAVE + 0.08 + ROOF_SLOPE * (y + 0.6) + lift)


def add_roof(shape: Shape, low_x: float, high_x: float, corner: bool = False) -> None:
    """Append rafters, boards and barrel tiles; in a ``corner`` all end at its diagonal y = x."""
    near, far = ROOF_REACH
    tiles = round((high_x - low_x) / 0.25)
    for i in range(tiles):
        x = low_x + (i + 0.5) * (high_x - low_x) / tiles
        begin = x if corner else near

        def tile(
            u: float, v: float, x: float = x, begin: float = begin
        ) -> tuple[float, float, float]:
            angle = math.pi * (1 - u)
            return roof_point(
                x + 0.12 * math.cos(angle), begin + (far - begin) * v, 0.06 + 0.09 * math.sin(angle)
            )

        shape.grid(tile, 6, 1, "roof tile")
        if i % 2 == 0:
            shape.beam(roof_point(x, begin, -0.06), roof_point(x, BAY, -0.06), 0.11, "timber")
    low_y, high_y = (low_x, high_x) if corner else (near, near)
    edge = [(low_x, low_y), (high_x, high_y), (high_x, far), (low_x, far)]
    for lift in (0.0, 0.05):
        shape.add([roof_point(x, y, lift) for x, y in edge], [(0, 1, 2, 3)], "timber")


def add_rib(shape: Shape) -> None:
    """Append the transverse rib of the vault at the left edge of a bay."""

    def rib(u: float, v: float) -> tuple[float, float, float]:
        x, inset = ((-0.2, 0.0), (-0.2, 0.12), (0.2, 0.12), (0.2, 0.0))[round(v * 3)]
        angle = math.pi * u
        radius = BAY / 2 - inset
        return (x - BAY / 2, BAY / 2 + radius * math.cos(angle), SPRING + radius * math.sin(angle))

    shape.grid(rib, 16, 3, "limestone", smooth=False)


def make_bay(name: str, panel: str) -> bpy.types.Collection:
    """Make one bay of the ring without its lower columns."""
    bay = new_collection(name, visible=False)
    half = BAY / 2
    front = Shape()
    add_arch(front, 0.0, half, 1.2, SPRING, 4.5, 20, (-1, 1))
    front.box((-half, -0.34, 4.5), (half, 0.25, 4.6), "marble")
    front.box((-half, -0.42, 4.6), (half, 0.25, UPPER_FLOOR), "marble")
    for x in (-0.75, 0.75):
        add_arch(front, x, 0.75, 0.56, UPPER_SPRING, 7.7, 14, (-1,))
    front.box((-half, -0.30, 7.7), (half, 0.25, 7.8), "marble")
    front.box((-half, -0.42, 8.02), (half, 0.25, EAVE), "marble")
    front.box((-half, -0.26, 7.8), (half, 0.25, 8.02), "limestone")
    front.box((-half, -0.5, -0.15), (half, -0.42, -0.001), "marble")
    add_object(f"{name} front", front, bay)
    for z, depth in ((4.42, 0.08), (7.9, 0.12)):
        dentil = Shape()
        dentil.box((-0.04, -0.27 - depth, z), (0.04, -0.25, z + 0.09), "marble")
        item = add_object(f"{name} dentil", dentil, bay, Matrix.Translation((-1.4, 0, 0)))
        repeat(item, 15, (0.2, 0, 0))
    add_upper_column(bay, 0.0)
    add_upper_column(bay, -half)
    add_balustrade(bay)

    back = Shape()
    add_gallery(back, -half, -0.5, panel)
    add_outer_wall(back, -half, half, panel)
    add_roof(back, -half, half)
    add_rib(back)
    back.box((-half - 0.2, BAY - 0.14, 0.0), (-half + 0.2, BAY, SPRING), "limestone")
    back.box((-half - 0.25, BAY - 0.2, SPRING - 0.15), (-half + 0.25, BAY, SPRING), "marble")
    add_object(f"{name} back", back, bay)
    return bay


def make_corner() -> bpy.types.Collection:
    """Make a corner of the ring: the pier at its inner edge, and the gallery square at +X, +Y."""
    corner = new_collection("corner", visible=False)
    pier = Shape()
    pier.box((-0.52, -0.52, -0.15), (0.52, 0.52, 0.3), "marble")
    pier.box((-0.33, -0.33, 0.3), (0.33, 0.33, EAVE), "limestone")
    for z in (SPRING - 0.15, UPPER_SPRING - 0.12):
        pier.box((-0.39, -0.39, z), (0.39, 0.39, z + 0.14), "marble")
    add_object("pier", pier, corner)
    shape = Shape()
    add_gallery(shape, 0.0, 0.0, "floor rose")
    add_object("corner gallery", shape, corner)
    for flip in (1, -1):
        side = Shape()
        add_outer_wall(side, 0.0, BAY + 0.3, "fresco red")
        add_roof(side, 0.0, BAY, corner=True)
        matrix = (
            Matrix.Identity(4)
            if flip == 1
            else Matrix(((0, 1, 0, 0), (1, 0, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)))
        )
        add_object("corner wall", side, corner, matrix)
    return corner
