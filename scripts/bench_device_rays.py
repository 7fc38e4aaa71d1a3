# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed of tracing on an OpenCL device, in turns with the CPU core on the same trees and rays."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from bvh_lab.native import core
from bvh_lab.study.core_scene import core_scene
from bvh_lab.study.devices import CPU
from bvh_lab.study.judge import Answers, differing_rays
from bvh_lab.study.plan import Plan
from bvh_lab.study.precision import CWBVH_BRANCHING, FULL
from bvh_lab.study.rays import RaySet, View, choose_views, generate_rays
from bvh_lab.study.results import Spread, spread
from bvh_lab.study.scene import Scene

Column = tuple[str, bool]  # kind of ray, and whether rays are sorted before they are traced
COLUMNS: tuple[Column, ...] = (
    ("primary", False),
    *((kind, ordered) for kind in ("secondary", "shadow") for ordered in (False, True)),
)
SHAPES = ((2, FULL), (4, FULL), (8, FULL), (CWBVH_BRANCHING, "cwbvh"))  # branching and layout
REORDER = "aila"  # the paper's order of rays
PROBE = (64, 48)  # pixels of the picture whose rays tell how many more there may be


@dataclass
class Cell:
    """One tree on one device with one column of rays: by view, how many and the seconds of each
    round, sorting included. ``differing`` rays were answered otherwise than the reference."""

    rays: dict[str, int] = field(default_factory=dict)
    seconds: dict[str, list[float]] = field(default_factory=dict)
    differing: int = 0

    def speed(self) -> Spread | None:
        """MRays/s, the mean over the views as in the paper: median and quartiles of the rounds."""
        rounds = list(zip(*self.seconds.values(), strict=True))
        if not rounds:
            return None
        counts = [1e-6 * self.rays[view] for view in self.seconds]
        return spread([_mean(n / s for n, s in zip(counts, of, strict=True)) for of in rounds])

    def over(self, other: Cell) -> Spread | None:
        """Speed over that of ``other`` in the same view and round, the mean over their views."""
        views = [view for view in self.seconds if view in other.seconds]
        pairs = [zip(other.seconds[v], self.seconds[v], strict=False) for v in views]
        rounds = list(zip(*([b / a for b, a in pair] for pair in pairs), strict=True))
        return spread([_mean(of) for of in rounds]) if rounds else None


Cells = dict[Column, Cell]


@dataclass
class Traced:
    """One tree. ``cpu`` is empty without the CPU core; ``base`` are the binary LBVH's cells on the
    device in the same rounds, rays in the order they come. ``kernel`` is the shape of the device's
    traversal."""

    builder: str
    label: str
    branching: int
    layout: str
    device: Cells = field(default_factory=dict)
    cpu: Cells = field(default_factory=dict)
    base: Cells = field(default_factory=dict)
    kernel: str = ""
    error: str = ""

    @property
    def differing(self) -> int:
        """Rays of the device and of the CPU core answered otherwise than the reference."""
        return sum(cell.differing for cells in (self.device, self.cpu) for cell in cells.values())

    @property
    def compared(self) -> int:
        """Answers of both that were compared."""
        cells = [*self.device.values(), *self.cpu.values()]
        return sum(sum(cell.rays.values()) for cell in cells)


def _mean(values: Any) -> float:
    listed = list(values)
    return sum(listed) / len(listed)


# --- rays ----------------------------------------------------------------------------------------


@dataclass
class Rays:
    """The rays of all views, with the answers of the CPU core to each."""

    views: list[View]

    def counts(self) -> dict[str, int]:
        """How many there are by kind."""
        found: dict[str, int] = {}
        for view in self.views:
            for rays in view.sets:
                found[rays.kind] = found.get(rays.kind, 0) + len(rays)
        return found

    @property
    def size(self) -> str:
        """Pixels of each view."""
        return f"{self.views[0].width}x{self.views[0].height}"


def make_rays(scene: Scene, bvh: Any, plan: Plan, token: Any) -> Rays:
    """The rays of one path a pixel in each view of the plan; ``bvh`` is the CPU core's."""
    made, _ = core_scene(core, bvh.mesh, scene)
    views = choose_views(core, scene, plan)
    for view in views:
        generate_rays(core, made, view, bvh, plan, token)
        for rays in view.sets:
            rays.reference = Answers.of(_trace(bvh, rays, False, CPU, token))
    return Rays(views)


def fitting_plan(
    scene: Scene, reference: Any, slowest: Any, device: str, plan: Plan, seconds: float, token: Any
) -> Plan:
    """The plan with as many pixels as let the device trace all columns once in about ``seconds``.

    ``slowest`` is the tree that is likely to take longest. Pictures stay 4:3, from `PROBE` up to
    the paper's 1024x768.
    """
    width, height = PROBE
    probe = make_rays(scene, reference, replace(plan, width=width, height=height), token)
    contender = Contender(slowest, device, COLUMNS)
    for timed in (False, True):
        contender.round(probe, timed, token)
    taken = sum(s for cell in contender.cells.values() for of in cell.seconds.values() for s in of)
    scale = math.sqrt(seconds / max(taken, 1e-9))
    width = 4 * round(min(max(width * scale, width), 1024) / 4)
    return replace(plan, width=width, height=3 * width // 4)


# --- tracing -------------------------------------------------------------------------------------


def _trace(bvh: Any, rays: RaySet, ordered: bool, device: str, token: Any) -> Any:
    return core.trace(
        bvh,
        rays.origins,
        rays.directions,
        t_max=rays.t_max,
        any_hit=rays.any_hit,
        reorder=REORDER if ordered else "off",
        device=device,
        token=token,
    )


@dataclass
class Contender:
    """A tree that a device traces; ``views`` limits how many it takes part in."""

    bvh: Any
    device: str
    columns: Sequence[Column]
    views: int | None = None
    cells: Cells = field(default_factory=dict)
    kernel: str = ""

    def round(self, rays: Rays, timed: bool, token: Any) -> None:
        """Trace all rays once: a round that is timed, or the warm-up, whose answers are compared.

        Raises what fails, and Cancelled.
        """
        for view, of, column in self._work(rays):
            hits = _trace(self.bvh, of, column[1], self.device, token)
            self.kernel = hits.shape or self.kernel
            cell = self.cells.setdefault(column, Cell())
            if not timed:
                assert of.reference is not None
                cell.rays[view.name] = cell.rays.get(view.name, 0) + len(of)
                cell.differing += differing_rays(Answers.of(hits), of.reference)
                cell.seconds.setdefault(view.name, [])
            elif of is self._first(view, column):
                cell.seconds[view.name].append(hits.seconds)
            else:
                cell.seconds[view.name][-1] += hits.seconds

    def _work(self, rays: Rays) -> Iterator[tuple[View, RaySet, Column]]:
        for view in rays.views[: self.views]:
            for of in view.sets:
                for column in self.columns:
                    if column[0] == of.kind:
                        yield view, of, column

    @staticmethod
    def _first(view: View, column: Column) -> RaySet:
        return next(of for of in view.sets if of.kind == column[0])


def measure_traces(
    tree: Any,
    builder: tuple[str, str],
    base: Any,
    rays: Rays,
    device: str,
    cpu_views: int,
    rounds: int,
    token: Any,
) -> list[Traced]:
    """A device's ``tree`` in all shapes, each on the device and on the CPU core, interleaved.

    ``builder`` is id and label, ``base`` the binary LBVH, None where that is the first of the
    shapes. The CPU core takes the first ``cpu_views`` views, none for 0. What fails has its
    ``error`` and the others go on, unless it is ``base``. Raises Cancelled.
    """
    found = [Traced(*builder, *shape) for shape in SHAPES]
    baseline = Contender(base, device, [column for column in COLUMNS if not column[1]])
    ours: dict[int, list[Contender]] = {}
    for number, (traced, shape) in enumerate(zip(found, SHAPES, strict=True)):
        with _failing_alone(traced):
            bvh = tree.collapse(shape[0], layout=shape[1], token=token)
            ours[number] = [Contender(bvh, device, COLUMNS)]
            if cpu_views:
                ours[number].append(Contender(bvh, CPU, COLUMNS, cpu_views))
    for turn in range(rounds + 1):
        if base is not None:
            baseline.round(rays, turn > 0, token)
        for number in _turned(list(ours), turn):
            with _failing_alone(found[number]):
                for contender in ours[number]:
                    contender.round(rays, turn > 0, token)
        ours = {number: of for number, of in ours.items() if not found[number].error}
    for number, contenders in ours.items():
        traced = found[number]
        traced.device, traced.kernel = contenders[0].cells, contenders[0].kernel
        traced.cpu = contenders[1].cells if cpu_views else {}
        traced.base = baseline.cells if base is not None else found[0].device
    return found


def _turned(values: list[int], turn: int) -> list[int]:
    """Who begins changes from round to round."""
    first = turn % max(len(values), 1)
    return [*values[first:], *values[:first]]


@contextmanager
def _failing_alone(traced: Traced) -> Iterator[None]:
    """A failure inside ends this tree alone."""
    try:
        yield
    except core.Cancelled:
        raise
    except (ValueError, RuntimeError, MemoryError) as error:
        traced.error = str(error)
