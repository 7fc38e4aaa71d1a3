# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tests of OpenCL devices share. PoCL is among the packages that tests need."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import Any

import numpy as np
from bvh_lab.native import core


def first_device() -> str:
    """Full id of the device that "opencl" stands for."""
    usable = [d for d in core.devices() if d["available"] and d["id"] != "cpu"]
    assert usable, [device["reason"] for device in core.devices()]
    return str(max(usable, key=lambda device: bool(device["is_gpu"]))["id"])


def answer_of(program: str, **environment: str) -> Any:
    """What a program of its own prints, as JSON, with these variables of the environment."""
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def soup(count: int, seed: int = 0, size: float = 0.1) -> Any:
    """Random triangles in the unit cube."""
    random = np.random.default_rng(seed)
    corners = random.random((count, 1, 3)) + size * (random.random((count, 3, 3)) - 0.5)
    vertices = corners.reshape(-1, 3).astype(np.float32)
    return core.Mesh(vertices, np.arange(3 * count, dtype=np.uint32).reshape(-1, 3))


def random_rays(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Rays from within the unit cube."""
    random = np.random.default_rng(seed)
    origins = random.random((count, 3)).astype(np.float32)
    return origins, random.normal(size=(count, 3)).astype(np.float32)


def same_bits(
    a: Any, b: Any, fields: tuple[str, ...] = ("t", "u", "v", "triangle", "occluded")
) -> bool:
    """Whether two Hits are equal bit for bit."""
    pairs = [(getattr(a, name), getattr(b, name)) for name in fields]
    return all(
        (x is None and y is None) or (x.tobytes() == y.tobytes() and x.shape == y.shape)
        for x, y in pairs
    )


def same_tree(a: Any, b: Any) -> bool:
    """Whether two trees are equal byte for byte."""
    return [part.tobytes() for part in a.memory] == [part.tobytes() for part in b.memory]
