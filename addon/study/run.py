# SPDX-License-Identifier: GPL-3.0-or-later
"""Run a plan on a scene: build every variant, trace the same rays with each, judge, render, count.

Variants are timed interleaved, so that a machine that slows down slows all alike. Their trees are
held at once for that; where they do not fit in the memory allowed, the variants are measured in
groups, one after the other, and the result says so.
"""

from __future__ import annotations

import copy
import hashlib
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from types import ModuleType
from typing import Any

import numpy as np

from ..native import load
from .contenders import (
    EMBREE_BYTES_PER_TRIANGLE,
    EMBREE_MODES,
    Contender,
    EmbreeMode,
    EmbreeTree,
    OurTree,
    TreeJob,
    embree_row,
    held_bytes,
    judged,
    prepare,
    record_build,
    record_bytes,
    tree_jobs,
)
from .core_scene import core_scene
from .devices import CPU, resolved
from .estimate import Estimate
from .judge import Answers, picture_difference
from .machine import describe_machine, free_bytes
from .plan import Plan
from .progress import Event, Progress, RowChanged, Step
from .rays import RaySet, View, choose_views, generate_rays, judge_rays
from .remarks import (
    SLOW_BUILD_SECONDS,
    device_notes,
    iteration_notes,
    measuring_notes,
    missing_ray_notes,
    precision_notes,
)
from .results import COUNTERS, Picture, Result, Row
from .scene import Float32Array, Scene
from .subject import subject_of
from .table import title
from .target_error import PictureJudge, Work, check_judge, target_notes

__all__ = ["Event", "RowChanged", "Step", "Study", "compare"]


@dataclass
class Study:
    """A result with the pictures, (variant name, view name) to (H, W, 3) float32 linear."""

    result: Result
    pictures: dict[tuple[str, str], Float32Array] = field(default_factory=dict)


def compare(
    scene: Scene,
    plan: Plan,
    token: Any = None,
    on_event: Callable[[Event], None] | None = None,
    host: str = "",
) -> Study:
    """Measure every variant of the plan on the scene; may be called in a worker thread.

    ``token`` is a `core.Token`: after ``cancel()`` this returns within about 0.1 s with the rows
    measured so far and ``result.cancelled`` set. ``on_event`` gets `Step` and `RowChanged` in the
    calling thread. ``host`` names the program around, e.g. "Blender 3.4.1". A variant that fails
    has its error in its row and the others go on. Raises NativeMissing without a core, and
    ValueError for a bad plan or mesh.
    """
    core = load()
    plan.check(core.builders(), core.devices())
    check_judge(core, plan)
    plan = replace(plan, devices=resolved(plan.devices, core.devices()))
    token = core.Token() if token is None else token
    return _Runner(core, scene, plan, token, on_event or (lambda event: None), host).run()


class _Runner:
    def __init__(
        self,
        core: ModuleType,
        scene: Scene,
        plan: Plan,
        token: Any,
        emit: Callable[[Event], None],
        host: str,
    ) -> None:
        self.core, self.plan, self.token, self.emit = core, plan, token, emit
        self.mesh = core.Mesh(scene.vertices, scene.triangles)
        self.scene, texture_notes = core_scene(core, self.mesh, scene)
        self.judge = PictureJudge(core, scene, self.scene)
        self.views = choose_views(core, scene, plan)
        self.jobs = tree_jobs(core, plan)
        self.modes = EMBREE_MODES if plan.embree else ()
        self.group = 1
        self.slow_builds: list[str] = []
        self.guess = Estimate(plan, len(scene.triangles), self.views)
        rows = [row for job in self.jobs for row in job.all_rows()]
        rows += [embree_row(core, mode, plan) for mode in self.modes]
        self.planned_rows = rows
        builds = [job.builder for job in self.jobs] + ["embree"] * len(self.modes)
        self.progress = Progress(self.guess.planned(rows, builds), emit)
        self.study = Study(
            Result(
                plan=copy.deepcopy(plan),
                subject=subject_of(scene, self.scene, self.views),
                machine=describe_machine(core, host),
                started=datetime.now(UTC).isoformat(timespec="seconds"),
                notes=[plan.preset_note(), *scene.notes, *texture_notes],
            )
        )

    @property
    def result(self) -> Result:
        return self.study.result

    def run(self) -> Study:
        start = time.perf_counter()
        try:
            self._measure_everything()
        except self.core.Cancelled:
            self.result.cancelled = True
            self.result.notes.append("Stopped early: rows hold what was measured until then.")
        self.result.notes += iteration_notes(self.result.rows)
        self.result.notes += precision_notes(self.plan)
        self.result.notes += device_notes(self.result, self.views)
        self.result.notes += measuring_notes(self.plan, self.group, self.slow_builds)
        self.result.notes += missing_ray_notes(self.result, self.views)
        self.result.notes += target_notes(self.result)
        self.result.seconds = time.perf_counter() - start
        return self.study

    def _measure_everything(self) -> None:
        budget = self.plan.memory_gib * 2**30 or free_bytes() / 2.0
        held: list[Contender] = []
        sizes: list[int] = []  # of what each build left in `held`, in bytes
        for build in self._builds():
            if held and sum(sizes) + max(sizes) > budget:
                self._measure(held)
                held, sizes = [], []
                self.group += 1
            built = build()
            held += built
            sizes.append(held_bytes(built))
        self._measure(held)

    def _builds(self) -> Iterator[Callable[[], Sequence[Contender]]]:
        for job in self.jobs:
            yield lambda job=job: self._build_tree(job)  # type: ignore[misc]
        for mode in self.modes:
            yield lambda mode=mode: self._build_embree(mode)  # type: ignore[misc]

    def _build_tree(self, job: TreeJob) -> list[Contender]:
        rows = job.all_rows()
        bvhs: dict[tuple[int, str], Any] = {}
        self._enter(rows)
        with self._failing_alone(rows):
            if job.device != CPU:
                with self.progress.step(f"build {job.builder}", 0.0, f"warming up {job.label}"):
                    self._build_once(job, timed=False)
            for repeat in range(self.plan.build_repeats):
                bvhs = {}  # two trees of the largest scenes need not fit
                guess = self.guess.build(job.builder)
                with self.progress.step(f"build {job.builder}", guess, f"building {job.label}"):
                    bvhs = self._build_once(job)
                left = self.plan.build_repeats - 1 - repeat
                if left and rows[0].tree_seconds[0] > SLOW_BUILD_SECONDS:
                    self.progress.skip({f"build {job.builder}": left * guess})
                    self.slow_builds.append(job.label)
                    break
            for shape, bvh in bvhs.items():
                bvh.validate()
                prepare(self.core, job.rows[shape], bvh, self.plan, self.token)
                if set(self.plan.devices) != {CPU}:
                    record_bytes(job.rows[shape], bvh)
        return self._started(
            [
                OurTree(self.core, row, bvhs.get(shape), self.plan)
                for shape, of_shape in job.rows.items()
                for row in of_shape
            ]
        )

    def _build_once(self, job: TreeJob, timed: bool = True) -> dict[tuple[int, str], Any]:
        """One build: the binary tree, and from it that of each branching and layout."""
        plan = self.plan
        tree = self.core.build_tree(
            self.mesh,
            job.builder,
            device=job.device,
            threads=plan.threads,
            params=plan.params.get(job.builder, {}),
            traversal=plan.traversal,
            intersection=plan.intersection,
            token=self.token,
        )
        bvhs = {}
        for (branching, layout), rows in job.rows.items():
            bvh = tree.collapse(branching, layout=layout, token=self.token)
            record_build(rows, bvh, plan, timed)
            bvhs[branching, layout] = bvh
        return bvhs

    def _build_embree(self, mode: EmbreeMode) -> list[Contender]:
        row, scene = embree_row(self.core, mode, self.plan), None
        self._enter([row])
        if not row.error:
            with self._failing_alone([row]):
                for _ in range(self.plan.build_repeats):
                    scene = None
                    guess = self.guess.build("embree")
                    with self.progress.step("build embree", guess, f"building {row.label}"):
                        scene = self.core.EmbreeScene(
                            self.mesh,
                            quality=mode.quality,
                            robust=mode.robust,
                            threads=self.plan.threads,
                        )
                    row.build_seconds.append(scene.build_seconds)
                    self._stop_if_cancelled()
        size = EMBREE_BYTES_PER_TRIANGLE * self.result.subject.triangles
        return self._started([EmbreeTree(row, scene, self.plan, size)])

    def _enter(self, rows: list[Row]) -> None:
        """Put rows in the result as their work begins, so that a cancel keeps them."""
        for row in rows:
            row.group = self.group
        self.result.rows += rows

    def _started(self, contenders: Sequence[Contender]) -> list[Contender]:
        """Announce freshly built rows and give back those that did not fail."""
        for contender in contenders:
            failed = bool(contender.row.error)
            self.emit(RowChanged(copy.deepcopy(contender.row), finished=failed))
            if failed:
                self.progress.skip(self.guess.measure(contender.row))
        return [contender for contender in contenders if not contender.row.error]

    def _measure(self, contenders: list[Contender]) -> None:
        """Everything about a group of contenders, view by view."""
        for view in self.views:
            ours = [c for c in contenders if isinstance(c, OurTree) and not c.row.error]
            # Stable; the first one is the reference.
            ours.sort(key=lambda tree: (not tree.row.exact, tree.row.device != CPU))
            if not view.sets and not any(self._prepare(view, tree) for tree in ours):
                continue
            for rays in view.sets:
                self._answer(view, rays, contenders)
            self._time(view, contenders)
            exact = [tree for tree in ours if tree.row.exact]  # others have no picture
            if self.plan.pictures:
                self._render(view, exact)
            if self.plan.target_error and view is self.views[0]:
                self._judge_pictures(view, [tree for tree in exact if not tree.row.error])
            for contender in contenders:
                finished = view is self.views[-1]
                self.emit(RowChanged(copy.deepcopy(contender.row), finished))

    def _prepare(self, view: View, tree: OurTree) -> bool:
        """Generate the view's rays with one tree; False where that failed (its row says why)."""
        with self._failing_alone([tree.row]):
            before = [self.guess.measure(row, [view]) for row in self.planned_rows]
            with self.progress.step("trace", 0.0, f"generating the rays of view {view.name}"):
                generate_rays(self.core, self.scene, view, tree.bvh, self.plan, self.token)
            for row, most in zip(self.planned_rows, before, strict=True):
                there = self.guess.measure(row, [view])
                self.progress.skip({name: most[name] - there[name] for name in most})
            for number, rays in enumerate(view.sets):
                stage = f"brute force on {rays.name} of view {view.name}"
                bounces = sum(1 for other in view.sets if other.kind == rays.kind)
                with self.progress.step("judge", self.guess.judge() / bounces, stage):
                    wanted = -(-self.plan.judged_rays // bounces)
                    seed = 1000 * self.views.index(view) + number
                    judge_rays(self.core, self.mesh, rays, wanted, self.plan, seed, self.token)
                stage = f"exact answers to {rays.name} of view {view.name}"
                with self.progress.step("trace", 0.0, stage):
                    rays.reference = Answers.of(tree.trace_exactly(rays, self.token))
            if not self.result.reference:
                self.result.reference = tree.row.name
        if tree.row.error:
            view.sets = []
        return bool(view.sets)

    def _answer(self, view: View, rays: RaySet, contenders: Sequence[Contender]) -> None:
        """One untimed run of each contender, the warm-up: are the answers right and the same?"""
        for contender in contenders:
            row = contender.row
            if row.error:
                continue
            with self._failing_alone([row]):
                stage = f"checking {rays.name} of view {view.name}: {title(row)}"
                with self._trace_step(rays, stage):
                    hit = contender.trace(rays, False, self.token)
                judged(self.core, self.mesh, view.name, rays, hit, contender)
                if isinstance(contender, OurTree):
                    with self._trace_step(rays, stage.replace("checking", "counting the work of")):
                        counted = contender.trace(rays, True, self.token)
                    for counter in COUNTERS:
                        total = int(getattr(counted, counter).sum(dtype=np.uint64))
                        setattr(row.measurements[-1], counter, total)

    def _time(self, view: View, contenders: Sequence[Contender]) -> None:
        """The timed repeats, interleaved; who begins changes from repeat to repeat."""
        for repeat in range(self.plan.repeats):
            first = repeat % max(len(contenders), 1)
            for contender in [*contenders[first:], *contenders[:first]]:
                row = contender.row
                if row.error:
                    continue
                stage = (
                    f"timing view {view.name}, {repeat + 1} of {self.plan.repeats}: {title(row)}"
                )
                with self._failing_alone([row]):
                    for rays in view.sets:
                        with self._trace_step(rays, stage):
                            hit = contender.trace(rays, False, self.token)
                        row.add_times(view.name, rays.kind, rays.bounce, hit)
                        self._stop_if_cancelled()

    def _render(self, view: View, trees: Sequence[OurTree]) -> None:
        for tree in trees:
            row = tree.row
            if row.error:
                continue
            stage = f"picture of view {view.name}: {title(row)}"
            with self._failing_alone([row]):
                with self.progress.step("render", self.guess.view(view)["render"], stage):
                    picture = tree.render(self.scene, view, self.token)
                self._keep_picture(view, row, picture)

    def _judge_pictures(self, view: View, trees: Sequence[OurTree]) -> None:
        """Their errors, and the time to the target error. The fastest renders the reference."""
        if trees:
            fastest = min(trees, key=lambda tree: tree.row.pictures[0].seconds)
            with self._failing_alone([fastest.row]):
                if self.result.convergence is None:
                    per_sample = self.guess.picture_sample(view)
                    work = Work(self.progress, per_sample)
                    self.judge.converge(fastest, view, self.result, work, self.token)
                self.judge.judge(trees, self.result, self.study.pictures)

    def _keep_picture(self, view: View, row: Row, picture: Any) -> None:
        pixels = picture.pixels
        reference = view.pictures.setdefault(row.device, pixels)
        if np.array_equal(pixels.view(np.uint32), reference.view(np.uint32)):
            pixels = reference  # equal ones share an array, so that hundreds take no memory
        self.study.pictures[row.name, view.name] = pixels
        difference = picture_difference(pixels, reference)
        row.pictures.append(
            Picture(
                view.name,
                view.width,
                view.height,
                self.plan.samples,
                {kind: int(count) for kind, count in picture.rays.items()},
                float(picture.seconds),
                float(picture.trace_seconds),
                hashlib.sha256(np.ascontiguousarray(picture.pixels).data).hexdigest(),
                largest_difference=float(difference.max()),
                differing_pixels=int(difference.any(axis=2).sum()),
            )
        )

    @contextmanager
    def _failing_alone(self, rows: Sequence[Row]) -> Iterator[None]:
        """A failure inside ends these rows, not the study."""
        try:
            yield
        except self.core.Cancelled:
            raise
        except Exception as error:
            for row in rows:
                row.error = str(error) or type(error).__name__

    def _stop_if_cancelled(self) -> None:
        if self.token.cancelled:
            raise self.core.Cancelled("cancelled")

    @contextmanager
    def _trace_step(self, rays: RaySet, stage: str) -> Iterator[None]:
        with self.progress.step("trace", self.guess.trace(len(rays)), stage):
            yield
