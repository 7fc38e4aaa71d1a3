# SPDX-License-Identifier: GPL-3.0-or-later
"""Hard cases for ray tracers: what each tries, and what is expected of it.

Pure generators of meshes and rays that need numpy alone; `tests/python/test_hard_cases.py` runs all
of them small, `make stability` large. Those of shading and of sums are not here: they ask more
than rays (tests/python/test_shading_accuracy.py). hard_cases_blend.py puts them into Blender.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import hard_cases_closed
import hard_cases_rays
import hard_cases_trees
import hard_cases_triangles
from hard_cases_base import Case, Problem

__all__ = ["CASES", "Case", "Problem", "case_named"]

CASES: list[Case] = sorted(
    [
        *hard_cases_closed.CASES,
        *hard_cases_triangles.CASES,
        *hard_cases_rays.CASES,
        *hard_cases_trees.CASES,
    ],
    key=lambda case: case.group,  # a stable sort: the order within a group stays
)


def case_named(name: str) -> Case:
    """The case of that name. Raises KeyError with the names there are."""
    for case in CASES:
        if case.name == name:
            return case
    raise KeyError(f"no hard case {name!r}; there are {', '.join(case.name for case in CASES)}")


def make() -> None:
    """Make the scene of the cases that can be looked at, in the running Blender."""
    import hard_cases_blend

    hard_cases_blend.make(CASES)
