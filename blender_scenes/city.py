# SPDX-License-Identifier: GPL-3.0-or-later
"""The city: towers, cranes, cables and roads, nearly all of them long thin triangles.

Each kind of building is a collection that is shown many times: turned by quarters in the blocks of
the grid, and by the angle of the diagonal avenue beside it, where boxes fit worst. The city is an
island with its streets along X and Y and its bridges at -Y. Its parts are in city_parts.py.
"""

from __future__ import annotations

import math
from random import Random

import bpy
from city_parts import BRIDGE_SPAN, BUILDINGS, make_bridge, make_crane, make_lamp, make_tree
from common import (
    Shape,
    add_area,
    add_camera,
    add_instance,
    add_material,
    add_object,
    add_sun,
    cable,
    empty_scene,
    new_collection,
    repeat,
    sagging,
    set_world,
)
from mathutils import Matrix

BLOCKS = 8
PITCH = 80.0  # from street to street, 18 of them street
LOT = 30.0
HALF = BLOCKS * PITCH / 2
AVENUE = math.radians(31.0)
AVENUE_HALF_WIDTH = 13.0
RIVER_HALF_WIDTH = BRIDGE_SPAN / 2
RIVER_Y = -HALF - RIVER_HALF_WIDTH - 12.0

MATERIALS = {
    "concrete": (0.52, 0.50, 0.47),
    "limestone": (0.66, 0.56, 0.42),
    "brick": (0.42, 0.16, 0.10),
    "glass blue": (0.10, 0.24, 0.36),
    "glass green": (0.09, 0.26, 0.24),
    "glass bronze": (0.26, 0.15, 0.08),
    "white": (0.76, 0.76, 0.73),
    "steel": (0.34, 0.37, 0.40),
    "copper roof": (0.20, 0.44, 0.36),
    "crane yellow": (0.80, 0.46, 0.03),
    "bridge red": (0.56, 0.11, 0.06),
    "asphalt": (0.07, 0.07, 0.08),
    "pavement": (0.38, 0.37, 0.35),
    "paint": (0.75, 0.74, 0.68),
    "grass": (0.13, 0.26, 0.07),
    "leaf": (0.09, 0.22, 0.05),
    "leaf gold": (0.52, 0.30, 0.04),
    "bark": (0.14, 0.09, 0.06),
    "water": (0.07, 0.17, 0.22),
}


def distance_to_avenue(x: float, y: float) -> float:
    """Return how far a point lies from the middle of the diagonal avenue."""
    return abs(-math.sin(AVENUE) * x + math.cos(AVENUE) * y)


def along_avenue(distance: float, aside: float, z: float = 0.0) -> Matrix:
    """Return the place at a distance along the avenue and aside of it, turned with the avenue."""
    return Matrix.Rotation(AVENUE, 4, "Z") @ Matrix.Translation((distance, aside, z))


def add_ground() -> None:
    """Lay the island and its far bank, streets as strips a city long, and lane marks."""
    ground = new_collection("ground")
    shape = Shape()
    far = 6000.0

    def strip(low: tuple[float, float], high: tuple[float, float], z: float, material: str) -> None:
        corners = [
            (low[0], low[1], z),
            (high[0], low[1], z),
            (high[0], high[1], z),
            (low[0], high[1], z),
        ]
        shape.add(corners, [(0, 1, 2, 3)], material)

    bank, shore = RIVER_Y + RIVER_HALF_WIDTH, HALF + 60.0
    strip((-far, -far), (far, far), -6.0, "water")
    shape.box((-shore, bank, -8.0), (shore, shore, 0.0), "grass")
    shape.box((-far, -far, -8.0), (far, RIVER_Y - RIVER_HALF_WIDTH, 0.0), "grass")
    shape.box((-shore, bank - 1.5, -8.0), (shore, bank, 1.0), "concrete")
    strip((-HALF - 12, -HALF - 12), (HALF + 12, HALF + 12), 0.05, "pavement")
    for i in range(BLOCKS + 1):
        at = -HALF + PITCH * i
        strip((at - 6, -HALF - 10), (at + 6, HALF + 10), 0.10, "asphalt")
        strip((-HALF - 10, at - 6), (HALF + 10, at + 6), 0.12, "asphalt")
    add_object("ground", shape, ground)
    for turn in (0.0, math.pi / 2):
        dash = Shape()
        dash.box((-1.5, -0.1, 0.0), (1.5, 0.1, 0.02), "paint")
        for i in range(BLOCKS + 1):
            place = Matrix.Translation((-HALF, -HALF + PITCH * i, 0.13))
            item = add_object("dash", dash, ground, Matrix.Rotation(turn, 4, "Z") @ place)
            repeat(item, 81, (8.0, 0, 0))
    add_avenue(ground)


def add_avenue(ground: bpy.types.Collection) -> None:
    """Lay the diagonal avenue with its lines, and span tram wires over it."""
    reach = HALF / math.cos(AVENUE)
    shape = Shape()
    for half, z, material in ((AVENUE_HALF_WIDTH, 0.14, "pavement"), (9.0, 0.16, "asphalt")):
        corners = [(-reach, -half, z), (reach, -half, z), (reach, half, z), (-reach, half, z)]
        shape.add(corners, [(0, 1, 2, 3)], material)
    for aside in (-8.6, -3.1, -1.7, 1.7, 3.1, 8.6):
        shape.box((-reach, aside - 0.08, 0.16), (reach, aside + 0.08, 0.19), "paint")
    turned = Matrix.Rotation(AVENUE, 4, "Z")
    add_object("avenue road", shape, ground, turned)
    wires = []
    for aside in (-2.4, 2.4):
        for i in range(-9, 9):
            wires.append(sagging((i * 40.0, aside, 7.0), ((i + 1) * 40.0, aside, 7.0), 0.35, 8))
    for i in range(-9, 10):
        wires.append([(i * 40.0, -12.0, 7.6), (i * 40.0, 12.0, 7.6)])
    cable("tram wires", wires, 0.04, "steel", 0, ground).matrix_world = turned


def add_buildings(random: Random) -> None:
    """Fill the lots of the grid, taller towards the middle, and both sides of the avenue."""
    town = new_collection("buildings")
    kinds = [(make(name), weight) for name, make, weight in BUILDINGS]
    crane, tree = make_crane(), make_tree("leaf")
    sources, weights = [k for k, _ in kinds], [w for _, w in kinds]
    for i in range(2 * BLOCKS):
        for j in range(2 * BLOCKS):
            x = -HALF + PITCH * (i // 2 + 0.5) + (LOT / 2 + 0.5) * (1 if i % 2 else -1)
            y = -HALF + PITCH * (j // 2 + 0.5) + (LOT / 2 + 0.5) * (1 if j % 2 else -1)
            turn, stretch = random.randrange(4), random.uniform(0.75, 1.3)
            source = random.choices(sources, weights)[0]
            away = distance_to_avenue(x, y)
            if away < AVENUE_HALF_WIDTH + 34.0:
                continue
            centre = math.hypot(x, y) / HALF
            height = stretch * (1.45 - 0.75 * min(1.2, centre))
            matrix = Matrix.Translation((x, y, 0)) @ Matrix.Rotation(turn * math.pi / 2, 4, "Z")
            add_instance(source, town, matrix @ Matrix.Diagonal((1, 1, height, 1)))
            if random.random() < 0.05:
                corner = Matrix.Translation((x + 16, y + 16, 0))
                add_instance(crane, town, corner @ Matrix.Rotation(random.uniform(0, 6.28), 4, "Z"))
    for distance in range(-320, 321, 40):
        for side in (-1, 1):
            source = random.choices(sources, weights)[0]
            height = random.uniform(0.7, 1.3) * (1.5 - abs(distance) / 400)
            place = along_avenue(distance, side * (AVENUE_HALF_WIDTH + 14.5))
            add_instance(source, town, place @ Matrix.Diagonal((1, 1, height, 1)))
    for _ in range(60):
        x, y = random.uniform(-HALF, HALF), RIVER_Y - RIVER_HALF_WIDTH - random.uniform(8, 70)
        size = random.uniform(0.8, 1.6)
        add_instance(tree, town, Matrix.Translation((x, y, 0)) @ Matrix.Scale(size, 4))


def add_street_life() -> None:
    """Line the avenue with lamps and trees, and cross the river."""
    street = new_collection("street")
    lamp, tree = make_lamp(), make_tree("leaf gold")
    for i in range(-17, 18):
        for side in (-1, 1):
            place = along_avenue(i * 20.0, side * 10.6)
            add_instance(lamp, street, place @ Matrix.Rotation(0 if side < 0 else math.pi, 4, "Z"))
            tree_place = along_avenue(i * 20.0 + 10.0, side * 11.2)
            add_instance(tree, street, tree_place @ Matrix.Rotation(1.7 * i, 4, "Z"))
    bridge = make_bridge()
    add_instance(bridge, street, Matrix.Translation((0.0, RIVER_Y, 0.0)))
    diagonal = Matrix.Rotation(math.radians(24), 4, "Z")
    add_instance(bridge, street, Matrix.Translation((-250.0, RIVER_Y, 0.0)) @ diagonal)


def make() -> None:
    """Build the city in an empty file."""
    scene = empty_scene("city")
    for name, color in MATERIALS.items():
        add_material(name, color, roughness=0.3 if "glass" in name else 0.8)
    add_ground()
    add_buildings(Random(1961))
    add_street_life()
    set_world((0.50, 0.62, 0.80))
    add_sun("sun", (-6.0, -5.0, 6.0), 3.6, (1.0, 0.86, 0.66), math.radians(0.6))
    add_area("sky", (0, 0, 700), (0, 0, 0), (800, 800), 1.2e6, (0.8, 0.9, 1.0))
    scene.camera = add_camera("skyline", (-210, -680, 46), (20, 0, 62), 30.0)
    add_camera("avenue", tuple(along_avenue(-262, -4, 5).translation), (60, 38, 38), 22.0)
    add_camera("aerial", (-400, -300, 300), (20, 10, 20), 28.0)
    for camera in bpy.data.cameras:
        camera.clip_start, camera.clip_end = 0.5, 5000.0
