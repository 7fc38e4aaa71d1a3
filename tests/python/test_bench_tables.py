# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of `make bench DEVICE=opencl`, from made-up times in closed form."""

from __future__ import annotations

import csv
import io
import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
import bench_device_builds as builds
import bench_device_rays as tracing
import bench_device_text as text
import bench_paper

needs_shared = pytest.mark.skipif(
    not bench_paper.PAPER.is_dir(), reason=f"{bench_paper.PAPER} is not there"
)


def cell(seconds: float, slower: float = 2.0, differing: int = 0) -> tracing.Cell:
    """A million rays in view a, half a million in b, which take ``slower`` as long; three rounds,
    of which the last takes twice as long."""
    rounds = [seconds, seconds, 2.0 * seconds]
    return tracing.Cell(
        {"a": 1_000_000, "b": 500_000},
        {"a": rounds, "b": [slower * s for s in rounds]},
        differing,
    )


def traced(builder: str, branching: int, seconds: float, **changes: Any) -> tracing.Traced:
    """A tree that takes ``seconds`` on the device, half of that on the CPU core, 0.5 as LBVH."""
    columns = tracing.COLUMNS
    fields: dict[str, Any] = {
        "device": {column: cell(seconds) for column in columns},
        "cpu": {column: cell(seconds / 2.0) for column in columns},
        "base": {column: cell(0.5) for column in columns if not column[1]},
        "kernel": "single",
    }
    return tracing.Traced(builder, builder.upper(), branching, "full", **{**fields, **changes})


def built(builder: str, seconds: list[float], **changes: Any) -> builds.Build:
    """A build whose tree takes the CPU core half as long."""
    kernels = [
        [
            builds.Kernel("tree", "sort", "count", 8, 0.3 * s),
            builds.Kernel("tree", "sort", "tiny", 1, 1e-4 * s),
            builds.Kernel("tree", "boxes", "unite", 1, 0.6 * s),
        ]
        for s in seconds
    ]
    ones = [0.001 for _ in seconds]
    fields: dict[str, Any] = {
        "made_by": "opencl:x/y",
        "device": builds.Times(seconds, ones, ones, 0.0, kernels),
        "cpu": builds.Times([s / 2.0 for s in seconds], ones, ones),
        "tree_bytes": 1000,
        "differing_bytes": 0,
    }
    return builds.Build(builder, builder.upper(), **{**fields, **changes})


def cells_of(lines: list[str], name: str) -> dict[str, str]:
    """The first line of a Markdown table that begins with ``name``, by its heading."""
    grid = [[part.strip() for part in line.split("|")[1:-1]] for line in lines if "|" in line]
    (found,) = (line for line in grid if line[0] == name)
    return dict(zip(grid[0], found, strict=True))


def test_speeds_are_means_over_views_and_medians_of_rounds() -> None:
    speed = cell(0.5).speed()
    assert speed is not None
    assert speed.median == pytest.approx((1.0 / 0.5 + 0.5 / 1.0) / 2)
    assert speed.low == pytest.approx(0.75 * speed.median)  # between the rounds 1 and 0.5 as fast
    ratio = cell(0.5, slower=2.0).over(cell(0.5, slower=4.0))
    assert ratio is not None and ratio.median == pytest.approx((1.0 + 2.0) / 2)
    first_view = cell(1.0)
    del first_view.seconds["b"]
    ratio = cell(0.5, slower=3.0).over(first_view)
    assert ratio is not None and ratio == pytest.approx((2.0, 2.0, 2.0))
    assert tracing.Cell().speed() is None and cell(1.0).over(tracing.Cell()) is None


def test_slow_builds_are_timed_less_often() -> None:
    assert [builds.repeats_after(s, 5) for s in (0.01, 3.0, 60.0)] == [5, 3, 0]
    assert built("lbvh", [0.1, 0.2, 0.3]).seconds() == pytest.approx(0.2 + 0.1 + 2 * 0.001)


def test_a_kernel_counts_with_its_median() -> None:
    kernels = built("lbvh", [0.01, 0.03, 0.02]).device.median_kernels()
    assert [(k.name, k.seconds) for k in kernels] == [
        ("count", pytest.approx(0.006)),
        ("tiny", pytest.approx(2e-6)),
        ("unite", pytest.approx(0.012)),
    ]


def test_numbers_keep_their_digits() -> None:
    values = (0.01234, 1.0, 12.34, 123.4, 12345.6, None)
    assert [text.number(v) for v in values] == ["0.0123", "1.00", "12.3", "123", "12346", "-"]


@needs_shared
def test_the_papers_figures_are_found() -> None:
    assert bench_paper.build_ms("crown", "lbvh") == 15.5
    assert bench_paper.build_ratio("sibenik", "ploc") == pytest.approx(17.2 / 2.0)
    assert bench_paper.mrays("sibenik", 2, "secondary", False, "lbvh") == 261
    assert bench_paper.speed_ratio("sibenik", 2, "secondary", False, "ploc") == 302 / 261
    assert bench_paper.speed_ratio("bathroom", 2, "secondary", False, "ploc") == 1.25  # Table 1
    assert bench_paper.mrays("bathroom", 2, "secondary", False, "lbvh") is None
    assert bench_paper.build_ms("bathroom", "lbvh") is None
    assert bench_paper.build_ratio("bathroom", "ploc") == pytest.approx(5.6, rel=0.02)  # Table 2
    assert bench_paper.build_ratio("bathroom", "trbvh") is None


@needs_shared
def test_tables_hold_times_ratios_and_errors() -> None:
    result = text.SceneResult("sibenik", 76112, ["a", "b"])
    result.builds = [built("lbvh", [0.01, 0.01]), built("ploc", [0.043])]
    result.traced = [traced("lbvh", 2, 0.5), traced("ploc", 2, 0.25)]
    of_builds = text.build_lines(result)
    lbvh, ploc = cells_of(of_builds, "LBVH"), cells_of(of_builds, "PLOC")
    assert (lbvh["tree, ms"], lbvh["its kernels"], lbvh["CPU core, ms"]) == (
        "10.0 ±0%",
        "9.00",
        "5.00 ±0%",
    )
    assert (lbvh["CPU core / device"], lbvh["paper, ms"], lbvh["paper / device"]) == (
        "0.500 ±0%",
        "2",
        "0.20",
    )
    assert (ploc["tree, ms"], ploc["/ LBVH"], ploc["paper's / LBVH"]) == (
        "43.0 once",
        "4.30",
        "8.60",
    )
    assert ploc["bytes differing"] == "0 of 1,000"
    kernels = "\n".join(text.kernel_lines(result.builds))
    assert "count 3.00 (8), 1 more 0.00100 |" in kernels and "67% | unite 6.00 (1) " in kernels
    lines = text.trace_tables(result)
    tables = "\n".join(lines).split("\n\n")
    speeds, over_cpu, over_lbvh, paper = (
        cells_of(part.splitlines(), "PLOC 2") for part in tables if part.startswith("|")
    )
    assert speeds["secondary"].startswith("2.50 ±") and speeds["kernel"] == "single"
    assert over_cpu["shadow sorted"] == "0.500 ±0%"
    assert (over_lbvh["primary"], over_lbvh["secondary"]) == ("2.00", "2.00 (1.16)")
    assert (paper["primary"], paper["secondary"]) == ("-", "302 (0.0083)")
    assert all(
        part["rays differing"] == "0 of 15,000,000" for part in (speeds, over_cpu, over_lbvh, paper)
    )
    summary = cells_of(text.summary_lines([result]), "2")
    assert (summary["trees"], summary["primary"]) == ("2", "0.50 (0.50)")


def test_failures_and_differences_are_said_loudly() -> None:
    result = text.SceneResult("hall", 12, ["a"], left_out=["PRBVH: would take about 900 s"])
    result.builds = [built("lbvh", [0.01], differing_bytes=7), built("ploc", [], error="lost\nlog")]
    wrong = {column: cell(0.5, differing=2) for column in tracing.COLUMNS}
    result.traced = [
        traced("lbvh", 2, 0.5, device=wrong),
        traced("lbvh", 8, 0.5, error="no memory"),
    ]
    said = "\n".join(text.scene_lines(result, "ours"))
    for line in (
        "- LEFT OUT: PRBVH: would take about 900 s",
        "- FAILED: hall: building PLOC failed: lost",
        "- FAILED: hall: LBVH's tree is not the CPU core's in 7 bytes",
        "- FAILED: hall: tracing LBVH 8 failed: no memory",
        "- FAILED: hall: 10 rays of LBVH 2 differ from the CPU core's",
    ):
        assert line in said.splitlines()
    assert "7 of 1,000" in said and "10 of 15,000,000" in said


def test_csv_holds_every_number() -> None:
    result = text.SceneResult("hall", 12, ["a"])
    result.builds = [built("lbvh", [0.01, 0.02])]
    result.traced = [traced("lbvh", 2, 0.5), traced("lbvh", 4, 0.25, cpu={})]
    times, kernels, rays = (
        list(csv.DictReader(io.StringIO(table([result]))))
        for table in (text.builds_csv, text.kernels_csv, text.traces_csv)
    )
    assert [(t["device"], float(t["tree_seconds"])) for t in times] == [
        ("device", 0.01),
        ("device", 0.02),
        ("cpu", 0.005),
        ("cpu", 0.01),
    ]
    assert [k["kernel"] for k in kernels] == ["count", "tiny", "unite"]
    assert len(rays) == 2 * len(tracing.COLUMNS)
    binary, wide = rays[0], rays[-1]
    assert float(binary["over_cpu"]) == 0.5 and float(binary["mrays_per_s"]) == 1.25
    assert (wide["over_cpu"], float(wide["over_binary_lbvh"])) == ("", 2.0)
    assert {line["differing_rays"] for line in rays} == {"0"}
