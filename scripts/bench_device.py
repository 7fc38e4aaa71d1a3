#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""`make bench DEVICE=opencl`: an OpenCL device beside the native CPU core and the paper's figures.

Builds and tracing of each scene as Markdown tables, in one file named after the device, with CSV
files beside it. The CPU core takes turns with the device in the same run: machines are shared and
noisy, so ratios are taken round by round. Answers and trees are compared with the CPU core's bit
for bit. What was measured is written after every builder; Ctrl-C leaves it, marked as not complete.
Needs no Blender, Embree or OpenImageIO.
"""

from __future__ import annotations

import argparse
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from bench_device_builds import labels, measure_build
from bench_device_rays import Rays, fitting_plan, make_rays, measure_traces
from bench_device_text import (
    SceneResult,
    builds_csv,
    kernels_csv,
    scene_lines,
    summary_lines,
    traces_csv,
)
from bench_scenes import OUR_VIEWS, PAPER_VIEWS, SHARED, load_scene
from bvh_lab.native import core
from bvh_lab.study.devices import CPU, described, resolved, short_name
from bvh_lab.study.machine import describe_machine
from bvh_lab.study.output import file_stems, write_text_aside
from bvh_lab.study.plan import BUILDERS, QUICK_PARAMS, Plan
from bvh_lab.study.scene import Scene

SCENES = ("sibenik", "crytek_sponza", "bathroom", "crown")  # small ones first
KERNELS = ("lbvh", "hlbvh", "ploc", "atrbvh", "prbvh", "prbvh_a", "trbvh")  # builders as kernels
FEW = ("lbvh", "ploc", "atrbvh", "prbvh", "sbvh")  # whose trees a processor traces
ITERATIONS = 20  # of annealing where no GPU does it


# --- settings ------------------------------------------------------------------------------------


@dataclass
class Settings:
    """All choices. ``seconds`` 0 takes the plan's resolution, else as many pixels as fit."""

    device: str
    plan: Plan
    builders: list[str]
    traced: list[str]
    params: dict[str, dict[str, float]]
    seconds: float
    cpu: bool
    cpu_views: int
    rounds: int
    build_repeats: int
    longest_build: float


def settings_of(arguments: argparse.Namespace, entry: dict[str, Any]) -> Settings:
    """The paper's settings on a GPU; fewer rays, iterations and traced trees elsewhere."""
    gpu = bool(entry["is_gpu"])
    plan = Plan.from_preset("paper")
    sides = [int(side) for side in (arguments.resolution or "1024x768").split("x")]
    if len(sides) != 2:
        raise ValueError(f"--resolution takes 640x480 and the like, not {arguments.resolution}")
    plan.width, plan.height = sides
    plan.depth = arguments.depth if arguments.depth is not None else 8 if gpu else 2
    built = list(BUILDERS if gpu else KERNELS)
    if arguments.builders:
        built = arguments.builders.split(",")
    if arguments.traced is not None:
        traced = [name for name in arguments.traced.split(",") if name]
    else:
        traced = [name for name in FEW if name in built or not arguments.builders]
        traced = built if gpu or arguments.builders else traced
    plan.builders = [name for name in BUILDERS if name in {*built, *traced}]
    plan.builders += [name for name in dict.fromkeys([*built, *traced]) if name not in BUILDERS]
    plan.params = {name: dict(of) for name, of in QUICK_PARAMS.items()}
    for settings in plan.params.values():
        settings["iterations"] = float(settings["iterations"] if gpu else ITERATIONS)
    plan.devices, plan.repeats = [entry["id"]], arguments.rounds
    plan.check(core.builders(), core.devices())
    return Settings(
        entry["id"],
        plan,
        plan.builders,
        traced,
        plan.params,
        seconds=0.0 if gpu or arguments.resolution else arguments.seconds,
        cpu=not arguments.no_cpu,
        cpu_views=0 if arguments.no_cpu else 1 if gpu else 3,
        rounds=arguments.rounds,
        build_repeats=arguments.build_repeats,
        longest_build=arguments.longest_build or (600.0 if gpu else 120.0),
    )


# --- measuring -----------------------------------------------------------------------------------


@dataclass
class Bench:
    """A run: its results so far, and what is called as each part is done."""

    settings: Settings
    token: Any
    on_result: Callable[[], None]
    results: list[SceneResult] = field(default_factory=list)
    doing: str = ""
    start: float = field(default_factory=time.monotonic)
    slowness: dict[str, float] = field(default_factory=dict)  # seconds a triangle, last scene's

    def run(self, paths: list[Path]) -> None:
        """Measure all scenes. Raises Cancelled."""
        for path in paths:
            self.say(f"{path.stem}: reading")
            scene = load_scene(path)
            views = [camera.name for camera in scene.cameras[:3]]
            result = SceneResult(path.stem, len(scene.triangles), views)
            self.results.append(result)
            self.scene(scene, result)
            self.on_result()

    def scene(self, scene: Scene, result: SceneResult) -> None:
        """All builders on a scene."""
        settings = self.settings
        mesh = core.Mesh(scene.vertices, scene.triangles)
        base, rays = self.prepare(scene, mesh, result) if settings.traced else (None, None)
        for builder in settings.builders:
            name = labels()[builder]
            expected = self.slowness.get(builder, 0.0) * result.triangles
            if expected > settings.longest_build:
                result.left_out.append(
                    f"{name}: would take about {expected:.0f} s by what it took before "
                    f"(--longest-build {expected:.0f} takes it)"
                )
                continue
            self.say(f"{result.name}: building {name}")
            build = measure_build(
                mesh,
                builder,
                settings.params.get(builder, {}),
                settings.device,
                settings.cpu,
                settings.build_repeats,
                self.token,
            )
            result.builds.append(build)
            if not build.error:
                self.slowness[builder] = build.seconds() / result.triangles
            if rays and build.tree and builder in settings.traced:
                self.say(f"{result.name}: tracing {name}")
                self.trace(build, base, rays, result)
            build.tree = None
            self.on_result()

    def prepare(self, scene: Scene, mesh: Any, result: SceneResult) -> tuple[Any, Rays | None]:
        """The binary LBVH on the device, and the rays."""
        settings, token = self.settings, self.token
        self.say(f"{result.name}: making rays")
        reference = core.build(mesh, "lbvh", token=token)
        plan = settings.plan
        try:
            base = core.build(mesh, "lbvh", branching=2, device=settings.device, token=token)
            if settings.seconds:
                plan = fitting_plan(
                    scene, reference, base, settings.device, plan, settings.seconds, token
                )
        except (RuntimeError, MemoryError) as error:
            if isinstance(error, core.Cancelled):
                raise
            result.left_out.append(f"tracing, for the binary LBVH failed: {error}")
            return None, None
        rays = make_rays(scene, reference, plan, token)
        result.size, result.rays = rays.size, rays.counts()
        self.say(f"{result.name}: {sum(result.rays.values()):,d} rays")
        return base, rays

    def trace(self, build: Any, base: Any, rays: Rays, result: SceneResult) -> None:
        """One builder's tree in all shapes."""
        settings = self.settings
        try:
            result.traced += measure_traces(
                build.tree,
                (build.builder, build.label),
                None if build.builder == "lbvh" else base,
                rays,
                settings.device,
                settings.cpu_views,
                settings.rounds,
                self.token,
            )
        except (RuntimeError, MemoryError) as error:
            if isinstance(error, core.Cancelled):
                raise
            result.left_out.append(f"tracing {build.label}, for the binary LBVH failed: {error}")

    def say(self, text: str) -> None:
        """One line of progress."""
        self.doing = text
        minutes, seconds = divmod(int(time.monotonic() - self.start), 60)
        print(f"[{minutes:2d}:{seconds:02d}] {text}", file=sys.stderr, flush=True)


# --- text ----------------------------------------------------------------------------------------


def commit() -> str:
    run = subprocess.run(
        ["git", "describe", "--always", "--dirty"],
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        check=False,
    )
    return run.stdout.strip() or "unknown"


def head(entry: dict[str, Any], settings: Settings) -> list[str]:
    """What was measured where and how."""
    machine, plan = describe_machine(core, ""), settings.plan
    lacking = [f"without {name}" for name, there in core.features().items() if not there]
    annealing = plan.params["prbvh_a"]["iterations"]
    rivals = ""
    if settings.cpu:
        rivals = ", in turns with the native CPU core on the same trees"
        if settings.cpu_views < 3:
            rivals += " (of it the first view only; ratios are of that view)"
    return [
        f"# {short_name(entry['id'])}",
        "",
        f"- {datetime.now(UTC):%Y-%m-%d}, BVH Lab {machine.version}, commit {commit()}"
        + (f", core built {', '.join(lacking)}" if lacking else ""),
        f"- Device {entry['id']}: {described(entry)}",
        f"- Machine: {machine.cpu}, {machine.cores} cores, {core.devices()[0]['simd']}; "
        f"{machine.system}",
        f"- Rays: those of one path a pixel, depth {plan.depth}, {plan.shadow_rays} shadow rays a "
        f"hit; {settings.rounds} rounds after a warm-up{rivals}. MRays/s by the device's own "
        "clock, kernels alone (the CPU core's: wall clock), sorting included; the mean over views. "
        "Medians; ± is half the distance between the quartiles.",
        "- Builds: wall clock from the first command to the last, without copies and without "
        f"compiling programs; {settings.build_repeats} after a warm-up, 3 of slow ones, and of "
        f"very slow ones the first (once). Annealing: {annealing:.0f} iterations, the paper's are "
        "3000. SAH, SBVH and Hybrid trees are made by the CPU core, as in the paper, which also "
        "makes the SBVH that PRBVHₛ and PRBVHₛᴬ begin with, in their time.",
        f"- Every answer{' and every 8-wide tree' if settings.cpu else ''} was compared with the "
        "CPU core's, bit for bit: see the last column of each table.",
        "- The paper's figures are of a Radeon RX 6800 XT, on other exports of the scenes but for "
        "crytek_sponza. Ratios are ours over the other, for times the other over ours.",
        "",
    ]


def whose_views(scene: str) -> str:
    if scene in PAPER_VIEWS:
        return "the paper's"
    return "ours, not the paper's" if scene in OUR_VIEWS else "around it, not the paper's"


@dataclass
class Files:
    """Where the results go: text and CSV, each whole at any time."""

    folder: Path
    stem: str
    head: list[str]

    def write(self, results: list[SceneResult], unfinished: str) -> str:
        """Write all; gives the text. ``unfinished`` says why it is not complete, if it is not."""
        lines = list(self.head)
        if unfinished:
            lines += [f"**NOT COMPLETE: {unfinished}.**", ""]
        for result in results:
            lines += scene_lines(result, whose_views(result.name))
        lines += summary_lines(results)
        text = "\n".join(lines).rstrip() + "\n"
        write_text_aside(self.folder / f"{self.stem}.md", text)
        for name, table in (("builds", builds_csv), ("kernels", kernels_csv), ("rays", traces_csv)):
            write_text_aside(self.folder / f"{self.stem}_{name}.csv", table(results))
        return text


# --- command -------------------------------------------------------------------------------------


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="*", type=Path, help=f"default: {', '.join(SCENES)}")
    parser.add_argument("--device", default="opencl", help="see the command devices")
    parser.add_argument("--out", type=Path, default=Path("out/bench"))
    parser.add_argument(
        "--builders", help=f"to time; default: all on a GPU, {','.join(KERNELS)} elsewhere"
    )
    parser.add_argument(
        "--traced",
        help="whose trees to trace, '' for none; default: those of --builders, or all on a GPU, "
        f"{','.join(FEW)} elsewhere",
    )
    parser.add_argument("--no-cpu", action="store_true", help="leave the CPU core out")
    parser.add_argument("--rounds", type=int, default=5, help="timed ones of tracing (5)")
    parser.add_argument("--build-repeats", type=int, default=5, help="timed builds (5)")
    parser.add_argument(
        "--resolution",
        help="of the rays; default: 1024x768 on a GPU, elsewhere what takes --seconds",
    )
    parser.add_argument(
        "--seconds", type=float, default=0.5, help="of a round of the binary LBVH (0.5)"
    )
    parser.add_argument("--depth", type=int, help="default: 8 on a GPU, 2 elsewhere")
    parser.add_argument(
        "--longest-build",
        type=float,
        default=0.0,
        help="seconds; what is likely to take longer is left out (600 on a GPU, 120 elsewhere)",
    )
    return parser.parse_args()


def prepared(arguments: argparse.Namespace) -> tuple[list[Path], Settings, Files]:
    """Scenes, settings and files. Raises ValueError or OSError naming what is wrong."""
    paths = arguments.scenes or [SHARED / f"{name}.npz" for name in SCENES]
    for path in paths:
        if not path.is_file():
            raise ValueError(f"there is no file {path}")
    (device,) = resolved([arguments.device], core.devices())
    entry = next(dict(d) for d in core.devices() if d["id"] == device)
    if device == CPU:
        raise ValueError("the CPU core is what is compared with: choose an OpenCL device")
    settings = settings_of(arguments, entry)
    arguments.out.mkdir(parents=True, exist_ok=True)
    name = short_name(device)
    stem = file_stems([name])[name]
    return paths, settings, Files(arguments.out, stem, head(entry, settings))


def main() -> int:
    arguments = parse()
    try:
        paths, settings, files = prepared(arguments)
    except (ValueError, OSError) as error:
        print(f"bench: error: {error}", file=sys.stderr)
        return 2
    bench = Bench(settings, core.Token(), lambda: files.write(bench.results, "still running"))
    for stop in (signal.SIGINT, signal.SIGTERM):  # the core hears of them by its token alone
        signal.signal(stop, lambda *_: bench.token.cancel())
    unfinished = ""
    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(bench.run, paths)
        while not running.done():
            time.sleep(0.1)
    try:
        running.result()
    except core.Cancelled:
        unfinished = f"stopped at {bench.doing}"
    except (ValueError, RuntimeError, MemoryError, OSError) as error:
        unfinished = f"failed at {bench.doing}: {error}"
    text = files.write(bench.results, unfinished)
    print(text, end="")
    failures = [line for result in bench.results for line in result.failures()]
    for line in [*failures, *([f"not complete: {unfinished}"] if unfinished else [])]:
        print(f"bench: error: {line}", file=sys.stderr)
    print(f"bench: wrote {files.folder / files.stem}.md", file=sys.stderr)
    return 1 if failures or unfinished else 0


if __name__ == "__main__":
    sys.exit(main())
