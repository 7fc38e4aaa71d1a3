# SPDX-License-Identifier: GPL-3.0-or-later
"""The running comparison and the finished ones.

They live outside of Blender's data: undo re-creates that, and would lose or duplicate them.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from typing import Any

import bpy

from ..native import NativeMissing, load
from ..study.job import Job
from ..study.progress import RowChanged
from ..study.results import Row
from ..study.run import Study


@dataclass
class Running:
    """A job at work for one scene; ``rows`` are the freshest copies, by name, in order of start."""

    job: Job
    scene: str
    variants: int
    rows: dict[str, Row] = field(default_factory=dict)

    def poll(self) -> None:
        """Take in what the worker sent since the last call."""
        for event in self.job.poll():
            if isinstance(event, RowChanged):
                self.rows[event.row.name] = event.row


running: Running | None = None
studies: dict[str, Study] = {}


def scene_key(scene: bpy.types.Scene) -> str:
    """What names a scene for the length of a session; undo and renaming keep it.

    Before Blender 4.1 it is the address, which undo keeps too, unless it brings a deleted scene
    back. Another scene may get the address of a deleted one: see `forget_deleted`.
    """
    return str(getattr(scene, "session_uid", None) or scene.as_pointer())


def is_deleted(key: str) -> bool:
    """Whether no scene of the open file has this key."""
    return all(scene_key(scene) != key for scene in bpy.data.scenes)


def forget_deleted() -> None:
    """Drop the studies of scenes that are gone, before another scene gets their key."""
    for key in [key for key in studies if is_deleted(key)]:
        del studies[key]


def start(scene: bpy.types.Scene, job: Job, variants: int) -> Running:
    """Make ``job`` the running one."""
    global running
    running = Running(job, scene_key(scene), variants)
    return running


def finish() -> Study:
    """Wait for the running job's end and keep its study; raises what the study raised.

    Nothing is kept for a scene that was deleted meanwhile.
    """
    global running
    assert running is not None
    ended, running = running, None
    study = ended.job.study
    if not is_deleted(ended.scene):
        studies[ended.scene] = study
    return study


def stop() -> None:
    """Cancel the running job, if any, and wait for its thread; its rows are dropped."""
    global running
    if running is not None:
        running.job.cancel()
        ended, running = running, None
        while ended.job.running:
            ended.job.wait(0.1)


def clear() -> None:
    """Forget everything: another file is being opened, or the add-on goes."""
    stop()
    studies.clear()


def is_running(scene: bpy.types.Scene) -> bool:
    """Whether this scene is the one being compared."""
    return running is not None and running.scene == scene_key(scene)


def study_of(scene: bpy.types.Scene) -> Study | None:
    """The finished study of a scene."""
    return studies.get(scene_key(scene))


def rows_of(scene: bpy.types.Scene) -> list[Row]:
    """The rows to show: those of the running comparison as they come in, else the finished ones."""
    if running is not None and is_running(scene):
        return list(running.rows.values())
    study = study_of(scene)
    return study.result.rows if study else []


@functools.cache  # a panel asks at every redraw, and only a restart changes the answer
def native_reason() -> str:
    """Why the compiled core cannot be used; empty where it can."""
    try:
        load()
    except NativeMissing as error:
        return str(error)
    return ""


@functools.cache  # drivers are asked once: the first question loads them
def devices() -> list[dict[str, Any]]:
    """What `core.devices()` lists, none without a core."""
    return [] if native_reason() else list(load().devices())


@functools.cache
def builders() -> list[dict[str, object]]:
    """What `core.builders()` offers, none without a core."""
    return [] if native_reason() else list(load().builders())
