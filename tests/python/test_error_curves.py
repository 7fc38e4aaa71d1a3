# SPDX-License-Identifier: GPL-3.0-or-later
"""Error against time, the converged reference with its cache, and agreement of two renderers."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bvh_lab.native import core
from bvh_lab.study import reference_picture as references
from bvh_lab.study.agreement import BLOCK, agreement, block_means
from bvh_lab.study.core_scene import core_scene
from bvh_lab.study.image_error import (
    Contestant,
    Curve,
    Point,
    crossing,
    curves_csv,
    curves_table,
    doubling,
    measure_curves,
    noise_note,
    our_contestant,
)
from bvh_lab.study.rays import View, choose_views
from bvh_lab.study.reference_picture import ReferencePicture, combine, reference_picture
from bvh_lab.study.scene import Scene
from study_samples import sample_scene, small_plan

SETTINGS = {"seed": 3, "depth": 2, "shadow_rays": 1, "threads": 2}


@dataclass
class Ready:
    """A scene that can be rendered at once."""

    scene: Scene
    core_scene: Any
    view: View
    mesh: Any
    bvh: Any

    def reference(
        self, folder: Path, samples: int = 8, token: Any = None, **changes: Any
    ) -> ReferencePicture:
        return reference_picture(
            core,
            self.bvh,
            self.scene,
            self.core_scene,
            self.view,
            samples,
            SETTINGS | changes,
            token,
            folder=folder,
        )


def ready(**changes: Any) -> Ready:
    scene = sample_scene(**changes)
    mesh = core.Mesh(scene.vertices, scene.triangles)
    view = choose_views(core, scene, small_plan(long_side=32))[0]
    return Ready(
        scene, core_scene(core, mesh, scene)[0], view, mesh, core.build(mesh, "sah", branching=8)
    )


# --- time to an error ----------------------------------------------------------------------------


def test_crossing_is_interpolated_on_log_axes() -> None:
    points = [(1.0, 0.4), (2.0, 0.1), (8.0, 0.001)]
    assert crossing(points, 0.1) == 2.0
    assert crossing(points, 0.01) == pytest.approx(4.0)  # halfway: 0.1 to 0.001, 2 to 8 seconds
    assert crossing(points, 0.2) == pytest.approx(math.sqrt(2.0))
    assert crossing(points, 0.001) == pytest.approx(8.0)


def test_crossing_not_reached_or_at_once() -> None:
    assert crossing([], 0.1) is None
    assert crossing([(1.0, 0.4), (2.0, 0.2)], 0.1) is None
    assert crossing([(1.0, 0.4), (2.0, math.nan)], 0.1) is None
    assert crossing([(1.0, 0.05), (2.0, 0.02)], 0.1) == 1.0
    assert crossing([(1.0, math.inf), (2.0, 0.02)], 0.1) == 2.0
    assert crossing([(1.0, 0.4), (2.0, 0.0)], 0.1) == 2.0


def test_crossing_is_for_good() -> None:
    assert crossing([(1.0, 0.05), (2.0, 0.2), (4.0, 0.05)], 0.1) == pytest.approx(math.sqrt(8.0))


def test_doubling() -> None:
    assert doubling(1) == [1]
    assert doubling(16) == [1, 2, 4, 8, 16]
    assert doubling(20) == [1, 2, 4, 8, 16, 20]


# --- curves --------------------------------------------------------------------------------------


def scripted(name: str, log: list[str], seconds: float) -> Contestant:
    """A renderer whose pictures are 1 + 1 / samples."""

    def start() -> tuple[Callable[[int], float], Callable[[], np.ndarray]]:
        log.append(name)
        done = 0

        def render(samples: int) -> float:
            nonlocal done
            done += samples
            return seconds * samples

        return render, lambda: np.full((8, 8, 3), 1.0 + 1.0 / done, np.float32)

    return Contestant(Curve(name, name, points=[]), start)


def test_repeats_take_turns_and_seconds_add_up() -> None:
    log: list[str] = []
    both = [scripted("a", log, 0.5), scripted("b", log, 0.25)]
    measure_curves(core, both, np.ones((8, 8, 3), np.float32), doubling(4), 3)
    assert log == ["a", "b", "b", "a", "a", "b"]
    points = both[0].curve.points
    assert [point.samples for point in points] == [1, 2, 4]
    assert [point.seconds for point in points] == [[0.5] * 3, [1.0] * 3, [2.0] * 3]
    errors = [point.errors["relMSE"] for point in points]
    assert errors == pytest.approx([1.0 / 1.01, 0.25 / 1.01, 0.0625 / 1.01], rel=1e-5)
    assert both[0].curve.samples_per_second() == 2.0
    assert both[1].curve.time_to_error(0.25 / 1.01) == pytest.approx(0.5, rel=1e-4)
    assert both[1].curve.time_to_error(1e-6) is None


def test_curve_ends_where_it_is_good_enough() -> None:
    contestant = scripted("a", [], 1.0)
    measure_curves(core, [contestant], np.ones((8, 8, 3), np.float32), doubling(64), 2, enough=0.1)
    assert [point.samples for point in contestant.curve.points] == [1, 2, 4]
    assert [len(point.seconds) for point in contestant.curve.points] == [2, 2, 2]


def test_curves_of_our_trees_differ_in_time_alone(tmp_path: Path) -> None:
    here = ready()
    reference = here.reference(tmp_path, samples=128)
    contestants = [
        our_contestant(
            core,
            Curve(name, name, builder=name, branching=2),
            core.build(here.mesh, name),
            here.core_scene,
            here.view,
            SETTINGS,
            core.Token(),
        )
        for name in ("lbvh", "sah")
    ]
    measure_curves(core, contestants, reference.pixels, doubling(16), 2)
    first, second = (contestant.curve.points for contestant in contestants)
    assert [point.errors for point in first] == [point.errors for point in second]
    errors = [point.errors["relMSE"] for point in first]
    assert errors[::2] == sorted(errors[::2], reverse=True)  # one doubling may be unlucky
    assert errors[0] > 4.0 * errors[-1] > 0.0
    for point, before in zip(first[1:], first, strict=False):
        assert all(a > b > 0.0 for a, b in zip(point.seconds, before.seconds, strict=True))


def test_table_and_csv() -> None:
    errors = {"relMSE": 0.5, "MAE": 0.1, "RMSE": 0.2, "PSNR": 20.0, "FLIP": 0.1, "bias": 0.0}
    points = [Point(1, [0.2, 0.4], errors), Point(64, [3.0, 5.0], errors | {"relMSE": 0.005})]
    curve = Curve("sah_8", "SAH 8-wide", builder="sah", branching=8, points=points)
    late = replace(curve, label="Late", points=points[:1])
    heading, row, other = curves_table([curve, late])
    assert len(heading) == len(row) == len(other)
    assert "not reached" in other
    assert f"{curve.time_to_error():.3g} s" in row
    lines = list(csv.DictReader(io.StringIO(curves_csv([curve]))))
    assert [line["samples"] for line in lines] == ["1", "64"]
    assert float(lines[1]["seconds"]) == 4.0
    assert float(lines[1]["seconds_low"]) == 3.5
    assert float(lines[1]["relMSE"]) == 0.005


# --- the reference -------------------------------------------------------------------------------


def test_error_of_a_mean_is_that_of_its_halves() -> None:
    random = np.random.default_rng(1)
    truth = np.full((100, 100, 3), 2.0)
    halves = [(n, truth + random.normal(0.0, 0.2, truth.shape)) for n in (8, 8)]
    result = combine(halves)
    assert result.samples == 16
    actual = core.image_error(result.pixels, truth.astype(np.float32))["relMSE"]
    assert result.error == pytest.approx(actual, rel=0.05)
    assert result.error == pytest.approx(0.02 / 4.04, rel=0.05)
    assert noise_note(0.01, result.error)
    assert noise_note(0.1, result.error) == ""


def test_reference_is_kept_and_found_again(tmp_path: Path) -> None:
    here = ready()
    first, again = here.reference(tmp_path), here.reference(tmp_path, threads=1)
    assert not first.from_cache
    assert again.from_cache
    np.testing.assert_array_equal(first.pixels, again.pixels)
    np.testing.assert_array_equal(first.noise, again.noise)
    assert (first.samples, first.error, first.notes) == (again.samples, again.error, again.notes)
    assert [path.suffix for path in tmp_path.iterdir()] == [".npz"]


def test_reference_shares_no_noise_with_the_picture(tmp_path: Path) -> None:
    here = ready()
    own = core.render(
        here.bvh,
        here.core_scene,
        here.view.camera,
        here.view.width,
        here.view.height,
        8,
        **SETTINGS,
    )
    reference = here.reference(tmp_path, samples=16)
    halves = [reference.pixels + side * reference.noise for side in (1.0, -1.0)]
    assert not any(np.allclose(own.pixels, half, rtol=1e-3) for half in halves)


def test_another_picture_has_another_key(tmp_path: Path) -> None:
    here = ready()
    here.reference(tmp_path)
    brighter = replace(here.scene.lights[0], color=(301.0, 300.0, 300.0))
    materials = [here.scene.materials[1], here.scene.materials[0]]
    moved = here.scene.vertices.copy()
    moved[0, 0] += 1e-6
    others = [
        ready(lights=[brighter]),
        ready(materials=materials),
        ready(vertices=moved),
        ready(cameras=[replace(here.scene.cameras[0], clip_start=0.1)]),
    ]
    assert not any(other.reference(tmp_path).from_cache for other in others)
    for changes in ({"depth": 3}, {"seed": 4}, {"shadow_rays": 2}):
        assert not here.reference(tmp_path, **changes).from_cache
    assert not here.reference(tmp_path, samples=10).from_cache
    assert len(list(tmp_path.iterdir())) == 9
    assert ready(name="other", notes=[]).reference(tmp_path).from_cache


@pytest.mark.parametrize("damage", ["cut", "changed", "emptied", "other"])
def test_broken_cache_is_made_anew(damage: str, tmp_path: Path) -> None:
    here = ready()
    first = here.reference(tmp_path)
    (path,) = tmp_path.iterdir()
    content = path.read_bytes()
    middle = len(content) // 2
    if damage == "other":
        np.savez(path, pixels=np.zeros((2, 2, 3)), noise=np.zeros((2, 2, 3)), samples=8, error=0.0)
    else:
        path.write_bytes(
            {
                "cut": content[:middle],
                "changed": content[:middle] + b"oops" + content[middle + 4 :],
                "emptied": b"",
            }[damage]
        )
    again = here.reference(tmp_path)
    assert not again.from_cache
    assert str(path) in again.notes[0]
    np.testing.assert_array_equal(first.pixels, again.pixels)
    assert here.reference(tmp_path).from_cache


def test_cache_that_cannot_be_written_is_no_failure(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    result = ready().reference(tmp_path / "file" / "folder")
    assert result.pixels.any()
    assert "cannot be" in result.notes[-1]


def test_cache_folder_respects_xdg(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert references.cache_folder() == tmp_path / "bvh_lab" / "references"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert references.cache_folder() == Path.home() / ".cache" / "bvh_lab" / "references"


def test_oldest_pictures_go_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    here = ready()
    here.reference(tmp_path)
    (oldest,) = tmp_path.iterdir()
    monkeypatch.setattr(references, "MOST_BYTES", int(1.5 * oldest.stat().st_size))
    here.reference(tmp_path, depth=3)
    (kept,) = tmp_path.iterdir()
    assert kept != oldest


def test_cancelled_reference_leaves_no_file(tmp_path: Path) -> None:
    here, token = ready(), core.Token()
    token.cancel()
    with pytest.raises(core.Cancelled):
        reference_picture(
            core,
            here.bvh,
            here.scene,
            here.core_scene,
            here.view,
            8,
            SETTINGS,
            token,
            None,
            tmp_path,
        )
    assert list(tmp_path.iterdir()) == []


def test_key_refuses_what_it_cannot_tell_apart() -> None:
    with pytest.raises(TypeError, match="SimpleNamespace cannot be hashed"):
        references._feed(references.hashlib.sha256(), SimpleNamespace())


# --- agreement -----------------------------------------------------------------------------------


def converged(truth: np.ndarray, noise: float, seed: int) -> ReferencePicture:
    random = np.random.default_rng(seed)
    halves = [(8, truth + random.normal(0.0, noise, truth.shape)) for _ in range(2)]
    return combine(halves)


def test_equal_pictures_agree_but_for_noise() -> None:
    truth = np.full((96, 128, 3), 0.5)
    found = agreement(converged(truth, 0.1, 1), converged(truth, 0.1, 2))
    assert abs(found.mean) < 4.0 * found.mean_noise
    assert found.blocks == pytest.approx(found.blocks_noise, rel=0.3)
    assert found.structure < found.blocks_noise


def test_a_difference_of_the_mean_and_of_one_place_is_found() -> None:
    truth = np.full((96, 128, 3), 0.5)
    brighter = truth * 1.01
    found = agreement(converged(brighter, 0.01, 1), converged(truth, 0.01, 2))
    assert found.mean == pytest.approx(0.01, abs=4.0 * found.mean_noise)
    patch = truth.copy()
    patch[:BLOCK, :BLOCK] += 0.1
    found = agreement(converged(patch, 0.01, 1), converged(truth, 0.01, 2))
    blocks = (96 // BLOCK) * (128 // BLOCK)
    assert found.structure == pytest.approx(0.2 / math.sqrt(blocks), rel=0.02)
    assert "16x16" in found.sentence()


def test_block_means() -> None:
    values = np.arange(40.0 * 33.0).reshape(40, 33)
    means = block_means(values)
    assert means.shape == (2, 2)
    assert means[1, 0] == values[16:32, :16].mean()
    assert block_means(values[:3, :20]).tolist() == [[values[:3, :16].mean()]]
