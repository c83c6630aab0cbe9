"""Every problem class in problems/ and in the package, found by itself: all that can be checked."""

from __future__ import annotations

import importlib.util
import inspect
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.ocp.terms import conditions

GALLERY = Path(__file__).resolve().parents[1] / "problems"


def discovered() -> list[go.Problem]:
    """The canonical instance of every class, and one of the package's own."""
    found: list[go.Problem] = [go.PointToPoint(go.Euclidean(3), (0.0, 0.0, 0.0), (1.0, 2.0, 2.0))]
    for file in sorted(GALLERY.glob("*.py")):
        spec = importlib.util.spec_from_file_location(f"problems.{file.stem}", file)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module
        spec.loader.exec_module(module)
        classes = [
            value
            for value in vars(module).values()
            if inspect.isclass(value)
            and issubclass(value, go.Problem)
            and not inspect.isabstract(value)
        ]
        assert classes, f"{file.name} has no problem in it"
        found += [problem() for problem in classes]
    return found


PROBLEMS = discovered()


@pytest.fixture(params=PROBLEMS, ids=lambda problem: type(problem).__name__)
def problem(request: pytest.FixtureRequest) -> go.Problem:
    return request.param


def constrained(problem: go.Problem) -> bool:
    symbols = (ca.SX.sym(name, problem.metric.dim) for name in "qv")
    return bool(problem.constraints(*symbols))


def test_it_is_explained(problem: go.Problem) -> None:
    assert inspect.getdoc(type(problem))


def test_it_converges_and_meets_its_conditions(problem: go.Problem) -> None:
    solution = go.solve(problem)
    assert solution.stats.success
    assert solution.stats.violation < 1e-7
    terms = conditions(problem)
    assert set(solution.multipliers) == {
        term.name
        for group in (terms.fixed, terms.ends, terms.bounds, terms.still, terms.moving)
        for term in group
    }


def test_refinement_settles(problem: go.Problem) -> None:
    """Twice as many segments change the energy by little."""
    grid = problem.grid
    coarse = go.solve(problem)
    fine = go.solve(problem, grid=go.Grid(2 * grid.segments, grid.degree))
    # Where a constraint switches inside a segment, its error falls but slowly.
    change = 2e-3 if constrained(problem) else 1e-8
    assert fine.path.energy == pytest.approx(coarse.path.energy, rel=change)


def test_speed_is_constant_where_nothing_holds_the_path(problem: go.Problem) -> None:
    if constrained(problem):
        pytest.skip("its constraints may do work")
    path = go.solve(problem).path
    s = np.linspace(0.0, 1.0, 11)
    speeds = [problem.metric.norm(q, v) for q, v in zip(path(s), path(s, 1), strict=True)]
    assert speeds == pytest.approx([path.length] * 11, rel=1e-4)


def test_closed_form(problem: go.Problem) -> None:
    s = np.linspace(0.0, 1.0, 21)
    if problem.exact_length is None and problem.exact(s) is None:
        pytest.skip("no closed form is known")
    path = go.solve(problem).path
    if problem.exact_length is not None:
        accuracy = 5e-3 if constrained(problem) else 1e-8
        assert path.length == pytest.approx(problem.exact_length, rel=accuracy)
    expected = problem.exact(s)
    if expected is not None:
        assert path(s) == pytest.approx(expected, abs=1e-6)
