# SPDX-License-Identifier: GPL-3.0-or-later
"""The results as CSV: units in the column names, full precision, empty where there is no value."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from .results import COUNTERS, KINDS, Measurement, Result, Row, mrays_per_second, spread

PRECISION = ("layout", "triangle_test", "box_test")
ACCURACY = {  # column: field of `Accuracy`
    "t_error_ulps_median": "t_ulps_median",
    "t_error_ulps_99.9_percent": "t_ulps_high",
    "t_error_ulps_largest": "t_ulps_largest",
    "uv_error_median": "uv_median",
    "uv_error_largest": "uv_largest",
}


def rows_csv(result: Result) -> str:
    """One line per row."""
    return _csv(csv_record(_nothing()), [csv_record(row) for row in result.rows])


def rays_csv(result: Result) -> str:
    """One line per row, view, kind of ray and bounce."""
    heading = measurement_record(_nothing(), Measurement("", "", 0))
    return _csv(heading, [measurement_record(r, m) for r in result.rows for m in r.measurements])


def _nothing() -> Row:
    return Row("", "", "", "", 0, "off", "")


def _csv(heading: dict[str, Any], records: Sequence[dict[str, Any]]) -> str:
    out = io.StringIO()
    writer = csv.DictWriter(out, heading.keys(), lineterminator="\n")
    writer.writeheader()
    writer.writerows(records)
    return out.getvalue()


def csv_record(row: Row) -> dict[str, Any]:
    """The row's line of the CSV file: column name to value, None where there is none."""
    tree = asdict(row.tree) if row.tree else {}
    errors = row.errors()
    names = ("name", "label", "system", "builder", "branching", *PRECISION, "reorder", "device")
    record: dict[str, Any] = {name: getattr(row, name) for name in (*names, "threads")}
    for name in (
        "nodes",
        "leaves",
        "references",
        "max_depth",
        "average_leaf_size",
        "bytes",
        "cost",
    ):
        record[name] = tree.get(name)
    record["bytes_per_triangle"] = row.bytes_per_triangle
    record["prepare_seconds"] = row.prepare_seconds
    for name in ("tree_device", "shape", "transfer_seconds", "program_seconds"):
        record[name] = getattr(row, name)
    for name in ("build_seconds", "tree_seconds", "collapse_seconds"):
        seconds = getattr(row, name)
        record[name] = spread(seconds).median if seconds else None
    for kind in KINDS:
        speed = row.speed(kind)
        for i, part in enumerate(("_low", "", "_high")):
            record[f"{kind}_mrays_per_second{part}"] = speed[i] if speed else None
        record[f"{kind}_sorting_share"] = row.sorting_share(kind)
    for counter in COUNTERS:
        for kind in KINDS:
            record[f"{kind}_{counter}_per_ray"] = row.per_ray(counter, kind)
    for name in ("judged", "wrong", "false_misses", "false_hits", "wrong_triangles"):
        record[f"{name}_rays"] = getattr(errors, name)
    for column, name in ACCURACY.items():
        record[column] = getattr(row.accuracy, name) if row.accuracy else None
    record["differing_rays"] = row.differing_rays()
    record["largest_picture_difference"] = row.picture_difference()
    time = row.time_to_error
    record["target_relMSE"] = time.target if time else None
    record["seconds_to_target_relMSE"] = time.seconds if time else None
    judged = next((p.errors for p in row.pictures if p.errors), {})
    for name in ("relMSE", "PSNR"):
        record[f"picture_{name}"] = judged.get(name)
    record["error"] = row.error
    return record


def measurement_record(row: Row, measurement: Measurement) -> dict[str, Any]:
    """One measurement's line of the CSV file of rays."""
    record: dict[str, Any] = {name: getattr(row, name) for name in ("name", "builder", "branching")}
    for name in (*PRECISION, "reorder", "device"):
        record[name] = getattr(row, name)
    for name in ("view", "kind", "bounce", "rays", "hits", *COUNTERS, "differing_rays"):
        record[name] = getattr(measurement, name)
    speed = mrays_per_second([measurement]) if measurement.seconds else None
    for i, part in enumerate(("_low", "", "_high")):
        record[f"mrays_per_second{part}"] = speed[i] if speed else None
    for name in ("key_seconds", "sort_seconds", "traverse_seconds", "transfer_seconds"):
        seconds = getattr(measurement, name)
        record[name] = spread(seconds).median if seconds else None
    for name in ("judged", "wrong", "false_misses", "false_hits", "wrong_triangles"):
        record[f"{name}_rays"] = getattr(measurement.errors, name)
    record["hits_sha256"] = measurement.hits_sha256
    return record
