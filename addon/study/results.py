# SPDX-License-Identifier: GPL-3.0-or-later
"""What a study measured: one row per variant, with every repeat, to JSON and back and to CSV."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

import numpy as np

from .accuracy import Accuracy, Errors
from .convergence import Convergence, TimeToError
from .devices import CPU
from .plan import Plan
from .precision import CONSERVATIVE, FULL, WATERTIGHT, is_exact
from .records import from_plain, parse_json

KINDS = ("primary", "secondary", "shadow")  # of rays: from the camera, from a hit on, to lights
COUNTERS = ("node_visits", "box_tests", "triangle_tests")
FORMAT = 4  # of results.json; 3 had nothing of OpenCL devices, 2 no precision choices either


class Spread(NamedTuple):
    """Median with the quartiles around it."""

    low: float
    median: float
    high: float

    @property
    def half_percent(self) -> float:
        """Half the distance between the quartiles, in percent of the median."""
        return 50.0 * (self.high - self.low) / self.median if self.median else 0.0


def spread(samples: list[float]) -> Spread:
    """Median and quartiles (linear between samples) of at least one sample."""
    low, median, high = np.percentile(samples, (25.0, 50.0, 75.0))
    return Spread(float(low), float(median), float(high))


@dataclass
class Measurement:
    """One variant, one view, one kind of ray, one bounce: rays that are traced together.

    ``bounce`` counts from the camera: primary rays and the shadow rays from what they hit have 0,
    the secondary rays from there 1. ``rays`` are those traced; there are no dead ones.
    ``key_seconds``, ``sort_seconds`` and ``traverse_seconds`` have one entry per timed repeat, on
    an OpenCL device by its own clock; generating the rays is in none of them, nor is copying rays
    and answers, which ``transfer_seconds`` have. ``node_visits``, ``box_tests`` and
    ``triangle_tests`` are sums over ``rays``, from a run of their own (None where there are no
    counters).
    ``hits_sha256`` is the hash of all answers. ``differing_rays`` is how many differ from the
    reference's: bit for bit where they should be the same, else as `Errors` counts.
    """

    view: str
    kind: str
    rays: int
    bounce: int = 0
    hits: int = 0
    hits_sha256: str = ""
    differing_rays: int = 0
    errors: Errors = field(default_factory=Errors)
    node_visits: int | None = None
    box_tests: int | None = None
    triangle_tests: int | None = None
    key_seconds: list[float] = field(default_factory=list)
    sort_seconds: list[float] = field(default_factory=list)
    traverse_seconds: list[float] = field(default_factory=list)
    transfer_seconds: list[float] = field(default_factory=list)

    @property
    def seconds(self) -> list[float]:
        """Seconds of each repeat: keys, sort and traversal together."""
        parts = zip(self.key_seconds, self.sort_seconds, self.traverse_seconds, strict=True)
        return [sum(part) for part in parts]

    @property
    def sorting_seconds(self) -> list[float]:
        """Seconds of each repeat that finding the order took: keys and sort."""
        parts = zip(self.key_seconds, self.sort_seconds, strict=True)
        return [sum(part) for part in parts]


def mrays_per_second(timed: list[Measurement]) -> Spread:
    """Rays of all bounces over their seconds, from measurements of one view and kind.

    The median and quartiles are those of the repeats that all have; ``low`` is from the slow ones.
    """
    mega_rays = 1e-6 * sum(m.rays for m in timed)
    repeats = zip(*(m.seconds for m in timed), strict=False)
    fast, median, slow = spread([sum(seconds) for seconds in repeats])
    return Spread(*(mega_rays / max(seconds, 1e-9) for seconds in (slow, median, fast)))


@dataclass
class Picture:
    """How one variant's picture of one view compares with the first one of its device.

    ``sha256`` is the hash of all pixels, float32. ``largest_difference`` is over all pixels and
    channels, linear; 0 means equal pixel for pixel. ``rays`` counts all that were traced for it, by
    kind; ``trace_seconds`` is the part of ``seconds`` that tracing them took. ``errors`` are those
    to the converged reference, by their names in `core.image_error`, where there is one.
    """

    view: str
    width: int
    height: int
    samples: int
    rays: dict[str, int]
    seconds: float
    trace_seconds: float
    sha256: str
    largest_difference: float
    differing_pixels: int
    errors: dict[str, float] = field(default_factory=dict)


@dataclass
class Tree:
    """The size of a tree, in the words of `Bvh.stats`; ``cost`` is Eq. 2 (binary) or 3 (wide).

    ``iterations`` and why they ``ended`` are 0 and "" for builders that do not iterate. ``sha256``
    is of every byte that rays traverse, where trees of other devices than the cpu are built.
    """

    nodes: int
    interior_nodes: int
    leaves: int
    references: int
    max_depth: int
    max_leaf_size: int
    average_leaf_size: float
    bytes: int
    cost: float
    iterations: int = 0
    ended: str = ""
    sha256: str = ""


@dataclass
class Row:
    """One variant of the study (``system`` "bvh_lab") or a rival on the same rays ("embree").

    ``build_seconds`` has one entry per timed build; for our trees it is ``tree_seconds`` (the
    binary tree) plus ``collapse_seconds``. ``threads`` is what was used, of an OpenCL device its
    compute units. ``tree_device`` made the binary tree: "cpu" on every device for some builders.
    ``kernel_seconds`` of the last build are by stage and the device's clock; copies took
    ``transfer_seconds`` and programs ``program_seconds``, which are in no other time. ``shape`` is
    how the device's traversal works. All are empty for device "cpu". ``layout``,
    ``triangle_test`` and ``box_test`` are of the module `precision`, and empty for a rival.
    ``prepared_bytes`` are what the triangle test keeps beside the tree, ``prepare_seconds`` what
    making that took, outside of all other times. ``bytes_per_triangle`` counts tree and prepared
    bytes by triangle of the mesh.
    ``accuracy`` pools all views and bounces of closest hits. ``error`` is empty unless
    the variant failed; what was measured until then stays. ``group`` numbers the variants that
    were measured interleaved: all are 1 unless the trees did not fit in memory together.
    ``time_to_error`` is there if the plan asked for it and the variant rendered that view.
    """

    name: str
    label: str
    system: str
    builder: str
    branching: int
    reorder: str  # of plan.REORDERS
    device: str
    threads: int = 0
    layout: str = FULL
    triangle_test: str = WATERTIGHT
    box_test: str = CONSERVATIVE
    group: int = 1
    error: str = ""
    tree: Tree | None = None
    bytes_per_triangle: float | None = None
    prepare_seconds: float = 0.0
    prepared_bytes: int = 0
    accuracy: Accuracy | None = None
    build_seconds: list[float] = field(default_factory=list)
    tree_seconds: list[float] = field(default_factory=list)
    collapse_seconds: list[float] = field(default_factory=list)
    measurements: list[Measurement] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)
    time_to_error: TimeToError | None = None
    tree_device: str = CPU
    shape: str = ""
    kernel_seconds: dict[str, float] = field(default_factory=dict)
    transfer_seconds: float = 0.0
    program_seconds: float = 0.0

    @property
    def exact(self) -> bool:
        """Whether it promises exact hits, and so those of all others that do, bit for bit."""
        return self.system == "bvh_lab" and is_exact(self.triangle_test, self.box_test)

    def add_times(self, view: str, kind: str, bounce: int, hits: Any) -> None:
        """Append one repeat's seconds, of what `core.trace` returned, to its measurement."""
        for measurement in self.measurements:
            if (measurement.view, measurement.kind, measurement.bounce) == (view, kind, bounce):
                measurement.key_seconds.append(hits.key_seconds)
                measurement.sort_seconds.append(hits.sort_seconds)
                measurement.traverse_seconds.append(hits.traverse_seconds)
                measurement.transfer_seconds.append(hits.transfer_seconds)

    def of_kind(self, kind: str) -> dict[str, list[Measurement]]:
        """The measurements of one kind of ray by view, where all bounces have been timed."""
        views: dict[str, list[Measurement]] = {}
        for measurement in self.measurements:
            if measurement.kind == kind:
                views.setdefault(measurement.view, []).append(measurement)
        return {
            view: measured
            for view, measured in views.items()
            if all(m.traverse_seconds for m in measured)
        }

    def view_speeds(self, kind: str) -> dict[str, Spread]:
        """MRays/s by view: rays of all bounces over their seconds, median and quartiles."""
        return {view: mrays_per_second(timed) for view, timed in self.of_kind(kind).items()}

    def speed(self, kind: str) -> Spread | None:
        """MRays/s: the arithmetic mean over views, as in the paper; None if not measured.

        Median and quartiles are each the mean of the views'.
        """
        speeds = list(self.view_speeds(kind).values())
        if not speeds:
            return None
        return Spread(*(sum(part) / len(speeds) for part in zip(*speeds, strict=True)))

    def sorting_share(self, kind: str) -> float | None:
        """Part of the median time, over all views, that went into sort keys and sorting."""
        timed = [m for measured in self.of_kind(kind).values() for m in measured]
        whole = sum(spread(m.seconds).median for m in timed)
        return sum(spread(m.sorting_seconds).median for m in timed) / whole if whole else None

    def build(self) -> Spread | None:
        """Seconds of building; None if not built."""
        return spread(self.build_seconds) if self.build_seconds else None

    def per_ray(self, counter: str, kind: str) -> float | None:
        """``counter`` (of `COUNTERS`) per ray over all views and bounces, or None."""
        counted = [m for m in self.measurements if m.kind == kind]
        counts = [getattr(m, counter) for m in counted]
        rays = sum(m.rays for m in counted)
        return sum(counts) / rays if rays and None not in counts else None

    def errors(self) -> Errors:
        """Wrong hits against brute force over all views and kinds of ray."""
        total = Errors()
        for measurement in self.measurements:
            total = total.plus(measurement.errors)
        return total

    def differing_rays(self) -> int | None:
        """Rays of all views and kinds answered otherwise than by the reference."""
        if not self.measurements:
            return None
        return sum(m.differing_rays for m in self.measurements)

    def picture_difference(self) -> float | None:
        """Largest difference to the reference variant's picture in any view, or None."""
        return max((p.largest_difference for p in self.pictures), default=None)

    def disagrees(self) -> bool:
        """Whether one that promises exact hits answered otherwise than the reference: a bug."""
        different = bool(self.differing_rays()) or bool(self.picture_difference())
        return self.exact and different


@dataclass
class Subject:
    """The scene that was measured. ``geometry`` is "viewport", "render" or "mesh file".

    ``features`` names what of the renderer it uses, in the words of `core.Scene.features`.
    """

    name: str
    source: str
    geometry: str
    frame: int
    triangles: int
    vertices: int
    materials: int
    lights: int
    views: list[str]
    sha256: str
    features: list[str] = field(default_factory=list)


@dataclass
class Machine:
    """Where it was measured. ``host`` is the program around the study, e.g. "Blender 3.4.1"."""

    cpu: str
    cores: int
    memory_gib: float
    system: str
    python: str
    numpy: str
    host: str
    version: str
    devices: list[dict[str, Any]]
    features: dict[str, Any]
    embree: str


@dataclass
class Result:
    """A study's rows and all that must be known to read them.

    ``convergence`` is there if the plan has a target error and the study came so far.
    """

    plan: Plan
    subject: Subject
    machine: Machine
    started: str  # ISO 8601, UTC
    seconds: float = 0.0
    cancelled: bool = False
    reference: str = ""  # name of the variant whose tree gave the answers that all are held to
    rows: list[Row] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)  # what was added, approximated or left out
    convergence: Convergence | None = None
    format: int = FORMAT

    def failed(self) -> list[Row]:
        """Rows that carry an error or whose answers differ from the reference variant's."""
        return [row for row in self.rows if row.error or row.disagrees()]

    def row(self, name: str) -> Row:
        """The row of that name; raises ValueError listing the names."""
        for row in self.rows:
            if row.name == name:
                return row
        raise ValueError(f"no row {name!r}; there are: {', '.join(r.name for r in self.rows)}")

    def rays(self) -> dict[tuple[str, int], int]:
        """How many rays of all views were traced, by kind and bounce."""
        counts: dict[tuple[str, int], int] = {}
        row = max(self.rows, key=lambda row: len(row.measurements), default=None)
        for m in row.measurements if row else []:
            counts[m.kind, m.bounce] = counts.get((m.kind, m.bounce), 0) + m.rays
        return dict(sorted(counts.items(), key=lambda item: (KINDS.index(item[0][0]), item[0][1])))

    def to_json(self) -> str:
        """JSON text, with every repeat, that `from_json` reads back into an equal result."""
        return json.dumps(asdict(self), indent=1, allow_nan=False, ensure_ascii=False)

    @classmethod
    def from_json(cls, text: str) -> Result:
        """The result that `to_json` wrote; raises ValueError naming a bad field."""
        plain = parse_json(text)
        if isinstance(plain, dict) and plain.get("format") != FORMAT:
            raise ValueError(
                f"results of format {plain.get('format')!r}; this reads {FORMAT}: measure again"
            )
        return from_plain(cls, plain)


def ratio(row: Row, baseline: Row, kind: str) -> float | None:
    """Speed of ``row`` over that of ``baseline`` for one kind of ray, or None."""
    ours, theirs = row.speed(kind), baseline.speed(kind)
    return ours.median / theirs.median if ours and theirs and theirs.median else None
