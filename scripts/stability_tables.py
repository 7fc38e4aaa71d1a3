# SPDX-License-Identifier: GPL-3.0-or-later
"""The text and CSV of `make stability`."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from stability_cases import EMBREE, CaseRow, SpeedRow
from stability_measure import Precision


def csv_text(rows: Sequence[dict[str, Any]]) -> str:
    """Rows of the same columns as CSV."""
    if not rows:
        return ""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def table(head: Sequence[str], lines: Iterable[Sequence[str]]) -> list[str]:
    """Columns in their widths; the first to the left, the others to the right."""
    rows = [list(head), *map(list, lines)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
    return [
        "  ".join(
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def by_choice(rows: Sequence[CaseRow]) -> dict[str, list[CaseRow]]:
    """Rows by pair of tests, those of all trees together; Embree by name."""
    groups: dict[str, list[CaseRow]] = {}
    for row in rows:
        if row.variant.builder in EMBREE:
            name = row.variant.builder
        else:
            name = pair_name(row.variant.precision)
        groups.setdefault(name, []).append(row)
    return groups


def pair_name(precision: Precision) -> str:
    return f"{precision.triangle_test}/{precision.box_test}"


def worst_share(rows: Sequence[CaseRow]) -> tuple[float, float]:
    """Largest shares of variants: gaps, and triangles farther than the nearest."""
    return (
        max((row.share(row.gaps()) for row in rows), default=0.0),
        max((row.share(int(row.errors["farther"])) for row in rows), default=0.0),
    )


def share_text(share: float) -> str:
    if share == 0.0:
        return "0"
    return f"{100 * share:.3g}%" if share >= 1e-4 else f"{1e6 * share:.3g}ppm"


def ulp_text(value: float) -> str:
    if np.isinf(value):
        return "inf"
    return f"{value:.2f}" if value < 100 else f"{value:.1e}"


DEFAULT_HEAD = (
    "default tests", "rays", "trees", "misses", "false hits", "wrong triangle", "by ulp",
    "t ulp median", "99.9 %", "max", "well-cond.", "max, all", "u, v max", "differ",
)  # fmt: skip


def default_cells(rows: Sequence[CaseRow]) -> tuple[str, ...]:
    """The line of one case under DEFAULT_HEAD: the worst of its trees."""
    worst = {name: max(row.errors[name] for row in rows) for name in rows[0].errors}
    return (
        rows[0].case,
        str(worst["judged"]),
        str(len(rows)),
        str(worst["false_misses"]),
        str(worst["false_hits"] + worst["invalid"]),
        str(worst["wrong_triangles"]),
        ulp_text(worst["wrong_ulps"]),
        *(ulp_text(worst[f"t_ulps_well_{name}"]) for name in ("median", "p999", "max")),
        f"{100 * worst['well_conditioned'] / max(worst['answered'], 1):.0f}%",
        ulp_text(worst["t_ulps_all_max"]),
        f"{worst['uv_well_max']:.1e}",
        str(max(row.disagreeing + row.any_hit_differs for row in rows)),
    )


def default_table(rows: Sequence[CaseRow]) -> list[str]:
    """Errors of the default tests on every case, over all of its trees."""
    return table(DEFAULT_HEAD, [default_cells(mine) for mine in _by_case(rows)])


CHOICES_HEAD = "gaps, farther triangles"


def choices_cells(rows: Sequence[CaseRow], names: Sequence[str]) -> tuple[str, ...]:
    """The line of one case: worst shares of gaps and of farther triangles, by choice."""
    groups = by_choice(rows)
    shares = [worst_share(groups.get(name, [])) for name in names]
    return rows[0].case, *(f"{share_text(gap)} {share_text(far)}" for gap, far in shares)


def choices_table(rows: Sequence[CaseRow]) -> list[str]:
    """Shares of gaps and of farther triangles on the worst tree, by case and choice."""
    names = list(by_choice(rows))
    return table((CHOICES_HEAD, *names), [choices_cells(mine, names) for mine in _by_case(rows)])


def _by_case(rows: Sequence[CaseRow]) -> list[list[CaseRow]]:
    groups: dict[str, list[CaseRow]] = {}
    for row in rows:
        groups.setdefault(row.case, []).append(row)
    return list(groups.values())


def speed_table(rows: Sequence[SpeedRow]) -> list[str]:
    """Speed over that of the default on the full 8-wide tree, by case and choice."""
    wide = [row for row in rows if row.variant.tree not in ("2", "4")]
    names = list(dict.fromkeys(row.variant.choice for row in wide))
    lines = []
    for case in dict.fromkeys(row.case for row in wide):
        mine = {row.variant.choice: row for row in wide if row.case == case}
        cells = []
        for name in names:
            low, median, high = mine[name].quartiles() if name in mine else (np.nan,) * 3
            cells.append(f"{median:.2f} [{low:.2f} {high:.2f}]")
        lines.append((case, *cells))
    return table(("speed / default", *names), lines)


def scene_table(errors: Sequence[CaseRow], speeds: Sequence[SpeedRow]) -> list[str]:
    """Errors and speeds side by side, a line for each variant."""
    head = (
        "variant", "MRays/s", "speed / default", "rays judged", "misses", "false hits",
        "wrong triangle", "any hit differs", "t ulp median", "99.9 %", "max", "u, v max",
    )  # fmt: skip
    timed = {(row.variant.tree, row.variant.choice): row for row in speeds}
    lines = []
    for row in errors:
        speed = timed[row.variant.tree, row.variant.choice]
        low, median, high = speed.quartiles()
        e = row.errors
        width = f"{row.variant.tree}-wide " if row.variant.tree.isdecimal() else ""
        lines.append(
            (
                width + row.variant.choice.removeprefix("full/"),
                f"{speed.mrays:.2f}",
                f"{median:.2f} [{low:.2f} {high:.2f}]",
                str(e["judged"]),
                str(e["false_misses"]),
                str(e["false_hits"] + e["invalid"]),
                str(e["wrong_triangles"]),
                str(row.any_hit_differs),
                *(ulp_text(e[f"t_ulps_well_{name}"]) for name in ("median", "p999", "max")),
                f"{e['uv_well_max']:.1e}",
            )
        )
    return table(head, lines)
