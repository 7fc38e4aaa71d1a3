# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress in a terminal or a log, and a stdout for results only."""

from __future__ import annotations

import ctypes
import os
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO

LOG_SECONDS = 5.0  # between lines where the stream is no terminal
GUESSED = 0.02  # fraction up to which the time left is a mere guess, and not shown


class ProgressLine:
    """One line that is written over in a terminal; elsewhere a line every few seconds."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._terminal = stream.isatty()
        self._shown = -LOG_SECONDS

    def show(self, fraction: float, stage: str, seconds_left: float) -> None:
        """Show how far the work is."""
        left = f"about {duration(seconds_left)} left" if fraction > GUESSED else "starting"
        line = f"{100.0 * fraction:3.0f}%  {left}  {stage}"
        if self._terminal:
            width = shutil.get_terminal_size().columns - 1
            self._stream.write(f"\r{line[:width]}\x1b[K")
        elif time.monotonic() - self._shown >= LOG_SECONDS:
            self._shown = time.monotonic()
            self._stream.write(f"{line}\n")
        self._stream.flush()

    def clear(self) -> None:
        """Take the line away."""
        if self._terminal:
            self._stream.write("\r\x1b[K")
            self._stream.flush()


@contextmanager
def stdout_to_stderr() -> Iterator[None]:
    """Send what anyone prints to stderr, native code too: Blender says "Read blend: ..." itself."""
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        sys.stdout.flush()
        if os.name == "posix":
            ctypes.CDLL(None).fflush(None)  # native code buffers too
        os.dup2(kept, 1)
        os.close(kept)


def duration(seconds: float) -> str:
    """E.g. "42 s", "3 min 5 s", "2 h 10 min"."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
