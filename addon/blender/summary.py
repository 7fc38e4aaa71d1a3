# SPDX-License-Identifier: GPL-3.0-or-later
"""The result in a few plain sentences, and the texts of the table's cells. No bpy in here."""

from __future__ import annotations

from collections.abc import Sequence

from ..study.precision import SHORT, tests_in_words, width_text
from ..study.results import COUNTERS, KINDS, Result, Row, ratio
from ..study.table import cost_text, title
from .notes import listed

MISSING = "-"


def fastest(rows: Sequence[Row], kind: str) -> Row | None:
    """The fastest of our own variants for one kind of ray that has no error.

    Of those that promise exact hits, where there are any.
    """
    timed = [row for row in rows if row.system == "bvh_lab" and row.speed(kind) and not row.error]
    exact = [row for row in timed if row.exact]
    return max(exact or timed, key=lambda row: row.speed(kind).median, default=None)  # type: ignore[union-attr]


def baseline(rows: Sequence[Row], chosen: str) -> Row | None:
    """The row that ratios are of: the chosen one, else the first that has a tree."""
    by_name = {row.name: row for row in rows}
    return by_name.get(chosen) or next((row for row in rows if row.tree), None)


def winner(rows: Sequence[Row], kind: str) -> list[str]:
    """Who won, by how much, with what error; and who built fastest. Empty before a first speed."""
    best = fastest(rows, kind)
    if best is None:
        return []
    speed, errors = best.speed(kind), best.errors()
    assert speed is not None
    lines = [f"Fastest: {title(best)}, {wrong_hits(errors.wrong, errors.judged)}"]
    pace = f"{speed.median:.2f} million {kind} rays a second (±{speed.half_percent:.0f}%)"
    ours = [row for row in rows if row.system == "bvh_lab" and not row.error]
    rivals = [(other, row) for row in ours if row is not best and (other := row.speed(kind))]
    if rivals:
        _, slowest = min(rivals, key=lambda pair: pair[0].median)
        pace += f", {ratio(best, slowest, kind):.1f} times {title(slowest)}"
    lines.append(pace)
    quicker, risky = max(rivals, key=lambda pair: pair[0].median, default=(speed, best))
    if quicker.median > speed.median:
        lines.append(
            f"Faster with a test that may be wrong: {title(risky)}, "
            f"{quicker.median / speed.median:.2f} times, {otherwise(risky)}"
        )
    rivals = [(other, row) for other, row in rivals if row.exact]
    if tied := [title(row) for other, row in rivals if other.high >= speed.low]:
        lines.append(f"Perhaps as fast, their spreads overlap: {listed(tied)}")
    if quickest := min((row for row in ours if row.build()), key=_build_seconds, default=None):
        lines.append(f"Quickest to build: {title(quickest)}, {seconds(_build_seconds(quickest))}")
    return lines


def _build_seconds(row: Row) -> float:
    build = row.build()
    return build.median if build else float("inf")


def wrong_hits(wrong: int, judged: int) -> str:
    """Errors in words."""
    if not judged:
        return "no hits were checked"
    return f"{wrong} wrong hit{'' if wrong == 1 else 's'} of {judged}"


def otherwise(row: Row) -> str:
    """How many of all rays it answered otherwise than the default tests."""
    rays = sum(m.rays for m in row.measurements)
    return f"{row.differing_rays() or 0:,d} of {rays:,d} rays answered otherwise than exactly"


def pictures(result: Result) -> str:
    """Whether all variants made the same picture; empty where none was made."""
    made = [row for row in result.rows if row.pictures]
    different = [row for row in made if row.picture_difference()]
    if not made:
        return ""
    if not different:
        each = " of each device" if len({row.device for row in made}) > 1 else ""
        return f"All {len(made)} pictures{each} are equal, pixel for pixel" if len(made) > 1 else ""
    worst = max(different, key=lambda row: row.picture_difference() or 0.0)
    return f"{title(worst)} made another picture: it differs by {worst.picture_difference():.3g}"


def seconds(value: float) -> str:
    """A time in the unit that suits it."""
    if value < 0.9995:
        return f"{1e3 * value:.3g} ms" if value < 0.0995 else f"{1e3 * value:.0f} ms"
    if value < 60.0:
        return f"{value:.1f} s"
    minutes, rest = divmod(round(value), 60)
    return f"{minutes} min {rest} s"


def cells(row: Row, kind: str, base: Row | None) -> dict[str, str]:
    """The text of each of the table's columns."""
    build, speed = row.build(), row.speed(kind)
    times = ratio(row, base, kind) if base else None
    return {
        "NAME": short_title(row),
        "BUILD": seconds(build.median) if build else MISSING,
        "COST": cost_text(row),
        "SPEED": f"{speed.median:.2f}" if speed else MISSING,
        "RATIO": f"{times:.2f}×" if times else MISSING,
        "WRONG": _wrong(row),
    }


def _wrong(row: Row) -> str:
    """Wrong hits of those judged and, where they are more and no bug, of all rays in brackets."""
    errors, others = row.errors(), row.differing_rays()
    if not errors.judged:
        return MISSING
    return f"{errors.wrong} ({others})" if others and not row.exact else str(errors.wrong)


def has_errors(row: Row) -> bool:
    """Whether it failed, or answered a ray wrongly for all that is known."""
    return bool(row.error) or row.errors().wrong > 0 or bool(row.differing_rays())


def short_title(row: Row) -> str:
    """The row's name in as few letters as tell it apart."""
    words = row.label.split()
    # A rival's label holds its version: "Embree 3.13.5 robust".
    name = f"{row.label} {width_text(row.branching, row.layout)}"
    tests = [SHORT.get(test, test) for test in (row.triangle_test, row.box_test)]
    parts = [name if row.branching else f"{words[0]} {words[-1]}", *tests]
    parts.append("sorted" if row.reorder != "off" else "")
    return " ".join(part for part in parts if part)


def sort_value(row: Row, column: str, kind: str) -> tuple[bool, float | str]:
    """What a column sorts by; rows without a value come last when ascending."""
    build, speed = row.build(), row.speed(kind)
    values: dict[str, float | str | None] = {
        "NAME": short_title(row),
        "BUILD": build.median if build else None,
        "COST": row.tree.cost if row.tree else None,
        "SPEED": speed.median if speed else None,
        "RATIO": speed.median if speed else None,
        "WRONG": _wrong_order(row),
    }
    value = values[column]
    return (value is None, "" if value is None and column == "NAME" else value or 0.0)


def _wrong_order(row: Row) -> float | None:
    """By judged rays, and where those are alike by all rays."""
    errors = row.errors()
    return errors.wrong + 1e-9 * (row.differing_rays() or 0) if errors.judged else None


def details(row: Row) -> list[tuple[str, str]]:
    """Everything else about a row, as pairs of label and value."""
    facts: list[tuple[str, str]] = []
    tree = row.tree
    if tree:
        facts += [
            ("Nodes", f"{tree.nodes:,d}, {tree.leaves:,d} of them leaves"),
            ("References", f"{tree.references:,d}, {tree.average_leaf_size:.1f} a leaf"),
            ("Depth", f"{tree.max_depth} levels"),
            (
                "Memory",
                f"{tree.bytes / 1e6:.1f} MB, {row.bytes_per_triangle or 0:.0f} bytes a triangle",
            ),
        ]
    if tests := tests_in_words(row.triangle_test, row.box_test):
        facts.append(("Tests", ", ".join(tests)))
    for kind in KINDS:
        if speed := row.speed(kind):
            text = f"{speed.median:.2f} MRays/s ±{speed.half_percent:.0f}%"
            share = row.sorting_share(kind)
            facts.append(
                (f"{kind.title()} Rays", text + (f", {share:.0%} sorting" if share else ""))
            )
        work = [row.per_ray(counter, kind) for counter in COUNTERS]
        if None not in work:
            said = zip(work, ("nodes", "boxes", "triangles"), strict=True)
            facts.append(("", f"{', '.join(f'{count:.1f} {name}' for count, name in said)} a ray"))
    if time := row.time_to_error:
        text = MISSING if time.seconds is None else f"after {seconds(time.seconds)}"
        facts.append((f"relMSE {time.target:g}", text))
    errors = row.errors()
    facts.append(("Wrong Hits", wrong_hits(errors.wrong, errors.judged)))
    if not row.exact:
        facts.append(("", otherwise(row)))
    if accuracy := row.accuracy:
        text = f"{accuracy.t_ulps_median:.2g} ulp, at most {accuracy.t_ulps_largest:.2g}"
        facts.append(("Distance Error", text))
    if row.threads:
        facts.append(("Threads", str(row.threads)))
    return facts
