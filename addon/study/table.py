# SPDX-License-Identifier: GPL-3.0-or-later
"""The result for people, as text: the table, who was fastest, how it was measured, the notes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from .accuracy import Errors
from .devices import CPU, described, known_as, labels, short_name
from .method import method
from .precision import BOX_TESTS, LAYOUTS, SHORT, TRIANGLE_TESTS, tests_in_words, width_text
from .results import COUNTERS, KINDS, Result, Row, Spread, ratio

MISSING = "-"  # in a cell without a value


@dataclass(frozen=True)
class Column:
    """One column of the table: two header lines and the text of a row's cell."""

    title: str
    unit: str
    cell: Callable[[Row], str]
    left: bool = False  # aligned; numbers stand right
    key: bool = False  # names the row


def _key_columns(rows: Sequence[Row]) -> list[Column]:
    """What names a row, where not all rows have it in common."""
    devices = labels(row.device for row in rows)
    chosen = [
        Column("builder", "", lambda row: row.label, left=True, key=True),
        Column("branching", "factor", _width, key=True),
    ]
    more: list[tuple[bool, str, str, Callable[[Row], str]]] = [
        (any(_tests(row) for row in rows), "triangle", "test", _triangle_test),
        (any(_tests(row) for row in rows), "box", "test", _box_test),
        (any(row.reorder != "off" for row in rows), "rays", "reordered", lambda row: row.reorder),
        (len(devices) > 1, "device", "", lambda row: devices[row.device]),
    ]
    chosen += [
        Column(title, unit, cell, left=True, key=True) for need, title, unit, cell in more if need
    ]
    return chosen


def columns(rows: Sequence[Row], detailed: bool = False) -> list[Column]:
    """The columns that these rows need, in the order of the table; those that name a row first.

    ``detailed`` adds how exact the right hits are.
    """
    chosen = _key_columns(rows)
    reordered = any(row.reorder != "off" for row in rows)
    for title, unit, name in (
        ("nodes", "", "nodes"),
        ("leaves", "", "leaves"),
        ("references", "", "references"),
        ("depth", "levels", "max_depth"),
    ):
        chosen.append(Column(title, unit, _tree_number(name)))
    chosen += [
        Column("size", "MB", lambda row: f"{row.tree.bytes / 1e6:.1f}" if row.tree else MISSING),
        Column("bytes", "/ triangle", lambda row: _optional(row.bytes_per_triangle, ".0f")),
        Column("build", "ms", _build),
        Column("BVH cost", "", cost_text),
    ]
    chosen += [Column(kind, "MRays/s", _speed(kind)) for kind in KINDS]
    if reordered:
        chosen += [Column(kind, "% sorting", _sorting(kind)) for kind in KINDS[1:]]
    targets = {row.time_to_error.target for row in rows if row.time_to_error}
    for target in sorted(targets):
        chosen.append(Column(f"relMSE {target:g}", "after s", _time_to_error))
    for counter, unit in zip(COUNTERS, ("visits", "boxes", "triangles"), strict=True):
        chosen += [Column(kind, unit, _per_ray(counter, kind)) for kind in KINDS]
    accuracy = [
        ("t error", "ulp, median", "t_ulps_median", ".2g"),
        ("t error", "ulp, 99.9%", "t_ulps_high", ".2g"),
        ("t error", "ulp, most", "t_ulps_largest", ".2g"),
        ("u, v error", "median", "uv_median", ".1e"),
        ("u, v error", "most", "uv_largest", ".1e"),
    ]
    return [
        *chosen,
        Column("wrong", "hits", _wrong),
        *(Column(t, unit, _accuracy(name, style)) for t, unit, name, style in accuracy if detailed),
        Column("differing", "rays", lambda row: _optional(row.differing_rays(), ",d")),
        Column("picture", "difference", lambda row: _optional(row.picture_difference(), ".3g")),
    ]


def _tree_number(name: str) -> Callable[[Row], str]:
    return lambda row: f"{getattr(row.tree, name):,d}" if row.tree else MISSING


def _build(row: Row) -> str:
    seconds = row.build()
    return _with_spread(seconds and Spread(*(1e3 * s for s in seconds)), 1, len(row.build_seconds))


def _speed(kind: str) -> Callable[[Row], str]:
    def cell(row: Row) -> str:
        timed = [m for measured in row.of_kind(kind).values() for m in measured]
        repeats = min((len(m.seconds) for m in timed), default=0)
        return _with_spread(row.speed(kind), 2, repeats)

    return cell


def _sorting(kind: str) -> Callable[[Row], str]:
    def cell(row: Row) -> str:
        share = row.sorting_share(kind) if row.reorder != "off" else None
        return _optional(share and 100.0 * share, ".0f")

    return cell


def _time_to_error(row: Row) -> str:
    return _optional(row.time_to_error.seconds if row.time_to_error else None, ".3g")


def _per_ray(counter: str, kind: str) -> Callable[[Row], str]:
    return lambda row: _optional(row.per_ray(counter, kind), ".1f")


def _wrong(row: Row) -> str:
    errors = row.errors()
    return errors_text(errors) if errors.judged else MISSING


def errors_text(errors: Errors) -> str:
    """E.g. "0 of 4608" or "12 of 4608 (3 missed)"."""
    missed = f" ({errors.false_misses} missed)" if errors.false_misses else ""
    return f"{errors.wrong} of {errors.judged}{missed}"


def _accuracy(name: str, style: str) -> Callable[[Row], str]:
    def cell(row: Row) -> str:
        return _optional(getattr(row.accuracy, name) if row.accuracy else None, style)

    return cell


def _width(row: Row) -> str:
    return width_text(row.branching, row.layout) if row.branching else MISSING


def _tests(row: Row) -> list[str]:
    return tests_in_words(row.triangle_test, row.box_test)


def cost_text(row: Row) -> str:
    """The cost; that of compressed nodes counts otherwise and is marked c."""
    return f"{row.tree.cost:.1f}{SHORT.get(row.layout, '')}" if row.tree else MISSING


def _triangle_test(row: Row) -> str:
    return TRIANGLE_TESTS.get(row.triangle_test, row.triangle_test or MISSING)


def _box_test(row: Row) -> str:
    return BOX_TESTS.get(row.box_test, row.box_test or MISSING)


def _optional(value: float | None, style: str) -> str:
    return MISSING if value is None else format(value, style)


def _with_spread(value: Spread | None, digits: int, repeats: int) -> str:
    """The median and, unless it was measured once only, its spread."""
    if value is None:
        return MISSING
    said = f"±{value.half_percent:2.0f}%" if repeats > 1 else "once"
    return f"{value.median:.{digits}f} {said}"


def text_table(rows: Sequence[Row], width: int | None = None) -> str:
    """The aligned table, in as many blocks as it takes to stay within ``width`` characters.

    Each block begins with what names the rows; without ``width`` there is one.
    """
    chosen = columns(rows)
    cells = [[c.title, c.unit, *(c.cell(row) for row in rows)] for c in chosen]
    widths = [max(len(text) for text in column) for column in cells]
    blocks = []
    keys = sum(column.key for column in chosen)
    for block in _blocks(widths, keys, width):
        lines = []
        for i in range(len(rows) + 2):
            parts = (
                f"{cells[c][i]:<{widths[c]}}" if chosen[c].left else f"{cells[c][i]:>{widths[c]}}"
                for c in block
            )
            lines.append("  ".join(parts).rstrip())
        rule = "-" * (sum(widths[c] for c in block) + 2 * (len(block) - 1))
        blocks.append("\n".join([*lines[:2], rule, *lines[2:]]))
    return "\n\n".join(blocks) + "\n"


def _blocks(widths: Sequence[int], keys: int, width: int | None) -> list[list[int]]:
    """Columns of each block: as many as fit beside the first ``keys``, which name the row."""
    names = list(range(keys))
    blocks = [list(names)]
    for column in range(len(names), len(widths)):
        used = sum(widths[c] + 2 for c in blocks[-1]) + widths[column]
        if width is not None and used > width and len(blocks[-1]) > len(names):
            blocks.append(list(names))
        blocks[-1].append(column)
    return blocks


def title(row: Row) -> str:
    """A row in words, e.g. "SBVH 8-wide" or "SBVH 8-wide compressed, rays sorted (aila)"."""
    words = [f"{row.label} {row.branching}-wide" if row.branching else row.label]
    if row.layout == "cwbvh":
        words[0] += f" {LAYOUTS[row.layout]}"
    words += _tests(row)
    if row.reorder != "off":
        words.append(f"rays sorted ({row.reorder})")
    if row.device != CPU:
        words.append(f"on {short_name(row.device)}")
    return ", ".join(words)


def fastest(result: Result) -> list[str]:
    """Who was fastest for each kind of ray, with the spread and the error beside it.

    Of those that promise exact hits where there are any; what is faster without that is named, too.
    """
    lines = []
    for kind in KINDS:
        timed = [(speed, row) for row in result.rows if (speed := row.speed(kind))]
        ours = [pair for pair in timed if pair[1].system == "bvh_lab"]
        if not ours:
            continue
        exact = [pair for pair in ours if pair[1].exact]
        speed, best = max(exact or ours, key=lambda pair: pair[0].median)
        rivals = [
            f"{ratio(best, row, kind):.2f} times {title(row)}"
            for _, row in timed
            if row.system != "bvh_lab"
        ]
        said = [f"{speed.median:.2f} MRays/s ±{speed.half_percent:.0f}%", *rivals, _judged(best)]
        lines.append(f"Fastest of ours for {kind} rays: {title(best)}, {', '.join(said)}.")
        faster, other = max(ours, key=lambda pair: pair[0].median)
        if faster.median > speed.median:
            lines.append(
                f"Faster with a test that may be wrong: {title(other)}, {faster.median:.2f} "
                f"MRays/s ±{faster.half_percent:.0f}%, {_judged(other)}, {_differing(other)}."
            )
    return lines


def _judged(row: Row) -> str:
    return f"{errors_text(row.errors())} judged rays wrong"


def _differing(row: Row) -> str:
    """How many answers of all are wrong if the default's are right."""
    rays = sum(m.rays for m in row.measurements)
    return f"{row.differing_rays() or 0:,d} of all {rays:,d} otherwise than the default"


def picture_quality(result: Result) -> list[str]:
    """How good the pictures are, and who is first at the target; none without a reference."""
    if (found := result.convergence) is None:
        return []
    lines = []
    judged = [p for row in result.rows for p in row.pictures if p.errors and p.view == found.view]
    if judged:
        said = [f"relMSE {judged[0].errors['relMSE']:.2g}"] if "relMSE" in judged[0].errors else []
        said += [f"PSNR {judged[0].errors['PSNR']:.1f} dB"] if "PSNR" in judged[0].errors else []
        lines.append(
            f"Pictures of view {found.view} with {_samples(judged[0].samples)} a pixel: "
            f"{', '.join(said) or 'no finite error'}, against a reference of "
            f"{found.reference_samples} samples whose own relMSE is about "
            f"{found.reference_error:.2g}."
        )
    timed = [
        (row.time_to_error.seconds, title(row))
        for row in result.rows
        if row.time_to_error and row.time_to_error.seconds is not None
    ]
    if timed and found.samples is not None:
        seconds, name = min(timed)
        lines.append(
            f"First at relMSE {found.target:g} in view {found.view}: {name}, after {seconds:.3g} s "
            f"({_samples(found.samples)} a pixel; without building the tree)."
        )
    return lines


def _samples(count: float) -> str:
    return "1 sample" if count == 1 else f"{count:.1f}".removesuffix(".0") + " samples"


def ray_counts(result: Result) -> list[str]:
    """How many rays of each kind were traced, a sentence; none before any was."""
    said = []
    for kind in KINDS:
        bounces = [count for (of, _), count in result.rays().items() if of == kind]
        text = f"{sum(bounces):,d} {kind}"
        if len(bounces) > 1:
            text += f" ({' + '.join(f'{count:,d}' for count in bounces)} by bounce)"
        said.append(text)
    return [f"Rays of all views: {', '.join(said)}."] if result.rays() else []


def failures(result: Result) -> list[str]:
    """One line per failed row."""
    lines = []
    for row in result.failed():
        reason = row.error or (
            f"answers differ from {result.reference}: {row.differing_rays()} rays, largest "
            f"picture difference {_optional(row.picture_difference(), '.3g')}; please report it"
        )
        lines.append(f"{title(row)}: {reason}")
    return lines


def header(result: Result) -> list[str]:
    """Scene, rays and machine, a line each."""
    scene, machine = result.subject, result.machine
    threads = max((row.threads for row in result.rows if row.device == CPU), default=0)
    used = {row.device for row in result.rows} - {CPU}
    devices = [d for d in machine.devices if d["id"] in used]
    return [
        f"Scene {scene.name}: {scene.triangles:,d} triangles ({scene.geometry} geometry), "
        f"{len(scene.views)} views ({', '.join(scene.views)}).",
        f"The picture needs: {', '.join(scene.features) or 'nothing but diffuse surfaces'}.",
        *ray_counts(result),
        f"{machine.host} with BVH Lab {machine.version}; {machine.cpu}"
        + (f", {threads} threads." if threads else "."),
        *(f"Device {known_as(device['id'])}: {described(device)}." for device in devices),
    ]


def text_report(result: Result, width: int | None = None) -> str:
    """Table, failures, the fastest, method and notes, as plain text."""
    sections = [header(result), [text_table(result.rows, width).rstrip()]]
    if result.failed():
        sections.append([f"FAILED  {line}" for line in failures(result)])
    sections += [
        [*fastest(result), *picture_quality(result)],
        _bullets("How it was measured", method(result.plan)),
    ]
    sections.append(_bullets("Modelled, approximated, left out", result.notes))
    return "\n\n".join("\n".join(section) for section in sections if section) + "\n"


def _bullets(heading: str, lines: Iterable[str]) -> list[str]:
    listed = [f"  - {line}" for line in lines]
    return [f"{heading}:", *listed] if listed else []
