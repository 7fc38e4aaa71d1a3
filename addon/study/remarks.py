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
