# SPDX-License-Identifier: GPL-3.0-or-later
"""What scripts that drive a Blender with a window share.

A script is a generator: each ``yield`` lets Blender handle events. What it saw, in ``seen``,
and its screenshots go to the folder that follows the build folder after " -- ".
"""

from __future__ import annotations

import json
import os
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy

_WORDS = sys.argv[sys.argv.index("--") + 1 :]
BUILD, OUT = Path(_WORDS[0]), Path(_WORDS[1])
REST = _WORDS[2:]  # what a script has to do, where it can do several things

TICK_SECONDS = 0.03
PATIENCE_SECONDS = 120.0
seen: dict[str, object] = {}


def wait_for(what: str, condition: Callable[[], bool]) -> Iterator[None]:
    end = time.monotonic() + PATIENCE_SECONDS
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"waited {PATIENCE_SECONDS} s in vain until {what}")
        yield


def screenshot(name: str) -> Iterator[None]:
    for _ in range(8):  # let the window be drawn
        yield
    bpy.ops.screen.screenshot(filepath=str(OUT / name))
    yield


def window_region(area: bpy.types.Area) -> bpy.types.Region:
    return next(region for region in area.regions if region.type == "WINDOW")


def scroll_to_end(area: bpy.types.Area) -> Iterator[None]:
    """Show the last panels of an area, which are ours."""
    region = window_region(area)
    for _ in range(3):
        with bpy.context.temp_override(window=bpy.context.window, area=area, region=region):
            if bpy.ops.view2d.scroll_down.poll():
                bpy.ops.view2d.scroll_down(deltay=2000)
        area.tag_redraw()
        yield


def play(script: Iterator[None], at_the_end: Callable[[], None]) -> None:
    """Run the script in Blender's event loop, write down what it saw, and quit."""

    def step() -> float | None:
        try:
            next(script)
            return TICK_SECONDS
        except StopIteration:
            pass
        except BaseException:
            seen["error"] = traceback.format_exc()
        (OUT / "seen.json").write_text(json.dumps(seen, indent=1))
        try:
            if "error" in seen:
                bpy.ops.screen.screenshot(filepath=str(OUT / "error.png"))
            at_the_end()
            (OUT / "seen.json").write_text(json.dumps(seen, indent=1))
            bpy.ops.wm.quit_blender()
        except BaseException:  # a Blender that goes on would keep the test waiting
            traceback.print_exc()
            os._exit(1)
        return None

    bpy.app.timers.register(step, first_interval=0.5, persistent=True)
