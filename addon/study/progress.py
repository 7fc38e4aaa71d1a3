# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a study has come, and how long it still takes, from what its parts took so far."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from .results import Row


@dataclass(frozen=True)
class Step:
    """A step begins. ``fraction`` is over the whole study, in [0, 1], and never falls."""

    fraction: float
    stage: str
    seconds_left: float


@dataclass(frozen=True)
class RowChanged:
    """A row has new numbers (a copy: later changes come as further events)."""

    row: Row
    finished: bool


Event = Step | RowChanged


class Progress:
    """Turns planned work into a fraction and a time.

    ``planned`` holds, per category of work, its amount in guessed seconds. The time left is what is
    left of each category at the pace measured for it, or at the overall pace before its first step.
    """

    def __init__(self, planned: dict[str, float], emit: Callable[[Event], None]) -> None:
        self._planned = planned
        self._emit = emit
        self._done = dict.fromkeys(planned, 0.0)
        self._seconds = dict.fromkeys(planned, 0.0)
        self._fraction = 0.0

    def seconds_left(self) -> float:
        """Estimate of the seconds that the rest of the study takes."""
        done = sum(self._done.values())
        overall = sum(self._seconds.values()) / done if done else 1.0
        left = 0.0
        for category, planned in self._planned.items():
            finished = self._done[category]
            pace = self._seconds[category] / finished if finished else overall
            left += max(planned - finished, 0.0) * pace
        return left

    @contextmanager
    def step(self, category: str, amount: float, stage: str) -> Iterator[None]:
        """Announce a step of ``amount`` guessed seconds and measure it, unless it fails."""
        left, spent = self.seconds_left(), sum(self._seconds.values())
        if spent:
            self._fraction = max(self._fraction, spent / (spent + left) if left else 1.0)
        self._emit(Step(self._fraction, stage, left))
        start = time.perf_counter()
        yield
        self._done[category] += amount
        self._seconds[category] += time.perf_counter() - start

    def replan(self, category: str, amount: float) -> None:
        """What is left of a category is ``amount`` after all."""
        self._planned[category] = self._done[category] + amount

    def skip(self, amounts: dict[str, float]) -> None:
        """Take work out, per category, that will not be done after all."""
        for category, amount in amounts.items():
            left = self._planned[category] - amount
            self._planned[category] = max(left, self._done[category])
