# SPDX-License-Identifier: GPL-3.0-or-later
"""How wrong and how inexact answers are, against exact arithmetic."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass
class Errors:
    """Answers that differ from a judge's, among ``judged`` rays.

    ``wrong_triangles`` are hits on another triangle than the judge's, unless both are met at the
    same distance in exact arithmetic: such a tie is no error.
    """

    judged: int = 0
    false_misses: int = 0
    false_hits: int = 0
    wrong_triangles: int = 0

    @property
    def wrong(self) -> int:
        """Number of wrong hits of any sort."""
        return self.false_misses + self.false_hits + self.wrong_triangles

    def plus(self, other: Errors) -> Errors:
        """The errors of both samples together."""
        return Errors(
            self.judged + other.judged,
            self.false_misses + other.false_misses,
            self.false_hits + other.false_hits,
            self.wrong_triangles + other.wrong_triangles,
        )


@dataclass
class Accuracy:
    """How exact the hits on the right triangle are, over ``hits`` judged ones.

    ``t_ulps_*``: |t - exact t| in units in the last place of the exact t as a float32: their
    median, the 99.9th percentile and the largest. ``uv_*``: |u - exact u| or |v - exact v|,
    whichever is larger.
    """

    hits: int
    t_ulps_median: float
    t_ulps_high: float
    t_ulps_largest: float
    uv_median: float
    uv_largest: float

    @classmethod
    def of(
        cls, t_ulps: npt.NDArray[np.float64], uv_errors: npt.NDArray[np.float64]
    ) -> Accuracy | None:
        """From (N,) errors, one a hit; None without any."""
        if not len(t_ulps):
            return None
        median, high, largest = np.percentile(t_ulps, (50.0, 99.9, 100.0)).tolist()
        uv_median, uv_largest = np.percentile(uv_errors, (50.0, 100.0)).tolist()
        return cls(len(t_ulps), median, high, largest, uv_median, uv_largest)
