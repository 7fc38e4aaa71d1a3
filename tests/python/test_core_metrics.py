# SPDX-License-Identifier: GPL-3.0-or-later
"""core.metrics: what it gives, what it refuses, and how it runs."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
import pytest
from bvh_lab.native import core

KEYS = {
    "cost",
    "epo",
    "leaf_count_mean",
    "leaf_count_deviation",
    "leaf_count_error",
    "max_depth",
    "mean_leaf_depth",
    "leaf_sizes",
    "nodes",
    "leaves",
    "references",
    "bytes",
}


def soup(count: int, size: float = 0.1) -> Any:
    random = np.random.default_rng(0)
    corners = random.random((count, 1, 3)) + size * (random.random((count, 3, 3)) - 0.5)
    vertices = corners.reshape(-1, 3).astype(np.float32)
    return core.Mesh(vertices, np.arange(3 * count, dtype=np.uint32).reshape(-1, 3))


@pytest.mark.parametrize("branching", [2, 4, 8])
@pytest.mark.parametrize("builder", [entry["id"] for entry in core.builders()])
def test_metrics_agree_with_the_tree(builder: str, branching: int) -> None:
    params = {"prbvh_a": {"iterations": 20}, "prbvh_sa": {"iterations": 20}}
    bvh = core.build(soup(2000), builder, branching=branching, params=params.get(builder, {}))
    metrics = core.metrics(bvh, lines=5000)
    assert set(metrics) == KEYS
    assert metrics["cost"] == bvh.cost()
    for name in ("nodes", "leaves", "references", "bytes", "max_depth"):
        assert metrics[name] == bvh.stats[name]
    sizes = metrics["leaf_sizes"]
    assert sizes.sum() == metrics["leaves"] and sizes[0] == 0 and sizes[-1] > 0
    assert (sizes * np.arange(len(sizes))).sum() == metrics["references"]
    assert 1 <= metrics["mean_leaf_depth"] <= metrics["max_depth"]
    assert 0 < metrics["epo"] < metrics["cost"]
    assert metrics["leaf_count_mean"] > 0
    assert 0 < metrics["leaf_count_error"] < 0.1 * metrics["leaf_count_deviation"]


def test_known_numbers_of_two_triangles() -> None:
    # The half of the lower triangle that lies in the upper one's box, of all the area there is.
    vertices = [[0, 0, 0], [2, 0, 0], [0, 2, 0], [1, 0, 0], [3, 0, 0], [1, 4, 2]]
    mesh = core.Mesh(np.array(vertices, np.float32), np.array([[0, 1, 2], [3, 4, 5]]))
    bvh = core.build(mesh, "sah", branching=2, traversal=1.0, intersection=1e5)
    assert bvh.stats["leaves"] == 2
    area = [2.0, 0.5 * 2.0 * np.hypot(4.0, 2.0)]
    metrics = core.metrics(bvh, traversal=1.0, intersection=10.0)
    # x from 1 to 2 of the flat one, area 1/2; the other one leaves z = 0 at once.
    assert metrics["epo"] == pytest.approx(10.0 * 0.5 / sum(area), rel=1e-12)


def test_costs_scale_the_overlap() -> None:
    bvh = core.build(soup(500, 0.4), "lbvh", branching=4)
    both, first, second = (
        core.metrics(bvh, traversal=t, intersection=i, lines=100)["epo"]
        for t, i in ((3.0, 2.0), (1.0, 0.0), (0.0, 1.0))
    )
    assert both == pytest.approx(3 * first + 2 * second, rel=1e-12)


def test_metrics_repeat_on_any_number_of_threads() -> None:
    bvh = core.build(soup(3000), "sbvh")
    one, many = (core.metrics(bvh, lines=3000, threads=threads) for threads in (1, 3))
    assert one.pop("leaf_sizes").tolist() == many.pop("leaf_sizes").tolist()
    assert one == many


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"lines": 1}, "lines must be 2 to"),
        ({"lines": -5}, "lines must be 2 to"),
        ({"traversal": -1.0}, "costs must be at least 0"),
        ({"intersection": float("nan")}, "costs must be at least 0"),
        ({"threads": -1}, "threads must be 0"),
    ],
)
def test_bad_arguments_are_named(arguments: dict[str, Any], sentence: str) -> None:
    bvh = core.build(soup(10), "lbvh")
    with pytest.raises(ValueError, match=sentence):
        core.metrics(bvh, **arguments)


def test_a_token_stops_it_and_other_threads_run_meanwhile() -> None:
    bvh = core.build(soup(20_000, 1.0), "lbvh", branching=2)  # all overlap: many seconds
    token = core.Token()
    cancelled_at = []

    def cancel() -> None:
        time.sleep(0.3)
        cancelled_at.append(time.monotonic())
        token.cancel()

    thread = threading.Thread(target=cancel)
    thread.start()
    with pytest.raises(core.Cancelled):
        core.metrics(bvh, token=token)
    assert time.monotonic() - cancelled_at[0] < 1.0  # 0.1 s on an idle machine
    thread.join()
    assert token.stage == "measuring end-point overlap"
