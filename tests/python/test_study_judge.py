# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparing answers bit for bit, and with a judge up to ties."""

from __future__ import annotations

import numpy as np
from bvh_lab.study.judge import Answers, Judge, differing_rays, picture_difference

MISS = 0xFFFFFFFF
# Two triangles that share an edge in the plane z = 0, a copy of the first, and one at z = 1.
VERTICES = np.array(
    [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], np.float32
)
TRIANGLES = np.array([[0, 1, 2], [1, 3, 2], [0, 1, 2], [4, 5, 6]], np.uint32)
ORIGINS = np.tile(np.float32([0.25, 0.25, 2.0]), (4, 1))
DIRECTIONS = np.tile(np.float32([0.0, 0.0, -1.0]), (4, 1))


def answers(triangle: list[int], t: list[float], dtype: type = np.float32) -> Answers:
    numbers = np.array(triangle, np.uint32)
    zeros = np.zeros(len(t), dtype)
    return Answers(numbers != MISS, np.array(t, dtype), zeros, zeros.copy(), numbers)


def judge(triangle: list[int], t: list[float]) -> Judge:
    count = len(t)
    truth = answers(triangle, t, np.float64)
    return Judge(VERTICES, TRIANGLES, ORIGINS[:count], DIRECTIONS[:count], truth)


def test_same_answers_have_no_errors() -> None:
    errors = judge([3, MISS], [1.0, np.inf]).errors(answers([3, MISS], [1.0, np.inf]))
    assert (errors.judged, errors.wrong, errors.largest_t_error) == (2, 0, 0.0)


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


def test_the_distance_error_is_relative() -> None:
    errors = judge([3], [1.0]).errors(answers([3], [1.5]))
    assert (errors.wrong, errors.largest_t_error) == (0, 0.5)


def test_any_hit_has_only_misses_and_hits() -> None:
    truth = Answers(np.array([True, False, True, False]))
    judged = Judge(VERTICES, TRIANGLES, ORIGINS, DIRECTIONS, truth)
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
