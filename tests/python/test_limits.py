# SPDX-License-Identifier: GPL-3.0-or-later
"""Counts beyond what 32-bit numbers hold are refused at once, before anything is copied.

The arrays here repeat one row without any memory for it (numpy's broadcast_to).
"""

from __future__ import annotations

import numpy as np
import pytest
from bvh_lab.native import core

ROW = np.zeros(3, np.float32)
MESH = core.Mesh(np.eye(3), [(0, 1, 2)])


def many(row: np.ndarray, count: int) -> np.ndarray:
    return np.broadcast_to(row, (count, *row.shape))


@pytest.mark.parametrize("count", [2**28 + 1, 2**31, 2**32, 2**33 + 1])
def test_too_many_triangles(count: int) -> None:
    for kind in (np.uint32, np.int64):
        with pytest.raises(ValueError, match=f"{count} triangles; at most 2\\^28"):
            core.Mesh(np.eye(3), many(np.arange(3, dtype=kind), count))


@pytest.mark.parametrize("count", [2**32 - 1, 2**32, 2**33 + 1])
def test_too_many_rows(count: int) -> None:
    with pytest.raises(ValueError, match=f"vertices has {count} rows; a call takes at most 2"):
        core.Mesh(many(ROW, count), [(0, 1, 2)])
    bvh = core.build(MESH, "lbvh")
    with pytest.raises(ValueError, match=f"origins has {count} rows; a call takes at most 2"):
        core.trace(bvh, many(ROW, count), many(ROW + 1, count))
    with pytest.raises(ValueError, match=f"origins has {count} rows"):
        core.brute_force(MESH, many(ROW, count), many(ROW + 1, count))


@pytest.mark.parametrize("shape", [(65536, 1), (1, 65536), (2**32 + 1, 1), (1, 2**31, 3)])
def test_too_large_pictures(shape: tuple[int, ...], tmp_path) -> None:  # type: ignore[no-untyped-def]
    if not core.features()["image"]:
        pytest.skip("this build has no OpenImageIO")
    picture = np.broadcast_to(np.float32(0), shape)
    with pytest.raises(ValueError, match="a side has at most 65535"):
        core.write_image(str(tmp_path / "a.exr"), picture)
    with pytest.raises(ValueError, match="a side has at most 65535"):
        core.image_difference(picture, picture)


def test_too_many_samples() -> None:
    scene = core.Scene(
        MESH, [core.Material([core.Component()])], np.zeros(1, np.uint32), [], core.World((1, 1, 1))
    )
    camera = core.Camera("perspective", np.eye(4), (-1, 1, -1, 1))
    renderer = core.Renderer(core.build(MESH, "lbvh"), scene, camera, 1, 1)
    renderer.render(1)
    with pytest.raises(ValueError, match="has 1, and 16777216 more were asked for"):
        renderer.render(2**24)
    assert renderer.samples == 1
    renderer.render(1)
    assert renderer.samples == 2
