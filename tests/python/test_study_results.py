# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows: what they compute, and JSON and CSV of them."""

from __future__ import annotations

import csv
import io
import json

import pytest
from bvh_lab.study.plan import Plan
from bvh_lab.study.results import (
    FORMAT,
    Accuracy,
    Errors,
    Machine,
    Measurement,
    Picture,
    Result,
    Row,
    Subject,
    Tree,
    ratio,
    spread,
)
from bvh_lab.study.spreadsheet import csv_record, rays_csv, rows_csv
from hypothesis import given, settings
from hypothesis import strategies as st


def timed(
    view: str, rays: int, seconds: list[float], kind: str = "primary", **more: int
) -> Measurement:
    """Rays whose repeats took ``seconds``, all of it traversal."""
    zeros = [0.0] * len(seconds)
    times = {"key_seconds": zeros, "sort_seconds": zeros, "traverse_seconds": seconds}
    return Measurement(view, kind, rays, **more, **times)


def row_of(*measurements: Measurement, name: str = "sah_2") -> Row:
    return Row(name, "SAH", "bvh_lab", "sah", 2, "off", "cpu", measurements=[*measurements])


def test_spread_is_median_and_quartiles() -> None:
    assert spread([5.0, 1.0, 3.0, 2.0, 4.0]) == (2.0, 3.0, 4.0)
    assert spread([3.0]) == (3.0, 3.0, 3.0)
    assert spread([5.0, 1.0, 3.0, 2.0, 4.0]).half_percent == pytest.approx(100.0 / 3.0)


def test_speed_is_the_mean_of_the_views_speeds() -> None:
    row = row_of(
        timed("a", 1_000_000, [0.1, 0.3, 0.2]),  # quartiles 0.15, 0.2, 0.25
        timed("b", 3_000_000, [0.6, 0.6, 0.6]),
    )
    speed = row.speed("primary")
    assert speed is not None
    assert speed.median == pytest.approx((5.0 + 5.0) / 2.0)
    assert speed.low == pytest.approx((4.0 + 5.0) / 2.0)
    assert speed.high == pytest.approx((1.0 / 0.15 + 5.0) / 2.0)
    assert row.speed("shadow") is None


def test_speed_of_a_view_is_all_its_rays_over_their_seconds() -> None:
    bounces = [
        timed("a", 1_000_000, [0.1, 0.2, 0.3], kind="secondary", bounce=1),
        timed("a", 200_000, [0.3, 0.1, 0.1], kind="secondary", bounce=2),
    ]  # together 0.4, 0.3, 0.4 s
    speeds = row_of(*bounces, timed("b", 9, [1.0], kind="secondary")).view_speeds("secondary")
    assert speeds["a"].median == pytest.approx(1.2 / 0.4)
    assert speeds["a"].high == pytest.approx(1.2 / 0.35)
    assert list(speeds) == ["a", "b"]


def test_a_view_is_left_out_until_all_its_bounces_are_timed() -> None:
    row = row_of(
        timed("a", 10, [0.1], kind="shadow"),
        timed("a", 10, [], kind="shadow", bounce=1),
        timed("b", 1_000_000, [0.5, 0.9], kind="shadow"),
        timed("b", 1_000_000, [0.5], kind="shadow", bounce=1),  # stopped before its second repeat
    )
    assert {view: s.median for view, s in row.view_speeds("shadow").items()} == {"b": 2.0}


def test_sorting_share_is_that_of_the_medians() -> None:
    parts = {"key_seconds": [1.0] * 3, "sort_seconds": [2.0] * 3}
    measured = Measurement("a", "shadow", 10, **parts, traverse_seconds=[5.0, 4.0, 9.0])
    assert row_of(measured).sorting_share("shadow") == pytest.approx(3.0 / 8.0)
    assert row_of(measured).sorting_share("primary") is None


def test_seconds_hold_keys_sort_and_traversal() -> None:
    parts = {"key_seconds": [1.0], "sort_seconds": [2.0], "traverse_seconds": [4.0]}
    assert Measurement("a", "primary", 10, **parts).seconds == [7.0]


def test_counters_are_per_ray_over_all_views() -> None:
    row = row_of(
        Measurement("a", "primary", 10, node_visits=100, triangle_tests=30),
        Measurement("b", "primary", 30, node_visits=20, triangle_tests=10),
    )
    assert row.per_ray("node_visits", "primary") == 3.0
    assert row.per_ray("triangle_tests", "primary") == 1.0
    assert row.per_ray("node_visits", "secondary") is None
    assert row_of(Measurement("a", "primary", 10)).per_ray("node_visits", "primary") is None


def test_errors_add_up() -> None:
    row = row_of(
        Measurement("a", "primary", 9, errors=Errors(4, 1, 0, 1)),
        Measurement("a", "shadow", 9, errors=Errors(5, 0, 2, 0)),
    )
    assert row.errors() == Errors(9, 1, 2, 1)
    assert row.errors().wrong == 4


def test_ratio_to_a_baseline() -> None:
    fast = row_of(timed("a", 1000, [1.0] * 3))
    slow = row_of(timed("a", 1000, [4.0] * 3))
    assert ratio(fast, slow, "primary") == pytest.approx(4.0)
    assert ratio(fast, slow, "shadow") is None


def test_only_our_own_rows_can_disagree() -> None:
    row = row_of(timed("a", 10, [1.0] * 3, differing_rays=1))
    assert row.disagrees()
    row.system = "embree"
    assert not row.disagrees()


@pytest.mark.parametrize(
    ("field", "choice"), [("triangle_test", "woop_affine"), ("box_test", "plain")]
)
def test_only_the_default_tests_can_disagree(field: str, choice: str) -> None:
    row = row_of(timed("a", 10, [1.0] * 3, differing_rays=1))
    row.layout = "cwbvh"  # promises the same hits
    assert row.exact and row.disagrees()
    setattr(row, field, choice)
    assert not row.exact and not row.disagrees() and row.differing_rays() == 1


def test_a_picture_difference_is_a_disagreement() -> None:
    row = row_of()
    row.pictures = [Picture("a", 2, 2, 1, {"primary": 4}, 0.1, 0.1, "", 0.5, differing_pixels=1)]
    assert row.disagrees()


finite = st.floats(allow_nan=False, allow_infinity=False)
counts = st.integers(0, 2**63)
seconds = st.lists(finite)
rows = st.builds(
    Row,
    name=st.text(),
    error=st.text(),
    layout=st.sampled_from(["full", "cwbvh", ""]),
    triangle_test=st.text(),
    bytes_per_triangle=st.none() | finite,
    accuracy=st.none() | st.builds(Accuracy, counts, *[finite] * 5),
    tree=st.none() | st.builds(Tree, nodes=counts, average_leaf_size=finite, cost=finite),
    build_seconds=seconds,
    measurements=st.lists(
        st.builds(
            Measurement,
            rays=counts,
            node_visits=st.none() | counts,
            triangle_tests=st.none() | counts,
            errors=st.builds(Errors, judged=counts, false_misses=counts),
            traverse_seconds=seconds,
        ),
        max_size=3,
    ),
    pictures=st.lists(
        st.builds(Picture, largest_difference=finite, seconds=finite, trace_seconds=finite),
        max_size=3,
    ),
)
machines = st.builds(
    Machine,
    devices=st.lists(st.dictionaries(st.text(), st.text() | st.booleans()), max_size=2),
    features=st.dictionaries(st.text(), st.booleans()),
    memory_gib=finite,
)


@settings(max_examples=40, deadline=None)
@given(
    st.builds(
        Result,
        plan=st.just(Plan(params={"sbvh": {"alpha": 1e-5}}, views=["Nave"])),
        subject=st.builds(Subject),
        machine=machines,
        seconds=finite,
        rows=st.lists(rows, max_size=3),
        notes=st.lists(st.text()),
        format=st.just(FORMAT),
    )
)
def test_json_gives_the_same_rows(result: Result) -> None:
    assert Result.from_json(result.to_json()) == result


def empty_result() -> Result:
    subject = Subject("s", "", "mesh file", 0, 1, 3, 1, 0, ["a"], "")
    machine = Machine("cpu", 2, 1.0, "Linux", "3", "1", "", "0", [], {}, "")
    return Result(Plan(), subject, machine, started="2026-01-01T00:00:00+00:00")


def test_results_of_another_format_are_refused() -> None:
    text = empty_result().to_json().replace(f'"format": {FORMAT}', '"format": 99')
    with pytest.raises(ValueError, match=f"results of format 99; this reads {FORMAT}"):
        Result.from_json(text)


def test_a_row_with_a_bad_field_is_named() -> None:
    result = empty_result()
    result.rows = [row_of()]
    plain = json.loads(result.to_json())
    plain["rows"][0]["branching"] = "two"
    with pytest.raises(ValueError, match=r"Result.rows\[0\].branching must be of type int"):
        Result.from_json(json.dumps(plain))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" * 100_000, "nested too deeply"),
        ('{"a":' * 100_000, "nested too deeply"),
        ('{"seconds": NaN}', "NaN is no finite number"),
        ('{"seconds": -1e999}', "-1e999 is no finite number"),
        ('{"seconds": 1' + 400 * "0" + "}", r"Result.seconds must be in the range of float"),
        ('{"notes": "' + 5000 * "x" + '"}', r"Result.notes must be a list, not 'x+\.\.\.x+'$"),
    ],
)
def test_texts_that_no_study_wrote_are_refused_in_a_sentence(text: str, message: str) -> None:
    text = text.replace("{", f'{{"format": {FORMAT}, ', 1)
    with pytest.raises(ValueError, match=message) as refusal:
        Result.from_json(text)
    assert len(str(refusal.value)) < 300


def test_csv_has_a_line_per_row_with_full_precision() -> None:
    result = empty_result()
    result.rows = [row_of(timed("a", 10, [0.1, 0.3, 0.2])), row_of(name='with "quotes", commas')]
    lines = list(csv.DictReader(io.StringIO(rows_csv(result))))
    assert [line["name"] for line in lines] == ["sah_2", 'with "quotes", commas']
    speed = result.rows[0].speed("primary")
    assert speed is not None and float(lines[0]["primary_mrays_per_second"]) == speed.median
    assert lines[0]["nodes"] == lines[1]["primary_mrays_per_second"] == ""
    assert list(lines[0]) == list(csv_record(result.rows[0]))


def test_csv_of_rays_has_a_line_per_bounce() -> None:
    result = empty_result()
    result.rows = [
        row_of(
            timed("a", 3_000_000, [0.5, 1.5, 1.0], kind="shadow", bounce=1, box_tests=6, hits=2),
            timed("b", 10, []),
        )
    ]
    first, second = csv.DictReader(io.StringIO(rays_csv(result)))
    assert (first["name"], first["kind"], first["bounce"], first["rays"]) == (
        *("sah_2", "shadow"),
        *("1", "3000000"),
    )
    assert (first["box_tests"], first["hits"], first["node_visits"]) == ("6", "2", "")
    assert float(first["mrays_per_second"]) == 3.0 and float(first["traverse_seconds"]) == 1.0
    assert second["mrays_per_second"] == second["traverse_seconds"] == ""


def test_csv_tells_precision_and_errors() -> None:
    result = empty_result()
    row = row_of(timed("a", 10, [0.1] * 3, bounce=1))
    row.measurements[0].errors = Errors(9, 1, 2, 3)
    row.layout, row.triangle_test, row.box_test = "cwbvh", "woop_affine", "plain"
    row.bytes_per_triangle, row.accuracy = 88.5, Accuracy(4, 0.25, 7.0, 8.0, 1e-8, 1e-6)
    result.rows = [row, row_of()]
    first, second = csv.DictReader(io.StringIO(rows_csv(result)))
    choices = [first[name] for name in ("layout", "triangle_test", "box_test")]
    assert choices == ["cwbvh", "woop_affine", "plain"]
    assert first["bytes_per_triangle"] == "88.5" and second["bytes_per_triangle"] == ""
    ulps = [first[f"t_error_ulps_{name}"] for name in ("median", "99.9_percent", "largest")]
    assert ulps == ["0.25", "7.0", "8.0"] and second["t_error_ulps_median"] == ""
    assert (first["uv_error_median"], first["uv_error_largest"]) == ("1e-08", "1e-06")
    (line,) = csv.DictReader(io.StringIO(rays_csv(result)))
    assert (line["layout"], line["box_test"], line["wrong_rays"]) == ("cwbvh", "plain", "6")


def test_an_unknown_row_is_named() -> None:
    result = empty_result()
    result.rows = [row_of()]
    assert result.row("sah_2") is result.rows[0]
    with pytest.raises(ValueError, match="no row 'x'; there are: sah_2"):
        result.row("x")
