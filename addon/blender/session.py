# SPDX-License-Identifier: GPL-3.0-or-later
"""This Blender, as the command line sees it: which program it is, and the scene of a file."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import bpy

from ..study.scene import Scene
from .extract import extract_scene


def program() -> str:
    """Name and version, e.g. "Blender 3.4.1" or "bpy 5.0.1"."""
    as_module = getattr(bpy.app, "module", False)
    return f"{'bpy' if as_module else 'Blender'} {bpy.app.version_string}"


def open_scene(path: Path | None, geometry: Literal["viewport", "render"]) -> Scene:
    """Extract the active scene of a .blend file, or of the open one where ``path`` is None.

    Scripts in the file are not run. Raises ValueError naming a file that is no .blend, and
    ExtractError.
    """
    if path is not None:
        try:
            bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
        except RuntimeError as error:
            reason = " ".join(str(error).split()).removeprefix("Error: ")
            raise ValueError(f"{path} is not a .blend file that Blender opens: {reason}") from error
    return extract_scene(bpy.context, geometry)
