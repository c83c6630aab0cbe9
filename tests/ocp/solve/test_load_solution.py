"""Solutions that are saved and read again."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from known_metrics import Sphere
from known_problems import PlaneAroundDisc

import geodesic_ocp as go


def test_a_solution_comes_back_whole(tmp_path: Path, arm: go.Model) -> None:
    reach = go.Reach(arm, [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1], position=[0.10, 0.45, -0.05])
    for problem in (go.PointToPoint(Sphere(), (1.0, 0.0), (1.4, 1.9)), PlaneAroundDisc(), reach):
        solution = go.solve(problem, tolerance=1e-4)
        file = (solution).save(tmp_path / "solution.json")
        again = go.load_solution(file, problem)
        assert again.path.grid == solution.path.grid
        assert np.array_equal(again.path.nodes, solution.path.nodes)
        assert again.stats == solution.stats
        assert again.violations == solution.violations
        assert again.certificate == solution.certificate
        assert again.multipliers.keys() == solution.multipliers.keys()
        for name, values in solution.multipliers.items():
            assert np.array_equal(again.multipliers[name], values)
        assert go.solve(problem, grid=again.path.grid, guess=again).stats.success


def test_files_are_json_that_others_read(tmp_path: Path) -> None:
    solution = go.solve(PlaneAroundDisc(), throw=False, ipopt={"max_iter": 1})
    file = (solution).save(tmp_path / "solution.json")
    record = json.loads(file.read_text(), parse_constant=lambda name: pytest.fail(name))
    assert record["problem"] == "PlaneAroundDisc"
    assert np.shape(record["nodes"]) == (len(record["s"]), 2)
    assert record["stats"]["status"].startswith("Ipopt used up its iterations")


def test_files_that_are_none_are_named(tmp_path: Path) -> None:
    problem = PlaneAroundDisc()
    good = (go.solve(problem)).save(tmp_path / "good.json")
    other = go.PointToPoint(Sphere(), (1.0, 0.0), (1.4, 1.9))
    with pytest.raises(go.RecordingError, match="a solution of PlaneAroundDisc, not of PointToP"):
        go.load_solution(good, other)
    record = json.loads(good.read_text())
    for change, message in (
        ({"version": 9}, "has version 9, expected 2"),
        ({"format": "soup"}, "is not a file of a solution"),
        ({"joint_names": ["a"]}, "its joints"),
        ({"nodes": [[0.0, 1.0]]}, "nodes must have shape"),
        ({"stats": {}}, "'success' is missing"),
        ({"problem": None}, "a solution of None, not of PlaneAroundDisc"),
    ):
        bad = tmp_path / "bad.json"
        bad.write_text(json.dumps(record | change))
        with pytest.raises(go.RecordingError, match=message):
            go.load_solution(bad, problem)
    bad.write_text("{")
    with pytest.raises(go.RecordingError, match="is not JSON"):
        go.load_solution(bad, problem)
    with pytest.raises(go.RecordingError, match="there is no such file"):
        go.load_solution(tmp_path / "none.json", problem)
