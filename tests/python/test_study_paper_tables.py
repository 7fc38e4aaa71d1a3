# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's tables: from made-up results in closed form, and from the paper's own numbers."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from bvh_lab.study.correlation import correlate
from bvh_lab.study.cost_points import correlations_text, cost_points, cost_points_csv
from bvh_lab.study.paper_tables import (
    Build,
    Line,
    Measured,
    Table,
    Trace,
    devices_of,
    measured_by,
    paper_tables,
    table_text,
    tables_csv,
)
from bvh_lab.study.plan import Plan
from bvh_lab.study.precision import LAYOUTS
from bvh_lab.study.results import Machine, Measurement, Result, Row, Subject, Tree

PAPER = Path(__file__).resolve().parents[3] / "shared" / "paper"
needs_paper = pytest.mark.skipif(not PAPER.is_dir(), reason=f"{PAPER} is not there")


def row(
    builder: str,
    branching: int,
    reorder: str,
    cost: float,
    seconds: list[float],
    device: str = "cpu",
) -> Row:
    """A row whose million secondary rays took ``seconds`` in the first view, twice that in the
    second; shadow rays took half."""
    tree = Tree(1, 1, 1, 1, 1, 1, 1.0, 1, cost)
    made = Row(
        f"{builder}_{branching}_{reorder}",
        builder.upper(),
        *("bvh_lab", builder, branching, reorder, device),
        tree=tree,
        build_seconds=[0.001 * cost],
    )
    for view, slower in (("a", 1.0), ("b", 2.0)):
        for kind, share in (("primary", 1.0), ("secondary", 1.0), ("shadow", 0.5)):
            times = [slower * share * s for s in seconds]
            nothing = [0.0] * len(seconds)
            made.measurements.append(
                Measurement(
                    view,
                    kind,
                    1_000_000,
                    key_seconds=nothing,
                    sort_seconds=nothing,
                    traverse_seconds=times,
                )
            )
    return made


def result(name: str, rows: list[Row]) -> Result:
    subject = Subject(name, "", "mesh file", 0, 1, 3, 1, 0, ["a", "b"], "")
    machine = Machine("cpu", 2, 1.0, "Linux", "3", "1", "", "0", [], {}, "")
    return Result(Plan(), subject, machine, started="", rows=rows)


@pytest.fixture(scope="module")
def measured() -> Measured:
    """Two scenes. SAH is 2 and 4 times as fast as LBVH; sorting makes all 1.25 times as fast."""
    scenes = []
    for name, speedup in (("hall", 2.0), ("hair", 4.0)):
        rows = []
        for reorder, gain in (("off", 1.0), ("aila", 1.25), ("origin", 100.0)):
            for k in (2, 4):
                rows.append(row("sah", k, reorder, 50.0, [k / speedup / gain]))
                rows.append(row("lbvh", k, reorder, 100.0, [k * s / gain for s in (1.0, 0.9, 1.1)]))
        broken = row("ploc", 2, "off", 10.0, [1e-3])
        broken.error = "it broke"
        rival = row("embree", 0, "off", 1.0, [1e-3])
        rival.system = "embree"
        scenes.append(result(name, [*rows, broken, rival]))
    return measured_by(scenes)


def table(measured: Measured, number: int) -> Table:
    (found,) = (table for table in paper_tables(measured) if table.number == number)
    return found


def line(of: Table, branching: int, statistic: str, scene: str = "", layout: str = "full") -> Line:
    wanted = (branching, layout, statistic, scene)
    (found,) = (
        ln for ln in of.lines if (ln.branching, ln.layout, ln.statistic, ln.scene) == wanted
    )
    return found


def test_only_our_rows_that_work_count(measured: Measured) -> None:
    assert measured.builders == ["lbvh", "sah"] and measured.scenes == ["hall", "hair"]
    assert {t.kind for t in measured.traces if not t.reordered} == {
        "primary",
        "secondary",
        "shadow",
    }
    assert {t.kind for t in measured.traces if t.reordered} == {"secondary", "shadow"}
    assert max(t.mrays for t in measured.traces) == pytest.approx(4.0 * 1.25)  # none by origin


def test_compressed_nodes_are_a_width_of_their_own() -> None:
    rows = []
    for layout, slower in (("full", 1.0), ("cwbvh", 1.25)):
        for builder, cost in (("lbvh", 100.0), ("sah", 50.0)):
            for test in ("watertight", "woop_affine"):
                made = row(builder, 8, "off", cost * slower, [cost * slower / 100.0])
                made.layout, made.triangle_test = layout, test
                rows.append(made)
    rows += [row("lbvh", 2, "off", 200.0, [2.0])]
    measured = measured_by([result("hall", rows)])
    assert len(measured.traces) == (2 * 2 + 1) * 2 * 3  # by default tests alone; views, kinds
    one, five, compressed, six = (t for t in paper_tables(measured) if t.number in (1, 5, 6))
    assert (five.name, compressed.name) == ("5", "5c")
    assert "octal compressed BVHs" in compressed.caption
    speeds = [line(one, 8, "shadow rays", "", layout).cells["sah"].value for layout in LAYOUTS]
    assert speeds == pytest.approx([4.0, 3.2])
    assert line(five, 8, "BVH cost", "hall").cells["lbvh"].value == 100.0
    assert line(compressed, 8, "BVH cost", "hall", "cwbvh").cells["lbvh"].value == 125.0
    relative = line(six, 8, "BVH cost", "", "cwbvh").cells
    assert (relative["lbvh"].value, relative["sah"].value) == (1.0, 0.5)
    assert "hall   8c  BVH cost" in table_text(compressed, measured)
    assert "\n5c,hall,8,cwbvh,BVH cost,sah,62.5," in tables_csv([compressed])
    assert {point.cost for point in cost_points(measured) if point.branching == 8} == {1.0, 0.5}


def test_table_1_is_relative_to_the_binary_lbvh_as_the_rays_come(measured: Measured) -> None:
    relative = table(measured, 1)
    for kind in ("secondary", "shadow"):
        plain = line(relative, 2, f"{kind} rays").cells
        assert plain["lbvh"].value == pytest.approx(1.0)
        assert plain["sah"].value == pytest.approx((2.0 + 4.0) / 2)
        assert plain["sah"].spread_percent == pytest.approx(100 / 3)  # 2, 2, 4, 4
        sorted_rays = line(relative, 2, f"{kind} rays reordered").cells
        assert sorted_rays["lbvh"].value == pytest.approx(1.25)
        assert line(relative, 4, f"{kind} rays").cells["sah"].value == pytest.approx(1.5)
    assert not line(relative, 8, "shadow rays").cells


def test_table_2_holds_milliseconds_and_their_mean_ratio(measured: Measured) -> None:
    builds = table(measured, 2)
    assert line(builds, 2, "build, ms", "hair").cells["sah"].value == pytest.approx(50.0)
    mean = line(builds, 2, "mean, relative to LBVH").cells
    assert (mean["lbvh"].value, mean["sah"].value) == pytest.approx((1.0, 0.5))


def test_tables_3_and_4_hold_costs_and_mean_speeds(measured: Measured) -> None:
    for number, k in ((3, 2), (4, 4)):
        of = table(measured, number)
        cost = line(of, k, "BVH cost", "hall").cells["sah"]
        assert (cost.value, cost.relative) == (50.0, 0.5)
        lbvh = line(of, k, "secondary rays", "hall").cells["lbvh"]
        assert lbvh.value == pytest.approx((1 / k + 1 / (2 * k)) / 2)  # the mean over views
        assert lbvh.relative == 1.0
        assert lbvh.spread_percent == pytest.approx(50 * (1 / 0.95 - 1 / 1.05))
        sah = line(of, k, "shadow rays reordered", "hair").cells["sah"]
        assert sah.value == pytest.approx(2 * 4 * 1.25 * 0.75 / k)
        assert sah.relative == pytest.approx(5.0)
    assert [t.number for t in paper_tables(measured)] == [1, 2, 3, 4, 6]


def test_table_6_is_time_over_cost(measured: Measured) -> None:
    of = table(measured, 6)
    for k in (2, 4):
        assert line(of, k, "BVH cost").cells["sah"].value == pytest.approx(0.5)
        # Half the cost takes a half and a quarter of the time.
        value = line(of, k, "secondary rays").cells["sah"].value
        assert value == pytest.approx((1.0 + 0.5) / 2)
        value = line(of, k, "shadow rays reordered").cells["lbvh"].value
        assert value == pytest.approx(1 / 1.25)


def test_another_key_can_be_asked_for() -> None:
    rows = [row("lbvh", 2, reorder, 9.0, [1.0]) for reorder in ("off", "aila", "origin")]
    rows[2].measurements = row("lbvh", 2, "", 9.0, [0.5]).measurements
    of = table(measured_by([result("hall", rows)], reorder="origin"), 1)
    assert line(of, 2, "shadow rays reordered").cells["lbvh"].value == pytest.approx(2.0)


def test_each_device_has_tables_of_its_own() -> None:
    rows = [
        row(builder, 2, "off", cost, [slower * cost], device)
        for device, slower in (("opencl:a/x", 1.0), ("cpu", 4.0))
        for builder, cost in (("lbvh", 1.0), ("sah", 0.5))
    ]
    broken = row("lbvh", 2, "off", 9.0, [1.0], "opencl:a/gone")
    broken.error = "device lost"
    results = [result("hall", [*rows, broken]), result("hair", rows[:2])]
    assert devices_of(results) == ["opencl:a/x", "cpu", "opencl:a/gone"]
    assert measured_by(results).device == "opencl:a/x"
    speeds = {}
    for device in devices_of(results):
        measured = measured_by(results, device=device)
        tables = paper_tables(measured)
        assert bool(tables) == (device != "opencl:a/gone")
        for of in tables:
            assert of.device == device
            assert all(
                cell["device"] == device
                for cell in csv.DictReader([*tables_csv([of]).splitlines()])
            )
        if tables:
            (three,) = (of for of in tables if of.number == 3)
            speeds[device] = line(three, 2, "secondary rays", "hall").cells["sah"].value
            assert len(measured.scenes) == (2 if device == "opencl:a/x" else 1)
    assert speeds["opencl:a/x"] == pytest.approx(4.0 * speeds["cpu"])


def test_without_lbvh_relative_cells_are_empty() -> None:
    tables = paper_tables(measured_by([result("hall", [row("sah", 2, "off", 50.0, [1.0])])]))
    assert [t.number for t in tables] == [2, 3]
    assert line(tables[1], 2, "shadow rays", "hall").cells["sah"].relative is None
    assert paper_tables(measured_by([])) == []


def test_two_results_of_a_name_are_refused() -> None:
    with pytest.raises(ValueError, match="two results are of a scene of the same name: hall, hall"):
        measured_by([result("hall", []), result("hall", [])])


def test_text_and_csv_hold_every_cell(measured: Measured) -> None:
    tables = paper_tables(measured)
    text = table_text(table(measured, 4), measured).splitlines()
    assert text[0].startswith("Table 4. BVH cost and trace speed in MRays/s")
    assert text[1].startswith("Half the distance between quartiles: median over the cells ")
    assert text[2].split() == ["scene", "k", "statistic", "LBVH", "SAH"]
    assert text[4].split() == ["hall", "4", "BVH", "cost", "100", "(1.00)", "50.0", "(0.50)"]
    assert len(text) == 4 + 2 * 5
    lines = list(csv.DictReader(io.StringIO(tables_csv(tables))))
    assert len(lines) == sum(len(ln.cells) for of in tables for ln in of.lines)
    first = tables[0].lines[0]
    assert float(lines[0]["value"]) == first.cells["lbvh"].value
    assert (lines[0]["table"], lines[0]["relative_to_lbvh"]) == ("1", "")


# --- Figure 1 ------------------------------------------------------------------------------------


def test_points_are_relative_to_lbvh_in_the_same_order(measured: Measured) -> None:
    points = {
        (p.scene, p.builder, p.kind, p.reordered, p.branching): p for p in cost_points(measured)
    }
    assert len(points) == 2 * 2 * 2 * (3 + 2)  # scenes, builders, widths; primary rays unsorted
    assert points["hall", "sah", "primary", False, 2].time == pytest.approx(0.5)
    for reordered in (False, True):
        hall = points["hall", "sah", "secondary", reordered, 2]
        assert (hall.cost, hall.time, hall.label) == (0.5, pytest.approx(0.5), "SAH")
        assert points["hair", "sah", "shadow", reordered, 4].time == pytest.approx(0.25)
        assert points["hair", "lbvh", "shadow", reordered, 2].time == 1.0
    text = correlations_text(cost_points(measured))
    assert text.count("least squares") == 1 and "shadow rays, reordered" in text
    assert "primary rays " in text and "primary rays, reordered" not in text
    rows = list(csv.DictReader(io.StringIO(cost_points_csv(cost_points(measured)))))
    assert len(rows) == 40 and float(rows[0]["cost"]) == cost_points(measured)[0].cost


def test_correlation_of_a_line_and_of_its_square() -> None:
    x = [1.0, 2.0, 3.0, 4.0]
    line_of = correlate(x, [3.0 - 2.0 * value for value in x])
    assert (line_of.pearson, line_of.spearman) == pytest.approx((-1.0, -1.0))
    assert (line_of.slope, line_of.offset) == pytest.approx((-2.0, 3.0))
    square = correlate(x, [value * value for value in x])
    assert square.pearson == pytest.approx(25 / np.sqrt(5 * 129))  # sums of squared deviations
    assert square.spearman == pytest.approx(1.0) and square.count == 4


def test_equal_values_share_their_rank() -> None:
    # Ranks 1, 2.5, 2.5, 4 and 1, 3, 2, 4.
    found = correlate([0.0, 1.0, 1.0, 2.0], [1.0, 7.0, 5.0, 9.0])
    assert found.spearman == pytest.approx(4.5 / np.sqrt(4.5 * 5.0))


def test_what_points_do_not_define_is_none() -> None:
    flat = correlate([1.0, 2.0], [5.0, 5.0])
    assert (flat.pearson, flat.spearman, flat.slope, flat.offset) == (None, None, 0.0, 5.0)
    alone = correlate([1.0], [1.0])
    assert (alone.pearson, alone.slope, alone.offset, alone.count) == (None, None, None, 1)
    with pytest.raises(ValueError, match="2 values cannot be correlated with 1"):
        correlate([1.0, 2.0], [1.0])


# --- from the paper's own tables -----------------------------------------------------------------


def read(name: str) -> Iterator[dict[str, str]]:
    with (PAPER / name).open(newline="") as file:
        yield from csv.DictReader(file)


@pytest.fixture(scope="module")
def paper() -> Measured:
    """Tables 2 to 5 as if we had measured them; cells that could not be read are missing."""
    costs = {
        (c["scene"], c["branching"], c["builder"]): float(c["bvh_cost"])
        for c in read("bvh_cost.csv")
    }
    found = Measured([], [], {})
    for cell in read("trace_speed.csv"):
        place = (cell["scene"], cell["branching"], cell["builder"])
        if place in costs:
            found.traces.append(
                Trace(
                    cell["scene"],
                    "mean",
                    cell["builder"].lower(),
                    int(cell["branching"]),
                    cell["ray_kind"].endswith("_reordered"),
                    cell["ray_kind"].removesuffix("_reordered"),
                    costs[place],
                    float(cell["mrays_per_s"]),
                )
            )
    for cell in read("build_time.csv"):
        seconds = 1e-3 * float(cell["build_ms"])
        found.builds.append(Build(cell["scene"], cell["builder"].lower(), seconds))
    return found


@needs_paper
def test_the_papers_mean_build_times_come_out(paper: Measured) -> None:
    mean = line(table(paper, 2), 2, "mean, relative to LBVH").cells
    last_line = (1.0, 2.3, 5.6, 6.6, 76.1, 13720.0, 5237.0, 22134.0, 1444.0, 5196.0)  # of Table 2
    assert [cell.value for cell in mean.values()] == pytest.approx(last_line, rel=0.02)


@needs_paper
def test_the_papers_relative_speeds_come_out(paper: Measured) -> None:
    """A quarter of the scenes have cells that could not be read, so means are a little off."""
    speeds = table(paper, 1)
    for cell in read("relative_speed.csv"):
        if cell["branching"] != "2":
            continue
        kind, _, reordered = cell["ray_kind"].partition("_")
        statistic = f"{kind} rays{' reordered' if reordered else ''}"
        ours = line(speeds, 2, statistic).cells[cell["builder"].lower()]
        assert ours.value == pytest.approx(float(cell["speed_relative_to_binary_lbvh"]), rel=0.08)


@needs_paper
def test_the_papers_time_per_cost_comes_out(paper: Measured) -> None:
    of = table(paper, 6)
    for statistic, there in {
        "BVH cost": (1.0, 0.83, 0.70, 0.65, 0.61, 0.60, 0.55, 0.55, 0.68, 0.59),
        "secondary rays": (1.0, 1.11, 1.21, 1.18, 1.21, 1.21, 1.11, 1.12, 1.07, 1.02),
        "shadow rays reordered": (0.84, 0.95, 0.98, 1.03, 1.03, 1.07, 1.10, 1.11, 0.95, 1.01),
    }.items():
        ours = [cell.value for cell in line(of, 2, statistic).cells.values()]
        assert ours == pytest.approx(there, rel=0.08)


@needs_paper
def test_the_paper_finds_cost_and_time_correlated(paper: Measured) -> None:
    points = [p for p in cost_points(paper) if p.branching == 2 and not p.reordered]
    for kind in ("secondary", "shadow"):
        of = [p for p in points if p.kind == kind]
        found = correlate([p.cost for p in of], [p.time for p in of])
        assert found.count > 80 and found.pearson is not None and found.pearson > 0.5
