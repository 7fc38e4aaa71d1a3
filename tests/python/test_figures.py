# SPDX-License-Identifier: GPL-3.0-or-later
"""The study's figures: they are drawn, show what they were given, and say what they cannot do."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from bvh_lab.study.cost_points import ScenePoint
from bvh_lab.study.figure_style import BUILDER_COLORS, display
from bvh_lab.study.figures import (
    FigureError,
    SceneViews,
    build_against_speed,
    build_points,
    contact_sheet,
    cost_against_time,
    error_against_time,
    residual_figure,
)
from bvh_lab.study.image_error import Curve, Point
from bvh_lab.study.paper_tables import Build, Measured, Trace
from bvh_lab.study.plan import BUILDERS
from bvh_lab.study.precision_figure import speed_against_error
from bvh_lab.study.precision_points import PrecisionPoint
from PIL import Image


def check_drawn(stem: Path, *words: str) -> str:
    """Both files are there, and nothing else; returns the SVG."""
    svg = stem.with_suffix(".svg").read_text()
    assert sorted(p.name for p in stem.parent.iterdir()) == [f"{stem.name}.png", f"{stem.name}.svg"]
    with Image.open(stem.with_suffix(".png")) as picture:
        assert picture.width == 1400  # 7 inches of 200 dots
        assert np.asarray(picture.convert("L")).std() > 5.0
    for word in words:  # matplotlib draws text as outlines and leaves it in comments
        assert f"<!-- {word} -->" in svg
    return svg


def cost_points(builders: tuple[str, ...], branchings: tuple[int, ...]) -> list[ScenePoint]:
    return [
        ScenePoint("box", kind, reordered, builder, builder.upper(), branching, cost, 0.5 * cost)
        for kind in ("primary", "secondary", "shadow")
        for reordered in ((False,) if kind == "primary" else (False, True))
        for branching in branchings
        for cost, builder in zip((1.0, 0.8, 0.7), builders, strict=False)
    ]


def test_every_builder_has_a_colour_of_its_own() -> None:
    assert list(BUILDER_COLORS) == list(BUILDERS)
    assert len(set(BUILDER_COLORS.values())) == len(BUILDERS)


def test_figure_1(tmp_path: Path) -> None:
    cost_against_time(cost_points(("lbvh", "ploc", "sah"), (2, 8)), tmp_path / "f")
    words = ("primary rays", "secondary rays", "shadow rays, reordered", "LBVH", "8-wide")
    svg = check_drawn(tmp_path / "f", *words)
    assert "primary rays, reordered" not in svg
    assert len(re.findall(r"<!--\s+Pearson\s+Spearman", svg)) == 5
    assert len(re.findall(r"2-wide +1\.00 +1\.00", svg)) == 5


def test_figure_1_of_one_builder_has_no_coefficient(tmp_path: Path) -> None:
    cost_against_time(cost_points(("lbvh",), (2,)), tmp_path / "f")
    assert re.search(r"2-wide +– +–", check_drawn(tmp_path / "f"))


def test_build_points_are_relative_to_lbvh() -> None:
    measured = Measured(
        [
            Trace(scene, "1", builder, branching, False, "shadow", 1.0, speed * branching)
            for scene in ("a", "b")
            for builder, speed in (("lbvh", 1.0), ("sah", 3.0))
            for branching in (2, 4)
        ],
        [
            Build("a", "lbvh", 0.5),
            Build("a", "sah", 2.0),
            Build("b", "lbvh", 1.0),
            Build("b", "sah", 8.0),
        ],
        {"lbvh": "LBVH", "sah": "SAH"},
    )
    points = {(p.builder, p.branching): p for p in build_points(measured, "shadow")}
    assert points["lbvh", 2].speed == (1.0, 1.0, 1.0)
    assert points["sah", 4].speed == (6.0, 6.0, 6.0)
    assert points["sah", 4].build == (4.0, 6.0, 8.0)
    assert build_points(measured, "secondary") == []


def test_build_figure(tmp_path: Path) -> None:
    traces = [Trace("a", "1", b, 2, False, "shadow", 1.0, 1.0) for b in ("lbvh", "sah")]
    builds = [Build("a", "lbvh", 0.5), Build("a", "sah", 2.0)]
    points = build_points(Measured(traces, builds, {"lbvh": "LBVH", "sah": "SAH"}), "shadow")
    build_against_speed(points, tmp_path / "f", "shadow")
    check_drawn(tmp_path / "f", "SAH", "2-wide")


def curve(name: str, system: str = "bvh_lab") -> Curve:
    points = [Point(n, [0.1 * n, 0.11 * n], {"relMSE": 0.5 / n}) for n in (1, 2, 4, 8)]
    return Curve(name, name, system, "sah", 8, points=points)


def test_error_curves(tmp_path: Path) -> None:
    curves = [curve("SAH 8-wide"), curve("Cycles", "cycles")]
    error_against_time(curves, tmp_path / "f", "box, camera one", reference_error=0.02)
    words = ("SAH 8-wide", "Cycles", "box, camera one", "relMSE 0.01", "the reference's own error")
    check_drawn(tmp_path / "f", *words)


def test_same_figure_same_file(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        error_against_time([curve("SAH")], tmp_path / name / "f", "box")
    for suffix in (".svg", ".png"):
        first, second = (tmp_path / name / f"f{suffix}" for name in ("a", "b"))
        assert first.read_bytes() == second.read_bytes()


def test_contact_sheet(tmp_path: Path) -> None:
    views = [(name, np.full((30, 40, 3), i / 3, np.float32)) for i, name in enumerate("abc")]
    scenes = [SceneViews("box", 12, views), SceneViews("city", 553668, views[:2])]
    contact_sheet(scenes, tmp_path / "f")
    check_drawn(tmp_path / "f", "box, 12 triangles", "city, 553,668 triangles", "b")


def test_residual(tmp_path: Path) -> None:
    picture = np.random.default_rng(0).random((30, 40, 3), np.float32)
    residual = picture[..., 0] - 0.5
    residual_figure(("Ours", picture), ("Cycles", picture), residual, tmp_path / "f", "box", 0.1)
    check_drawn(tmp_path / "f", "Ours", "Cycles", "box")


def test_display_is_srgb_and_shows_what_is_broken() -> None:
    row = [[0.0, 0.5, 1.0], [2.0, -1.0, 0.001], [np.nan, 0.5, 0.5]]
    shown = display(np.array([row], np.float32))
    assert shown.tolist() == [[[0, 188, 255], [255, 0, 3], [255, 0, 255]]]


@pytest.mark.parametrize(
    "draw",
    [
        lambda stem: cost_against_time([], stem),
        lambda stem: build_against_speed([], stem, "shadow"),
        lambda stem: error_against_time([Curve("a", "a")], stem, "box"),
        lambda stem: contact_sheet([SceneViews("box", 12, [])], stem),
    ],
)
def test_nothing_to_draw_is_said(draw, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="at least one"):
        draw(tmp_path / "f")
    assert list(tmp_path.iterdir()) == []


def test_missing_matplotlib_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(FigureError, match="pip install matplotlib"):
        error_against_time([curve("SAH")], tmp_path / "f", "box")


def test_speed_against_error(tmp_path: Path) -> None:
    points = [
        PrecisionPoint(
            *(layout, triangle_test, box_test, 2, speed, 0.9 * speed, 1.1 * speed, 200_000, wrong),
            *(0.25, 0.5, 0.5 if triangle_test == "watertight" else 3000.0),
        )
        for layout, slower in (("full", 1.0), ("cwbvh", 0.8))
        for triangle_test, speed, wrong in (("watertight", slower, 0), ("woop_affine", 1.4, 31))
        for box_test in ("conservative", "plain")
    ]
    speed_against_error(points, tmp_path / "f", "box")
    words = ("watertight", "Woop affine", "plain boxes", "compressed nodes", "none", "0.01%")
    svg = check_drawn(tmp_path / "f", "box", "wrong answers, of 200,000 rays", *words)
    assert "Baldwin-Weber" not in svg


def test_speed_against_error_needs_two_choices(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="at least two choices"):
        speed_against_error([], tmp_path / "f", "box")
