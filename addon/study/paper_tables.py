# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of Meister & Bittner 2022, and the data of their Figure 1, from one's own results.

Every relative number is taken within one scene and view and then averaged, arithmetic mean, over
scenes and views. Where LBVH, which all is relative to, was not measured, cells stay empty.

Compressed nodes of eight children (cwbvh), which the paper does not have, are a further width
beside 2, 4 and 8, "8c", with a table of their own after the octal one. Rows traced with other than
the default tests are left out: all that the tables compare has the same hits.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from .devices import CPU
from .plan import BRANCHINGS, BUILDERS
from .precision import CWBVH_BRANCHING, FULL, width_text
from .results import KINDS, Result, spread

BASELINE = "lbvh"
PAPER_KINDS = ("secondary", "shadow")  # the paper's tables and figure leave primary rays out
Shape = tuple[int, str]  # branching factor and layout
CWBVH: Shape = (CWBVH_BRANCHING, "cwbvh")
WIDTHS: dict[Shape, str] = {
    **dict(zip(((b, FULL) for b in BRANCHINGS), ("binary", "quaternary", "octal"), strict=True)),
    CWBVH: "octal compressed",
}


@dataclass(frozen=True)
class Trace:
    """One builder's tree and how fast it is on one view's rays of one kind.

    ``cost`` is Eq. 2 (binary) or 3 (wide), ``mrays`` MRays/s with sorting included;
    ``spread_percent`` is half the distance between its quartiles.
    """

    scene: str
    view: str
    builder: str
    branching: int
    reordered: bool
    kind: str
    cost: float
    mrays: float
    spread_percent: float = 0.0
    layout: str = FULL


@dataclass(frozen=True)
class Build:
    """Building one binary BVH."""

    scene: str
    builder: str
    seconds: float
    spread_percent: float = 0.0


@dataclass
class Measured:
    """What the tables are made of, on one device.

    ``labels`` are the builders' names in the paper's spelling.
    """

    traces: list[Trace]
    builds: list[Build]
    labels: dict[str, str]
    device: str = CPU

    @property
    def scenes(self) -> list[str]:
        """Names of the scenes, in the order they come."""
        return list(
            dict.fromkeys([*(t.scene for t in self.traces), *(b.scene for b in self.builds)])
        )

    @property
    def builders(self) -> list[str]:
        """The builders that were measured, in the paper's order."""
        there = {t.builder for t in self.traces} | {b.builder for b in self.builds}
        return [*(b for b in BUILDERS if b in there), *sorted(there - set(BUILDERS))]


class Cell(NamedTuple):
    """A number, what it is relative to LBVH's, and how far what it was made of spreads.

    ``spread_percent`` is half the distance between quartiles: of the repeats where ``value`` was
    measured in one scene, of scenes and views where it is their mean.
    """

    value: float
    relative: float | None = None
    spread_percent: float | None = None


@dataclass
class Line:
    """One line of a table; ``cells`` by builder."""

    scene: str
    branching: int
    statistic: str
    cells: dict[str, Cell] = field(default_factory=dict)
    layout: str = FULL


@dataclass
class Table:
    """A table as in the paper, builders across."""

    number: int
    caption: str
    lines: list[Line]
    suffix: str = ""
    device: str = CPU

    @property
    def name(self) -> str:
        """Its number, with a letter where the paper has no such table."""
        return f"{self.number}{self.suffix}"


def devices_of(results: Sequence[Result]) -> list[str]:
    """The ids of the devices that have rows of ours, in the order they come."""
    rows = (row for result in results for row in result.rows)
    return list(dict.fromkeys(row.device for row in rows if row.system == "bvh_lab"))


def measured_by(
    results: Sequence[Result], reorder: str = "aila", device: str | None = None
) -> Measured:
    """The measurements of our own rows on one device in all results, one result for each scene.

    Of the rows with reordered rays those with the key ``reorder`` count. ``device`` is of
    `devices_of`, the first of them unless given. Raises ValueError for two results of one scene
    name.
    """
    names = [result.subject.name for result in results]
    if len(set(names)) < len(names):
        raise ValueError(f"two results are of a scene of the same name: {', '.join(names)}")
    device = device or next(iter(devices_of(results)), CPU)
    made = Measured([], [], {}, device)
    for result in results:
        for row in result.rows:
            if not row.exact or row.error or row.tree is None:
                continue
            if row.device != device:
                continue
            made.labels[row.builder] = row.label
            if row.branching == 2 and row.reorder == "off" and (build := row.build()):
                spread_percent = build.half_percent
                made.builds.append(
                    Build(result.subject.name, row.builder, build.median, spread_percent)
                )
            if row.reorder not in ("off", reorder):
                continue
            for kind in KINDS if row.reorder == "off" else PAPER_KINDS:  # primary: never reordered
                made.traces += [
                    Trace(
                        result.subject.name,
                        view,
                        row.builder,
                        row.branching,
                        row.reorder != "off",
                        kind,
                        row.tree.cost,
                        speed.median,
                        speed.half_percent,
                        row.layout,
                    )
                    for view, speed in row.view_speeds(kind).items()
                ]
    return made


def paper_tables(measured: Measured) -> list[Table]:
    """Tables 1 to 6, in that order, those that the measurements can fill."""
    tables = [_relative_speeds(measured), _build_times(measured)]
    tables += [_cost_and_speed(measured, shape) for shape in WIDTHS]
    tables.append(_time_by_cost(measured))
    for table in tables:
        table.device = measured.device
    return [table for table in tables if any(line.cells for line in table.lines)]


def _statistic(kind: str, reordered: bool) -> str:
    return f"{kind} rays{' reordered' if reordered else ''}"


def _select(traces: Iterable[Trace], **wanted: object) -> list[Trace]:
    return [t for t in traces if all(getattr(t, name) == value for name, value in wanted.items())]


Place = tuple[str, str, str]  # scene, view, kind


def _baselines(measured: Measured, shape: Shape) -> dict[Place, Trace]:
    branching, layout = shape
    traces = _select(
        measured.traces, builder=BASELINE, branching=branching, layout=layout, reordered=False
    )
    return {(t.scene, t.view, t.kind): t for t in traces}


def _mean(
    traces: Sequence[Trace],
    baselines: Mapping[Place, Trace],
    ratio: Callable[[Trace, Trace], float],
) -> Cell | None:
    """The mean of ``ratio`` over those of the traces that have a baseline."""
    ratios = [ratio(t, base) for t in traces if (base := baselines.get((t.scene, t.view, t.kind)))]
    return Cell(sum(ratios) / len(ratios), None, spread(ratios).half_percent) if ratios else None


def _lines(
    measured: Measured,
    shape: Shape,
    reordered: Sequence[bool],
    baselines: Mapping[Place, Trace],
    ratio: Callable[[Trace, Trace], float],
) -> list[Line]:
    """A line of means for each kind of ray."""
    branching, layout = shape
    lines = []
    for sorting in reordered:
        for kind in PAPER_KINDS:
            line = Line("", branching, _statistic(kind, sorting), layout=layout)
            for builder in measured.builders:
                of = _select(
                    measured.traces,
                    builder=builder,
                    branching=branching,
                    layout=layout,
                    reordered=sorting,
                    kind=kind,
                )
                if cell := _mean(of, baselines, ratio):
                    line.cells[builder] = cell
            lines.append(line)
    return lines


def _relative_speeds(measured: Measured) -> Table:
    binary = _baselines(measured, (2, FULL))
    caption = (
        "Ray tracing speed relative to the binary LBVH without reordering; mean over scenes and "
        "views."
    )
    lines = [
        line
        for reordered in (False, True)
        for shape in WIDTHS
        for line in _lines(
            measured, shape, (reordered,), binary, lambda t, base: t.mrays / base.mrays
        )
    ]
    return Table(1, caption, lines)


def _build_times(measured: Measured) -> Table:
    by_scene: dict[str, dict[str, Build]] = {}
    for build in measured.builds:
        by_scene.setdefault(build.scene, {})[build.builder] = build
    lines = []
    ratios: dict[str, list[float]] = {}
    for scene, builds in by_scene.items():
        line, base = Line(scene, 2, "build, ms"), builds.get(BASELINE)
        for builder in measured.builders:
            if (built := builds.get(builder)) is None:
                continue
            relative = built.seconds / base.seconds if base else None
            line.cells[builder] = Cell(1e3 * built.seconds, relative, built.spread_percent)
            if relative is not None:
                ratios.setdefault(builder, []).append(relative)
        lines.append(line)
    mean = Line("", 2, "mean, relative to LBVH")
    for builder, values in ratios.items():
        mean.cells[builder] = Cell(sum(values) / len(values), None, spread(values).half_percent)
    return Table(2, "Build times of binary BVHs in milliseconds.", [*lines, mean])


def _cost_and_speed(measured: Measured, shape: Shape) -> Table:
    """Table 3, 4 or 5: costs and MRays/s of each scene; relative to LBVH without reordering."""
    branching, layout = shape
    lines = []
    for scene in measured.scenes:
        of_scene = _select(measured.traces, scene=scene, branching=branching, layout=layout)
        cost = Line(scene, branching, "BVH cost", layout=layout)
        costs = {t.builder: t.cost for t in of_scene}
        for builder in (b for b in measured.builders if b in costs):
            base = costs.get(BASELINE)
            cost.cells[builder] = Cell(costs[builder], costs[builder] / base if base else None)
        lines.append(cost)
        for reordered in (False, True):
            lines += [_speed_line(measured, of_scene, kind, reordered) for kind in PAPER_KINDS]
    caption = f"BVH cost and trace speed in MRays/s (mean over views), {WIDTHS[shape]} BVHs."
    return Table(branching.bit_length() + 1, caption, lines, "c" if shape == CWBVH else "")


def _speed_line(measured: Measured, of_scene: Sequence[Trace], kind: str, reordered: bool) -> Line:
    def mean(traces: Sequence[Trace]) -> float | None:
        return sum(t.mrays for t in traces) / len(traces) if traces else None

    base = mean(_select(of_scene, builder=BASELINE, kind=kind, reordered=False))
    line = Line("", 0, _statistic(kind, reordered))
    for builder in measured.builders:
        traces = _select(of_scene, builder=builder, kind=kind, reordered=reordered)
        if (speed := mean(traces)) is None:
            continue
        line.scene, line.branching = traces[0].scene, traces[0].branching
        line.layout = traces[0].layout
        spread_percent = sum(t.spread_percent for t in traces) / len(traces)
        line.cells[builder] = Cell(speed, speed / base if base else None, spread_percent)
    return line


def _time_by_cost(measured: Measured) -> Table:
    """Table 6: cost, and trace time per unit of cost, relative to LBVH of the same width."""

    def cost(t: Trace, base: Trace) -> float:
        return t.cost / base.cost

    def time_by_cost(t: Trace, base: Trace) -> float:
        return (base.mrays / t.mrays) * (base.cost / t.cost)

    lines = []
    for shape in WIDTHS:
        baselines = _baselines(measured, shape)
        (of_cost,) = _lines(measured, shape, (False,), baselines, cost)[:1]
        of_cost.statistic = "BVH cost"
        lines += [of_cost, *_lines(measured, shape, (False, True), baselines, time_by_cost)]
    caption = (
        "BVH cost and trace time per unit of BVH cost, relative to LBVH of the same branching "
        "factor without reordering; mean over scenes and views."
    )
    return Table(6, caption, lines)


def table_text(table: Table, measured: Measured) -> str:
    """The table, aligned, with its caption; lines without a number are left out.

    What a value is relative to LBVH's stands behind it in brackets.
    """
    builders = [b for b in measured.builders if any(b in line.cells for line in table.lines)]
    heads = ["scene", "k", "statistic", *(measured.labels.get(b, b) for b in builders)]
    grid = [heads]
    for line in (line for line in table.lines if line.cells):
        cells = [_cell_text(line.cells.get(builder)) for builder in builders]
        of_width = width_text(line.branching, line.layout)
        grid.append([line.scene or "all", of_width, line.statistic, *cells])
    widths = [max(map(len, column)) for column in zip(*grid, strict=True)]
    lines = []
    for words in grid:
        left = [f"{word:<{width}}" for word, width in zip(words[:3], widths[:3], strict=True)]
        right = [f"{word:>{width}}" for word, width in zip(words[3:], widths[3:], strict=True)]
        lines.append("  ".join([*left, *right]).rstrip())
    lines.insert(1, "-" * (sum(widths) + 2 * (len(widths) - 1)))
    return "\n".join([f"Table {table.name}. {table.caption}", _spread_text(table), *lines]) + "\n"


def _cell_text(cell: Cell | None) -> str:
    if cell is None:
        return "-"
    digits = 2 if cell.value < 10.0 else 1 if cell.value < 100.0 else 0
    value = f"{cell.value:.{digits}f}"
    return value if cell.relative is None else f"{value} ({cell.relative:.2f})"


def _spread_text(table: Table) -> str:
    """How much to trust the numbers, in a sentence."""
    spreads = [
        cell.spread_percent
        for line in table.lines
        for cell in line.cells.values()
        if cell.spread_percent is not None
    ]
    if not spreads:
        return "Nothing here was measured more than once."
    return (
        "Half the distance between quartiles: median over the cells "
        f"{spread(spreads).median:.0f}%, at most {max(spreads):.0f}%."
    )


def tables_csv(tables: Sequence[Table]) -> str:
    """All cells of all tables, one a line, with full precision."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    names = ("table", "scene", "branching", "layout", "statistic", "builder")
    writer.writerow([*names, "value", "relative_to_lbvh", "spread_percent", "device"])
    for table in tables:
        for line in table.lines:
            for builder, cell in line.cells.items():
                place = (table.name, line.scene, line.branching, line.layout, line.statistic)
                writer.writerow([*place, builder, *cell, table.device])
    return out.getvalue()
