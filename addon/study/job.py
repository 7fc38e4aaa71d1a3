# SPDX-License-Identifier: GPL-3.0-or-later
"""A study in a worker thread, for callers that must stay responsive."""

from __future__ import annotations

import math
import queue
import threading
import time
from typing import Any

from ..native import load
from .plan import Plan
from .progress import Event, Step
from .run import Study, compare
from .scene import Scene


class Job:
    """Runs `compare`. Poll it from the main thread; read `study` once it is not `running`.

    Raises NativeMissing at once without a core.
    """

    def __init__(self, scene: Scene, plan: Plan, host: str = "") -> None:
        self._token: Any = load().Token()
        self._events: queue.SimpleQueue[Event] = queue.SimpleQueue()
        self._study: Study | None = None
        self._error: BaseException | None = None
        # Not Thread.join: a Ctrl-C inside one lets the next return while the thread still runs
        # (Python 3.11).
        self._ended = threading.Event()
        self._thread = threading.Thread(
            target=self._work, args=(scene, plan, host), name="bvh_lab study"
        )
        self._step, self._since = Step(0.0, "reading the mesh", 0.0), time.monotonic()
        self._thread.start()

    def _work(self, scene: Scene, plan: Plan, host: str) -> None:
        try:
            self._study = compare(scene, plan, self._token, self._events.put, host)
        except BaseException as error:  # handed to the caller in `study`
            self._error = error
        finally:
            self._ended.set()

    @property
    def running(self) -> bool:
        """Whether the worker is still at it."""
        return not self._ended.is_set()

    def wait(self, seconds: float) -> None:
        """Wait for the end, but not longer than ``seconds``; signals are still handled."""
        self._ended.wait(seconds)

    def cancel(self) -> None:
        """Ask the study to stop; it does within about 0.1 s and keeps the rows measured so far."""
        self._token.cancel()

    def poll(self) -> list[Event]:
        """The events since the last call."""
        events: list[Event] = []
        while not self._events.empty():
            events.append(self._events.get())
            if isinstance(last := events[-1], Step):
                self._step, self._since = last, time.monotonic()
        return events

    @property
    def fraction(self) -> float:
        """Finished part of the study, in [0, 1], as of the last `poll`."""
        return self._step.fraction

    @property
    def stage(self) -> str:
        """What the study does now, as of the last `poll`; how far a tree has been improved."""
        cost = float(self._token.cost)
        if math.isnan(cost):
            return self._step.stage
        return f"{self._step.stage}: {self._token.fraction:.0%}, cost {cost:.1f}"

    @property
    def seconds_left(self) -> float:
        """Estimate of the seconds until the end."""
        return max(self._step.seconds_left - (time.monotonic() - self._since), 0.0)

    @property
    def study(self) -> Study:
        """The study, after the end; raises what `compare` raised."""
        self._ended.wait()
        self._thread.join()
        if self._error is not None:
            raise self._error
        assert self._study is not None
        return self._study
