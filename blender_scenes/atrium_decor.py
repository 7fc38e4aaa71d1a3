# SPDX-License-Identifier: GPL-3.0-or-later
"""What stands in the atrium and spans it: fountain, statues, vases, orange trees and ropes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from random import Random

import bpy
from atrium_bay import COURT_FLOOR, HALF_X, HALF_Y
from common import (
    Point,
    Shape,
    add_instance,
    add_object,
    cable,
    lathe,
    new_collection,
    sagging,
    smoothstep,
    subdivide,
)
from mathutils import Matrix, Vector


def add_fountain() -> None:
    """Build the fountain in the middle of the court: basin, two bowls, and jets as thin arcs."""
    fountain = new_collection("fountain")
    place = Matrix.Translation((0, 0, COURT_FLOOR))
    basin = [
        (1.75, 0.0),
        (1.75, 0.1),
        (1.62, 0.14),
        (1.62, 0.42),
        (1.72, 0.48),
        (1.72, 0.56),
        (1.48, 0.56),
        (1.46, 0.2),
    ]
    lathe("basin", basin, 8, "marble", fountain, place)
    stem = [
        (0.42, 0.1),
        (0.42, 0.3),
        (0.2, 0.42),
        (0.15, 0.6),
        (0.24, 0.78),
        (0.14, 0.95),
        (0.16, 1.12),
    ]
    stem += [(0.5, 1.2), (0.86, 1.36), (0.92, 1.44), (0.88, 1.45), (0.5, 1.33), (0.12, 1.30)]
    stem += [
        (0.10, 1.5),
        (0.16, 1.64),
        (0.08, 1.78),
        (0.10, 1.86),
        (0.32, 1.93),
        (0.46, 2.06),
        (0.44, 2.07),
        (0.2, 1.98),
        (0.05, 1.97),
    ]
    stem += [(0.05, 2.08), (0.12, 2.16), (0.13, 2.26), (0.06, 2.40), (0.0, 2.44)]
    lathe("bowls", stem, 32, "marble", fountain, place)
    add_water(fountain, place)
    star = Shape()
    rings = ((2.9, 0.004, ("floor slate", "floor cream")), (2.3, 0.008, ("floor rose", "marble")))
    for i in range(32):
        angles = (2 * math.pi * i / 32, 2 * math.pi * (i + 1) / 32)
        for radius, lift, materials in rings:
            edge = [(radius * math.cos(a), radius * math.sin(a), lift) for a in angles]
            star.add([(0.0, 0.0, lift), *edge], [(0, 1, 2)], materials[i % 2])
    add_object("floor star", star, fountain, place)


def rippled(radius: float, height: float) -> Callable[[float, float], Point]:
    """Return a disc of water with rings of ripples around its middle."""

    def surface(u: float, v: float) -> Point:
        r, angle = radius * v, 2 * math.pi * u
        z = height + 0.012 * math.cos(16 * r) * (1 - v)
        return (r * math.cos(angle), r * math.sin(angle), z)

    return surface


def add_water(fountain: bpy.types.Collection, place: Matrix) -> None:
    """Fill both bowls and let sixteen thin jets fall from bowl to bowl."""
    water = Shape()
    water.grid(rippled(1.47, 0.36), 32, 12, "water", closed=True)
    water.grid(rippled(0.80, 1.40), 24, 4, "water", closed=True)
    add_object("water", water, fountain, place)
    jets = []
    for i in range(16):
        angle = 2 * math.pi * i / 16
        # Start radius, start height, reach and drop of a jet; odd ones leave the lower bowl.
        start, height, reach, drop = (0.90, 1.44, 0.36, 1.04) if i % 2 else (0.45, 2.06, 0.30, 0.62)
        arc = []
        for k in range(9):
            t = k / 8
            r = start + reach * t
            z = COURT_FLOOR + height + 0.16 * t - (drop + 0.16) * t * t
            arc.append((r * math.cos(angle), r * math.sin(angle), z))
        jets.append(arc)
    cable("jets", jets, 0.010, "water", 0, fountain)


def make_statue() -> bpy.types.Collection:
    """Make a veiled figure on a pedestal: one surface with folds, and its joined arms."""
    statue = new_collection("statue", visible=False)
    shape = Shape()
    shape.box((-0.42, -0.42, 0.0), (0.42, 0.42, 0.12), "limestone")
    shape.box((-0.34, -0.34, 0.12), (0.34, 0.34, 0.86), "limestone")
    shape.box((-0.28, -0.355, 0.24), (0.28, 0.355, 0.76), "marble")
    shape.box((-0.40, -0.40, 0.86), (0.40, 0.40, 0.96), "marble")
    add_object("pedestal", shape, statue)

    figure = Shape()
    figure.grid(veiled_body, 28, 20, "marble", closed=True)
    figure.grid(veil, 14, 12, "marble")
    for side in (-1, 1):
        points = ((0.15, 0.0, 2.35), (0.27, -0.01, 2.22), (0.28, -0.08, 2.02), (0.15, -0.21, 1.98))
        points += ((0.035, -0.25, 2.10), (0.01, -0.24, 2.21))
        path = [Vector((side * x, y, z)) for x, y, z in points]
        figure.tube(path, [0.07, 0.085, 0.085, 0.075, 0.045, 0.02], 6, "marble")
    subdivide(add_object("figure", figure, statue), 1)
    return statue


# (height, half width, half depth) of the statue's figure, hem (0) to crown (1), and of its veil.
BODY = ((0.0, 0.34, 0.30), (0.04, 0.31, 0.27), (0.3, 0.25, 0.22), (0.5, 0.22, 0.19))
BODY += ((0.6, 0.205, 0.165), (0.70, 0.235, 0.175), (0.78, 0.24, 0.15), (0.815, 0.19, 0.13))
BODY += ((0.84, 0.075, 0.08), (0.87, 0.07, 0.08), (0.90, 0.09, 0.11), (0.95, 0.095, 0.12))
BODY += ((0.98, 0.07, 0.085), (1.0, 0.012, 0.015))
VEIL = ((0.62, 0.28, 0.21), (0.72, 0.275, 0.21), (0.79, 0.26, 0.18), (0.83, 0.18, 0.16))
VEIL += ((0.87, 0.135, 0.14), (0.92, 0.13, 0.15), (0.97, 0.11, 0.13), (1.01, 0.06, 0.07))
VEIL += ((1.02, 0.005, 0.005),)


def outline_at(outline: tuple[tuple[float, float, float], ...], height: float) -> Sequence[float]:
    """Return the half width and half depth of an outline at a height within it."""
    pieces = pairwise(outline)
    low, high = next((a, b) for a, b in pieces if height <= b[0] + 1e-9)
    t = (height - low[0]) / (high[0] - low[0])
    return [low[i] + (high[i] - low[i]) * t for i in (1, 2)]


def veiled_body(u: float, v: float) -> Point:
    """Return a point of the statue's robe and head: folds that fade upwards."""
    width, depth = outline_at(BODY, v)
    angle = 2 * math.pi * u
    folds = 0.10 * (1 - smoothstep(0.35, 0.8, v)) * math.sin(8 * angle + 4 * v)
    folds += 0.05 * (1 - smoothstep(0.6, 0.86, v)) * math.sin(5 * angle - 9 * v)
    x, y = width * (1 + folds) * math.cos(angle), depth * (1 + folds) * math.sin(angle)
    return (x, y, 0.96 + 1.75 * v)


def veil(u: float, v: float) -> Point:
    """Return a point of the statue's veil, open at the face (-Y)."""
    height = VEIL[0][0] + (VEIL[-1][0] - VEIL[0][0]) * v
    width, depth = outline_at(VEIL, height)
    angle = (2 * u - 1) * (2.0 - 0.35 * v)
    folds = 1 + 0.06 * (1 - v) * math.sin(10 * angle)
    return (width * folds * math.sin(angle), depth * folds * math.cos(angle), 0.96 + 1.75 * height)


def make_vase() -> bpy.types.Collection:
    """Make a tall glazed vase with gold rings."""
    vase = new_collection("vase", visible=False)
    profile = [
        (0.0, 0.0),
        (0.20, 0.0),
        (0.21, 0.04),
        (0.14, 0.10),
        (0.24, 0.28),
        (0.33, 0.50),
        (0.345, 0.66),
        (0.29, 0.84),
    ]
    profile += [(0.17, 0.98), (0.135, 1.08), (0.15, 1.18), (0.23, 1.26), (0.22, 1.27), (0.12, 1.12)]
    lathe("vase", profile, 28, "glaze", vase)
    for radius, z in ((0.355, 0.66), (0.145, 1.08)):
        ring = [(radius, z - 0.03), (radius + 0.015, z), (radius, z + 0.03)]
        lathe("vase ring", ring, 28, "gold", vase)
    for side in (-1, 1):
        handle = Shape()
        path = [
            Vector((side * r, 0, z))
            for r, z in ((0.15, 1.14), (0.30, 1.16), (0.38, 1.02), (0.36, 0.84), (0.31, 0.74))
        ]
        handle.tube(path, [0.025] * 5, 8, "gold")
        add_object("vase handle", handle, vase)
    return vase


def random_in_ball(random: Random) -> Vector:
    """Return a point drawn evenly from the unit ball."""
    while True:
        point = Vector((random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)))
        if 0.01 < point.length < 1.0:
            return point


def make_tree(seed: int) -> bpy.types.Collection:
    """Make an orange tree in a pot: folded leaves and fruit scattered in a round crown."""
    random = Random(seed)
    tree = new_collection(f"orange tree {seed}", visible=False)
    pot = [
        (0.0, 0.0),
        (0.27, 0.0),
        (0.28, 0.05),
        (0.36, 0.46),
        (0.41, 0.48),
        (0.41, 0.58),
        (0.36, 0.58),
        (0.34, 0.50),
        (0.0, 0.50),
    ]
    lathe("pot", pot, 24, "terracotta", tree)
    shape = Shape()
    crown = Vector((0, 0, 1.85))
    trunk = [
        Vector((0.0, 0, 0.48)),
        Vector((0.03, 0.02, 0.9)),
        Vector((-0.02, 0.03, 1.3)),
        Vector((0.0, 0.0, 1.7)),
    ]
    shape.tube(trunk, [0.06, 0.05, 0.045, 0.03], 8, "bark")
    for _ in range(9):
        shape.beam(
            (0, 0, 1.25 + 0.3 * random.random()),
            tuple(crown + random_in_ball(random) * 0.5),
            0.025,
            "bark",
        )
    for _ in range(380):
        centre = random_in_ball(random)
        outward = centre.normalized()
        centre = crown + 0.6 * centre
        along = (outward + 0.9 * random_in_ball(random) - Vector((0, 0, 0.25))).normalized()
        side = along.cross(random_in_ball(random)).normalized()
        lift = side.cross(along)
        size = 0.09 + 0.05 * random.random()
        tip, middle = centre + size * along, centre + 0.5 * size * along - 0.1 * size * lift
        wings = [middle + s * 0.3 * size * side + 0.12 * size * lift for s in (-1, 1)]
        shape.add(
            [tuple(p) for p in (centre, wings[0], tip, wings[1])], [(0, 1, 2), (0, 2, 3)], "leaf"
        )
    for _ in range(16):
        centre = crown + 0.57 * random_in_ball(random).normalized()

        def fruit(u: float, v: float, centre: Vector = centre) -> Point:
            a, b = 2 * math.pi * u, math.pi * v
            return tuple(
                centre
                + 0.055
                * Vector((math.cos(a) * math.sin(b), math.sin(a) * math.sin(b), -math.cos(b)))
            )

        shape.grid(fruit, 10, 6, "orange", closed=True)
    add_object("tree", shape, tree)
    return tree


def add_figures() -> None:
    """Place statues, vases and trees."""
    placed = new_collection("figures")
    statue, vase = make_statue(), make_vase()
    trees = [make_tree(seed) for seed in (1, 2)]
    for x, y, degrees in ((HALF_X + 1.7, 0.0, -90), (6.6, 2.6, -60), (6.6, -2.6, -120)):
        z = 0.0 if x > HALF_X else COURT_FLOOR
        add_instance(
            statue,
            placed,
            Matrix.Translation((x, y, z)) @ Matrix.Rotation(math.radians(degrees), 4, "Z"),
        )
    for i, (x, y) in enumerate(((-3.6, 2.9), (3.4, 2.9), (3.4, -2.9), (-3.4, -2.9))):
        matrix = Matrix.Translation((x, y, COURT_FLOOR)) @ Matrix.Rotation(1.3 * i, 4, "Z")
        add_instance(trees[i % 2], placed, matrix)
    for x, y in ((-6.0, -6.9), (0.0, -6.9), (6.0, -6.9), (-5.4, 3.1), (0.0, 3.35)):
        add_instance(
            vase, placed, Matrix.Translation((x, y, 0.0 if abs(y) > HALF_Y else COURT_FLOOR))
        )


def add_ropes() -> None:
    """Span long thin things over the court: lamp cables and two ropes of pennants, all diagonal."""
    ropes = new_collection("ropes")
    lamp = (0.0, 0.0, 5.5)
    corners = [(sx * (HALF_X - 0.4), sy * (HALF_Y - 0.4), 7.9) for sx in (-1, 1) for sy in (-1, 1)]
    cable("lamp cables", [[corner, (0, 0, 5.95)] for corner in corners], 0.014, "bronze", 0, ropes)
    place = Matrix.Translation(lamp)
    for name, turn in (
        ("ring level", (0, 0)),
        ("ring tilted", (1.1, 0.4)),
        ("ring upright", (1.5708, 1.2)),
    ):
        ring = [(0.42, -0.02), (0.45, -0.02), (0.45, 0.02), (0.42, 0.02), (0.42, -0.02)]
        spin = Matrix.Rotation(turn[1], 4, "Z") @ Matrix.Rotation(turn[0], 4, "X")
        lathe(f"lamp {name}", ring, 40, "gold", ropes, place @ spin)
    globe = [
        (0.17 * math.sin(math.pi * i / 10), -0.17 * math.cos(math.pi * i / 10)) for i in range(11)
    ]
    lathe("lamp globe", globe, 24, "lamp glass", ropes, place)

    cloths = ("crimson cloth", "ivory cloth", "teal cloth", "saffron cloth")
    for start, end in (((-8.6, 4.2, 7.4), (7.2, -4.2, 7.4)), ((-7.2, -4.2, 7.5), (8.6, 4.2, 7.5))):
        path = sagging(start, end, 1.3, 40)
        cable("pennant rope", [path], 0.012, "rope", 0, ropes)
        shape = Shape()
        for i in range(1, 39):
            a, b = Vector(path[i]), Vector(path[i + 1])
            foot = (a + b) / 2 + Vector((0.05 * math.sin(3.0 * i), 0.06 * math.cos(2.0 * i), -0.34))
            shape.add(
                [tuple(a + 0.15 * (b - a)), tuple(b + 0.15 * (a - b)), tuple(foot)],
                [(0, 1, 2)],
                cloths[i % 4],
            )
        add_object("pennants", shape, ropes)


def add_decor() -> None:
    """Furnish the atrium."""
    add_fountain()
    add_figures()
    add_ropes()
