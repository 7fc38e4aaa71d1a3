# SPDX-License-Identifier: GPL-3.0-or-later
"""The table as text and the folder that a user keeps."""

from __future__ import annotations

import csv
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from bvh_lab.study.output import file_stems, staged_folder, write_text_aside
from bvh_lab.study.report import write_report
from bvh_lab.study.results import Accuracy, Errors, Measurement, Result, Row
from bvh_lab.study.run import Study, compare
from bvh_lab.study.table import fastest, ray_counts, text_report, text_table, title
from PIL import Image
from study_samples import sample_scene, small_plan


@pytest.fixture(scope="module")
def study() -> Study:
    scene = sample_scene(name="boxes & <more>")
    scene.cameras[0].name = "Nave / west"
    return compare(scene, small_plan())


def test_table_is_aligned_with_a_row_per_variant(study: Study) -> None:
    lines = text_table(study.result.rows).splitlines()
    assert len(lines) == 3 + len(study.result.rows)
    assert lines[0].split()[:6] == [
        "builder",
        "branching",
        "nodes",
        "leaves",
        "references",
        "depth",
    ]
    units = ["visits"] * 3 + ["boxes"] * 3 + ["triangles"] * 3
    assert lines[1].split()[-12:-3] == units
    assert len({line.rstrip()[-1] for line in lines}) > 1
    assert {len(line) for line in lines[2:]} == {len(lines[2])}
    assert lines[3].startswith("LBVH ") and "±" in lines[3]


def test_table_breaks_into_blocks_that_fit(study: Study) -> None:
    whole, broken = text_table(study.result.rows), text_table(study.result.rows, 80)
    assert max(map(len, broken.splitlines())) <= 80
    blocks = broken.rstrip().split("\n\n")
    assert len(blocks) > 1 and all(block.startswith("builder") for block in blocks)
    assert set(whole.split()) - {"-" * len(whole.splitlines()[2])} <= set(broken.split())


def test_a_result_without_rows_is_still_a_table() -> None:
    assert text_table([]).count("\n") == 3


def test_text_names_the_fastest_with_its_error(study: Study) -> None:
    lines = fastest(study.result)
    assert len(lines) == 3
    pattern = r"Fastest of ours for primary rays: (LBVH|SAH) \d-wide, [\d.]+ MRays/s ±\d+%, .*"
    assert re.fullmatch(pattern + r"0 of \d+ judged rays wrong\.", lines[0])
    report = text_report(study.result)
    assert lines[0] in report and "A note of the extraction." in report
    assert "FAILED" not in report


def test_text_tells_the_rays_by_kind_and_bounce(study: Study) -> None:
    rays = study.result.rays()
    (line,) = ray_counts(study.result)
    assert f"{rays['primary', 0]:,d} primary, " in line
    first, second = rays["secondary", 1], rays["secondary", 2]
    assert f" {first + second:,d} secondary ({first:,d} + {second:,d} by bounce), " in line
    assert line in text_report(study.result)


def test_sorted_rays_show_what_sorting_takes() -> None:
    times = {"key_seconds": [1e-3], "sort_seconds": [1e-3], "traverse_seconds": [6e-3]}
    rows = [
        Row("sah_2", "SAH", "bvh_lab", "sah", 2, reorder, "cpu", measurements=[measured])
        for reorder, measured in (
            ("off", Measurement("a", "shadow", 10, traverse_seconds=[6e-3])),
            ("origin", Measurement("a", "shadow", 10, **times)),
        )
    ]
    rows[0].measurements[0].key_seconds = rows[0].measurements[0].sort_seconds = [0.0]
    table = text_table(rows).splitlines()
    assert "% sorting" in table[1] and " 25 " in table[4] and " 25 " not in table[3]
    assert title(rows[0]) == "SAH 2-wide"
    assert title(rows[1]) == "SAH 2-wide, rays sorted (origin)"


def test_text_shows_failures(study: Study) -> None:
    result = Result.from_json(study.result.to_json())
    result.rows[0].error = "it broke"
    result.rows[1].measurements[0].differing_rays = 3
    lines = [line for line in text_report(result).splitlines() if line.startswith("FAILED")]
    assert lines[0] == "FAILED  LBVH 2-wide: it broke"
    assert lines[1].startswith("FAILED  LBVH 8-wide: answers differ from lbvh_2: 3 rays")


def precise_row(triangle_test: str, seconds: float, wrong: int, layout: str = "full") -> Row:
    times = {"key_seconds": [0.0], "sort_seconds": [0.0], "traverse_seconds": [seconds]}
    errors = Errors(100, false_misses=wrong // 2, false_hits=wrong - wrong // 2)
    measured = Measurement("a", "primary", 1000, differing_rays=10 * wrong, errors=errors, **times)
    return Row(
        *(f"sah_8_{layout}_{triangle_test}", "SAH", "bvh_lab", "sah", 8, "off", "cpu"),
        layout=layout,
        triangle_test=triangle_test,
        measurements=[measured],
        accuracy=Accuracy(50, 0.25, 0.5 + wrong, 1.0 + wrong, 1e-8, 1e-7),
        bytes_per_triangle=77.7,
    )


@pytest.fixture
def precise(study: Study) -> Result:
    """Two layouts and a test that is twice as fast and wrong."""
    result = Result.from_json(study.result.to_json())
    result.reference = "sah_8_full_watertight"
    result.rows = [
        precise_row("watertight", 2.0, 0),
        precise_row("watertight", 2.5, 0, "cwbvh"),
        precise_row("woop_affine", 1.0, 3),
    ]
    return result


def test_table_names_precision_and_its_errors(precise: Result) -> None:
    heads, units, _, *lines = text_table(precise.rows).splitlines()
    assert heads.split()[:4] == ["builder", "branching", "triangle", "box"]
    assert units.split()[:3] == ["factor", "test", "test"]
    assert [line.split()[:3] for line in lines] == [
        ["SAH", "8", "watertight"],
        ["SAH", "8c", "watertight"],
        ["SAH", "8", "Woop"],
    ]
    assert " 0 of 100 " in lines[0] and " 3 of 100 (1 missed) " in lines[2]
    assert " 78 " in lines[0]
    assert title(precise.rows[1]) == "SAH 8-wide compressed"
    precise.rows[2].box_test = "plain"
    assert title(precise.rows[2]) == "SAH 8-wide, Woop affine, plain boxes"


def test_every_block_names_the_tests(precise: Result) -> None:
    for block in text_table(precise.rows, 90).rstrip().split("\n\n"):
        assert block.split()[:4] == ["builder", "branching", "triangle", "box"]


def test_the_fastest_is_exact_and_a_faster_one_is_named(precise: Result) -> None:
    best, faster = fastest(precise)
    assert best.startswith("Fastest of ours for primary rays: SAH 8-wide, 0.00 MRays/s")
    assert faster.startswith("Faster with a test that may be wrong: SAH 8-wide, Woop affine, ")
    assert "3 of 100 (1 missed) judged rays wrong, 30 of all 1,000 otherwise" in faster


def test_speed_against_error_is_in_the_report(precise: Result, tmp_path: Path) -> None:
    write_report(precise, {}, tmp_path / "out")
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {f"speed_against_error.{end}" for end in ("svg", "png", "csv")} <= names
    page = Page()
    page.feed((tmp_path / "out" / "index.html").read_text())
    assert "Speed against error" in page.text and "ulp, 99.9%" in page.text
    assert len(page.links) == 1


class Page(HTMLParser):
    """Checks that tags are closed in order and keeps the text."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text = ""
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.links += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.fixture(scope="module")
def folder(study: Study, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("report") / "above" / "boxes"
    write_report(study.result, study.pictures, out)
    return out


def test_folder_is_whole_and_alone(study: Study, folder: Path) -> None:
    assert [path.name for path in folder.parent.iterdir()] == ["boxes"]
    names = {path.name for path in folder.iterdir()}
    assert names == {
        "table.txt",
        "results.csv",
        "rays.csv",
        "results.json",
        "index.html",
        "pictures",
    }
    assert (folder / "table.txt").read_text() == text_report(study.result)
    assert Result.from_json((folder / "results.json").read_text()) == study.result
    with (folder / "results.csv").open(newline="") as file:
        assert [line["name"] for line in csv.DictReader(file)] == [
            r.name for r in study.result.rows
        ]


def test_pictures_are_there_in_both_formats(folder: Path) -> None:
    names = {path.name for path in (folder / "pictures").iterdir()}
    variants = ["lbvh_2", "lbvh_8", "sah_2", "sah_8", "difference"]
    views = ["Nave___west", "auto_2"]
    assert names == {f"{v}_{n}.{s}" for v in views for n in variants for s in ("png", "exr")}


def test_pictures_hold_the_right_pixels(folder: Path) -> None:
    for name, black in (("auto_2_sah_8", False), ("auto_2_difference", True)):
        with Image.open(folder / "pictures" / f"{name}.png") as picture:
            assert picture.size == (48, 36)
            assert (np.asarray(picture).max() == 0) == black


def test_web_page_is_well_formed_and_needs_no_other_file(study: Study, folder: Path) -> None:
    page = Page()
    page.feed((folder / "index.html").read_text())
    assert not page.open
    assert "boxes & <more>" in page.text and "equal pixel for pixel" in page.text
    assert len(page.links) == 2 and all(link.startswith("data:image/png") for link in page.links)
    for row in study.result.rows:
        assert row.label in page.text


def test_other_files_of_a_folder_stay(study: Study, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("keep")
    (tmp_path / "table.txt").write_text("old")
    write_report(study.result, {}, tmp_path)
    assert (tmp_path / "mine.txt").read_text() == "keep"
    assert (tmp_path / "table.txt").read_text() == text_report(study.result)
    assert not (tmp_path / "pictures").exists()


def test_a_difference_is_shown(study: Study, tmp_path: Path) -> None:
    result = Result.from_json(study.result.to_json())
    view = result.subject.views[1]
    pictures = dict(study.pictures)
    pictures["sah_8", view] = pictures["sah_8", view] + np.float32(0.25)
    result.row("sah_8").pictures[1].largest_difference = 0.25
    write_report(result, pictures, tmp_path / "out")
    page = Page()
    page.feed((tmp_path / "out" / "index.html").read_text())
    assert len(page.links) == 3 and "scaled so that white is 0.25" in page.text


def test_nothing_is_left_of_a_failed_report(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="half way"), staged_folder(tmp_path / "out") as staging:
        (staging / "a").touch()
        raise RuntimeError("half way")
    assert not list(tmp_path.iterdir())


def test_a_file_in_the_way_is_named(tmp_path: Path) -> None:
    (tmp_path / "out").touch()
    with pytest.raises(OSError, match="out is a file"), staged_folder(tmp_path / "out"):
        pass
    with pytest.raises(OSError), staged_folder(tmp_path / "out" / "below"):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_text_is_written_aside(tmp_path: Path) -> None:
    write_text_aside(tmp_path / "a.json", "one")
    write_text_aside(tmp_path / "a.json", "two")
    assert (tmp_path / "a.json").read_text() == "two"
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError):
        write_text_aside(tmp_path / "folder", "three")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.json", "folder"]


def test_file_names_are_safe_and_unique() -> None:
    stems = file_stems(["Nave", "a/b", "a b", "A_B", "..", "", "Nave"])
    assert stems == {
        "Nave": "Nave",
        "a/b": "a_b",
        "a b": "a_b_2",
        "A_B": "A_B_3",
        "..": "view",
        "": "view_2",
    }
