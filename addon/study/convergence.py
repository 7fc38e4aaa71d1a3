# SPDX-License-Identifier: GPL-3.0-or-later
"""How soon a picture is good enough: what a result holds of it."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class ErrorPoint:
    """A picture of ``samples`` per pixel with its errors, by their names in `core.image_error`.

    A measure that is not finite is left out.
    """

    samples: int
    errors: dict[str, float] = field(default_factory=dict)


@dataclass
class Convergence:
    """How the picture of ``view`` converges: alike for all our variants, whose pictures are equal.

    The errors are to a reference of ``reference_samples`` per pixel, whose own relMSE is about
    ``reference_error``. ``points`` by increasing samples are what the variant ``rendered_by``
    rendered. ``samples`` per pixel bring the relMSE down to ``target``, interpolated between points
    on log-log axes; None where no point came so far.
    """

    view: str
    target: float
    reference_samples: int
    reference_error: float
    rendered_by: str
    points: list[ErrorPoint] = field(default_factory=list)
    samples: float | None = None


@dataclass
class TimeToError:
    """The seconds that one variant's picture of ``view`` takes to relMSE ``target``.

    They are the samples needed times the variant's own seconds per sample. None: not reached.
    """

    view: str
    target: float
    seconds: float | None
