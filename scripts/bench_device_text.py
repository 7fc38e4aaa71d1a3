# SPDX-License-Identifier: GPL-3.0-or-later
"""What bench_device.py measured, as Markdown tables and as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import bench_paper
from bench_device_builds import Build
from bench_device_rays import COLUMNS, SHAPES, Cell, Cells, Column, Traced
from bvh_lab.study.devices import CPU
from bvh_lab.study.plan import QUICK_PARAMS
from bvh_lab.study.precision import FULL, width_text
from bvh_lab.study.results import Spread, spread

NONE = "-"
SMALL = 0.01  # kernels below this part of a build are summed up
NAMES = [kind + (" sorted" if ordered else "") for kind, ordered in COLUMNS]


@dataclass
class SceneResult:
    """What was measured on one scene. ``left_out`` says what was not, and why."""

    name: str
    triangles: int
    views: list[str]
    size: str = ""  # pixels of each view
    rays: dict[str, int] = field(default_factory=dict)
    builds: list[Build] = field(default_factory=list)
    traced: list[Traced] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)

    def failures(self) -> list[str]:
        """What failed, and answers and trees that are not the CPU core's: a line each."""
        lines = [
            f"{self.name}: building {b.label} failed: {first_line(b.error)}"
            for b in self.builds
            if b.error
        ]
        lines += [
            f"{self.name}: {b.label}'s tree is not the CPU core's in {b.differing_bytes} bytes"
            for b in self.builds
            if b.differing_bytes
        ]
        lines += [
            f"{self.name}: tracing {tree_name(t)} failed: {first_line(t.error)}"
            for t in self.traced
            if t.error
        ]
        return lines + [
            f"{self.name}: {t.differing} rays of {tree_name(t)} differ from the CPU core's"
            for t in self.traced
            if t.differing
        ]


# --- cells ---------------------------------------------------------------------------------------


def first_line(text: str) -> str:
    return text.splitlines()[0] if text else ""


def tree_name(traced: Traced) -> str:
    return f"{traced.label} {width_text(traced.branching, traced.layout)}"


def number(value: float | None, digits: int = 3) -> str:
    """With so many digits, but none cut off before the point: 0.0123, 1.23, 12.3, 1234."""
    if value is None:
        return NONE
    text = f"{value:#.{digits}g}"
    return f"{value:.0f}" if "e" in text and value >= 1.0 else text.rstrip(".")


def with_spread(value: Spread | None, repeats: int = 2) -> str:
    if value is None:
        return NONE
    said = f" ±{value.half_percent:.0f}%" if repeats > 1 else " once"
    return number(value.median) + said


def _of(samples: Sequence[float], scale: float = 1.0) -> str:
    return with_spread(spread([scale * s for s in samples]), len(samples)) if samples else NONE


def table(heading: Sequence[str], lines: Iterable[Sequence[str]]) -> list[str]:
    """A Markdown table with aligned columns: text to the left, numbers to the right."""
    grid = [list(heading), *(list(line) for line in lines)]
    rule, columns = [], []
    for column in zip(*grid, strict=True):
        width = max(map(len, column))
        numbers = all(cell == NONE or cell[:1].isdigit() for cell in column[1:])
        columns.append([f"{cell:>{width}}" if numbers else f"{cell:<{width}}" for cell in column])
        rule.append("-" * (width + 1) + (":" if numbers else "-"))
    lines = [f"| {' | '.join(line)} |" for line in zip(*columns, strict=True)]
    return ["", lines[0], f"|{'|'.join(rule)}|", *lines[1:], ""]


# --- builds --------------------------------------------------------------------------------------


def build_lines(result: SceneResult) -> list[str]:
    """The table of build times."""
    base = next((b for b in result.builds if b.builder == "lbvh" and b.device.tree), None)
    lines = [_build_line(result.name, build, base) for build in result.builds if not build.error]
    if not lines:
        return []
    heading = ["builder", "tree by", "tree, ms", "its kernels", "copies", "CPU core, ms"]
    heading += ["CPU core / device", "/ LBVH", "paper's / LBVH", "paper, ms", "paper / device"]
    heading += ["to 8-wide, ms", "CPU core's, ms", "bytes differing"]
    said = "Build times: the binary tree, then its collapse to full 8-wide nodes"
    if result.name not in bench_paper.SCENES:
        said += " (the paper's ratio: the mean over its scenes)"
    said += "."
    return [said, *table(heading, lines)]


def _build_line(scene: str, build: Build, base: Build | None) -> list[str]:
    ours, cpu = build.device, build.cpu
    middle = spread(ours.tree).median
    kernels = sum(k.seconds for k in ours.median_kernels() if k.of == "tree")
    paper = bench_paper.build_ms(scene, build.builder)
    comparable = paper and build.builder not in QUICK_PARAMS  # those iterate less than the paper's
    differing = NONE
    if build.differing_bytes is not None:
        differing = f"{build.differing_bytes:,d} of {build.tree_bytes:,d}"
    return [
        build.label,
        "device" if build.on_device else "CPU core",
        _of(ours.tree, 1e3),
        number(1e3 * kernels) if build.on_device else NONE,
        number(1e3 * spread(ours.transfer).median),
        _of(cpu.tree, 1e3),
        _of(build.ratios()),
        number(middle / spread(base.device.tree).median) if base else NONE,
        number(bench_paper.build_ratio(scene, build.builder)),
        f"{paper:g}" if paper else NONE,
        number(paper / (1e3 * middle) if comparable else None, 2),
        _of(ours.collapse, 1e3),
        _of(cpu.collapse, 1e3),
        differing,
    ]


def kernel_lines(builds: Sequence[Build]) -> list[str]:
    """The table of stages, with the kernels of each."""
    lines = [line for build in builds if not build.error for line in _stage_lines(build)]
    if not lines:
        return []
    heading = ["builder", "of", "stage", "ms", "share", "kernels: ms (launches)"]
    said = f"Kernels by the device's clock; those below {SMALL:.0%} of their build are summed up."
    return [said, *table(heading, lines)]


def _stage_lines(build: Build) -> list[list[str]]:
    lines = []
    kernels = build.device.median_kernels()
    for of in ("tree", "collapse"):
        whole = sum(k.seconds for k in kernels if k.of == of)
        for stage in dict.fromkeys(k.stage for k in kernels if k.of == of):
            here = sorted(
                (k for k in kernels if (k.of, k.stage) == (of, stage)), key=lambda k: -k.seconds
            )
            seconds = sum(k.seconds for k in here)
            large = [k for k in here if k.seconds >= SMALL * whole]
            said = [f"{k.name} {number(1e3 * k.seconds)} ({k.launches})" for k in large]
            if rest := [k for k in here if k not in large]:
                said.append(f"{len(rest)} more {number(1e3 * sum(k.seconds for k in rest))}")
            share = f"{seconds / whole:.0%}" if whole else NONE
            lines.append([build.label, of, stage, number(1e3 * seconds), share, ", ".join(said)])
    return lines


# --- tracing -------------------------------------------------------------------------------------


def trace_tables(result: SceneResult) -> list[str]:
    """Speeds, and what they are relative to the CPU core, the binary LBVH and the paper."""
    good = [traced for traced in result.traced if not traced.error]
    if not good:
        return []
    lines = ["MRays/s on the device:"]
    lines += _trace_table(good, lambda t, column: _speed(t.device.get(column)), kernel=True)
    if any(t.cpu for t in good):
        lines.append("Speed over that of the CPU core with the same tree and rays:")
        lines += _trace_table(
            good, lambda t, column: with_spread(_over(t.device, t.cpu, column, column))
        )
    lines.append(
        "Speed over that of the binary LBVH as the rays come (in brackets the paper's"
        + (": of the scene for 2 and 4" if result.name in bench_paper.SCENES else "")
        + ", the mean over its scenes):"
    )
    lines += _trace_table(good, lambda t, column: _relative(result.name, t, column))
    if any(_paper(result.name, t, column) for t in good for column in COLUMNS):
        lines.append("The paper's MRays/s (in brackets ours over it):")
        lines += _trace_table(
            [t for t in good if any(_paper(result.name, t, column) for column in COLUMNS)],
            lambda t, column: _beside_paper(result.name, t, column),
        )
    return lines


def _trace_table(
    trees: Sequence[Traced], cell: Callable[[Traced, Column], str], kernel: bool = False
) -> list[str]:
    heading = ["tree", *NAMES, *(["kernel"] if kernel else []), "rays differing"]
    lines = []
    for traced in trees:
        cells = [cell(traced, column) for column in COLUMNS]
        shape = [traced.kernel] if kernel else []
        wrong = f"{traced.differing:,d} of {traced.compared:,d}"
        lines.append([tree_name(traced), *cells, *shape, wrong])
    return table(heading, lines)


def _speed(cell: Cell | None) -> str:
    return with_spread(cell.speed()) if cell else NONE


def _over(ours: Cells, theirs: Cells, column: Column, other: Column) -> Spread | None:
    if column not in ours or other not in theirs:
        return None
    return ours[column].over(theirs[other])


def _relative(scene: str, traced: Traced, column: Column) -> str:
    ratio = _over(traced.device, traced.base, column, (column[0], False))
    if ratio is None:
        return NONE
    paper = None
    if traced.layout == FULL:
        paper = bench_paper.speed_ratio(scene, traced.branching, *column, traced.builder)
    return f"{ratio.median:.2f}" + (f" ({paper:.2f})" if paper else "")


def _paper(scene: str, traced: Traced, column: Column) -> float | None:
    if traced.layout != FULL:
        return None
    return bench_paper.mrays(scene, traced.branching, *column, traced.builder)


def _beside_paper(scene: str, traced: Traced, column: Column) -> str:
    paper = _paper(scene, traced, column)
    if not paper or not (speed := traced.device[column].speed()):
        return NONE
    return f"{paper:g} ({number(speed.median / paper, 2)})"


# --- all of it -----------------------------------------------------------------------------------


def scene_lines(result: SceneResult, whose_views: str) -> list[str]:
    """The scene's part of the text."""
    counts = ", ".join(f"{count:,d} {kind}" for kind, count in result.rays.items())
    views = f"{len(result.views)} views ({', '.join(result.views)}; {whose_views})"
    lines = [f"## {result.name}: {result.triangles:,d} triangles, {views}", ""]
    if counts:
        lines += [f"Rays of {result.size} pixels in each view: {counts}.", ""]
    lines += [f"- LEFT OUT: {text}" for text in result.left_out]
    lines += [f"- FAILED: {text}" for text in result.failures()]
    if result.left_out or result.failures():
        lines.append("")
    return [
        *lines,
        *build_lines(result),
        *kernel_lines(result.builds),
        *trace_tables(result),
    ]


def summary_lines(results: Sequence[SceneResult]) -> list[str]:
    """Speed over the CPU core by width: mean over trees of all scenes, in brackets the least."""
    lines = []
    for branching, layout in SHAPES:
        trees = [
            t
            for result in results
            for t in result.traced
            if (t.branching, t.layout) == (branching, layout) and t.cpu and not t.error
        ]
        if not trees:
            continue
        cells = []
        for column in COLUMNS:
            found = [_over(t.device, t.cpu, column, column) for t in trees]
            ratios = [ratio.median for ratio in found if ratio]
            mean = sum(ratios) / len(ratios) if ratios else None
            cells.append(f"{mean:.2f} ({min(ratios):.2f})" if mean else NONE)
        wrong, all_rays = sum(t.differing for t in trees), sum(t.compared for t in trees)
        width = width_text(branching, layout)
        lines.append([width, str(len(trees)), *cells, f"{wrong:,d} of {all_rays:,d}"])
    if not lines:
        return []
    said = "Speed over that of the CPU core, mean over the trees of all scenes (in brackets least):"
    heading = ["width", "trees", *NAMES, "rays differing"]
    return ["## All scenes", "", said, *table(heading, lines)]


# --- CSV -----------------------------------------------------------------------------------------


def _csv(heading: Sequence[str], lines: Iterable[Sequence[object]]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(heading)
    writer.writerows(lines)
    return out.getvalue()


def builds_csv(results: Sequence[SceneResult]) -> str:
    """Every timed build, a line each: seconds."""
    heading = ("scene", "builder", "device", "tree_by", "build", "tree_seconds", "collapse_seconds")
    lines = [
        (result.name, b.builder, on, b.made_by, i, tree, collapse, transfer, b.differing_bytes)
        for result in results
        for b in result.builds
        for on, times in (("device", b.device), (CPU, b.cpu))
        for i, (tree, collapse, transfer) in enumerate(
            zip(times.tree, times.collapse, times.transfer, strict=True)
        )
    ]
    return _csv((*heading, "transfer_seconds", "differing_bytes"), lines)


def kernels_csv(results: Sequence[SceneResult]) -> str:
    """Every kernel of every builder, a line each: the median of its seconds in a build."""
    heading = ("scene", "builder", "of", "stage", "kernel", "launches", "seconds")
    return _csv(
        heading,
        [
            (r.name, b.builder, *k)
            for r in results
            for b in r.builds
            for k in b.device.median_kernels()
        ],
    )


def traces_csv(results: Sequence[SceneResult]) -> str:
    """Every cell of the tables of speeds, a line each; MRays/s and ratios with their quartiles."""
    heading = ["scene", "builder", "branching", "layout", "kind", "reordered", "rays", "kernel"]
    for name in ("mrays_per_s", "cpu_mrays_per_s", "over_cpu", "over_binary_lbvh"):
        heading += [f"{name}_low", name, f"{name}_high"]
    heading += ["paper_mrays_per_s", "paper_over_binary_lbvh", "differing_rays"]
    lines = []
    for result in results:
        for t in (t for t in result.traced if not t.error):
            for column, cell in t.device.items():
                kind, ordered = column
                cpu = t.cpu.get(column)
                place = (t.branching, kind, ordered, t.builder)
                spreads = [
                    cell.speed(),
                    cpu.speed() if cpu else None,
                    _over(t.device, t.cpu, column, column),
                    _over(t.device, t.base, column, (kind, False)),
                ]
                full = t.layout == FULL
                lines.append(
                    [
                        *(result.name, t.builder, t.branching, t.layout, kind, int(ordered)),
                        *(sum(cell.rays.values()), t.kernel),
                        *(value for of in spreads for value in (of or ("", "", ""))),
                        _paper(result.name, t, column) or "",
                        (full and bench_paper.speed_ratio(result.name, *place)) or "",
                        cell.differing + (cpu.differing if cpu else 0),
                    ]
                )
    return _csv(heading, lines)
