# SPDX-License-Identifier: GPL-3.0-or-later
"""What Meister & Bittner 2022 measured on a Radeon RX 6800 XT: Tables 1 to 4, of binary and 4-wide
trees, where ../shared/paper has them."""

from __future__ import annotations

import csv
from functools import cache

from bench_scenes import SHARED

PAPER = SHARED.parent / "paper"
SCENES = {"crytek_sponza": "CrytekSponza", "sibenik": "Sibenik", "crown": "Crown"}  # by our names

Places = dict[tuple[str, ...], float]


@cache
def _table(name: str, value: str) -> Places:
    """The numbers of a CSV file by the texts of its other columns, in lower case."""
    path = PAPER / name
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        return {
            tuple(text.lower() for column, text in line.items() if column != value): float(
                line[value]
            )
            for line in csv.DictReader(file)
        }


def _scene(name: str) -> str:
    return SCENES.get(name, "").lower()


def _kind(kind: str, ordered: bool) -> str:
    return f"{kind}_reordered" if ordered else kind


def build_ms(scene: str, builder: str) -> float | None:
    """Table 2: milliseconds of the binary tree."""
    return _table("build_time.csv", "build_ms").get((_scene(scene), builder))


def build_ratio(scene: str, builder: str) -> float | None:
    """Table 2: build time over that of LBVH, the mean over its scenes where this is not there."""
    times = _table("build_time.csv", "build_ms")
    names = [_scene(scene)] if _scene(scene) else sorted({place[0] for place in times})
    pairs = [(times.get((name, builder)), times.get((name, "lbvh"))) for name in names]
    ratios = [ours / base for ours, base in pairs if ours and base]
    return sum(ratios) / len(ratios) if ratios else None


def mrays(scene: str, branching: int, kind: str, ordered: bool, builder: str) -> float | None:
    """Tables 3 and 4: MRays/s, the mean over the views."""
    place = (_scene(scene), str(branching), _kind(kind, ordered), builder)
    return _table("trace_speed.csv", "mrays_per_s").get(place)


def speed_ratio(scene: str, branching: int, kind: str, ordered: bool, builder: str) -> float | None:
    """Speed over that of the binary LBVH without reordering.

    From Tables 3 and 4 where the scene is there, else the mean over the paper's scenes, Table 1.
    """
    if _scene(scene):
        ours = mrays(scene, branching, kind, ordered, builder)
        base = mrays(scene, 2, kind, False, "lbvh")
        if ours and base:
            return ours / base
    table = _table("relative_speed.csv", "speed_relative_to_binary_lbvh")
    return table.get((str(branching), _kind(kind, ordered), builder))
