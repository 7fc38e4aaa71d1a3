#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""`make bench DEVICE=opencl`: an OpenCL device beside the native CPU core and the paper's figures.

Builders and tracing of each scene as Markdown tables, in one file named after the device, which
says what was measured where. The CPU core takes turns with the device in the same run: machines are
shared and noisy, so ratios are taken round by round. Needs no Blender, Embree or OpenImageIO.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from bench_ratios import speed_ratios
from bench_scenes import PAPER_VIEWS, SHARED, load_scene
from bvh_lab.native import core
from bvh_lab.study.devices import CPU, described, resolved, short_name
from bvh_lab.study.machine import describe_machine
from bvh_lab.study.plan import BUILDERS, QUICK_PARAMS, Plan
from bvh_lab.study.precision import LAYOUTS, width_text
from bvh_lab.study.results import Result, Row, spread
from bvh_lab.study.run import Step, compare
from bvh_lab.study.scene import Scene

PAPER = SHARED.parent / "paper"
PAPER_SCENES = {"crytek_sponza": "CrytekSponza", "sibenik": "Sibenik", "crown": "Crown"}
SCENES = ("crytek_sponza", "sibenik", "bathroom", "crown")
SLOW_SECONDS = 10.0  # what takes longer to build is built once more after the warm-up, and timed
ON_PROCESSORS = ("lbvh", "hlbvh", "ploc", "atrbvh", "trbvh", "prbvh", "sbvh")  # by default
COLUMNS = [("primary", False)]
COLUMNS += [(kind, ordered) for kind in ("secondary", "shadow") for ordered in (False, True)]


# --- the paper -----------------------------------------------------------------------------------


def paper_cells(table: str, value: str) -> dict[tuple[str, ...], float]:
    """The numbers of a CSV file of the paper by the texts of its other columns, in lower case."""
    path = PAPER / table
    if not path.exists():
        return {}
    with path.open() as file:
        return {
            tuple(text.lower() for name, text in line.items() if name != value): float(line[value])
            for line in csv.DictReader(file)
        }


def paper_kind(kind: str, ordered: bool) -> str:
    return f"{kind}_reordered" if ordered else kind


# --- builds --------------------------------------------------------------------------------------


@dataclass
class Builds:
    """What the builds of one tree took, an entry each, and each kernel in the last."""

    seconds: list[float] = field(default_factory=list)
    collapse_seconds: list[float] = field(default_factory=list)
    transfer_seconds: list[float] = field(default_factory=list)
    program_seconds: float = 0.0
    kernels: list[dict[str, Any]] = field(default_factory=list)
    made_on: str = ""

    @property
    def kernel_seconds(self) -> float:
        return sum(kernel["seconds"] for kernel in self.kernels if kernel["of"] == "tree")


def add_build(builds: Builds, mesh: Any, builder: str, device: str, timed: bool) -> float:
    """Build once, with the collapse to 8-wide nodes; gives the seconds of both."""
    tree = core.build_tree(mesh, builder, device=device, params=QUICK_PARAMS.get(builder, {}))
    bvh = tree.collapse(8)
    stats = bvh.stats
    builds.program_seconds += stats["program_seconds"]
    builds.made_on = stats["tree_device"]
    if timed:
        builds.seconds.append(stats["tree_seconds"])
        builds.collapse_seconds.append(stats["collapse_seconds"])
        builds.transfer_seconds.append(stats["transfer_seconds"])
        builds.kernels = [{"of": "tree", **kernel} for kernel in tree.kernels]
        builds.kernels += [{"of": "collapse", **kernel} for kernel in bvh.collapse_kernels]
    return float(stats["build_seconds"])


def measure_builds(
    mesh: Any, builder: str, devices: Sequence[str], repeats: int
) -> dict[str, Builds]:
    """A warm-up, then the timed builds, the devices in turns."""
    builds = {device: Builds() for device in devices}
    slow = [
        add_build(builds[device], mesh, builder, device, timed=False) > SLOW_SECONDS
        for device in devices
    ]
    for _ in range(1 if any(slow) else repeats):
        for device in devices:
            add_build(builds[device], mesh, builder, device, timed=True)
    return builds


def build_line(scene: str, builder: str, builds: dict[str, Builds], device: str) -> list[str]:
    """Cells of the table of builds."""
    ours = builds[device]
    of_paper = paper_cells("build_time.csv", "build_ms")
    paper = of_paper.get((PAPER_SCENES.get(scene, "").lower(), builder))
    ratio = ""
    if cpu := builds.get(CPU):
        pairs = zip(cpu.seconds, ours.seconds, strict=True)
        ratio = with_spread([theirs / own for theirs, own in pairs], 2)
    return [
        builder,
        "CPU core" if ours.made_on == CPU else "device",
        with_spread([1e3 * s for s in ours.seconds], 1),
        f"{1e3 * ours.kernel_seconds:.1f}" if ours.kernels else "-",
        f"{1e3 * spread(ours.transfer_seconds).median:.1f}",
        with_spread([1e3 * s for s in ours.collapse_seconds], 1),
        with_spread([1e3 * s for s in cpu.seconds], 1) if cpu else "-",
        ratio or "-",
        f"{paper:g}" if paper else "-",
        f"{paper / (1e3 * spread(ours.seconds).median):.2g}" if paper else "-",
    ]


def kernel_lines(builder: str, builds: Builds) -> list[list[str]]:
    """Every kernel of a build, the slow ones first."""
    kernels = sorted(builds.kernels, key=lambda kernel: -kernel["seconds"])
    return [
        [builder, k["of"], k["stage"], k["kernel"], str(k["launches"]), f"{1e3 * k['seconds']:.2f}"]
        for k in kernels
    ]


# --- tracing -------------------------------------------------------------------------------------


def row_of(result: Result, like: Row, **changes: Any) -> Row | None:
    """The row that differs from ``like`` in these fields only."""
    names = ("builder", "branching", "layout", "reorder", "device")
    wanted = {name: getattr(like, name) for name in names} | changes
    for row in result.rows:
        if all(getattr(row, name) == value for name, value in wanted.items()):
            return None if row.error else row
    return None


def trace_lines(result: Result, scene: str, device: str) -> list[list[str]]:
    """Cells: MRays/s, in brackets over the CPU core's in the same rounds and over the paper's."""
    paper = paper_cells("trace_speed.csv", "mrays_per_s")
    lines = []
    for row in result.rows:
        if (row.device, row.reorder) != (device, "off"):
            continue
        name = f"{row.label} {width_text(row.branching, row.layout)}"
        if row.error:
            lines.append([name, f"failed: {row.error.splitlines()[0]}", *[""] * len(COLUMNS)])
            continue
        cells = []
        for kind, ordered in COLUMNS:
            ours = row_of(result, row, reorder="aila" if ordered else "off")
            place = (scene, str(row.branching), paper_kind(kind, ordered), row.builder)
            of_paper = None if row.layout == "cwbvh" else paper.get(place)
            cells.append(speed_cell(result, ours, kind, of_paper))
        lines.append([name, *cells, row.shape])
    return lines


def speed_cell(result: Result, row: Row | None, kind: str, paper: float | None) -> str:
    if row is None or (speed := row.speed(kind)) is None:
        return "-"
    parts = []
    if cpu := row_of(result, row, device=CPU):
        parts.append(f"{spread(speed_ratios(row, cpu, kind)).median:.2f} CPU")
    if paper:
        parts.append(f"{speed.median / paper:.2g} paper")
    return f"{speed.median:.2f} ±{speed.half_percent:.0f}%" + (
        f" ({', '.join(parts)})" if parts else ""
    )


def relative_lines(result: Result, device: str) -> list[list[str]]:
    """Table 1: speeds relative to the binary LBVH without reordering, the paper's in brackets."""
    paper = paper_cells("relative_speed.csv", "speed_relative_to_binary_lbvh")
    rows = [row for row in result.rows if (row.device, row.reorder) == (device, "off")]
    rows = [row for row in rows if not row.error]
    base = next((r for r in rows if (r.builder, r.branching) == ("lbvh", 2)), None)
    if base is None:
        return []
    lines = []
    for row in rows:
        cells = []
        for kind, ordered in COLUMNS:
            ours = row_of(result, row, reorder="aila" if ordered else "off")
            if ours is None or not (ratios := speed_ratios(ours, base, kind)):
                cells.append("-")
                continue
            place = (str(row.branching), paper_kind(kind, ordered), row.builder)
            theirs = None if row.layout == "cwbvh" else paper.get(place)
            cells.append(
                f"{spread(ratios).median:.2f}" + (f" ({theirs:.2f})" if theirs is not None else "")
            )
        lines.append([f"{row.label} {width_text(row.branching, row.layout)}", *cells])
    return lines


# --- text ----------------------------------------------------------------------------------------


def with_spread(samples: Sequence[float], digits: int) -> str:
    middle = spread(list(samples))
    said = f" ±{middle.half_percent:.0f}%" if len(samples) > 1 else " once"
    return f"{middle.median:.{digits}f}{said}"


def table(heading: Sequence[str], lines: Iterable[Sequence[str]]) -> list[str]:
    """A Markdown table, numbers to the right."""
    rule = ["---", *["--:"] * (len(heading) - 1)]
    return [f"| {' | '.join(cells)} |" for cells in (heading, rule, *lines)]


def commit() -> str:
    run = subprocess.run(
        ["git", "describe", "--always", "--dirty"], capture_output=True, text=True, check=False
    )
    return run.stdout.strip() or "unknown"


def head(entry: dict[str, Any], plan: Plan, arguments: argparse.Namespace) -> list[str]:
    """What was measured where."""
    machine = describe_machine(core, "")
    lacking = [f"without {name}" for name, there in core.features().items() if not there]
    rivals = "" if arguments.no_cpu else ", in turns with the native CPU core"
    return [
        f"# {short_name(entry['id'])}",
        "",
        f"- {datetime.now(UTC):%Y-%m-%d}, BVH Lab {machine.version}, commit {commit()}"
        + (f", core built {', '.join(lacking)}" if lacking else ""),
        f"- Device {entry['id']}: {described(entry)}",
        f"- Machine: {machine.cpu}, {machine.cores} cores, {core.devices()[0]['simd']}; "
        f"{machine.system}",
        f"- Rays: those of one path for each of {plan.width}x{plan.height} pixels in each view, "
        f"depth {plan.depth}, {plan.shadow_rays} shadow rays a hit; {plan.repeats} rounds after a "
        f"warm-up{rivals}. MRays/s by the device's own clock, kernels alone; ± is half the "
        "distance between the quartiles.",
        "- Builds: wall clock from the first command to the last, without copies and without "
        f"compiling programs; {arguments.build_repeats} after a warm-up. Annealing: "
        f"{QUICK_PARAMS['prbvh_a']['iterations']:.0f} iterations, the paper's are 3000.",
        "- The paper's figures are of a Radeon RX 6800 XT, on other exports of the scenes but for "
        "crytek_sponza; ratios to them are ours over theirs (build: theirs over ours).",
        "",
    ]


def bench(path: Path, plan: Plan, device: str, arguments: argparse.Namespace) -> list[str]:
    """The scene's part of the file."""
    scene = load_scene(path)
    mesh = core.Mesh(scene.vertices, scene.triangles)
    seen = "the paper's" if path.stem in PAPER_VIEWS else "ours, not the paper's"
    lines = [f"## {path.stem}: {len(scene.triangles):,d} triangles, {len(scene.cameras)} views "]
    lines[0] += f"({seen})"
    heading = ["builder", "made by", "binary tree, ms", "of which kernels", "copies, ms"]
    heading += ["collapse to 8-wide, ms", "CPU core, ms", "CPU core / device", "paper, ms"]
    built, kernels = build_tables(path.stem, mesh, plan, device, arguments.build_repeats)
    lines += ["", *table([*heading, "paper / device"], built)]
    if kernels:
        heading = ["builder", "of", "stage", "kernel", "launches", "ms"]
        lines += ["", "Kernels of the last build:", "", *table(heading, kernels)]
    if arguments.builds_only:
        return [*lines, ""]
    return [*lines, *traced(scene, path.stem, plan, device), ""]


def build_tables(
    stem: str, mesh: Any, plan: Plan, device: str, repeats: int
) -> tuple[list[list[str]], list[list[str]]]:
    """Lines of the table of builds and of that of kernels; what fails says why."""
    built, kernels = [], []
    for builder in plan.builders:
        say(f"{stem}: building {builder}")
        try:
            builds = measure_builds(mesh, builder, plan.devices, repeats)
        except (ValueError, RuntimeError, MemoryError) as error:
            built.append([builder, f"failed: {str(error).splitlines()[0]}", *["-"] * 8])
            continue
        built.append(build_line(stem, builder, builds, device))
        kernels += kernel_lines(builder, builds[device])
    return built, kernels


def traced(scene: Scene, stem: str, plan: Plan, device: str) -> list[str]:
    """Speeds of all trees, and relative to the binary LBVH."""
    result = compare(scene, plan, on_event=show).result
    names = [kind + (", sorted" if ordered else "") for kind, ordered in COLUMNS]
    of_paper = PAPER_SCENES.get(stem, "").lower()
    lines = [
        "",
        "MRays/s:",
        "",
        *table(["tree", *names, "kernel"], trace_lines(result, of_paper, device)),
    ]
    relative = relative_lines(result, device)
    if relative:
        lines += ["", "Relative to binary LBVH (in brackets the paper's mean over its scenes):", ""]
        lines += table(["tree", *names], relative)
    wrong = sum(row.errors().wrong for row in result.rows)
    judged = sum(row.errors().judged for row in result.rows)
    differing = sum(row.differing_rays() or 0 for row in result.rows)
    lines += [
        "",
        f"Wrong hits: {wrong} of {judged} judged. Rays answered otherwise than by the CPU core: "
        f"{differing}.",
    ]
    return lines + [f"- FAILED {row.name}: {row.error}" for row in result.rows if row.error]


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def show(event: Any) -> None:
    if isinstance(event, Step) and sys.stderr.isatty():
        print(f"\r{event.fraction:4.0%} {event.stage[:90]:<90}", end="", file=sys.stderr)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", type=Path, help=f"default: {', '.join(SCENES)}")
    parser.add_argument("--device", default="opencl", help="see the command devices")
    parser.add_argument("--out", type=Path, default=Path("out/bench"))
    parser.add_argument(
        "--builders", help=f"default: all on a GPU, {','.join(ON_PROCESSORS)} elsewhere"
    )
    parser.add_argument("--builds-only", action="store_true", help="trace nothing")
    parser.add_argument("--no-cpu", action="store_true", help="leave the CPU core out")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--build-repeats", type=int, default=3)
    parser.add_argument("--resolution", help="default: 1024x768 on a GPU, 320x240 elsewhere")
    parser.add_argument("--depth", type=int, help="default: 8 on a GPU, 2 elsewhere")
    return parser.parse_args()


def plan_of(arguments: argparse.Namespace, entry: dict[str, Any]) -> Plan:
    """The paper's settings on a GPU, fewer rays elsewhere."""
    gpu = bool(entry["is_gpu"])
    plan = Plan.from_preset("paper")
    for builder, settings in QUICK_PARAMS.items():  # the full annealing takes minutes
        plan.params.setdefault(builder, {}).update(settings)
    chosen = arguments.builders.split(",") if arguments.builders else []
    plan.builders = chosen or list(BUILDERS if gpu else ON_PROCESSORS)
    sides = (arguments.resolution or ("1024x768" if gpu else "320x240")).split("x")
    plan.width, plan.height = (int(side) for side in sides)
    plan.depth = arguments.depth if arguments.depth is not None else 8 if gpu else 2
    plan.devices = [entry["id"]] if arguments.no_cpu else [CPU, entry["id"]]
    plan.reorders, plan.layouts = ["off", "aila"], list(LAYOUTS)
    plan.repeats, plan.build_repeats = arguments.repeats, 1
    plan.pictures, plan.embree, plan.judged_rays = False, False, 128
    plan.check(core.builders(), core.devices())
    return plan


def main() -> int:
    arguments = parse()
    paths = arguments.scenes or [SHARED / f"{name}.npz" for name in SCENES]
    missing = [str(path) for path in paths if not path.is_file()]
    try:
        if missing:
            raise ValueError(f"there is no file {missing[0]}")
        (device,) = resolved([arguments.device], core.devices())
        entry = next(dict(d) for d in core.devices() if d["id"] == device)
        plan = plan_of(arguments, entry)
    except ValueError as error:
        print(f"bench: error: {error}", file=sys.stderr)
        return 2
    arguments.out.mkdir(parents=True, exist_ok=True)
    stem = "".join(c if c.isalnum() else "-" for c in short_name(device))
    file = arguments.out / f"{stem}.md"
    lines = head(entry, plan, arguments)
    for path in paths:
        lines += bench(path, plan, device, arguments)
        file.write_text("\n".join(lines))  # what is measured stays, whatever happens to the next
    print("\n".join(lines))
    say(f"wrote {file}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
