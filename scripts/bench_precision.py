# SPDX-License-Identifier: GPL-3.0-or-later
"""What precision costs: all layouts, triangle and box tests on one tree and the same rays.

Ratios are those to the default (watertight, conservative boxes, full nodes) in the same round.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from bench_ratios import ratio_text, speed_ratios
from bvh_lab.study.figure_style import FigureError
from bvh_lab.study.plan import Plan
from bvh_lab.study.precision import BOX_TESTS, LAYOUTS, TRIANGLE_TESTS
from bvh_lab.study.precision_figure import speed_against_error
from bvh_lab.study.precision_points import precision_csv, precision_points
from bvh_lab.study.results import KINDS, Result, Row
from bvh_lab.study.run import compare
from bvh_lab.study.scene import Scene
from bvh_lab.study.table import errors_text, title

BUILDER, BRANCHING = "sbvh", 8
JUDGED_RAYS = 2048  # of each view and kind
RAY_LONG_SIDE = 320  # pixels whose rays are traced


def precision_lines(scene: Scene, plan: Plan, stem: Path) -> list[str]:
    """Measure all choices in the plan's views and repeats, and give the lines of their table.

    Writes its figure and CSV to ``stem`` + .svg, .png and .csv.
    """
    chosen = replace(
        plan,
        builders=[BUILDER],
        branchings=[BRANCHING],
        layouts=list(LAYOUTS),
        triangle_tests=list(TRIANGLE_TESTS),
        box_tests=list(BOX_TESTS),
        judged_rays=JUDGED_RAYS,
        ray_long_side=min(plan.width, RAY_LONG_SIDE),
    )
    result = compare(scene, chosen).result
    points = precision_points(result)
    stem.with_name(f"{stem.name}.csv").write_text(precision_csv(points), encoding="utf-8")
    notes = []
    try:
        speed_against_error(points, stem, f"{scene.name}, {title(result.rows[0])}")
    except FigureError as error:
        notes.append(str(error))
    return [*_table(result), *notes]


def _table(result: Result) -> list[str]:
    default = result.rows[0]
    lines = [
        f"Speed / {title(default)} with the default tests in the same round, "
        f"{result.plan.repeats} rounds: median [quartiles];",
        "otherwise: answers of all rays that are not the exact ones; wrong: of those judged by "
        "brute force; t error in ulp",
        f"{'':52s}"
        + "".join(f"{kind:>20s}" for kind in KINDS)
        + f"{'otherwise':>24s}  {'wrong':32s}{'t median':>9s}{'99.9%':>9s}{'most':>9s}"
        + f"{'bytes/triangle':>16s}{'prepared in':>13s}",
    ]
    return lines + [_line(row, default) for row in result.rows]


def _line(row: Row, default: Row) -> str:
    if row.error:
        return f"{title(row):52s} failed: {row.error}"
    cells = "".join(f"{ratio_text(speed_ratios(row, default, kind)):>20s}" for kind in KINDS)
    rays = sum(m.rays for m in row.measurements)
    otherwise = f"{row.differing_rays() or 0:,d} of {rays:,d}"
    line = f"{title(row):52s}{cells}{otherwise:>24s}  {errors_text(row.errors()):32s}"
    if row.accuracy:
        ulps = (
            row.accuracy.t_ulps_median,
            row.accuracy.t_ulps_high,
            row.accuracy.t_ulps_largest,
        )
        line += "".join(f"{value:9.2g}" for value in ulps)
    size = f"{row.bytes_per_triangle:.0f}" if row.bytes_per_triangle else "-"
    return f"{line}{size:>16s}{1e3 * row.prepare_seconds:10.1f} ms"
