# SPDX-License-Identifier: GPL-3.0-or-later
"""The time to a target error: from the reference to the column of the table."""

from __future__ import annotations

import argparse
import csv
import io
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from bvh_lab.native import core
from bvh_lab.study.arguments import add_plan_arguments, plan_from_arguments
from bvh_lab.study.convergence import Convergence, ErrorPoint
from bvh_lab.study.core_scene import core_scene
from bvh_lab.study.job import Job
from bvh_lab.study.method import method
from bvh_lab.study.plan import Plan
from bvh_lab.study.rays import choose_views
from bvh_lab.study.report import write_report
from bvh_lab.study.results import Machine, Picture, Result, Row, Subject
from bvh_lab.study.run import Study, compare
from bvh_lab.study.spreadsheet import rows_csv
from bvh_lab.study.table import picture_quality, text_report, text_table
from bvh_lab.study.target_error import (
    LEAST_REFERENCE,
    MOST_REFERENCE,
    PILOT_SAMPLES,
    check_judge,
    error_curves,
    reference_samples,
    set_times,
    target_notes,
)
from study_samples import sample_scene, small_plan

TARGET = 0.02


def target_plan(**changes: object) -> Plan:
    fields = {"views": 1, "long_side": 32, "samples": 2, "target_error": TARGET, "embree": False}
    return small_plan(**{**fields, "reorders": ["off", "aila"], "branchings": [2], **changes})


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A cache folder of our own."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("cache")
        patch.setenv("XDG_CACHE_HOME", str(folder))
        yield folder


@pytest.fixture(scope="module")
def study(cache: Path) -> Study:
    return compare(sample_scene(), target_plan())


# --- a study -------------------------------------------------------------------------------------


def test_each_row_has_its_time(study: Study) -> None:
    found = study.result.convergence
    assert found is not None and found.samples is not None and not study.result.failed()
    assert found.view == "auto_1" and found.target == TARGET
    assert found.points[-2].errors["relMSE"] > TARGET >= found.points[-1].errors["relMSE"]
    assert found.points[-2].samples < found.samples <= found.points[-1].samples
    assert 0.0 < found.reference_error < 0.2 * TARGET
    assert len(study.result.rows) == 4
    for row in study.result.rows:
        assert row.time_to_error is not None
        expected = found.samples * row.pictures[0].seconds / 2
        assert row.time_to_error.seconds == pytest.approx(expected)
        assert row.time_to_error.view == found.view and row.time_to_error.target == TARGET


def test_pictures_have_their_errors(study: Study) -> None:
    """Of two samples, as the plan has it: the same that the point of two samples has."""
    found = study.result.convergence
    assert found is not None and found.points[1].samples == 2
    for row in study.result.rows:
        assert row.pictures[0].errors == found.points[1].errors
    assert set(found.points[1].errors) == {"relMSE", "MAE", "RMSE", "PSNR", "bias"}


def test_points_are_errors_of_any_variants_pictures(study: Study, cache: Path) -> None:
    """Rendered here with another tree, and judged by the reference that lies in the cache."""
    found, scene, plan = study.result.convergence, sample_scene(), target_plan()
    assert found is not None
    files = [np.load(path) for path in (cache / "bvh_lab" / "references").glob("*.npz")]
    (pixels,) = (file["pixels"] for file in files if file["samples"] == found.reference_samples)
    mesh = core.Mesh(scene.vertices, scene.triangles)
    made, view = core_scene(core, mesh, scene)[0], choose_views(core, scene, plan)[0]
    bvh = core.build(mesh, "ploc", branching=4)
    for point in found.points[:4]:
        picture = core.render(
            bvh,
            made,
            view.camera,
            view.width,
            view.height,
            samples=point.samples,
            depth=plan.depth,
            shadow_rays=plan.shadow_rays,
        )
        assert core.image_error(picture.pixels, pixels)["relMSE"] == point.errors["relMSE"]


def test_again_the_reference_comes_from_the_cache(study: Study) -> None:
    stages: list[str] = []
    again = compare(
        sample_scene(),
        target_plan(reorders=["off"], builders=["sah"]),
        on_event=lambda event: stages.append(getattr(event, "stage", "")),
    )
    before, after = study.result.convergence, again.result.convergence
    assert before is not None and after is not None
    assert (after.points, after.samples) == (before.points, before.samples)
    referred = [stage for stage in stages if stage.startswith("reference of")]
    assert len(referred) == 2 and all(" 0 of " in stage for stage in referred)


def test_groups_are_judged_by_one_reference(study: Study) -> None:
    plan = target_plan(memory_gib=1e-9, reorders=["off"])
    result = compare(sample_scene(), plan).result
    assert [row.group for row in result.rows] == [1, 2] and not result.failed()
    assert all(row.time_to_error and row.pictures[0].errors for row in result.rows)


def test_result_goes_to_json_and_back(study: Study) -> None:
    assert Result.from_json(study.result.to_json()) == study.result


def test_report_draws_the_curves(study: Study, tmp_path: Path) -> None:
    write_report(study.result, {}, tmp_path / "a")
    page = (tmp_path / "a" / "index.html").read_text()
    assert "<h2>Error against time</h2>" in page and "each builder&#x27;s fastest variant" in page
    names = {path.name for path in (tmp_path / "a").iterdir()}
    assert {f"error_against_time.{end}" for end in ("csv", "svg", "png")} < names
    assert [curve.builder for curve in error_curves(study.result)] == ["lbvh", "sah"]


def test_report_without_matplotlib_says_so(
    study: Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    write_report(study.result, {}, tmp_path / "a")
    page = (tmp_path / "a" / "index.html").read_text()
    assert "its numbers are in error_against_time.csv: figures need" in page
    assert not list((tmp_path / "a").glob("error_against_time.[ps]*"))
    assert (tmp_path / "a" / "error_against_time.csv").read_text().count("\n") > 4


def test_a_cancel_is_obeyed_while_it_converges() -> None:
    plan = target_plan(target_error=1e-5, seed=9, long_side=96, ray_long_side=16)
    job = Job(sample_scene(), plan)
    while not job.stage.startswith("reference of view auto_1, 16 of"):
        job.wait(0.005)
        job.poll()
    start = time.perf_counter()
    job.cancel()
    result = job.study.result
    assert time.perf_counter() - start < 0.5
    assert result.cancelled and result.convergence is None
    assert result.rows[0].speed("primary") and result.rows[0].time_to_error is None


# --- made-up numbers -----------------------------------------------------------------------------


def test_reference_has_samples_enough_for_the_target() -> None:
    assert reference_samples(0.02, 0.02) == 8 * PILOT_SAMPLES
    assert reference_samples(0.021, 0.02) == 16 * PILOT_SAMPLES
    assert reference_samples(0.0, 0.02) == LEAST_REFERENCE
    assert reference_samples(1e9, 0.02) == reference_samples(float("inf"), 0.02) == MOST_REFERENCE


def made_up(samples: float | None) -> Result:
    """Two variants, one twice as fast, and Embree, which renders nothing."""
    subject = Subject("hall", "", "viewport", 1, 1, 3, 1, 0, ["a", "b"], "")
    machine = Machine("cpu", 2, 1.0, "Linux", "3", "1", "", "0", [], {}, "")
    result = Result(Plan(target_error=0.05), subject, machine, "2026-01-01T00:00:00+00:00")
    for name, seconds in (("lbvh", 8.0), ("sah", 4.0)):
        row = Row(f"{name}_2", name.upper(), "bvh_lab", name, 2, "off", "cpu")
        for view, factor in (("a", 1.0), ("b", 100.0)):
            times = (factor * seconds, 0.5 * factor * seconds)
            row.pictures.append(Picture(view, 4, 3, 16, {}, *times, "", 0.0, 0))
        row.pictures[0].errors = {"relMSE": 0.02, "PSNR": 30.0}
        result.rows.append(row)
    result.rows.append(Row("embree", "Embree", "embree", "embree", 0, "off", "cpu"))
    points = [ErrorPoint(1, {"relMSE": 0.4}), ErrorPoint(4, {"relMSE": 0.1}), ErrorPoint(8)]
    result.convergence = Convergence("a", 0.05, 512, 0.002, "SAH 2-wide", points, samples)
    set_times(result.rows, result.convergence)
    return result


def column(result: Result) -> list[str]:
    """The cells of the column of the time to the target."""
    lines = text_table(result.rows).splitlines()
    end = lines[0].index("relMSE 0.05") + len("relMSE 0.05")
    assert lines[1][:end].endswith("after s")
    return [line[:end].split()[-1] for line in lines[3:]]


def test_time_is_samples_needed_at_the_rows_own_pace() -> None:
    result = made_up(samples=6.0)
    assert column(result) == ["3", "1.5", "-"]
    records = list(csv.DictReader(io.StringIO(rows_csv(result))))
    times = [record["seconds_to_target_relMSE"] for record in records]
    assert times == ["3.0", "1.5", ""]
    assert [record["target_relMSE"] for record in records] == ["0.05", "0.05", ""]
    assert (records[0]["picture_relMSE"], records[0]["picture_PSNR"]) == ("0.02", "30.0")
    assert picture_quality(result) == [
        "Pictures of view a with 16 samples a pixel: relMSE 0.02, PSNR 30.0 dB, against a "
        "reference of 512 samples whose own relMSE is about 0.002.",
        "First at relMSE 0.05 in view a: SAH 2-wide, after 1.5 s (6 samples a pixel; without "
        "building the tree).",
    ]
    assert all(line in text_report(result) for line in picture_quality(result))
    assert target_notes(result) == []
    points = error_curves(result)[1].points
    assert [(p.samples, p.seconds) for p in points] == [(1, [0.25]), (4, [1.0])]


def test_a_target_not_reached_is_said() -> None:
    result = made_up(samples=None)
    assert column(result) == ["-", "-", "-"]
    assert len(picture_quality(result)) == 1
    assert target_notes(result)[-1].startswith("relMSE 0.05 was not reached: it is inf after 8 ")


def test_a_noisy_reference_is_said() -> None:
    result = made_up(samples=6.0)
    assert result.convergence is not None
    result.convergence.reference_error = 0.02
    assert target_notes(result)[0].startswith("The reference's own relMSE is about 0.02: ")


def test_without_a_target_there_is_no_column(study: Study) -> None:
    assert Plan().target_error == Plan.from_preset("paper").target_error == 0.0
    result = made_up(samples=6.0)
    result.convergence = None
    for row in result.rows:
        row.time_to_error = None
    assert "relMSE" not in text_table(result.rows)
    assert picture_quality(result) == target_notes(result) == error_curves(result) == []
    assert not any("relMSE" in line for line in method(Plan()))


def test_the_option() -> None:
    parser = argparse.ArgumentParser()
    add_plan_arguments(parser)
    plan = plan_from_arguments(parser.parse_args(["--target-error", "0.05"]))
    assert plan.target_error == 0.05
    with pytest.raises(ValueError, match="judged by pictures and there are none"):
        plan_from_arguments(parser.parse_args(["--target-error", "0.05", "--no-pictures"]))
    for bad in ("-1", "nan", "1e-9"):
        with pytest.raises(ValueError, match=r"target_error \(0: none\) is .* from 1e-05 to 100"):
            plan_from_arguments(parser.parse_args([f"--target-error={bad}"]))


def test_a_core_that_cannot_judge_is_refused() -> None:
    class Blind:
        @staticmethod
        def features() -> dict[str, bool]:
            return {"image": False}

    with pytest.raises(ValueError, match="no OpenImageIO, which judges pictures"):
        check_judge(Blind, target_plan())  # type: ignore[arg-type]
    check_judge(Blind, Plan())  # type: ignore[arg-type]
