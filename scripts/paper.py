#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""`make paper`: cost of every builder at branching 2, 4 and 8 beside the paper's (Tables 3 to 5).

Builders run as in preset `paper`. Writes cost.txt and cost.csv into out/paper/<scene>, after every
builder anew, and for builders that anneal the cost over time: cost_over_time.csv and .png. Build
times are ratios to this project's LBVH, the median of three builds right before.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from bvh_lab.native import core
from bvh_lab.study.console import ProgressLine
from bvh_lab.study.load import LoadError, load_mesh_file
from bvh_lab.study.machine import usable_cores
from bvh_lab.study.output import write_text_aside
from bvh_lab.study.plan import BRANCHINGS, BUILDERS, QUICK_PARAMS, Plan
from paper_tables import (
    Cell,
    Row,
    cost_csv,
    cost_table,
    curve_csv,
    draw_curves,
    row_text,
    settings_text,
)

PAPER_COSTS = Path(__file__).resolve().parents[2] / "shared" / "paper" / "bvh_cost.csv"
ANNEALING = tuple(QUICK_PARAMS)
PaperCosts = Mapping[tuple[str, int], float]  # by builder and branching


def complain(message: str) -> None:
    print(f"paper: warning: {message}", file=sys.stderr, flush=True)


# --- the paper's side ----------------------------------------------------------------------------


def read_paper_costs(path: Path) -> dict[str, dict[tuple[str, int], float]]:
    """Costs by the paper's scene name. Raises OSError, or ValueError naming the bad line."""
    scenes: dict[str, dict[tuple[str, int], float]] = {}
    with path.open(encoding="utf-8", newline="") as file:
        for line in csv.DictReader(file):
            try:
                cell = (line["builder"].lower(), int(line["branching"]))
                scenes.setdefault(line["scene"], {})[cell] = float(line["bvh_cost"])
            except (KeyError, TypeError, ValueError, AttributeError):
                raise ValueError(
                    f"{path} is no table of scene,branching,builder,bvh_cost: {line}"
                ) from None
    return scenes


def paper_scene(stem: str, scenes: Sequence[str]) -> str | None:
    """The paper's scene that a file is named after: crytek_sponza is CrytekSponza."""

    def plain(name: str) -> str:
        return "".join(c for c in name.lower() if c.isalnum())

    return next((scene for scene in scenes if plain(scene) == plain(stem)), None)


def find_paper_costs(arguments: argparse.Namespace) -> tuple[str, PaperCosts]:
    """A sentence on what the costs stand beside, and the paper's costs.

    Without a table, or for a scene that is not the paper's, no costs and the reason. Raises
    ValueError for a --paper-scene that is not in the table.
    """
    try:
        scenes = read_paper_costs(arguments.paper_costs)
    except (OSError, ValueError) as error:
        complain(f"there are no costs of the paper to compare with: {error}")
        return "No deviation is shown: the table of the paper's costs cannot be read.", {}
    name = arguments.paper_scene or paper_scene(arguments.scene.stem, list(scenes))
    if name is None:
        why = f"{arguments.scene.name} is none of the paper's scenes by its name"
        complain(f"{why}; --paper-scene takes one of {', '.join(scenes)}")
        return f"No deviation is shown: {why}.", {}
    if name not in scenes:
        raise ValueError(f"the paper has no scene {name!r}; it has {', '.join(scenes)}")
    return f"Beside the paper's costs for {name}, and the deviation from them.", scenes[name]


# --- our side ------------------------------------------------------------------------------------


def chosen_params(arguments: argparse.Namespace) -> dict[str, dict[str, float]]:
    """The paper's settings, changed by --iterations and --set. Raises ValueError."""
    params = Plan.from_preset("paper").params
    if arguments.iterations is not None:
        for builder in ANNEALING:
            params.setdefault(builder, {})["iterations"] = float(arguments.iterations)
    for setting in arguments.set:
        name, _, value = setting.partition("=")
        builder, _, parameter = name.partition(".")
        try:
            params.setdefault(builder, {})[parameter] = float(value)
        except ValueError:
            raise ValueError(f"--set is like sbvh.alpha=1e-5, not {setting!r}") from None
    return params


def chosen_builders(words: str, known: Sequence[str]) -> list[str]:
    """The builders asked for: by default all that there should be, and all that there are."""
    asked = [word.strip() for word in words.split(",") if word.strip()]
    return asked or [*BUILDERS, *(name for name in known if name not in BUILDERS)]


def in_background(call: Callable[[Any], Any]) -> Any:
    """What ``call(token)`` gives, run so that Ctrl-C ends it and a terminal shows how far it is."""
    token = core.Token()
    result: list[Any] = []
    failure: list[Exception] = []
    # Not Thread.join, after which an interrupted Python 3.11 takes a running thread for a dead one.
    finished = threading.Event()

    def work() -> None:
        try:
            result.append(call(token))
        except Exception as error:
            failure.append(error)
        finally:
            finished.set()

    terminal = sys.stderr.isatty()
    threading.Thread(target=work).start()
    try:
        while not finished.wait(0.2):
            if terminal:
                cost = "" if math.isnan(token.cost) else f", cost {token.cost:.2f}"
                sys.stderr.write(f"\r{100.0 * token.fraction:3.0f}%  {token.stage}{cost}\x1b[K")
    except KeyboardInterrupt:
        token.cancel()
        finished.wait()
        raise
    finally:
        ProgressLine(sys.stderr).clear()
    if failure:
        raise failure[0]
    return result[0]


def measure(
    mesh: Any,
    row: Row,
    params: Mapping[str, Mapping[str, float]],
    paper: PaperCosts,
    arguments: argparse.Namespace,
) -> None:
    """Build the tree once and fill ``row`` with what comes of it."""

    def build(builder: str) -> Any:
        return in_background(
            lambda token: core.build_tree(
                mesh,
                builder,
                threads=arguments.threads,
                params=dict(params.get(builder, {})),
                token=token,
            )
        )

    def metrics(bvh: Any) -> Any:
        return in_background(
            lambda token: core.metrics(bvh, threads=arguments.threads, token=token)
        )

    row.lbvh_seconds = median(build("lbvh").seconds for _ in range(3))
    tree = build(row.builder)
    row.seconds = tree.seconds
    row.steps, row.ended = list(tree.log["steps"]), tree.log["ended"]
    for branching in BRANCHINGS:
        bvh = in_background(lambda token, k=branching: tree.collapse(k, token=token))
        row.cells[branching] = Cell(
            bvh.cost(),
            paper.get((row.builder, branching)),
            metrics(bvh) if arguments.metrics else {},
        )


def write_results(rows: Sequence[Row], heading: Sequence[str], with_paper: bool, out: Path) -> str:
    """All files anew; gives the text of cost.txt."""
    text = cost_table(heading, rows, with_paper)
    write_text_aside(out / "cost.txt", text)
    write_text_aside(out / "cost.csv", cost_csv(rows))
    improving = [row for row in rows if row.steps]
    if any(row.builder in ANNEALING for row in improving):
        write_text_aside(out / "cost_over_time.csv", curve_csv(improving))
        try:
            draw_curves(improving, out / "cost_over_time.png", out.name)
        except ImportError as error:
            complain(f"cost_over_time.png is not drawn: {error}")
    return text


def compare_costs(arguments: argparse.Namespace) -> int:
    """Everything, builder by builder; 1 where a builder is missing or failed."""
    scene = load_mesh_file(arguments.scene, up="y")
    sentence, paper = find_paper_costs(arguments)
    known = {entry["id"]: entry["label"] for entry in core.builders()}
    builders = chosen_builders(arguments.builders, list(known))
    params = chosen_params(arguments)
    for name in params:
        if name not in known and name not in BUILDERS:
            raise ValueError(f"--set: there is no builder {name!r}; there are {', '.join(known)}")

    mesh = core.Mesh(scene.vertices, scene.triangles)
    out = arguments.out / arguments.scene.stem
    out.mkdir(parents=True, exist_ok=True)
    heading = [
        f"{arguments.scene.stem}: {len(scene.triangles)} triangles, c_T = 3, c_I = 2",
        sentence,
        f"{arguments.threads or usable_cores()} threads; time of the binary tree over that of LBVH",
        "Settings: " + (settings_text(params, builders) or "the builders' defaults"),
    ]
    rows: list[Row] = []
    for name in builders:
        row = Row(name, known.get(name, name))
        rows.append(row)
        try:
            if name not in known:
                raise ValueError("this build of the core has no such builder")
            measure(mesh, row, params, paper, arguments)
        except (ValueError, RuntimeError, MemoryError) as error:
            row.cells, row.steps = {}, []
            row.error = str(error) or type(error).__name__
            complain(f"{row.label} failed: {row.error}")
        text = write_results(rows, heading, bool(paper), out)
        print(row_text(row, bool(paper)), file=sys.stderr, flush=True)
    print(text, end="")
    return 1 if any(row.error for row in rows) else 0


def parse(words: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", type=Path, help=".npz, .obj or .ply")
    parser.add_argument("--builders", default="", help="ids, by commas; default: all")
    parser.add_argument(
        "--iterations", type=int, help=f"limit for {', '.join(ANNEALING)}; default: the paper's"
    )
    parser.add_argument("--set", action="append", default=[], metavar="BUILDER.PARAMETER=VALUE")
    parser.add_argument("--threads", type=int, default=0, help="0: all")
    parser.add_argument("--metrics", action="store_true", help="add EPO, LCV, depth and sizes")
    parser.add_argument("--paper-scene", help="the paper's name of the scene; default: by the file")
    parser.add_argument("--paper-costs", type=Path, default=PAPER_COSTS, help="its table, as CSV")
    parser.add_argument("--out", type=Path, default=Path("out/paper"))
    return parser.parse_args(words)


def main(words: Sequence[str] | None = None) -> int:
    arguments = parse(words)
    try:
        return compare_costs(arguments)
    except (LoadError, ValueError, OSError) as error:
        print(f"paper: error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("paper: stopped; what was finished is written", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
