# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of the city, each a collection to be shown many times.

Buildings stand on a lot of 30 x 30 m around the origin.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy
from common import Point, Shape, add_object, cable, new_collection, repeat, sagging
from mathutils import Matrix, Vector

BRIDGE_SPAN = 220.0


def quarter_turns(angle_count: int = 4) -> list[Matrix]:
    """Return the turns that carry one facade of a square building to all four."""
    return [Matrix.Rotation(2 * math.pi * i / angle_count, 4, "Z") for i in range(angle_count)]


def make_curtain_wall(name: str) -> bpy.types.Collection:
    """Make a glass tower: a core box behind mullions as long as the tower is high."""
    tower = new_collection(name, visible=False)
    half, height = 12.0, 128.0
    core = Shape()
    core.box((-half, -half, 0), (half, half, height), "glass blue")
    core.box((-half - 1.5, -half - 1.5, 0), (half + 1.5, half + 1.5, 6), "concrete")
    core.box((-6, -6, height), (6, 6, height + 7), "steel")
    core.beam((0, 0, height), (0, 0, height + 34), 0.5, "steel")
    add_object(f"{name} core", core, tower)
    for turn in quarter_turns():
        mullion = Shape()
        mullion.box((-half, -half - 0.35, 6), (-half + 0.2, -half, height), "white")
        repeat(add_object(f"{name} mullion", mullion, tower, turn), 17, (1.4875, 0, 0))
        sill = Shape()
        sill.box((-half, -half - 0.2, 6), (half, -half, 6.5), "steel")
        repeat(add_object(f"{name} sill", sill, tower, turn), 16, (0, 0, 7.6))
    return tower


def make_stepped(name: str) -> bpy.types.Collection:
    """Make a stepped stone tower with fins on every step and a copper spire."""
    tower = new_collection(name, visible=False)
    shape = Shape()
    steps = ((14.0, 0.0, 44.0), (11.0, 44.0, 82.0), (7.5, 82.0, 108.0), (4.5, 108.0, 122.0))
    for half, low, high in steps:
        shape.box((-half, -half, low), (half, half, high), "limestone")
        shape.box((-half - 0.5, -half - 0.5, high - 1), (half + 0.5, half + 0.5, high), "white")
        windows = round(half * 0.5)
        for turn in quarter_turns():
            for i in range(windows):
                x = -half + (i + 0.5) * 2 * half / windows
                add_turned_box(
                    shape,
                    turn,
                    (x - 0.55, -half - 0.05, low + 2),
                    (x + 0.55, -half, high - 3),
                    "glass bronze",
                )
                fin = x + half / windows
                add_turned_box(
                    shape,
                    turn,
                    (fin - 0.3, -half - 0.6, low),
                    (fin + 0.3, -half, high + 1),
                    "limestone",
                )
            rows = round((high - low) / 8)
            for j in range(1, rows):
                z = low + 2 + (high - low - 5) * j / rows
                add_turned_box(
                    shape, turn, (-half, -half - 0.2, z), (half, -half, z + 0.9), "limestone"
                )
    corners = [(-4, -4, 122), (4, -4, 122), (4, 4, 122), (-4, 4, 122), (0, 0, 152)]
    shape.add(corners, [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)], "copper roof")
    shape.beam((0, 0, 148), (0, 0, 166), 0.3, "steel")
    add_object(name, shape, tower)
    return tower


def add_turned_box(shape: Shape, turn: Matrix, low: Point, high: Point, material: str) -> None:
    """Append a box that is turned with its facade."""
    part = Shape()
    part.box(low, high, material)
    shape.add([turn @ Vector(v) for v in part.vertices], part.faces, material)


def make_diagrid(name: str) -> bpy.types.Collection:
    """Make a round tower inside a net of diagonal bars."""
    tower = new_collection(name, visible=False)
    shape = Shape()
    levels, around, height = 9, 12, 118.0

    def radius(v: float) -> float:
        return 12.5 * (1 - 0.45 * v * v) * (0.86 + 0.25 * math.sin(math.pi * min(1.0, v + 0.12)))

    def skin(u: float, v: float, out: float = 0.0) -> Point:
        angle = 2 * math.pi * u
        r = radius(v) + out
        return (r * math.cos(angle), r * math.sin(angle), height * v)

    shape.grid(skin, 2 * around, levels, "glass green", closed=True)
    shape.add([skin(i / 32, 1.0) for i in range(32)], [range(32)], "steel")
    for j in range(levels):
        for i in range(around):
            for lean in (-1, 1):
                foot = skin((i + 0.5 * (j % 2)) / around, j / levels, 0.35)
                head = skin((i + 0.5 * (j % 2) + 0.5 * lean) / around, (j + 1) / levels, 0.35)
                shape.beam(foot, head, 0.55, "white")
    shape.beam((0, 0, height), (0, 0, height + 20), 0.4, "steel")
    add_object(name, shape, tower)
    return tower


def make_slab(name: str) -> bpy.types.Collection:
    """Make a brick slab of flats with rows of windows and balconies as long as the slab."""
    flats = new_collection(name, visible=False)
    shape = Shape()
    shape.box((-14, -7, 0), (14, 7, 54), "brick")
    shape.box((-14.4, -7.4, 54), (14.4, 7.4, 55.2), "concrete")
    shape.box((-4, -3, 55.2), (4, 3, 59), "concrete")
    add_object(f"{name} block", shape, flats)
    for turn in (Matrix.Identity(4), Matrix.Rotation(math.pi, 4, "Z")):
        window = Shape()
        pane = [(-13.2, -7.05, 3.0), (-11.3, -7.05, 3.0), (-11.3, -7.05, 5.0), (-13.2, -7.05, 5.0)]
        window.add(pane, [(0, 1, 2, 3)], "glass blue")
        item = add_object(f"{name} window", window, flats, turn)
        repeat(item, 8, (3.5, 0, 0))
        repeat(item, 15, (0, 0, 3.4))
        pier = Shape()
        pier.box((-14.0, -8.4, 0.0), (-13.7, -7.0, 54.0), "concrete")
        repeat(add_object(f"{name} pier", pier, flats, turn), 5, (6.925, 0, 0))
        balcony = Shape()
        balcony.box((-13.7, -8.3, 2.0), (13.7, -7.0, 2.2), "concrete")
        balcony.box((-13.7, -8.3, 3.0), (13.7, -8.22, 3.08), "steel")
        repeat(add_object(f"{name} balcony", balcony, flats, turn), 15, (0, 0, 3.4))
    return flats


def make_twisted(name: str) -> bpy.types.Collection:
    """Make a tower of floor plates, each turned a little more, between four leaning columns."""
    tower = new_collection(name, visible=False)
    shape = Shape()
    floors, rise, twist = 28, 4.6, math.radians(100)
    for i in range(floors):
        turn = Matrix.Rotation(twist * i / floors, 4, "Z")
        z = rise * i
        add_turned_box(shape, turn, (-10.5, -10.5, z), (10.5, 10.5, z + rise - 0.6), "glass bronze")
        add_turned_box(shape, turn, (-11.6, -11.6, z + rise - 0.6), (11.6, 11.6, z + rise), "white")
        following = Matrix.Rotation(twist * (i + 1) / floors, 4, "Z")
        for corner in ((-11.3, -11.3), (11.3, -11.3), (11.3, 11.3), (-11.3, 11.3)):
            foot, head = turn @ Vector((*corner, z)), following @ Vector((*corner, z + rise))
            shape.beam(tuple(foot), tuple(head), 0.7, "white")
        for k in (-1, 1):
            for side in turn, turn @ Matrix.Rotation(math.pi / 2, 4, "Z"):
                for face in (-10.6, 10.6):
                    foot = side @ Vector((3.6 * k, face, z))
                    head = side @ Vector((3.6 * k, face, z + rise - 0.6))
                    shape.beam(tuple(foot), tuple(head), 0.18, "steel")
    add_object(name, shape, tower)
    return tower


def make_skeleton(name: str) -> bpy.types.Collection:
    """Make a building under construction: slabs on columns, with scaffolding and its braces."""
    site = new_collection(name, visible=False)
    column = Shape()
    column.box((-11.3, -11.3, 0), (-10.7, -10.7, 44), "concrete")
    item = add_object(f"{name} columns", column, site)
    repeat(item, 5, (5.5, 0, 0))
    repeat(item, 5, (0, 5.5, 0))
    slab = Shape()
    slab.box((-12, -12, 3.6), (12, 12, 4.0), "concrete")
    repeat(add_object(f"{name} slabs", slab, site), 11, (0, 0, 4.0))
    scaffold = Shape()
    for turn in quarter_turns():
        for i in range(13):
            x = -13 + 26 * i / 12
            scaffold.beam(
                tuple(turn @ Vector((x, -13.2, 0))),
                tuple(turn @ Vector((x, -13.2, 40))),
                0.12,
                "steel",
            )
        for j in range(1, 14):
            z = 3.0 * j
            scaffold.beam(
                tuple(turn @ Vector((-13, -13.2, z))),
                tuple(turn @ Vector((13, -13.2, z))),
                0.12,
                "crane yellow",
            )
        for i in range(6):
            for lean in (0, 1):
                low = turn @ Vector((-13 + 26 * (i + lean) / 6, -13.3, 0))
                high = turn @ Vector((-13 + 26 * (i + 1 - lean) / 6, -13.3, 39))
                scaffold.beam(tuple(low), tuple(high), 0.10, "steel")
    add_object(f"{name} scaffold", scaffold, site)
    return site


BUILDINGS: tuple[tuple[str, Callable[[str], bpy.types.Collection], float], ...] = (
    ("curtain wall", make_curtain_wall, 3.0),
    ("stepped", make_stepped, 2.0),
    ("diagrid", make_diagrid, 1.0),
    ("flats", make_slab, 4.0),
    ("twisted", make_twisted, 0.8),
    ("skeleton", make_skeleton, 1.0),
)


def add_lattice(
    shape: Shape, start: Vector, end: Vector, size: float, panels: int, material: str
) -> None:
    """Append a square lattice girder: four chords of full length, and a diagonal in each panel."""
    along = (end - start).normalized()
    side = along.cross(Vector((0, 0, 1)) if abs(along.z) < 0.9 else Vector((1, 0, 0))).normalized()
    up = side.cross(along)
    offsets = [0.5 * size * (a * side + b * up) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    for i in range(4):
        shape.beam(tuple(start + offsets[i]), tuple(end + offsets[i]), 0.16, material)
        for j in range(panels):
            low, high = start.lerp(end, j / panels), start.lerp(end, (j + 1) / panels)
            first, second = offsets[i], offsets[(i + 1) % 4]
            if j % 2:
                first, second = second, first
            shape.beam(tuple(low + first), tuple(high + second), 0.09, material)


def make_crane() -> bpy.types.Collection:
    """Make a tower crane: lattice mast and jib, stays and a hanging hook."""
    crane = new_collection("crane", visible=False)
    shape = Shape()
    top = 150.0
    add_lattice(shape, Vector((0, 0, 0)), Vector((0, 0, top)), 2.0, 50, "crane yellow")
    add_lattice(shape, Vector((-16, 0, top)), Vector((52, 0, top)), 1.5, 34, "crane yellow")
    add_lattice(shape, Vector((0, 0, top)), Vector((0, 0, top + 11)), 1.0, 5, "crane yellow")
    shape.box((-16, -1.2, top - 3), (-12, 1.2, top - 0.5), "concrete")
    shape.box((0.8, -2.4, top - 2.4), (3, -0.8, top), "white")
    add_object("crane frame", shape, crane)
    peak = (0, 0, top + 11)
    stays = [[peak, (x, 0, top + 0.8)] for x in (-15, 26, 48)]
    cable("crane stays", [*stays, [(36, 0, top), (36, 0, 62)]], 0.07, "steel", 0, crane)
    return crane


def make_bridge() -> bpy.types.Collection:
    """Make a suspension bridge along Y: deck, trusses, towers, cables and hangers."""
    bridge = new_collection("bridge", visible=False)
    half, tower, deck, top = BRIDGE_SPAN / 2 + 60, 70.0, 7.0, 52.0
    shape = Shape()
    shape.box((-7, -half, deck - 0.6), (7, half, deck), "asphalt")
    for x in (-7.5, 7.5):
        for y in (-tower, tower):
            shape.box((x - 1.2, y - 1.6, -8), (x + 1.2, y + 1.6, top + 2), "bridge red")
        add_lattice(
            shape,
            Vector((x, -half, deck - 1.5)),
            Vector((x, half, deck - 1.5)),
            2.2,
            80,
            "bridge red",
        )
    for y in (-tower, tower):
        for z in (deck + 16, deck + 30, top - 1):
            shape.box((-7, y - 0.8, z), (7, y + 0.8, z + 1.8), "bridge red")
        for low, high in ((deck + 17.8, deck + 30), (deck + 31.8, top - 1)):
            shape.beam((-7, y, low), (7, y, high), 0.6, "bridge red")
            shape.beam((7, y, low), (-7, y, high), 0.6, "bridge red")
    add_object("bridge frame", shape, bridge)
    mains, hangers = [], []
    for x in (-7.5, 7.5):
        middle = sagging((x, -tower, top), (x, tower, top), top - deck - 3, 56)
        mains += [middle]
        mains += [sagging((x, s * tower, top), (x, s * half, deck), 4.0, 20) for s in (-1, 1)]
        for path in mains[-3:]:
            hangers += [[(px, py, pz), (px, py, deck)] for px, py, pz in path[1:-1]]
    cable("bridge cables", mains, 0.32, "bridge red", 1, bridge)
    cable("bridge hangers", hangers, 0.07, "steel", 0, bridge)
    return bridge


def make_lamp() -> bpy.types.Collection:
    """Make a street lamp whose arm reaches to +Y."""
    lamp = new_collection("street lamp", visible=False)
    shape = Shape()
    shape.tube([Vector((0, 0, 0)), Vector((0, 0, 8.5))], [0.12, 0.07], 6, "steel")
    shape.beam((0, 0, 8.4), (0, 2.6, 9.0), 0.1, "steel")
    shape.box((-0.2, 2.2, 8.95), (0.2, 3.1, 9.1), "white")
    add_object("street lamp", shape, lamp)
    return lamp


def make_tree(leaf: str) -> bpy.types.Collection:
    """Make a street tree of three stacked, ragged crowns."""
    tree = new_collection(f"tree {leaf}", visible=False)
    shape = Shape()
    shape.tube([Vector((0, 0, 0)), Vector((0, 0, 5))], [0.28, 0.14], 6, "bark")
    for base, size, squash in ((3.0, 2.3, 0.8), (4.6, 1.9, 0.85), (6.0, 1.2, 1.0)):

        def crown(
            u: float, v: float, base: float = base, size: float = size, squash: float = squash
        ) -> Point:
            angle = 2 * math.pi * u + 0.4 * base
            r = size * math.sin(math.pi * v) * (1 + 0.16 * math.sin(5 * angle + 9 * v + base))
            return (
                r * math.cos(angle),
                r * math.sin(angle),
                base + size * squash * (1 - math.cos(math.pi * v)),
            )

        shape.grid(crown, 8, 5, leaf, closed=True)
    add_object(f"tree {leaf}", shape, tree)
    return tree
