# SPDX-License-Identifier: GPL-3.0-or-later
"""Embree beside another Embree that everyone can see, as an official Blender brings its own.

Linked, our core would run that one's code behind the wrong headers, and every ray would miss.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from bvh_lab.native import core

PROGRAM = """
import ctypes, json, sys
import numpy as np
from bvh_lab.native import core

status = core.embree()
random = np.random.default_rng(1)
vertices = random.random((3000, 3), np.float32) * np.float32(0.2)
vertices += np.repeat(random.random((1000, 3), np.float32), 3, axis=0)
mesh = core.Mesh(vertices, np.arange(3000, dtype=np.uint32).reshape(-1, 3))
rays = random.random((2, 2000, 3), np.float32) - np.float32(0.5)
rays = rays[0] + np.float32(0.5), rays[1]
truth = core.brute_force(mesh, *rays)
found = core.EmbreeScene(mesh).trace(*rays)
seen = hasattr(ctypes.CDLL(None), "rtcNewDevice")
print(json.dumps({
    "version": status["version"], "everyone sees Embree": seen, "hits": int(truth.occluded.sum()),
    "wrong": int((truth.triangle != found.triangle).sum()),
}))
"""


def bpy_embree() -> Path | None:
    """The Embree that the bpy wheel holds, found without importing bpy."""
    spec = importlib.util.find_spec("bpy")
    folders = spec.submodule_search_locations or [] if spec else []
    return next(
        (path for folder in folders for path in Path(folder).glob("lib/libembree4.so.4")), None
    )


def run(preload: Path | None) -> dict[str, object]:
    """What the program prints in a process that has `preload` in the global scope."""
    environment = dict(os.environ, LD_PRELOAD=str(preload or ""))
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    answer: dict[str, object] = json.loads(done.stdout)
    return answer


@pytest.mark.skipif(not core.embree()["available"], reason=core.embree()["reason"])
def test_embree_alone() -> None:
    answer = run(None)
    assert not answer["everyone sees Embree"]
    assert isinstance(answer["hits"], int) and answer["hits"] > 500
    assert isinstance(answer["wrong"], int) and answer["wrong"] <= 2


def test_embree_beside_another_one() -> None:
    library = bpy_embree()
    if library is None:
        pytest.skip("no bpy module with libembree4.so.4 here")
    if not core.embree()["available"]:
        pytest.skip(core.embree()["reason"])
    answer = run(library)
    assert answer["everyone sees Embree"]
    assert isinstance(answer["hits"], int) and answer["hits"] > 500
    assert isinstance(answer["wrong"], int) and answer["wrong"] <= 2
