# SPDX-License-Identifier: GPL-3.0-or-later
"""The precision choices as Python sees them: triangle and box tests of core.trace."""

from __future__ import annotations

import numpy as np
import pytest
from bvh_lab.native import core

TRIANGLE_TESTS = ["watertight", "moller_trumbore", "woop_affine", "baldwin_weber"]
BOX_TESTS = ["conservative", "plain"]


def grid(side: int) -> core.Mesh:
    """A flat square of 2 side^2 triangles at z = 0.3, its vertices at odd multiples of 0.1."""
    along = np.arange(side + 1)
    x, y = np.meshgrid(along, along, indexing="ij")
    vertices = np.stack((0.1 + 0.1 * x, 0.2 + 0.1 * y, np.full_like(x, 0.3, dtype=float)), axis=-1)
    at = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    triangles = np.concatenate(
        (
            np.stack((at, at + side + 1, at + side + 2), axis=1),
            np.stack((at, at + side + 2, at + 1), axis=1),
        )
    )
    return core.Mesh(vertices.reshape(-1, 3).astype(np.float32), triangles)


@pytest.fixture(scope="module")
def mesh() -> core.Mesh:
    return grid(16)


def rays_at_vertices(mesh: core.Mesh, each: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from above at vertices that are not on the border."""
    random = np.random.default_rng(1)
    vertices = mesh.vertices
    lower, upper = mesh.bounds
    inner = np.all((vertices > lower)[:, :2] & (vertices < upper)[:, :2], axis=1)
    targets = np.repeat(vertices[inner], each, axis=0)
    origins = (targets + random.uniform((-1, -1, 2), (1, 1, 4), targets.shape)).astype(np.float32)
    return origins, targets - origins


def test_precisions_lists_what_there_is() -> None:
    choices = core.precisions()
    assert [choice["id"] for choice in choices["triangle_test"]] == TRIANGLE_TESTS
    assert [choice["id"] for choice in choices["box_test"]] == BOX_TESTS
    assert [choice["id"] for choice in choices["layout"]] == ["full", "cwbvh"]
    assert [c["bytes_per_triangle"] for c in choices["triangle_test"]] == [36, 36, 48, 40]
    assert [choice["node_bytes"] for choice in choices["layout"]] == [256, 80]
    for kind in choices.values():
        assert all(choice["label"] and choice["source"] for choice in kind)


def test_unknown_tests_are_named(mesh: core.Mesh) -> None:
    bvh = core.build(mesh, "lbvh")
    with pytest.raises(ValueError, match="'woop'; there are: watertight, moller_trumbore, woop_"):
        core.trace(bvh, [[0, 0, 1]], [[0, 0, -1]], triangle_test="woop")
    with pytest.raises(ValueError, match="unknown box test 'exact'; there are: conservative, pl"):
        core.trace(bvh, [[0, 0, 1]], [[0, 0, -1]], box_test="exact")


@pytest.mark.parametrize("triangle_test", TRIANGLE_TESTS)
@pytest.mark.parametrize("box_test", BOX_TESTS)
def test_every_choice_answers_every_question(
    mesh: core.Mesh, triangle_test: str, box_test: str
) -> None:
    """Closest and any hit, counters and order of every choice tell one story."""
    origins, directions = rays_at_vertices(mesh, 3)
    directions = directions + np.float32([0.03, 0.04, 0])  # inside the triangles
    chosen = {"triangle_test": triangle_test, "box_test": box_test}
    for branching, layout in ((2, "full"), (4, "full"), (8, "full"), (8, "cwbvh")):
        bvh = core.build(mesh, "sah", branching=branching, layout=layout)
        default = core.trace(bvh, origins, directions)
        hits = core.trace(bvh, origins, directions, count=True, **chosen)
        assert hits.occluded.mean() > 0.8
        assert np.mean(hits.triangle == default.triangle) > 0.99
        same = (hits.triangle == default.triangle) & hits.occluded
        np.testing.assert_allclose(hits.t[same], default.t[same], rtol=1e-5)
        np.testing.assert_allclose(hits.u[same], default.u[same], atol=1e-3)
        np.testing.assert_allclose(hits.v[same], default.v[same], atol=1e-3)
        assert np.all(hits.triangle_tests[hits.occluded] > 0)
        assert np.all(hits.box_tests >= hits.node_visits)
        sorted_hits = core.trace(bvh, origins, directions, reorder=True, threads=2, **chosen)
        np.testing.assert_array_equal(sorted_hits.t, hits.t)
        np.testing.assert_array_equal(sorted_hits.triangle, hits.triangle)
        any_hit = core.trace(bvh, origins, directions, any_hit=True, **chosen)
        np.testing.assert_array_equal(any_hit.occluded, hits.occluded)


def test_transforms_are_made_once_and_counted(mesh: core.Mesh) -> None:
    bvh = core.build(mesh, "sah", branching=8)
    ray = ([[0.5, 0.5, 1]], [[0, 0, -1]])
    assert core.trace(bvh, *ray).prepared_bytes == 0
    slots = bvh.stats["leaf_bytes"] // 40  # nine floats and an index a lane
    for test, size in (("woop_affine", 48), ("baldwin_weber", 40)):
        first = core.trace(bvh, *ray, triangle_test=test)
        assert first.prepared_bytes == size * slots
        assert first.prepare_seconds > 0
        assert first.seconds == first.traverse_seconds
        again = core.trace(bvh, *ray, triangle_test=test)
        assert again.prepared_bytes == first.prepared_bytes


def test_only_the_default_loses_no_ray_at_a_vertex(mesh: core.Mesh) -> None:
    """What the other choices lose is theirs to lose: here some do, which is the comparison."""
    origins, directions = rays_at_vertices(mesh, 30)
    lost = {}
    for branching in (2, 8):
        bvh = core.build(mesh, "sah", branching=branching)
        for triangle_test in TRIANGLE_TESTS:
            for box_test in BOX_TESTS:
                hits = core.trace(
                    bvh, origins, directions, triangle_test=triangle_test, box_test=box_test
                )
                lost[branching, triangle_test, box_test] = int(np.sum(~hits.occluded))
    assert lost[2, "watertight", "conservative"] == lost[8, "watertight", "conservative"] == 0
    assert lost[2, "watertight", "plain"] > 0
    assert lost[2, "moller_trumbore", "conservative"] > 0
    assert lost[2, "woop_affine", "conservative"] > 0
