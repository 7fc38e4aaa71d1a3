# SPDX-License-Identifier: GPL-3.0-or-later
"""How far answers to rays are from the exact ones, and how variants are listed.

What counts as well-conditioned: a distance whose condition number (core.crossing) is at most 2^26.
Arithmetic in double with some ten roundings of 2^-53 each then has t to 10 * 2^-27 of itself, a
third of a unit in the last place of a float, and 4 units leave room for the rounding to float and
for the clamp to the triangle's box; float arithmetic loses everything there. Rays beyond it start
within 2^-26 of the scene's size from the plane they hit, or run along it. Left out, too, are hits
closer than 2^-120 in a scene larger than 2^-100: the default scales t to lengths in the scene, and
those are denormal numbers there.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

MISS = 0xFFFFFFFF
WELL_CONDITIONED = 2.0**26
# Brute force takes rays x triangles tests; of more than this, an even sample of rays is judged.
JUDGED_TESTS = 1.5e9

Array = Any


@dataclass(frozen=True)
class Precision:
    """The tests to trace with: ids of core.precisions(); the layout is the tree's."""

    triangle_test: str = ""
    box_test: str = ""

    def arguments(self) -> dict[str, str]:
        """Keyword arguments of core.trace; none for its defaults."""
        pairs = ("triangle_test", self.triangle_test), ("box_test", self.box_test)
        return {name: value for name, value in pairs if value}


def choices(core: Any, what: str) -> list[str]:
    """Ids of the "triangle_test", "box_test" or "layout" choices, the default first."""
    return [entry["id"] for entry in core.precisions()[what]]


def precision_choices(core: Any) -> list[Precision]:
    """All pairs of a triangle and a box test, the default pair first."""
    return [
        Precision(triangle, box)
        for triangle in choices(core, "triangle_test")
        for box in choices(core, "box_test")
    ]


def trees(core: Any, tree: Any) -> Iterator[tuple[str, Any]]:
    """(name, tree) for each branching factor and layout that a binary tree collapses to."""
    for branching in (2, 4, 8):
        yield str(branching), tree.collapse(branching)
    for layout in choices(core, "layout")[1:]:
        yield layout, tree.collapse(8, layout=layout)


@dataclass
class Errors:
    """Wrong answers of a variant to the judged rays of a case.

    ``t_ulps``: |t - exact t| in float32 units in the last place of the exact t, by ray with the
    right triangle; ``well``: those of them that are well-conditioned. ``uv``: the larger error of u
    and v. ``missed_margin``: how far inside, in barycentric coordinates, lies the deepest hit that
    was missed. ``wrong_ulps``: how much farther than the nearest lies the triangle answered, at
    most, and ``farther``: wrong triangles that are so by more than a unit in the last place, which
    no rounding of t excuses.
    ``invalid``: answers that are none (no such triangle, NaN, outside [t_min, t_max]).
    """

    judged: int = 0
    false_misses: int = 0
    false_hits: int = 0
    wrong_triangles: int = 0
    invalid: int = 0
    must_hit_missed: int = 0
    must_miss_hit: int = 0
    missed_margin: float = 0.0
    wrong_ulps: float = 0.0
    farther: int = 0
    t_ulps: Array = field(default_factory=lambda: np.zeros(0))
    well: Array = field(default_factory=lambda: np.zeros(0, bool))
    uv: Array = field(default_factory=lambda: np.zeros(0))

    def wrong(self) -> int:
        """Rays with a wrong answer."""
        return self.false_misses + self.false_hits + self.wrong_triangles + self.invalid

    @cached_property
    def summary(self) -> dict[str, float | int]:
        """One value a name, for tables; t in ulps over well-conditioned and over all rays."""
        row: dict[str, float | int] = {
            name: getattr(self, name)
            for name in (
                "judged", "false_misses", "false_hits", "wrong_triangles", "invalid",
                "must_hit_missed", "must_miss_hit", "missed_margin", "wrong_ulps", "farther",
            )
        }  # fmt: skip
        for name, values in (
            ("t_ulps_well", self.t_ulps[self.well]),
            ("t_ulps_all", self.t_ulps),
            ("uv_well", self.uv[self.well]),
            ("uv_all", self.uv),
        ):
            quantiles = (
                np.quantile(values, (0.5, 0.999, 1.0), method="higher")  # infinities do not mix
                if len(values)
                else (0.0, 0.0, 0.0)
            )
            for label, value in zip(("median", "p999", "max"), quantiles, strict=True):
                row[f"{name}_{label}"] = float(value)
        row["well_conditioned"], row["answered"] = int(self.well.sum()), len(self.well)
        return row


def ulps(values: Array, exact: Array) -> Array:
    """|values - exact| in float32 units in the last place of exact; 0 where both overflow."""
    with np.errstate(over="ignore", invalid="ignore"):
        rounded = exact.astype(np.float32)
        unit = np.spacing(np.minimum(np.abs(rounded), np.finfo(np.float32).max)).astype(float)
        off = np.abs(values.astype(float) - exact) / unit
    return np.where(np.isinf(rounded) & (values == rounded), 0.0, off)


def well_conditioned(mesh: Any, origins: Array, directions: Array, crossing: Any) -> Array:
    """By ray, whether the crossing's t is to be within 4 units in the last place (see above)."""
    reach = np.abs(mesh.bounds[:, None].astype(float) - origins).max(axis=(0, 2))
    length = crossing.t * np.abs(directions).max(axis=1).astype(float)
    normal = (reach < 2.0**-100) | (length >= 2.0**-120) | (crossing.t == 0)
    return normal & (crossing.condition <= WELL_CONDITIONED)


class Judge:
    """The exact answers to a problem's rays, or to an even sample of them."""

    def __init__(self, core: Any, problem: Any, tests: float = JUDGED_TESTS) -> None:
        self.core, self.problem = core, problem
        self.mesh = core.Mesh(problem.vertices, problem.triangles)
        count = len(problem.origins)
        step = max(1, int(np.ceil(count * len(problem.triangles) / tests)))
        self.sample = np.arange(0, count, step)
        self.rays = [self._per_ray(argument) for argument in problem.rays()]
        self.truth = core.brute_force(self.mesh, *self.rays)
        self.hit = self.truth.occluded
        found = np.flatnonzero(self.hit)
        crossing = self._crossing(found, self.truth.triangle[found])
        self.margin = np.full(len(self.sample), np.inf)
        self.margin[found] = crossing.margin
        self.well = np.zeros(len(self.sample), bool)
        self.well[found] = well_conditioned(
            self.mesh, self.rays[0][found], self.rays[1][found], crossing
        )
        self._known: dict[bytes, Errors] = {}

    def errors(self, hits: Any) -> Errors:
        """The errors of a closest-hit answer to all rays of the problem."""
        arrays = hits.triangle, hits.t, hits.u, hits.v
        key = hashlib.sha256(b"".join(array.tobytes() for array in arrays)).digest()
        if key not in self._known:
            self._known[key] = self._errors(hits)
        return self._known[key]

    def _errors(self, hits: Any) -> Errors:
        everywhere = hits.triangle != MISS
        triangle = hits.triangle[self.sample]
        t, u, v = (array[self.sample] for array in (hits.t, hits.u, hits.v))
        valid = self._valid(triangle, t, u, v)
        hit = triangle != MISS
        errors = Errors(
            judged=len(self.sample),
            false_misses=int((self.hit & ~hit).sum()),
            false_hits=int((hit & valid & ~self.hit).sum()),
            invalid=int((~valid).sum()),
            must_hit_missed=int((self.problem.must_hit & ~everywhere).sum()),
            must_miss_hit=int((self.problem.must_miss & everywhere).sum()),
        )
        if errors.false_misses:
            errors.missed_margin = float(self.margin[self.hit & ~hit].max())
        both = np.flatnonzero(hit & self.hit & valid)
        same = triangle[both] == self.truth.triangle[both]
        right, other = both[same], both[~same]
        exact_u, exact_v = self.truth.u[right], self.truth.v[right]
        if len(other):
            chosen, true = triangle[other], self.truth.triangle[other]
            tied = self.core.exact_tie(
                self.mesh, self.rays[0][other], self.rays[1][other], chosen, true
            )
            crossing = self._crossing(other, chosen)
            errors.wrong_triangles = int((~tied).sum())
            if not tied.all():
                far = ulps(crossing.t[~tied], self.truth.t[other[~tied]])
                far = np.nan_to_num(far, nan=np.inf, posinf=np.inf)
                errors.wrong_ulps, errors.farther = float(far.max()), int((far > 1).sum())
            right = np.concatenate([right, other[tied]])
            exact_u = np.concatenate([exact_u, crossing.u[tied]])
            exact_v = np.concatenate([exact_v, crossing.v[tied]])
        errors.t_ulps = ulps(t[right], self.truth.t[right])
        errors.well = self.well[right]
        errors.uv = np.maximum(np.abs(u[right] - exact_u), np.abs(v[right] - exact_v))
        return errors

    def _valid(self, triangle: Array, t: Array, u: Array, v: Array) -> Array:
        """Answers that a miss or a hit may look like, right or wrong."""
        hit = triangle != MISS
        numbers = ~(np.isnan(t) | np.isnan(u) | np.isnan(v))
        return numbers & (
            (~hit & np.isinf(t))
            | (
                hit
                & (triangle < len(self.problem.triangles))
                & (t >= self.rays[2])
                & (t <= self.rays[3])
            )
        )

    def _per_ray(self, argument: Array) -> Array:
        shape = (len(self.problem.origins), *argument.shape[1:])
        return np.ascontiguousarray(np.broadcast_to(argument, shape)[self.sample])

    def _crossing(self, rays: Array, triangle: Array) -> Any:
        return self.core.crossing(self.mesh, self.rays[0][rays], self.rays[1][rays], triangle)


def disagreeing(a: Any, b: Any) -> int:
    """Rays whose closest hits differ in any bit."""
    differs = a.triangle != b.triangle
    for name in ("t", "u", "v"):
        differs |= getattr(a, name).view(np.uint32) != getattr(b, name).view(np.uint32)
    return int(differs.sum())
