# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed against error of the precision choices: the data of the figure, from a study's rows."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields

import numpy as np

from .precision import CONSERVATIVE, FULL, WATERTIGHT, tests_in_words
from .results import KINDS, Result, Row, ratio


@dataclass(frozen=True)
class PrecisionPoint:
    """A choice of layout and tests over all ``trees`` measured with it.

    ``speed`` is relative to the default choice on the same tree, rays and order of rays:
    the geometric mean over trees and kinds of ray, ``speed_low`` and ``speed_high`` the least and
    the most. ``wrong`` of ``rays`` were answered otherwise than by the default, exact ties apart.
    ``t_ulps_*`` are those of `Accuracy`: of the medians the median, of the others the largest; None
    where nothing was judged.
    """

    layout: str
    triangle_test: str
    box_test: str
    trees: int
    speed: float
    speed_low: float
    speed_high: float
    rays: int
    wrong: int
    t_ulps_median: float | None
    t_ulps_high: float | None
    t_ulps_largest: float | None

    @property
    def name(self) -> str:
        """In words, e.g. "Woop affine, plain boxes"."""
        return ", ".join(tests_in_words(self.triangle_test, self.box_test)) or WATERTIGHT


def precision_points(result: Result) -> list[PrecisionPoint]:
    """A point for each choice that stands beside the default one of the same tree.

    None unless several tests were measured: layouts alone do not differ in error. The default
    choice's layout is full nodes, or the row's own where those were not measured.
    """
    rows = [row for row in result.rows if row.system == "bvh_lab" and not row.error]
    if len({(row.triangle_test, row.box_test) for row in rows}) < 2:
        return []
    defaults = {_tree(row, row.layout): row for row in rows if row.exact}
    choices: dict[tuple[str, str, str], list[tuple[Row, Row]]] = {}
    for row in rows:
        default = defaults.get(_tree(row, FULL)) or defaults.get(_tree(row, row.layout))
        if default is not None:
            choice = (row.layout, row.triangle_test, row.box_test)
            choices.setdefault(choice, []).append((row, default))
    points = [_point(choice, pairs) for choice, pairs in choices.items()]
    return [point for point in points if point is not None]


def _tree(row: Row, layout: str) -> tuple[str, int, str, str, str]:
    return (row.builder, row.branching, row.reorder, row.device, layout)


def _point(choice: tuple[str, str, str], pairs: Sequence[tuple[Row, Row]]) -> PrecisionPoint | None:
    speeds = [s for row, default in pairs for kind in KINDS if (s := ratio(row, default, kind))]
    if not speeds:
        return None
    accuracies = [row.accuracy for row, _ in pairs if row.accuracy]
    return PrecisionPoint(
        *choice,
        trees=len(pairs),
        speed=math.exp(sum(math.log(speed) for speed in speeds) / len(speeds)),
        speed_low=min(speeds),
        speed_high=max(speeds),
        rays=sum(m.rays for row, _ in pairs for m in row.measurements),
        wrong=sum(row.differing_rays() or 0 for row, _ in pairs),
        t_ulps_median=float(np.median([a.t_ulps_median for a in accuracies]))
        if accuracies
        else None,
        t_ulps_high=max((a.t_ulps_high for a in accuracies), default=None),
        t_ulps_largest=max((a.t_ulps_largest for a in accuracies), default=None),
    )


def is_default(point: PrecisionPoint) -> bool:
    """Whether it is the choice that the others are relative to."""
    return (point.triangle_test, point.box_test) == (WATERTIGHT, CONSERVATIVE) and (
        point.layout == FULL
    )


def precision_csv(points: Sequence[PrecisionPoint]) -> str:
    """One line a choice, full precision."""
    out = io.StringIO()
    names = [field.name for field in fields(PrecisionPoint)]
    writer = csv.DictWriter(out, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(point) for point in points)
    return out.getvalue()
