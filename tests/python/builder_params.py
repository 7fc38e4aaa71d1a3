# SPDX-License-Identifier: GPL-3.0-or-later
"""Builder settings that keep tests short."""

from __future__ import annotations

ANNEALING = ("prbvh_a", "prbvh_sa")


def fast_params(builder: str) -> dict[str, float]:
    """Few iterations for the annealing builders, which would run 3000; else the defaults."""
    return {"iterations": 60.0} if builder in ANNEALING else {}
