# SPDX-License-Identifier: GPL-3.0-or-later
"""BVH cost against trace time, tree by tree: the data of the paper's Figure 1."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from .correlation import correlate
from .paper_tables import BASELINE, Measured
from .precision import FULL
from .results import KINDS


@dataclass(frozen=True)
class ScenePoint:
    """A tree on one scene: cost, and time of one kind of ray, both over those of LBVH there.

    LBVH has the same branching factor and the same order of rays. ``time`` is that of one ray, the
    mean over views of what it is relative to LBVH's in that view.
    """

    scene: str
    kind: str
    reordered: bool
    builder: str
    label: str
    branching: int
    cost: float
    time: float


def cost_points(measured: Measured) -> list[ScenePoint]:
    """A point for each scene, tree, kind and order of rays that LBVH was measured for, too.

    The paper shows those of binary BVHs, and no primary rays. Compressed nodes are left out: their
    cost counts boxes that are larger than the tree's.
    """
    traces = [t for t in measured.traces if t.layout == FULL]
    bases = {
        (t.scene, t.view, t.branching, t.reordered, t.kind): t
        for t in traces
        if t.builder == BASELINE
    }
    ratios: dict[tuple[str, str, bool, str, int], list[tuple[float, float]]] = {}
    for t in traces:
        if base := bases.get((t.scene, t.view, t.branching, t.reordered, t.kind)):
            place = (t.scene, t.kind, t.reordered, t.builder, t.branching)
            ratios.setdefault(place, []).append((t.cost / base.cost, base.mrays / t.mrays))
    points = []
    for (scene, kind, reordered, builder, branching), pairs in ratios.items():
        cost, time = np.mean(pairs, axis=0).tolist()
        label = measured.labels.get(builder, builder)
        points.append(ScenePoint(scene, kind, reordered, builder, label, branching, cost, time))
    return points


def correlations_text(points: Sequence[ScenePoint], branching: int = 2) -> str:
    """Correlation of cost and time for each kind of ray, with and without reordering."""
    lines = [
        f"Figure 1. Cost and trace time of {branching}-wide BVHs relative to LBVH: correlation "
        "over builders and scenes.",
        f"{'':28s}{'points':>8s}{'Pearson':>10s}{'Spearman':>10s}  least squares",
    ]
    for reordered in (False, True):
        for kind in KINDS:
            of = [
                p
                for p in points
                if (p.kind, p.reordered, p.branching) == (kind, reordered, branching)
            ]
            if not of:
                continue
            found = correlate([p.cost for p in of], [p.time for p in of])
            name = f"{kind} rays{', reordered' if reordered else ''}"
            line = "-"
            if found.slope is not None:
                line = f"time = {found.slope:.2f} cost {found.offset:+.2f}"
            lines.append(
                f"{name:28s}{found.count:8d}{_number(found.pearson):>10s}"
                f"{_number(found.spearman):>10s}  {line}"
            )
    return "\n".join(lines) + "\n"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def cost_points_csv(points: Sequence[ScenePoint]) -> str:
    """One line a point, full precision; cost and time are relative to LBVH's."""
    out = io.StringIO()
    names = [field.name for field in fields(ScenePoint)]
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([getattr(point, name) for name in names] for point in points)
    return out.getvalue()
