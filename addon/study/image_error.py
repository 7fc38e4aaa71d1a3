# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed against error: how wrong a picture still is after how many seconds.

A curve has a point for each number of samples (1, 2, 4, ...): the seconds that rendering took until
then, and the picture's error against a converged reference (`core.image_error`).
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from .results import Spread, spread
from .scene import Float32Array

MEASURES = ("relMSE", "MAE", "RMSE", "PSNR", "FLIP", "bias")  # of core.image_error
TARGET = 0.01  # relMSE that the tables give the time to
NOISE_SHARE = 0.2  # of an error that the reference's own may be, for the error to mean something


@dataclass
class Point:
    """A picture of ``samples`` per pixel: ``seconds`` has one entry per repeat."""

    samples: int
    seconds: list[float] = field(default_factory=list)
    errors: dict[str, float] = field(default_factory=dict)  # by MEASURES

    @property
    def time(self) -> Spread:
        """Median seconds with quartiles."""
        return spread(self.seconds)


@dataclass
class Curve:
    """One renderer on one view; points by increasing samples.

    ``system`` is "bvh_lab" or a rival, e.g. "cycles"; ``builder`` and ``branching`` say whose tree
    it is. ``overhead_seconds`` came on top of every point's time, and is in none.
    """

    name: str
    label: str
    system: str = "bvh_lab"
    builder: str = ""
    branching: int = 0
    overhead_seconds: float | None = None
    points: list[Point] = field(default_factory=list)

    def time_to_error(self, target: float = TARGET, measure: str = "relMSE") -> float | None:
        """Median seconds until the error falls to ``target``; None where it never does.

        Between points it is interpolated on log-log axes. Where the first point is below already
        it is that point's time: there is no picture with fewer samples.
        """
        timed = [point for point in self.points if point.seconds and point.time.median > 0.0]
        return crossing([(p.time.median, p.errors[measure]) for p in timed], target)

    def samples_per_second(self) -> float | None:
        """Samples of each pixel per second, from the median time of the last point."""
        timed = [p for p in self.points if p.seconds and p.time.median > 0.0]
        return timed[-1].samples / timed[-1].time.median if timed else None


def crossing(points: Sequence[tuple[float, float]], target: float) -> float | None:
    """The time at which the error of (time, error) points has fallen to ``target`` for good."""
    if not points or not points[-1][1] <= target:  # NaN too
        return None
    after = len(points) - 1
    while after > 0 and points[after - 1][1] <= target:
        after -= 1
    time, error = points[after]
    if after == 0 or error <= 0.0:
        return time
    earlier, larger = points[after - 1]
    if not math.isfinite(larger):
        return time
    share = math.log(larger / target) / math.log(larger / error)
    return earlier * math.pow(time / earlier, share)


def doubling(most: int) -> list[int]:
    """1, 2, 4, ... up to ``most``, which ends the list whatever it is."""
    counts = [2**i for i in range(max(most, 1).bit_length())]
    return counts if counts[-1] == most else [*counts, most]


@dataclass
class Contestant:
    """A curve in the making. ``start`` gives a renderer anew: (render, picture).

    ``render(samples)`` adds samples and returns the seconds that it took, ``picture()`` the pixels
    of what is there, (H, W, 3) float32.
    """

    curve: Curve
    start: Callable[[], tuple[Callable[[int], float], Callable[[], Float32Array]]]


def our_contestant(
    core: Any, curve: Curve, bvh: Any, scene: Any, view: Any, settings: dict[str, Any], token: Any
) -> Contestant:
    """One of our trees under `core.Renderer`; ``view`` is a `rays.View`, ``scene`` a `core.Scene`.

    The seconds are the core's own: all stages of the path tracer, without building the tree.
    """

    def start() -> tuple[Callable[[int], float], Callable[[], Float32Array]]:
        renderer = core.Renderer(bvh, scene, view.camera, view.width, view.height, **settings)
        spent = 0.0

        def render(samples: int) -> float:
            nonlocal spent
            renderer.render(samples, token=token)
            before, spent = spent, float(renderer.picture().seconds)
            return spent - before

        return render, lambda: np.asarray(renderer.picture().pixels)

    return Contestant(curve, start)


def measure_curves(
    core: Any,
    contestants: Sequence[Contestant],
    reference: Float32Array,
    counts: Sequence[int],
    repeats: int,
    enough: float = 0.0,
    on_step: Callable[[str], None] | None = None,
) -> None:
    """Fill the contestants' curves at the sample ``counts``, rising; the first ones add points.

    A curve ends early at relMSE ``enough``. Every repeat renders all contestants, the first one
    first in every other repeat, else last. The errors come from a curve's first repeat: our
    pictures do not change from one to the next.
    """
    for repeat in range(repeats):
        for contestant in contestants if repeat % 2 == 0 else reversed(contestants):
            if on_step:
                on_step(f"{contestant.curve.label}, repeat {repeat + 1} of {repeats}")
            if contestant.curve.points:
                _render_again(contestant)
            else:
                _render_first(core, contestant, reference, counts, enough)


def _render_first(
    core: Any, contestant: Contestant, reference: Float32Array, counts: Sequence[int], enough: float
) -> None:
    render, picture = contestant.start()
    seconds, before = 0.0, 0
    for count in counts:
        seconds += render(count - before)
        before = count
        error = core.image_error(picture(), reference)
        errors = {name: float(error[name]) for name in MEASURES}
        contestant.curve.points.append(Point(count, [seconds], errors))
        if errors["relMSE"] <= enough:
            break


def _render_again(contestant: Contestant) -> None:
    render, _ = contestant.start()
    seconds, before = 0.0, 0
    for point in contestant.curve.points:
        seconds += render(point.samples - before)
        before = point.samples
        point.seconds.append(seconds)


def noise_note(target: float, reference_error: float) -> str:
    """A sentence where the reference is too noisy to tell errors as small as ``target``, or ""."""
    if reference_error <= NOISE_SHARE * target:
        return ""
    return (
        f"The reference's own relMSE is about {reference_error:.2g}: times to relMSE {target:g} "
        "are uncertain; take more samples for the reference."
    )


# --- text ----------------------------------------------------------------------------------------


def seconds_text(seconds: float | None) -> str:
    """Three digits, or "not reached"."""
    return "not reached" if seconds is None else f"{seconds:.3g} s"


def curves_table(curves: Sequence[Curve], target: float = TARGET) -> list[str]:
    """Lines: error at the end, time to the target, samples per second."""
    width = max([len(curve.label) for curve in curves], default=0)
    heading = f"time to relMSE {target:g}"
    lines = [
        f"{'':{width}s}  samples       seconds    relMSE   PSNR dB    FLIP  {heading}  samples/s"
    ]
    for curve in curves:
        last, speed = curve.points[-1], curve.samples_per_second()
        error, time = last.errors, last.time
        cells = (
            f"{curve.label:{width}s}",
            f"{last.samples:7d}",
            f"{time.median:7.2f} ±{time.half_percent:2.0f}%",
            f"{error['relMSE']:8.2g}",
            f"{error['PSNR']:8.1f}",
            f"{error['FLIP']:6.3f}",
            f"{seconds_text(curve.time_to_error(target)):>{len(heading)}s}",
            f"{speed or math.nan:9.3g}",
        )
        lines.append("  ".join(cells))
    return lines


def curves_csv(curves: Sequence[Curve]) -> str:
    """One line per point."""
    out = io.StringIO()
    names = ["name", "label", "system", "builder", "branching", "samples"]
    names += ["seconds", "seconds_low", "seconds_high", *MEASURES]
    writer = csv.DictWriter(out, names, lineterminator="\n")
    writer.writeheader()
    for curve in curves:
        for point in curve.points:
            if point.seconds:
                record = {name: asdict(curve)[name] for name in names[:5]}
                low, median, high = point.time
                record |= {"samples": point.samples, "seconds": median, **point.errors}
                writer.writerow(record | {"seconds_low": low, "seconds_high": high})
    return out.getvalue()
