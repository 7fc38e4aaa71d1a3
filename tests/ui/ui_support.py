# SPDX-License-Identifier: GPL-3.0-or-later
"""What scripts that drive a Blender with a window share.

A script is a generator: each ``yield`` lets Blender handle events. What it saw, in ``seen``,
and its screenshots go to the folder that follows the build folder after " -- ".
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

_WORDS = sys.argv[sys.argv.index("--") + 1 :]
BUILD, OUT = Path(_WORDS[0]), Path(_WORDS[1])
REST = _WORDS[2:]  # what a script has to do, where it can do several things

TICK_SECONDS = 0.03
PATIENCE_SECONDS = 120.0
# Not for ever: closing a window waits for the study's end. It looks members up before and after.
GATE_SECONDS = 5.0
seen: dict[str, object] = {}


def wait_for(what: str, condition: Callable[[], bool]) -> Iterator[None]:
    end = time.monotonic() + PATIENCE_SECONDS
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"waited {PATIENCE_SECONDS} s in vain until {what}")
        yield


class Gate:
    """Holds up our threads before their next call into the native module."""

    def __init__(self) -> None:
        self._open = threading.Event()
        self._open.set()
        self._parked: set[int] = set()

    def guard(self, function: Callable[..., object]) -> Callable[..., object]:
        """``function``, which waits at the gate if it is called by a thread of ours."""

        def guarded(*arguments: object, **named: object) -> object:
            if threading.current_thread() is not threading.main_thread():
                self._parked.add(threading.get_ident())
                self._open.wait(GATE_SECONDS)
                self._parked.discard(threading.get_ident())
            return function(*arguments, **named)

        return guarded

    @contextmanager
    def closed(self) -> Iterator[None]:
        """All threads of ours are parked (or busy with something else for two seconds)."""
        self._open.clear()
        end = time.monotonic() + 2.0
        while time.monotonic() < end and any(
            thread.ident not in self._parked
            for thread in threading.enumerate()
            if "bvh_lab" in thread.name
        ):
            time.sleep(0.001)
        try:
            yield
        finally:
            self._open.set()


_gates: list[Gate] = []


@contextmanager
def override(**members: object) -> Iterator[None]:
    """bpy.context.temp_override while no other thread runs Python.

    An operator that Python calls lets go of the interpreter's lock, and then looks members up in
    the override's dictionary. Before Python 3.12, Blender (PyC_IsInterpreterActive) takes the lock
    for that only if *no* thread has it: if one of ours does, two threads change Python's heap at
    once, and Blender crashes in either. The add-on itself overrides no context.
    """
    if not _gates and "bvh_lab.native" in sys.modules:
        from bvh_lab.native import core

        gate = Gate()
        core.trace = gate.guard(core.trace)
        core.Renderer.render = gate.guard(core.Renderer.render)
        _gates.append(gate)
    if not _gates:
        with bpy.context.temp_override(**members):
            yield
        return
    with _gates[0].closed(), bpy.context.temp_override(**members):
        yield


def screenshot(name: str) -> Iterator[None]:
    for _ in range(8):  # let the window be drawn
        yield
    end = time.monotonic() + PATIENCE_SECONDS
    while True:
        try:
            bpy.ops.screen.screenshot(filepath=str(OUT / name))
            break
        except RuntimeError as error:  # a render that is just ending holds the data for a moment
            if "drawing/rendering" not in str(error) or time.monotonic() > end:
                raise
        yield
    yield


def window_region(area: bpy.types.Area) -> bpy.types.Region:
    return next(region for region in area.regions if region.type == "WINDOW")


def scroll_to_end(area: bpy.types.Area) -> Iterator[None]:
    """Show the last panels of an area, which are ours."""
    region = window_region(area)
    for _ in range(3):
        with override(window=bpy.context.window, area=area, region=region):
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
