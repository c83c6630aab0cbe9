"""Solutions: accuracy, multipliers, convergence with the grid, and failures."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from known_metrics import Sphere
from known_problems import PlaneAroundDisc, check_derivatives

import geodesic_ocp as go
from geodesic_ocp.ocp.problem import parse_conditions
from geodesic_ocp.ocp.transcription import PathTerms, Transcription, Units


@dataclass(frozen=True)
class SphereToMeridian(go.Problem):
    """From a point to the nearest point of a meridian: the end's colatitude is free."""

    colatitude: float = 1.0
    longitude: float = 0.8
    metric: go.Metric = field(default_factory=Sphere)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, (self.colatitude, 0.0)), (q1[1], self.longitude)]

    @property
    def exact_length(self) -> float:
        """arcsin(sin t sin p): the great circle that meets the meridian at a right angle."""
        return float(np.arcsin(np.sin(self.colatitude) * np.sin(self.longitude)))


@dataclass(frozen=True)
class Mixed(go.Problem):
    """All types of conditions at once, on a human arm."""

    model: go.Model = field(default_factory=go.human_arm)

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.model)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        start = [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1]
        target = self.model.hand_pose(np.array([0.9, 0.0, -0.6, 0.6, 0.2, 0.0, 0.0]))[1]
        return [(q0, start), (self.model.hand_pose(q1)[1], target, "hand")]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        height = self.model.hand_pose(q)[1][2]
        return [
            (self.model.lower, q, self.model.upper, "limits"),
            (-0.5, height, 0.0, "height"),
            (-2.0, v[3] * ca.cos(q[3]), 2.0, "rate"),
        ]


@pytest.mark.slow
@pytest.mark.parametrize("grid", [go.Grid(1, 6), go.Grid(3, 4), go.Grid(2, 2)])
def test_assembled_derivatives_equal_those_of_casadi(
    grid: go.Grid, rng: np.random.Generator
) -> None:
    """Gradient and Hessian assembled from those of one node, against CasADi's of the whole NLP."""
    problem = Mixed()
    terms = parse_conditions(problem)
    assert [len(group) for group in (terms.fixed, terms.ends, terms.bounds)] == [1, 1, 1]
    assert [len(group) for group in (terms.along_q, terms.along_qv)] == [1, 1]
    transcription = Transcription(
        PathTerms.of(problem.metric, terms), replace(grid, ends=None), grid.nodes
    )
    p = transcription.parameters(Units(rng.normal(size=7), 0.7, 3.0), grid)
    check_derivatives(transcription, p, rng)


def test_all_types_of_conditions_are_met() -> None:
    problem = Mixed()
    solution = go.solve(problem)
    assert solution.stats.success
    assert solution.stats.max_node_violation < 1e-8
    nodes = solution.path.nodes
    assert np.array_equal(nodes[0], [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
    assert np.all(nodes >= problem.model.lower - 1e-8)
    assert np.all(nodes <= problem.model.upper + 1e-8)
    grid = solution.path.grid
    shapes = {name: values.shape for name, values in solution.multipliers.items()}
    assert shapes == {
        "boundary[0]": (7,),
        "hand": (3,),
        "limits": (grid.size, 7),
        "height": (grid.size, 1),
        "rate": (grid.collocations, 1),
    }


@pytest.mark.slow
@pytest.mark.parametrize("shift", [-0.05, -0.017, 0.0, 0.013, 0.05])
def test_free_ends_do_not_depend_on_rounding(shift: float) -> None:
    """The guess stays at the start; its extent of 1e-16 must not become the NLP's unit."""

    @dataclass(frozen=True)
    class Shifted(Mixed):
        def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
            start = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1]) + shift
            return [(q0, start), (self.model.hand_pose(q1)[1][1], 0.4, "plane")]

        def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
            return [(self.model.lower, q, self.model.upper, "limits")]

    assert go.solve(Shifted()).stats.success


def test_path_to_a_meridian_arrives_at_a_right_angle() -> None:
    """Transversality: v'G n = 0 along the free direction."""
    problem = SphereToMeridian()
    solution = go.solve(problem)
    assert solution.path.length == pytest.approx(problem.exact_length, rel=1e-9)
    along = problem.metric.inner(solution.path(1.0), solution.path(1.0, 1), [1.0, 0.0])
    assert abs(along) < 1e-7


def test_multipliers_are_derivatives_of_the_least_energy() -> None:
    """Of the straight line's energy |q1 - q0|^2 / 2 by its end; Ipopt's sign is the opposite."""
    solution = go.solve(go.PointToPoint(go.Euclidean(2), (0.0, 0.0), (3.0, 4.0)))
    assert solution.multipliers["goal"] == pytest.approx([-3.0, -4.0], rel=1e-6)
    assert solution.multipliers["start"] == pytest.approx([3.0, 4.0], rel=1e-6)


def test_multipliers_of_constraint_functions_have_units_of_energy() -> None:
    """The same for a condition that is not a bare coordinate, against differences of energies."""

    @dataclass(frozen=True)
    class ToSum(go.Problem):
        total: float = 3.0
        metric: go.Metric = field(default_factory=lambda: go.Euclidean(2))

        def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
            return [(q0, (0.0, 0.0)), (q1[0] + q1[1], self.total, "sum")]

    step = 1e-4
    slope = (
        go.solve(ToSum(3.0 + step)).stats.energy - go.solve(ToSum(3.0 - step)).stats.energy
    ) / (2 * step)
    assert go.solve(ToSum()).multipliers["sum"] == pytest.approx([-slope], rel=1e-6)


def test_stats_describe_the_solution() -> None:
    problem = go.PointToPoint(Sphere(), (1.0, 0.0), (1.4, 1.1))
    solution = go.solve(problem, grid=go.Grid(1, 12))
    stats = solution.stats
    assert solution.problem is problem
    assert stats.status == "Ipopt found a local solution"
    assert stats.variables == 26
    assert stats.constraints == 0
    assert 0 < stats.iterations < 20
    assert stats.seconds > 0
    assert stats.energy == pytest.approx(solution.path.energy, rel=1e-6)
    assert problem.nlp(solution.path.grid).transcription.grid == go.Grid(1, 12)


def test_order_of_convergence_is_twice_the_degree() -> None:
    """The energy on segments of degree d has order 2 d: the slope in log-log."""
    a, b = np.array([1.0, 0.0]), np.array([1.4, 1.9])
    exact = go.distance(Sphere(), a, b) ** 2 / 2
    problem = go.PointToPoint(Sphere(), tuple(a), tuple(b))
    counts = np.array([2, 4, 8, 16])
    for degree in (2, 3):
        energies = [go.solve(problem, grid=go.Grid(c, degree)).stats.energy for c in counts]
        slope = np.polyfit(np.log(counts), np.log(np.abs(np.array(energies) - exact)), 1)[0]
        assert slope < -2 * degree + 0.5


@pytest.mark.slow
def test_geodesics_do_not_depend_on_the_scale_of_the_mass() -> None:
    """The energies differ by ten orders of magnitude."""
    q0 = (0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1)
    q1 = (0.9, 0.0, -0.6, 0.6, 0.2, 0.0, 0.0)
    nodes = []
    for mass in (1e-7, 70.0, 1000.0):
        metric = go.KineticEnergy(go.human_arm("right", 1.75, mass))
        solution = go.solve(go.PointToPoint(metric, q0, q1))
        nodes.append(solution.path.nodes)
        assert solution.stats.iterations < 15
    assert nodes[0] == pytest.approx(nodes[1], abs=1e-8)
    assert nodes[2] == pytest.approx(nodes[1], abs=1e-8)


@pytest.mark.slow
def test_infeasible_problem_is_explained_with_its_last_iterate() -> None:
    @dataclass(frozen=True)
    class OutOfReach(Mixed):
        def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
            start = [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1]
            return [(q0, start), (self.model.hand_pose(q1)[1], [5.0, 0.0, 0.0], "hand")]

    message = r"OutOfReach was not solved: .*hand\[0\] falls below 5 by 4\.\d+ at s = 1\.00"
    grid = go.Grid(4, 3)
    with pytest.raises(go.NotConverged, match=message) as info:
        go.solve(OutOfReach(), grid=grid)
    record = info.value.solution
    assert isinstance(record, go.ocp.Solution)
    assert record.stats.worst_constraint == "hand"
    assert record.violations[0].amount > 1.0  # [m]
    assert record.violations[0].relative == pytest.approx(record.stats.max_path_violation)
    again = go.solve(OutOfReach(), grid=grid, throw=False)
    assert not again.stats.success
    assert again.stats.status == record.stats.status


def test_options_are_passed_to_ipopt() -> None:
    problem = go.PointToPoint(Sphere(), (1.0, 0.0), (1.4, 1.9))
    with pytest.raises(go.NotConverged, match=r"reached its iteration limit \(ipopt="):
        go.solve(problem, ipopt={"max_iter": 1})
    assert go.solve(problem).stats.success  # options of one call do not stay


def test_start_outside_the_limits_is_reported_before_the_solve() -> None:
    @dataclass(frozen=True)
    class Outside(Mixed):
        def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
            return [(q0, [0.0, 0.0, -0.4, -0.9, 0.0, 0.0, 0.0], "start")]

    with pytest.raises(
        ValueError, match=r"start: joint REx_joint is fixed at -0.9 .* 0 to 2.79253"
    ):
        go.solve(Outside())


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("(q0,)", r"boundary\[0\] must be \(expression, value\[, name\]\)"),
        ("(q0, [1.0])", None),
        ("(q0, [1.0, 2.0, 3.0])", "a bound must be one number or 2"),
        ("(q0, [np.nan, 0.0])", "a bound must be one number or 2"),
        ("('here', 0.0)", "is not an expression in SX symbols"),
    ],
)
def test_malformed_conditions_are_named(entry: str, message: str | None) -> None:
    class Odd(go.Problem):
        metric = go.Euclidean(2)

        def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
            return [eval(entry, {"q0": q0, "np": np}), (q1, 0.0)]

    if message is None:
        assert go.solve(Odd()).path.nodes[0].tolist() == [1.0, 1.0]
    else:
        with pytest.raises(ValueError, match=message):
            go.solve(Odd())


def test_other_errors_in_a_problem_are_named() -> None:
    with pytest.raises(ValueError, match="problem must be an instance of a Problem class"):
        go.solve(Mixed)

    class Twice(PlaneAroundDisc):
        def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
            return [(q0, 0.0, "end"), (q1, 1.0, "end")]

    with pytest.raises(ValueError, match="conditions must have different names"):
        go.solve(Twice())

    class WrongGuess(PlaneAroundDisc):
        def guess(self, s: np.ndarray) -> np.ndarray:
            return np.zeros((3, 2))

    with pytest.raises(ValueError, match=r"guess\(s\) must give finite positions of shape"):
        go.solve(WrongGuess())

    class UpsideDown(PlaneAroundDisc):
        def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
            return [(1.0, q[0], -1.0, "x")]

    with pytest.raises(ValueError, match="x: a lower bound lies above its upper bound"):
        go.solve(UpsideDown())


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"max_iters": 3}, "Ipopt has no option 'max_iters'; did you mean 'max_iter'?"),
        ({"max_iter": "many"}, "max_iter must be 0 <= (default 3000) < +inf, got 'many'"),
        ({"tol": -1.0}, "tol must be 0 < (default 1e-08) < +inf, got -1.0"),
        ({"mu_strategy": "none"}, "mu_strategy must be one of monotone, adaptive, got 'none'"),
    ],
)
def test_options_unknown_to_ipopt_are_named(options: dict, reason: str) -> None:
    problem = go.PointToPoint(go.Euclidean(2), (0.0, 0.0), (1.0, 0.0))
    with pytest.raises(ValueError, match=f"^ipopt: {re.escape(reason)}$"):
        go.solve(problem, ipopt=options)


def test_path_around_a_disc_has_the_exact_length() -> None:
    """Refined grids approach two tangents and an arc; the smooth parts alone would be 2."""
    problem = PlaneAroundDisc()
    errors = []
    for segments in (8, 16, 32):
        solution = go.solve(problem, grid=go.Grid(segments, 4))
        assert solution.stats.max_node_violation < 1e-8
        errors.append(abs(solution.path.length - problem.exact_length))
    assert errors[0] < 1e-2
    assert errors[2] < 1e-3
    assert np.all(solution.multipliers["disc"] <= 1e-9)  # it pushes outwards only


def test_grids_converge_spectrally() -> None:
    """The energy's error falls by orders of magnitude with every few degrees, until rounding."""
    a, b = np.array([1.0, 0.0]), np.array([1.4, 1.9])
    exact = go.distance(Sphere(), a, b) ** 2 / 2
    problem = go.PointToPoint(Sphere(), tuple(a), tuple(b))
    errors = [
        abs(go.solve(problem, grid=go.Grid(1, d)).stats.energy - exact) for d in (4, 8, 12, 16)
    ]
    assert errors[1] < 1e-2 * errors[0]
    assert errors[2] < 1e-2 * errors[1]
    assert errors[3] < 1e-11


def test_warm_start_from_a_path_on_another_grid() -> None:
    problem = go.PointToPoint(Sphere(), (1.0, 0.0), (1.4, 1.9))
    coarse = go.solve(problem, grid=go.Grid(1, 12))
    cold = go.solve(problem, grid=go.Grid(4, 6))
    warm = go.solve(problem, grid=go.Grid(4, 6), guess=coarse.path)
    assert warm.path.length == pytest.approx(cold.path.length, rel=1e-10)
    assert warm.stats.iterations < cold.stats.iterations
