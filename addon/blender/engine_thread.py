# SPDX-License-Identifier: GPL-3.0-or-later
"""A long call into the core beside a thread that stays responsive."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar

Result = TypeVar("Result")
TICK_SECONDS = 0.05
STOP_SECONDS = 10.0  # more than enough: a cancel takes 0.1 s
GRACE_SECONDS = 0.2  # for Blender to leave an engine whose call has returned


class AtWork:
    """Counts the calls within ``with at_work:``, in whichever threads, and can stop them."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._count = 0
        self.stopping = False  # the calls are to watch this

    def __enter__(self) -> None:
        with self._changed:
            self._count += 1

    def __exit__(self, *_: object) -> None:
        with self._changed:
            self._count -= 1
            self._changed.notify_all()

    def stop(self) -> None:
        """Ask all calls to end, and wait for it."""
        with self._changed:
            if self._count == 0:
                return
            self.stopping = True
            self._changed.wait_for(lambda: self._count == 0, STOP_SECONDS)
            self.stopping = False
        time.sleep(GRACE_SECONDS)


def call_aside(work: Callable[[], Result], token: Any, tick: Callable[[], bool]) -> Result:
    """Call ``work`` in a thread and return what it returns, or raise what it raises.

    ``tick`` is called about every 0.05 s meanwhile, in the calling thread; once it is true
    ``token`` is cancelled, which makes ``work`` raise `core.Cancelled` soon. The thread has ended
    when this returns or raises.
    """
    outcome: dict[str, Any] = {}
    ended = threading.Event()

    def run() -> None:
        try:
            outcome["result"] = work()
        except BaseException as error:  # carried over to the caller
            outcome["error"] = error
        finally:
            ended.set()

    thread = threading.Thread(target=run, name="bvh_lab render")
    thread.start()
    try:
        while not ended.wait(TICK_SECONDS):
            if tick():
                token.cancel()
    finally:
        if not ended.is_set():  # tick raised, or Ctrl-C was pressed
            token.cancel()
            ended.wait()
        thread.join()
    if "error" in outcome:
        raise outcome["error"]
    return outcome["result"]
