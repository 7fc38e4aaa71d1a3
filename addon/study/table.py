# SPDX-License-Identifier: GPL-3.0-or-later
"""The result for people, as text: the table, who was fastest, how it was measured, the notes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from .plan import Plan
from .results import COUNTERS, KINDS, Result, Row, Spread, ratio

MISSING = "-"  # in a cell without a value


@dataclass(frozen=True)
class Column:
    """One column of the table: two header lines and the text of a row's cell."""

    title: str
    unit: str
    cell: Callable[[Row], str]
    left: bool = False  # aligned; numbers stand right


def columns(rows: Sequence[Row]) -> list[Column]:
    """The columns that these rows need, in the order of the table."""
    chosen = [
        Column("builder", "", lambda row: row.label, left=True),
        Column("branching", "factor", lambda row: str(row.branching or MISSING)),
    ]
    reordered = any(row.reorder != "off" for row in rows)
    if reordered:
        chosen.append(Column("rays", "reordered", lambda row: row.reorder, left=True))
    if len({row.device for row in rows}) > 1:
        chosen.append(Column("device", "", lambda row: row.device, left=True))
    for title, unit, name in (
        ("nodes", "", "nodes"),
        ("leaves", "", "leaves"),
        ("references", "", "references"),
        ("depth", "levels", "max_depth"),
    ):
        chosen.append(Column(title, unit, _tree_number(name)))
    chosen += [
        Column("size", "MB", lambda row: f"{row.tree.bytes / 1e6:.1f}" if row.tree else MISSING),
        Column("build", "ms", _build),
        Column("BVH cost", "", lambda row: f"{row.tree.cost:.1f}" if row.tree else MISSING),
    ]
    chosen += [Column(kind, "MRays/s", _speed(kind)) for kind in KINDS]
    if reordered:
        chosen += [Column(kind, "% sorting", _sorting(kind)) for kind in KINDS[1:]]
    targets = {row.time_to_error.target for row in rows if row.time_to_error}
    for target in sorted(targets):
        chosen.append(Column(f"relMSE {target:g}", "after s", _time_to_error))
    for counter, unit in zip(COUNTERS, ("visits", "boxes", "triangles"), strict=True):
        chosen += [Column(kind, unit, _per_ray(counter, kind)) for kind in KINDS]
    return [
        *chosen,
        Column("wrong", "hits", _wrong),
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
    return f"{errors.wrong}/{errors.judged}" if errors.judged else MISSING


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

    Each block begins with builder and branching factor; without ``width`` there is one.
    """
    chosen = columns(rows)
    cells = [[c.title, c.unit, *(c.cell(row) for row in rows)] for c in chosen]
    widths = [max(len(text) for text in column) for column in cells]
    blocks = []
    for block in _blocks(widths, width):
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


def _blocks(widths: Sequence[int], width: int | None) -> list[list[int]]:
    """Columns of each block: as many as fit beside the two that name the row."""
    names = [0, 1]
    blocks = [list(names)]
    for column in range(len(names), len(widths)):
        used = sum(widths[c] + 2 for c in blocks[-1]) + widths[column]
        if width is not None and used > width and len(blocks[-1]) > len(names):
            blocks.append(list(names))
        blocks[-1].append(column)
    return blocks


def title(row: Row) -> str:
    """A row in words, e.g. "SBVH 8-wide" or "SBVH 8-wide, rays sorted (aila)"."""
    name = f"{row.label} {row.branching}-wide" if row.branching else row.label
    return name if row.reorder == "off" else f"{name}, rays sorted ({row.reorder})"


def fastest(result: Result) -> list[str]:
    """Who was fastest for each kind of ray, with the spread and the error beside it."""
    lines = []
    for kind in KINDS:
        timed = [(speed, row) for row in result.rows if (speed := row.speed(kind))]
        ours = [(speed, row) for speed, row in timed if row.system == "bvh_lab"]
        if not ours:
            continue
        speed, best = max(ours, key=lambda pair: pair[0].median)
        rivals = [
            f"{ratio(best, row, kind):.2f} times {title(row)}"
            for _, row in timed
            if row.system != "bvh_lab"
        ]
        errors = best.errors()
        said = [
            f"{speed.median:.2f} MRays/s ±{speed.half_percent:.0f}%",
            *rivals,
            f"{errors.wrong} of {errors.judged} judged rays wrong",
        ]
        lines.append(f"Fastest of ours for {kind} rays: {title(best)}, {', '.join(said)}.")
    return lines


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


def method(plan: Plan) -> list[str]:
    """What was measured and how, a sentence each."""
    judged = f"{plan.judged_rays} rays of each view and kind"
    builds = f"median of {plan.build_repeats} builds" if plan.build_repeats > 1 else "one build"
    lines = [
        f"Speed: MRays/s from the median of {plan.repeats} timed runs after a warm-up, all "
        "variants interleaved; the arithmetic mean over the views, as in the paper. ± is half the "
        "distance between the quartiles. Sort keys, sorting and traversal are included, generating "
        "the rays is not.",
        "Rays: those that the path tracer traces for one path of each pixel, generated once and "
        "traced by every variant, bounce by bounce; paths that have ended have none. Primary: "
        "closest hit, from the camera. Secondary: closest hit, from a hit on, in directions that "
        f"the material scatters to, for {plan.depth} bounces. Shadow: any hit, {plan.shadow_rays} "
        "towards sampled lights from each hit where light can be found so.",
        "Visits, boxes, triangles: interior nodes visited, their children's boxes tested and "
        "triangles tested, per ray, counted in a run of their own.",
    ]
    if set(plan.reorders) != {"off"}:
        lines.append(
            "Rays reordered: secondary and shadow rays of a bounce are sorted by a key of 32 bits "
            "(Meister et al. 2020; aila is the paper's) and traced in that order; primary rays are "
            "not. % sorting: what keys and sorting take of the time."
        )
    if plan.target_error:
        lines.append(
            f"Time to relMSE {plan.target_error:g}: of the first view's picture, without building "
            "the tree. The samples needed, the same for all variants as their pictures are equal, "
            "come from pictures of 1, 2, 4, ... samples against a converged reference of other "
            "random numbers, interpolated on log-log axes; the seconds are those samples times the "
            "variant's seconds per sample in its one render of its picture (no repeats)."
        )
    return [
        *lines,
        f"Build: {builds}, binary tree and collapse together.",
        "BVH cost: Eq. 2 (binary) and 3 (wide) of Meister & Bittner 2022 with c_T = "
        f"{plan.traversal:g}, c_I = {plan.intersection:g}.",
        f"Wrong hits: against brute force in double precision on {judged}; equal distances (within "
        "4 float32 ulp) are no error. Differing rays: against the first variant, bit for bit, over "
        "all rays; for Embree by the rule for wrong hits.",
        f"Picture: path traced, {plan.samples} samples per pixel, depth {plan.depth}, "
        f"{plan.shadow_rays} shadow rays a hit; the difference is the largest of any channel "
        "(linear) to the first variant's.",
    ]


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
    threads = max((row.threads for row in result.rows), default=0)
    return [
        f"Scene {scene.name}: {scene.triangles:,d} triangles ({scene.geometry} geometry), "
        f"{len(scene.views)} views ({', '.join(scene.views)}).",
        f"The picture needs: {', '.join(scene.features) or 'nothing but diffuse surfaces'}.",
        *ray_counts(result),
        f"{machine.host} with BVH Lab {machine.version}; {machine.cpu}, {threads} threads.",
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
