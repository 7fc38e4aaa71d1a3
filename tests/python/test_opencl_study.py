# SPDX-License-Identifier: GPL-3.0-or-later
"""Studies with several devices: one table, the same answers, failures that stay in their row."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bvh_lab import cli
from bvh_lab.native import core
from bvh_lab.study import run
from bvh_lab.study.devices import known_as, labels, named, resolved, short_name
from bvh_lab.study.plan import Plan
from bvh_lab.study.report import write_report
from bvh_lab.study.results import KINDS, Result
from bvh_lab.study.run import Study, compare
from bvh_lab.study.table import failures, text_report
from opencl_support import first_device
from study_samples import grid_of_boxes, sample_scene, small_plan


def entry(name: str, available: bool = True, is_gpu: bool = False) -> dict[str, Any]:
    reason = "" if available else f"{name} is broken"
    return {"id": name, "available": available, "is_gpu": is_gpu, "reason": reason}


LISTED = [
    entry("cpu"),
    entry("opencl:a/broken", available=False, is_gpu=True),
    entry("opencl:a/processor"),
    entry("opencl:b/card", is_gpu=True),
]


def test_opencl_stands_for_the_first_device_graphics_cards_before_others() -> None:
    assert resolved(["cpu", "opencl"], LISTED) == ["cpu", "opencl:b/card"]
    assert resolved(["opencl", "opencl:b/card"], LISTED) == ["opencl:b/card"]
    assert resolved(["opencl"], LISTED[:3]) == ["opencl:a/processor"]
    with pytest.raises(ValueError, match="'opencl' cannot be used: opencl:a/broken is broken"):
        resolved(["opencl"], LISTED[:2])
    with pytest.raises(ValueError, match=r"'opencl:a/broken' cannot be used: .* is broken"):
        resolved(["opencl:a/broken"], LISTED)
    with pytest.raises(ValueError, match=r"there are: cpu, opencl:a/processor, opencl:b/card$"):
        resolved(["opencl:c"], LISTED)
    with pytest.raises(ValueError, match="unknown device 'opencl'; there are: cpu"):
        resolved(["opencl"], LISTED[:1])


def test_the_core_takes_opencl_for_the_same_device() -> None:
    (full,) = resolved(["opencl"], core.devices())
    assert full == first_device()
    mesh = core.Mesh(*grid_of_boxes(1))
    assert core.build(mesh, "lbvh", device="opencl").device == full


def test_names_may_hold_commas() -> None:
    assert named("cpu") == ["cpu"]
    assert named("opencl, cpu") == ["opencl", "cpu"]
    assert named("cpu,opencl:Clover/AMD (DRM 3, LLVM 15),opencl:x/y") == [
        "cpu",
        "opencl:Clover/AMD (DRM 3, LLVM 15)",
        "opencl:x/y",
    ]


def test_short_names_tell_devices_apart() -> None:
    assert short_name("cpu") == "cpu" and short_name("opencl:a/b/c") == "b/c"
    assert labels(["cpu", "opencl:a/x", "opencl:b/y"]) == {
        "cpu": "cpu",
        "opencl:a/x": "x",
        "opencl:b/y": "y",
    }
    assert labels(["opencl:a/x", "opencl:b/x"]) == {d: d for d in ("opencl:a/x", "opencl:b/x")}


@pytest.mark.parametrize(
    ("device", "name"),
    [
        ("Portable Computing Language/pthread-skylake-Intel(R) Xeon(R) @ 2.50GHz", "PoCL pthread"),
        ("Portable Computing Language/cpu-znver3-AMD EPYC 7713 #2", "PoCL cpu #2"),
        ("NVIDIA CUDA/NVIDIA H100 80GB HBM3", "NVIDIA H100 80GB HBM3"),
        ("NVIDIA CUDA/NVIDIA H100 80GB HBM3 #3", "NVIDIA H100 80GB HBM3 #3"),
        ("Intel(R) OpenCL/Intel(R) Core(TM) i7-8700 CPU @ 3.20GHz", "Intel Core i7-8700"),
        ("Clover/AMD Radeon RX 6800 XT (navi21, LLVM 15, DRM 3.49)", "AMD Radeon RX 6800 XT"),
        ("a/An accelerator whose name does not want to end", "An accelerator whose name …"),
        ("a/(nothing else)", "(nothing else)"),
    ],
)
def test_long_names_are_shortened_and_known_by_their_ids(device: str, name: str) -> None:
    assert short_name(f"opencl:{device}") == name
    assert known_as(f"opencl:{device}") == f"{name} (opencl:{device})"
    assert known_as("cpu") == "cpu"


# --- studies -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def study() -> Study:
    plan = small_plan(
        devices=["cpu", "opencl"], reorders=["off", "aila"], layouts=["full", "cwbvh"]
    )
    return compare(sample_scene(), plan, host="pytest")


def test_every_device_has_the_same_rows_with_the_same_answers(study: Study) -> None:
    result, full = study.result, first_device()
    assert result.plan.devices == ["cpu", full] and not result.failed()
    assert result.reference == "lbvh_2"
    by_place: dict[tuple[Any, ...], list[Any]] = {}
    for row in result.rows:
        if row.system == "bvh_lab":
            place = (row.builder, row.branching, row.layout, row.reorder)
            by_place.setdefault(place, []).append(row)
    assert len(by_place) == 2 * 3 * 2  # builders, shapes, orders of rays
    for rows in by_place.values():
        cpu, ours = rows
        assert (cpu.device, ours.device) == ("cpu", full)
        assert ours.tree.sha256 == cpu.tree.sha256 != ""
        assert ours.tree_device == ("cpu" if ours.builder == "sah" else full)
        assert ours.differing_rays() == 0 and ours.errors().wrong == 0
        assert [m.hits_sha256 for m in ours.measurements] == [
            m.hits_sha256 for m in cpu.measurements
        ]
        assert ours.shape and not cpu.shape
        assert ours.kernel_seconds and ours.transfer_seconds > 0.0
        assert len(ours.build_seconds) == study.result.plan.build_repeats
        for kind in KINDS:
            assert ours.speed(kind)
        assert all(seconds > 0.0 for m in ours.measurements for seconds in m.transfer_seconds)
        assert len(ours.pictures) == len(cpu.pictures) > 0
        assert ours.picture_difference() == cpu.picture_difference() == 0.0


def test_all_outputs_show_the_device(study: Study, tmp_path: Path) -> None:
    result, full = study.result, first_device()
    text = text_report(result)
    assert f"Device {known_as(full)}: " in text and "driver" in text
    assert text.count(full) == 1  # else by its short name, so that tables stay narrow
    assert "by the device's own clock" in text
    assert "those of the cpu, byte for byte" in text
    assert f"{short_name(full)}'s differs from" in text or "cpu's, bit for bit" in text
    assert "SAH are made by the CPU core" in text
    assert Result.from_json(result.to_json()) == result
    write_report(result, {}, tmp_path / "report")
    page = (tmp_path / "report" / "index.html").read_text()
    assert f"<dt>Device {short_name(full)}</dt><dd>{full}: " in page
    for name in ("results.csv", "rays.csv"):
        lines = list(csv.DictReader(io.StringIO((tmp_path / "report" / name).read_text())))
        assert {line["device"] for line in lines} >= {"cpu", full}
    by_id = {device["id"]: device for device in result.machine.devices}
    assert by_id[full]["driver"] and by_id[full]["platform"]


def test_one_device_alone_is_held_to_the_cpu(study: Study) -> None:
    plan = small_plan(devices=[first_device()], builders=["lbvh"], branchings=[2], embree=False)
    result = compare(sample_scene(), plan).result
    (row,) = result.rows
    assert not row.error and row.differing_rays() == 0
    (other,) = (
        r
        for r in study.result.rows
        if (r.builder, r.branching, r.device, r.reorder) == ("lbvh", 2, "cpu", "off")
    )
    assert [m.hits_sha256 for m in row.measurements] == [m.hits_sha256 for m in other.measurements]


class Broken:
    """The real core on which a call with the OpenCL device fails."""

    def __init__(self, name: str, error: BaseException, after: int = 0) -> None:
        self.name, self.error, self.left = name, error, after

    def __getattr__(self, name: str) -> Any:
        call = getattr(core, name)
        return self._failing(call) if name == self.name else call

    def _failing(self, call: Callable[..., Any]) -> Callable[..., Any]:
        def wrapped(*args: Any, **kwargs: Any) -> Any:
            if kwargs.get("device", "cpu") != "cpu":
                self.left -= 1
                if self.left < 0:
                    raise self.error
            return call(*args, **kwargs)

        return wrapped


@pytest.mark.parametrize(
    ("name", "after", "error"),
    [
        ("build_tree", 0, RuntimeError("the kernels of lbvh.cl do not compile on device 'x'")),
        ("build_tree", 1, MemoryError("LBVH does not fit: 9 MiB are needed")),
        ("trace", 0, RuntimeError("kernel 'closest_hit' on device 'x': CL_OUT_OF_RESOURCES")),
        ("trace", 7, RuntimeError("waiting for device 'x': CL_OUT_OF_RESOURCES")),
    ],
)
def test_a_device_that_fails_leaves_its_reason_and_the_study_goes_on(
    monkeypatch: pytest.MonkeyPatch, name: str, after: int, error: BaseException
) -> None:
    monkeypatch.setattr(run, "load", lambda: Broken(name, error, after))
    plan = small_plan(
        devices=[first_device(), "cpu"], builders=["lbvh"], branchings=[2], embree=False
    )
    result = compare(sample_scene(), plan).result
    ours, cpu = result.rows
    assert ours.error == str(error) and not cpu.error
    assert all(cpu.speed(kind) for kind in KINDS)
    assert result.failed() == [ours]
    (line,) = failures(result)
    assert short_name(first_device()) in line and str(error) in line


def test_tests_to_compare_with_have_rows_of_the_cpu_only() -> None:
    plan = Plan(
        builders=["lbvh"],
        branchings=[4],
        devices=["cpu", first_device()],
        triangle_tests=["watertight", "woop_affine"],
    )
    assert [(v.device == "cpu", v.triangle_test) for v in plan.variants()] == [
        (True, "watertight"),
        (False, "watertight"),
        (True, "woop_affine"),
    ]


def test_the_command_line_takes_devices(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vertices, triangles = grid_of_boxes(2)
    np.savez(tmp_path / "boxes.npz", vertices=vertices, triangles=triangles)
    words = ["compare", str(tmp_path / "boxes.npz"), "--device", "cpu,opencl", "--json", "-"]
    words += ["--builders", "lbvh", "--branching", "2", "--views", "1", "--resolution", "32"]
    words += ["--ray-resolution", "0", "--repeats", "3", "--build-repeats", "1", "--no-embree"]
    assert cli.main(words) == 0
    result = Result.from_json(capsys.readouterr().out)
    assert [row.device for row in result.rows] == ["cpu", first_device()]
    assert cli.main([*words, "--device", "opencl:no/thing"]) == 2
    said = capsys.readouterr().err
    assert "unknown device 'opencl:no/thing'; there are: cpu, " in said and first_device() in said
