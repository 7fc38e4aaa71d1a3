# SPDX-License-Identifier: GPL-3.0-or-later
"""Node layouts: compressed 8-wide trees give the hits of full ones, and say what they are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bvh_lab.native import core

SHARED = Path(__file__).resolve().parents[3] / "shared" / "scenes"
QUICK = {"prbvh_a": {"iterations": 20}, "prbvh_sa": {"iterations": 20}}
BUILDERS = [entry["id"] for entry in core.builders()]


def soup(count: int, size: float = 0.2) -> Any:
    random = np.random.default_rng(3)
    corners = random.random((count, 1, 3)) + size * (random.random((count, 3, 3)) - 0.5)
    vertices = corners.reshape(-1, 3).astype(np.float32)
    return core.Mesh(vertices, np.arange(3 * count, dtype=np.uint32).reshape(-1, 3))


def rays(mesh: Any, count: int) -> tuple[Any, Any]:
    random = np.random.default_rng(4)
    lower, upper = mesh.bounds
    origins = lower + (upper - lower) * random.uniform(-0.2, 1.2, (count, 3))
    directions = random.normal(size=(count, 3)) * (random.random((count, 3)) > 0.2)
    directions[~directions.any(axis=1)] = 1.0
    return origins.astype(np.float32), directions.astype(np.float32)


def assert_same_hits(first: Any, second: Any) -> None:
    for name in ("t", "u", "v", "triangle"):
        a, b = getattr(first, name), getattr(second, name)
        assert np.array_equal(a.view(np.uint32), b.view(np.uint32)), name


@pytest.mark.parametrize("builder", BUILDERS)
def test_compressed_trees_give_the_hits_of_full_ones(builder: str) -> None:
    mesh = soup(2000)
    origins, directions = rays(mesh, 2000)
    tree = core.build_tree(mesh, builder, params=QUICK.get(builder, {}))
    full, small = tree.collapse(8), tree.collapse(8, layout="cwbvh")
    small.validate()
    expected = core.trace(full, origins, directions)
    assert 0.05 < np.mean(expected.occluded) < 1
    assert_same_hits(core.trace(small, origins, directions, reorder=True, threads=3), expected)
    any_hit = core.trace(small, origins, directions, any_hit=True)
    assert np.array_equal(any_hit.occluded, expected.occluded)


def test_what_a_compressed_tree_says_of_itself() -> None:
    mesh = soup(3000)
    tree = core.build_tree(mesh, "sah")
    full, small = tree.collapse(8), tree.collapse(8, layout="cwbvh")
    assert (full.layout, small.layout) == ("full", "cwbvh")
    assert core.build(mesh, "sah", layout="cwbvh").cost() == small.cost()
    stats = small.stats
    assert stats["layout"] == "cwbvh" and full.stats["layout"] == "full"
    assert stats["branching"] == small.branching == 8
    assert stats["node_bytes"] == 80 * stats["interior_nodes"]
    assert 40 * stats["references"] <= stats["leaf_bytes"] <= 40 * stats["references"] + 16
    assert stats["bytes"] == stats["node_bytes"] + stats["leaf_bytes"] < full.stats["bytes"]
    assert 1 <= stats["average_leaf_size"] <= stats["max_leaf_size"] <= 3
    metrics = core.metrics(small, lines=1000)
    assert metrics["cost"] == small.cost() and metrics["bytes"] == stats["bytes"]
    assert metrics["references"] == sum(i * n for i, n in enumerate(metrics["leaf_sizes"]))
    # Eq. 3 charges each triangle once, and is linear in the two constants.
    assert small.cost(3, 2) == pytest.approx(3 * small.cost(1, 0) + 2 * small.cost(0, 1))


def test_counters_count_what_is_stored() -> None:
    mesh = soup(1)
    bvh = core.build(mesh, "lbvh", layout="cwbvh")
    centre = mesh.vertices[mesh.triangles[0]].mean(axis=0)
    normal = np.cross(*(mesh.vertices[mesh.triangles[0]][1:] - mesh.vertices[0])).astype(np.float32)
    hits = core.trace(bvh, [centre - normal], [normal], count=True)
    assert hits.triangle[0] == 0
    assert (hits.node_visits[0], hits.box_tests[0], hits.triangle_tests[0]) == (1, 1, 1)


def test_layouts_that_are_not_there_are_refused() -> None:
    mesh = soup(10)
    tree = core.build_tree(mesh, "lbvh")
    with pytest.raises(ValueError, match="unknown layout 'small'; there are full and cwbvh"):
        tree.collapse(8, layout="small")
    for branching in (2, 4):
        with pytest.raises(ValueError, match=f"layout cwbvh has branching 8 only, not {branching}"):
            tree.collapse(branching, layout="cwbvh")
        with pytest.raises(ValueError, match="branching 8 only"):
            core.build(mesh, "lbvh", branching, layout="cwbvh")
    with pytest.raises(ValueError, match="branching must be 2, 4 or 8, not 3"):
        core.build(mesh, "lbvh", 3, layout="cwbvh")


def test_renders_the_same_picture() -> None:
    mesh = soup(500)
    material = core.Material([core.Component(color=(0.8, 0.5, 0.2))])
    index = np.zeros(len(mesh.triangles), np.uint32)
    scene = core.Scene(mesh, [material], index, [], core.World((1.0, 0.9, 0.8)))
    to_world = np.eye(4)
    to_world[:3, 3] = 0.5, 0.5, 3.0
    camera = core.Camera("perspective", to_world, (-0.4, 0.4, -0.3, 0.3), 1.0)
    tree = core.build_tree(mesh, "ploc")
    full, small = (
        np.asarray(
            core.render(
                tree.collapse(8, layout=layout), scene, camera, 32, 24, samples=4, depth=3
            ).pixels
        )
        for layout in ("full", "cwbvh")
    )
    assert full.std() > 0.01
    assert np.array_equal(full.view(np.uint32), small.view(np.uint32))


def test_bunny_in_half_the_bytes() -> None:
    path = SHARED / "stanford_bunny.npz"
    if not path.is_file():
        pytest.skip(f"no {path.name} in the shared scenes")
    arrays = np.load(path)
    mesh = core.Mesh(arrays["vertices"], arrays["triangles"])
    origins, directions = rays(mesh, 20000)
    tree = core.build_tree(mesh, "ploc")
    full, small = tree.collapse(8), tree.collapse(8, layout="cwbvh")
    small.validate()
    expected = core.trace(full, origins, directions, count=True)
    hits = core.trace(small, origins, directions, count=True)
    assert_same_hits(hits, expected)
    # Smaller leaves and coarser boxes: some more nodes, but far fewer triangles and bytes.
    assert hits.node_visits.mean() < 1.3 * expected.node_visits.mean()
    assert hits.triangle_tests.mean() < 0.6 * expected.triangle_tests.mean()
    assert small.stats["bytes"] < 0.65 * full.stats["bytes"]
