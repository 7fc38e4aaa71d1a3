# SPDX-License-Identifier: GPL-3.0-or-later
"""Guesses of how long the parts of a study take: they weigh its progress bar, nothing else.

All are in seconds; each category's pace is corrected as soon as one of its steps was measured.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from .machine import usable_cores
from .plan import Plan
from .rays import View, most_rays
from .results import KINDS, Row
from .target_error import guessed_samples

# One binary tree and its collapse to three branching factors in full, on two cores.
BUILD_SECONDS_PER_MILLION = {
    "lbvh": 1.0,
    "hlbvh": 1.1,
    "ploc": 1.8,
    "atrbvh": 2.5,
    "prbvh": 12.0,
    "prbvh_a": 300.0,
    "prbvh_s": 25.0,
    "prbvh_sa": 400.0,
    "sah": 3.0,
    "sbvh": 9.0,
    "trbvh": 2.5,
    "hybrid": 15.0,
    "embree": 1.5,
}
COMPRESS_SECONDS_PER_MILLION = 0.9  # the collapse to compressed nodes on top
TRACE_SECONDS_PER_MILLION = 0.5
SHADING = 1.5  # what a picture takes, in times of tracing its rays
JUDGE_SECONDS_PER_TEST = 6e-9  # one brute-force ray against one triangle on one core


@dataclass(frozen=True)
class Estimate:
    """Guesses for one plan on one mesh."""

    plan: Plan
    triangles: int
    views: Sequence[View]

    def build(self, builder: str) -> float:
        """One build; ``builder`` may be "embree"."""
        seconds = BUILD_SECONDS_PER_MILLION.get(builder, 5.0)
        if builder != "embree" and "cwbvh" in self.plan.layouts:
            seconds += COMPRESS_SECONDS_PER_MILLION
        return 1e-6 * self.triangles * seconds

    def trace(self, rays: int) -> float:
        """Rays traced once."""
        return 1e-6 * rays * TRACE_SECONDS_PER_MILLION

    def view(self, view: View) -> dict[str, float]:
        """One run of all rays of a view, and one picture of it, per category.

        The rays are those that are there, or before that as many as there can be.
        """
        rays = sum(len(rays) for rays in view.sets) or sum(most_rays(view, self.plan).values())
        paths = self.plan.samples * view.width * view.height / view.rays
        return {"trace": self.trace(rays), "render": SHADING * paths * self.trace(rays)}

    def picture_sample(self, view: View) -> float:
        """One sample of each pixel of a picture."""
        return self.view(view)["render"] / self.plan.samples

    def judge(self) -> float:
        """Brute force for one kind of ray, all bounces, in one view."""
        return self.plan.judged_rays * self.triangles * JUDGE_SECONDS_PER_TEST / usable_cores()

    def measure(self, row: Row, views: Sequence[View] | None = None) -> dict[str, float]:
        """Everything that one built row takes, per category, in all views or these."""
        ours = row.system == "bvh_lab"
        runs = self.plan.repeats + (2 if ours else 1)  # warm-up, and counters for ours
        pictures = 1 if row.exact and self.plan.pictures else 0
        once = [self.view(view) for view in views or self.views]
        return {
            "trace": runs * sum(part["trace"] for part in once),
            "render": pictures * sum(part["render"] for part in once),
        }

    def planned(self, rows: Iterable[Row], builds: Iterable[str]) -> dict[str, float]:
        """The whole study, per category; ``builds`` names a builder for each tree."""
        total = {"judge": self.judge() * len(KINDS) * len(self.views)}
        if self.plan.target_error:
            total["converge"] = self.picture_sample(self.views[0]) * guessed_samples()
        for builder in builds:
            category = f"build {builder}"
            seconds = self.build(builder) * self.plan.build_repeats
            total[category] = total.get(category, 0.0) + seconds
        for row in rows:
            for category, seconds in self.measure(row).items():
                total[category] = total.get(category, 0.0) + seconds
        return total
