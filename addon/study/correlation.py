# SPDX-License-Identifier: GPL-3.0-or-later
"""How well one quantity tells another: the coefficients of the paper's Figure 1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Numbers = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Correlation:
    """Of ``count`` pairs (x, y); ``offset`` + ``slope`` x is the line of least squares in y.

    What the pairs do not define is None: the line where all x are equal, the coefficients where all
    x or all y are.
    """

    count: int
    pearson: float | None
    spearman: float | None
    slope: float | None
    offset: float | None


def correlate(x: Sequence[float], y: Sequence[float]) -> Correlation:
    """Pearson's and Spearman's coefficient and the line of least squares; x and y of one length."""
    if len(x) != len(y):
        raise ValueError(f"{len(x)} values cannot be correlated with {len(y)}")
    first, second = np.asarray(x, np.float64), np.asarray(y, np.float64)
    slope, offset = _line(first, second)
    return Correlation(
        len(x), _pearson(first, second), _pearson(ranks(first), ranks(second)), slope, offset
    )


def ranks(values: Numbers) -> Numbers:
    """Place of each value in ascending order, from 1; equal ones share the mean of theirs."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    return np.asarray((last - 0.5 * (counts - 1))[inverse], dtype=np.float64)


def _constant(values: Numbers) -> bool:
    return len(values) == 0 or bool((values == values[0]).all())


def _pearson(x: Numbers, y: Numbers) -> float | None:
    if _constant(x) or _constant(y):
        return None
    dx, dy = x - x.mean(), y - y.mean()
    return float((dx * dy).sum() / np.sqrt((dx * dx).sum() * (dy * dy).sum()))


def _line(x: Numbers, y: Numbers) -> tuple[float | None, float | None]:
    if _constant(x):
        return None, None
    dx = x - x.mean()
    slope = float((dx * (y - y.mean())).sum() / (dx * dx).sum())
    return slope, float(y.mean() - slope * x.mean())
