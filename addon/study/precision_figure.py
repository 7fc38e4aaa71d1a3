# SPDX-License-Identifier: GPL-3.0-or-later
"""The figure of speed against error of the precision choices.

Raises as those of the module `figures` do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .figure_style import COLUMN, drawn
from .precision import BOX_TESTS, CONSERVATIVE, LAYOUTS, TRIANGLE_TESTS
from .precision_points import PrecisionPoint

# Told apart by colour-blind eyes, too; the default is black.
TEST_COLORS = dict(zip(TRIANGLE_TESTS, ("#000000", "#EE7733", "#0077BB", "#AA4499"), strict=True))
LAYOUT_MARKERS = dict(zip(LAYOUTS, ("o", "s"), strict=True))


def speed_against_error(points: Sequence[PrecisionPoint], stem: Path, title: str) -> None:
    """Speed over share of wrong answers, and over the error of t, a dot for each choice.

    Bars of speed go from the least to the most of all trees and kinds of ray, bars of t from the
    median to the largest error. Raises ValueError without a point.
    """
    if not points:
        raise ValueError("speed against error needs at least two choices of tests")
    judged = [point for point in points if point.t_ulps_median is not None]
    panels_wide = 2 if judged else 1
    with drawn(stem, (COLUMN, 0.56 * COLUMN)) as figure:
        panels = figure.subplots(1, panels_wide, sharey=True, squeeze=False)[0]
        _wrong_panel(panels[0], points)
        if judged:
            _distance_panel(panels[1], judged)
        for panel in panels:
            panel.axhline(1.0, color="#444444", lw=0.7, ls=(0, (4, 3)), zorder=1)
        panels[0].set_ylabel("speed / that of watertight, full nodes")
        figure.suptitle(title, size=9.0)
        handles, labels = _legend(points)
        figure.legend(handles, labels, loc="outside lower center", ncols=4)


def _wrong_panel(panel: Any, points: Sequence[PrecisionPoint]) -> None:
    """A log axis whose left end is 0: a share below that of one ray cannot be told from it."""
    rays = max(point.rays for point in points)
    least = math.floor(math.log10(min(_shares(points), default=1.0 / rays)))
    most = math.ceil(math.log10(max(_shares(points), default=1.0 / rays)) + 0.01)
    most = max(most, least + 2)
    none = least - 1.0
    for point in points:
        share = math.log10(point.wrong / point.rays) if point.wrong else none
        panel.plot([share] * 2, [point.speed_low, point.speed_high], **_bar(point))
        panel.plot(share, point.speed, **_dot(point))
    ticks = list(range(least, most + 1))
    panel.set_xticks([none, *ticks], ["none", *(_percent(tick) for tick in ticks)])
    panel.set_xlim(none - 0.5, most + 0.2)
    panel.axvspan(none - 0.5, none + 0.5, color="#F2F2F2", lw=0, zorder=0)
    panel.set_xlabel(f"wrong answers, of {rays:,d} rays" if _same_rays(points) else "wrong answers")


def _shares(points: Sequence[PrecisionPoint]) -> list[float]:
    return [point.wrong / point.rays for point in points if point.wrong]


def _same_rays(points: Sequence[PrecisionPoint]) -> bool:
    return len({point.rays for point in points}) == 1


def _percent(decade: int) -> str:
    return f"{10.0 ** (decade + 2):.{max(-decade - 2, 0)}f}%"


def _distance_panel(panel: Any, points: Sequence[PrecisionPoint]) -> None:
    for point in points:
        assert point.t_ulps_median is not None and point.t_ulps_largest is not None
        errors = [max(point.t_ulps_median, 1e-3), max(point.t_ulps_largest, 1e-3)]
        panel.plot(errors, [point.speed] * 2, **_bar(point))
        panel.plot(errors[0], point.speed, **_dot(point))
        panel.plot(errors[1], point.speed, "|", color=TEST_COLORS[point.triangle_test], ms=5)
    panel.set_xscale("log")
    panel.set_xlabel("error of the distance t, ulp: median to largest")


def _bar(point: PrecisionPoint) -> dict[str, Any]:
    color = TEST_COLORS[point.triangle_test]
    return {"color": color, "lw": 0.7, "alpha": 0.6, "zorder": 2}


def _dot(point: PrecisionPoint) -> dict[str, Any]:
    """Plain boxes are rings, wide enough to show the dot of the other beneath."""
    color, filled = TEST_COLORS[point.triangle_test], point.box_test == CONSERVATIVE
    return {
        "marker": LAYOUT_MARKERS[point.layout],
        "markersize": 4.5 if filled else 7.0,
        "color": color,
        "markerfacecolor": color if filled else "none",
        "markeredgecolor": color,
        "markeredgewidth": 1.0,
        "linestyle": "none",
        "zorder": 3,
    }


def _legend(points: Sequence[PrecisionPoint]) -> tuple[list[Any], list[str]]:
    """Triangle tests by colour, then boxes by filling and layouts by shape where they differ."""
    from matplotlib.lines import Line2D

    def entry(color: str, marker: str, filled: bool = True) -> Any:
        face, size = (color, 5.0) if filled else ("none", 7.0)
        return Line2D([], [], ls="none", marker=marker, color=color, mfc=face, markersize=size)

    tests = [test for test in TRIANGLE_TESTS if any(p.triangle_test == test for p in points)]
    handles = [entry(TEST_COLORS[test], "o") for test in tests]
    labels = [TRIANGLE_TESTS[test] for test in tests]
    boxes = [box for box in BOX_TESTS if any(p.box_test == box for p in points)]
    if len(boxes) > 1:
        handles += [entry("#777777", "o", box == CONSERVATIVE) for box in boxes]
        labels += [f"{BOX_TESTS[box]} boxes" for box in boxes]
    layouts = [layout for layout in LAYOUTS if any(p.layout == layout for p in points)]
    if len(layouts) > 1:
        handles += [entry("#777777", LAYOUT_MARKERS[layout]) for layout in layouts]
        labels += [f"{LAYOUTS[layout]} nodes" for layout in layouts]
    return handles, labels
