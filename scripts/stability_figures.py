# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures of `make stability`: speed against error, and errors by hard case and choice."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from bvh_lab.study.figure_style import COLUMN, RIVAL_COLOR, drawn
from bvh_lab.study.precision_figure import TEST_COLORS
from stability_cases import EMBREE, CaseRow, SpeedRow, Variant
from stability_scenes import SceneResult
from stability_tables import by_choice, share_text

EMBREE_LABELS = dict(zip(EMBREE, ("Embree, fast", "Embree, robust"), strict=True))
FULL_WIDTH = "8"  # the width of the full layout that is drawn


def labels_of(core: Any, what: str) -> dict[str, str]:
    """Names for people by id."""
    return {entry["id"]: entry["label"] for entry in core.precisions()[what]}


# --- speed against error --------------------------------------------------------------------------


def speed_against_error(core: Any, results: Sequence[SceneResult], stem: Path) -> None:
    """A panel for each kind of ray: share of wrong answers across, speed up."""
    with drawn(stem, (COLUMN, 0.62 * COLUMN)) as figure:
        panels = figure.subplots(1, len(results), sharey=True, squeeze=False)[0]
        for panel, result in zip(panels, results, strict=True):
            _scene_panel(panel, result)
        panels[0].set_ylabel("speed / default's on the full 8-wide tree")
        figure.suptitle(f"{results[0].scene}: speed against error of the precision choices", size=9)
        handles, labels = _scene_legend(core)
        figure.legend(handles, labels, loc="outside lower center", ncols=4)


def _scene_panel(panel: Any, result: SceneResult) -> None:
    drawn_rows = [row for row in result.errors if row.variant.tree not in ("2", "4")]
    timed = {(row.variant.tree, row.variant.choice): row for row in result.speeds}
    judged = int(drawn_rows[0].errors["judged"])
    shares = [row.wrong() / judged for row in drawn_rows if row.wrong()]
    least = math.floor(math.log10(min(shares, default=1 / judged)) + 1e-9)
    most = max(math.ceil(math.log10(max(shares, default=1 / judged)) + 1e-9), least + 2)
    none = least - 1
    for row in drawn_rows:
        x = math.log10(row.wrong() / judged) if row.wrong() else none
        _draw_point(panel, x, timed[row.variant.tree, row.variant.choice])
    ticks = range(least, most + 1)
    panel.set_xticks([none, *ticks], ["none", *(share_text(10.0**tick) for tick in ticks)])
    panel.set_xlim(none - 0.5, most + 0.2)
    panel.axvspan(none - 0.5, none + 0.5, color="#F2F2F2", lw=0, zorder=0)
    panel.axhline(1.0, color="#444444", lw=0.7, ls=(0, (4, 3)), zorder=1)
    panel.set_xlabel(f"wrong answers, of {judged:,d}")
    panel.set_title(
        f"rays {result.rays}" if result.rays.startswith("at") else f"{result.rays} rays"
    )


def _style(variant: Variant) -> dict[str, Any]:
    if variant.builder in EMBREE:
        filled = variant.builder == "embree_robust"
        return {"marker": "*", "color": RIVAL_COLOR, "ms": 8, "filled": filled}
    return {
        "marker": "o" if variant.tree == FULL_WIDTH else "s",
        "color": TEST_COLORS[variant.precision.triangle_test],
        "ms": 5,
        "filled": variant.precision.box_test != "plain",
    }


def _draw_point(panel: Any, x: float, speed: SpeedRow) -> None:
    style = _style(speed.variant)
    low, median, high = speed.quartiles()
    panel.plot([x, x], [low, high], color=style["color"], lw=0.7, alpha=0.6, zorder=2)
    panel.plot(
        x,
        median,
        style["marker"],
        color=style["color"],
        mfc=style["color"] if style["filled"] else "white",
        ms=style["ms"],
        mew=1.0,
        zorder=3,
    )


def _scene_legend(core: Any) -> tuple[list[Any], list[str]]:
    from matplotlib.lines import Line2D

    def entry(color: str, marker: str, filled: bool = True, size: float = 5) -> Any:
        face = color if filled else "white"
        return Line2D([], [], ls="none", marker=marker, color=color, mfc=face, ms=size)

    tests, layouts = labels_of(core, "triangle_test"), labels_of(core, "layout")
    handles = [entry(TEST_COLORS[test], "o") for test in tests]
    names = list(tests.values())
    for box, label in labels_of(core, "box_test").items():
        handles.append(entry("#777777", "o", box != "plain"))
        names.append(f"boxes: {label}")
    for marker, label in zip("os", layouts.values(), strict=True):
        handles.append(entry("#777777", marker))
        names.append(f"nodes: {label}")
    handles += [entry(RIVAL_COLOR, "*", name == "embree_robust", 8) for name in EMBREE]
    return handles, [*names, *EMBREE_LABELS.values()]


# --- errors by case -------------------------------------------------------------------------------


def errors_by_case(
    core: Any,
    rows: Sequence[CaseRow],
    groups: dict[str, str],
    share: Callable[[CaseRow], float],
    title: str,
    stem: Path,
) -> None:
    """A field for each case and pair of tests: the largest share of wrong answers of all trees.

    ``groups``: the group of each case; ``share``: what is wrong of a row's judged rays.
    """
    cases = list(dict.fromkeys(row.case for row in rows))
    choices = list(by_choice(rows))
    shares = np.zeros((len(cases), len(choices)))
    for row, case in enumerate(cases):
        named = by_choice([r for r in rows if r.case == case])
        shares[row] = [max(map(share, named.get(choice, [])), default=0.0) for choice in choices]
    with drawn(stem, (COLUMN, 1.2 + 0.15 * len(cases))) as figure:
        panel = figure.subplots()
        with np.errstate(divide="ignore"):
            field = np.ma.masked_invalid(np.where(shares > 0, np.log10(shares), np.nan))
        panel.imshow(field, aspect="auto", cmap="YlOrRd", vmin=-5.5, vmax=0.3)
        for y, line in enumerate(shares):
            for x, value in enumerate(line):
                color = "white" if value > 0.1 else "#222222" if value else "#AAAAAA"
                text = share_text(value) if value else "·"
                panel.text(x, y, text, ha="center", va="center", size=6.5, color=color)
        panel.set_xticks(range(len(choices)), [_choice_label(core, c) for c in choices], size=5.6)
        panel.xaxis.tick_top()
        panel.set_yticks(range(len(cases)), cases)
        panel.tick_params(length=0)
        panel.grid(False)
        _separate(panel, [groups[case] for case in cases])
        panel.set_title(title)


def _choice_label(core: Any, choice: str) -> str:
    """Three short lines."""
    if choice in EMBREE:
        return EMBREE_LABELS[choice].replace(", ", "\n") + "\n"
    triangle, box = choice.split("/")
    label = labels_of(core, "triangle_test")[triangle]
    for mark in ("–", ", ", " "):  # an en dash stays at the end of its line
        if mark in label:
            first, last = label.split(mark, 1)
            label = f"{first}{mark.strip()}\n{last}"
            break
    return f"{label}\n{labels_of(core, 'box_test')[box].lower()}"


def _separate(panel: Any, groups: Sequence[str]) -> None:
    """A line between groups, and the number and name of each at the right."""
    start = 0
    for i in range(1, len(groups) + 1):
        if i < len(groups) and groups[i] == groups[start]:
            continue
        if i < len(groups):
            panel.axhline(i - 0.5, color="#444444", lw=0.7)
        panel.text(
            1.01, (start + i - 1) / 2, groups[start].replace(" ", "\n", 2).replace("\n", " ", 1),
            transform=panel.get_yaxis_transform(), ha="left", va="center", size=7.0,
        )  # fmt: skip
        start = i
