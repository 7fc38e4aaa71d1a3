# SPDX-License-Identifier: GPL-3.0-or-later
"""Every builder, width and layout on every hard case (`make stability` runs them at full size).

The default tests of `core.trace` have to be right; the other precision choices are compared with
them elsewhere, wrong as they may be, but must answer. The errors of all are printed as tables.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builder_params import fast_params
from bvh_lab.native import core

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "blender_scenes"), str(ROOT / "scripts")]

from hard_cases import CASES, case_named
from stability_cases import CaseRow, Variant
from stability_measure import MISS, Judge, disagreeing, precision_choices, trees
from stability_tables import CHOICES_HEAD, DEFAULT_HEAD, choices_cells, default_cells, pair_name

TRACED = [case.name for case in CASES if not case.refused]
REFUSED = [case.name for case in CASES if case.refused]
# u and v are rounded to float, at most 2^-25 for a value up to 1, after an error in double that is
# far below that where the triangle is well-conditioned (stability_measure.py).
UV_BOUND = 2.0**-24


@cache
def judge_of(name: str) -> Judge:
    return Judge(core, case_named(name).make(False))


def all_trees(name: str) -> Any:
    """(variant, tree) of every builder, width and layout."""
    mesh = judge_of(name).mesh
    for builder in [entry["id"] for entry in core.builders()]:
        tree = core.build_tree(mesh, builder, params=fast_params(builder))
        for width, bvh in trees(core, tree):
            yield Variant(builder, width), bvh


@pytest.mark.parametrize("name", TRACED)
def test_the_default_is_right_and_the_same_from_every_tree(
    name: str, record_property: Callable[[str, object], None]
) -> None:
    judge = judge_of(name)
    rays = judge.problem.rays()
    first, rows = None, []
    for variant, bvh in all_trees(name):
        bvh.validate()
        hits, any_hit = core.trace(bvh, *rays), core.trace(bvh, *rays, any_hit=True)
        first = first or hits
        row = CaseRow(
            name,
            variant,
            judge.errors(hits).summary,
            disagreeing(first, hits),
            int((any_hit.occluded != hits.occluded).sum()),
        )
        assert row.disagreeing == row.any_hit_differs == 0, variant
        rows.append(row)
    record_property("table", (DEFAULT_HEAD, default_cells(rows)))
    errors = judge.errors(first)
    assert errors.must_hit_missed == errors.must_miss_hit == 0
    assert errors.false_misses == errors.false_hits == errors.invalid == 0
    # Two triangles are told apart by t as it is returned, in float32. The one answered may be
    # farther than the nearest by that rounding: half a unit for each of the two.
    assert errors.wrong_triangles == 0 or errors.wrong_ulps <= 1.0
    assert errors.t_ulps[errors.well].max(initial=0.0) <= 4.0
    assert errors.uv[errors.well].max(initial=0.0) <= UV_BOUND


@pytest.mark.parametrize("name", TRACED)
def test_other_precision_choices_answer(
    name: str, record_property: Callable[[str, object], None]
) -> None:
    """Right or wrong, but a miss, or a triangle at a distance within the interval."""
    judge = judge_of(name)
    rays = judge.problem.rays()
    tree = core.build_tree(judge.mesh, "sbvh")
    choices = precision_choices(core)[1:]
    rows = []
    for width, bvh in list(trees(core, tree))[2:]:  # 8-wide, in every layout
        for choice in choices:
            variant = Variant("sbvh", width, choice)
            hits = core.trace(bvh, *rays, **choice.arguments())
            errors = judge.errors(hits)
            assert errors.invalid == 0, variant
            any_hit = core.trace(bvh, *rays, any_hit=True, **choice.arguments())
            assert any_hit.occluded.shape == hits.occluded.shape, variant
            rows.append(CaseRow(name, variant, errors.summary, 0, 0))
    names = [pair_name(choice) for choice in choices]
    record_property("table", ((CHOICES_HEAD, *names), choices_cells(rows, names)))


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_mesh_or_ray_is_refused_in_a_sentence(name: str) -> None:
    case = case_named(name)
    problem = case.make(False)
    with pytest.raises(ValueError, match=case.refused):
        mesh = core.Mesh(problem.vertices, problem.triangles)
        core.trace(core.build(mesh, "lbvh"), *problem.rays())


def test_coincident_triangles_are_told_apart_by_their_index() -> None:
    for name in ("identical", "twice"):
        judge = judge_of(name)
        half = len(judge.problem.triangles) // 2
        hits = core.trace(core.build(judge.mesh, "ploc"), *judge.problem.rays())
        assert hits.triangle.max() < half
    assert not hits.triangle.all()
    identical = judge_of("identical")
    hits = core.trace(core.build(identical.mesh, "ploc"), *identical.problem.rays())
    assert not hits.triangle.any()


def test_a_t_that_overflows_is_infinite() -> None:
    judge = judge_of("overflowing_t")
    hits = core.trace(core.build(judge.mesh, "lbvh"), *judge.problem.rays())
    assert hits.occluded.all() and (hits.triangle != MISS).all() and np.isinf(hits.t).all()


def test_the_start_of_a_ray_on_a_surface_is_a_hit_at_zero() -> None:
    judge = judge_of("from_vertices")
    hits = core.trace(core.build(judge.mesh, "lbvh"), *judge.problem.rays())
    assert (hits.t[judge.problem.must_hit] == 0).all()


def test_cases_say_what_they_are() -> None:
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names)
    assert {case.group[0] for case in CASES} == set("123456")
    for case in CASES:
        assert case.tries and case.expected, case.name
        small, again = case.make(False), case.make(False)
        for a, b in zip(small.rays(), again.rays(), strict=True):
            assert a.tobytes() == b.tobytes(), case.name
        assert small.vertices.tobytes() == again.vertices.tobytes(), case.name
    with pytest.raises(KeyError, match="no hard case 'nothing'; there are sphere_random"):
        case_named("nothing")
