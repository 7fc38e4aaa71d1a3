# SPDX-License-Identifier: GPL-3.0-or-later
"""All variants on the hard cases: how wrong they are, and how fast."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from stability_measure import Judge, Precision, disagreeing, precision_choices, trees

EMBREE = ("embree_fast", "embree_robust")
# The trees that speed is measured on: a builder that every mesh is quickly built by.
SPEED_BUILDER = "sbvh"


@dataclass
class Variant:
    """Who answered: a builder's tree in a width or layout with a pair of tests, or Embree."""

    builder: str
    tree: str = ""
    precision: Precision = field(default_factory=Precision)

    @property
    def choice(self) -> str:
        """The precision choice by name: layout, triangle test and box test; Embree's own name."""
        if not self.tree:
            return self.builder
        layout = self.tree if not self.tree.isdecimal() else "full"
        return "/".join((layout, self.precision.triangle_test, self.precision.box_test))

    def columns(self) -> dict[str, str]:
        return {"builder": self.builder, "tree": self.tree, **asdict(self.precision)}


@dataclass
class CaseRow:
    """Errors of a variant on a case, as Errors.summary() names them.

    ``disagreeing``: rays whose hit differs in any bit from that of the case's first tree with the
    same tests; ``any_hit_differs``: rays for which any hit says another thing than closest hit.
    """

    case: str
    variant: Variant
    errors: dict[str, float | int]
    disagreeing: int
    any_hit_differs: int

    def wrong(self) -> int:
        """Rays with a wrong answer."""
        return self.gaps() + int(self.errors["wrong_triangles"])

    def gaps(self) -> int:
        """Rays that hit where there is nothing or nothing where something is."""
        names = ("false_misses", "false_hits", "invalid")
        return int(sum(self.errors[name] for name in names))

    def share(self, count: int) -> float:
        """So many of the judged rays, as a share."""
        return count / max(1, self.errors["judged"])

    def columns(self) -> dict[str, Any]:
        """The row of a table."""
        return {
            "case": self.case,
            **self.variant.columns(),
            **self.errors,
            "disagreeing": self.disagreeing,
            "any_hit_differs": self.any_hit_differs,
        }


@dataclass
class SpeedRow:
    """Speed of a variant over that of the default of the same tree, round by round."""

    case: str
    variant: Variant
    mrays: float
    ratios: list[float]

    def quartiles(self) -> tuple[float, float, float]:
        low, median, high = np.quantile(self.ratios, (0.25, 0.5, 0.75))
        return float(low), float(median), float(high)

    def columns(self) -> dict[str, Any]:
        low, median, high = self.quartiles()
        ratios = {"speed_ratio": median, "ratio_low": low, "ratio_high": high}
        return {
            "case": self.case,
            **self.variant.columns(),
            "mrays_per_second": self.mrays,
            **ratios,
            "rounds": len(self.ratios),
        }


def fast_params(builder: str) -> dict[str, float]:
    """Few iterations for the annealing builders, which would run 3000; else the defaults."""
    return {"iterations": 60.0} if builder in ("prbvh_a", "prbvh_sa") else {}


def case_trees(core: Any, case: Any, mesh: Any) -> Iterator[tuple[str, str, Any]]:
    """(builder, width or layout, tree) of each."""
    limited = case.builders and len(mesh.triangles) > 100_000
    for builder in case.builders if limited else [entry["id"] for entry in core.builders()]:
        binary = core.build_tree(mesh, builder, params=fast_params(builder))
        for name, bvh in trees(core, binary):
            yield builder, name, bvh


def embree_scenes(core: Any, mesh: Any) -> dict[str, Any]:
    """Embree's scenes by name, fast and robust; none where there is no Embree."""
    if not core.embree()["available"]:
        return {}
    return {
        name: core.EmbreeScene(mesh, quality="high", robust=name == "embree_robust")
        for name in EMBREE
    }


def measure_case(core: Any, case: Any, large: bool) -> list[CaseRow]:
    """Errors of every variant on a case that is not to be refused."""
    judge = Judge(core, case.make(large))
    rays = judge.problem.rays()
    rows = []
    first: dict[Precision, Any] = {}
    for builder, tree, bvh in case_trees(core, case, judge.mesh):
        bvh.validate()
        for precision in precision_choices(core):
            arguments = precision.arguments()
            hits = core.trace(bvh, *rays, **arguments)
            any_hit = core.trace(bvh, *rays, any_hit=True, **arguments)
            reference = first.setdefault(precision, hits)
            rows.append(
                CaseRow(
                    case.name,
                    Variant(builder, tree, precision),
                    judge.errors(hits).summary,
                    disagreeing(reference, hits),
                    int((any_hit.occluded != hits.occluded).sum()),
                )
            )
    for name, scene in embree_scenes(core, judge.mesh).items():
        hits, any_hit = scene.trace(*rays), scene.trace(*rays, any_hit=True)
        differs = int((any_hit.occluded != hits.occluded).sum())
        rows.append(CaseRow(case.name, Variant(name), judge.errors(hits).summary, 0, differs))
    return rows


def refusal(core: Any, case: Any) -> str:
    """The sentence by which a case is refused. Raises AssertionError where it is not."""
    problem = case.make(False)
    try:
        mesh = core.Mesh(problem.vertices, problem.triangles)
        core.trace(core.build(mesh, "lbvh"), *problem.rays())
    except ValueError as error:
        return str(error)
    raise AssertionError(f"{case.name} was not refused")


def measure_speed(
    core: Any, name: str, mesh: Any, rays: tuple[Any, ...], rounds: int
) -> list[SpeedRow]:
    """Speeds of all tests and layouts, and of Embree, on the trees of one builder.

    Contenders take turns, so that what slows the machine slows all of them. The ratio is to the
    default tests on the full 8-wide tree in the same round.
    """
    binary = core.build_tree(mesh, SPEED_BUILDER)
    contenders: list[tuple[Variant, Any]] = []
    for tree, bvh in trees(core, binary):
        for precision in precision_choices(core):
            variant = Variant(SPEED_BUILDER, tree, precision)
            contenders.append((variant, _tracer(core, bvh, precision)))
    contenders += [(Variant(n), scene.trace) for n, scene in embree_scenes(core, mesh).items()]
    base = Variant(SPEED_BUILDER, "8", precision_choices(core)[0])
    for _, trace in contenders:  # warm: what is prepared once is no part of tracing
        trace(*rays)
    seconds = np.zeros((rounds, len(contenders)))
    for turn in range(rounds):
        for i in np.roll(np.arange(len(contenders)), turn):
            seconds[turn, i] = contenders[i][1](*rays).traverse_seconds
    of_base = next(i for i, (variant, _) in enumerate(contenders) if variant == base)
    count = len(rays[0])
    return [
        SpeedRow(
            name,
            variant,
            1e-6 * count / float(np.median(seconds[:, i])),
            (seconds[:, of_base] / seconds[:, i]).tolist(),
        )
        for i, (variant, _) in enumerate(contenders)
    ]


def _tracer(core: Any, bvh: Any, precision: Precision) -> Any:
    return lambda *rays: core.trace(bvh, *rays, **precision.arguments())
