#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""`make stability`: how accurate the hits are on hard cases, and what accuracy costs in speed.

Every builder, width, layout and pair of tests answers the rays of blender_scenes/hard_cases.py; the
exact judge counts what is wrong. On a real mesh speed stands against error. A random search looks
for counterexamples of the bounds that the default rests on. Writes into --out: stability.txt,
errors.csv, speeds.csv, scene_errors.csv, scene_speeds.csv, shading.csv, stability.json, and the
figures speed_against_error, gaps_by_case, triangles_by_case (.png, .svg).
Ends with an error where the default tests are wrong.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import bpy  # first, always: the native module binds to Blender's oneTBB
import stability_shading
from bvh_lab.native import core
from bvh_lab.study.machine import describe_machine
from bvh_lab.study.output import write_text_aside
from stability_cases import CaseRow, SpeedRow, measure_case, measure_speed, refusal
from stability_figures import errors_by_case, speed_against_error
from stability_measure import precision_choices
from stability_scenes import ATRIUM, SHARED, SceneResult, measure_scene
from stability_search import Found, search
from stability_tables import (
    choices_table,
    csv_text,
    default_table,
    scene_table,
    speed_table,
    table,
)

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "blender_scenes"))

from hard_cases import CASES, Case

ROUNDS = 7


@dataclass
class Study:
    """All that was measured."""

    machine: dict[str, Any]
    large: bool
    errors: list[CaseRow] = field(default_factory=list)
    speeds: list[SpeedRow] = field(default_factory=list)
    scenes: list[SceneResult] = field(default_factory=list)
    refusals: dict[str, str] = field(default_factory=dict)
    shading: list[dict[str, Any]] = field(default_factory=list)
    found: Found = field(default_factory=Found)

    def default_rows(self) -> list[CaseRow]:
        """Rows of the default tests on our trees."""
        default = precision_choices(core)[0]
        return [row for row in self.errors if row.variant.tree and row.variant.precision == default]

    def failures(self) -> list[str]:
        """What the default must not do, and did."""
        lines = []
        names = ("false_misses", "false_hits", "invalid", "must_hit_missed", "must_miss_hit")
        for row in self.default_rows():
            label = f"{row.case}, {row.variant.builder} {row.variant.tree}"
            wrong = [f"{row.errors[name]} {name}" for name in names if row.errors[name]]
            if row.disagreeing or row.any_hit_differs:
                wrong.append(
                    f"{row.disagreeing + row.any_hit_differs} rays differ between variants"
                )
            if row.errors["wrong_ulps"] > 1:
                wrong.append(
                    f"a nearer triangle passed over, by {row.errors['wrong_ulps']:.3g} ulp"
                )
            if row.errors["t_ulps_well_max"] > 4:
                wrong.append(f"t off by {row.errors['t_ulps_well_max']:.3g} ulp")
            lines += [f"{label}: {', '.join(wrong)}"] if wrong else []
        return lines + self.found.failures


def say(text: str) -> None:
    print(f"stability: {text}", file=sys.stderr, flush=True)


# --- measuring ------------------------------------------------------------------------------------


def measure(arguments: argparse.Namespace) -> Study:
    machine = asdict(describe_machine(core, f"bpy {bpy.app.version_string}"))
    study = Study(machine, large=not arguments.quick)
    for case in chosen_cases(arguments.cases):
        start = time.monotonic()
        if case.refused:
            study.refusals[case.name] = refusal(core, case)
            continue
        rows = measure_case(core, case, study.large)
        problem = case.make(study.large)
        mesh = core.Mesh(problem.vertices, problem.triangles)
        study.errors += rows
        if len(problem.triangles) <= 100_000:  # a million triangles take minutes by all trees
            rounds = ROUNDS if study.large else 3
            study.speeds += measure_speed(core, case.name, mesh, problem.rays(), rounds)
        say(f"{case.name}: {len(rows)} variants, {time.monotonic() - start:.1f} s")
    for path in [] if arguments.cases else [arguments.scene or default_scene()]:
        say(f"{path.stem}: speed against error")
        count, tests = (200_000, 4e9) if study.large else (30_000, 5e8)
        study.scenes += measure_scene(core, path, count, ROUNDS, tests)
    if not arguments.cases:
        say("shading")
        seconds = 60 if study.large else 10
        study.shading = stability_shading.run(core, 128 if study.large else 64, seconds)
    if arguments.seconds > 0:
        say(f"random search, {arguments.seconds:g} s")
        study.found = search(core, arguments.seconds, arguments.seed)
    return study


def chosen_cases(names: Sequence[str]) -> list[Case]:
    return [case for case in CASES if not names or case.name in names]


def default_scene() -> Path:
    return SHARED if SHARED.is_file() else ATRIUM


# --- writing --------------------------------------------------------------------------------------


def report(study: Study) -> str:
    """The whole text."""
    machine = study.machine
    lines = [
        f"{machine['cpu']}, {machine['cores']} cores, {core.devices()[0]['simd']}, "
        f"Embree {machine['embree']}, {'full size' if study.large else 'small'}",
        "",
        "Errors against the exact answer: the worst of all builders, widths and layouts. A wrong",
        "triangle is one that is not an exact tie; 'by ulp': how much farther it is. t in float32",
        "units in the last place, where well-conditioned (condition number up to 2^26) and in all.",
        "'differ': rays for which two trees, or any hit and closest hit, disagree.",
        "",
        *default_table(study.default_rows()),
        "",
        "All choices: share of rays with a gap (a hit missed, or seen where there is none), and",
        "with a triangle farther than the nearest by over one ulp of t; worst tree of each.",
        "",
        *choices_table(study.errors),
        "",
    ]
    if study.refusals:
        lines += [*table(("refused", "sentence"), study.refusals.items()), ""]
    if study.speeds:
        lines += [f"Median of {len(study.speeds[0].ratios)} rounds [quartiles], contenders in turn"]
        lines += ["on the SBVH's 8-wide trees:", "", *speed_table(study.speeds), ""]
    for result in study.scenes:
        lines += [f"{result.scene}, SBVH, rays {result.rays}, median of {ROUNDS} rounds", ""]
        lines += [*scene_table(result.errors, result.speeds), ""]
    if study.shading:
        head = list(study.shading[0])
        lines += [*table(head, [[_cell(row[name]) for name in head] for row in study.shading]), ""]
    lines += search_lines(study.found)
    failures = study.failures()
    lines += ["", "The default failed:" if failures else "The default failed nowhere.", *failures]
    return "\n".join(lines) + "\n"


def _cell(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def search_lines(found: Found) -> list[str]:
    if not found.examples:
        return []
    return [
        f"Random search, {found.seconds:.0f} s: {found.examples} arbitrary examples, "
        f"{found.rays} grazing rays with {found.hits} hits on {found.batches} meshes;",
        f"largest error of t {found.largest_t_ulps:.3f} ulp, of u and v {found.largest_uv:.2e} "
        f"(well-conditioned); {found.float_ties} hits on a triangle of the same t in float32;",
        f"{len(found.failures)} counterexamples",
    ]


def write(study: Study, out: Path) -> None:
    out.mkdir(parents=True, exist_ok=True)
    scene_errors = [row.columns() for result in study.scenes for row in result.errors]
    scene_speeds = [
        {"rays": result.rays, **row.columns()} for result in study.scenes for row in result.speeds
    ]
    texts = {
        "stability.txt": report(study),
        "errors.csv": csv_text([row.columns() for row in study.errors]),
        "speeds.csv": csv_text([row.columns() for row in study.speeds]),
        "scene_errors.csv": csv_text(scene_errors),
        "scene_speeds.csv": csv_text(scene_speeds),
        "shading.csv": csv_text(study.shading),
        "stability.json": json.dumps(
            plain(
                {
                    "machine": study.machine,
                    "large": study.large,
                    "errors": [row.columns() for row in study.errors],
                    "speeds": [row.columns() for row in study.speeds],
                    "scene_errors": scene_errors,
                    "scene_speeds": scene_speeds,
                    "refused": study.refusals,
                    "shading": study.shading,
                    "search": asdict(study.found),
                    "failures": study.failures(),
                }
            ),
            indent=1,
            allow_nan=False,
        ),
    }
    for name, text in texts.items():
        write_text_aside(out / name, text)
    groups = {case.name: case.group for case in CASES}
    for stem, share, title in (
        (
            "gaps_by_case",
            lambda row: row.share(row.gaps()),
            "Hits missed, or seen where there are none: share of rays, worst tree (· none)",
        ),
        (
            "triangles_by_case",
            lambda row: row.share(row.errors["farther"]),
            "A triangle farther than the nearest by over 1 ulp of t: share of rays, worst tree",
        ),
    ):
        errors_by_case(core, study.errors, groups, share, title, out / stem)
    if study.scenes:
        speed_against_error(core, study.scenes, out / "speed_against_error")


def plain(value: Any) -> Any:
    """The value as JSON has it: numbers that are not finite as text."""
    if isinstance(value, dict):
        return {name: plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("cases", nargs="*", help="names of hard cases; default: all, and a scene")
    parser.add_argument("--out", type=Path, default=Path("out/stability"))
    parser.add_argument("--quick", action="store_true", help="small cases: two minutes")
    parser.add_argument("--seconds", type=float, help="of random search (default 150, quick 20)")
    parser.add_argument("--seed", type=int, default=1, help="of the random search")
    parser.add_argument("--scene", type=Path, help="mesh for speed against error")
    arguments = parser.parse_args()
    unknown = set(arguments.cases) - {case.name for case in CASES}
    if unknown:
        names = ", ".join(case.name for case in CASES)
        parser.error(f"no hard case {sorted(unknown)[0]}; there are {names}")
    if arguments.seconds is None:
        arguments.seconds = 20.0 if arguments.quick else 150.0
    study = measure(arguments)
    write(study, arguments.out)
    print(report(study))
    return 1 if study.failures() else 0


if __name__ == "__main__":
    sys.exit(main())
