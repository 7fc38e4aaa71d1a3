# SPDX-License-Identifier: GPL-3.0-or-later
"""The time that each variant takes to a picture of a given error.

The pictures of all variants are equal bit for bit, so that the samples needed are the same for all:
one of them renders 1, 2, 4, ... samples, which are judged by the converged reference. The time of a
variant is that many samples at the pace of its own picture.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from .contenders import OurTree
from .convergence import Convergence, ErrorPoint, TimeToError
from .image_error import Curve, Point, crossing, doubling, noise_note
from .plan import Plan
from .progress import Progress
from .rays import View
from .reference_picture import ReferencePicture, reference_picture
from .results import Picture, Result, Row
from .scene import Float32Array, Scene
from .table import title

PILOT_SAMPLES = 16  # of the picture that tells how many samples the reference needs
LEAST_REFERENCE, MOST_REFERENCE = 64, 4096  # samples per pixel
LEAD = 8  # samples of the reference for each that the target is likely to need
REACH = 2  # samples of the reference for each of the longest picture that it may judge


def guessed_samples() -> int:
    """Samples per pixel to be rendered, before anything is known of the scene."""
    return PILOT_SAMPLES + 2 * LEAST_REFERENCE


def reference_samples(pilot_error: float, target: float) -> int:
    """Samples per pixel, a power of two, of a reference that can tell errors of ``target``.

    ``pilot_error`` is the relMSE of `PILOT_SAMPLES`; the error of a mean falls with their number.
    """
    if not math.isfinite(pilot_error):
        return MOST_REFERENCE
    needed = max(LEAD * PILOT_SAMPLES * pilot_error / target, LEAST_REFERENCE)
    for doubled in doubling(MOST_REFERENCE):
        if doubled >= needed:
            return doubled
    return MOST_REFERENCE


def check_judge(core: ModuleType, plan: Plan) -> None:
    """Raise ValueError where a target error is asked for and pictures cannot be judged."""
    if plan.target_error and not core.features()["image"]:
        raise ValueError(
            "this build has no OpenImageIO, which judges pictures: choose a target_error of 0"
        )


@dataclass
class Work:
    """Where the work is announced: the study's progress, and a guess of the seconds per sample."""

    progress: Progress
    per_sample: float

    def step(self, samples: int, stage: str) -> AbstractContextManager[None]:
        """Around the part of the work that renders so many samples of each pixel."""
        return self.progress.step("converge", samples * self.per_sample, stage)

    def replan(self, samples: int) -> None:
        """So many samples of each pixel are left to be rendered."""
        self.progress.replan("converge", samples * self.per_sample)


@dataclass
class PictureJudge:
    """Judges pictures of one view by a converged reference, once `converge` has made it."""

    core: ModuleType
    scene: Scene
    core_scene: Any
    reference: ReferencePicture | None = None

    def converge(self, tree: OurTree, view: View, result: Result, work: Work, token: Any) -> None:
        """Fill ``result.convergence``: the samples that bring the view to the plan's target.

        Rendered with this tree. Raises core.Cancelled, about 0.1 s after the token's cancel.
        """
        plan = tree.plan
        settings = {
            "seed": plan.seed,
            "depth": plan.depth,
            "shadow_rays": plan.shadow_rays,
            "reorder": tree.row.reorder,
            "threads": plan.threads,
        }
        pilot = self._converged(tree, view, PILOT_SAMPLES, settings, work, token)
        samples = reference_samples(pilot.error, plan.target_error)
        work.replan(samples + samples // LEAD)
        reference = self._converged(tree, view, samples, settings, work, token)
        renderer = self.core.Renderer(
            tree.bvh, self.core_scene, view.camera, view.width, view.height, **settings
        )
        points: list[ErrorPoint] = []
        for count in doubling(samples // REACH):
            more = count - renderer.samples
            work.replan(more)
            with work.step(more, f"error of view {view.name} after {count} samples"):
                renderer.render(more, token=token)
                errors = self._errors(renderer.picture().pixels, reference)
            points.append(ErrorPoint(count, errors))
            if errors.get("relMSE", math.inf) <= plan.target_error:
                break
        work.replan(0)
        self.reference = reference
        result.notes += reference.notes
        result.convergence = Convergence(
            view.name,
            plan.target_error,
            samples,
            reference.error,
            title(tree.row),
            points,
            crossing(relative_errors(points), plan.target_error),
        )

    def judge(
        self,
        trees: Sequence[OurTree],
        result: Result,
        pictures: Mapping[tuple[str, str], Float32Array],
    ) -> None:
        """Give the trees' rows the errors of their pictures, and the time to the target."""
        if (found := result.convergence) is None or self.reference is None:
            return
        for tree in trees:
            pixels = pictures[tree.row.name, found.view]
            if picture := judged_picture(tree.row, found):
                picture.errors = self._errors(pixels, self.reference)
        set_times((tree.row for tree in trees), found)

    def _converged(
        self,
        tree: OurTree,
        view: View,
        samples: int,
        settings: dict[str, Any],
        work: Work,
        token: Any,
    ) -> ReferencePicture:
        with ExitStack() as stack:

            def begin(done: int) -> None:
                stack.close()
                if done < samples:
                    stage = f"reference of view {view.name}, {done} of {samples} samples"
                    stack.enter_context(work.step(min(16, samples - done), stage))

            begin(0)
            return reference_picture(
                self.core,
                tree.bvh,
                self.scene,
                self.core_scene,
                view,
                samples,
                settings,
                token,
                begin,
            )

    def _errors(self, pixels: Float32Array, reference: ReferencePicture) -> dict[str, float]:
        """What is finite of `core.image_error`, without FLIP: it is slow and cannot be stopped."""
        errors = self.core.image_error(pixels, reference.pixels, flip=False)
        del errors["non_finite"]
        return {name: float(value) for name, value in errors.items() if math.isfinite(value)}


def relative_errors(points: Iterable[ErrorPoint]) -> list[tuple[float, float]]:
    """(samples, relMSE) of the points; infinite where it is not finite."""
    return [(float(p.samples), p.errors.get("relMSE", math.inf)) for p in points]


# --- rows ----------------------------------------------------------------------------------------


def judged_picture(row: Row, found: Convergence) -> Picture | None:
    """The row's picture of the view that was converged."""
    return next((picture for picture in row.pictures if picture.view == found.view), None)


def set_times(rows: Iterable[Row], found: Convergence) -> None:
    """Give the rows their time to the target, from the samples needed and their own pictures."""
    for row in rows:
        if picture := judged_picture(row, found):
            seconds = None
            if found.samples is not None:
                seconds = found.samples * picture.seconds / picture.samples
            row.time_to_error = TimeToError(found.view, found.target, seconds)


def target_notes(result: Result) -> list[str]:
    """What a reader of the times must know, a sentence each."""
    if (found := result.convergence) is None:
        return []
    notes = [noise_note(found.target, found.reference_error)]
    if found.samples is None:
        most, error = relative_errors(found.points)[-1]
        notes.append(
            f"relMSE {found.target:g} was not reached: it is {error:.2g} after {most:g} samples a "
            "pixel, and more were not tried."
        )
    return [note for note in notes if note]


def error_curves(result: Result) -> list[Curve]:
    """Error against time of each builder's fastest variant, derived as the rows' times are."""
    if (found := result.convergence) is None:
        return []
    fastest: dict[str, tuple[float, Row]] = {}
    for row in result.rows:
        if picture := judged_picture(row, found):
            pace = picture.seconds / picture.samples
            if row.builder not in fastest or pace < fastest[row.builder][0]:
                fastest[row.builder] = (pace, row)
    return [
        Curve(
            row.name,
            title(row),
            builder=row.builder,
            branching=row.branching,
            points=[
                Point(point.samples, [pace * point.samples], point.errors)
                for point in found.points
                if "relMSE" in point.errors
            ],
        )
        for pace, row in fastest.values()
    ]
