"""Solutions are saved to files and read again."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from known_metrics import Sphere
from known_problems import PlaneAroundDisc
from numpy.testing import assert_array_equal

import geodesic_ocp as go

START, TARGET = (0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1), (0.10, 0.45, -0.05)  # [rad], [m]


@pytest.mark.slow
def test_saved_solution_is_read_unchanged(tmp_path: Path, arm: go.Model) -> None:
    reach = go.Reach(arm, START, TARGET)
    sphere = go.PointToPoint(Sphere(), (1.0, 0.0), (1.4, 1.9))
    for problem, tolerance in ((sphere, 1e-3), (PlaneAroundDisc(), 1e-3), (reach, None)):
        solution = go.solve(problem, tolerance=tolerance)
        file = solution.save(tmp_path / "solution.json")
        again = go.ocp.load_solution(file, problem)
        assert again.path.grid == solution.path.grid
        assert np.array_equal(again.path.nodes, solution.path.nodes)
        assert again.stats == solution.stats
        assert again.violations == solution.violations
        assert again.certificate == solution.certificate
        assert again.multipliers.keys() == solution.multipliers.keys()
        for name, values in solution.multipliers.items():
            assert np.array_equal(again.multipliers[name], values)
        assert go.solve(problem, grid=again.path.grid, guess=again).stats.success


def test_malformed_files_are_named(tmp_path: Path) -> None:
    problem = PlaneAroundDisc()
    good = go.solve(problem).save(tmp_path / "good.json")
    other = go.PointToPoint(Sphere(), (1.0, 0.0), (1.4, 1.9))
    with pytest.raises(go.RecordingError, match="a solution of PlaneAroundDisc, not of PointToP"):
        go.ocp.load_solution(good, other)
    record = json.loads(good.read_text())
    for change, message in (
        ({"version": 9}, "has version 9, expected 1"),
        ({"format": "soup"}, "is not a file of a solution"),
        ({"joint_names": ["a"]}, "its joints"),
        ({"nodes": [[0.0, 1.0]]}, "nodes must have shape"),
        ({"stats": {}}, "missing required field `success`"),
        ({"problem": None}, "a solution of None, not of PlaneAroundDisc"),
    ):
        bad = tmp_path / "bad.json"
        bad.write_text(json.dumps(record | change))
        with pytest.raises(go.RecordingError, match=message):
            go.ocp.load_solution(bad, problem)
    bad.write_text("{")
    with pytest.raises(go.RecordingError, match="is not JSON"):
        go.ocp.load_solution(bad, problem)
    with pytest.raises(go.RecordingError, match="there is no such file"):
        go.ocp.load_solution(tmp_path / "none.json", problem)


def test_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    solution = go.solve(PlaneAroundDisc())
    file = solution.save(tmp_path / "solution.json")
    before = file.read_bytes()

    def disk_full(path: Path, text: str, **options: Any) -> None:
        """The beginning is written before the disk is full."""
        with path.open("w", **options) as stream:
            stream.write(text[:100])
        raise OSError("no space left on device")

    monkeypatch.setattr(Path, "write_text", disk_full)
    with pytest.raises(OSError, match="no space left"):
        go.solve(PlaneAroundDisc(radius=0.4)).save(file)
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]
    with pytest.raises(OSError, match="none"):
        solution.save(tmp_path / "none" / "solution.json")


def test_model_with_other_limits_or_hand_is_refused(tmp_path: Path, arm: go.Model) -> None:
    target = arm.hand_pose(START)[1] + [0.0, 0.02, 0.0]
    file = go.solve(go.Reach(arm, START, target, limits=False)).save(tmp_path / "solution.json")
    wider = arm.with_limits(arm.lower, arm.upper + 0.1)
    with pytest.raises(go.RecordingError, match=r"upper of the problem's model 'human right arm'"):
        go.ocp.load_solution(file, go.Reach(wider, START, target, limits=False))
    other = arm.with_hand("right forearm")
    with pytest.raises(go.RecordingError, match=r"hand of the problem's model 'human right arm'"):
        go.ocp.load_solution(file, go.Reach(other, START, target, limits=False))
    assert go.ocp.load_solution(file, go.Reach(arm, START, target, limits=False)).stats.success


@dataclass(frozen=True)
class WithObstacles(PlaneAroundDisc):
    """Obstacles as a field; they do not take part."""

    obstacles: tuple[Any, ...] = ()


def test_obstacles_are_saved(tmp_path: Path) -> None:
    obstacles = (
        go.Ball((0.1, 0.2, 1 / 3), 0.05, name="lamp"),
        go.Capsule((0.0, 0.0, 1.0), (0.0, 0.0, 2.0), 0.1),
        go.HalfSpace((0.0, 0.0, -0.5), (0.0, 0.0, 1.0), "floor"),
    )
    file = go.solve(WithObstacles(obstacles=obstacles)).save(tmp_path / "solution.json")
    again = go.ocp.load_solution(file).problem
    assert isinstance(again, WithObstacles)
    assert again.obstacles == obstacles


class NoDataclass(go.Problem):
    """A straight line whose goal is not a field."""

    def __init__(self, goal: float) -> None:
        self.goal = goal

    @property
    def metric(self) -> go.Metric:
        return go.Euclidean(1)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, 0.0), (q1, self.goal)]


def test_problem_that_is_no_dataclass_must_be_given(tmp_path: Path) -> None:
    file = go.solve(NoDataclass(2.0)).save(tmp_path / "solution.json")
    with pytest.raises(
        go.RecordingError, match="does not hold the fields of NoDataclass; use load_solution"
    ):
        go.ocp.load_solution(file)
    assert go.ocp.load_solution(file, NoDataclass(2.0)).path(1.0) == pytest.approx(2.0)
    with pytest.raises(go.RecordingError, match="violates this problem's conditions by 1"):
        go.ocp.load_solution(file, NoDataclass(3.0))


class Undefined(NoDataclass):
    """A constraint that is not a number anywhere."""

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [(0.0, ca.sqrt(-1.0 - q**2), 1.0, "root")]


def test_iterate_that_is_not_a_number_is_saved(tmp_path: Path) -> None:
    grid = go.Grid(2, 2)
    line = go.Path(go.Euclidean(1), grid, grid.nodes[:, None])
    failed = go.solve(Undefined(1.0), grid=grid, guess=line, throw=False)
    assert not failed.stats.success
    file = failed.save(tmp_path / "solution.json")
    record = json.loads(file.read_text(), parse_constant=pytest.fail)
    assert record["stats"]["max_path_violation"] == "inf"
    again = go.ocp.load_solution(file, Undefined(1.0))
    assert again.stats.status == failed.stats.status
    assert again.record() == failed.record()
    assert_array_equal(again.path.nodes, failed.path.nodes)
    for name, values in failed.multipliers.items():
        assert_array_equal(again.multipliers[name], values)


def test_file_is_standard_json(tmp_path: Path) -> None:
    around = go.Path.through(go.Euclidean(2), [(-1.0, 0.0), (0.0, 1.0), (1.0, 0.0)])
    options = {"max_iter": 1}
    solution = go.solve(PlaneAroundDisc(), guess=around, throw=False, ipopt=options)
    file = solution.save(tmp_path / "solution.json")
    record = json.loads(file.read_text(), parse_constant=lambda name: pytest.fail(name))
    assert record["problem"] == "PlaneAroundDisc"
    assert np.shape(record["nodes"]) == (len(record["s"]), 2)
    assert record["stats"]["status"].startswith("Ipopt reached its iteration limit")
