# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress over a whole study, and how it is shown."""

from __future__ import annotations

import io

import pytest
from bvh_lab.study import progress as module
from bvh_lab.study.console import ProgressLine, duration
from bvh_lab.study.progress import Event, Progress, Step


class Clock:
    """Seconds that pass only when told."""

    def __init__(self) -> None:
        self.now = 0.0

    def perf_counter(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(module, "time", clock)
    return clock


def test_time_left_follows_the_measured_pace(clock: Clock) -> None:
    events: list[Event] = []
    progress = Progress({"build": 4.0, "trace": 8.0}, events.append)
    assert progress.seconds_left() == 12.0
    with progress.step("build", 1.0, "first"):
        clock.now += 2.0  # half as fast as guessed: all of it may be
    assert progress.seconds_left() == pytest.approx(3.0 * 2.0 + 8.0 * 2.0)
    with progress.step("trace", 4.0, "second"):
        clock.now += 1.0  # tracing is fast after all
    assert progress.seconds_left() == pytest.approx(3.0 * 2.0 + 1.0)
    assert events == [Step(0.0, "first", 12.0), Step(2.0 / 24.0, "second", 22.0)]


def test_the_fraction_never_falls_and_ends_at_one(clock: Clock) -> None:
    events: list[Event] = []
    progress = Progress({"a": 1.0, "b": 10.0}, events.append)
    for category, amount, seconds in (("a", 1.0, 1.0), ("b", 1.0, 50.0), ("b", 9.0, 450.0)):
        with progress.step(category, amount, category):
            clock.now += seconds
    with progress.step("b", 0.0, "end"):
        pass
    fractions = [event.fraction for event in events if isinstance(event, Step)]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0


def test_work_that_is_left_out_takes_no_time(clock: Clock) -> None:
    progress = Progress({"a": 1.0, "b": 10.0}, lambda event: None)
    progress.skip({"b": 4.0})
    assert progress.seconds_left() == 7.0
    progress.skip({"b": 40.0})
    assert progress.seconds_left() == 1.0


def test_a_log_gets_a_line_every_few_seconds() -> None:
    stream = io.StringIO()
    line = ProgressLine(stream)
    for _ in range(100):
        line.show(0.42, "timing", 65.0)
    line.clear()
    assert stream.getvalue() == " 42%  about 1 min 5 s left  timing\n"


def test_a_terminal_gets_one_line_written_over(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "30")
    stream = io.StringIO()
    stream.isatty = lambda: True  # type: ignore[method-assign]
    line = ProgressLine(stream)
    line.show(0.5, "a stage with a long name", 3.0)
    line.clear()
    assert stream.getvalue() == "\r 50%  about 3 s left  a stage\x1b[K\r\x1b[K"


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (59.6, "1 min 0 s"), (3599.0, "59 min 59 s"), (7800, "2 h 10 min")],
)
def test_durations(seconds: float, text: str) -> None:
    assert duration(seconds) == text
