"""Every problem class in problems/ and in the package, found by itself: all that can be checked."""

from __future__ import annotations

import inspect
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.cli.problem_file import problem_classes
from geodesic_ocp.ocp.problem.parse_conditions import parse_conditions

GALLERY = Path(__file__).resolve().parents[1] / "problems"


def discovered() -> list[Any]:
    """The canonical instance of every class, and one of the package's own."""
    arm, start = go.human_arm(), (0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1)
    found: list[Any] = [
        go.PointToPoint(go.Euclidean(3), (0.0, 0.0, 0.0), (1.0, 2.0, 2.0)),
        go.Reach(arm, start, (0.1, 0.45, -0.05)),
    ]
    for file in sorted(GALLERY.glob("*.py")):
        for kind in problem_classes(file):
            try:
                found.append(kind())
            except ValueError as error:
                if "not installed" not in str(error):
                    raise
                skip = pytest.mark.skip(reason=f"{kind.__name__}: {error}")
                found.append(pytest.param(kind, marks=skip, id=kind.__name__))
    return found


PROBLEMS = discovered()


@pytest.fixture(scope="module", params=PROBLEMS, ids=lambda problem: type(problem).__name__)
def problem(request: pytest.FixtureRequest) -> go.Problem:
    return request.param


@pytest.fixture(scope="module")
def solution(problem: go.Problem) -> go.Solution:
    return go.solve(problem)


def held_back(problem: go.Problem) -> bool:
    """Whether anything but its ends is asked of the path."""
    q, v = (ca.SX.sym(name, problem.metric.dim) for name in "qv")
    return bool(problem.constraints(q, v)) or bool(problem.via(q))


def rounds_corners(problem: go.Problem) -> bool:
    return problem.continuous_velocity_at_via and bool(
        problem.via(ca.SX.sym("q", problem.metric.dim))
    )


def test_it_is_explained(problem: go.Problem) -> None:
    assert inspect.getdoc(type(problem))


def test_it_converges_and_meets_its_conditions(problem: go.Problem, solution: go.Solution) -> None:
    assert solution.stats.success
    assert solution.stats.max_node_violation < 1e-7
    terms = parse_conditions(problem)
    groups = (terms.fixed, terms.ends, *terms.via, terms.via_continuity)
    groups += (terms.bounds, terms.along_q, terms.along_qv)
    assert set(solution.multipliers) == {term.name for group in groups for term in group}


def test_it_is_locally_shortest(solution: go.Solution) -> None:
    assert solution.certificate.locally_shortest


def test_refinement_settles(problem: go.Problem, solution: go.Solution) -> None:
    """Twice as many segments change the energy by little."""
    grid = problem.grid
    fine = go.solve(problem, grid=go.Grid(2 * grid.segments, grid.degree))
    if rounds_corners(problem):
        corner = go.solve(replace(problem, continuous_velocity_at_via=False)).path.energy
        assert corner < fine.path.energy < solution.path.energy
        return
    # Where a constraint switches inside a segment, its error falls but slowly.
    change = 2e-3 if held_back(problem) else 1e-8
    assert fine.path.energy == pytest.approx(solution.path.energy, rel=change)


@pytest.mark.slow
def test_its_conditions_hold_between_the_nodes(problem: go.Problem) -> None:
    if rounds_corners(problem):
        pytest.skip("its corner is rounded the less the finer the grid is")
    refined = go.solve(problem, tolerance=1e-6)
    assert refined.stats.max_path_violation <= 1e-6


def test_speed_is_constant_where_nothing_holds_the_path(
    problem: go.Problem, solution: go.Solution
) -> None:
    if held_back(problem):
        pytest.skip("its constraints may do work")
    path = solution.path
    s = np.linspace(0.0, 1.0, 11)
    speeds = [problem.metric.norm(q, v) for q, v in zip(path(s), path(s, 1), strict=True)]
    assert speeds == pytest.approx([path.length] * 11, rel=1e-4)


def test_closed_form(problem: go.Problem, solution: go.Solution) -> None:
    s, path = np.linspace(0.0, 1.0, 21), solution.path
    if problem.exact_length is None and problem.exact(s) is None:
        pytest.skip("no closed form is known")
    if problem.exact_length is not None:
        accuracy = 5e-3 if held_back(problem) else 1e-8
        assert path.length == pytest.approx(problem.exact_length, rel=accuracy)
    expected = problem.exact(s)
    if expected is not None:
        assert path(s) == pytest.approx(expected, abs=1e-6)


def test_it_is_drawn(solution: go.Solution, tmp_path: Path) -> None:
    figure = solution.plot()
    assert all(axes.get_ylabel() for axes in figure.axes)
    figure.savefig(tmp_path / "picture.png", dpi=40)


def test_it_is_kept_in_a_file(problem: go.Problem, solution: go.Solution, tmp_path: Path) -> None:
    again = go.load_solution(solution.save(tmp_path / "solution.json"), problem)
    assert again.path.energy == solution.path.energy
    assert again.stats == solution.stats


def test_the_gallery_shows_it() -> None:
    """Every file has its picture, and a place in the list."""
    listed = (GALLERY / "README.md").read_text()
    for file in GALLERY.glob("*.py"):
        for kind in problem_classes(file):
            assert (GALLERY / "pictures" / f"{kind.__name__}.png").is_file()
            assert f"({file.name})" in listed
            assert f"pictures/{kind.__name__}.png" in listed
