# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine as a user meets it: F12, ESC and the rendered viewport, under Xvfb."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from window import what_blender_saw

WIDTH, HEIGHT = 720, 540
VIEWS = ("4_viewport", "5_turned", "6_moved", "7_hidden", "8_camera")


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict:
    """What the script saw; its folder, with the screenshots, stands under "folder"."""
    shots = os.environ.get("BVHLAB_SCREENSHOTS")
    folder = Path(shots, "engine") if shots else tmp_path_factory.mktemp("engine")
    return what_blender_saw("engine_in_blender.py", folder, WIDTH, HEIGHT)


def picture(seen: dict, name: str) -> np.ndarray:
    """The 3D viewport in a screenshot, without the buttons on its sides."""
    left, bottom, width, height = seen["region"]
    image = Image.open(seen["folder"] / f"{name}.png").convert("RGB")
    pixels = np.asarray(image).astype(int)[HEIGHT - bottom - height : HEIGHT - bottom]
    return pixels[:, left + 60 : left + width - 60]


def test_escape_stops_the_render_and_keeps_the_picture(seen: dict) -> None:
    assert seen["seconds_to_stop"] < 5.0
    assert seen["threads_after_stop"] == []
    for name in ("1_rendering", "2_stopped", "3_rendered"):
        shown = picture(seen, name)
        assert ((shown[..., 0] > 100) & (shown[..., 1] < 90)).sum() > 1000, f"no red in {name}"


def test_add_on_goes_while_it_renders(seen: dict) -> None:
    assert not seen["at_work_after_unregister"]


def test_viewport_shows_each_change(seen: dict) -> None:
    pictures = [picture(seen, name) for name in VIEWS]
    for name, shown in zip(VIEWS, pictures, strict=True):
        assert shown.std() > 3.0, f"{name} is flat"
    for name, last, shown in zip(VIEWS[1:], pictures[:-1], pictures[1:], strict=True):
        assert (np.abs(shown - last).max(axis=2) > 20).sum() > 200, f"{name} is as before"


def test_a_selection_is_no_change(seen: dict) -> None:
    assert not seen["read_again_for_a_selection"]


def test_no_thread_is_left(seen: dict) -> None:
    assert seen["threads_after_unregister"] == []
