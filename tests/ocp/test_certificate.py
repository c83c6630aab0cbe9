"""Certificates: Morse index, conjugate points, active constraints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import pytest
from known_metrics import OutsideEllipse, Sphere
from known_problems import PlaneAroundDisc
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.manifold.exp import sample_geodesic


def along_great_circle(length: float, start: tuple[float, float] = (1.2, 0.3)) -> go.Path:
    metric = Sphere()
    velocity = np.array([0.3, 1.0])
    velocity *= length / metric.norm(start, velocity)
    grid = go.Grid(4, 20)
    nodes, _ = sample_geodesic(metric, start, velocity, grid.nodes)
    return go.Path(metric, grid, nodes)


@pytest.mark.slow
@pytest.mark.parametrize("length", [0.5, 2.0, np.pi - 1e-3])
def test_great_circles_are_minimizing_before_the_antipode(length: float) -> None:
    certificate = go.ocp.certify(along_great_circle(length))
    assert certificate.locally_shortest
    assert certificate.morse_index == 0
    assert certificate.first_conjugate_point is None
    assert certificate.endpoint_error < 1e-6  # from the path's velocity, not the integrated one
    assert certificate.drift < 1e-6
    assert str(certificate).startswith("locally minimizing; endpoint error")


@pytest.mark.parametrize("length", [np.pi + 1e-3, 2 * np.pi + 0.1])
def test_great_circles_are_not_minimizing_beyond_the_antipode(length: float) -> None:
    certificate = go.ocp.certify(along_great_circle(length))
    assert not certificate.locally_shortest
    assert certificate.morse_index == int(length / np.pi)  # Morse: conjugate points inside
    assert certificate.first_conjugate_point == pytest.approx(np.pi / length, abs=1e-5)
    assert "stationary, not locally minimizing" in str(certificate)


def test_every_solution_has_a_certificate(arm: go.Model) -> None:
    metric = go.KineticEnergy(arm)
    start = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
    goal = np.array([1.2, -0.2, -0.9, 1.6, -0.3, 0.1, 0.4])
    path = go.geodesic(metric, start, goal)
    assert path.certificate.locally_shortest
    assert path.certificate.endpoint_error <= 1e-9
    assert path.certificate.drift <= 1e-5
    solution = go.solve(go.PointToPoint(metric, start, goal))
    assert solution.certificate.locally_shortest
    assert solution.certificate.endpoint_error < 1e-4  # as accurate as the grid
    with pytest.raises(go.NotConverged) as failure:
        go.solve(go.PointToPoint(metric, start, goal), ipopt={"max_iter": 1})
    assert failure.value.solution.certificate.endpoint_error > 1e-4
    assert not failure.value.solution.certificate.stationary
    assert str(failure.value.solution.certificate).startswith("not stationary")


class AlongEquatorToMeridian(go.Problem):
    """From a point of the sphere to a meridian: minimizing up to the focal point, at pi / 2."""

    def __init__(self, longitude: float) -> None:
        self.longitude = longitude

    @property
    def metric(self) -> go.Metric:
        return Sphere()

    def boundary(self, q0: ca.SX, q1: ca.SX) -> list:
        return [(q0, (np.pi / 2, 0.0)), (q1[1] * 1.0, self.longitude)]

    def guess(self, s: np.ndarray) -> np.ndarray:
        return np.column_stack([np.full_like(s, np.pi / 2), self.longitude * s])


@pytest.mark.parametrize(("longitude", "index"), [(1.4, 0), (1.8, 1), (4.0, 1)])
def test_second_variation_includes_free_ends(longitude: float, index: int) -> None:
    """Along the equator to a meridian: beyond pi / 2, paths by way of a pole are shorter."""
    solution = go.solve(AlongEquatorToMeridian(longitude), throw=False)
    assert_allclose(solution.path.nodes[:, 0], np.pi / 2, rtol=0, atol=1e-6)
    assert solution.certificate.morse_index == index


def test_constrained_paths_are_minimizing_but_not_geodesics() -> None:
    certificate = go.solve(PlaneAroundDisc()).certificate
    assert certificate.locally_shortest
    assert certificate.endpoint_error > 0.1


def test_undefined_metric_leaves_the_index_undetermined() -> None:
    grid = go.Grid(1, 20)
    straight = np.column_stack([2.0 * grid.nodes - 1.0, 0.0 * grid.nodes])
    certificate = go.ocp.certify(go.Path(OutsideEllipse(), grid, straight))
    assert not certificate.stationary
    assert not certificate.locally_shortest
    assert certificate.morse_index is None
    assert certificate.drift == np.inf
    with pytest.raises(go.IntegrationFailed):
        go.exp(OutsideEllipse(), [-1.0, 0.0], [2.0, 0.0])


def test_paths_other_than_geodesics_are_not_stationary() -> None:
    grid = go.Grid(1, 20)
    wave = np.column_stack([1.2 + 0.3 * np.sin(6.0 * grid.nodes), grid.nodes])
    certificate = go.ocp.certify(go.Path(Sphere(), grid, wave))
    assert not certificate.stationary
    assert not certificate.locally_shortest
    coarse = go.solve(go.PointToPoint(Sphere(), [0.1, 0.0], [0.1, 3.0]), grid=go.Grid(1, 2))
    assert not coarse.certificate.stationary


def test_certify_names_wrong_arguments() -> None:
    path = along_great_circle(1.0)
    with pytest.raises(ValueError, match=r"velocity must have shape \(2,\)"):
        go.ocp.certify(path, [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="velocity must be finite"):
        go.ocp.certify(path, [np.nan, 1.0])
    with pytest.raises(ValueError, match="path must be a Path"):
        go.ocp.certify(3)  # type: ignore[arg-type]


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e6])
def test_active_constraints_do_not_depend_on_their_unit(factor: float) -> None:
    """A force presses the path down onto the straight line between its ends."""

    class Pressed(go.Problem):
        metric = go.Euclidean(2)

        def boundary(self, q0: ca.SX, q1: ca.SX) -> list[object]:
            return [(q0, (0.0, 0.0)), (q1, (1.0, 0.0))]

        def constraints(self, q: ca.SX, v: ca.SX) -> list[object]:
            return [(0.0, factor * ca.sinh(q[1]), np.inf, "floor")]

        def cost(self, q: ca.SX, v: ca.SX) -> ca.SX:
            return q[1] - 8.0 * q[1] ** 2  # which decreases again far above the floor

    certificate = go.solve(Pressed(), grid=go.Grid(8, 4)).certificate
    assert certificate.has_active_constraints
    assert certificate.locally_shortest


class Ridge(go.Metric):
    """A plane with a ridge along y = 0, on which a path is longer than beside it."""

    dim = 2

    def matrix(self, q: ca.SX) -> ca.SX:
        return type(q).eye(2) * (1.0 + 5.0 * ca.exp(-8.0 * q[1] ** 2))


class AlongCostlyLine(go.Problem):
    metric = go.Euclidean(2)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> list[object]:
        return [(q0, (0.0, 0.0)), (q1, (4.0, 0.0))]

    def cost(self, q: ca.SX, v: ca.SX) -> ca.SX:
        return 100.0 * ca.exp(-8.0 * q[1] ** 2)


@pytest.mark.parametrize(
    "problem",
    [go.PointToPoint(Ridge(), (0.0, 0.0), (4.0, 0.0)), AlongCostlyLine()],
    ids=["geodesic", "cost"],
)
def test_saddle_points_are_left(problem: go.Problem) -> None:
    """The straight line is stationary by symmetry, and Ipopt makes no step from it."""
    solution = go.solve(problem)
    assert solution.certificate.locally_shortest
    assert np.abs(solution.path.nodes[:, 1]).max() > 0.5


def test_a_saddle_point_that_cannot_be_left_is_called_one() -> None:
    """Five times around the equator: shorter paths lead over a pole, where the chart ends."""
    solution = go.solve(go.PointToPoint(Sphere(), (np.pi / 2, 0.0), (np.pi / 2, 16.0)))
    assert solution.certificate.morse_index == 5
    assert "a saddle point: it is not locally minimizing" in solution.stats.status


def test_multipliers_that_do_not_fit_are_noticed() -> None:
    solution = go.solve(PlaneAroundDisc())
    for change in ({"lam_g": -solution.iterate.lam_g}, {"lam_g": 0.0 * solution.iterate.lam_g}):
        wrong = replace(solution, iterate=replace(solution.iterate, **change))
        assert not wrong.certificate.stationary


@pytest.mark.slow
def test_forces_of_joint_limits_have_the_right_sign_except_around_switching_points() -> None:
    arm = go.human_arm()
    metric = go.KineticEnergy(arm)
    q0 = (1.94, -0.9, -0.75, 1.43, 1.21, -0.43, 0.68)
    q1 = (-0.72, -0.23, -1.57, 2.57, 0.18, -0.28, -0.82)
    wrong = []
    for grid in (go.Grid(24, 4), go.Grid(80, 4)):
        solution = go.solve(go.PointToPoint(metric, q0, q1, limits=True), grid=grid, throw=False)
        path, points = solution.path, np.array(solution.certificate.switching_points)
        assert solution.certificate.locally_shortest
        assert len(points) > 1
        largest = {True: 0.0, False: 0.0}
        breaks = path.breakpoints
        for index, (start, end) in enumerate(pairwise(breaks)):
            low, high = breaks[max(index - 1, 0)], breaks[min(index + 2, len(breaks) - 1)]
            is_near = bool(np.any((points >= low) & (points <= high)))
            s = start + (end - start) * np.linspace(0.02, 0.98, 9)
            for q, v, a in zip(*path.derivatives(s, 2), strict=True):
                force = metric.matrix(q) @ (a - metric.acceleration(q, v)) / path.energy
                at = np.array([arm.upper - q, q - arm.lower]) < 1e-6
                largest[is_near] = max(largest[is_near], *(at * [-force, force]).ravel())
        assert largest[False] < 1e-6
        wrong.append(largest[True])
    assert wrong[1] < 0.1 * wrong[0]


@dataclass(frozen=True)
class WithCost(go.Problem):
    """From the origin along x, with a cost of the position."""

    kind: str
    length: float = 1.0

    @property
    def metric(self) -> go.Metric:
        return go.Euclidean(2)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, (0.0, 0.0)), (q1, (self.length, 0.0))]

    def cost(self, q: ca.SX, v: ca.SX) -> Any:
        x, y = q[0], q[1]
        # A displacement a sin(pi s) of y costs the energy a^2 pi^2 / 4, and k y^2 saves k a^2 / 2.
        costs = {
            "-100 y|y|": -100.0 * y * ca.fabs(y),
            "-6 y|y|": -6.0 * y * ca.fabs(y),
            "-4 y|y|": -4.0 * y * ca.fabs(y),
            "-|y|": -ca.fabs(y),
            "|y|": ca.fabs(y),
            "floor(x)": ca.floor(x),
            "floor(x + 5)": ca.floor(x + 5.0),
        }
        return costs[self.kind]


@pytest.mark.parametrize(
    ("problem", "is_least"),
    [
        (WithCost("-100 y|y|"), False),
        (WithCost("-6 y|y|"), False),  # 3 > pi^2 / 4
        (WithCost("-4 y|y|"), True),  # 2 < pi^2 / 4
        (WithCost("-|y|"), False),
        (WithCost("|y|"), True),
        (WithCost("floor(x)", 2.3), False),
        (WithCost("floor(x + 5)", 0.7), True),  # constant on the way
    ],
)
def test_costs_that_are_not_smooth_are_not_judged_by_derivatives(
    problem: WithCost, is_least: bool
) -> None:
    certificate = go.solve(problem).certificate
    assert certificate.stationary
    assert certificate.morse_index == 0
    assert certificate.locally_shortest == is_least
    assert certificate.decreases_nearby == (not is_least)
    assert ("decrease nearby" in str(certificate)) == (not is_least)


def test_a_metric_that_is_not_smooth_is_not_judged_by_derivatives() -> None:
    class Ridge(go.Metric):
        dim = 2

        def matrix(self, q: ca.SX) -> ca.SX:
            return (1.0 - ca.fabs(q[1]) / 2.0) * ca.SX.eye(2)

    certificate = go.geodesic(Ridge(), [0.0, 0.0], [1.0, 0.0]).certificate
    assert certificate.decreases_nearby
    assert not certificate.locally_shortest
