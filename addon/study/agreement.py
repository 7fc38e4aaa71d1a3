# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether two renderers converge to the same picture: their difference beyond noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .reference_picture import ReferencePicture
from .scene import Float64Array

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # Rec. 709
BLOCK = 16  # pixels along a side: enough to average noise away, few enough to show structure


@dataclass
class Agreement:
    """Two converged pictures, ours minus theirs, in units of the mean luminance of theirs.

    ``residual`` is (H, W). ``mean`` is its mean, ``mean_noise`` the standard deviation that the
    noise of both gives that mean. ``blocks`` is the root mean square of the residual's means over
    blocks of 16 x 16 pixels, ``blocks_noise`` what noise alone would give: where the pictures agree
    the two are alike, where something is systematically different the first is larger.
    """

    residual: Float64Array
    mean: float
    mean_noise: float
    blocks: float
    blocks_noise: float

    @property
    def structure(self) -> float:
        """Root mean square of what blocks differ by beyond noise; 0 where noise explains it all."""
        return float(np.sqrt(max(self.blocks**2 - self.blocks_noise**2, 0.0)))

    def sentence(self) -> str:
        """All of it in words, percent of the mean."""
        return (
            f"mean difference {100.0 * self.mean:+.3f}% of the mean "
            f"(noise ±{100.0 * self.mean_noise:.3f}%); blocks of {BLOCK}x{BLOCK} pixels differ by "
            f"{100.0 * self.blocks:.2f}% (root mean square), of which noise explains "
            f"{100.0 * self.blocks_noise:.2f}%"
        )


def agreement(ours: ReferencePicture, theirs: ReferencePicture) -> Agreement:
    """Compare two converged pictures of one size."""
    mean = float(_luminance(theirs.pixels).mean())
    residual = (_luminance(ours.pixels) - _luminance(theirs.pixels)) / mean
    noises = [_luminance(picture.noise) / mean for picture in (ours, theirs)]
    return Agreement(
        residual,
        mean=float(residual.mean()),
        mean_noise=float(np.sqrt(sum((noise**2).mean() / noise.size for noise in noises))),
        blocks=float(np.sqrt((block_means(residual) ** 2).mean())),
        blocks_noise=float(np.sqrt(sum((block_means(noise) ** 2).mean() for noise in noises))),
    )


def block_means(values: Float64Array) -> Float64Array:
    """(H, W) to the means of whole blocks; the picture itself where it is smaller than a block."""
    height, width = (max(side // BLOCK, 1) for side in values.shape)
    rows, columns = (min(side, BLOCK) for side in values.shape)
    kept = values[: height * rows, : width * columns].reshape(height, rows, width, columns)
    means: Float64Array = kept.mean(axis=(1, 3))
    return means


def _luminance(pixels: npt.NDArray[np.float32]) -> Float64Array:
    values: Float64Array = pixels.astype(np.float64) @ LUMINANCE
    return values
