# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenCL on real meshes: a million rays a scene are answered as by the CPU core, bit for bit.

BVHLAB_TEST_DEVICE_RAYS sets the number of rays a scene; they are shared out among the shapes.
"""

from __future__ import annotations

import os

import numpy as np
import pytest
from bvh_lab.native import core
from opencl_support import same_bits, same_tree
from test_core_scenes import NAMES, load, random_rays

RAYS = int(os.environ.get("BVHLAB_TEST_DEVICE_RAYS", "1000000"))
SHAPES = [(2, "full"), (4, "full"), (8, "full"), (8, "cwbvh")]


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_on_the_device(name: str) -> None:
    mesh = load(name)
    tree = core.build_tree(mesh, "lbvh", device="opencl")
    same = core.build_tree(mesh, "lbvh")
    for number, (branching, layout) in enumerate(SHAPES):
        bvh = tree.collapse(branching, layout)
        assert same_tree(bvh, same.collapse(branching, layout)), (branching, layout)
        rays = random_rays(mesh, RAYS // len(SHAPES), seed=10 + number)
        expected = core.trace(bvh, *rays)
        assert same_bits(core.trace(bvh, *rays, device="opencl"), expected), (branching, layout)
        few = [part[: len(part) // 10] for part in rays]
        shadow = core.trace(bvh, *few, any_hit=True, reorder=True, device="opencl")
        assert np.array_equal(shadow.occluded, expected.occluded[: len(few[0])])
