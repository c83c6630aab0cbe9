"""Of many conditions along a path, only those that may become active are part of the program."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.ipopt import STOPPED
from geodesic_ocp.ocp import conditions as conditions_module
from geodesic_ocp.ocp import descent as descent_module
from geodesic_ocp.ocp import solver as solver_module
from geodesic_ocp.ocp.conditions import CELLS
from geodesic_ocp.ocp.nlp import build_nlp
from geodesic_ocp.ocp.problem import Equality, Inequality, parse_conditions
from geodesic_ocp.ocp.solver import Solver
from geodesic_ocp.ocp.violations import excess_over_bounds, path_samples


@dataclass(frozen=True)
class PlaneAmongDiscs(go.Problem):
    """A straight line through one disc; the way around it leads through another."""

    metric: go.Metric = field(default_factory=lambda: go.Euclidean(2))
    centres: tuple[tuple[float, float], ...] = (
        *((0.0, -0.1), (0.6, 0.36)),
        *((x, y) for x in np.linspace(-1.2, 1.2, 12).tolist() for y in (-2.0, 2.0)),
    )
    radii: tuple[float, ...] = (0.5, 0.2, *(0.1,) * 24)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Equality]:
        return [(q0, (-1.0, 0.0)), (q1, (1.0, 0.0))]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Inequality]:
        discs = zip(self.centres, self.radii, strict=True)
        return [(r, ca.norm_2(q - ca.DM(c)), np.inf, f"disc {c}") for c, r in discs]


def test_conditions_are_added_where_a_path_violates_them(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = PlaneAmongDiscs()
    few = go.solve(problem, tolerance=1e-8)
    kept = [each.name for each in few.iterate.nlp.conditions.along_q]
    assert kept == ["disc (0.0, -0.1)", "disc (0.6, 0.36)"]
    monkeypatch.setattr(conditions_module, "_FEW", len(problem.centres))
    every = go.solve(problem, tolerance=1e-8)
    assert few.stats.objective == pytest.approx(every.stats.objective, rel=1e-8)
    assert few.multipliers.keys() == every.multipliers.keys()
    for centre in problem.centres[2:]:
        assert not np.any(few.multipliers[f"disc {centre}"])
    path = few.path(np.linspace(0.0, 1.0, 2001))
    for centre, radius in zip(problem.centres, problem.radii, strict=True):
        assert np.linalg.norm(path - centre, axis=1).min() >= radius - 2e-6


WALL = tuple((0.0, 0.8 - 0.05 * k) for k in range(40))


def beside_wall() -> tuple[PlaneAmongDiscs, go.Path]:
    """A thin wall between start and goal, and a path far around its upper end."""
    problem = PlaneAmongDiscs(centres=WALL, radii=(0.03,) * len(WALL))
    return problem, go.Path.through(problem.metric, [(-1.0, 0.0), (0.0, 2.0), (1.0, 0.0)])


def test_a_path_beside_thin_bodies_does_not_jump_over_them() -> None:
    """It becomes the shortest one on its side: two tangents of the last disc, and an arc."""
    problem, guess = beside_wall()
    solution = go.solve(problem, guess=guess)
    q = solution.path(np.linspace(0.0, 1.0, 5001))
    assert np.linalg.norm(q[:, None] - WALL, axis=2).min() > 0.03 - 1e-4
    apart, up = np.hypot(1.0, 0.8), np.arctan2(0.8, 1.0)
    turn = 2.0 * (up + np.arcsin(0.03 / apart))
    shortest = 2.0 * np.sqrt(apart**2 - 0.03**2) + 0.03 * turn
    assert solution.path.length == pytest.approx(shortest, rel=1e-4)


@dataclass(frozen=True)
class Below(PlaneAmongDiscs):
    """With a limit that leaves a gap of 5 cm above a wall of discs 6 cm in radius."""

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Inequality]:
        return [((-2.0, -1.0), q, (2.0, 0.91), "limits"), *super().constraints(q, v)]


@pytest.mark.parametrize("is_given", [True, False])
def test_paths_among_bodies_stay_within_limits(is_given: bool) -> None:
    """Those from waypoints and from guesses that `solve` finds; their iterations are all counted
    where there is one guess.
    """
    problem = Below(centres=WALL, radii=(0.06,) * len(WALL))
    corners = [(-1.0, 0.0), (-0.5, 0.9), (0.5, 0.9), (1.0, 0.0)]
    guess = go.Path.through(problem.metric, corners) if is_given else None
    numbers = list[int]()
    solution = go.solve(problem, guess=guess, callback=lambda each: numbers.append(each.number))
    q = solution.path(np.linspace(0.0, 1.0, 5001))
    assert 0.86 - 1e-4 < q[:, 1].max() < 0.91 + 1e-4
    assert np.linalg.norm(q[:, None] - WALL, axis=2).min() > 0.06 - 1e-4
    if is_given:
        assert solution.stats.total_iterations == np.count_nonzero(numbers)


def test_every_step_of_a_descent_stays_clear(monkeypatch: pytest.MonkeyPatch) -> None:
    """With discs a hundredth as thick as a step is long, from a path that enters one by 2 cm."""
    problem, _ = beside_wall()
    guess = go.Path.through(problem.metric, [(-1.0, 0.0), (0.0, 0.81), (0.5, 1.5), (1.0, 0.0)])
    starts = list[go.Path]()
    step = descent_module._step

    def seen(definition, samples, path, *rest):  # type: ignore[no-untyped-def]
        starts.append(path)
        return step(definition, samples, path, *rest)

    monkeypatch.setattr(descent_module, "_step", seen)
    solver = Solver(problem, problem.definition(), parse_conditions(problem), {}, None, 1e-6)
    solution = solver.descend(go.Grid(8, 4), guess)
    assert solution is not None
    assert solution.stats.success
    worst = [
        max(0.03 - np.linalg.norm(path(np.linspace(0, 1, 5001))[:, None] - WALL, axis=2).min(), 0)
        for path in starts
    ]
    assert len(starts) > 2
    assert 0.015 < worst[0] < 0.03
    assert all(after < max(0.0031, before) for before, after in itertools.pairwise(worst))
    assert worst[-1] < 0.0031
    assert starts[-1].discrete_energy < starts[0].discrete_energy


def test_a_descent_that_is_stopped_gives_its_path(tmp_path: Path) -> None:
    problem, guess = beside_wall()
    numbers = itertools.count()
    solver = Solver(
        *(problem, problem.definition(), parse_conditions(problem)),
        *({}, lambda iterate: next(numbers) == 30, 1e-6),
    )
    solution = solver.descend(go.Grid(8, 4), guess)
    assert solution is not None
    assert solution.stats.status == STOPPED
    assert next(numbers) == 31
    assert solution.path.discrete_energy < guess.discrete_energy
    solution.save(tmp_path / "stopped.json")
    again = go.ocp.load_solution(tmp_path / "stopped.json", problem)
    assert again.violations == solution.violations


def test_conditions_are_linearized_at_all_samples_near_their_bounds(arm: go.Model) -> None:
    """Slopes of distances and limits on either side are those of finite differences."""
    rod = go.Capsule((0.3, 0.3, 0.0), (0.3, 0.6, 0.2), 0.02, name="rod")
    ends = (0.0, 0.2, -0.3, 0.8, 0.1, 0.0, 0.0), (0.3, -0.2, -0.1, 2.79, 0.2, 0.1, 0.1)
    problem = go.PointToPoint(go.KineticEnergy(arm), *ends, limits=True, obstacles=(rod,))
    path = problem.definition().initial_path(go.Grid(2, 4), None)
    samples = path_samples(parse_conditions(problem))
    s, excess, slopes = samples.linearized(path, np.inf)
    at = samples(path)[0]
    assert_allclose(s, np.tile(at, samples.lower.size))

    def moved(change: np.ndarray) -> np.ndarray:
        by = go.Path(path.metric, path.grid, path.nodes + change)
        return excess_over_bounds(samples, samples._values(by, at)).ravel()

    assert_allclose(excess, moved(np.zeros(7)))
    for k, unit in enumerate(1e-6 * np.eye(7)):
        assert_allclose(slopes[:, k], (moved(unit) - moved(-unit)) / 2e-6, rtol=0.0, atol=1e-6)
    _, near, _ = samples.linearized(path, 0.1)
    assert 0 < near.size < excess.size
    assert near.min() > -0.1 * (2.79 - 0.8)  # the elbow, near its limit


def test_a_search_among_many_bodies_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, guess = beside_wall()
    needed = go.solve(problem, guess=guess).stats.total_iterations
    monkeypatch.setattr(solver_module, "_MOST_AMONG_MANY", needed // 2)
    with pytest.raises(go.NotConverged, match=f"in {needed // 2} iterations") as error:
        go.solve(problem, guess=guess)
    assert error.value.solution.stats.total_iterations < needed  # type: ignore[attr-defined]


def test_distances_of_one_body_share_their_derivatives(arm: go.Model) -> None:
    """Balls and capsules are numbers of one function, whose rows are those of the distances."""
    balls = [go.Ball((0.1 * k, 0.5, 0.1), 0.05, name=f"ball {k}") for k in range(3)]
    rod = go.Capsule((0.4, 0.3, 0.0), (0.4, 0.6, 0.2), 0.02, name="rod")
    metric, ends = go.KineticEnergy(arm), ((0.0,) * 7, (0.2,) * 7)
    problem = go.PointToPoint(metric, *ends, obstacles=(*balls, rod), links=("right hand",))
    conditions = parse_conditions(problem)
    bodies = sum(body.link == "right hand" for body in arm.bodies)
    assert len(conditions.along_q) == 4 * bodies
    assert len(conditions.groups) == 2
    nlp = problem.nlp(go.Grid(2, 3))
    g = nlp.transcription.constraints(nlp.values["x0"], nlp.p)[0].full()[:, 0]
    by_name = nlp.bounds.multipliers(np.zeros(nlp.nodes.size), nlp.bounds.scales_g * g)
    for node, q in enumerate(nlp.nodes):
        distances = go.distances.signed_distances(arm, q, [*balls, rod], links=["right hand"])
        for name, distance in distances.items():
            assert_allclose(by_name[name][node], distance, rtol=0.0, atol=1e-12)


def test_a_cell_without_a_node_has_no_rows(arm: go.Model) -> None:
    """On a coarse grid a program may be without a distance that is part of it on finer ones."""
    ends = (0.0,) * 7, (0.2,) * 7
    ball = go.Ball((0.1, 0.5, 0.1), 0.05)
    definition = go.PointToPoint(go.KineticEnergy(arm), *ends, obstacles=[ball]).definition()
    cell = np.arange(CELLS) == 2
    kept = definition.restricted({definition.conditions.along_q[0].name: cell})
    for segments, rows in ((1, 0), (16, 1)):
        nlp = build_nlp(kept, go.Grid(segments, 2))
        assert nlp.transcription.value(nlp.values["x0"], nlp.p)[1].numel() == rows


@pytest.mark.slow
def test_derivatives_of_distances_are_those_of_the_whole_program(arm: go.Model) -> None:
    """Gradients in closed form and points of the links, compared with CasADi's derivatives."""
    obstacles = [
        go.Ball((0.1, 0.5, 0.1), 0.05),
        go.Capsule((0.4, 0.3, 0.0), (0.4, 0.6, 0.2), 0.02),
        go.Box((0.5, 0.1, -0.2), (0.2, 0.3, 0.4)),
        go.Box((0.0, 0.0, -0.1), (0.05, 0.03, 0.04), link="right upper arm"),
        go.HalfSpace((0.0, 0.0, -1.0), (0.0, 0.0, 1.0)),
    ]
    pairs = (("right hand", "right upper arm"),)
    metric, ends = go.KineticEnergy(arm), ((0.1,) * 7, (0.4,) * 7)
    problem = go.PointToPoint(metric, *ends, obstacles=obstacles, pairs=pairs, margin=-1.0)
    nlp = problem.nlp(go.Grid(2, 2))
    symbols = nlp.expressions
    lam = ca.MX.sym("lam", nlp.bounds.lower_g.size)
    weighted = ca.dot(lam, symbols["g"])
    derivatives = [
        ca.jacobian(symbols["g"], symbols["x"]),
        ca.triu(ca.hessian(weighted, symbols["x"])[0]),
    ]
    expected = ca.Function("expected", [symbols["x"], symbols["p"], lam], derivatives)
    x, p, factors = nlp.values["x0"], nlp.p, np.linspace(-1.0, 1.0, lam.numel())
    slopes, hessian = (each.full() for each in expected(x, p, factors))
    assert_allclose(nlp.transcription.constraints(x, p)[1].full(), slopes, atol=1e-9)
    found = nlp.transcription.hessian(x, p, 0.0, factors).full()
    assert_allclose(found, hessian, rtol=0.0, atol=1e-7 * np.abs(hessian).max())
