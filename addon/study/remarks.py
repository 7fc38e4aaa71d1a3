# SPDX-License-Identifier: GPL-3.0-or-later
"""What a reader of the result must know of how it came about, a sentence each."""

from __future__ import annotations

from collections.abc import Sequence

from .plan import Plan
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
