# SPDX-License-Identifier: GPL-3.0-or-later
"""Keeps Blender's data writable after a render in a thread.

Around each Python callback Blender saves a global flag "data is read-only", raises it, and puts the
saved value back. With a window `render` runs in a thread of its own, so that these pairs may
interleave with those of a panel's `draw` in the main thread. Where only one of the two began or
ended inside the other, the flag stays raised for good, and no script or operator can write any
more. So a render that began outside of such a callback ends outside of one, and one that began
inside of one ends inside of one.
"""

from __future__ import annotations

import sys
import threading
import time

PATIENCE_SECONDS = 5.0
# Names of the callbacks for which Blender raises the flag, as far as they are called often.
CALLBACKS = {
    "draw",
    "draw_filter",
    "draw_header",
    "draw_header_preset",
    "draw_item",
    "filter_items",
    "poll",
    "view_draw",
    "view_update",
}


class WriteGuard:
    """To be entered first and left last in `render`."""

    def __enter__(self) -> None:
        self._inside = main_in_callback()

    def __exit__(self, *_: object) -> None:
        if threading.current_thread() is threading.main_thread():
            return
        end = time.monotonic() + PATIENCE_SECONDS
        usual = sys.getswitchinterval()
        try:
            # Wake up in the middle of callbacks, but look and leave without being interrupted.
            while time.monotonic() < end:
                sys.setswitchinterval(1.0)
                if main_in_callback() == self._inside:
                    break
                sys.setswitchinterval(1e-5)
                time.sleep(0.0001)
        finally:
            sys.setswitchinterval(usual)


def main_in_callback() -> bool:
    """Whether the main thread is in one of Blender's read-only callbacks."""
    main = threading.main_thread()
    if threading.current_thread() is main:
        return False
    frame = sys._current_frames().get(main.ident)
    if frame is None:
        return False
    while frame.f_back is not None:
        frame = frame.f_back
    return frame.f_code.co_name in CALLBACKS
