# SPDX-License-Identifier: GPL-3.0-or-later
"""What stands in one row of the table: a tree of ours or a rival, built and ready to trace."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np

from .accuracy import Accuracy
from .devices import CPU
from .judge import Answers, Deviations, Judge, differing_rays
from .machine import usable_cores
from .plan import Plan, Variant
from .precision import CONSERVATIVE, WATERTIGHT
from .rays import RaySet, View
from .results import Measurement, Row, Tree

EMBREE_BYTES_PER_TRIANGLE = 120  # peers measured at 88 to 117; Embree does not say


@dataclass
class Pool:
    """The deviations of a row's judged hits: percentiles need them all at once."""

    parts: list[Deviations] = field(default_factory=list)

    def add(self, part: Deviations) -> Accuracy | None:
        """Take in those of one more set of rays; the accuracy of all so far."""
        self.parts.append(part)
        t_ulps = np.concatenate([part.t_ulps for part in self.parts])
        return Accuracy.of(t_ulps, np.concatenate([part.uv for part in self.parts]))


@dataclass
class OurTree:
    """A tree of ours with the row that it fills."""

    core: ModuleType
    row: Row
    bvh: Any
    plan: Plan
    pool: Pool = field(default_factory=Pool)

    @property
    def bytes(self) -> int:
        """Size of the tree in bytes, with its copy on a device, which may be memory of ours."""
        return int(self.bvh.stats["bytes"]) * (1 if self.row.device == CPU else 2)

    def trace(self, rays: RaySet, count: bool, token: Any) -> Any:
        """The core's hits, with work counters if ``count``. Primary rays are never sorted."""
        return self._trace(rays, count, self.row.triangle_test, self.row.box_test, token)

    def trace_exactly(self, rays: RaySet, token: Any) -> Any:
        """The cpu's hits by the default tests: those that every tree and device gives."""
        return self._trace(rays, False, WATERTIGHT, CONSERVATIVE, token, CPU)

    def _trace(
        self,
        rays: RaySet,
        count: bool,
        triangle_test: str,
        box_test: str,
        token: Any,
        device: str = "",
    ) -> Any:
        return self.core.trace(
            self.bvh,
            rays.origins,
            rays.directions,
            t_max=rays.t_max,
            any_hit=rays.any_hit,
            reorder=self.row.reorder if rays.kind != "primary" else "off",
            device=device or self.row.device,
            threads=self.plan.threads,
            count=count,
            token=token,
            triangle_test=triangle_test,
            box_test=box_test,
        )

    def render(self, core_scene: Any, view: View, token: Any) -> Any:
        """The core's picture of the view."""
        return self.core.render(
            self.bvh,
            core_scene,
            view.camera,
            view.width,
            view.height,
            samples=self.plan.samples,
            seed=self.plan.seed,
            depth=self.plan.depth,
            shadow_rays=self.plan.shadow_rays,
            reorder=self.row.reorder,
            threads=self.plan.threads,
            token=token,
            device=self.row.device,
        )


@dataclass
class EmbreeTree:
    """Embree's tree of the same mesh."""

    row: Row
    scene: Any  # core.EmbreeScene
    plan: Plan
    bytes: int
    pool: Pool = field(default_factory=Pool)

    def trace(self, rays: RaySet, count: bool, token: Any) -> Any:
        """The core's hits; Embree has no work counters and cannot be stopped within a batch."""
        assert not count
        return self.scene.trace(
            rays.origins,
            rays.directions,
            t_max=rays.t_max,
            any_hit=rays.any_hit,
            threads=self.plan.threads,
        )


Contender = OurTree | EmbreeTree


def held_bytes(contenders: Sequence[Contender]) -> int:
    """What their trees take, those that rows share counted once, and what tests keep beside."""
    trees = {id(c.bvh if isinstance(c, OurTree) else c): c.bytes for c in contenders}
    ours = [c for c in contenders if isinstance(c, OurTree)]
    kept = {(id(c.bvh), c.row.triangle_test): c.row.prepared_bytes for c in ours}
    return sum(trees.values()) + sum(kept.values())


def judged(
    core: ModuleType,
    mesh: Any,
    view: str,
    rays: RaySet,
    hits: Any,
    contender: Contender,
) -> None:
    """Add a measurement of a contender's ``hits`` to its row: are they right and the same?"""
    assert rays.reference is not None
    answers, row = Answers.of(hits), contender.row
    measurement = Measurement(
        view,
        rays.kind,
        len(rays),
        rays.bounce,
        hits=int(answers.occluded.sum()),
        hits_sha256=answers.sha256(),
    )
    row.shape = hits.shape
    if row.exact:
        measurement.differing_rays = differing_rays(answers, rays.reference)
    else:  # it rounds otherwise: bits may differ where the hit does not
        ours = Judge(core, mesh, rays.origins, rays.directions, rays.reference)
        measurement.differing_rays = ours.errors(answers).wrong
    if rays.judge is not None:
        sample = answers.sample(rays.sampled)
        measurement.errors = rays.judge.errors(sample)
        row.accuracy = contender.pool.add(rays.judge.deviations(sample))
    row.measurements.append(measurement)


@dataclass(frozen=True)
class EmbreeMode:
    """How Embree builds and traces."""

    quality: str
    robust: bool

    @property
    def name(self) -> str:
        """Name of the row."""
        return f"embree_{self.quality}_{'robust' if self.robust else 'fast'}"


EMBREE_MODES = (EmbreeMode("high", True), EmbreeMode("high", False))


@dataclass
class TreeJob:
    """One binary tree to build, and the rows it fills by branching factor and layout.

    Several rows share these where the plan wants rays in order and reordered, or several tests.
    """

    builder: str
    device: str
    rows: dict[tuple[int, str], list[Row]] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """The builder's name in the paper's spelling."""
        return self.all_rows()[0].label

    def all_rows(self) -> list[Row]:
        """The rows of all branching factors and layouts."""
        return [row for rows in self.rows.values() for row in rows]


def tree_jobs(core: ModuleType, plan: Plan) -> list[TreeJob]:
    """The binary trees that the plan's variants need, each once."""
    labels = {builder["id"]: builder["label"] for builder in core.builders()}
    jobs: dict[tuple[str, str], TreeJob] = {}
    for variant in plan.variants():
        key = (variant.builder, variant.device)
        rows = jobs.setdefault(key, TreeJob(*key)).rows
        shape = (variant.branching, variant.layout)
        rows.setdefault(shape, []).append(_row(variant, labels[variant.builder]))
    return list(jobs.values())


def _row(variant: Variant, label: str) -> Row:
    return Row(
        variant.name,
        label,
        "bvh_lab",
        variant.builder,
        variant.branching,
        variant.reorder,
        variant.device,
        layout=variant.layout,
        triangle_test=variant.triangle_test,
        box_test=variant.box_test,
    )


def record_build(rows: Sequence[Row], bvh: Any, plan: Plan, timed: bool) -> None:
    """Add what the tree is, and if ``timed`` one build's seconds, to the rows that trace it."""
    stats = bvh.stats
    names = [name for name in Tree.__dataclass_fields__ if name not in ("cost", "sha256")]
    tree = Tree(**{n: stats[n] for n in names}, cost=bvh.cost(plan.traversal, plan.intersection))
    for row in rows:
        row.tree, row.threads = tree, stats["threads"]
        row.tree_device = stats["tree_device"]
        row.kernel_seconds = stats["kernel_seconds"]
        row.transfer_seconds = stats["transfer_seconds"]
        row.program_seconds += stats["program_seconds"]
        if not timed:
            continue
        row.build_seconds.append(stats["build_seconds"])
        row.tree_seconds.append(stats["tree_seconds"])
        row.collapse_seconds.append(stats["collapse_seconds"])


def record_bytes(rows: Sequence[Row], bvh: Any) -> None:
    """Note what the tree is, byte for byte."""
    sha = hashlib.sha256()
    for part in bvh.memory:
        sha.update(part.data)
    for row in rows:
        if row.tree:
            row.tree.sha256 = sha.hexdigest()


def prepare(core: ModuleType, rows: Sequence[Row], bvh: Any, plan: Plan, token: Any) -> None:
    """Let the rows' triangle tests make what they keep beside the tree, and note what it takes."""
    ray = np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32)
    for test in dict.fromkeys(row.triangle_test for row in rows):
        hits = core.trace(bvh, *ray, triangle_test=test, threads=plan.threads, token=token)
        for row in rows:
            if row.triangle_test == test and row.tree:
                row.prepare_seconds, row.prepared_bytes = hits.prepare_seconds, hits.prepared_bytes
                size = row.tree.bytes + row.prepared_bytes
                row.bytes_per_triangle = size / len(bvh.mesh.triangles)


def embree_row(core: ModuleType, mode: EmbreeMode, plan: Plan) -> Row:
    """The row of an Embree mode, with its error where there is no Embree."""
    embree = core.embree()
    version = f" {embree['version']}" if embree["available"] else ""
    label = f"Embree{version} {'robust' if mode.robust else 'fast'}"
    row = Row(mode.name, label, "embree", f"embree_{mode.quality}", 0, "off", "cpu")
    row.threads = plan.threads or usable_cores()
    row.layout = row.triangle_test = row.box_test = ""
    if not embree["available"]:
        row.error = f"Embree is missing: {embree['reason']}; leave it out with --no-embree"
    return row
