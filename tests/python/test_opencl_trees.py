# SPDX-License-Identifier: GPL-3.0-or-later
"""Trees and hits of OpenCL devices are the CPU core's, byte for byte."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest
from builder_params import fast_params
from bvh_lab.native import core
from opencl_support import first_device, random_rays, same_bits, same_tree, soup

BUILDERS = [entry["id"] for entry in core.builders()]
MADE_BY_THE_CPU = {"sah", "sbvh", "hybrid"}
SHAPES = [(2, "full"), (4, "full"), (8, "full"), (8, "cwbvh")]


def hard_meshes() -> dict[str, Any]:
    """Few triangles, equal ones, ones in a line, flat ones."""
    one = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    random = np.random.default_rng(3).random((30, 3)).astype(np.float32)

    def mesh(corners: np.ndarray) -> Any:
        indices = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
        return core.Mesh(corners, indices)

    shifts = np.arange(20, dtype=np.float32)[:, None, None] * np.float32([1, 0, 0])
    return {
        "one": mesh(one),
        "two": mesh(np.concatenate([one, one + 2])),
        "equal": mesh(np.tile(one, (40, 1))),
        "in a line": mesh((one[None] + shifts).reshape(-1, 3)),
        "flat": mesh(random * np.float32([1, 1, 0])),
        "points": mesh(np.repeat(random[:10], 3, axis=0)),
        "growing": mesh(np.concatenate([one * np.float32(2.0) ** k for k in range(-20, 20)])),
    }


@pytest.mark.parametrize("builder", BUILDERS)
def test_trees_are_those_of_the_cpu(builder: str) -> None:
    mesh, params = soup(1500), fast_params(builder)
    ours = core.build_tree(mesh, builder, device="opencl", params=params)
    theirs = core.build_tree(mesh, builder, params=params)
    assert ours.cost() == theirs.cost() and ours.references == theirs.references
    assert ours.log["ended"] == theirs.log["ended"]
    steps = [[(i, cost) for i, _, cost in tree.log["steps"]] for tree in (ours, theirs)]
    assert len(steps[0]) == len(steps[1])
    for (i, cost), (j, expected) in zip(*steps, strict=True):
        assert i == j and cost == pytest.approx(expected, rel=1e-12)
    for branching, layout in SHAPES:
        a, b = ours.collapse(branching, layout), theirs.collapse(branching, layout)
        assert same_tree(a, b), (branching, layout)
        a.validate()
        assert a.cost() == b.cost()
        made = "cpu" if builder in MADE_BY_THE_CPU else first_device()
        assert a.stats["tree_device"] == made and b.stats["tree_device"] == "cpu"


@pytest.mark.parametrize("builder", BUILDERS)
def test_hard_meshes(builder: str) -> None:
    params = fast_params(builder)
    for name, mesh in hard_meshes().items():
        ours = core.build_tree(mesh, builder, device="opencl", params=params)
        theirs = core.build_tree(mesh, builder, params=params)
        for branching, layout in SHAPES:
            a, b = ours.collapse(branching, layout), theirs.collapse(branching, layout)
            assert same_tree(a, b), (name, branching, layout)


@pytest.mark.parametrize(("branching", "layout"), SHAPES)
def test_hits_are_those_of_the_cpu(branching: int, layout: str) -> None:
    mesh, rays = soup(3000), random_rays(20_000)
    bvh = core.build(mesh, "sbvh", branching, layout=layout)
    expected = core.trace(bvh, *rays)
    for reorder in ("off", "aila", "origin", "octahedron", "two_point"):
        hit = core.trace(bvh, *rays, reorder=reorder, device="opencl")
        assert same_bits(hit, expected), reorder
        assert hit.seconds > 0.0 and hit.shape
        shadow = core.trace(bvh, *rays, any_hit=True, reorder=reorder, device="opencl")
        assert shadow.t is None and np.array_equal(shadow.occluded, expected.occluded), reorder
    for any_hit in (False, True):
        ours, theirs = (
            core.trace(bvh, *rays, any_hit=any_hit, count=True, device=device)
            for device in ("opencl", "cpu")
        )
        for counter in ("node_visits", "box_tests", "triangle_tests"):
            a, b = getattr(ours, counter), getattr(theirs, counter)
            assert a.dtype == b.dtype == np.uint32 and (a > 0).any()
            # How children are ordered may differ where they are equally far.
            assert a.sum() == pytest.approx(b.sum(), rel=0.02), (counter, any_hit)


@pytest.mark.parametrize(
    ("branching", "layout", "shape"),
    [(2, "full", "persistent"), (4, "full", "lanes"), (8, "full", "lanes"), (8, "cwbvh", "octant")],
)
def test_shapes_for_graphics_cards_give_the_same_hits(
    branching: int, layout: str, shape: str
) -> None:
    bvh, rays = core.build(soup(2000), "lbvh", branching, layout=layout), random_rays(3000)
    expected = core.trace(bvh, *rays)
    for name in ("single", "measured", shape):
        hit = core.trace(bvh, *rays, device="opencl", shape=name)
        assert same_bits(hit, expected), name
        assert hit.shape == name or (name == "measured" and hit.shape in ("single", shape))


def test_shapes_that_cannot_be_are_refused() -> None:
    bvh, rays = core.build(soup(20), "lbvh", 4), random_rays(3)
    with pytest.raises(ValueError, match="unknown shape 'round'; there are: automatic, measured"):
        core.trace(bvh, *rays, device="opencl", shape="round")
    with pytest.raises(
        ValueError, match="shape 'single' is for OpenCL devices, not for device cpu"
    ):
        core.trace(bvh, *rays, shape="single")
    with pytest.raises(ValueError, match="octant"):
        core.trace(bvh, *rays, device="opencl", shape="octant")


def test_rays_that_end_and_begin_somewhere() -> None:
    bvh, (origins, directions) = core.build(soup(3000), "ploc", 4), random_rays(5000)
    random = np.random.default_rng(2)
    t_min = random.random(5000).astype(np.float32) * np.float32(0.1)
    t_max = t_min + random.random(5000).astype(np.float32)
    ours, theirs = (
        core.trace(bvh, origins, directions, t_min, t_max, device=device)
        for device in ("opencl", "cpu")
    )
    assert same_bits(ours, theirs) and ours.occluded.any() and not ours.occluded.all()


def test_rays_at_corners_and_edges_are_decided_as_exactly() -> None:
    mesh = soup(500)
    bvh = core.build(mesh, "lbvh", 4)
    corners = mesh.vertices[mesh.triangles]
    targets = np.concatenate([corners.reshape(-1, 3), corners[:, :2].mean(axis=1)])
    origins = np.full_like(targets, 0.5)
    rays = origins, (targets - origins).astype(np.float32)
    assert same_bits(core.trace(bvh, *rays, device="opencl"), core.trace(bvh, *rays))


def test_no_rays() -> None:
    bvh = core.build(soup(10), "lbvh")
    for reorder in (False, True):
        hit = core.trace(bvh, np.zeros((0, 3)), np.zeros((0, 3)), reorder=reorder, device="opencl")
        assert hit.t.shape == (0,)


def test_many_threads_may_call_at_once() -> None:
    mesh, rays = soup(2000), random_rays(2000)
    expected = core.trace(core.build(mesh, "lbvh"), *rays)
    bvh = core.build(mesh, "lbvh", device="opencl")
    wrong: list[int] = []

    def work(number: int) -> None:
        tree = bvh if number % 2 else core.build(mesh, "lbvh", device="opencl")
        for _ in range(3):
            if not same_bits(core.trace(tree, *rays, device="opencl"), expected):
                wrong.append(number)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []
