# SPDX-License-Identifier: GPL-3.0-or-later
"""What the study's figures have in common: size, colours, legend, and how they are written.

matplotlib is imported where a figure is drawn, so that the add-on works without it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .plan import BRANCHINGS, BUILDERS

DOTS_PER_INCH = 200
COLUMN = 7.0  # inches, the width of a page's text

# Paul Tol's muted scheme with orange, black and grey: told apart by colour-blind eyes, too.
COLORS = (
    "#88CCEE",
    "#332288",
    "#117733",
    "#999933",
    "#EE7733",
    "#CC6677",
    "#AA4499",
    "#882255",
    "#777777",
    "#000000",
    "#DDCC77",
    "#44AA99",
)
BUILDER_COLORS = dict(zip(BUILDERS, COLORS, strict=True))
RIVAL_COLOR = "#BB0000"
MARKERS = dict(zip(BRANCHINGS, ("o", "s", "^"), strict=True))
DASHES = dict(zip(BRANCHINGS, (":", "--", "-"), strict=True))

STYLE = {
    "font.family": "sans-serif",
    "font.size": 8.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 8.5,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
    "svg.hashsalt": "bvh_lab",  # the same figure is the same file
}


class FigureError(RuntimeError):
    """Figures cannot be drawn here; the message says what to do."""


@contextmanager
def drawn(stem: Path, size: tuple[float, float]) -> Iterator[Any]:
    """A matplotlib figure in our style, written to ``stem`` + .svg and .png at the end."""
    try:
        import matplotlib
        from matplotlib.figure import Figure
    except ImportError as error:
        raise FigureError(
            f"figures need the Python package matplotlib ({error}): pip install matplotlib"
        ) from error
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=size, layout="constrained")  # no pyplot: no window, Agg
        yield figure
        for suffix, metadata in ((".svg", {"Date": None}), (".png", {"Software": None})):
            aside = stem.with_name(f".{stem.name}.partial{suffix}")
            try:
                figure.savefig(aside, dpi=DOTS_PER_INCH, metadata=metadata)
                aside.replace(stem.with_name(stem.name + suffix))
            finally:
                aside.unlink(missing_ok=True)


def draw_dot(panel: Any, builder: str, branching: int, x: float, y: float) -> None:
    panel.plot(
        x,
        y,
        MARKERS[branching],
        color=BUILDER_COLORS.get(builder, RIVAL_COLOR),
        markersize=4.5,
        markeredgecolor="white",
        markeredgewidth=0.4,
    )


def builder_legend(
    labels: Mapping[str, str], branchings: Sequence[int]
) -> tuple[list[Any], list[str]]:
    """Builders (id to name) by colour in the paper's order, then widths by marker."""
    from matplotlib.lines import Line2D

    order = [*(b for b in BUILDERS if b in labels), *sorted(set(labels) - set(BUILDERS))]
    widths = sorted(set(branchings))

    def dot(marker: str, color: str) -> Any:
        return Line2D([], [], ls="none", marker=marker, color=color, markersize=4.5)

    handles = [dot("o", BUILDER_COLORS.get(b, RIVAL_COLOR)) for b in order]
    handles += [dot(MARKERS[width], "#444444") for width in widths]
    return handles, [*(labels[b] for b in order), *(f"{width}-wide" for width in widths)]


def legend_columns(count: int) -> int:
    """Columns of a legend of so many entries: two or three even lines."""
    return math.ceil(count / math.ceil(count / 8))


def draw_note(
    panel: Any, x: float, y: float, offset: tuple[int, int], text: str, side: str
) -> None:
    """Small text at a share ``x`` of the panel's width and at value ``y``; ``offset`` in points."""
    panel.annotate(
        text,
        (x, y),
        xycoords=("axes fraction", "data"),
        xytext=offset,
        textcoords="offset points",
        ha=side,
        color="#444444",
        size=7.5,
    )


def label_decades(axis: Any) -> None:
    """Label a log axis with plain decimal numbers at the powers of ten and at 2 and 5 between."""
    from matplotlib.ticker import FuncFormatter, LogLocator

    axis.set_major_locator(LogLocator(10.0, (1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, position: f"{value:g}"))
    axis.set_minor_formatter(FuncFormatter(lambda value, position: ""))


def display(pixels: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    """Linear values as 8-bit sRGB, clipped to [0, 1]; what is not finite is magenta."""
    broken = ~np.isfinite(pixels).all(axis=-1)
    value = np.clip(np.nan_to_num(pixels, nan=0.0), 0.0, 1.0)
    curve = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1.0 / 2.4) - 0.055)
    result: npt.NDArray[np.uint8] = np.rint(255.0 * curve).astype(np.uint8)
    result[broken] = (255, 0, 255)
    return result
