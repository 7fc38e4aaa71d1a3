# SPDX-License-Identifier: GPL-3.0-or-later
"""What the result says of the scene that was measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .rays import View
from .results import Subject
from .scene import Scene


def subject_of(scene: Scene, core_scene: Any, views: Sequence[View]) -> Subject:
    """The scene as the result names it; ``core_scene`` is the `core.Scene` made of it."""
    return Subject(
        scene.name,
        scene.source,
        scene.geometry,
        scene.frame,
        len(scene.triangles),
        len(scene.vertices),
        len(scene.materials),
        len(scene.lights),
        [view.name for view in views],
        scene.digest(),
        [name for name, used in core_scene.features.items() if used],
    )
