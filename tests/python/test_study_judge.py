# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparing answers bit for bit, and with a judge up to exact ties."""

from __future__ import annotations

import numpy as np
import pytest
from bvh_lab.native import core
from bvh_lab.study.accuracy import Accuracy
from bvh_lab.study.judge import Answers, Judge, differing_rays, picture_difference

MISS = 0xFFFFFFFF
# Two triangles that share an edge in the plane z = 0, a copy of the first, and one at z = 1.
VERTICES = np.array(
    [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], np.float32
)
TRIANGLES = np.array([[0, 1, 2], [1, 3, 2], [0, 1, 2], [4, 5, 6]], np.uint32)
MESH = core.Mesh(VERTICES, TRIANGLES)
ORIGINS = np.tile(np.float32([0.25, 0.25, 2.0]), (4, 1))
DIRECTIONS = np.tile(np.float32([0.0, 0.0, -1.0]), (4, 1))


def answers(triangle: list[int], t: list[float], dtype: type = np.float32) -> Answers:
    numbers = np.array(triangle, np.uint32)
    zeros = np.zeros(len(t), dtype)
    return Answers(numbers != MISS, np.array(t, dtype), zeros, zeros.copy(), numbers)


def judge(triangle: list[int], t: list[float]) -> Judge:
    count = len(t)
    truth = answers(triangle, t, np.float64)
    return Judge(core, MESH, ORIGINS[:count], DIRECTIONS[:count], truth)


def test_same_answers_have_no_errors() -> None:
    errors = judge([3, MISS], [1.0, np.inf]).errors(answers([3, MISS], [1.0, np.inf]))
    assert (errors.judged, errors.wrong) == (2, 0)


def test_misses_and_hits_are_told_apart() -> None:
    errors = judge([3, MISS, 3], [1.0, np.inf, 1.0]).errors(
        answers([MISS, 3, MISS], [np.inf, 1.0, np.inf])
    )
    assert (errors.false_misses, errors.false_hits, errors.wrong_triangles) == (2, 1, 0)


def test_a_triangle_further_away_is_wrong() -> None:
    errors = judge([3], [1.0]).errors(answers([0], [2.0]))
    assert errors.wrong_triangles == errors.wrong == 1


def test_equal_distance_is_a_tie() -> None:
    assert judge([0], [2.0]).errors(answers([2], [2.0])).wrong == 0


def test_a_rounded_distance_to_a_tied_triangle_is_a_tie() -> None:
    off = np.float32(2.0) * np.float32(1.00001)
    assert judge([0], [2.0]).errors(answers([2], [off])).wrong == 0


def test_a_neighbour_that_is_not_met_is_no_tie() -> None:
    assert judge([0], [2.0]).errors(answers([1], [2.0])).wrong_triangles == 1  # in the same plane


def test_deviations_are_from_the_exact_crossing_of_what_was_answered() -> None:
    truth = [3, 0, 3, 3], [1.0, 2.0, 1.0, 1.0]
    answered = answers([3, 2, 0, MISS], [1.5, 2.0, 2.0, np.inf])  # the third and fourth are wrong
    deviations = judge(*truth).deviations(answered)
    assert deviations.t_ulps.tolist() == [2.0**22, 0.0]  # an ulp of 1 is 2^-23
    assert deviations.uv.tolist() == [0.25, 0.25]  # u = v = 1/4, and 0 was answered


def test_any_hit_has_no_deviations() -> None:
    truth = Answers(np.array([True, False]))
    judged = Judge(core, MESH, ORIGINS[:2], DIRECTIONS[:2], truth)
    assert len(judged.deviations(Answers(np.array([True, True]))).t_ulps) == 0


def test_a_distance_that_is_no_number_is_the_largest_error() -> None:
    deviations = judge([3, 3], [1.0, 1.0]).deviations(answers([3, 3], [np.nan, np.inf]))
    assert deviations.t_ulps.tolist() == [np.finfo(np.float64).max] * 2


def test_accuracy_pools_all_hits() -> None:
    accuracy = Accuracy.of(np.arange(1001.0), np.linspace(0.0, 1.0, 1001))
    assert accuracy == Accuracy(1001, 500.0, pytest.approx(999.0), 1000.0, 0.5, 1.0)
    assert Accuracy.of(np.empty(0), np.empty(0)) is None


def test_any_hit_has_only_misses_and_hits() -> None:
    truth = Answers(np.array([True, False, True, False]))
    judged = Judge(core, MESH, ORIGINS, DIRECTIONS, truth)
    errors = judged.errors(Answers(np.array([True, True, False, False])))
    assert (errors.judged, errors.false_misses, errors.false_hits) == (4, 1, 1)


def test_differing_rays_compares_bits() -> None:
    reference = answers([0, 0, MISS], [2.0, 2.0, np.inf])
    assert differing_rays(answers([0, 0, MISS], [2.0, 2.0, np.inf]), reference) == 0
    other = answers([0, 2, MISS], [np.nextafter(np.float32(2), np.float32(3)), 2.0, np.inf])
    assert differing_rays(other, reference) == 2
    assert other.sha256() != reference.sha256()


def test_minus_zero_is_another_answer() -> None:
    reference = answers([0], [0.0])
    assert differing_rays(answers([0], [-0.0]), reference) == 1


def test_a_sample_keeps_its_rays() -> None:
    sample = answers([0, 3, MISS], [2.0, 1.0, np.inf]).sample(np.array([1, 2]))
    assert sample.triangle is not None and sample.triangle.tolist() == [3, MISS]
    assert Answers(np.array([True, False])).sample(np.array([1])).occluded.tolist() == [False]


def test_picture_difference_is_finite() -> None:
    reference = np.float32([[[np.nan, 1.0, np.inf]]])
    assert not picture_difference(reference, reference).any()
    difference = picture_difference(np.float32([[[0.0, 1.5, 1.0]]]), reference)
    largest = np.finfo(np.float32).max
    assert difference.tolist() == [[[largest, 0.5, largest]]]
