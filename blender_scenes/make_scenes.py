# SPDX-License-Identifier: GPL-3.0-or-later
r"""Make BVH Lab's scenes: atrium, hairball, city and hard_cases.

    blender -b --factory-startup --python-exit-code 1 \
        --python blender_scenes/make_scenes.py -- atrium
    python blender_scenes/make_scenes.py hairball --strands 4000 --out scenes

The second form needs the bpy module. Only atrium.blend is committed; it is saved by Blender 3.4,
so that every later version opens it.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from pathlib import Path

import bpy

FOLDER = Path(__file__).resolve().parent
SCENES = ("atrium", "hairball", "city")  # those that `make study` takes
EVERY_SCENE = (*SCENES, "hard_cases")
DEFAULT_STRANDS = 2000
MAXIMUM_STRANDS = 100_000

sys.path.insert(0, str(FOLDER))


def make(name: str, strands: int = DEFAULT_STRANDS) -> None:
    """Build the scene ``name`` in the running Blender; whatever was open is lost."""
    maker = importlib.import_module(name)
    if name == "hairball":
        maker.make(strands)
    else:
        maker.make()
    bpy.context.view_layer.update()


def save(path: Path) -> None:
    """Save the open scene, compressed: written aside, then renamed, so that no half file stays."""
    aside = path.with_name(f".{path.stem}.partial.blend")
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(aside), compress=True, copy=True)
        os.replace(aside, path)
    finally:
        aside.unlink(missing_ok=True)


def triangle_count() -> int:
    """Return the number of evaluated triangles, instances counted each time they show."""
    graph = bpy.context.evaluated_depsgraph_get()
    counts: dict[str, int] = {}
    total = 0
    for instance in graph.object_instances:
        item = instance.object
        # A curve is listed twice: as itself, and as the mesh it evaluates to.
        if item.type != "MESH":
            continue
        if item.name_full not in counts:
            item.data.calc_loop_triangles()
            counts[item.name_full] = len(item.data.loop_triangles)
        total += counts[item.name_full]
    return total


def strand_count(text: str) -> int:
    """Parse --strands."""
    if not text.isdecimal() or not 1 <= int(text) <= MAXIMUM_STRANDS:
        message = f"{text!r} is no count of strands: give 1 to {MAXIMUM_STRANDS}"
        raise argparse.ArgumentTypeError(message)
    return int(text)


def arguments(argv: list[str]) -> argparse.Namespace:
    """Parse the arguments after Blender's own."""
    parser = argparse.ArgumentParser(prog="make_scenes.py", description="Make BVH Lab's scenes.")
    parser.add_argument("scene", nargs="?", default="atrium", choices=(*EVERY_SCENE, "all"))
    parser.add_argument(
        "--out", type=Path, default=FOLDER, help="folder for the .blend files, made where missing"
    )
    strands_help = f"strands of the hairball (default {DEFAULT_STRANDS})"
    parser.add_argument(
        "--strands", type=strand_count, default=DEFAULT_STRANDS, metavar="N", help=strands_help
    )
    return parser.parse_args(argv)


def main() -> int:
    """Make the scenes that the command line asks for; return the exit code."""
    if "--" in sys.argv:
        argv = sys.argv[sys.argv.index("--") + 1 :]
    else:
        argv = sys.argv[1:] if getattr(bpy.app, "module", False) else []
    wanted = arguments(argv)
    for name in EVERY_SCENE if wanted.scene == "all" else (wanted.scene,):
        path = wanted.out.resolve() / f"{name}.blend"
        make(name, wanted.strands)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            save(path)
        except (OSError, RuntimeError) as error:
            print(f"make_scenes.py: cannot write {path}: {str(error).strip()}", file=sys.stderr)
            return 1
        size, version = path.stat().st_size / 1e6, bpy.app.version_string
        print(f"{path}: {triangle_count()} triangles, {size:.2f} MB, saved by Blender {version}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
