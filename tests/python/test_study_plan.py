# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans: their variants, their checks and their JSON."""

from __future__ import annotations

import argparse
from typing import Any

import pytest
from bvh_lab.native import core
from bvh_lab.study.arguments import add_plan_arguments, plan_from_arguments
from bvh_lab.study.plan import (
    BUILDERS,
    PRESETS,
    REORDERS,
    UNLIMITED_REFERENCES,
    Plan,
    Variant,
)
from bvh_lab.study.precision import BOX_TESTS, LAYOUTS, TRIANGLE_TESTS, is_exact
from hypothesis import given
from hypothesis import strategies as st


def plan_of(*words: str) -> Plan:
    parser = argparse.ArgumentParser()
    add_plan_arguments(parser)
    return plan_from_arguments(parser.parse_args(words))


def test_variants_are_all_combinations_with_builders_slowest() -> None:
    plan = Plan(
        builders=["lbvh", "sah"], branchings=[2, 8], reorders=["off", "aila"], layouts=["full"]
    )
    names = [variant.name for variant in plan.variants()]
    assert names[:4] == ["lbvh_2", "lbvh_2_aila", "lbvh_8", "lbvh_8_aila"]
    assert len(set(names)) == len(names) == 8


def test_variant_name_holds_what_is_not_the_default() -> None:
    assert Variant("sah", 4, "off", "opencl:a/b c").name == "sah_4_opencl-a-b-c"
    assert Variant("sbvh", 8, "off", "cpu", "cwbvh").name == "sbvh_8_cwbvh"
    assert (
        Variant("sbvh", 8, "off", "cpu", triangle_test="woop_affine").name == "sbvh_8_woop_affine"
    )
    full_name = "sbvh_8_cwbvh_moller_trumbore_plain_aila"
    assert Variant("sbvh", 8, "aila", "cpu", "cwbvh", "moller_trumbore", "plain").name == full_name


def test_compressed_nodes_are_for_8_children_alone() -> None:
    plan = Plan(builders=["sah"], layouts=["full", "cwbvh"])
    assert [v.name for v in plan.variants()] == ["sah_2", "sah_4", "sah_8", "sah_8_cwbvh"]
    plan.layouts = ["cwbvh"]
    assert [v.name for v in plan.variants()] == ["sah_8_cwbvh"]


def test_the_default_has_both_layouts_and_exact_tests() -> None:
    plan = Plan()
    assert len(plan.variants()) == 4 * len(BUILDERS) and plan.all_exact()
    assert not Plan(box_tests=["conservative", "plain"]).all_exact()


def test_precision_choices_are_those_of_the_core() -> None:
    offered = core.precisions()
    assert [choice["id"] for choice in offered["layout"]] == list(LAYOUTS)
    assert [choice["id"] for choice in offered["triangle_test"]] == list(TRIANGLE_TESTS)
    assert [choice["id"] for choice in offered["box_test"]] == list(BOX_TESTS)
    assert is_exact(next(iter(TRIANGLE_TESTS)), next(iter(BOX_TESTS)))


@pytest.mark.parametrize("preset", ["quick", "paper"])
def test_presets_are_good_plans(preset: str) -> None:
    plan = Plan.from_preset(preset)
    plan.check(core.builders(), core.devices())
    assert plan.preset_note().startswith(f"Preset {preset}")


def test_the_default_is_every_builder_of_the_core() -> None:
    assert list(BUILDERS) == [builder["id"] for builder in core.builders()]
    assert Plan().builders == list(BUILDERS)


def test_the_note_tells_the_iterations_that_are_run() -> None:
    plan = plan_of("--builders", "sah,prbvh_a", "--param", "prbvh_a.iterations=7")
    assert "prbvh_a: 7 iterations" in plan.preset_note()
    assert "prbvh_sa" not in plan.preset_note()


def test_presets_do_not_share_their_settings() -> None:
    Plan().params["prbvh_a"]["iterations"] = 1.0
    assert Plan().params["prbvh_a"]["iterations"] > 1.0


def test_paper_preset_is_the_papers() -> None:
    plan = Plan.from_preset("paper")
    assert (plan.width, plan.height, plan.traversal, plan.intersection) == (1024, 768, 3.0, 2.0)
    assert (plan.samples, plan.depth, plan.shadow_rays, plan.views) == (32, 8, 2, 3)
    assert plan.reorders == ["off", "aila"] and plan.ray_long_side == 0
    assert plan.layouts == ["full"] and plan.all_exact()
    assert "full nodes (no cwbvh)" in plan.preset_note() and "woop_affine" in plan.preset_note()
    assert all(Plan.from_preset(preset).repeats >= 5 for preset in PRESETS)


def test_orders_of_rays_are_those_of_the_core() -> None:
    mesh = core.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    bvh = core.build(mesh, "lbvh")
    for reorder in REORDERS:
        core.trace(bvh, [[0, 0, 1]], [[0, 0, -1]], reorder=reorder)
    with pytest.raises(ValueError, match=f"unknown ray order .*: {', '.join(REORDERS)}$"):
        core.trace(bvh, [[0, 0, 1]], [[0, 0, -1]], reorder="morton")
    with pytest.raises(ValueError, match="reorder must be True, False or a name, not 1"):
        core.trace(bvh, [[0, 0, 1]], [[0, 0, -1]], reorder=1)


def test_orders_of_older_plans_are_read() -> None:
    assert Plan.from_json('{"reorders": [false, true]}').reorders == ["off", "aila"]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"builders": ["lbvh", "nope"]}, r"unknown builder 'nope'; there are: lbvh, .*sbvh"),
        ({"builders": []}, "builders is empty"),
        ({"builders": ["sah", "sah"]}, "builders names one twice"),
        ({"branchings": [2, 3]}, "branching 3 is not known; it is 2, 4 or 8"),
        ({"devices": ["gpu9"]}, "unknown device 'gpu9'; there are: cpu"),
        (
            {"devices": ["cpu", "opencl:no/thing"]},
            "unknown device 'opencl:no/thing'; there are: cpu",
        ),
        ({"devices": ["opencl"], "box_tests": ["plain"]}, "OpenCL devices have the default"),
        ({"repeats": 2}, "repeats is 2; it must be from 3"),
        ({"samples": 0}, "samples is 0"),
        ({"depth": -1}, "depth is -1; it must be from 0"),
        ({"shadow_rays": -1}, "shadow_rays is -1"),
        ({"ray_long_side": 1}, "ray_long_side is 1; it must be from 8"),
        ({"reorders": ["off", "on"]}, "unknown reorder 'on'; there are: off, aila, "),
        ({"layouts": ["cwbvh8"]}, "unknown layout 'cwbvh8'; there are: full, cwbvh$"),
        ({"layouts": ["full", "full"]}, "layouts names one twice"),
        (
            {"layouts": ["cwbvh"], "branchings": [2, 4]},
            "layout cwbvh is 8-wide: choose branching 8",
        ),
        ({"triangle_tests": []}, "triangle_tests is empty"),
        (
            {"triangle_tests": ["woop"]},
            "unknown triangle test 'woop'; there are: watertight, .*weber$",
        ),
        ({"box_tests": ["slabs"]}, "unknown box test 'slabs'; there are: conservative, plain$"),
        ({"views": 0}, "views is 0"),
        ({"views": []}, "views is empty"),
        ({"width": 64}, "64x0 needs both"),
        ({"traversal": float("nan")}, "traversal is nan"),
        ({"preset": "fast"}, "unknown preset 'fast'; there are: quick, paper"),
        ({"params": {"nope": {}}}, "unknown builder 'nope'"),
        ({"params": {"sbvh": {"nope": 1.0}}}, "builder 'sbvh' has no parameter 'nope'"),
    ],
)
def test_bad_choices_are_named(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Plan(**changes).check(core.builders(), core.devices())


def test_parameter_out_of_range_is_named() -> None:
    sbvh = next(builder for builder in core.builders() if builder["id"] == "sbvh")
    parameter = sbvh["parameters"][0]
    plan = Plan(params={"sbvh": {parameter["name"]: 2.0 * parameter["maximum"] + 1.0}})
    with pytest.raises(ValueError, match=f"sbvh.{parameter['name']} is .*; it must be from"):
        plan.check(core.builders(), core.devices())


plans = st.builds(
    Plan,
    builders=st.lists(st.text()),
    branchings=st.lists(st.integers()),
    reorders=st.lists(st.text()),
    layouts=st.lists(st.text()),
    triangle_tests=st.lists(st.text()),
    params=st.dictionaries(
        st.text(), st.dictionaries(st.text(), st.floats(allow_nan=False, allow_infinity=False))
    ),
    views=st.integers() | st.lists(st.text()),
    pictures=st.booleans(),
    seed=st.integers(),
    traversal=st.floats(allow_nan=False, allow_infinity=False),
)


@given(plans)
def test_json_gives_the_same_plan(plan: Plan) -> None:
    assert Plan.from_json(plan.to_json()) == plan


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"colour": 1}', "Plan has no field 'colour'"),
        ('{"builders": "sah"}', "Plan.builders must be a list"),
        ('{"branchings": [2, "4"]}', r"Plan.branchings\[1\] must be of type int"),
        ('{"views": 1.5}', "Plan.views must be"),
        ("[]", "Plan must be an object"),
    ],
)
def test_bad_json_is_named(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Plan.from_json(text)


def test_arguments_change_the_preset() -> None:
    plan = plan_of(
        *[
            "--preset",
            "paper",
            "--builders",
            "sah",
            "--branching",
            "8,2",
            "--views",
            "2",
            "--samples",
            "7",
        ],
        *[
            "--reorder",
            "off,origin",
            "--no-embree",
            "--depth",
            "3",
            "--shadow-rays",
            "1",
            "--param",
            "sbvh.alpha=1e-4",
            "--threads",
            "1",
        ],
    )
    assert (plan.width, plan.builders, plan.branchings) == (1024, ["sah"], [8, 2])
    assert (plan.views, plan.samples, plan.reorders) == (2, 7, ["off", "origin"])
    assert (plan.depth, plan.shadow_rays) == (3, 1)
    assert (plan.embree, plan.pictures, plan.threads) == (False, True, 1)
    assert plan.params["sbvh"] == {"max_references": UNLIMITED_REFERENCES, "alpha": 1e-4}


def test_arguments_choose_precision() -> None:
    plan = plan_of("--layouts", "cwbvh", "--triangle-tests", "all", "--box-tests", "plain")
    assert plan.layouts == ["cwbvh"] and plan.box_tests == ["plain"]
    assert plan.triangle_tests == list(TRIANGLE_TESTS)
    plan = plan_of(
        "--preset", "paper", "--layouts", "all", "--box-tests", "all", "--builders", "all"
    )
    assert (plan.layouts, plan.box_tests) == (list(LAYOUTS), list(BOX_TESTS))
    assert plan.builders == list(BUILDERS)


def test_arguments_name_views_and_resolutions() -> None:
    assert plan_of("--views", "Nave, Door").views == ["Nave", "Door"]
    plan = plan_of("--preset", "paper", "--resolution", "640x480")
    assert (plan.width, plan.height) == (640, 480)
    plan = plan_of("--preset", "paper", "--resolution", "320")
    assert (plan.width, plan.height, plan.long_side) == (0, 0, 320)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--branching two", "--branching: 'two' is not a whole number"),
        ("--branching 3", "branching 3 is not known"),
        ("--layouts small", "unknown layout 'small'; there are: full, cwbvh"),
        ("--triangle-tests ,", "triangle_tests is empty"),
        ("--layouts cwbvh --branching 4", "layout cwbvh is 8-wide"),
        ("--resolution 5x5x5", "--resolution is like 512x384"),
        ("--resolution 0x64", "--resolution is like 512x384"),
        ("--param alpha=1", "--param is like sbvh.alpha=1e-5"),
        ("--param sbvh.alpha=much", "--param is like sbvh.alpha=1e-5"),
        ("--builders ,", "builders is empty"),
    ],
)
def test_bad_arguments_are_named(words: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        plan_of(*words.split())
