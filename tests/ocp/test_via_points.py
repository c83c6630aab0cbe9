"""Paths through via points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import pytest
from known_metrics import Sphere
from known_problems import check_derivatives
from numpy.testing import assert_allclose
from scipy.linalg import null_space

import geodesic_ocp as go
from geodesic_ocp.ocp.transcription import Units

START = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1])
TARGET, POINT = (0.1, 0.45, -0.05), (0.3, 0.3, -0.2)  # [m]


@dataclass(frozen=True)
class Mirror(go.Problem):
    """In the plane from one point to another by way of the line y = 1, like reflected light."""

    end: tuple[float, float] = (3.0, 0.5)
    continuous_velocity_at_via: bool = False
    via_parameters: tuple[float, ...] | None = None

    @property
    def metric(self) -> go.Metric:
        return go.Euclidean(2)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, (0.0, 0.0)), (q1, self.end)]

    def via(self, q: ca.SX) -> Sequence[Sequence[Any]]:
        return [[(q[1], 1.0, "mirror")]]


@dataclass(frozen=True)
class Corners(Mirror):
    """Through two points, in this order."""

    points: tuple[tuple[float, float], ...] = ((1.0, 1.0), (2.0, -1.0))

    def via(self, q: ca.SX) -> Sequence[Sequence[Any]]:
        return [[(q, point)] for point in self.points]


@pytest.mark.slow
def test_reflection_at_a_line() -> None:
    """The image of the end behind the mirror lies on a straight line."""
    solution = go.solve(Mirror())
    assert solution.path.length == pytest.approx(np.hypot(3.0, 1.5), rel=1e-9)
    (s,) = solution.path.grid.via_s
    assert s == pytest.approx(1.0 / 1.5, abs=1e-4)
    assert_allclose(solution.path(s), [2.0, 1.0], atol=1e-3)
    # Equal angles before and after, at one speed.
    before, after = solution.path(s - 1e-6, 1), solution.path(s + 1e-6, 1)
    assert_allclose(after, before * [1.0, -1.0], atol=1e-3)
    assert solution.multipliers["mirror"].shape == (1,)
    refined = go.solve(Mirror(), tolerance=1e-9)
    assert refined.path.length == pytest.approx(np.hypot(3.0, 1.5), rel=1e-9)


def test_via_points_are_passed_in_order() -> None:
    solution = go.solve(Corners())
    lengths = [np.hypot(1.0, 1.0), np.hypot(1.0, 2.0), np.hypot(1.0, 1.5)]
    assert solution.path.length == pytest.approx(sum(lengths), rel=1e-9)
    assert_allclose(solution.path.grid.via_s, np.cumsum(lengths)[:2] / sum(lengths), atol=1e-5)
    assert_allclose(solution.path(solution.path.grid.via_s), Corners.points, atol=1e-9)


def test_prescribed_via_parameters() -> None:
    solution = go.solve(Corners(via_parameters=(0.2, 0.5)))
    assert list(solution.path.grid.via_s) == [0.2, 0.5]
    assert_allclose(solution.path([0.2, 0.5]), Corners.points, atol=1e-9)
    energy = sum(
        length**2 / (2.0 * s)
        for length, s in zip(
            [np.hypot(1.0, 1.0), np.hypot(1.0, 2.0), np.hypot(1.0, 1.5)],
            [0.2, 0.3, 0.5],
            strict=True,
        )
    )
    assert solution.path.energy == pytest.approx(energy, rel=1e-9)
    with pytest.raises(ValueError, match="via_parameters must be s for 2 via points"):
        go.solve(Corners(via_parameters=(0.2,)))
    with pytest.raises(ValueError, match="via points must increase between"):
        go.solve(Corners(via_parameters=(0.5, 0.2)))


@pytest.mark.slow
def test_continuous_velocity_rounds_the_corner() -> None:
    """The additional energy decreases as the grid is refined."""
    corner, energies = go.solve(Mirror()).path.energy, []
    for segments in (8, 16, 32):
        path = go.solve(Mirror(continuous_velocity_at_via=True), grid=go.Grid(segments, 4)).path
        (s,) = path.grid.via_s
        before, after = path(s - 1e-9, 1), path(s + 1e-9, 1)
        assert_allclose(after, before, atol=1e-4)
        assert path(s)[1] == pytest.approx(1.0, abs=1e-9)
        energies.append(path.energy)
    assert energies[0] > energies[1] > energies[2] > corner
    assert energies[2] - corner < 0.6 * (energies[1] - corner)
    with pytest.raises(ValueError, match="has a corner at its via points"):
        go.solve(Mirror(continuous_velocity_at_via=True), tolerance=1e-4)


@pytest.mark.slow
def test_configuration_at_a_via_point_of_the_hand_is_optimal(arm: go.Model) -> None:
    """The momentum jumps there, but not along the configurations with the hand at that point."""
    problem = go.Reach(
        arm, START, TARGET, through=[POINT], continuous_velocity_at_via=False, limits=False
    )
    solution = go.solve(problem, tolerance=1e-7)
    (s,) = solution.path.grid.via_s
    q = solution.path(s)
    assert_allclose(arm.hand_pose(q)[1], POINT, rtol=0, atol=1e-8)
    jump = solution.path(s + 1e-12, 1) - solution.path(s - 1e-12, 1)
    momentum, tangents = problem.metric.matrix(q) @ jump, null_space(arm.hand_jacobian(q)[:3])
    assert np.linalg.norm(momentum) > 0.01
    assert np.abs(tangents.T @ momentum).max() < 1e-3 * np.linalg.norm(momentum)
    smooth = go.solve(go.Reach(arm, START, TARGET, through=[POINT], limits=False))
    assert smooth.path.energy > solution.path.energy
    (s,) = smooth.path.grid.via_s
    after, before = smooth.path(s + 1e-12, 1), smooth.path(s - 1e-12, 1)
    assert_allclose(after, before, atol=1e-6)


def test_moved_via_points_s_the_nlp(arm: go.Model) -> None:
    grid = go.Grid(8, 4).with_via_points([0.4])
    one = go.Reach(arm, START, TARGET, through=[POINT])
    other = go.Reach(arm, START, TARGET, through=[(0.25, 0.3, -0.2)])
    two = go.Reach(arm, START, TARGET, through=[POINT, (0.2, 0.4, -0.1)])
    assert other.nlp(grid).transcription is one.nlp(grid).transcription
    assert two.nlp(go.Grid(8, 4).with_via_points([0.3, 0.6])).transcription.grid.via_segments
    with pytest.raises(ValueError, match=r"through\[1\] must have shape \(3,\)"):
        go.Reach(arm, START, TARGET, through=[POINT, (0.2, 0.4)])


def test_assembled_derivatives_equal_those_of_casadi(rng: np.random.Generator) -> None:
    class Curved(Mirror):
        @property
        def metric(self) -> go.Metric:
            return Sphere()

        def via(self, q: ca.SX) -> Sequence[Sequence[Any]]:
            return [[(ca.sin(q[0]) * q[1], 1.0)], [(q[0] ** 3, 1.0), (ca.cos(q[1]), 0.0)]]

    for smooth in (True, False):
        grid = go.Grid(6, 3).with_via_points([0.3, 0.6])
        transcription = Curved(continuous_velocity_at_via=smooth).nlp(grid).transcription
        p = transcription.parameters(Units(rng.normal(size=2), 1.3, 0.7), grid)
        check_derivatives(transcription, p, rng)


def test_warm_start_from_a_solution_with_via_points() -> None:
    first = go.solve(Corners())
    again = go.solve(Corners(), grid=go.Grid(24, 5), guess=first)
    assert again.path.length == pytest.approx(first.path.length, rel=1e-9)
    assert_allclose(again.path.grid.via_s, first.path.grid.via_s, atol=1e-5)


def test_malformed_via_points_are_named() -> None:
    class Flat(Mirror):
        def via(self, q: ca.SX) -> Sequence[Any]:
            return [(q[1], 1.0)]

    with pytest.raises(ValueError, match=r"via\[0\]"):
        go.solve(Flat())
    with pytest.raises(ValueError, match="the grid has 1 via points, the problem none"):
        go.solve(
            go.PointToPoint(go.Euclidean(2), (0.0, 0.0), (1.0, 0.0)),
            grid=go.Grid(8, 4).with_via_points([0.5]),
        )
    with pytest.raises(ValueError, match="via_segments must increase between 0 and 8"):
        go.Grid(8, 4, None, (3, 9))


def test_violated_via_conditions_are_named() -> None:
    class Apart(Mirror):
        def via(self, q: ca.SX) -> Sequence[Sequence[Any]]:
            return [[(q[1], 1.0, "mirror"), (q[1], 2.0, "wall")]]

    with pytest.raises(go.NotConverged, match=r"(mirror|wall) .* at s = 0\.[0-9]+"):
        go.solve(Apart(via_parameters=(0.5,)))


@pytest.mark.parametrize(
    ("points", "end", "close"),
    [
        (((0.0, 0.0),), (3.0, 0.5), r"the start and via\[0\]"),
        (((3.0, 0.5),), (3.0, 0.5), r"via\[0\] and the end"),
        (((1.0, 1.0), (1.0, 1.0)), (3.0, 0.5), r"via\[0\] and via\[1\]"),
        (((1.0, 1.0), (1.0 + 1e-5, 1.0)), (3.0, 0.5), r"via\[0\] and via\[1\]"),
    ],
)
def test_coincident_via_points_are_named(points: Any, end: Any, close: str) -> None:
    problem = Corners(points=points, end=end)
    with pytest.raises(go.NotConverged, match=f"{close} have come together: do they coincide"):
        go.solve(problem)


def test_velocities_along_rounded_corners_are_exact() -> None:
    """The speed varies quickly at a rounded corner, so that lengths need a fine quadrature."""
    solution = go.solve(Mirror(continuous_velocity_at_via=True, end=(1.5, 0.2)))
    motion = solution.to_motion(1.0, rate=10_000.0)
    assert motion.velocity is not None
    slopes = np.gradient(motion.q, motion.time, axis=0)
    # Except at a few samples beside the ends of segments, where the velocity may jump.
    off = np.abs(motion.velocity - slopes)[2:-2].max(axis=1)
    assert np.mean(off > 5e-3) < 1e-3
    steps = np.linalg.norm(np.diff(solution.resample(2001), axis=0), axis=1)
    assert_allclose(steps, solution.path.length / 2000, rtol=2e-3)
