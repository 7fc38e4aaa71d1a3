# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures of a study: each as .svg and as .png with 200 dots per inch.

All raise FigureError where matplotlib is missing, and OSError where the files cannot be written.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .correlation import correlate
from .cost_points import ScenePoint
from .figure_style import (
    BUILDER_COLORS,
    COLUMN,
    DASHES,
    MARKERS,
    RIVAL_COLOR,
    FigureError,
    builder_legend,
    display,
    draw_dot,
    draw_note,
    drawn,
    label_decades,
    legend_columns,
)
from .image_error import TARGET, Curve
from .paper_tables import BASELINE, Measured
from .precision import FULL
from .scene import Float32Array

__all__ = [
    "BuildPoint",
    "FigureError",
    "SceneViews",
    "build_against_speed",
    "build_points",
    "contact_sheet",
    "cost_against_time",
    "error_against_time",
    "residual_figure",
]


# --- Figure 1: cost against time -----------------------------------------------------------------


def cost_against_time(points: Sequence[ScenePoint], stem: Path) -> None:
    """Figure 1: a panel for each kind of ray, a row of them with and one without reordering.

    Each branching factor has its marker, its line of least squares and its coefficients. Primary
    rays are never reordered: the legend takes the place of that panel. Raises ValueError without a
    point.
    """
    kinds = list(dict.fromkeys(point.kind for point in points))
    orders = sorted({point.reordered for point in points})
    if not kinds:
        raise ValueError("Figure 1 needs at least one timed tree beside LBVH")
    shape = 0.4 if len(orders) > 1 else 0.5
    height = COLUMN * max(shape, 0.62 - 0.07 * len(kinds)) * len(orders)
    with drawn(stem, (COLUMN, height + 0.6)) as figure:
        panels = figure.subplots(len(orders), len(kinds), sharex=True, sharey=True, squeeze=False)
        grid = [
            [[p for p in points if (p.kind, p.reordered) == (kind, order)] for kind in kinds]
            for order in orders
        ]
        for row, order, of_row in zip(panels, orders, grid, strict=True):
            for panel, kind, shown in zip(row, kinds, of_row, strict=True):
                if shown:
                    _cost_panel(panel, shown)
                    panel.set_title(f"{kind} rays{', reordered' if order else ''}")
        _label_outer(panels, grid)
        least, most = panels[0, 0].get_ylim()
        panels[0, 0].set_ylim(least, most + 0.3 * (most - least))  # room for the coefficients
        labels = {point.builder: point.label for point in points}
        entries = builder_legend(labels, [point.branching for point in points])
        free = [panels[i, k] for i, row in enumerate(grid) for k, of in enumerate(row) if not of]
        for panel in free:
            panel.set_axis_off()
        if free:
            free[0].legend(*entries, loc="center", ncols=2)
        else:
            columns = legend_columns(len(entries[1]))
            figure.legend(*entries, loc="outside lower center", ncols=columns)


def _label_outer(panels: Any, grid: Sequence[Sequence[Sequence[ScenePoint]]]) -> None:
    """Axes are labelled where no panel with points is below, or on the left."""
    for i, row in enumerate(grid):
        for k in range(len(row)):
            if not any(below[k] for below in grid[i + 1 :]):
                panels[i, k].set_xlabel("BVH cost / LBVH's")
                panels[i, k].tick_params(labelbottom=True)
            if not any(row[:k]):
                panels[i, k].set_ylabel("trace time / LBVH's")
                panels[i, k].tick_params(labelleft=True)


def _cost_panel(panel: Any, points: Sequence[ScenePoint]) -> None:
    lines = [f"{'':6s}  Pearson  Spearman"]
    for branching in sorted({point.branching for point in points}):
        costs = [point.cost for point in points if point.branching == branching]
        times = [point.time for point in points if point.branching == branching]
        found = correlate(costs, times)
        if found.slope is not None and found.offset is not None:
            ends = np.array([min(costs), max(costs)])
            line = found.offset + found.slope * ends
            panel.plot(ends, line, DASHES[branching], color="#444444", lw=0.9, zorder=1)
        coefficients = f"{_coefficient(found.pearson):>7s}  {_coefficient(found.spearman):>8s}"
        lines.append(f"{branching}-wide  {coefficients}")
    for point in points:
        draw_dot(panel, point.builder, point.branching, point.cost, point.time)
    panel.text(
        0.03,
        0.98,
        "\n".join(lines),
        transform=panel.transAxes,
        va="top",
        family="monospace",
        size=6.5,
        linespacing=1.3,
    )


def _coefficient(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}".replace("-", "−")


# --- build time against speed --------------------------------------------------------------------


@dataclass(frozen=True)
class BuildPoint:
    """A tree: build time over LBVH's, and speed over that of the binary LBVH.

    Both are (least, mean, most) over scenes and views.
    """

    builder: str
    label: str
    branching: int
    build: tuple[float, float, float]
    speed: tuple[float, float, float]


def build_points(measured: Measured, kind: str) -> list[BuildPoint]:
    """Of all trees with full nodes that were timed beside LBVH, rays in the order they come."""
    base_builds = {b.scene: b.seconds for b in measured.builds if b.builder == BASELINE}
    builds: dict[str, list[float]] = {}
    for b in measured.builds:
        if base_builds.get(b.scene):
            builds.setdefault(b.builder, []).append(b.seconds / base_builds[b.scene])
    traces = [t for t in measured.traces if t.kind == kind and t.layout == FULL and not t.reordered]
    bases = {
        (t.scene, t.view): t.mrays for t in traces if (t.builder, t.branching) == (BASELINE, 2)
    }
    speeds: dict[tuple[str, int], list[float]] = {}
    for t in traces:
        if bases.get((t.scene, t.view)):
            ratio = t.mrays / bases[t.scene, t.view]
            speeds.setdefault((t.builder, t.branching), []).append(ratio)
    return [
        BuildPoint(
            builder,
            measured.labels[builder],
            branching,
            _range(builds[builder]),
            _range(ratios),
        )
        for (builder, branching), ratios in speeds.items()
        if builder in builds
    ]


def _range(values: Sequence[float]) -> tuple[float, float, float]:
    return min(values), sum(values) / len(values), max(values)


def build_against_speed(points: Sequence[BuildPoint], stem: Path, kind: str) -> None:
    """Build time (log) against speed; bars go from the least to the most of all scenes and views.

    Raises ValueError without a point.
    """
    if not points:
        raise ValueError("the figure of build times needs at least one timed tree beside LBVH")
    with drawn(stem, (COLUMN, 0.55 * COLUMN)) as figure:
        panel = figure.subplots()
        panel.set_xscale("log")
        for point in points:
            (low, build, high), (slow, speed, fast) = point.build, point.speed
            color = BUILDER_COLORS.get(point.builder, RIVAL_COLOR)
            panel.plot([low, high], [speed, speed], color=color, lw=0.6, alpha=0.5)
            panel.plot([build, build], [slow, fast], color=color, lw=0.6, alpha=0.5)
            draw_dot(panel, point.builder, point.branching, build, speed)
        label_decades(panel.xaxis)
        panel.set_xlabel("build time / LBVH's")
        panel.set_ylabel(f"speed on {kind} rays / binary LBVH's")
        labels = {point.builder: point.label for point in points}
        entries = builder_legend(labels, [point.branching for point in points])
        figure.legend(*entries, loc="outside right center")


# --- error against time --------------------------------------------------------------------------


def error_against_time(
    curves: Sequence[Curve],
    stem: Path,
    title: str,
    reference_error: float | None = None,
    target: float = TARGET,
) -> None:
    """relMSE over render seconds, both log, with the target and the reference's own error."""
    curves = [curve for curve in curves if any(point.seconds for point in curve.points)]
    if not curves:
        raise ValueError("the figure of errors needs at least one curve")
    with drawn(stem, (COLUMN, 0.62 * COLUMN)) as figure:
        panel = figure.subplots()
        for curve in curves:
            _error_curve(panel, curve)
        panel.set_xscale("log")
        panel.set_yscale("log")
        label_decades(panel.xaxis)
        label_decades(panel.yaxis)
        panel.axhline(target, color="#444444", lw=0.7, ls=(0, (4, 3)), zorder=1)
        draw_note(panel, 0.0, target, (4, 3), f"relMSE {target:g}", "left")
        if reference_error:
            low = panel.get_ylim()[0]
            if reference_error > low:
                panel.axhspan(low, reference_error, color="#EEEEEE", lw=0, zorder=0)
                panel.set_ylim(bottom=low)
                draw_note(
                    panel, 1.0, reference_error, (-4, -10), "the reference's own error", "right"
                )
        panel.set_xlabel("render time (s)")
        panel.set_ylabel("relMSE")
        panel.set_title(title)
        panel.legend(loc="upper right" if len(curves) < 9 else "best")


def _error_curve(panel: Any, curve: Curve) -> None:
    timed = [point for point in curve.points if point.seconds]
    ours = curve.system == "bvh_lab"
    color = BUILDER_COLORS.get(curve.builder, RIVAL_COLOR) if ours else RIVAL_COLOR
    seconds = [point.time.median for point in timed]
    errors = [point.errors["relMSE"] for point in timed]
    panel.plot(
        seconds,
        errors,
        DASHES.get(curve.branching, "-"),
        color=color,
        marker=MARKERS.get(curve.branching, "D"),
        markersize=3.6,
        markeredgecolor="white",
        markeredgewidth=0.3,
        lw=1.3 if ours else 1.8,
        label=curve.label,
    )
    low, high = ([point.time[i] for point in timed] for i in (0, 2))
    panel.hlines(errors, low, high, color=color, lw=0.8)


# --- Figure 2: the views -------------------------------------------------------------------------


@dataclass(frozen=True)
class SceneViews:
    """A scene's pictures: ``views`` are (camera, (H, W, 3) float32 linear)."""

    name: str
    triangles: int
    views: list[tuple[str, Float32Array]]


def contact_sheet(scenes: Sequence[SceneViews], stem: Path) -> None:
    """Figure 2: a row for each scene, a picture for each view, as sRGB clipped to [0, 1]."""
    columns = max((len(scene.views) for scene in scenes), default=0)
    if not columns:
        raise ValueError("the contact sheet needs at least one picture")
    aspects = [p.shape[0] / p.shape[1] for scene in scenes for _, p in scene.views]
    cell = COLUMN / columns
    heights = cell * float(np.median(aspects)) + 0.36
    with drawn(stem, (COLUMN, heights * len(scenes))) as figure:
        figure.get_layout_engine().set(w_pad=0.02, h_pad=0.02, wspace=0.0, hspace=0.0)
        rows = figure.subplots(len(scenes), columns, squeeze=False)
        for row, scene in zip(rows, scenes, strict=True):
            for panel in row:
                panel.set_axis_off()
            for panel, (camera, pixels) in zip(row, scene.views, strict=False):
                panel.imshow(display(pixels), interpolation="lanczos", aspect="equal")
                panel.text(
                    0.5, -0.03, camera, transform=panel.transAxes, ha="center", va="top", size=7.5
                )
            row[0].set_title(
                f"{scene.name}, {scene.triangles:,} triangles".replace(",", "\u2009", 0),
                loc="left",
                weight="bold",
            )


# --- two renderers' converged pictures -----------------------------------------------------------


def residual_figure(
    ours: tuple[str, Float32Array],
    theirs: tuple[str, Float32Array],
    residual: npt.NDArray[np.floating[Any]],
    stem: Path,
    title: str,
    limit: float,
) -> None:
    """Both pictures, and their signed difference (H, W) in colours from -``limit`` to ``limit``."""
    height, width = residual.shape
    with drawn(stem, (COLUMN, COLUMN / 3.0 * height / width + 0.75)) as figure:
        panels = figure.subplots(1, 3)
        for panel, (name, pixels) in zip(panels, (ours, theirs), strict=False):
            panel.imshow(display(pixels), interpolation="lanczos")
            panel.set_title(name)
        shown = panels[2].imshow(
            residual, cmap="RdBu_r", vmin=-limit, vmax=limit, interpolation="nearest"
        )
        panels[2].set_title("difference / mean")
        for panel in panels:
            panel.set_xticks([])
            panel.set_yticks([])
            panel.grid(False)
            for spine in panel.spines.values():
                spine.set_visible(False)
        figure.colorbar(shown, ax=panels[2], shrink=0.8, pad=0.02)
        figure.suptitle(title, size=9.0)
