# SPDX-License-Identifier: GPL-3.0-or-later
"""Build times on an OpenCL device in turns with the CPU core, and whether their trees differ."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from bvh_lab.native import core
from bvh_lab.study.devices import CPU
from bvh_lab.study.results import spread

WIDTH = 8  # of the tree that the builds are collapsed to
QUICK, SLOW = 2.0, 12.0  # seconds of one build on device and CPU core together


class Kernel(NamedTuple):
    """What all launches of a kernel took in a build, the median over the builds."""

    of: str  # "tree" or "collapse"
    stage: str
    name: str
    launches: int
    seconds: float


@dataclass
class Times:
    """Seconds of each timed build. ``program`` is of all builds together: compiling kernels."""

    tree: list[float] = field(default_factory=list)
    collapse: list[float] = field(default_factory=list)
    transfer: list[float] = field(default_factory=list)
    program: float = 0.0
    kernels: list[list[Kernel]] = field(default_factory=list)

    def median_kernels(self) -> list[Kernel]:
        """Each kernel once, in the order of the first launch."""
        samples: dict[tuple[str, str, str], list[Kernel]] = {}
        for build in self.kernels:
            for kernel in build:
                samples.setdefault(kernel[:3], []).append(kernel)
        return [
            of[-1]._replace(seconds=spread([kernel.seconds for kernel in of]).median)
            for of in samples.values()
        ]


@dataclass
class Build:
    """One builder on one scene.

    ``cpu`` is empty where the CPU core was left out, or makes the device's tree. ``tree`` is the
    device's last, as long as it is needed. ``differing_bytes`` are those in which its 8-wide tree
    is not the CPU core's, None where that has none.
    """

    builder: str
    label: str
    made_by: str = ""  # CPU or the device's id: who makes the binary tree
    device: Times = field(default_factory=Times)
    cpu: Times = field(default_factory=Times)
    tree_bytes: int = 0
    differing_bytes: int | None = None
    error: str = ""
    tree: Any = None

    @property
    def on_device(self) -> bool:
        """Whether kernels make the binary tree."""
        return self.made_by != CPU

    def seconds(self) -> float:
        """What one more build is likely to take on device and CPU core together."""
        parts = (self.device.tree, self.device.collapse, self.cpu.tree, self.cpu.collapse)
        return sum(spread(part).median for part in parts if part)

    def ratios(self) -> list[float]:
        """Seconds of the CPU core over those of the device, build by build: binary trees."""
        pairs = zip(self.cpu.tree, self.device.tree, strict=False)
        return [theirs / ours for theirs, ours in pairs]


def repeats_after(first_seconds: float, wanted: int) -> int:
    """How many builds to time after the first: fewer where they are slow; 0: the first counts."""
    if first_seconds > SLOW:
        return 0
    return wanted if first_seconds < QUICK else min(wanted, 3)


def labels() -> dict[str, str]:
    """The builders' names in the paper's spelling."""
    return {builder["id"]: builder["label"] for builder in core.builders()}


def measure_build(
    mesh: Any,
    builder: str,
    params: dict[str, float],
    device: str,
    rival: bool,
    repeats: int,
    token: Any,
) -> Build:
    """Build on the device and, if ``rival``, on the CPU core in turns, 8-wide collapse included.

    The first build of each warms up, unless it is slow: then it is the only one. What fails has its
    ``error``. Raises Cancelled.
    """
    build = Build(builder, labels()[builder])
    job = (mesh, builder, params, token)
    try:
        ours = _build_once(*job, device, build.device)
        build.tree, build.tree_bytes = ours[0], ours[1].stats["bytes"]
        build.made_by = ours[1].stats["tree_device"]
        rival = rival and build.on_device
        if rival:
            theirs = _build_once(*job, CPU, build.cpu)
            build.differing_bytes = differing_bytes(ours[1], theirs[1])
            del theirs
        del ours
        more = repeats_after(build.seconds(), repeats) if build.on_device else 0
        if more:
            program = build.device.program
            build.device, build.cpu = Times(program=program), Times()
        for _ in range(more):
            build.tree = None  # two trees of a large scene need not fit
            build.tree = _build_once(*job, device, build.device)[0]
            if rival:
                _build_once(*job, CPU, build.cpu)
    except (ValueError, RuntimeError, MemoryError) as error:
        if isinstance(error, core.Cancelled):
            raise
        build.error, build.tree = str(error), None
    return build


def _build_once(
    mesh: Any, builder: str, params: dict[str, float], token: Any, device: str, times: Times
) -> tuple[Any, Any]:
    tree = core.build_tree(mesh, builder, device=device, params=params, token=token)
    bvh = tree.collapse(WIDTH, token=token)
    stats = bvh.stats
    times.tree.append(stats["tree_seconds"])
    times.collapse.append(stats["collapse_seconds"])
    times.transfer.append(stats["transfer_seconds"])
    times.program += stats["program_seconds"]
    times.kernels.append(
        [
            Kernel(of, kernel["stage"], kernel["kernel"], kernel["launches"], kernel["seconds"])
            for of, kernels in (("tree", tree.kernels), ("collapse", bvh.collapse_kernels))
            for kernel in kernels
        ]
    )
    return tree, bvh


def differing_bytes(a: Any, b: Any) -> int:
    """In how many bytes of nodes and leaves two trees differ; what one has more counts, too."""
    total = 0
    for ours, theirs in zip(a.memory, b.memory, strict=True):
        both = min(len(ours), len(theirs))
        total += abs(len(ours) - len(theirs))
        total += int(np.count_nonzero(ours[:both] != theirs[:both]))
    return total
