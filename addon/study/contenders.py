# SPDX-License-Identifier: GPL-3.0-or-later
"""What stands in one row of the table: a tree of ours or a rival, built and ready to trace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

from .machine import usable_cores
from .plan import Plan, Variant
from .rays import RaySet, View
from .results import Row, Tree

EMBREE_BYTES_PER_TRIANGLE = 120  # peers measured at 88 to 117; Embree does not say


@dataclass
class OurTree:
    """A tree of ours with the row that it fills."""

    core: ModuleType
    row: Row
    bvh: Any
    plan: Plan

    @property
    def bytes(self) -> int:
        """Size of the tree in bytes."""
        return int(self.bvh.stats["bytes"])

    def trace(self, rays: RaySet, count: bool, token: Any) -> Any:
        """The core's hits, with work counters if ``count``. Primary rays are never sorted."""
        return self.core.trace(
            self.bvh,
            rays.origins,
            rays.directions,
            t_max=rays.t_max,
            any_hit=rays.any_hit,
            reorder=self.row.reorder if rays.kind != "primary" else "off",
            device=self.row.device,
            threads=self.plan.threads,
            count=count,
            token=token,
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
        )


@dataclass
class EmbreeTree:
    """Embree's tree of the same mesh."""

    row: Row
    scene: Any  # core.EmbreeScene
    plan: Plan
    bytes: int

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
    """One binary tree to build, and the rows it fills by branching factor.

    Several rows share a branching factor where the plan wants rays in order and reordered.
    """

    builder: str
    device: str
    rows: dict[int, list[Row]] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """The builder's name in the paper's spelling."""
        return self.all_rows()[0].label

    def all_rows(self) -> list[Row]:
        """The rows of all branching factors."""
        return [row for rows in self.rows.values() for row in rows]


def tree_jobs(core: ModuleType, plan: Plan) -> list[TreeJob]:
    """The binary trees that the plan's variants need, each once."""
    labels = {builder["id"]: builder["label"] for builder in core.builders()}
    jobs: dict[tuple[str, str], TreeJob] = {}
    for variant in plan.variants():
        key = (variant.builder, variant.device)
        rows = jobs.setdefault(key, TreeJob(*key)).rows
        rows.setdefault(variant.branching, []).append(_row(variant, labels[variant.builder]))
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
    )


def record_build(rows: Sequence[Row], bvh: Any, plan: Plan) -> None:
    """Add one build's seconds, and what the tree is, to the rows that trace it."""
    stats = bvh.stats
    names = [name for name in Tree.__dataclass_fields__ if name != "cost"]
    tree = Tree(**{n: stats[n] for n in names}, cost=bvh.cost(plan.traversal, plan.intersection))
    for row in rows:
        row.tree, row.threads = tree, stats["threads"]
        row.build_seconds.append(stats["build_seconds"])
        row.tree_seconds.append(stats["tree_seconds"])
        row.collapse_seconds.append(stats["collapse_seconds"])


def embree_row(core: ModuleType, mode: EmbreeMode, plan: Plan) -> Row:
    """The row of an Embree mode, with its error where there is no Embree."""
    embree = core.embree()
    version = f" {embree['version']}" if embree["available"] else ""
    label = f"Embree{version} {'robust' if mode.robust else 'fast'}"
    row = Row(mode.name, label, "embree", f"embree_{mode.quality}", 0, "off", "cpu")
    row.threads = plan.threads or usable_cores()
    if not embree["available"]:
        row.error = f"Embree is missing: {embree['reason']}; leave it out with --no-embree"
    return row
