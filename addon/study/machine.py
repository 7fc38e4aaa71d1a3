# SPDX-License-Identifier: GPL-3.0-or-later
"""The machine and the software that a study runs on."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from types import ModuleType

import numpy as np

from .results import Machine


def describe_machine(core: ModuleType, host: str) -> Machine:
    """All that must be known of the machine to read the timings. ``host``: see `Machine`."""
    embree = core.embree()
    return Machine(
        cpu=_cpu_name(),
        cores=usable_cores(),
        memory_gib=round(_pages("SC_PHYS_PAGES") / 2**30, 1),
        system=platform.platform(),
        python=platform.python_version(),
        numpy=np.__version__,
        host=host or f"Python {platform.python_version()}",
        version=core.__version__,
        devices=[dict(device) for device in core.devices()],
        features=dict(core.features()),
        embree=embree["version"] if embree["available"] else f"missing: {embree['reason']}",
    )


def usable_cores() -> int:
    """Logical processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def free_bytes() -> float:
    """Memory that is free now, in bytes; infinity where the system does not say."""
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return 1024.0 * int(line.split()[1])
    except OSError:
        pass
    return _pages("SC_AVPHYS_PAGES") or float("inf")


def _pages(name: str) -> float:
    try:
        return float(os.sysconf(name) * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return 0.0


def _cpu_name() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
