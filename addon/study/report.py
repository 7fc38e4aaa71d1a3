# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder of files that a user keeps of a study."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..native import load
from .figures import FigureError, error_against_time
from .html import html_page
from .image_error import curves_csv
from .judge import picture_difference
from .output import file_stems, publish_folder, staged_folder
from .precision_figure import speed_against_error
from .precision_points import precision_csv, precision_points
from .results import Result
from .scene import Float32Array
from .spreadsheet import rays_csv, rows_csv
from .table import text_report, title
from .target_error import error_curves

PICTURES = "pictures"
PRECISION = "speed_against_error"
CURVES = "error_against_time"
Pictures = Mapping[tuple[str, str], Float32Array]  # (variant name, view name) -> (H, W, 3)


def write_report(result: Result, pictures: Pictures, out: Path) -> None:
    """Write tables (txt, csv), results.json, index.html and pictures/ into the folder ``out``.

    With a target error there are error_against_time.csv, .svg and .png, too, and with several
    triangle or box tests speed_against_error; the figures only where matplotlib is.

    Everything is written into a new folder beside it and renamed at the end. Raises OSError.
    """
    with staged_folder(out) as staging:
        fill_report(result, pictures, staging)
        publish_folder(staging, out)


def fill_report(result: Result, pictures: Pictures, folder: Path) -> None:
    """Write the report's files into a folder that exists."""
    files = write_pictures(result, pictures, folder) if pictures else {}
    curves, precision = write_curves(result, folder), write_precision(result, folder)
    texts = {
        "table.txt": text_report(result),
        "results.csv": rows_csv(result),
        "rays.csv": rays_csv(result),
        "results.json": result.to_json(),
        "index.html": html_page(result, files, folder, curves, precision),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")


def write_pictures(result: Result, pictures: Pictures, folder: Path) -> dict[tuple[str, str], str]:
    """Write PNG and EXR of every picture and, per view, of the largest difference.

    Returns the PNG's name, relative to ``folder``, by variant and view; the difference stands under
    the variant "". A difference PNG is scaled so that its largest value is white.
    """
    core = load()
    if not core.features()["image"]:
        result.notes.append("This build has no OpenImageIO: picture files are left out.")
        return {}
    (folder / PICTURES).mkdir(exist_ok=True)
    stems = file_stems(view for _, view in pictures)
    files: dict[tuple[str, str], str] = {}
    for view, stem in stems.items():
        first: tuple[Float32Array, str] | None = None
        difference: Float32Array | None = None
        for (variant, of_view), pixels in pictures.items():
            if of_view != view:
                continue
            name = f"{PICTURES}/{stem}_{variant}"
            files[variant, view] = f"{name}.png"
            if first is not None and pixels is first[0]:  # equal, and already encoded
                for suffix in (".png", ".exr"):
                    shutil.copyfile(folder / f"{first[1]}{suffix}", folder / f"{name}{suffix}")
                continue
            for suffix in (".png", ".exr"):
                core.write_image(str(folder / f"{name}{suffix}"), pixels)
            if first is None:
                first, difference = (pixels, name), np.zeros_like(pixels)
            assert difference is not None
            difference = np.maximum(difference, picture_difference(pixels, first[0]))
        assert difference is not None
        name = f"{PICTURES}/{stem}_difference"
        files["", view] = f"{name}.png"
        core.write_image(str(folder / f"{name}.exr"), difference)
        core.write_image(str(folder / f"{name}.png"), difference / (difference.max() or 1.0))
    return files


def write_curves(result: Result, folder: Path) -> Path | str:
    """Write error against time as CSV and, with matplotlib, as SVG and PNG.

    Returns the PNG's path, a sentence that says why there is none, or "" without a target error.
    """
    found, curves = result.convergence, error_curves(result)
    if found is None or not curves:
        return ""
    (folder / f"{CURVES}.csv").write_text(curves_csv(curves), encoding="utf-8")
    if not any(curve.points for curve in curves):
        return "There is no finite error to draw."
    heading = f"{result.subject.name}, view {found.view}"
    try:
        error_against_time(curves, folder / CURVES, heading, found.reference_error, found.target)
    except FigureError as error:
        return f"The figure is left out, its numbers are in {CURVES}.csv: {error}."
    return folder / f"{CURVES}.png"


def write_precision(result: Result, folder: Path) -> Path | str:
    """Write speed against error of the precision choices as CSV and, with matplotlib, as figure.

    Returns the PNG's path, a sentence that says why there is none, or "" for less than two choices.
    """
    if not (points := precision_points(result)):
        return ""
    (folder / f"{PRECISION}.csv").write_text(precision_csv(points), encoding="utf-8")
    trees = points[0].trees
    tree = title(result.row(result.reference)) if trees == 1 else f"mean over {trees} trees"
    heading = f"{result.subject.name}, {result.subject.triangles:,d} triangles, {tree}"
    try:
        speed_against_error(points, folder / PRECISION, heading)
    except FigureError as error:
        return f"The figure is left out, its numbers are in {PRECISION}.csv: {error}."
    return folder / f"{PRECISION}.png"
