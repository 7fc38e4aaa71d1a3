# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparing answers: bit for bit with our own, up to exact ties with a judge's."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from .accuracy import Errors
from .scene import Float32Array, Float64Array, UInt32Array

BoolArray = npt.NDArray[np.bool_]


@dataclass
class Answers:
    """What a batch of N rays met. Any hit: ``occluded`` alone, the rest None.

    ``t``, ``u``, ``v`` are (N,) float32 (float64 from brute force), ``triangle`` (N,) uint32,
    ``occluded`` (N,) bool.
    """

    occluded: BoolArray
    t: npt.NDArray[np.floating[Any]] | None = None
    u: npt.NDArray[np.floating[Any]] | None = None
    v: npt.NDArray[np.floating[Any]] | None = None
    triangle: UInt32Array | None = None

    @classmethod
    def of(cls, hit: Any) -> Answers:
        """The answers in what `core.trace`, `core.brute_force` or Embree returned."""
        return cls(hit.occluded, hit.t, hit.u, hit.v, hit.triangle)

    def arrays(self) -> list[npt.NDArray[Any]]:
        """The arrays that are there, in a fixed order."""
        parts = (self.occluded, self.t, self.u, self.v, self.triangle)
        return [part for part in parts if part is not None]

    def sample(self, rays: npt.NDArray[np.intp]) -> Answers:
        """The answers of some rays."""
        if self.t is None or self.u is None or self.v is None or self.triangle is None:
            return Answers(self.occluded[rays])
        return Answers(
            self.occluded[rays], self.t[rays], self.u[rays], self.v[rays], self.triangle[rays]
        )

    def sha256(self) -> str:
        """Hash of every bit of the answers, hexadecimal."""
        sha = hashlib.sha256()
        for part in self.arrays():
            sha.update(np.ascontiguousarray(part).data)
        return sha.hexdigest()


def differing_rays(answers: Answers, reference: Answers) -> int:
    """How many rays got another answer, compared bit for bit."""
    differs: BoolArray = np.zeros(len(answers.occluded), dtype=np.bool_)
    for ours, theirs in zip(answers.arrays(), reference.arrays(), strict=True):
        if ours.dtype.kind == "f":
            ours, theirs = ours.view(np.uint32), theirs.view(np.uint32)
        differs |= ours != theirs
    return int(differs.sum())


def picture_difference(pixels: Float32Array, reference: Float32Array) -> Float32Array:
    """|pixels - reference| per channel, 0 where the bits are equal and never NaN or infinite."""
    with np.errstate(invalid="ignore", over="ignore"):
        difference = np.abs(pixels - reference)
    largest = float(np.finfo(np.float32).max)
    difference = np.nan_to_num(difference, nan=largest, posinf=largest)
    return np.where(pixels.view(np.uint32) == reference.view(np.uint32), np.float32(0), difference)


@dataclass
class Deviations:
    """How far the hits on the right triangle are from the exact ones, one entry a hit.

    ``t_ulps`` is |t - exact t| in units in the last place of the exact t as a float32, ``uv`` the
    larger of |u - exact u| and |v - exact v|. Both float64, finite.
    """

    t_ulps: Float64Array
    uv: Float64Array

    @classmethod
    def none(cls) -> Deviations:
        """Of no hits."""
        return cls(np.empty(0), np.empty(0))


@dataclass
class Judge:
    """Compares answers with those of a judge, forgiving exact ties.

    ``mesh`` is a `core.Mesh`, ``origins`` and ``directions`` (N, 3) are the judged rays, ``truth``
    the judge's answers to them.
    """

    core: ModuleType
    mesh: Any
    origins: Float32Array
    directions: Float32Array
    truth: Answers

    def errors(self, answers: Answers) -> Errors:
        """Count the wrong answers (see `Errors`)."""
        hit, should_hit = answers.occluded, self.truth.occluded
        return Errors(
            judged=len(hit),
            false_misses=int((~hit & should_hit).sum()),
            false_hits=int((hit & ~should_hit).sum()),
            wrong_triangles=int((hit & should_hit & ~self._right(answers)).sum()),
        )

    def deviations(self, answers: Answers) -> Deviations:
        """How exact the right hits are; none where only occlusion was asked for.

        Each is held against the exact crossing of the triangle that was answered.
        """
        if answers.t is None or answers.u is None or answers.v is None or answers.triangle is None:
            return Deviations.none()
        rays = np.flatnonzero(answers.occluded & self.truth.occluded & self._right(answers))
        if not len(rays):
            return Deviations.none()
        exact = self.core.crossing(
            self.mesh, self.origins[rays], self.directions[rays], answers.triangle[rays]
        )
        with np.errstate(over="ignore", invalid="ignore"):
            ulp = np.spacing(np.abs(exact.t).astype(np.float32)).astype(np.float64)
            t_ulps = np.abs(answers.t[rays] - exact.t) / ulp
            uv = np.maximum(np.abs(answers.u[rays] - exact.u), np.abs(answers.v[rays] - exact.v))
        return Deviations(_finite(t_ulps), _finite(uv))

    def _right(self, answers: Answers) -> BoolArray:
        """Which hits are on the judge's triangle, or tied with it; of no meaning for misses."""
        if answers.triangle is None or self.truth.triangle is None:
            return np.ones(len(answers.occluded), dtype=np.bool_)
        right: BoolArray = answers.triangle == self.truth.triangle
        other = np.flatnonzero(answers.occluded & self.truth.occluded & ~right)
        if len(other):
            right[other] = self.core.exact_tie(
                self.mesh,
                self.origins[other],
                self.directions[other],
                answers.triangle[other],
                self.truth.triangle[other],
            )
        return right


def _finite(values: Float64Array) -> Float64Array:
    """NaN and infinities as the largest number: JSON has neither, and an error they are."""
    largest = float(np.finfo(np.float64).max)
    return np.nan_to_num(values, nan=largest, posinf=largest)
