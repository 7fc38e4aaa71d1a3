# SPDX-License-Identifier: GPL-3.0-or-later
"""`make paper`: its files, the deviation from the paper, and what it says of missing parts."""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bvh_lab.native import core

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
sys.path.insert(0, str(SCRIPTS))
import paper
import paper_tables


@pytest.fixture()
def scene(tmp_path: Path) -> Path:
    random = np.random.default_rng(0)
    corners = random.random((200, 1, 3)) + 0.1 * random.random((200, 3, 3))
    path = tmp_path / "tiny_scene.npz"
    np.savez(
        path,
        vertices=corners.reshape(-1, 3).astype(np.float32),
        triangles=np.arange(600, dtype=np.uint32).reshape(-1, 3),
    )
    return path


@pytest.fixture()
def table(tmp_path: Path) -> Path:
    path = tmp_path / "costs.csv"
    path.write_text(
        "scene,branching,builder,bvh_cost\n"
        "TinyScene,2,LBVH,40\nTinyScene,8,LBVH,25\nTinyScene,2,SBVH,30\nOther,2,LBVH,7\n"
    )
    return path


def run(scene: Path, table: Path, *words: str) -> tuple[int, Path]:
    out = scene.parent / "out"
    code = paper.main([str(scene), "--out", str(out), "--paper-costs", str(table), *words])
    return code, out / scene.stem


def read(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_files_hold_costs_and_deviations(scene: Path, table: Path, capsys: Any) -> None:
    code, out = run(scene, table, "--builders", "lbvh,sbvh", "--metrics")
    assert code == 0
    assert sorted(path.name for path in out.iterdir()) == ["cost.csv", "cost.txt"]
    arrays = np.load(scene)
    mesh = core.Mesh(arrays["vertices"], arrays["triangles"])
    rows = read(out / "cost.csv")
    assert [(row["builder"], int(row["branching"])) for row in rows] == [
        (builder, branching) for builder in ("lbvh", "sbvh") for branching in (2, 4, 8)
    ]
    paper_costs = {("lbvh", 2): 40.0, ("lbvh", 8): 25.0, ("sbvh", 2): 30.0}
    for row in rows:
        branching = int(row["branching"])
        bvh = core.build(mesh, row["builder"], branching=branching)
        assert float(row["cost"]) == bvh.cost()
        known = paper_costs.get((row["builder"], branching))
        assert row["paper_cost"] == ("" if known is None else str(known))
        if known is not None:
            assert float(row["deviation_percent"]) == pytest.approx(
                (bvh.cost() - known) / known * 100, abs=1e-9
            )
        assert float(row["build_ratio"]) > 0
        assert float(row["epo"]) == core.metrics(bvh)["epo"]
    printed = capsys.readouterr()
    assert printed.out == (out / "cost.txt").read_text()
    assert "costs for TinyScene" in printed.out and "EPO" in printed.out
    lines = printed.err.splitlines()
    assert len(lines) == 2 and lines[0].startswith("LBVH") and lines[1].startswith("SBVH")


def test_deviation_is_percent_above_the_paper() -> None:
    assert paper_tables.Cell(103.0, 100.0).deviation == pytest.approx(3.0)
    assert paper_tables.Cell(49.5, 50.0).deviation == pytest.approx(-1.0)
    assert paper_tables.Cell(49.5, None).deviation is None
    row = paper_tables.Row("lbvh", "LBVH", {2: paper_tables.Cell(103.0, 100.0)}, 1.0, 0.5)
    assert "103.00   100  +3.00%" in paper_tables.row_text(row, with_paper=True)
    assert "%" not in paper_tables.row_text(row, with_paper=False)


def test_a_scene_of_another_name_has_no_deviation_unless_told(
    scene: Path, table: Path, capsys: Any
) -> None:
    other = scene.rename(scene.with_name("elsewhere.npz"))
    code, out = run(other, table, "--builders", "lbvh")
    printed = capsys.readouterr()
    assert code == 0 and "none of the paper's scenes" in printed.err
    assert "No deviation is shown" in printed.out and "%" not in printed.out
    code, out = run(other, table, "--builders", "lbvh", "--paper-scene", "Other")
    assert code == 0 and read(out / "cost.csv")[0]["paper_cost"] == "7.0"
    assert run(other, table, "--paper-scene", "Nowhere")[0] == 2
    assert "the paper has no scene 'Nowhere'; it has TinyScene, Other" in capsys.readouterr().err


def test_what_is_missing_is_said_and_the_rest_done(
    scene: Path, tmp_path: Path, capsys: Any
) -> None:
    code, out = run(scene, tmp_path / "nothing.csv", "--builders", "kdtree,lbvh")
    printed = capsys.readouterr()
    assert code == 1
    assert "there are no costs of the paper to compare with" in printed.err
    assert "kdtree failed: this build of the core has no such builder" in printed.err
    rows = read(out / "cost.csv")
    assert rows[0]["builder"] == "kdtree" and "no such builder" in rows[0]["error"]
    assert [row["builder"] for row in rows[1:]] == ["lbvh"] * 3
    assert "kdtree     failed" in printed.out


def test_a_failing_builder_leaves_the_others(scene: Path, table: Path, capsys: Any) -> None:
    code, out = run(scene, table, "--builders", "sbvh,lbvh", "--set", "sbvh.magic=1")
    assert code == 1 and "has no parameter 'magic'" in capsys.readouterr().err
    assert [row["builder"] for row in read(out / "cost.csv")] == ["sbvh", *["lbvh"] * 3]


def test_settings_reach_the_builder(scene: Path, table: Path, capsys: Any) -> None:
    code, _ = run(scene, table, "--builders", "sbvh", "--set", "sbvh.spatial_bins=16")
    assert code == 0 and "sbvh.spatial_bins=16" in capsys.readouterr().out
    assert run(scene, table, "--set", "sbvh.alpha")[0] == 2
    assert run(scene, table, "--set", "nobody.alpha=1")[0] == 2
    assert run(scene.with_name("absent.npz"), table)[0] == 2


def test_the_paper_scene_is_found_by_the_files_name() -> None:
    scenes = ["CrytekSponza", "Sibenik", "HappyBuddha"]
    assert paper.paper_scene("crytek_sponza", scenes) == "CrytekSponza"
    assert paper.paper_scene("sibenik", scenes) == "Sibenik"
    assert paper.paper_scene("happy-buddha", scenes) == "HappyBuddha"
    assert paper.paper_scene("dabrovic_sponza", scenes) is None


def annealed(builder: str, costs: list[float]) -> Any:
    row = paper_tables.Row(builder, builder.upper(), seconds=4.0, lbvh_seconds=0.5, ended="done")
    row.steps = [(i, 1.0 + i, cost) for i, cost in enumerate(costs)]
    row.cells = {2: paper_tables.Cell(costs[-1], None)}
    return row


def test_annealing_leaves_a_curve_of_cost_over_time(tmp_path: Path) -> None:
    rows = [annealed("prbvh", [90.0, 80.0]), annealed("prbvh_a", [90.0, 85.0, 79.0])]
    paper.write_results(rows[:1], [], False, tmp_path)
    assert not (tmp_path / "cost_over_time.csv").exists()  # nothing anneals
    paper.write_results(rows, [], False, tmp_path)
    curve = read(tmp_path / "cost_over_time.csv")
    assert [float(step["cost"]) for step in curve] == [90, 80, 90, 85, 79]
    assert [float(step["lbvh_builds"]) for step in curve] == [2, 4, 2, 4, 6]
    picture = tmp_path / "cost_over_time.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert not list(tmp_path.glob(".*"))
    assert read(tmp_path / "cost.csv")[1]["iterations"] == "2"


def test_iterations_are_for_the_builders_that_anneal() -> None:
    arguments = paper.parse(["scene.npz", "--iterations", "7", "--set", "atrbvh.iterations=5"])
    params = paper.chosen_params(arguments)
    assert params["prbvh_a"]["iterations"] == params["prbvh_sa"]["iterations"] == 7
    assert params["atrbvh"] == {"iterations": 5}
