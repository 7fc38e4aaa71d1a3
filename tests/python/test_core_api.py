# SPDX-License-Identifier: GPL-3.0-or-later
"""The plain Python API: checks at the edge, threads, progress, and the arrays that come back."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
import pytest
from builder_params import ANNEALING, fast_params
from bvh_lab.native import core
from bvh_lab.study.plan import BUILDERS

TRIANGLE = (np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], dtype=np.uint32))


def soup(count: int, seed: int = 0, size: float = 0.1) -> Any:
    random = np.random.default_rng(seed)
    corners = random.random((count, 1, 3)) + size * (random.random((count, 3, 3)) - 0.5)
    vertices = corners.reshape(-1, 3).astype(np.float32)
    return core.Mesh(vertices, np.arange(3 * count, dtype=np.uint32).reshape(-1, 3))


def random_rays(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    origins = random.random((count, 3)).astype(np.float32)
    return origins, random.normal(size=(count, 3)).astype(np.float32)


@pytest.mark.parametrize(
    ("vertices", "triangles", "sentence"),
    [
        (np.eye(3), np.zeros((0, 3), np.uint32), "no triangles"),
        (np.zeros((3, 2)), TRIANGLE[1], "vertices must have shape"),
        (np.array([["a"] * 3]), TRIANGLE[1], "vertices must be an array of numbers"),
        (np.array([[0, 0, 0], [1, np.nan, 0], [0, 1, 0]]), TRIANGLE[1], "vertex 1 is"),
        (np.array([[0, 0, 0], [1, 0, 0], [0, np.inf, 0]]), TRIANGLE[1], "vertex 2 is"),
        (np.eye(3), np.array([[0, 1, 2], [0, 3, 1]]), "triangle 1 refers to vertex 3"),
        (np.eye(3), np.array([[0, 1, -1]]), "triangle 0 refers to vertex -1"),
        (np.eye(3), np.array([[0.0, 1.0, 2.0]]), "triangles must be an array of integers"),
        (np.eye(3), np.array([0, 1, 2]), "triangles must have shape"),
    ],
)
def test_bad_meshes_are_refused_with_the_first_bad_index(
    vertices: np.ndarray, triangles: np.ndarray, sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence):
        core.Mesh(vertices, triangles)


def test_mesh_keeps_what_it_was_given() -> None:
    for dtype in (np.int32, np.int64, np.uint8, np.uint32, np.uint64):
        mesh = core.Mesh(TRIANGLE[0].astype(np.float64), TRIANGLE[1].astype(dtype))
        assert np.array_equal(mesh.vertices, TRIANGLE[0])
        assert np.array_equal(mesh.triangles, TRIANGLE[1])
        assert np.array_equal(mesh.bounds, [[0, 0, 0], [1, 1, 1]])
        with pytest.raises(ValueError, match="read-only"):
            mesh.vertices[0, 0] = 5


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"builder": "kdtree"}, "unknown builder 'kdtree'; there are lbvh, .*, sbvh"),
        ({"branching": 3}, "branching must be 2, 4 or 8, not 3"),
        ({"device": "gpu"}, "unknown device 'gpu'; there are: cpu"),
        ({"threads": -1}, "threads must be 0"),
        ({"params": {"magic": 1}}, "has no parameter 'magic'"),
        (
            {"builder": "sbvh", "params": {"alpha": -1}},
            "parameter 'alpha' of builder 'sbvh' must be",
        ),
        ({"builder": "sbvh", "params": {"alpha": "x"}}, "parameter 'alpha' must be a number"),
        ({"traversal": 0.0}, "costs must be above 0"),
        ({"intersection": float("nan")}, "costs must be above 0"),
    ],
)
def test_bad_build_arguments_are_named(arguments: dict[str, Any], sentence: str) -> None:
    mesh = core.Mesh(*TRIANGLE)
    with pytest.raises(ValueError, match=sentence):
        core.build(mesh, **{"builder": "lbvh", **arguments})


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"origins": np.zeros((2, 2))}, r"origins must have shape \(N, 3\), not \(2, 2\)"),
        ({"directions": np.ones((1, 3))}, r"directions must have shape \(2, 3\)"),
        ({"origins": [[0, 0, 0], [0, np.nan, 0]]}, "ray 1: the origin is not finite"),
        ({"directions": [[1, 0, 0], [0, 0, 0]]}, "ray 1: the direction is zero"),
        ({"directions": [[np.inf, 0, 0], [0, 0, 1]]}, "ray 0: the direction is not finite"),
        ({"t_min": -1.0}, "ray 0: t_min must be"),
        ({"t_max": [1.0, np.nan]}, "ray 1: t_max is not a number"),
        ({"t_max": [1.0, 2.0, 3.0]}, r"t_max must be one number or of shape \(2,\)"),
        ({"device": "gpu"}, "unknown device 'gpu'; there are: cpu"),
    ],
)
def test_bad_rays_are_named(arguments: dict[str, Any], sentence: str) -> None:
    bvh = core.build(core.Mesh(*TRIANGLE), "lbvh")
    given_rays = {"origins": np.zeros((2, 3)), "directions": np.ones((2, 3))}
    with pytest.raises(ValueError, match=sentence):
        core.trace(bvh, **{**given_rays, **arguments})


def test_a_miss_and_a_hit_look_as_documented() -> None:
    bvh = core.build(core.Mesh(*TRIANGLE), "sah", branching=2)
    hit = core.trace(bvh, [[0, 0, 0], [0, 0, 0]], [[1, 1, 1], [-1, -1, -1]])
    assert hit.triangle.tolist() == [0, 0xFFFFFFFF] and hit.triangle.dtype == np.uint32
    assert hit.t[0] == pytest.approx(1 / 3) and np.isinf(hit.t[1])
    assert hit.u.tolist() == pytest.approx([1 / 3, 0]) and hit.u.dtype == np.float32
    assert hit.occluded.tolist() == [True, False] and hit.occluded.dtype == bool
    assert hit.node_visits is None
    assert hit.seconds == hit.key_seconds + hit.sort_seconds + hit.traverse_seconds
    occluded = core.trace(bvh, [[0, 0, 0]], [[1, 1, 1]], any_hit=True)
    assert occluded.occluded.tolist() == [True] and occluded.t is None


def test_no_rays_give_no_hits() -> None:
    bvh = core.build(core.Mesh(*TRIANGLE), "lbvh")
    for reorder in (False, True):
        hit = core.trace(bvh, np.zeros((0, 3)), np.zeros((0, 3)), reorder=reorder)
        assert hit.t.shape == (0,)


@pytest.mark.parametrize("builder", [entry["id"] for entry in core.builders()])
def test_stats_agree_with_each_other(builder: str) -> None:
    mesh = soup(500)
    for branching in (2, 4, 8):
        bvh = core.build(mesh, builder, branching, params=fast_params(builder))
        bvh.validate()
        stats = bvh.stats
        assert stats["nodes"] == stats["interior_nodes"] + stats["leaves"]
        assert stats["references"] >= 500
        assert stats["average_leaf_size"] == stats["references"] / stats["leaves"]
        assert stats["node_bytes"] == 32 * branching * stats["interior_nodes"]
        assert stats["bytes"] == stats["node_bytes"] + stats["leaf_bytes"]
        assert stats["build_seconds"] == stats["tree_seconds"] + stats["collapse_seconds"] > 0
        assert bvh.builder == builder and bvh.branching == branching and bvh.mesh is mesh
        # Eq. 2 and 3 are linear in the two constants.
        assert bvh.cost(3, 2) == pytest.approx(3 * bvh.cost(1, 0) + 2 * bvh.cost(0, 1))


@pytest.mark.parametrize("builder", [entry["id"] for entry in core.builders()])
def test_one_tree_collapses_to_each_branching_factor(builder: str) -> None:
    mesh = soup(2000)
    params = fast_params(builder)
    tree = core.build_tree(mesh, builder, params=params)
    assert tree.builder == builder and tree.mesh is mesh and tree.seconds > 0
    assert tree.references >= 2000
    collapsed = tree.collapse(2)
    assert collapsed.cost() < tree.cost()  # leaves of several references cost less
    for branching in (2, 4, 8):
        bvh = tree.collapse(branching)
        bvh.validate()
        assert bvh.cost() == core.build(mesh, builder, branching, params=params).cost()
    with pytest.raises(ValueError, match="branching must be 2, 4 or 8, not 5"):
        tree.collapse(5)


@pytest.mark.parametrize(
    "builder",
    [b["id"] for b in core.builders() if any(p["name"] == "iterations" for p in b["parameters"])],
)
def test_iterations_are_logged_and_limited(builder: str) -> None:
    mesh = soup(20000)
    log = core.build_tree(mesh, builder, params={"iterations": 2}).log
    assert log["ended"] in ("iteration limit", "converged")
    iterations, seconds, costs = zip(*log["steps"], strict=True)
    assert iterations[0] == 0 and sorted(set(iterations)) == list(iterations)
    if builder not in ANNEALING:  # they end by hill climbing until it converges
        assert len(iterations) <= 3
    assert list(seconds) == sorted(seconds)
    if builder != "trbvh":  # it minimises the cost after the collapse, which this is not
        assert list(costs) == sorted(costs, reverse=True), "the cost of the best tree never rises"
    token = core.Token()
    tree = core.build_tree(mesh, builder, params={"max_seconds": 1e-6}, token=token)
    assert tree.log["ended"] == "time limit"
    tree.collapse(8).validate()
    assert token.cost == tree.log["steps"][-1][2]


@pytest.mark.parametrize("builder", [entry["id"] for entry in core.builders()])
def test_trees_do_not_depend_on_the_thread_count(builder: str) -> None:
    mesh = soup(20000)
    params = fast_params(builder)
    one, many = (core.build(mesh, builder, threads=n, params=params) for n in (1, 5))
    assert one.cost() == many.cost()
    assert {k: v for k, v in one.stats.items() if "seconds" not in k and k != "threads"} == {
        k: v for k, v in many.stats.items() if "seconds" not in k and k != "threads"
    }


@pytest.mark.parametrize("builder", [entry["id"] for entry in core.builders()])
def test_cancel_stops_a_build_soon_and_leaves_the_gil(builder: str) -> None:
    mesh = soup(400000)
    token = core.Token()
    raised: list[float] = []

    def work() -> None:
        try:
            while True:  # a build can end before the cancel
                core.build(mesh, builder, token=token)
        except core.Cancelled:
            raised.append(time.monotonic())

    worker = threading.Thread(target=work)
    worker.start()
    time.sleep(0.3)  # the main thread runs on: the GIL is released
    asked = time.monotonic()
    token.cancel()
    worker.join(timeout=20)
    assert raised, "the build went on after cancel()"
    # 0.1 s is the promise; a loaded machine may wake us late.
    assert raised[0] - asked < 1.0
    assert token.cancelled and isinstance(token.stage, str) and 0 <= token.fraction <= 1


def test_builders_and_devices_say_what_there_is() -> None:
    builders = {entry["id"]: entry for entry in core.builders()}
    assert list(builders) == list(BUILDERS)
    for entry in builders.values():
        assert entry["label"] and entry["source"]
        for parameter in entry["parameters"]:
            assert parameter["minimum"] <= parameter["default"] <= parameter["maximum"]
            assert parameter["description"] and parameter["source"]
    devices = {entry["id"]: entry for entry in core.devices()}
    assert devices["cpu"]["available"] and devices["cpu"]["threads"] >= 1
    for device in devices.values():  # more in test_opencl_devices.py
        assert device["available"] or device["reason"]
