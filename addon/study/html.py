# SPDX-License-Identifier: GPL-3.0-or-later
"""The report as one web page that needs no other file."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path

from .devices import CPU, described, labels
from .method import method
from .results import KINDS, Result, Row
from .table import Column, columns, failures, fastest, header, picture_quality

STYLE = """
:root { color-scheme: light dark; --ink: #1c2024; --soft: #60646c; --paper: #fcfcfd;
  --card: #ffffff; --line: #e0e1e6; --bar: #cfe3fb; --bad: #c62a2f; --good: #18794e; }
@media (prefers-color-scheme: dark) { :root { --ink: #edeef0; --soft: #b0b4ba; --paper: #111113;
  --card: #18191b; --line: #363a3f; --bar: #10395f; --bad: #ff9592; --good: #3dd68c; } }
body { margin: 0 auto; max-width: 120rem; padding: 2rem; color: var(--ink);
  background: var(--paper); font: 15px/1.5 system-ui, sans-serif; }
h1 { margin: 0; font-size: 1.7rem; } h2 { margin: 2.2rem 0 .6rem; font-size: 1.15rem; }
p { margin: .25rem 0; max-width: 60rem; } .soft { color: var(--soft); }
ul { margin: 0; padding-left: 1.2rem; max-width: 60rem; }
.scroll { overflow-x: auto; border: 1px solid var(--line); border-radius: 8px;
  background: var(--card); }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums;
  font-size: 13px; }
th, td { padding: .35rem .45rem; text-align: right; white-space: nowrap; }
th { border-bottom: 1px solid var(--line); font-weight: 600; vertical-align: bottom; }
th small { display: block; color: var(--soft); font-weight: 400; }
tr + tr td { border-top: 1px solid var(--line); } .left { text-align: left; }
tr.rival td { color: var(--soft); } .bad { color: var(--bad); font-weight: 600; }
td.bar { background: linear-gradient(to right, var(--bar) var(--share), transparent var(--share)); }
figure { margin: 0; } figcaption { color: var(--soft); font-size: 13px; padding: .3rem 0; }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(20rem, 1fr)); gap: 1rem; }
img { width: 100%; border-radius: 6px; border: 1px solid var(--line); }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .15rem 1rem; margin: 0; }
dt { color: var(--soft); } dd { margin: 0; overflow-wrap: anywhere; }
""".strip()


def html_page(
    result: Result,
    files: Mapping[tuple[str, str], str],
    folder: Path,
    curves: Path | str = "",
    precision: Path | str = "",
) -> str:
    """The page. ``files`` names the PNG, relative to ``folder``, of each (variant, view) as
    `report.write_pictures` returns them; the ones shown are copied into the page.

    ``curves`` is the PNG of error against time, or says why there is none; ``precision`` that of
    speed against error.
    """
    name = escape(result.subject.name)
    failed = "".join(f'<p class="bad">{escape(line)}</p>' for line in failures(result))
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>BVH Lab: {name}</title>
<style>
{STYLE}
</style>
</head>
<body>
<h1>{name}</h1>
{_paragraphs(header(result), "soft")}
{failed}
<h2>What was fastest</h2>
{_paragraphs([*fastest(result), *picture_quality(result)])}
<h2>All variants</h2>
{_table(result.rows)}
{_pictures(result, files, folder)}
{_precision_figure(precision)}
{_error_curves(result, curves)}
<h2>How it was measured</h2>
{_list(method(result.plan))}
<h2>Modelled, approximated, left out</h2>
{_list(result.notes)}
<h2>Settings and machine</h2>
{_facts(result)}
</body>
</html>
"""


def _paragraphs(lines: Iterable[str], kind: str = "") -> str:
    attribute = f' class="{kind}"' if kind else ""
    return "\n".join(f"<p{attribute}>{escape(line)}</p>" for line in lines)


def _list(lines: Iterable[str]) -> str:
    return "<ul>\n" + "\n".join(f"<li>{escape(line)}</li>" for line in lines) + "\n</ul>"


def _table(rows: Sequence[Row]) -> str:
    chosen = columns(rows, detailed=True)
    heads = "".join(
        f"<th{_side(column)}>{escape(column.title)}<small>{escape(column.unit)}</small></th>"
        for column in chosen
    )
    body = "\n".join(_line(row, rows, chosen) for row in rows)
    return (
        f'<div class="scroll"><table>\n<thead><tr>{heads}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody></table></div>"
    )


def _line(row: Row, rows: Sequence[Row], chosen: Sequence[Column]) -> str:
    cells = []
    for column in chosen:
        attributes = _side(column)
        share = _share(row, rows, column)
        if share is not None:
            attributes = f' class="bar" style="--share: {100.0 * share:.1f}%"'
        elif column.title == "wrong" and row.errors().wrong:
            attributes = ' class="bad"'
        cells.append(f"<td{attributes}>{escape(column.cell(row))}</td>")
    rival = "" if row.system == "bvh_lab" else ' class="rival"'
    return f"<tr{rival}>{''.join(cells)}</tr>"


def _side(column: Column) -> str:
    return ' class="left"' if column.left else ""


def _share(row: Row, rows: Sequence[Row], column: Column) -> float | None:
    """Length of the bar behind a speed: its part of the column's largest."""
    if column.unit != "MRays/s" or column.title not in KINDS:
        return None
    speed = row.speed(column.title)
    largest = max((s.median for other in rows if (s := other.speed(column.title))), default=0.0)
    return speed.median / largest if speed and largest else None


def _pictures(result: Result, files: Mapping[tuple[str, str], str], folder: Path) -> str:
    figures = []
    for view in result.subject.views:
        shown = next((variant for variant, of in files if of == view and variant), None)
        if shown is None:
            continue
        count = sum(1 for variant, of in files if of == view and variant)
        largest = max(
            (p.largest_difference for row in result.rows for p in row.pictures if p.view == view),
            default=0.0,
        )
        verdict = (
            f"all {count} variants are equal pixel for pixel"
            if largest == 0.0
            else f"largest difference between variants {largest:.3g}"
        )
        figures.append(_figure(folder / files[shown, view], f"{view}: {verdict}"))
        if largest:
            caption = f"{view}: largest difference, scaled so that white is {largest:.3g}"
            figures.append(_figure(folder / files["", view], caption))
    if not figures:
        return ""
    return f'<h2>Pictures</h2>\n<div class="pictures">\n{"".join(figures)}</div>'


def _precision_figure(precision: Path | str) -> str:
    if not precision:
        return ""
    if isinstance(precision, str):
        shown = _paragraphs([precision], "soft")
    else:
        caption = (
            "Precision choices against the default one of the same tree. Dots: speed, geometric "
            "mean over trees and kinds of ray; bars: least to most. Left: answers otherwise than "
            "the default's over all rays, exact ties apart. Right: error of t in units in the "
            "last place of float32 where the triangle is right, from median to largest"
        )
        shown = _figure(precision, caption)
    return f"<h2>Speed against error</h2>\n{shown}"


def _error_curves(result: Result, curves: Path | str) -> str:
    if result.convergence is None or not curves:
        return ""
    if isinstance(curves, str):
        shown = _paragraphs([curves], "soft")
    else:
        caption = (
            f"View {result.convergence.view}: relMSE against render time of each builder's fastest "
            "variant, derived as the times in the table"
        )
        shown = _figure(curves, caption)
    return f"<h2>Error against time</h2>\n{shown}"


def _figure(path: Path, caption: str) -> str:
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    text = escape(caption)
    return (
        f'<figure><img src="data:image/png;base64,{data}" alt="{text}">'
        f"<figcaption>{text}</figcaption></figure>\n"
    )


def _facts(result: Result) -> str:
    plan, scene, machine = result.plan, result.subject, result.machine
    along = f"{plan.long_side} pixels along the long side"
    facts = {
        "Preset": plan.preset,
        "Builder settings": str(plan.params or "defaults"),
        "Resolution": f"{plan.width}x{plan.height} pixels" if plan.width else along,
        "Paths": f"{plan.samples} samples a pixel, depth {plan.depth}, {plan.shadow_rays} shadow "
        "rays a hit",
        "Renderer's features": ", ".join(scene.features) or "none",
        "Seed": str(plan.seed),
        "Measured": f"{result.started}, {result.seconds:.0f} s in all",
        "Scene file": scene.source or "not saved",
        "Scene hash": f"SHA-256 {scene.sha256}",
        "Contents": f"{scene.triangles:,d} triangles, {scene.vertices:,d} vertices, "
        f"{scene.materials} materials, {scene.lights} lights, frame {scene.frame}",
        "Machine": f"{machine.cpu}, {machine.cores} cores, {machine.memory_gib:g} GiB",
        "System": machine.system,
        "Program": f"{machine.host}, Python {machine.python}, NumPy {machine.numpy}",
        "BVH Lab": machine.version,
        "Embree": machine.embree,
    }
    names = labels(plan.devices)
    for device in machine.devices:
        if device["id"] in plan.devices and device["id"] != CPU:
            facts[f"Device {names[device['id']]}"] = f"{device['id']}: {described(device)}"
    listed = "\n".join(f"<dt>{escape(k)}</dt><dd>{escape(v)}</dd>" for k, v in facts.items())
    return f"<dl>\n{listed}\n</dl>"
