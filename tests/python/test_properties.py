# SPDX-License-Identifier: GPL-3.0-or-later
"""What must hold for any small mesh and any rays; scripts/stability_examples.py says what."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from bvh_lab.native import core
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))

from stability_examples import EXAMPLE_BYTES, LARGEST_COORDINATE, check, example_of


@settings(max_examples=10_000, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.binary(min_size=EXAMPLE_BYTES, max_size=EXAMPLE_BYTES))
def test_any_mesh_and_rays_give_the_exact_hits_or_a_clear_refusal(data: bytes) -> None:
    check(core, data)


def test_examples_reach_what_they_are_for() -> None:
    """Random bytes give hits, misses, refusals, denormals, huge and equal coordinates."""
    random = np.random.default_rng(1)
    seen = {"hits": 0, "misses": 0, "refused": 0, "denormal": 0, "huge": 0, "equal corners": 0}
    seen |= {"axis-parallel": 0, "t_min = t_max": 0}
    for _ in range(400):
        data = random.bytes(EXAMPLE_BYTES)
        hits, example = check(core, data), example_of(data)
        seen["refused"] += hits < 0
        if hits < 0:
            continue
        size = np.abs(example.vertices)
        corners = example.vertices[example.triangles]
        seen["hits"] += hits > 0
        seen["misses"] += hits == 0
        seen["denormal"] += bool(((size > 0) & (size < np.finfo(np.float32).tiny)).any())
        seen["huge"] += bool((size > 1e-3 * LARGEST_COORDINATE).any())
        seen["equal corners"] += bool((corners[:, 0] == corners[:, 1]).all(axis=1).any())
        seen["axis-parallel"] += bool(((example.directions == 0).sum(axis=1) == 2).any())
        seen["t_min = t_max"] += example.interval == 1
    assert min(seen.values()) >= 20, seen
