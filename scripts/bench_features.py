#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a feature of the renderer costs where no visible surface uses it: what specialising saves.

The scene is a .blend made plain: diffuse colours, flat, lamps and a constant world. Each variant
has one more triangle, tiny and hidden below, whose material (or corner normals) switches one
feature on for the whole scene. The renderer takes what a scene does not need out of its loops, so
the plain scene pays for none of them; what the variants pay is what that saves. All render the same
view in turns; ratios are those to the plain scene in the same round.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from blender_scene import open_for_render
from bvh_lab.blender.extract import extract_scene
from bvh_lab.native import core
from bvh_lab.study.console import stdout_to_stderr
from bvh_lab.study.core_scene import core_camera, core_scene
from bvh_lab.study.machine import describe_machine
from bvh_lab.study.output import write_text_aside
from bvh_lab.study.results import spread
from bvh_lab.study.scene import Component, Lookup, Material, Scene, Texture, World

ATRIUM = Path(__file__).parents[1] / "blender_scenes" / "atrium.blend"
PLAIN = "as it is"
CONTROL = "a triangle more"
ALL = "all of these"
TRIANGLE_SIZE = 1e-4  # of the scene's largest side
LENS_RADIUS = 1e-6  # of the scene's largest side

# What switches a feature on: the material of the hidden triangle.
MATERIALS = {
    "textures": Material("on", [Component(color=Lookup(0))]),
    "gloss": Material("on", [Component("glossy", roughness=0.5)]),
    "transmission": Material("on", [Component("glass", roughness=0.0)]),
    "transparency": Material("on", [Component(), Component("transparent", weight=0.5)]),
    "emitters": Material("on", emission=(1e-6, 1e-6, 1e-6)),
}


@dataclass
class Contestant:
    """One variant, ready to be rendered; ``seconds`` has an entry per round."""

    name: str
    core_scene: Any
    bvh: Any
    camera: Any
    picture: np.ndarray | None = None
    seconds: list[float] = field(default_factory=list)

    @property
    def features(self) -> set[str]:
        """What the renderer is made for."""
        return {name for name, used in self.core_scene.features.items() if used}


# --- scenes --------------------------------------------------------------------------------------


def plain(scene: Scene) -> Scene:
    """The scene without textures, smooth normals, emission and the texture of its world."""
    materials = [
        Material(m.name, [Component(color=_color(c.color)) for c in m.components[:1]])
        for m in scene.materials
    ]
    world = World(scene.world.color if scene.world.texture is None else (0.5, 0.5, 0.5))
    return replace(
        scene, materials=materials, world=world, textures=[], uvs=None, normals=None, notes=[]
    )


def _color(color: Any) -> Any:
    return (0.5, 0.5, 0.5) if isinstance(color, Lookup) else color


def with_triangles(scene: Scene, materials: Sequence[Material]) -> Scene:
    """With a tiny triangle of each material below the scene's lowest corner."""
    low, high = scene.vertices.min(axis=0), scene.vertices.max(axis=0)
    size = TRIANGLE_SIZE * float((high - low).max())
    corners = size * np.array([(1.0, 1.0, -1.0), (2.0, 1.0, -1.0), (1.0, 2.0, -1.0)], np.float32)
    count, first = len(materials), len(scene.vertices)
    extra = [low + corners + (3.0 * size * i, 0.0, 0.0) for i in range(count)]
    triangles = first + np.arange(3 * count, dtype=np.uint32).reshape(count, 3)
    indices = len(scene.materials) + np.arange(count, dtype=np.uint32)
    return replace(
        scene,
        vertices=np.vstack([scene.vertices, *extra]).astype(np.float32),
        triangles=np.vstack([scene.triangles, triangles]),
        material_index=np.concatenate([scene.material_index, indices]),
        materials=[*scene.materials, *materials],
    )


def with_texture(scene: Scene) -> Scene:
    """With coordinates for all triangles and a white texture of one texel."""
    uvs = np.zeros((len(scene.triangles), 3, 2), np.float32)
    white = Texture("white", pixels=np.ones((1, 1, 3), np.float32))
    return replace(scene, textures=[white], uvs=uvs)


def with_normals(scene: Scene) -> Scene:
    """With the corner normals that flat triangles have."""
    a, b, c = (scene.vertices[scene.triangles[:, i]].astype(np.float64) for i in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(lengths > 0.0, normals / np.maximum(lengths, 1e-300), (0.0, 0.0, 1.0))
    return replace(scene, normals=np.repeat(normals[:, None], 3, axis=1).astype(np.float32))


def variants(scene: Scene) -> dict[str, Scene]:
    """Name to scene; the first is plain."""
    made = {PLAIN: scene, CONTROL: with_triangles(scene, [Material("more")])}
    made["smooth"] = with_normals(made[CONTROL])
    for name, material in MATERIALS.items():
        made[name] = with_triangles(scene, [material])
    made["textures"] = with_texture(made["textures"])
    every = with_triangles(scene, list(MATERIALS.values()))
    made[ALL] = with_normals(with_texture(every))
    return made


def contestants(scene: Scene, builder: str) -> list[Contestant]:
    """Those of `variants`, and the plain scene through a lens too small to blur."""
    found: list[Contestant] = []
    trees: dict[int, tuple[Any, Any]] = {}  # by number of triangles, which tells them apart
    view = scene.cameras[0]
    for name, variant in variants(scene).items():
        count = len(variant.triangles)
        if count not in trees:
            mesh = core.Mesh(variant.vertices, variant.triangles)
            trees[count] = mesh, core.build(mesh, builder, branching=8)
        mesh, bvh = trees[count]
        made, _ = core_scene(core, mesh, variant)
        found.append(Contestant(name, made, bvh, core_camera(core, view)))
    extent = float(np.ptp(scene.vertices, axis=0).max())
    lens = replace(view, lens_radius=LENS_RADIUS * extent, focus_distance=extent)
    first = found[0]
    found.insert(-1, Contestant("lens", first.core_scene, first.bvh, core_camera(core, lens)))
    return found


# --- measuring -----------------------------------------------------------------------------------


def measure(entries: Sequence[Contestant], settings: dict[str, Any], repeats: int) -> None:
    """Render all in turns, who begins changes; the first round warms up and keeps the pictures."""
    for repeat in range(repeats + 1):
        first = repeat % len(entries)
        for entry in [*entries[first:], *entries[:first]]:
            picture = core.render(entry.bvh, entry.core_scene, entry.camera, **settings)
            if repeat:
                entry.seconds.append(picture.seconds)
            else:
                entry.picture = picture.pixels


def ratios(entry: Contestant, base: Contestant) -> Any:
    """Median and quartiles of the seconds over those of ``base`` in the same round."""
    return spread([a / b for a, b in zip(entry.seconds, base.seconds, strict=True)])


def picture_text(entry: Contestant, base: Contestant) -> str:
    """Whether the picture is the same; where light is sampled otherwise it has other noise."""
    assert entry.picture is not None and base.picture is not None
    differing = (entry.picture != base.picture).any(axis=2).mean()
    if differing == 0.0:
        return "same bits"
    change = entry.picture.mean(dtype=np.float64) / base.picture.mean(dtype=np.float64) - 1.0
    return f"{differing:.1%} of the pixels differ, mean {change:+.2%}"


def lines_of(entries: Sequence[Contestant]) -> list[str]:
    """The table and what it comes down to."""
    base = entries[0]
    low, median, high = spread(base.seconds)
    lines = [
        f"as it is: {median:.3f} s [{low:.3f} {high:.3f}]; the others as ratios to it in the same "
        f"round, {len(base.seconds)} rounds: median [quartiles]",
        f"{'switched on':18s}{'time ratio':>20s}  picture",
    ]
    for entry in entries[1:]:
        found = ratios(entry, base)
        text = f"{found.median:.3f} [{found.low:.3f} {found.high:.3f}]"
        lines.append(f"{entry.name:18s}{text:>20s}  {picture_text(entry, base)}")
    features = [entry for entry in entries[1:] if entry.name not in (CONTROL, ALL)]
    dearest = max(features, key=lambda entry: ratios(entry, base).median)
    every = next(entry for entry in entries if entry.name == ALL)
    noise = ratios(next(entry for entry in entries if entry.name == CONTROL), base)
    lines += [
        "Where the picture is another: with gloss lamps are met by chance, too, with transmission "
        "lights on both sides of a surface count, which",
        "makes other noise; smooth and lens round otherwise.",
    ]
    lines.append(
        "What the scene does not use costs it nothing, for it is not in its loops; if it were, "
        f"{dearest.name} alone would make it take {ratios(dearest, base).median:.2f} times as long "
        f"and all together {ratios(every, base).median:.2f} times (a triangle more, which changes "
        f"no loop: {noise.median:.2f} [{noise.low:.2f} {noise.high:.2f}])."
    )
    return lines


def bench(arguments: argparse.Namespace) -> list[str]:
    """Measure and write; returns the lines."""
    width, height = arguments.resolution
    with stdout_to_stderr():
        open_for_render(arguments.scene, width, height, "", diffuse=True)
        scene = plain(extract_scene(bpy.context, "render"))
    entries = contestants(scene, arguments.builder)
    check_features(entries)
    settings = {
        "width": width,
        "height": height,
        "samples": arguments.samples,
        "depth": arguments.depth,
        "shadow_rays": 2,
    }
    measure(entries, settings, arguments.repeats)
    machine = describe_machine(core, f"bpy {bpy.app.version_string}")
    lines = [
        f"{arguments.scene.stem}, diffuse and flat ({', '.join(sorted(entries[0].features))}), "
        f"camera {scene.cameras[0].name}, {width}x{height}, {arguments.samples} samples, depth "
        f"{arguments.depth}, {arguments.builder} 8-wide; {machine.cpu}, {machine.cores} cores",
        *lines_of(entries),
    ]
    arguments.out.mkdir(parents=True, exist_ok=True)
    path = arguments.out / f"{arguments.scene.stem}_features.txt"
    write_text_aside(path, "\n".join(lines) + "\n")
    return lines


def check_features(entries: Sequence[Contestant]) -> None:
    """Each variant must have what it is named after, and the plain scene nothing of it."""
    base = entries[0].features
    for entry in entries:
        expected = {entry.name} if entry.name in ("smooth", *MATERIALS) else set()
        if not expected <= entry.features or (expected & base):
            raise RuntimeError(f"{entry.name} has the features {sorted(entry.features)}")


def size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(side) for side in text.split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no size like 160x120") from None
    return width, height


def main(words: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", nargs="?", type=Path, default=ATRIUM, help=".blend")
    parser.add_argument("--out", type=Path, default=Path("out/bench"))
    parser.add_argument("--resolution", type=size, default=(96, 72), metavar="WIDTHxHEIGHT")
    parser.add_argument("--samples", type=int, default=2)
    parser.add_argument("--depth", type=int, default=4)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--builder", default="sah")
    arguments = parser.parse_args(words)
    if arguments.repeats < 1:
        parser.error("--repeats is 1 or more")
    if not arguments.scene.is_file():
        parser.error(f"there is no file {arguments.scene}")
    print("\n".join(bench(arguments)), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
