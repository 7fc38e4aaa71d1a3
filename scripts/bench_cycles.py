#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Our path tracer against Cycles: do both converge to the same picture, and which is there first?

Both render the same .blend on the CPU in turns, with the same threads, size, camera and depth.
Both are judged by our converged picture; what that differs from Cycles' own is shown apart, and is
far too little to count at relMSE 0.01. Writes text, CSV, the plot of error against time and the
picture of differences.

Seconds are those of path tracing alone: ours as the core counts them, without building the tree;
those of Cycles are n times its seconds per sample, (T(n) - T(1)) / (n - 1), so that reading the
scene, its tree and writing the file are in none.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

import bpy
import numpy as np
from blender_scene import open_for_render
from bvh_lab.blender.extract import extract_scene
from bvh_lab.native import core
from bvh_lab.study.agreement import agreement
from bvh_lab.study.console import stdout_to_stderr
from bvh_lab.study.core_scene import core_scene
from bvh_lab.study.figures import FigureError, error_against_time, residual_figure
from bvh_lab.study.image_error import (
    MEASURES,
    TARGET,
    Curve,
    Point,
    curves_csv,
    curves_table,
    doubling,
    measure_curves,
    noise_note,
    our_contestant,
)
from bvh_lab.study.machine import describe_machine, usable_cores
from bvh_lab.study.output import write_text_aside
from bvh_lab.study.plan import Plan
from bvh_lab.study.rays import View, choose_views
from bvh_lab.study.reference_picture import ReferencePicture, combine, reference_picture

AIM = 0.7  # of Cycles' time to the target
LEAST_SECONDS = 2.0  # of the render that Cycles is timed by
WORKER = Path(__file__).with_name("cycles_worker.py")
ATRIUM = Path(__file__).parents[1] / "blender_scenes" / "atrium.blend"


def say(text: str) -> None:
    print(f"bench_cycles: {text}", file=sys.stderr, flush=True)


# --- Cycles ---------------------------------------------------------------------------------------


class Cycles:
    """Cycles in its own process; use as a context manager."""

    def __init__(self, arguments: argparse.Namespace, camera: str) -> None:
        width, height = arguments.resolution
        settings = {
            "width": width,
            "height": height,
            "camera": camera,
            "diffuse": arguments.materials == "diffuse",
            "depth": arguments.depth,
            "threads": arguments.threads,
        }
        self._folder = tempfile.TemporaryDirectory()
        self._log = Path(self._folder.name) / "cycles.log"
        self._process = subprocess.Popen(
            [sys.executable, str(WORKER), str(arguments.scene), json.dumps(settings)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log.open("w"),
            text=True,
        )
        self.version = str(self._answer()["version"])

    def __enter__(self) -> Cycles:
        return self

    def __exit__(self, *error: object) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()
        self._folder.cleanup()

    def seconds(self, samples: int, seed: int = 0) -> float:
        """Render and drop the picture."""
        return float(self._order(samples, seed, "")["seconds"])

    def picture(self, samples: int, seed: int) -> np.ndarray:
        """(H, W, 3) float32."""
        path = Path(self._folder.name) / "picture.npy"
        self._order(samples, seed, str(path))
        return np.load(path)

    def _order(self, samples: int, seed: int, pixels: str) -> dict[str, Any]:
        assert self._process.stdin is not None
        order = {"samples": samples, "seed": seed, "pixels": pixels}
        print(json.dumps(order), file=self._process.stdin, flush=True)
        return self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            self._process.wait()
            last = self._log.read_text(errors="replace").strip().splitlines()[-1:]
            raise RuntimeError(f"Cycles ended: {' '.join(last) or 'no reason given'}")
        return dict(json.loads(line))


@dataclass
class CyclesTimes:
    """Seconds of whole renders of 1 and of ``most`` samples, one entry per repeat."""

    most: int
    one: list[float] = field(default_factory=list)
    all: list[float] = field(default_factory=list)

    def per_sample(self) -> list[float]:
        return [(b - a) / (self.most - 1) for a, b in zip(self.one, self.all, strict=True)]

    def fill(self, curve: Curve) -> None:
        """Give the points their seconds, and the curve what came on top."""
        for point in curve.points:
            point.seconds = [point.samples * seconds for seconds in self.per_sample()]
        curve.overhead_seconds = max(median(self.one) - median(self.per_sample()), 0.0)


def samples_to_time(cycles: Cycles, samples: int) -> int:
    """So many samples, or more where a render of them is too short for the clock."""
    samples = max(samples, 2)
    while cycles.seconds(samples) < LEAST_SECONDS + cycles.seconds(1):
        samples *= 2
    return samples


def cycles_curve(cycles: Cycles, reference: ReferencePicture, most: int) -> Curve:
    """The errors of Cycles, without times, until the target is reached."""
    curve = Curve("cycles", f"Cycles {cycles.version}", "cycles")
    for count in doubling(most):
        error = core.image_error(cycles.picture(count, 0), reference.pixels)
        point = Point(count, errors={name: float(error[name]) for name in MEASURES})
        say(f"Cycles at {count} samples: relMSE {point.errors['relMSE']:.2g}")
        curve.points.append(point)
        if point.errors["relMSE"] <= TARGET:
            break
    return curve


# --- ours -----------------------------------------------------------------------------------------


@dataclass
class Ours:
    """The scene, ready for our path tracer."""

    scene: Any  # study.scene.Scene
    core_scene: Any
    view: View
    bvh: Any
    settings: dict[str, Any]


def prepare(arguments: argparse.Namespace) -> Ours:
    width, height = arguments.resolution
    with stdout_to_stderr():
        open_for_render(
            arguments.scene, width, height, arguments.camera, arguments.materials == "diffuse"
        )
    scene = extract_scene(bpy.context, "render")
    mesh = core.Mesh(scene.vertices, scene.triangles)
    made, notes = core_scene(core, mesh, scene)
    for note in [*scene.notes, *notes]:
        say(note)
    plan = Plan(views=[scene.cameras[0].name], width=width, height=height)
    bvh = core.build(
        mesh, arguments.builder, branching=arguments.branching, threads=arguments.threads
    )
    settings = {
        "seed": 0,
        "depth": arguments.depth,
        "shadow_rays": arguments.shadow_rays,
        "threads": arguments.threads,
    }
    return Ours(scene, made, choose_views(core, scene, plan)[0], bvh, settings)


# --- both -----------------------------------------------------------------------------------------


def converge(ours: Ours, cycles: Cycles, samples: int) -> tuple[ReferencePicture, ReferencePicture]:
    """The converged pictures of both, ours from the cache where it is there."""
    say(f"converging, {samples} samples per pixel")
    our_own = reference_picture(
        core, ours.bvh, ours.scene, ours.core_scene, ours.view, samples, ours.settings
    )
    for note in our_own.notes:
        say(note)
    say(f"converging with Cycles, {samples} samples per pixel")
    halves = [
        (count, cycles.picture(count, seed).astype(np.float64))
        for seed, count in ((1001, samples - samples // 2), (1002, samples // 2))
    ]
    return our_own, combine(halves)


def measure(
    ours: Ours, cycles: Cycles, reference: ReferencePicture, arguments: argparse.Namespace
) -> list[Curve]:
    """Both curves: every repeat times both, who is first changes."""
    label = next(b["label"] for b in core.builders() if b["id"] == arguments.builder)
    curve = Curve(
        f"{arguments.builder}_{arguments.branching}",
        f"BVH Lab, {label} {arguments.branching}-wide",
        builder=arguments.builder,
        branching=arguments.branching,
    )
    contestant = our_contestant(
        core, curve, ours.bvh, ours.core_scene, ours.view, ours.settings, core.Token()
    )
    rival = cycles_curve(cycles, reference, arguments.samples)
    times = CyclesTimes(samples_to_time(cycles, rival.points[-1].samples))

    def our_turn() -> None:
        counts = doubling(arguments.samples)
        measure_curves(core, [contestant], reference.pixels, counts, 1, enough=TARGET)

    def their_turn() -> None:
        times.one.append(cycles.seconds(1))
        times.all.append(cycles.seconds(times.most))

    for repeat in range(arguments.repeats):
        say(f"timing, repeat {repeat + 1} of {arguments.repeats}")
        turns = (our_turn, their_turn)
        for turn in turns if repeat % 2 == 0 else reversed(turns):
            turn()
    times.fill(rival)
    return [curve, rival]


def ratio_lines(ours: Curve, theirs: Curve) -> list[str]:
    """What it comes down to."""
    our_time, their_time = ours.time_to_error(), theirs.time_to_error()
    our_speed, their_speed = ours.samples_per_second(), theirs.samples_per_second()
    lines = []
    if our_speed and their_speed:
        lines.append(f"samples per second, ours / Cycles: {our_speed / their_speed:.2f}")
    if our_time is None or their_time is None:
        late = " and ".join(c.label for c in (ours, theirs) if c.time_to_error() is None)
        lines.append(f"time to relMSE {TARGET:g}: not reached by {late}; take more --samples")
    else:
        share = our_time / their_time
        verdict = "reached" if share < AIM else "missed"
        lines.append(
            f"time to relMSE {TARGET:g}, ours / Cycles: {share:.2f} (aim: under {AIM}, {verdict})"
        )
    lines.append(
        f"beside the path tracing: Cycles {theirs.overhead_seconds or 0.0:.2f} s for each picture"
    )
    return lines


def bench(arguments: argparse.Namespace) -> int:
    ours = prepare(arguments)
    name = arguments.scene.stem
    with Cycles(arguments, ours.view.name) as cycles:
        first = cycles.seconds(1)
        references = converge(ours, cycles, arguments.reference_samples)
        curves = measure(ours, cycles, references[0], arguments)
    found = agreement(*references)
    machine = describe_machine(core, f"bpy {bpy.app.version_string}")
    width, height = arguments.resolution
    note = noise_note(TARGET, references[0].error)
    lines = [
        f"{name}, camera {ours.view.name}, {width}x{height}, depth {arguments.depth}, "
        f"{arguments.shadow_rays} shadow rays per hit (Cycles: 1), materials {arguments.materials}",
        f"{machine.cpu}, {arguments.threads} threads, {arguments.repeats} repeats in turns",
        "",
        *curves_table(curves),
        *ratio_lines(*curves),
        f"our tree: {ours.bvh.stats['build_seconds']:.2f} s; Cycles' first picture of one sample, "
        f"with reading the scene and its tree: {first:.2f} s",
        f"converged pictures of {references[0].samples} samples, ours minus Cycles': "
        + found.sentence(),
        *([note] if note else []),
    ]
    print("\n".join(lines))
    arguments.out.mkdir(parents=True, exist_ok=True)
    stem = arguments.out / f"{name}_cycles"
    write_text_aside(stem.with_name(stem.name + ".txt"), "\n".join(lines) + "\n")
    write_text_aside(stem.with_name(stem.name + ".csv"), curves_csv(curves))
    title = f"{name}, camera {ours.view.name}, {width}×{height}, {arguments.threads} threads"
    try:
        error_against_time(curves, stem.with_name(stem.name + "_error"), title, references[0].error)
        residual_figure(
            ("BVH Lab", references[0].pixels),
            (curves[1].label, references[1].pixels),
            found.residual,
            stem.with_name(stem.name + "_residual"),
            f"{name}: mean difference {100.0 * found.mean:+.2f}% of the mean",
            limit=0.1,
        )
    except FigureError as error:
        say(str(error))
    return 0 if abs(found.mean) < 0.01 else 1


def parse(words: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", nargs="?", type=Path, default=ATRIUM, help=".blend")
    parser.add_argument("--out", type=Path, default=Path("out/bench"))
    parser.add_argument("--camera", default="", help="default: the scene's own")
    parser.add_argument("--resolution", type=size, default=(160, 120), metavar="WIDTHxHEIGHT")
    parser.add_argument("--depth", type=int, default=8, help="bounces after the first hit")
    parser.add_argument("--shadow-rays", type=int, default=2, help="of ours, per hit")
    parser.add_argument("--samples", type=int, default=1024, help="at most, per pixel")
    parser.add_argument("--reference-samples", type=int, default=1024)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--threads", type=int, default=usable_cores())
    parser.add_argument("--builder", default="sbvh")
    parser.add_argument("--branching", type=int, choices=(2, 4, 8), default=8)
    parser.add_argument(
        "--materials",
        choices=("diffuse", "as_is"),
        default="diffuse",
        help="diffuse: every Principled BSDF becomes a Diffuse BSDF of its colour, for both",
    )
    arguments = parser.parse_args(words)
    if arguments.samples < 2 or arguments.reference_samples < 2 or arguments.repeats < 1:
        parser.error("--samples and --reference-samples are 2 or more, --repeats 1 or more")
    if not arguments.scene.is_file():
        parser.error(f"there is no file {arguments.scene}")
    return arguments


def size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(side) for side in text.split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no size like 160x120") from None
    return width, height


if __name__ == "__main__":
    sys.exit(bench(parse()))
