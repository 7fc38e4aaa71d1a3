# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel as a user meets it: in a window, under Xvfb, driven by mouse and keyboard."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from window import what_blender_saw

# Every builder but those that take minutes on a scene of usual size.
SWITCHED_ON = (
    "lbvh",
    "hlbvh",
    "ploc",
    "atrbvh",
    "prbvh",
    "prbvh_s",
    "sah",
    "sbvh",
    "trbvh",
    "hybrid",
)


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict:
    """What the script saw; its folder, with the screenshots, stands under "folder"."""
    folder = Path(os.environ.get("BVHLAB_SCREENSHOTS") or tmp_path_factory.mktemp("panel"))
    return what_blender_saw("panel_in_blender.py", folder, 1280, 900, "--enable-event-simulate")


def test_progress_while_it_runs(seen: dict) -> None:
    assert 0.0 < seen["progress"] < 1.0


def test_escape_stops_and_keeps_rows(seen: dict) -> None:
    assert seen["cancelled"]
    assert seen["rows_kept"] >= 2
    assert seen["seconds_to_stop"] < 5.0


def test_table_holds_every_variant(seen: dict) -> None:
    widths = ("2", "4", "8", "8_cwbvh")
    ours = [f"{builder}_{width}" for builder in SWITCHED_ON for width in widths]
    assert [name for name in seen["rows"] if not name.startswith("embree")] == ours
    assert seen["failures"] == []


def test_render_geometry_with_a_window(seen: dict) -> None:
    assert seen["geometry"] == "render"
    assert seen["scenes_left_over"] == 0


def test_winner_is_said_with_its_error(seen: dict) -> None:
    assert seen["said"][0].startswith("Fastest: ")
    assert "wrong hits of" in seen["said"][0]


def test_precision_is_chosen_in_the_panel(seen: dict) -> None:
    assert seen["precise_variants"] == 2 * 4 * 2  # two layouts, four triangle and two box tests
    assert len(seen["precise_rows"]) == 16 and seen["precise_failures"] == []
    assert seen["precise_titles"][:3] == ["LBVH 8", "LBVH 8 plain", "LBVH 8 MT"]
    assert seen["precise_titles"][-1] == "LBVH 8c BW plain"
    assert seen["precise_pictured"] == ["lbvh_8", "lbvh_8_cwbvh"]


def test_picture_is_in_the_image_editor(seen: dict) -> None:
    name, width, height = seen["image"]
    assert name == "BVH Lab Camera"
    assert max(width, height) == 128


def test_screenshots(seen: dict) -> None:
    pictures = sorted(path.name for path in seen["folder"].glob("*.png"))
    assert [name[0] for name in pictures] == ["1", "2", "3", "4", "5", "6", "7"]
