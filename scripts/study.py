#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""`make study`: the paper's tables and figures from Blender scenes.

For every scene all builders are built, traced and compared; a few variants also path trace, and
their error against time is drawn. Writes into the folder --out: tables.txt and .csv (Tables 1 to
6), figure1 (cost against time), figure2 (the views), build_time, error_<scene>, each as .svg and
.png, with their numbers as .csv; and for every scene a folder with its own report.

Without scenes it takes those of blender_scenes/, and makes the large ones that are not kept there
in the folder scenes of --out. A scene that fails is named, and the others go on.
"""

from __future__ import annotations

import argparse
import sys
import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import bpy  # first, always: the native module binds to Blender's oneTBB
from bvh_lab.blender.session import open_scene, program
from bvh_lab.native import core
from bvh_lab.study.arguments import add_plan_arguments, plan_from_arguments
from bvh_lab.study.console import ProgressLine, duration, stdout_to_stderr
from bvh_lab.study.core_scene import core_scene
from bvh_lab.study.cost_points import correlations_text, cost_points, cost_points_csv
from bvh_lab.study.devices import CPU, known_as, labels
from bvh_lab.study.figures import (
    SceneViews,
    build_against_speed,
    build_points,
    contact_sheet,
    cost_against_time,
    error_against_time,
)
from bvh_lab.study.image_error import (
    Curve,
    curves_csv,
    curves_table,
    doubling,
    measure_curves,
    noise_note,
    our_contestant,
)
from bvh_lab.study.job import Job
from bvh_lab.study.output import file_stems, write_text_aside
from bvh_lab.study.paper_tables import (
    PAPER_KINDS,
    Measured,
    Table,
    devices_of,
    measured_by,
    paper_tables,
    table_text,
    tables_csv,
)
from bvh_lab.study.plan import QUICK_PARAMS, Plan
from bvh_lab.study.precision import FULL
from bvh_lab.study.rays import choose_views
from bvh_lab.study.reference_picture import reference_picture
from bvh_lab.study.report import write_report
from bvh_lab.study.results import Result
from bvh_lab.study.scene import Float32Array, Scene
from bvh_lab.study.table import failures

SCENE_FOLDER = Path(__file__).resolve().parents[1] / "blender_scenes"
QUICK_ITERATIONS = 50  # of annealing: one period of heating and cooling
LINE = ProgressLine(sys.stderr)


class Stopped(Exception):
    """The user pressed Ctrl-C while a scene was measured."""


def say(text: str) -> None:
    LINE.clear()
    print(f"study: {text}", file=sys.stderr, flush=True)


# --- scenes --------------------------------------------------------------------------------------


def default_scenes(out: Path) -> list[Path]:
    """The scenes that are kept, and those too large for that, made where they are missing."""
    sys.path.insert(0, str(SCENE_FOLDER))
    import make_scenes

    found = sorted(SCENE_FOLDER.glob("*.blend"))
    folder = out / "scenes"
    for name in make_scenes.SCENES:
        path = folder / f"{name}.blend"
        if name in (kept.stem for kept in found):
            continue
        if not path.is_file():
            say(f"making the scene {name}")
            folder.mkdir(parents=True, exist_ok=True)
            with stdout_to_stderr():
                make_scenes.make(name)
                make_scenes.save(path.resolve())
        found.append(path)
    return found


@dataclass
class Studied:
    """What is known of one scene."""

    result: Result
    views: list[tuple[str, Float32Array]] = field(default_factory=list)
    curves: list[Curve] = field(default_factory=list)
    curve_title: str = ""
    target: float = 0.0
    reference_error: float = 0.0


def study_scene(path: Path, plan: Plan, arguments: argparse.Namespace) -> Studied:
    """Compare all variants, then render the views and the curves. Raises what failed."""
    with stdout_to_stderr():
        scene = open_scene(path, "render")
    result = compare_variants(scene, plan)
    for failure in failures(result):
        say(failure)
    studied = Studied(result)
    if result.cancelled:
        raise Stopped
    mesh = core.Mesh(scene.vertices, scene.triangles)
    made, _ = core_scene(core, mesh, scene)
    if arguments.sheet_samples:
        studied.views = render_views(scene, mesh, made, plan, arguments)
    if arguments.curves:
        render_curves(studied, scene, mesh, made, plan, arguments)
    return studied


def compare_variants(scene: Scene, plan: Plan) -> Result:
    """The study of one scene; Ctrl-C ends it early, with what was measured."""
    job = Job(scene, plan, program())
    while job.running:
        try:
            job.wait(0.1)
            job.poll()
            LINE.show(job.fraction, f"{scene.name}: {job.stage}", job.seconds_left)
        except KeyboardInterrupt:
            job.cancel()
    LINE.clear()
    return job.study.result


# --- pictures ------------------------------------------------------------------------------------


def path_settings(plan: Plan, arguments: argparse.Namespace) -> dict[str, Any]:
    return {
        "seed": plan.seed,
        "depth": arguments.picture_depth,
        "shadow_rays": plan.shadow_rays,
        "threads": plan.threads,
    }


def render_views(
    scene: Scene, mesh: Any, made: Any, plan: Plan, arguments: argparse.Namespace
) -> list[tuple[str, Float32Array]]:
    """A picture of every view, for the contact sheet."""
    bvh = core.build(mesh, "sah", branching=8, threads=plan.threads)
    pictures = []
    for view in choose_views(
        core, scene, replace(plan, width=0, height=0, long_side=arguments.sheet_side)
    ):
        say(f"{scene.name}: picture of view {view.name}")
        picture = core.render(
            bvh,
            made,
            view.camera,
            view.width,
            view.height,
            samples=arguments.sheet_samples,
            **path_settings(plan, arguments),
        )
        pictures.append((view.name, picture.pixels))
    return pictures


def render_curves(
    studied: Studied,
    scene: Scene,
    mesh: Any,
    made: Any,
    plan: Plan,
    arguments: argparse.Namespace,
) -> None:
    """Error against time of a few variants, in the first view."""
    small = replace(plan, views=1, width=0, height=0, long_side=arguments.curve_side)
    view = choose_views(core, scene, small)[0]
    settings = path_settings(plan, arguments)
    labels = {builder["id"]: builder["label"] for builder in core.builders()}
    contestants = []
    for name in arguments.curves:
        builder, branching, layout = variant(name)
        bvh = core.build(
            mesh,
            builder,
            branching=branching,
            layout=layout,
            threads=plan.threads,
            params=plan.params.get(builder, {}),
        )
        curve = Curve(
            name,
            f"{labels[builder]} {branching}-wide{' compressed' if layout == 'cwbvh' else ''}",
            builder=builder,
            branching=branching,
        )
        contestants.append(our_contestant(core, curve, bvh, made, view, settings, core.Token()))
    if not contestants:
        return
    samples = arguments.reference_samples
    say(f"{scene.name}: reference of {samples} samples, {view.width}x{view.height}")
    reference = reference_picture(core, bvh, scene, made, view, samples, settings)
    for note in reference.notes:
        say(note)
    measure_curves(
        core,
        contestants,
        reference.pixels,
        doubling(arguments.curve_samples),
        arguments.curve_repeats,
        on_step=lambda step: say(f"{scene.name}: error against time of {step}"),
    )
    studied.curves = [contestant.curve for contestant in contestants]
    studied.reference_error, studied.target = reference.error, arguments.target
    studied.curve_title = (
        f"{scene.name}, camera {view.name}, {view.width}×{view.height}, "
        f"depth {settings['depth']}, {settings['shadow_rays']} shadow rays per hit"
    )


def variant(name: str) -> tuple[str, int, str]:
    """Builder, branching factor and layout of a name like sbvh_8_cwbvh. Raises ValueError."""
    layout = "cwbvh" if name.endswith("_8_cwbvh") else FULL
    builder, _, branching = name.removesuffix("_cwbvh" if layout == "cwbvh" else "").rpartition("_")
    if branching not in ("2", "4", "8") or builder not in {b["id"] for b in core.builders()}:
        raise ValueError(f"--curves takes variants like sbvh_8 and sbvh_8_cwbvh, not {name!r}")
    return builder, int(branching), layout


# --- what is written -----------------------------------------------------------------------------


def write_study(studied: Sequence[Studied], out: Path) -> str:
    """All tables and figures over the scenes so far; gives the text of tables.txt."""
    results = [one.result for one in studied]
    devices = devices_of(results)
    names = labels(devices)
    stems = file_stems(names.values())
    tables, texts = list[Table](), list[str]()
    for device in devices:
        measured = measured_by(results, device=device)
        of_device = paper_tables(measured)
        tables += of_device
        if devices != [CPU]:
            said = "" if of_device else ": nothing was measured"
            texts.append(f"Device {known_as(device)}{said}\n")
        texts += [table_text(table, measured) for table in of_device]
        ending = "" if device == devices[0] else f"_{stems[names[device]]}"
        texts += write_figures(measured, out, ending)
    subjects = [(one.result.subject, one.views) for one in studied if one.views]
    if subjects:
        sheet = [SceneViews(subject.name, subject.triangles, views) for subject, views in subjects]
        contact_sheet(sheet, out / "figure2")
    text = "\n".join(texts)
    write_text_aside(out / "tables.txt", text)
    write_text_aside(out / "tables.csv", tables_csv(tables))
    return text


def write_figures(measured: Measured, out: Path, ending: str) -> list[str]:
    """Figure 1 and those of build times of a device; gives the text of the correlations."""
    for kind in PAPER_KINDS:
        if builds := build_points(measured, kind):
            build_against_speed(builds, out / f"build_time_{kind}{ending}", kind)
    if not (points := cost_points(measured)):
        return []
    cost_against_time(points, out / f"figure1{ending}")
    write_text_aside(out / f"figure1{ending}.csv", cost_points_csv(points))
    return [correlations_text(points)]


def write_scene(one: Studied, stem: str, out: Path) -> str:
    """The scene's own report and its curves; gives the text of the curves."""
    write_report(one.result, {}, out / stem)
    if not one.curves:
        return ""
    figure = out / f"error_{stem}"
    error_against_time(one.curves, figure, one.curve_title, one.reference_error, one.target)
    write_text_aside(out / f"error_{stem}.csv", curves_csv(one.curves))
    note = noise_note(one.target, one.reference_error)
    lines = [
        f"Error against time: {one.curve_title}",
        f"relMSE of the reference itself: about {one.reference_error:.2g}",
        *curves_table(one.curves, one.target),
        *([note] if note else []),
    ]
    text = "\n".join(lines) + "\n"
    write_text_aside(out / f"error_{stem}.txt", text)
    return text


def run(arguments: argparse.Namespace, plan: Plan) -> int:
    start = time.monotonic()
    out = arguments.out
    out.mkdir(parents=True, exist_ok=True)
    scenes = arguments.scenes or default_scenes(out)
    stems = file_stems(path.stem for path in scenes)
    studied: list[Studied] = []
    failed: list[str] = []
    for number, path in enumerate(scenes):
        say(f"{path.stem}, scene {number + 1} of {len(scenes)}")
        try:
            one = study_scene(path, plan, arguments)
            studied.append(one)
            if text := write_scene(one, stems[path.stem], out):
                say("\n" + text)
            failed += [f"{path.stem}: {row.label} failed" for row in one.result.failed()]
        except (KeyboardInterrupt, Stopped, core.Cancelled):
            failed.append(f"stopped at {path.stem}")
            break
        except Exception as error:
            say(f"{path} failed: {error}")
            if not isinstance(error, (ValueError, OSError, RuntimeError)):
                traceback.print_exc()
            failed.append(f"{path.stem}: {error}")
    if studied:
        print(write_study(studied, out), end="")
    say(f"{len(studied)} of {len(scenes)} scenes in {duration(time.monotonic() - start)}, in {out}")
    for reason in failed:
        say(f"error: {reason}")
    return 1 if failed else 0


def quick_defaults() -> argparse.Namespace:
    """What the preset quick cuts further for a study of all scenes: ten minutes on two cores."""
    iterations = [f"{builder}.iterations={QUICK_ITERATIONS}" for builder in QUICK_PARAMS]
    return argparse.Namespace(ray_long_side=80, judged_rays=64, param=iterations)


def parse(words: Sequence[str] | None = None) -> tuple[argparse.Namespace, Plan]:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="*", type=Path, help=".blend; default: blender_scenes/")
    parser.add_argument("--out", type=Path, default=Path("out/study"))
    parser.add_argument(
        "--curves",
        type=lambda text: [word for word in text.split(",") if word],
        default=["lbvh_2", "ploc_8", "sbvh_8"],
        metavar="A,B",
        help="variants whose error against time is drawn; default: lbvh_2,ploc_8,sbvh_8",
    )
    parser.add_argument(
        "--target", type=float, default=0.05, help="relMSE to give the time to (0.05)"
    )
    for name, default, text in (
        ("picture-depth", 8, "bounces in the pictures of curves and contact sheet"),
        ("curve-side", 96, "pixels along the longer side of the curves' pictures"),
        ("curve-samples", 32, "where the curves end"),
        ("curve-repeats", 2, "timed renders of each curve"),
        ("reference-samples", 256, "of the curves' converged picture"),
        ("sheet-side", 192, "pixels along the longer side of the contact sheet's pictures"),
        ("sheet-samples", 16, "of the contact sheet's pictures; 0: no contact sheet"),
    ):
        parser.add_argument(f"--{name}", type=int, default=default, help=f"{text} ({default})")
    add_plan_arguments(parser)
    parser.set_defaults(reorder="off,aila", build_repeats=1, embree=False, param=[])
    arguments = parser.parse_args(words)
    if arguments.preset == "quick":
        arguments = parser.parse_args(words, quick_defaults())
    try:
        plan = plan_from_arguments(arguments)
        plan.check(core.builders(), core.devices())
        for name in arguments.curves:
            variant(name)
    except ValueError as error:
        parser.error(str(error))
    plan.pictures = plan.target_error > 0.0  # else the contact sheet and the curves are enough
    missing = [path for path in arguments.scenes if not path.is_file()]
    if missing:
        parser.error(f"there is no file {missing[0]}")
    return arguments, plan


if __name__ == "__main__":
    assert bpy.app.version
    sys.exit(run(*parse()))
