# SPDX-License-Identifier: GPL-3.0-or-later
"""Ratios of what was timed in the same round, and how they are written."""

from __future__ import annotations

from collections.abc import Sequence

from bvh_lab.study.results import Row, spread


def ratio_text(ratios: Sequence[float]) -> str:
    """Median with quartiles."""
    low, median, high = spread(list(ratios))
    return f"{median:6.2f} [{low:.2f} {high:.2f}]"


def round_seconds(row: Row, kind: str) -> list[float]:
    """Seconds of each round over all views."""
    timed = [m for measured in row.of_kind(kind).values() for m in measured]
    return [sum(seconds) for seconds in zip(*(m.seconds for m in timed), strict=True)]


def speed_ratios(row: Row, rival: Row, kind: str) -> list[float]:
    """Speed of ``row`` over that of ``rival``, round by round."""
    pairs = zip(round_seconds(row, kind), round_seconds(rival, kind), strict=True)
    return [theirs / ours for ours, theirs in pairs]
