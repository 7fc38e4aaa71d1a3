# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparing answers: bit for bit with our own, up to exact ties with a judge's."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .results import Errors
from .scene import Float32Array, Float64Array, UInt32Array

BoolArray = npt.NDArray[np.bool_]
TIE_ULPS = 4.0  # float32 units in the last place within which two distances are a tie


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
class Judge:
    """Compares answers with those of a judge, forgiving exact ties.

    ``vertices`` and ``triangles`` are the mesh, ``origins`` and ``directions`` (N, 3) the judged
    rays, ``truth`` the judge's answers to them.
    """

    vertices: Float32Array
    triangles: UInt32Array
    origins: Float32Array
    directions: Float32Array
    truth: Answers

    def errors(self, answers: Answers) -> Errors:
        """Count the wrong answers (see `Errors`)."""
        hit, should_hit = answers.occluded, self.truth.occluded
        errors = Errors(
            judged=len(hit),
            false_misses=int((~hit & should_hit).sum()),
            false_hits=int((hit & ~should_hit).sum()),
        )
        if answers.t is None or answers.triangle is None:
            return errors
        assert self.truth.t is not None and self.truth.triangle is not None
        same = answers.triangle == self.truth.triangle
        both = np.flatnonzero(hit & should_hit & same)
        if len(both):
            true_t = self.truth.t[both].astype(np.float64)
            relative = np.abs(answers.t[both] - true_t) / np.maximum(
                true_t, np.finfo(np.float32).tiny
            )
            errors.largest_t_error = float(relative.max())
        other = np.flatnonzero(hit & should_hit & ~same)
        errors.wrong_triangles = int((~self._tied(other, answers)).sum())
        return errors

    def _tied(self, rays: npt.NDArray[np.intp], answers: Answers) -> BoolArray:
        """Whether these rays met another triangle at the judge's distance.

        The distance to the triangle that was answered is computed in double here: the rounding of
        the answer's own float32 distance grows with the triangle, not with the distance.
        """
        assert answers.t is not None and answers.triangle is not None and self.truth.t is not None
        true_t = self.truth.t[rays].astype(np.float64)
        exact_t = self._plane_distance(rays, answers.triangle[rays])
        off = np.minimum(np.abs(exact_t - true_t), np.abs(answers.t[rays] - true_t))
        tolerance = TIE_ULPS * np.spacing(true_t.astype(np.float32)).astype(np.float64)
        return np.asarray(off <= tolerance, dtype=np.bool_)

    def _plane_distance(self, rays: npt.NDArray[np.intp], triangle: UInt32Array) -> Float64Array:
        a, b, c = (self.vertices[self.triangles[triangle, i]].astype(np.float64) for i in range(3))
        normal = np.cross(b - a, c - a)
        origin = self.origins[rays].astype(np.float64)
        direction = self.directions[rays].astype(np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = ((a - origin) * normal).sum(axis=1) / (direction * normal).sum(axis=1)
        return np.where(np.isfinite(distance), distance, np.inf)
