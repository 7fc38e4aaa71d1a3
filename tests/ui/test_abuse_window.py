# SPDX-License-Identifier: GPL-3.0-or-later
"""Undo, deletions, other files, the end of the add-on and of Blender, in the middle of work."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
from window import what_blender_saw

QUIT_SECONDS = 30.0  # a hang would last for hours


def folder(name: str, factory: pytest.TempPathFactory) -> Path:
    shots = os.environ.get("BVHLAB_SCREENSHOTS")
    return Path(shots, name) if shots else factory.mktemp(name)


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict:
    """What the script saw in two Blenders."""
    found: dict = {}
    for part in ("compare", "render"):
        place = folder(f"abuse_{part}", tmp_path_factory)
        found |= what_blender_saw("abuse_in_blender.py", place, 640, 480, words=[part])
    return found


def test_undo_and_redo_change_nothing(seen: dict) -> None:
    assert [seen[f"runs_after_undo_{number}"] for number in range(3)] == [True] * 3
    assert seen["rows_after_undo"] == seen["rows_after_later_undo"] >= 2


def test_data_may_go_once_they_are_read(seen: dict) -> None:
    assert seen["runs_after_delete"]
    assert seen["blocks_left"] == 0
    assert seen["rows_after_delete"] >= 2


def test_results_belong_to_their_scene(seen: dict) -> None:
    assert seen["rows_of_other_scene"] == seen["rows_of_new_scene"] == 0
    assert seen["studies_of_deleted"] == 0
    assert seen["rows_of_second"] == seen["rows_of_renamed"] >= 2


def test_it_ends_with_its_window(seen: dict) -> None:
    assert not seen["runs_after_close"]


def test_nothing_is_left_of_an_opened_file(seen: dict) -> None:
    assert not seen["runs_after_load"]


def test_add_on_comes_and_goes(seen: dict) -> None:
    assert seen["left_after_disable"] == []


def test_render_and_viewport_survive(seen: dict) -> None:
    assert seen["survived"] == ["undo", "delete", "scene", "load"]
    assert seen["threads_after_load"] == []


@pytest.mark.parametrize("work", ["compare", "render viewport"])
def test_quit(work: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Blender ends with 0, and at once."""
    place = folder(f"quit_{work.split()[0]}", tmp_path_factory)
    seen = what_blender_saw("quit_in_blender.py", place, 500, 400, words=work.split())
    assert time.time() - seen["quits_at"] < QUIT_SECONDS
