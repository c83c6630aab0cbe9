"""Problems with a running cost, conditions on end velocities, and parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import casadi as ca
import numpy as np
import pytest
from known_metrics import Sphere
from known_problems import PlaneAroundDisc, check_derivatives
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.ocp.problem import parse_conditions
from geodesic_ocp.ocp.transcription import PathTerms, Transcription, Units


@dataclass(frozen=True)
class Spring(go.Problem):
    """In the plane, with a quadratic potential about the origin: q'' = k^2 q."""

    start: tuple = (1.0, 0.5)
    goal: tuple = (-0.5, 2.0)
    stiffness: float = 2.0
    parameters: ClassVar = ("stiffness",)

    @property
    def metric(self) -> go.Metric:
        return go.Euclidean(2)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start), (q1, self.goal)]

    def cost(self, q: ca.SX, v: ca.SX) -> Any:
        return self.stiffness**2 * ca.dot(q, q) / 2

    def exact(self, s: np.ndarray) -> np.ndarray:
        k = self.stiffness
        weights = np.sinh(k * np.array([1.0 - s, s])) / np.sinh(k)
        return np.outer(weights[0], self.start) + np.outer(weights[1], self.goal)


@pytest.mark.parametrize("stiffness", [0.5, 2.0, 6.0])
def test_cost_is_added_to_the_energy(stiffness: float) -> None:
    problem = Spring(stiffness=stiffness)
    solution = go.solve(problem)
    s = np.linspace(0.0, 1.0, 21)
    assert_allclose(solution.path(s), problem.exact(s), rtol=0, atol=1e-8)
    # int (|q'|^2 + k^2 |q|^2) / 2 = [q . q'] / 2 of the solution.
    ends = solution.path([0.0, 1.0]), solution.path([0.0, 1.0], 1)
    flow = np.einsum("ki,ki->k", *ends)
    assert solution.stats.objective == pytest.approx((flow[1] - flow[0]) / 2.0, rel=1e-7)
    assert solution.stats.energy == pytest.approx(solution.path.energy, rel=1e-9)
    assert solution.stats.energy < solution.stats.objective
    assert solution.certificate.stationary
    assert solution.certificate.morse_index == 0


def test_problems_that_differ_in_parameters_share_the_nlp() -> None:
    first = Spring(stiffness=1.0).nlp(go.Grid(1, 20)).transcription
    assert Spring(stiffness=3.0).nlp(go.Grid(1, 20)).transcription is first
    assert replace(Spring(), start=(1.0, 1.0)).nlp(go.Grid(1, 20)).transcription is not first


def test_metric_that_depends_on_a_parameter_needs_a_new_nlp() -> None:
    @dataclass(frozen=True)
    class InWater(Spring):
        @property
        def metric(self) -> go.Metric:
            return Torus(tube=self.stiffness)

    first = InWater(stiffness=1.0).nlp(go.Grid(1, 20)).transcription
    assert InWater(stiffness=1.0).nlp(go.Grid(1, 20)).transcription is first
    assert InWater(stiffness=1.5).nlp(go.Grid(1, 20)).transcription is not first


@dataclass(frozen=True)
class Torus(go.Metric):
    """A torus, in the angles about its tube and about its axis."""

    dim: int = 2
    tube: float = 0.5
    radius: float = 2.0

    def matrix(self, q: Any) -> Any:
        return ca.diag(ca.vertcat(self.tube**2, (self.radius + self.tube * ca.cos(q[0])) ** 2))


@dataclass(frozen=True)
class Closed(go.Problem):
    """The shortest closed curve around the axis: the inner equator."""

    metric: go.Metric = field(default_factory=Torus)

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
        around = ca.vertcat(0.0, 2.0 * np.pi)
        return [(q0[1], 0.0), (q1 - q0 - around, 0.0, "closed"), (v1 - v0, 0.0, "smooth")]

    def guess(self, s: np.ndarray) -> np.ndarray:
        return np.column_stack([2.5 + 0.2 * np.sin(2 * np.pi * s), 2 * np.pi * s])


def test_closed_geodesic_by_conditions_on_end_velocities() -> None:
    solution = go.solve(Closed(), grid=go.Grid(2, 12))
    assert solution.path.length == pytest.approx(2 * np.pi * 1.5, rel=1e-9)
    assert_allclose(solution.path.nodes[:, 0], np.pi, rtol=0, atol=1e-6)
    velocities = solution.path([0.0, 1.0], 1)
    assert_allclose(velocities[1], velocities[0], rtol=0, atol=1e-7)
    assert solution.certificate.locally_shortest


@dataclass(frozen=True)
class Everything(go.Problem):
    """All types of conditions, with parameters in each, on the sphere."""

    parameters: ClassVar = ("weight", "centre", "table")
    weight: float = 0.7
    centre: tuple = (0.2, 0.3)
    table: np.ndarray = field(default_factory=lambda: np.array([[1.0, 2.0], [3.0, 4.0]]))

    @property
    def metric(self) -> go.Metric:
        return Sphere()

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
        coupled = ca.sin(v0[0]) * q1[1] + self.weight * v1[1] ** 2 * q0[0]
        return [
            (q0[0], 1.0),
            (coupled, 0.3, "coupled"),
            (ca.dot(v0, v1) - self.centre[0], self.weight),
        ]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [
            (self.centre[1], ca.dot(q, self.table @ q), np.inf, "still"),
            (-1.0, q[0] * v[1] ** 2 * self.weight, 1.0, "moving"),
        ]

    def cost(self, q: ca.SX, v: ca.SX) -> Any:
        return self.weight * ca.cos(q[0] * v[1]) + ca.dot(self.centre[0] * q, v) ** 2


@pytest.mark.parametrize("grid", [go.Grid(1, 6), go.Grid(3, 4, (0.0, 0.2, 0.9, 1.0))])
def test_assembled_derivatives_equal_those_of_casadi(
    grid: go.Grid, rng: np.random.Generator
) -> None:
    """With a running cost, conditions on end velocities and parameters."""
    problem = Everything()
    terms = parse_conditions(problem)
    assert_allclose(terms.p_values, [0.7, 0.2, 0.3, 1.0, 3.0, 2.0, 4.0])
    transcription = Transcription(
        PathTerms.of(problem.metric, terms), replace(grid, ends=None), grid.nodes
    )
    units = Units(rng.normal(size=2), 0.7, 3.0)
    scales = rng.uniform(0.5, 2.0, transcription.program.size_g)
    p = transcription.parameters(units, grid, rng.normal(size=7), scales)
    check_derivatives(transcription, p, rng)


@dataclass(frozen=True)
class Reach(go.Problem):
    """The hand moves to a target past a ball; both may change from solve to solve."""

    model: go.Model
    target: tuple = (0.10, 0.45, -0.05)
    ball: tuple = (0.12, 0.20, -0.30)
    parameters: ClassVar = ("target", "ball")

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.model)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        start = [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1]
        return [(q0, start), (self.model.hand_pose(q1)[1], self.target, "target")]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        offset = self.model.hand_pose(q)[1] - ca.vertcat(*ca.vertsplit(ca.SX(self.ball)))
        return [(0.01, ca.dot(offset, offset), np.inf, "ball")]


@pytest.mark.slow
def test_moved_target_is_reached_from_the_last_solution(arm: go.Model) -> None:
    problem = Reach(arm)
    solution = go.solve(problem)
    for shift in (0.05, 0.10):
        moved = replace(problem, target=(0.10 + shift, 0.45, -0.05))
        solution = go.solve(moved, guess=solution.path)
        assert_allclose(arm.hand_pose(solution.path(1.0))[1], moved.target, rtol=0, atol=1e-8)
    cold = go.solve(moved)
    assert solution.stats.energy == pytest.approx(cold.stats.energy, rel=1e-6)
    elsewhere = go.solve(moved, grid=go.Grid(8, 6), guess=solution.path)  # on another grid
    assert elsewhere.stats.success


@pytest.mark.parametrize(
    ("field_name", "value", "message"),
    [
        ("target", "there", "parameter 'target' must be a field with finite numbers"),
        ("target", (0.1, np.nan, 0.0), "parameter 'target' must be a field with finite numbers"),
    ],
)
def test_wrong_parameters_are_named(
    arm: go.Model, field_name: str, value: object, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        go.solve(replace(Reach(arm), **{field_name: value}))


def test_cost_must_be_a_scalar_expression() -> None:
    class Two(Spring):
        def cost(self, q: ca.SX, v: ca.SX) -> Any:
            return q

    with pytest.raises(ValueError, match=r"cost\(q, v\) must be a scalar, got shape \(2, 1\)"):
        go.solve(Two())

    class Word(Spring):
        def cost(self, q: ca.SX, v: ca.SX) -> Any:
            return "much"

    with pytest.raises(ValueError, match="cost: 'much' is not an expression"):
        go.solve(Word())


@dataclass(frozen=True)
class ElbowBounded(go.Problem):
    """Two configurations of the arm whose geodesic exceeds a bound on elbow flexion."""

    model: go.Model

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.model)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, np.zeros(7)), (q1, [1.4, 0.2, -0.6, 0.3, 0.0, 0.0, 0.0])]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [(-1.0, q[3], 0.2, "elbow"), (0.0, ca.dot(v, v), 4.0, "speed")]


def test_violated_conditions_are_named_with_value_and_s(arm: go.Model) -> None:
    """The goal has an elbow angle of 0.3 rad, and is farther than a speed of two allows."""
    with pytest.raises(ValueError, match=r"joint REx_joint is fixed at 0\.3"):
        go.solve(ElbowBounded(arm))

    @dataclass(frozen=True)
    class Hurried(ElbowBounded):
        def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
            return [(-np.inf, ca.sin(q[3]), 0.2, "elbow"), (0.0, ca.dot(v, v), 1.0, "speed")]

    with pytest.raises(ValueError, match=r"elbow exceeds 0\.2 by 0\.096 at s = 1\.00"):
        go.solve(Hurried(arm))

    class Barely(Hurried):
        """Conditions on the velocity cannot be checked before the solve."""

        def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
            (low, elbow, high, name), speed = super().constraints(q, v)
            return [(low, elbow + 1e-12 * v[3], high, name), speed]

    with pytest.raises(go.NotConverged, match=r"elbow exceeds 0\.2 by 0\.096 at s = 1\.00") as info:
        go.solve(Barely(arm))
    assert "speed exceeds 1 by" in str(info.value)
    worst = info.value.solution.violations[0]
    assert worst.amount == pytest.approx(worst.value - worst.limit)
    assert worst.name in ("elbow", "speed")


def test_violations_between_the_nodes_are_found() -> None:
    message = r"disc falls below 0\.5 by 0\.\d+ at s = 0\.\d+"
    with pytest.raises(go.NotConverged, match=message) as failure:
        go.solve(PlaneAroundDisc(), grid=go.Grid(4, 4))
    coarse = failure.value.solution
    fine = go.solve(PlaneAroundDisc(), grid=go.Grid(32, 4), throw=False)
    assert not coarse.stats.success
    with pytest.raises(go.NotConverged, match="not a solution: disc falls below"):
        coarse.to_motion(1.0)
    assert coarse.stats.max_node_violation < 1e-8
    assert coarse.stats.max_path_violation > 1e-4
    assert coarse.violations[0].name == "disc"
    assert 0.0 < coarse.violations[0].s < 1.0
    assert fine.stats.max_path_violation < 0.1 * coarse.stats.max_path_violation
    s = np.linspace(0.0, 1.0, 2001)
    inside = 0.5 - np.linalg.norm(coarse.path(s), axis=1)
    assert coarse.stats.max_path_violation == pytest.approx(inside.max(), rel=0.1)


@dataclass(frozen=True, eq=False)
class Boxed(go.Problem):
    """In the plane between bounds that are expressions in parameters, one of them in the way."""

    low: float = 0.3
    box: tuple = (2.0, 1.5)
    parameters: ClassVar = ("low", "box")

    @property
    def metric(self) -> go.Metric:
        return go.Euclidean(2)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, [-1.0, 2 * self.low]), (q1, ca.vertcat(1.0, 2 * self.low))]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [
            ([-self.box[0], 0.0], q, [self.box[0], self.box[0] * self.box[1]], "box"),
            (self.low**2 - 1.0, q[1] + ca.exp(-4 * q[0] ** 2), self.box[1], "bump"),
        ]

    def guess(self, s: np.ndarray) -> np.ndarray:
        return np.column_stack([2.0 * s - 1.0, np.full_like(s, 2 * self.low)])


def test_bounds_are_expressions_in_parameters() -> None:
    first, second = Boxed(), Boxed(0.55, (1.5, 2.0))
    assert first.nlp(first.grid).transcription is second.nlp(second.grid).transcription
    for problem in (first, second):
        conditions = {each.name: each for each in parse_conditions(problem)}
        height = problem.box[0] * problem.box[1]
        assert_allclose(conditions["box"].lower, [-problem.box[0], 0.0])
        assert_allclose(conditions["box"].upper, [problem.box[0], height])
        assert_allclose(conditions["bump"].lower, [problem.low**2 - 1.0])
        assert_allclose(conditions["bump"].upper, [problem.box[1]])
        assert_allclose(conditions["boundary[0]"].lower, [-1.0, 2 * problem.low])
        assert_allclose(conditions["boundary[1]"].upper, [1.0, 2 * problem.low])

    class InVariables(Boxed):
        def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
            return [([-1.0, q[1]], q, [1.0, 1.0], "box")]

    with pytest.raises(ValueError, match="box: a bound must be numbers or an expression in the p"):
        parse_conditions(InVariables())

    class Words(Boxed):
        def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
            return [(["low", 0.0], q, 1.0, "box")]

    with pytest.raises(ValueError, match="box: a bound must be numbers, got"):
        parse_conditions(Words())
