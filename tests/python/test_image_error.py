# SPDX-License-Identifier: GPL-3.0-or-later
"""Image error through Python: closed forms, FLIP against its authors' own program, bad input."""

from __future__ import annotations

import math

import numpy as np
import pytest
from bvh_lab.native import core

MEASURES = ("relMSE", "MAE", "RMSE", "FLIP", "bias")


def pattern(height: int, width: int) -> np.ndarray:
    """(height, width, 3) float32 with waves, edges and black."""
    y, x = np.mgrid[0:height, 0:width]
    channels = (
        1.0 + np.sin(x / 5.0),
        0.5 + 0.5 * np.cos(y / 9.0 + x / 20.0),
        2.0 * (x > width / 2),
    )
    return np.stack(channels, axis=-1).astype(np.float32)


def noisy(reference: np.ndarray, variance: float) -> np.ndarray:
    """Each value times a gamma-distributed factor of mean 1."""
    random = np.random.default_rng(5)
    factors = random.gamma(1.0 / variance, variance, reference.shape)
    return (reference * factors).astype(np.float32)


def test_formulas() -> None:
    reference, picture = pattern(30, 40), noisy(pattern(30, 40), 0.3)
    x, r = picture.astype(np.float64), reference.astype(np.float64)
    error, mean = core.image_error(picture, reference), r.mean()
    mse = np.mean((x - r) ** 2)
    assert error["relMSE"] == pytest.approx(np.mean((x - r) ** 2 / (r**2 + 0.01 * mean**2)))
    assert error["MAE"] == pytest.approx(np.mean(np.abs(x - r)))
    assert error["RMSE"] == pytest.approx(math.sqrt(mse))
    assert error["PSNR"] == pytest.approx(10.0 * math.log10(r.max() ** 2 / mse))
    assert error["bias"] == pytest.approx(np.mean(x - r) / mean)
    assert error["non_finite"] == 0


def test_grey_is_the_colour_without_chroma() -> None:
    reference = pattern(20, 30)[..., 0]
    picture = noisy(reference, 0.3)
    error = core.image_error(picture, reference)
    stacked = core.image_error(np.stack([picture] * 3, -1), np.stack([reference] * 3, -1))
    assert error == pytest.approx(stacked)
    assert core.image_error(picture[..., None], reference[..., None]) == error


def test_more_samples_less_error() -> None:
    reference = pattern(40, 60)
    errors = [core.image_error(noisy(reference, 1.0 / n), reference) for n in (1, 4, 16)]
    for measure in ("relMSE", "MAE", "RMSE", "FLIP"):
        assert errors[0][measure] > errors[1][measure] > errors[2][measure] > 0.0
    assert errors[0]["relMSE"] / errors[2]["relMSE"] == pytest.approx(16.0, rel=0.2)


@pytest.mark.parametrize("size", [(8, 8), (5, 90), (96, 128)])
@pytest.mark.parametrize("variance", [0.02, 2.0])
def test_flip_is_that_of_its_authors(size: tuple[int, int], variance: float) -> None:
    judge = pytest.importorskip("flip_evaluator")
    reference = pattern(*size)
    picture = noisy(reference, variance)
    mean = reference.mean(dtype=np.float64)

    def shown(values: np.ndarray) -> np.ndarray:
        mapped = values / (values + mean)
        curve = 1.055 * np.maximum(mapped, 1e-9) ** (1.0 / 2.4) - 0.055
        return np.where(mapped <= 0.0031308, 12.92 * mapped, curve).astype(np.float32)

    truth = judge.evaluate(shown(reference), shown(picture), "LDR", applyMagma=False)[1]
    assert core.image_error(picture, reference)["FLIP"] == pytest.approx(truth, abs=1e-5)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_no_broken_value_is_hidden(bad: float) -> None:
    reference = pattern(10, 10)
    picture = reference.copy()
    picture[3, 4, 1] = bad
    error = core.image_error(picture, reference)
    assert error["non_finite"] == 1
    assert all(error[measure] == math.inf for measure in MEASURES)
    assert error["PSNR"] == -math.inf


@pytest.mark.parametrize("bad", [math.nan, math.inf, -1.0])
def test_broken_reference_is_refused(bad: float) -> None:
    reference = pattern(10, 10)
    reference[3, 4, 1] = bad
    with pytest.raises(ValueError, match=r"reference.*\(4, 3\)"):
        core.image_error(pattern(10, 10), reference)


def test_shapes_must_fit() -> None:
    with pytest.raises(ValueError, match=r"10 x 12.*10 x 10"):
        core.image_error(pattern(12, 10), pattern(10, 10))
    with pytest.raises(ValueError, match="1 or 3 channels, not 4"):
        core.image_error(np.ones((4, 4, 4), np.float32), np.ones((4, 4, 4), np.float32))
    with pytest.raises(ValueError, match="picture must be an array of numbers"):
        core.image_error("no picture", pattern(4, 4))


def test_flip_can_be_left_out() -> None:
    picture, reference = pattern(10, 10), pattern(10, 10) + np.float32(0.1)
    whole = core.image_error(picture, reference)
    assert whole.pop("FLIP") > 0.0
    assert core.image_error(picture, reference, flip=False) == whole
