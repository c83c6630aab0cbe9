"""Every problem class in problems/ and in the package is discovered, solved and checked."""

from __future__ import annotations

import inspect
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from drawing.test_path_scenes import check

import geodesic_ocp as go
from geodesic_ocp.cli.solve import problem_classes
from geodesic_ocp.drawing.playback_of import playback_of
from geodesic_ocp.ocp.problem import parse_conditions

GALLERY = Path(__file__).resolve().parents[1] / "problems"
EXPENSIVE = ("AroundBall", "BothArms", "CarryingCup", "ViaPoint", "WithinLimits")


def discovered_problems() -> list[Any]:
    """The default instance of every class in problems/, and one of each class of the package."""
    arm, start = go.human_arm(), (0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1)
    found: list[Any] = [
        go.PointToPoint(go.Euclidean(3), (0.0, 0.0, 0.0), (1.0, 2.0, 2.0)),
        go.Reach(arm, start, (0.1, 0.45, -0.05)),
    ]
    for file in sorted(GALLERY.glob("*.py")):
        for problem_class in problem_classes(file):
            name = problem_class.__name__
            if not issubclass(problem_class, go.Problem):
                continue  # a motion in time, see below
            try:
                slow = [pytest.mark.slow] if name in EXPENSIVE else []
                found.append(pytest.param(problem_class(), marks=slow, id=name))
            except ValueError as error:
                if "not installed" not in str(error):
                    raise
                skip = pytest.mark.skip(reason=f"{name}: {error}")
                found.append(pytest.param(problem_class, marks=skip, id=name))
    return found


PROBLEMS = discovered_problems()


@pytest.fixture(scope="module", params=PROBLEMS, ids=lambda problem: type(problem).__name__)
def problem(request: pytest.FixtureRequest) -> go.Problem:
    return request.param


@pytest.fixture(scope="module")
def solution(problem: go.Problem) -> go.ocp.Solution:
    return go.solve(problem)


def is_constrained(problem: go.Problem) -> bool:
    """Whether there are any conditions but those at the ends."""
    q, v = (ca.SX.sym(name, problem.metric.dim) for name in "qv")
    return bool(problem.constraints(q, v)) or bool(problem.via(q))


def test_class_has_a_docstring(problem: go.Problem) -> None:
    assert inspect.getdoc(type(problem))


def test_solve_converges_and_meets_all_conditions(
    problem: go.Problem, solution: go.ocp.Solution
) -> None:
    assert solution.stats.success
    assert solution.stats.max_node_violation < 1e-7
    terms = parse_conditions(problem)
    groups = (terms.fixed, terms.ends, *terms.via, terms.via_continuity)
    groups += (terms.bounds, terms.along_q, terms.along_qv)
    assert set(solution.multipliers) == {term.name for group in groups for term in group}


@pytest.mark.slow
def test_solution_is_locally_minimizing(solution: go.ocp.Solution) -> None:
    assert solution.certificate.locally_shortest


@pytest.mark.slow
def test_energy_converges_with_the_grid(problem: go.Problem, solution: go.ocp.Solution) -> None:
    """The energy hardly changes with twice as many segments."""
    grid = problem.grid
    # On a given grid, conditions may be violated between the nodes.
    finer = go.Grid(2 * grid.segments, grid.degree)
    fine = go.solve(problem, grid=finer, guess=solution, throw=False)
    if problem.via(ca.SX.sym("q", problem.metric.dim)):
        # Rounded corners cost energy, the less the finer the grid.
        rounded = replace(problem, continuous_velocity_at_via=True)
        costs = [go.solve(rounded, grid=each, throw=False).path.energy for each in (finer, grid)]
        assert fine.path.energy < costs[0] < costs[1]
    # Convergence is slow where a constraint becomes active inside a segment.
    change = 2e-3 if is_constrained(problem) else 1e-8
    assert fine.path.energy == pytest.approx(solution.path.energy, rel=change)


@pytest.mark.slow
def test_conditions_hold_between_the_nodes(problem: go.Problem, solution: go.ocp.Solution) -> None:
    refined = go.solve(problem, tolerance=1e-6, guess=solution)
    assert refined.stats.max_path_violation <= 1e-6


def test_speed_is_constant_without_constraints(
    problem: go.Problem, solution: go.ocp.Solution
) -> None:
    if is_constrained(problem):
        pytest.skip("constraint forces may do work")
    path = solution.path
    s = np.linspace(0.0, 1.0, 11)
    speeds = [problem.metric.norm(q, v) for q, v in zip(path(s), path(s, 1), strict=True)]
    assert speeds == pytest.approx([path.length] * 11, rel=1e-4)


def test_solution_agrees_with_its_closed_form(
    problem: go.Problem, solution: go.ocp.Solution
) -> None:
    s, path = np.linspace(0.0, 1.0, 21), solution.path
    if problem.exact_length is None and problem.exact(s) is None:
        pytest.skip("no closed form is known")
    if problem.exact_length is not None:
        accuracy = 5e-3 if is_constrained(problem) else 1e-8
        assert path.length == pytest.approx(problem.exact_length, rel=accuracy)
    expected = problem.exact(s)
    if expected is not None:
        assert path(s) == pytest.approx(expected, abs=1e-6)


@pytest.mark.slow
def test_figure_has_labels_and_is_written(solution: go.ocp.Solution, tmp_path: Path) -> None:
    figure = go.plot(solution)
    assert all(axes.get_ylabel() for axes in figure.axes if axes.axison and len(axes.get_yticks()))
    figure.savefig(tmp_path / "picture.png", dpi=20)


@pytest.mark.slow
def test_solution_is_shown(problem: go.Problem, solution: go.ocp.Solution) -> None:
    playback = playback_of(solution)
    check(playback)
    (scene,) = playback.scenes
    assert type(problem).__name__ in playback.title
    assert len(scene.solids) == len(problem.obstacles)
    if problem.metric.dim > 2 and not isinstance(problem.metric, go.Euclidean):
        assert scene.actors
        assert bool(scene.gaps) == bool(problem.obstacles)
    assert len(scene.trails) >= 1


@pytest.mark.slow
def test_solution_is_saved_and_read(
    problem: go.Problem, solution: go.ocp.Solution, tmp_path: Path
) -> None:
    again = go.ocp.load_solution(solution.save(tmp_path / "solution.json"), problem)
    assert again.path.energy == solution.path.energy
    assert again.stats == solution.stats


def test_every_problem_is_listed_in_the_gallery() -> None:
    """With its picture and a link to its file."""
    listed = (GALLERY / "README.md").read_text()
    for file in GALLERY.glob("*.py"):
        for problem_class in problem_classes(file):
            assert (GALLERY / "pictures" / f"{problem_class.__name__}.png").is_file()
            assert f"({file.name})" in listed
            assert f"pictures/{problem_class.__name__}.png" in listed


def discovered_motions() -> list[Any]:
    """Every class of motions in time in problems/."""
    every = [each for file in sorted(GALLERY.glob("*.py")) for each in problem_classes(file)]
    return [each for each in every if not issubclass(each, go.Problem)]


@pytest.mark.slow
@pytest.mark.parametrize("motion_class", discovered_motions())
def test_motions_are_solved_and_drawn(motion_class: type[go.MotionProblem], tmp_path: Path) -> None:
    assert inspect.getdoc(motion_class)
    found = go.solve(motion_class())
    assert found.stats.success
    assert found.stats.max_path_violation <= 1e-4
    assert found.certificate.locally_minimizing
    assert all(axes.get_ylabel() for axes in go.plot(found).axes)
    found.to_trajectory().save(tmp_path / "motion.csv")
    assert go.read_trajectory(tmp_path / "motion.csv").duration == pytest.approx(found.duration)
    assert playback_of(found).scenes[0].solids or not found.problem.obstacles
