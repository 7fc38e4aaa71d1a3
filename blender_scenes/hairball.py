# SPDX-License-Identifier: GPL-3.0-or-later
"""The hairball: strands that wind out of a ball, hard for boxes because they bend every way.

Strands are curves with a four-sided bevel. A few tufts of strands are modelled and shown many
times, each time turned another way, so that the file stays small at any strand count.
"""

from __future__ import annotations

import math
from random import Random

import bpy
from common import (
    Shape,
    add_area,
    add_camera,
    add_material,
    add_object,
    add_sun,
    empty_scene,
    lathe,
    new_collection,
    set_world,
)
from mathutils import Matrix, Quaternion, Vector

STRANDS_PER_TUFT = 50
PIECES = 48  # of a strand, each 8 triangles
CENTRE = Vector((0.0, 0.0, 1.62))  # of the ball, whose radius is about 1 m
HAIR = {"copper": (0.62, 0.20, 0.06), "gold": (0.80, 0.50, 0.16), "umber": (0.26, 0.10, 0.05)}


def random_unit(random: Random) -> Vector:
    """Return a direction drawn evenly from the sphere."""
    z, angle = random.uniform(-1, 1), random.uniform(0, 2 * math.pi)
    r = math.sqrt(1 - z * z)
    return Vector((r * math.cos(angle), r * math.sin(angle), z))


def strand(random: Random) -> list[Vector]:
    """Return one strand: it leaves the core, winds around a random axis and curls at its tip."""
    start, axis = random_unit(random), random_unit(random)
    wind, curl = random.uniform(1.0, 4.2), random.uniform(0.02, 0.07)
    turns, phase = random.uniform(2.0, 5.0), random.uniform(0, 2 * math.pi)
    reach = random.uniform(0.82, 1.08)
    points = []
    for i in range(PIECES + 1):
        t = i / PIECES
        radial = Quaternion(axis, wind * t * t) @ start
        side = axis.cross(radial).normalized()
        lift = radial.cross(side)
        angle = phase + 2 * math.pi * turns * t
        wobble = curl * t * (math.cos(angle) * side + math.sin(angle) * lift)
        points.append(radial * (0.12 + (reach - 0.12) * t**0.7) + wobble)
    return points


def make_tuft(name: str, count: int, material: str) -> bpy.types.Curve:
    """Make one curve of ``count`` strands, thinner towards their tips; the name is the seed."""
    random = Random(name)
    curve = bpy.data.curves.new(name, "CURVE")
    curve.dimensions = "3D"
    curve.bevel_depth = 0.006
    curve.bevel_resolution = 0
    curve.materials.append(bpy.data.materials[material])
    radii = [1.0 - 0.75 * (i / PIECES) ** 2 for i in range(PIECES + 1)]
    for _ in range(count):
        spline = curve.splines.new("POLY")
        spline.points.add(PIECES)
        spline.points.foreach_set("co", [c for p in strand(random) for c in (*p, 1.0)])
        spline.points.foreach_set("radius", radii)
    return curve


def add_ball(strands: int) -> None:
    """Show tufts, each turned another way, until there are exactly ``strands`` strands."""
    ball = new_collection("ball")
    random = Random(20220711)
    whole, rest = divmod(strands, STRANDS_PER_TUFT)
    kinds = list(HAIR)[: max(1, whole)]
    tufts = [make_tuft(f"tuft {kind}", STRANDS_PER_TUFT, kind) for kind in kinds] if whole else []
    for i in range(whole):
        turn = Quaternion(random_unit(random), random.uniform(0, 2 * math.pi))
        matrix = Matrix.Translation(CENTRE) @ turn.to_matrix().to_4x4()
        add_object(tufts[i % len(tufts)].name, tufts[i % len(tufts)], ball, matrix)
    if rest:
        matrix = Matrix.Translation(CENTRE)
        add_object("tuft rest", make_tuft("tuft rest", rest, "copper"), ball, matrix)


def add_studio() -> None:
    """Add a plinth, a core that hides the roots, and a backdrop that curves up behind."""
    studio = new_collection("studio")
    core = [
        (0.16 * math.sin(math.pi * i / 12), -0.16 * math.cos(math.pi * i / 12)) for i in range(13)
    ]
    lathe("core", core, 24, "umber", studio, Matrix.Translation(CENTRE))
    plinth = [(0.0, 0.0), (0.62, 0.0), (0.62, 0.08), (0.50, 0.14), (0.44, 0.46), (0.52, 0.54)]
    plinth += [(0.56, 0.56), (0.56, 0.62), (0.0, 0.62)]
    lathe("plinth", plinth, 64, "slate", studio)

    def backdrop(u: float, v: float) -> tuple[float, float, float]:
        bend, radius, depth = 0.5, 2.0, 4.0
        x = 14.0 * (2 * u - 1)
        if v < bend:
            return (x, -6.0 + (6.0 + depth - radius) * v / bend, 0.0)
        if v < 0.9:
            angle = (v - bend) / (0.9 - bend) * math.pi / 2
            return (x, depth - radius + radius * math.sin(angle), radius * (1 - math.cos(angle)))
        return (x, depth, radius + 7.0 * (v - 0.9) / 0.1)

    shape = Shape()
    shape.grid(backdrop, 2, 40, "backdrop")
    add_object("backdrop", shape, studio)


def make(strands: int) -> None:
    """Build the hairball in an empty file."""
    scene = empty_scene("hairball")
    for name, color in HAIR.items():
        add_material(name, color, roughness=0.45)
    add_material("slate", (0.10, 0.12, 0.14))
    add_material("backdrop", (0.34, 0.42, 0.45))
    add_ball(strands)
    add_studio()
    set_world((0.20, 0.23, 0.27))
    add_sun("sun", (-4.0, -5.0, 6.0), 2.2, (1.0, 0.93, 0.82), math.radians(2.0))
    add_area("key", (3.2, -3.0, 3.8), tuple(CENTRE), (2.0, 2.0), 300, (1.0, 0.95, 0.9))
    add_area("rim", (-2.6, 2.6, 3.2), tuple(CENTRE), (1.0, 2.5), 160, (0.7, 0.85, 1.0))
    scene.camera = add_camera("front", (0.0, -4.4, 1.9), (0, 0, 1.38), 38.0)
    add_camera("close", (0.95, -1.55, 2.1), (-0.1, 0.0, 1.72), 40.0)
    add_camera("above", (-1.7, -1.9, 4.4), (0.0, 0.1, 1.4), 38.0)
