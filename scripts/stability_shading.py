# SPDX-License-Identifier: GPL-3.0-or-later
"""Shading hard cases: the rays that the path tracer sends from surfaces, counted where exact
geometry says what they must do.

``run(core, size, seconds)`` gives one row for each case. A *self-hit* is a secondary or shadow ray
that leaves a flat or convex surface outwards and meets something all the same; a *leak* is a ray
that gets out of a closed surface, or light seen where there is none. Both are counted on the very
rays that rendering traces (`core.path_rays`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

MISS = 0xFFFFFFFF
WINDOW = (-1.0, 1.0, -1.0, 1.0)
# Where the scene is put: edge length 2 * scale, moved along (1, 0.7, -0.4) * distance.
PLACES = [(1.0, 10.0**k) for k in range(3, 8)] + [(10.0**k, 0.0) for k in (-6, -3, 0, 3, 6)]

Row = dict[str, Any]


@dataclass
class Shot:
    """A scene with what its rays must do."""

    case: str
    what: str
    vertices: np.ndarray
    triangles: np.ndarray
    camera: Any
    lights: list[Any] = field(default_factory=list)
    world: float = 0.0
    materials: list[Any] = field(default_factory=list)
    material_index: np.ndarray | None = None
    normals: np.ndarray | None = None
    # What is counted: "convex", "closed", "black" (radiance where none may be) or "lit" (value).
    rule: str = "black"
    light: float | None = None  # the exact radiance of every pixel, where there is one


# --- shapes --------------------------------------------------------------------------------------


def rotation(random: np.random.Generator) -> np.ndarray:
    """A random orthogonal matrix that keeps handedness."""
    matrix, _ = np.linalg.qr(random.normal(size=(3, 3)))
    return matrix * np.sign(np.linalg.det(matrix))


def cube() -> tuple[np.ndarray, np.ndarray]:
    """Corners at ±1, 12 triangles, counter-clockwise from outside."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def icosahedron() -> tuple[np.ndarray, np.ndarray]:
    """Radius 1; its dihedral angles keep it convex when its corners are rounded to float."""
    golden = (1 + math.sqrt(5)) / 2
    corners = np.array(
        [p for a in (-1, 1) for b in (-golden, golden) for p in ((0, a, b), (a, b, 0), (b, 0, a))]
    )
    edge = 2.0
    near = np.abs(np.linalg.norm(corners[:, None] - corners[None], axis=2) - edge) < 1e-9
    triangles = []
    for a in range(12):
        for b in range(a + 1, 12):
            for c in range(b + 1, 12):
                if near[a, b] and near[b, c] and near[a, c]:
                    turn = np.linalg.det(corners[[a, b, c]]) > 0
                    triangles.append((a, b, c) if turn else (a, c, b))
    return corners / np.linalg.norm(corners[0]), np.array(triangles)


def quad(x: float, y: float, z: float) -> np.ndarray:
    """Corners of a rectangle of half sides x and y at height z, counter-clockwise from +z."""
    return np.array([(-x, -y, z), (x, -y, z), (x, y, z), (-x, y, z)])


QUAD = np.array([(0, 1, 2), (0, 2, 3)])


def placed(scale: float, distance: float) -> np.ndarray:
    return distance * np.array([1.0, 0.7, -0.4]) * (1.0 if distance else scale)


def looking(core: Any, eye: np.ndarray, towards: np.ndarray, wide: float = 1.0) -> Any:
    """A perspective camera; `wide` is the tangent of half its angle."""
    back = eye - towards
    back = back / np.linalg.norm(back)
    right = np.cross((0.3, 0.9, 0.2), back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, np.cross(back, right), back, eye], axis=1)
    return core.Camera("perspective", matrix, tuple(wide * side for side in WINDOW))


def moved(core: Any, kind: str, place: np.ndarray, color: float, **sizes: Any) -> Any:
    """A lamp at a place that shines along -Z."""
    matrix = np.eye(4)
    matrix[:3, 3] = place
    return core.Light(kind, matrix, (color,) * 3, **sizes)


# --- cases ---------------------------------------------------------------------------------------


def cases(core: Any, seed: int) -> Iterator[Shot]:
    random = np.random.default_rng(seed)
    for scale, distance in PLACES:
        yield from _of_one_place(core, random, scale, distance)
    yield from _walls(core)
    yield from _grazing(core)
    yield from _terminator(core, random)


def _of_one_place(
    core: Any, random: np.random.Generator, scale: float, distance: float
) -> Iterator[Shot]:
    """Outside of convex shapes and inside of a closed one, anywhere and of any size."""
    where = f"moved by {distance:g}" if distance else f"scaled by {scale:g}"
    offset = placed(scale, distance)
    turned = rotation(random)
    for name, shape in (("cube", cube()), ("icosahedron", icosahedron())):
        corners = scale * (shape[0] if name == "cube" else shape[0] @ turned.T) + offset
        camera = looking(core, offset + scale * np.array([2.5, -3.0, 2.0]), offset, 0.5)
        yield Shot("self-intersection", f"{name} from outside, {where}", corners, shape[1], camera,
                   world=1.0, rule="convex")  # fmt: skip
    corners = scale * (cube()[0] @ turned.T) + offset
    camera = looking(core, offset, offset + scale * turned @ np.array([1.0, 0.9, 0.8]))
    sun = moved(core, "sun", offset, 10.0, size_x=0.01)
    lamp = moved(core, "point", offset + scale * np.array([0.5, 0.4, 4.0]), 1e3 * scale**2,
                 size_x=0.1 * scale)  # fmt: skip
    yield Shot("closed box", f"lamp, sun and world outside, {where}", corners, cube()[1], camera,
               [sun, lamp], world=1.0, rule="closed")  # fmt: skip


def _walls(core: Any) -> Iterator[Shot]:
    """Two walls 1e-5 apart: relative to a scene of any size, and 0.01 mm in rooms of some metres.

    The light is between them, or behind both and the first can be seen through.
    """
    clear = core.Material([core.Component("transparent", color=(1, 1, 1))])
    grey = core.Material([core.Component()])
    glow = core.Material([core.Component()], emission=(5, 5, 5))
    sides = [(side, 1e-5 * side) for side in (1e-6, 1.0, 1e6)] + [
        (s, 1e-5) for s in (1.0, 4.0, 20.0)
    ]
    for side, gap in sides:
        half = 0.5 * side
        what = f"{side:g} wide, {gap:g} apart"
        eye = np.array([0.2, 0.1, 0.7]) * side
        camera = looking(core, eye, np.zeros(3), 0.3)
        walls = np.concatenate([quad(half, half, 0.0), quad(half, half, -gap)])
        both = np.concatenate([QUAD, QUAD + 4])
        behind = np.concatenate([walls, quad(half, half, -side)])
        yield Shot("two walls", f"decal on a wall, emitter behind: {what}", behind,
                   np.concatenate([both, QUAD + 8]), camera, materials=[clear, grey, glow],
                   material_index=np.array([0, 0, 1, 1, 2, 2], np.uint32))  # fmt: skip
        floor = quad(half, half, 0.0)[:, [0, 2, 1]] * (1, 1, -1) + (0, -half, half)
        room = np.concatenate([walls, floor])
        parts = np.concatenate([both, QUAD + 8])
        yield Shot("two walls", f"emitter behind a wall: {what}", room, parts, camera,
                   materials=[grey, glow],
                   material_index=np.array([0, 0, 1, 1, 0, 0], np.uint32))  # fmt: skip
        panel = core.Light("area", np.diag([1.0, -1.0, -1.0, 1.0]) + _at(0, 0, -gap),
                           (side**2,) * 3, size_x=side, size_y=side)  # fmt: skip
        open_room = np.concatenate([walls[:4], floor])
        yield Shot("two walls", f"area lamp behind a wall: {what}", open_room,
                   both, camera, [panel])  # fmt: skip


def _at(x: float, y: float, z: float) -> np.ndarray:
    matrix = np.zeros((4, 4))
    matrix[:3, 3] = x, y, z
    return matrix


def _grazing(core: Any) -> Iterator[Shot]:
    """A plane under a sun near the horizon: nothing shadows it; E cos / pi is what it sends."""
    for scale, distance in ((1.0, 0.0), (1.0, 1e5), (1e-6, 0.0), (1e6, 0.0)):
        offset = placed(scale, distance)
        for sine in (1e-1, 1e-3, 1e-5, 1e-7):
            away = np.array([math.sqrt(1 - sine * sine), 0.0, sine])
            matrix = np.eye(4)
            matrix[:3, 0] = (-sine, 0, away[0])
            matrix[:3, 1] = np.cross(away, matrix[:3, 0])
            matrix[:3, 2] = away
            yield Shot(
                "grazing light",
                f"plane of side {2 * scale:g} moved by {distance:g}, sun at sine {sine:g}",
                quad(scale, scale, 0.0) + offset, QUAD,
                looking(core, offset + scale * np.array([0.1, 0.2, 1.5]), offset, 0.2),
                [core.Light("sun", matrix, (10.0 / sine,) * 3)],
                rule="convex", light=10.0 * 0.8 / math.pi,
            )  # fmt: skip


def _terminator(core: Any, random: np.random.Generator) -> Iterator[Shot]:
    """A coarse ball shaded as if round: dark inside when the lamp is outside, and the reverse."""
    corners, triangles = icosahedron()
    for scale, distance in ((1.0, 0.0), (1e-6, 0.0), (1e6, 0.0), (1.0, 1e3), (1.0, 1e5)):
        offset = placed(scale, distance)
        turned = corners @ rotation(random).T
        where = f"size {2 * scale:g} moved by {distance:g}"
        inside = moved(core, "point", offset + scale * np.array([0.1, 0.2, 0.3]), scale**2)
        outside = moved(core, "point", offset + scale * np.array([1.0, 2.0, 3.0]), scale**2)
        from_inside = looking(
            core, offset - 0.2 * scale, offset + scale * np.array([1.0, 2.0, 3.0])
        )
        from_outside = looking(core, offset + scale * np.array([2.0, 3.0, 1.0]), offset, 0.4)
        for what, lamp, camera in (
            ("seen from inside, lit from outside", outside, from_inside),
            ("seen from outside, lit from inside", inside, from_outside),
        ):
            yield Shot("terminator", f"smooth icosahedron {what}, {where}", scale * turned + offset,
                       triangles, camera, [lamp], normals=turned[triangles])  # fmt: skip


# --- counting ------------------------------------------------------------------------------------


def measure(core: Any, shot: Shot, side: int, seed: int) -> Row:
    """Trace one sample of side x side pixels and count what must not be."""
    mesh = core.Mesh(shot.vertices.astype(np.float32), shot.triangles.astype(np.uint32))
    materials = shot.materials or [core.Material([core.Component()])]
    index = shot.material_index
    if index is None:
        index = np.zeros(len(shot.triangles), np.uint32)
    normals = None if shot.normals is None else shot.normals.astype(np.float32)
    scene = core.Scene(mesh, materials, index, shot.lights, core.World((shot.world,) * 3),
                       normals=normals)  # fmt: skip
    bvh = core.build(mesh, "sah", branching=2)
    rays = core.path_rays(bvh, scene, shot.camera, side, side, depth=3, seed=seed, sample=1)
    row: Row = {"case": shot.case, "what": shot.what, "rays": 0, "self_hits": 0, "leaks": 0,
                "light_error": math.nan}  # fmt: skip
    for origins, directions in rays.secondary:
        hit = core.trace(bvh, origins, directions).triangle != MISS
        row["rays"] += len(hit)
        _count(row, shot.rule, hit)
    for origins, directions, t_max in rays.shadow:
        hit = core.trace(bvh, origins, directions, t_max=t_max, any_hit=True).occluded
        row["rays"] += len(hit)
        _count(row, shot.rule, hit)
    if shot.rule == "black" or shot.light is not None:
        picture = core.render(bvh, scene, shot.camera, side, side, samples=2, depth=3, seed=seed)
        seen = picture.pixels[..., 0].astype(float)
        if shot.light is None:
            row["leaks"] += int((seen != 0).sum())
            row["light_error"] = float(np.abs(seen).max())
        else:
            row["light_error"] = float(np.abs(seen / shot.light - 1.0).max())
    return row


def _count(row: Row, rule: str, hit: np.ndarray) -> None:
    if rule == "convex":
        row["self_hits"] += int(hit.sum())
    elif rule == "closed":
        row["leaks"] += int((~hit).sum())


def run(core: Any, size: int, seconds: float, seed: int = 1) -> list[Row]:
    """One row for each case: its worst of as many rounds as fit into ``seconds``, at least one.

    ``size`` is the side of the pictures in pixels. Rows have ``case``, ``what``, ``rays``,
    ``self_hits`` and ``leaks`` (rays; where light is seen that cannot be: pixels), summed over the
    rounds, and ``light_error``, the worst of the rounds: relative to the exact radiance, or the
    radiance itself where it must be 0; NaN where only rays are counted.
    """
    end = time.monotonic() + seconds
    rows: dict[str, Row] = {}
    merge: list[tuple[str, Callable[[Any, Any], Any]]] = [
        ("rays", lambda a, b: a + b), ("self_hits", lambda a, b: a + b),
        ("leaks", lambda a, b: a + b), ("light_error", max),
    ]  # fmt: skip
    while not rows or time.monotonic() < end:
        for shot in cases(core, seed):
            row = measure(core, shot, size, seed)
            known = rows.setdefault(f"{shot.case}: {shot.what}", row)
            if known is not row:
                known.update({name: how(known[name], row[name]) for name, how in merge})
        seed += 1
    return list(rows.values())


def main() -> None:
    """Print the table."""
    from bvh_lab.native import core

    for row in run(core, 128, 0.0):
        print(
            f"{row['case']:18} {row['what']:70} {row['rays']:8} {row['self_hits']:7} "
            f"{row['leaks']:7} {row['light_error']:.2g}"
        )


if __name__ == "__main__":
    main()
