# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole studies of a small scene with the real core."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bvh_lab.native import core
from bvh_lab.study import run
from bvh_lab.study.precision import BOX_TESTS, LAYOUTS, TRIANGLE_TESTS
from bvh_lab.study.progress import Event, RowChanged, Step
from bvh_lab.study.results import COUNTERS, KINDS, Result
from bvh_lab.study.run import Study, compare
from bvh_lab.study.scene import Material
from bvh_lab.study.table import fastest, text_table
from study_samples import sample_scene, small_plan

# Kinds and bounces of the rays of small_plan().
PLACES = [("primary", 0), *(("secondary", i) for i in (1, 2)), *(("shadow", i) for i in (0, 1, 2))]
EMBREE = core.embree()["available"]


class Double:
    """The real core with some of its functions replaced, to see failures handled."""

    def __init__(self, **changes: Any) -> None:
        self._changes = changes

    def __getattr__(self, name: str) -> Any:
        return self._changes.get(name) or getattr(core, name)


@pytest.fixture(scope="module")
def study() -> Study:
    return compare(sample_scene(), small_plan(reorders=["off", "aila"]), host="pytest")


def test_every_variant_has_its_row(study: Study) -> None:
    names = [row.name for row in study.result.rows if row.system == "bvh_lab"]
    assert names == [variant.name for variant in study.result.plan.variants()]
    assert not study.result.failed() and not study.result.cancelled
    assert study.result.reference == "lbvh_2"


def test_rows_hold_the_tree_as_the_core_tells_it(study: Study) -> None:
    row, plan, scene = study.result.row("sah_8"), study.result.plan, sample_scene()
    bvh = core.build(core.Mesh(scene.vertices, scene.triangles), "sah", branching=8)
    assert row.tree is not None and row.label == "SAH"
    assert row.tree.nodes == bvh.stats["nodes"] and row.tree.bytes == bvh.stats["bytes"]
    assert row.tree.cost == bvh.cost(plan.traversal, plan.intersection)
    assert len(row.build_seconds) == plan.build_repeats and row.threads >= 1


def test_every_row_answers_alike(study: Study) -> None:
    rows = [row for row in study.result.rows if row.system == "bvh_lab"]
    hashes = {tuple(m.hits_sha256 for m in row.measurements) for row in rows}
    assert len(hashes) == 1
    assert all(row.differing_rays() == 0 and row.picture_difference() == 0.0 for row in rows)


def test_every_row_is_measured_and_judged(study: Study) -> None:
    plan, views = study.result.plan, study.result.subject.views
    assert len(views) == plan.views == 2
    for row in study.result.rows:
        assert [(m.view, m.kind, m.bounce) for m in row.measurements] == [
            (view, *place) for view in views for place in PLACES
        ]
        for measurement in row.measurements:
            assert len(measurement.seconds) == plan.repeats and min(measurement.seconds) > 0.0
            bounces = sum(1 for kind, _ in PLACES if kind == measurement.kind)
            wanted = math.ceil(plan.judged_rays / bounces)
            assert measurement.errors.judged == min(wanted, measurement.rays)
            assert 0 < measurement.hits <= measurement.rays
            if row.system == "embree":
                assert measurement.node_visits is None
                continue
            visits, boxes = measurement.node_visits, measurement.box_tests
            assert visits is not None and boxes is not None
            # The root alone may have fewer children than two.
            assert 2 * visits - measurement.rays <= boxes <= row.branching * visits
            assert measurement.triangle_tests is not None
            assert measurement.triangle_tests >= measurement.hits
        assert row.errors().wrong == 0
        assert all(row.speed(kind) for kind in KINDS)


def test_rays_are_those_of_the_path_tracer(study: Study) -> None:
    """One path a pixel: no more and no fewer rays than one sample of the picture traces."""
    row = study.result.rows[0]
    for picture in row.pictures:
        assert picture.samples == 1 and (picture.width, picture.height) == (48, 36)
        of_view = [m for m in row.measurements if m.view == picture.view]
        for kind in KINDS:
            assert sum(m.rays for m in of_view if m.kind == kind) == picture.rays[kind] > 0
        primary, first = of_view[0], of_view[1]
        assert primary.rays == 48 * 36 and first.rays == primary.hits < primary.rays
    assert sum(study.result.rays().values()) == sum(m.rays for m in row.measurements)


def test_fewer_rays_may_be_measured_than_the_picture_has() -> None:
    plan = small_plan(builders=["sah"], branchings=[4], ray_long_side=16, depth=0, shadow_rays=1)
    result = compare(sample_scene(), plan).result
    assert list(result.rays()) == [("primary", 0), ("shadow", 0)]
    row = result.rows[0]
    assert {m.rays for m in row.of_kind("primary")[row.pictures[0].view]} == {16 * 12}
    assert (row.pictures[0].width, row.speed("secondary")) == (48, None)
    assert not any("has no" in note for note in result.notes)


def test_reordering_costs_keys_and_sorting(study: Study) -> None:
    for name, reorder in (("sah_2", "off"), ("sah_2_aila", "aila")):
        row = study.result.row(name)
        assert row.reorder == reorder
        for m in row.measurements:
            sorts = reorder == "aila" and m.kind != "primary"
            assert (sum(m.key_seconds) > 0.0) == (sum(m.sort_seconds) > 0.0) == sorts
        share = row.sorting_share("shadow")
        assert share is not None and (0.0 < share < 1.0) == (reorder == "aila")


def test_both_orders_share_one_build(study: Study) -> None:
    plain, reordered = study.result.row("sah_2"), study.result.row("sah_2_aila")
    assert plain.build_seconds == reordered.build_seconds


@pytest.mark.skipif(not EMBREE, reason=f"Embree: {core.embree()['reason']}")
def test_embree_stands_beside(study: Study) -> None:
    rows = [row for row in study.result.rows if row.system == "embree"]
    assert [row.name for row in rows] == ["embree_high_robust", "embree_high_fast"]
    assert rows[0].differing_rays() == 0 and rows[0].tree is None and not rows[0].pictures
    assert all(row.build_seconds for row in rows)


@pytest.fixture(scope="module")
def precise() -> Study:
    """All layouts and tests on one tree."""
    plan = small_plan(
        builders=["sah"],
        branchings=[2, 8],
        layouts=list(LAYOUTS),
        triangle_tests=list(TRIANGLE_TESTS),
        box_tests=list(BOX_TESTS),
        embree=False,
        judged_rays=256,
    )
    return compare(sample_scene(), plan)


def test_precision_choices_are_rows(precise: Study) -> None:
    result = precise.result
    assert len(result.rows) == 3 * 4 * 2 and not result.failed()
    assert result.rows[0].name == result.reference == "sah_2"
    names = {"sah_8_cwbvh", "sah_8_woop_affine", "sah_8_cwbvh_moller_trumbore_plain"}
    assert names < {row.name for row in result.rows}
    for row in result.rows:
        assert all(row.speed(kind) for kind in KINDS) and row.errors().judged > 1000
        assert row.accuracy is not None and row.accuracy.hits > 100
        if row.exact:
            assert row.differing_rays() == row.errors().wrong == 0
            assert row.accuracy.t_ulps_largest <= 0.5 + 1e-6  # rounded once, from double
    assert any("8c: " in note for note in result.notes)
    assert any("render no pictures" in note for note in result.notes)


def test_one_build_serves_all_precision_choices(precise: Study) -> None:
    rows = {row.name: row for row in precise.result.rows}
    for name in ("sah_8_plain", "sah_8_woop_affine", "sah_8_woop_affine_plain"):
        assert rows[name].build_seconds == rows["sah_8"].build_seconds
        assert rows[name].tree == rows["sah_8"].tree
    full, compressed = rows["sah_8"], rows["sah_8_cwbvh"]
    assert compressed.tree_seconds == full.tree_seconds
    assert compressed.collapse_seconds != full.collapse_seconds
    assert full.tree is not None and full.bytes_per_triangle is not None
    assert full.bytes_per_triangle == full.tree.bytes / 768
    assert compressed.bytes_per_triangle is not None
    assert compressed.bytes_per_triangle < full.bytes_per_triangle
    for test, size in (("moller_trumbore", 0), ("woop_affine", 48), ("baldwin_weber", 40)):
        row = rows[f"sah_8_{test}"]
        assert row.bytes_per_triangle == (full.tree.bytes + row.prepared_bytes) / 768
        assert 768 * size <= row.prepared_bytes <= 8 * 768 * size  # unused lanes of SIMD, too
    assert rows["sah_8_woop_affine_plain"].prepare_seconds > 0.0 == full.prepare_seconds


def test_only_exact_rows_render(precise: Study) -> None:
    pictured = {name for name, _ in precise.pictures}
    assert pictured == {"sah_2", "sah_8", "sah_8_cwbvh"}
    assert {row.name for row in precise.result.rows if row.pictures} == pictured
    assert precise.result.row("sah_8_plain").picture_difference() is None


def test_tests_that_are_not_exact_need_no_exact_row() -> None:
    plan = small_plan(builders=["sah"], branchings=[8], triangle_tests=["woop_affine"])
    result = compare(sample_scene(), plan).result
    assert not result.failed() and not any(row.pictures for row in result.rows)
    assert result.rows[0].differing_rays() is not None


def test_a_wrong_test_is_no_failure_and_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    """Box test plain made to lose every tenth ray."""

    def losing_trace(bvh: Any, *arguments: Any, box_test: str = "conservative", **more: Any) -> Any:
        hit = core.trace(bvh, *arguments, **more)
        if box_test == "plain":
            for name, lost in (("occluded", False), ("t", np.inf), ("triangle", 0xFFFFFFFF)):
                if getattr(hit, name) is not None:
                    getattr(hit, name)[::10] = lost
        return hit

    monkeypatch.setattr(run, "load", lambda: Double(trace=losing_trace))
    plan = small_plan(builders=["sah"], branchings=[2], box_tests=["plain", "conservative"])
    result = compare(sample_scene(), plan).result
    plain, exact = result.row("sah_2_plain"), result.row("sah_2")
    assert not result.failed() and result.reference == "sah_2"  # though it comes second
    first = exact.measurements[0]
    assert plain.measurements[0].differing_rays > 0.05 * first.hits
    assert plain.errors().false_misses == plain.errors().wrong > 0 == exact.errors().wrong
    (lost,) = (row for row in text_table(result.rows).splitlines() if " plain " in row)
    assert f" of {plain.errors().judged} ({plain.errors().wrong} missed)" in lost
    assert "SAH 2-wide, " in " ".join(fastest(result))  # not the one that loses hits


def test_pictures_of_equal_variants_share_memory(study: Study) -> None:
    first, *rest = study.result.subject.views
    assert len(study.pictures) == 8 * 2
    picture = study.pictures["lbvh_2", first]
    assert picture.shape == (36, 48, 3) and picture.dtype == np.float32 and picture.max() > 0.0
    assert study.pictures["sah_8", first] is picture
    assert study.pictures["sah_8", rest[0]] is not picture
    for number in range(2):
        rows = [row for row in study.result.rows if row.pictures]
        assert len({row.pictures[number].sha256 for row in rows}) == 1


def test_result_lists_what_the_picture_needs(study: Study) -> None:
    assert study.result.subject.features == ["lamps", "world"]


def test_result_goes_to_json_and_back(study: Study) -> None:
    assert Result.from_json(study.result.to_json()) == study.result


def test_result_names_scene_and_machine(study: Study) -> None:
    result, scene = study.result, sample_scene()
    assert result.subject.sha256 == scene.digest() and result.subject.triangles == 768
    assert result.machine.host == "pytest" and result.machine.version == core.__version__
    assert result.machine.cpu and result.machine.cores >= 1
    assert "A note of the extraction." in result.notes


def test_same_seed_same_answers(study: Study) -> None:
    again = compare(sample_scene(), small_plan(builders=["sah"], branchings=[4], threads=1))
    ours, theirs = again.result.rows[0], study.result.rows[0]
    assert [m.hits_sha256 for m in ours.measurements] == [
        m.hits_sha256 for m in theirs.measurements
    ]
    other = compare(sample_scene(), small_plan(builders=["sah"], branchings=[4], seed=1))
    hashes = [m.hits_sha256 for m in other.result.rows[0].measurements]
    assert hashes[1] != ours.measurements[1].hits_sha256  # the secondary rays are random


def test_events_tell_progress_and_rows() -> None:
    events: list[Event] = []
    plan = small_plan(builders=["sah"], embree=False)
    result = compare(sample_scene(), plan, on_event=events.append).result
    steps = [event for event in events if isinstance(event, Step)]
    fractions = [step.fraction for step in steps]
    assert fractions == sorted(fractions) and 0.8 < fractions[-1] <= 1.0
    assert steps[0].stage == "building SAH" and all(s.seconds_left >= 0.0 for s in steps)
    finished = [event.row for event in events if isinstance(event, RowChanged) and event.finished]
    assert finished == result.rows


def test_no_more_than_asked_for() -> None:
    plan = small_plan(
        builders=["lbvh"], branchings=[4], embree=False, pictures=False, judged_rays=0
    )
    study = compare(sample_scene(), plan)
    (row,) = study.result.rows
    assert not study.pictures and not row.pictures and row.picture_difference() is None
    assert row.errors().judged == 0 and row.speed("secondary")


def test_a_view_of_nothing_has_primary_rays_only() -> None:
    scene = sample_scene()
    scene.cameras[0].to_world[:3, 0] *= -1.0  # turned round about its up axis
    scene.cameras[0].to_world[:3, 2] *= -1.0
    result = compare(scene, small_plan(views=1, builders=["sah"])).result
    assert not result.failed()
    assert [m.kind for m in result.rows[0].measurements] == ["primary"]
    assert (
        "View auto_1 has no secondary and shadow rays: nothing was hit that sends any there."
        in result.notes
    )
    assert Result.from_json(result.to_json()) == result


def test_trees_that_do_not_fit_are_measured_in_groups() -> None:
    plan = small_plan(memory_gib=1e-9, embree=False)
    result = compare(sample_scene(), plan).result
    assert [row.group for row in result.rows] == [1, 1, 2, 2]
    assert not result.failed() and all(row.speed("secondary") for row in result.rows)
    assert any("measured in 2 groups" in note for note in result.notes)


def test_slow_builds_are_timed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "SLOW_BUILD_SECONDS", 0.0)
    result = compare(sample_scene(), small_plan(build_repeats=3, embree=False)).result
    assert {len(row.build_seconds) for row in result.rows} == {1}
    assert any(
        note.startswith("Built and timed once, ") and "LBVH, SAH" in note for note in result.notes
    )


def failing_build(mesh: Any, builder: str, **more: Any) -> Any:
    if builder == "sah":
        raise RuntimeError("the SAH builder broke")
    return core.build_tree(mesh, builder, **more)


def test_a_variant_that_fails_leaves_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "load", lambda: Double(build_tree=failing_build))
    plan = small_plan(builders=["sah", "lbvh"], embree=False)
    result = compare(sample_scene(), plan).result
    assert [row.error for row in result.rows] == ["the SAH builder broke"] * 2 + [""] * 2
    assert result.reference == "lbvh_2" and result.rows[2].speed("primary")
    assert [row.name for row in result.failed()] == ["sah_2", "sah_8"]


def test_a_variant_that_answers_otherwise_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    def lying_trace(bvh: Any, *arguments: Any, **more: Any) -> Any:
        hit = core.trace(bvh, *arguments, **more)
        if bvh.builder != "sah" or hit.t is None:
            return hit
        names = ("occluded", "t", "u", "v", "triangle", *COUNTERS)
        names += ("key_seconds", "sort_seconds", "traverse_seconds")
        names += ("prepare_seconds", "prepared_bytes", "transfer_seconds", "shape")
        lie = SimpleNamespace(**{name: getattr(hit, name) for name in names})
        lie.t = np.where(hit.occluded, np.nextafter(hit.t, np.float32(0)), hit.t)
        return lie

    monkeypatch.setattr(run, "load", lambda: Double(trace=lying_trace))
    result = compare(sample_scene(), small_plan(branchings=[2], embree=False)).result
    assert [row.name for row in result.failed()] == ["sah_2"]
    first = result.row("sah_2").measurements[0]
    assert first.differing_rays == first.hits > 0


def test_missing_embree_is_a_failed_row(monkeypatch: pytest.MonkeyPatch) -> None:
    absent = {"available": False, "version": "", "reason": "no libembree"}
    monkeypatch.setattr(run, "load", lambda: Double(embree=lambda: absent))
    result = compare(sample_scene(), small_plan(builders=["sah"])).result
    assert [row.system for row in result.failed()] == ["embree", "embree"]
    assert "Embree is missing: no libembree; leave it out with" in result.failed()[0].error
    assert result.row("sah_8").speed("primary")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"triangles": np.zeros((0, 3), np.uint32)}, "no triangles"),
        ({"triangles": np.uint32([[0, 1, 9999]]), "material_index": np.uint32([0])}, "triangle 0"),
        ({"cameras": []}, "has no camera"),
        ({"materials": [Material("one")]}, "material"),
    ],
)
def test_bad_scenes_are_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        compare(sample_scene(**changes), small_plan())


def test_rays_that_do_not_fit_are_refused() -> None:
    plan = small_plan(ray_long_side=16384, depth=1024)
    with pytest.raises(ValueError, match=r"may take [\d.]+ GiB and [\d.]+ GiB are free; choose a"):
        compare(sample_scene(), plan)


def test_unknown_views_are_named() -> None:
    with pytest.raises(ValueError, match="unknown view 'Nave'; there are: auto_1, auto_2, auto_3"):
        compare(sample_scene(), small_plan(views=["Nave"]))
