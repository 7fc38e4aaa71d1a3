# SPDX-License-Identifier: GPL-3.0-or-later
"""What a reader of the result must know of how it came about, a sentence each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .devices import CPU, short_name
from .judge import picture_difference
from .plan import Plan
from .precision import width_text
from .rays import View
from .results import KINDS, Result, Row

SLOW_BUILD_SECONDS = 10.0  # a tree that takes longer is built and timed once


def iteration_notes(rows: Sequence[Row]) -> list[str]:
    """How the builders that work in iterations ended."""
    ends = {
        row.label: f"{row.label}: {row.tree.iterations} iterations, then {row.tree.ended}."
        for row in rows
        if row.tree and row.tree.ended
    }
    return list(ends.values())


def measuring_notes(plan: Plan, groups: int, slow_builds: Sequence[str]) -> list[str]:
    """Where pictures, builds and timings are not as one would expect."""
    notes = []
    if slow_builds:
        notes.append(
            f"Built and timed once, for it took more than {SLOW_BUILD_SECONDS:g} s: "
            f"{', '.join(slow_builds)}."
        )
    if plan.width:
        notes.append(
            f"Pictures are {plan.width}x{plan.height} whatever the cameras' shape: each keeps "
            "what it sees along its longer side."
        )
    if groups > 1:
        notes.append(
            "The trees do not fit in memory together: variants were measured in "
            f"{groups} groups, and only within a group were they timed interleaved."
        )
    return notes


def device_notes(result: Result, views: Sequence[View]) -> list[str]:
    """What rows of OpenCL devices are, and whether their trees are those of the cpu."""
    notes = []
    rows = [row for row in result.rows if row.system == "bvh_lab" and row.device != CPU]
    for device in dict.fromkeys(row.device for row in rows):
        built = [row for row in rows if row.device == device and row.tree]
        hosted = dict.fromkeys(row.label for row in built if row.tree_device == CPU)
        if hosted:
            notes.append(
                f"The binary trees of {', '.join(hosted)} are made by the CPU core for "
                f"{short_name(device)}, too, as in the paper."
            )
        notes += _trees_compared(result, built)
        notes += [note for view in views if (note := _pictures_compared(view, device))]
    return notes


def _pictures_compared(view: View, device: str) -> str:
    """How far a device's picture is from the cpu's; empty where one of them is missing."""
    ours, theirs = view.pictures.get(device), view.pictures.get(CPU)
    if ours is None or theirs is None:
        return ""
    difference = picture_difference(ours, theirs)
    pixels = difference.any(axis=2)
    if not pixels.any():
        return f"Picture of view {view.name}: {short_name(device)}'s is the cpu's, bit for bit."
    return (
        f"Picture of view {view.name}: {short_name(device)}'s differs from the cpu's in "
        f"{100.0 * pixels.mean():.2g}% of the pixels, by {difference.max():.2g} at most and "
        f"{difference.mean(dtype=np.float64):.2g} on average; the cpu's mean is "
        f"{theirs.mean(dtype=np.float64):.2g}. Sines, powers and the like round otherwise there."
    )


def _trees_compared(result: Result, rows: Sequence[Row]) -> list[str]:
    """Whether trees are byte for byte those of the cpu, where both were built."""
    others = {_shape(row): row for row in result.rows if row.device == CPU and row.tree}
    pairs = [(row, others[_shape(row)]) for row in rows if _shape(row) in others]
    trees = {_shape(row): (row, other) for row, other in pairs}
    different = [
        f"{row.label} {width_text(row.branching, row.layout)}"
        for row, other in trees.values()
        if row.tree and other.tree and row.tree.sha256 != other.tree.sha256
    ]
    if not trees:
        return []
    device = short_name(rows[0].device)
    if different:
        return [f"Trees of {device} that are not those of the cpu: {', '.join(different)}."]
    return [f"All {len(trees)} trees of {device} are those of the cpu, byte for byte."]


def _shape(row: Row) -> tuple[str, int, str]:
    return (row.builder, row.branching, row.layout)


def precision_notes(plan: Plan) -> list[str]:
    """What layouts and tests beyond the default mean."""
    notes = []
    if any(variant.layout == "cwbvh" for variant in plan.variants()):
        notes.append(
            "8c: the eight boxes of a node compressed to 80 bytes, rounded outwards (cwbvh, "
            "Ylitie et al. 2017), with the same hits. Its BVH cost, marked c, counts these "
            "boxes and each triangle by itself: it is not to be compared with that of other rows."
        )
    if not plan.all_exact():
        notes.append(
            "Tests other than watertight (triangles) and conservative (boxes) are float arithmetic "
            "as published, to be compared with: they may miss hits or name a wrong triangle, which "
            "stands beside their speed. What they prepare for each triangle counts in bytes per "
            "triangle, and in no time. They render no pictures: these would have their errors."
        )
    return notes


def missing_ray_notes(result: Result, views: Sequence[View]) -> list[str]:
    """Views without a kind of ray that the plan asks for."""
    notes = []
    plan = result.plan
    wanted = {"primary": True, "secondary": plan.depth > 0, "shadow": plan.shadow_rays > 0}
    for view in views:
        there = {rays.kind for rays in view.sets}
        missing = [kind for kind in KINDS if wanted[kind] and kind not in there]
        if result.reference and not result.cancelled and missing:
            kinds = " and ".join(missing)
            notes.append(
                f"View {view.name} has no {kinds} rays: nothing was hit that sends any there."
            )
    return notes
