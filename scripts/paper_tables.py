# SPDX-License-Identifier: GPL-3.0-or-later
"""What `make paper` found: its rows, and the tables, curve and picture made of them."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bvh_lab.study.plan import BRANCHINGS

METRICS = {  # of core.metrics: heading, width and format in cost.txt
    "epo": ("EPO", 8, ".2f"),
    "leaf_count_mean": ("leaves met", 11, ".3f"),
    "leaf_count_deviation": ("LCV", 7, ".3f"),
    "leaf_count_error": ("± of it", 8, ".3f"),
    "max_depth": ("depth", 6, "d"),
    "mean_leaf_depth": ("mean", 6, ".1f"),
    "leaves": ("leaves", 9, "d"),
    "references": ("references", 11, "d"),
    "bytes": ("bytes", 12, "d"),
}


@dataclass
class Cell:
    """One builder at one branching factor. ``deviation`` from the paper's cost is in percent."""

    cost: float
    paper: float | None
    metrics: dict[str, Any] = field(default_factory=dict)

    @property
    def deviation(self) -> float | None:
        return None if self.paper is None else 100.0 * (self.cost / self.paper - 1.0)


@dataclass
class Row:
    """One builder. ``steps`` are (iteration, seconds, cost); ``error`` says why there are no cells.

    ``seconds`` and ``lbvh_seconds`` are for the binary tree, measured one after the other.
    """

    builder: str
    label: str
    cells: dict[int, Cell] = field(default_factory=dict)
    seconds: float = 0.0
    lbvh_seconds: float = 0.0
    steps: list[tuple[int, float, float]] = field(default_factory=list)
    ended: str = ""
    error: str = ""

    @property
    def build_ratio(self) -> float:
        return self.seconds / self.lbvh_seconds

    @property
    def iterations(self) -> int | None:
        return self.steps[-1][0] if self.steps else None


def row_text(row: Row, with_paper: bool) -> str:
    """One line of the table of costs."""
    if row.error:
        return f"{row.label:10s} failed: {row.error}"
    cells = []
    for cell in row.cells.values():
        text = f"{cell.cost:9.2f}"
        if with_paper:
            if cell.paper is not None and cell.deviation is not None:
                text += f"{cell.paper:6.0f} {cell.deviation:+6.2f}%"
            else:
                text += f"{'-':>6s} {'-':>7s}"
        cells.append(text)
    ending = f"  {row.iterations} iterations, {row.ended}" if row.steps else ""
    return f"{row.label:10s}{'  '.join(cells)}  {row.build_ratio:10.2f}{ending}"


def metric_lines(rows: Sequence[Row]) -> list[str]:
    """The table of core.metrics, where they were asked for."""
    measured = [row for row in rows if any(cell.metrics for cell in row.cells.values())]
    if not measured:
        return []
    lines = [
        "",
        "EPO: end-point overlap, exact. Leaves met: mean number over random lines through the",
        "scene; LCV: its standard deviation, with its standard error. Depth in interior nodes.",
        f"{'':10s} k" + "".join(f"{heading:>{width}s}" for heading, width, _ in METRICS.values()),
    ]
    for row in measured:
        for branching, cell in row.cells.items():
            numbers = (
                f"{cell.metrics[key]:{width}{style}}" for key, (_, width, style) in METRICS.items()
            )
            lines.append(f"{row.label:10s} {branching}{''.join(numbers)}")
    return lines


def cost_table(heading: Sequence[str], rows: Sequence[Row], with_paper: bool) -> str:
    """The text of cost.txt."""
    titles = (
        f"{f'k = {k}':>9s}" + (f"{'paper':>6s} {'off':>7s}" if with_paper else "")
        for k in BRANCHINGS
    )
    lines = [
        *heading,
        "",
        f"{'':10s}{'  '.join(titles)}  {'time/LBVH':>10s}",
        *(row_text(row, with_paper) for row in rows),
        *metric_lines(rows),
    ]
    return "\n".join(lines) + "\n"


def cost_csv(rows: Sequence[Row]) -> str:
    """The text of cost.csv: one line for each builder and branching factor."""
    out = io.StringIO()
    names = ["builder", "branching", "cost", "paper_cost", "deviation_percent", "build_seconds"]
    names += ["lbvh_seconds", "build_ratio", "iterations", "ended", "error", *METRICS]
    writer = csv.DictWriter(out, names, lineterminator="\n")
    writer.writeheader()
    for row in rows:
        if row.error:
            writer.writerow({"builder": row.builder, "error": row.error})
        for branching, cell in row.cells.items():
            writer.writerow(
                {
                    "builder": row.builder,
                    "branching": branching,
                    "cost": cell.cost,
                    "paper_cost": cell.paper,
                    "deviation_percent": cell.deviation,
                    "build_seconds": row.seconds,
                    "lbvh_seconds": row.lbvh_seconds,
                    "build_ratio": row.build_ratio,
                    "iterations": row.iterations,
                    "ended": row.ended,
                    **{key: cell.metrics[key] for key in METRICS if cell.metrics},
                }
            )
    return out.getvalue()


def curve_csv(rows: Sequence[Row]) -> str:
    """The text of cost_over_time.csv."""
    lines = ["builder,iteration,seconds,lbvh_builds,cost"]
    for row in rows:
        lines += [
            f"{row.builder},{iteration},{seconds},{seconds / row.lbvh_seconds},{cost}"
            for iteration, seconds, cost in row.steps
        ]
    return "\n".join(lines) + "\n"


def draw_curves(rows: Sequence[Row], path: Path, title: str) -> None:
    """The picture of the same, whole and from 10% above the least. Raises ImportError."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 5.0), layout="constrained")
    whole, end = figure.subplots(1, 2)
    least = min(cost for row in rows for _, _, cost in row.steps)
    end.set_ylim(0.995 * least, 1.1 * least)
    for axes in (whole, end):
        for row in rows:
            times = [seconds / row.lbvh_seconds for _, seconds, _ in row.steps]
            costs = [cost for _, _, cost in row.steps]
            (line,) = axes.plot(times, costs, label=f"{row.label} ({costs[-1]:.1f})")
            axes.plot(times[-1], costs[-1], "o", color=line.get_color())
        axes.set_xscale("log")
        axes.set_xlabel("time since the build began, in LBVH builds")
        axes.grid(alpha=0.3, which="both")
    whole.set_ylabel("best cost so far (Eq. 2, one reference per leaf)")
    end.set_title("up to 10% above the least", fontsize="medium")
    whole.legend(title="builder (last cost)")
    figure.suptitle(title)
    partial = path.with_name(f".{path.stem}.partial.png")
    figure.savefig(partial, dpi=120)
    partial.replace(path)


def settings_text(params: Mapping[str, Mapping[str, float]], builders: Sequence[str]) -> str:
    """What differs from the builders' defaults."""
    return ", ".join(
        f"{builder}.{name}={value:g}"
        for builder, settings in params.items()
        if builder in builders
        for name, value in settings.items()
    )
