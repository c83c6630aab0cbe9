"""Motions of least cost under conditions: known optima, limits, via points, failures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
import pytest
from known_models import planar_arm
from scipy.interpolate import CubicSpline

import geodesic_ocp as go
from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metrics import default_joint_inertia
from geodesic_ocp.ocp.motion_problem import MotionProblem

ARM = go.human_arm()
HUMAN = go.KineticEnergy(ARM.with_armature(default_joint_inertia(ARM)))
RODS = go.KineticEnergy(planar_arm((1.0, 1.0), (1.0, 1.0), (0.5, 0.5), (0.1, 0.1)))
Q0, Q1 = (0.3, 0.0, -0.2, 0.8, 0.0, 0.0, 0.0), (0.6, 0.2, -0.9, 1.4, 0.1, 0.0, 0.1)


@dataclass(frozen=True)
class FromRestToRest(MotionProblem):
    """Between two configurations at rest."""

    metric: go.Metric = field(default_factory=lambda: go.Euclidean(1))
    duration: float = 1.0
    start: Sequence[float] = (0.0,)
    goal: Sequence[float] = (1.0,)

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start), (q1, self.goal), (v0, 0.0), (v1, 0.0)]


def test_the_default_cost_gives_riemannian_cubics() -> None:
    q0, q1, rest = (0.0, 0.5), (0.8, 1.2), np.zeros(2)
    found = go.solve(FromRestToRest(RODS, 0.5, q0, q1))
    expected = go.cubic(RODS, q0, rest, q1, rest, 0.5)
    t = np.linspace(0.0, 0.5, 21)
    assert found.objective == pytest.approx(expected.action, rel=1e-7)
    np.testing.assert_allclose(found(t), expected(t), atol=1e-5)
    np.testing.assert_allclose(found.torques(t), expected.torques(t), atol=2e-3 * found.objective)


def test_free_velocities_and_via_points_give_the_spline() -> None:
    times, points = (0.0, 0.3, 0.8), ((0.0, 0.5), (0.4, 0.2), (1.0, 0.9))

    class Through(MotionProblem):
        metric, duration = go.Euclidean(2), times[-1]

        def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
            return [(q0, points[0]), (q1, points[2])]

        def via(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
            return [(times[1], [(q, points[1])])]

    found = go.solve(Through())
    t = np.linspace(0.0, 0.8, 17)
    expected = CubicSpline(times, points, bc_type="natural")
    np.testing.assert_allclose(found(t), expected(t), atol=1e-7)


class SpeedLimited(FromRestToRest):
    def constraints(self, t: Any, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Sequence[Any]:
        return [(-1.2, v, 1.2, "speed")]


def test_limits_hold_between_the_points_of_the_program() -> None:
    """Bryson and Ho's double integrator with a limit on speed: parabolas of speed, then the limit.

    v rises to V within t1 as V (1 - (1 - t / t1)^2), so that 1 = V (1 - 2 t1 / 3).
    """
    found = go.solve(SpeedLimited())
    t1 = 1.5 * (1.0 - 1.0 / 1.2)
    t = np.linspace(0.0, 1.0, 1001)
    speed = found(t, 1)[:, 0]
    assert speed.max() < 1.2 + 2e-4
    expected = 1.2 * (1.0 - np.maximum(0.0, 1.0 - np.minimum(t, 1.0 - t) / t1) ** 2)
    np.testing.assert_allclose(speed, expected, atol=5e-3)
    acceleration = 2.0 * 1.2 / t1
    assert found.objective == pytest.approx(acceleration**2 * t1 / 3.0, rel=1e-3)


@pytest.mark.slow
def test_gravity_enters_by_the_torque() -> None:
    """Without time to use the arm's weight, holding it still costs int |g(q)|^2 dt."""

    class Hold(FromRestToRest):
        def torque(self, q: ca.SX, v: ca.SX, a: ca.SX) -> Any:
            return ARM.inverse_dynamics(q, v, a)

        def cost(self, t: Any, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Any:
            return ca.dot(torque, torque)

    found = go.solve(Hold(HUMAN, 0.05, Q0, Q0))
    weight = ARM.inverse_dynamics(Q0, np.zeros(7), np.zeros(7))
    assert found.objective == pytest.approx(0.05 * float(weight @ weight), rel=0.02)
    assert found.objective < 0.05 * float(weight @ weight)


def test_a_failure_carries_the_last_iterate() -> None:
    class Impossible(FromRestToRest):
        def constraints(self, t: Any, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Sequence[Any]:
            return [(-0.5, v, 0.5, "speed")]

    named = r"Impossible was not solved: .* is violated by"
    with pytest.raises(go.NotConverged, match=named) as caught:
        go.solve(Impossible())
    assert caught.value.solution.times[-1] == 1.0
    assert not go.solve(Impossible(), throw=False).stats.success


class WithVia(FromRestToRest):
    times: Array | tuple[float, ...] = (0.5,)

    def via(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [(at, [(q, 0.5)]) for at in self.times]


def foreign(method: str, what: Any = ca.SX.sym("z")) -> MotionProblem:  # noqa: B008
    """A problem one of whose methods returns something that is not made of its arguments."""
    results = {
        "cost": what,
        "torque": what,
        "constraints": [(0.0, what, 1.0)],
        "via": [(0.5, [(what, 1.0)])],
        "boundary": [(what, 1.0, "the mark")],
    }
    return type("Foreign", (FromRestToRest,), {method: lambda *_: results[method]})()


@pytest.mark.parametrize(
    ("problem", "message"),
    [
        (FromRestToRest(duration=0.0), "duration must be positive"),
        (FromRestToRest(start=(0.0, 1.0)), "a bound must be one number or 1"),
        (type("List", (FromRestToRest,), {"torque": lambda *_: None})(), "torque must be"),
        (type("Once", (FromRestToRest,), {"via": lambda *_: [0.5]})(), "must be .time, equalities"),
        (FromRestToRest(goal=(np.inf,)), "a value must be finite"),
        (type("Late", (WithVia,), {"times": (1.5,)})(), "times must increase between 0 and 1 s"),
        (type("Odd", (FromRestToRest,), {"cost": lambda *_: [1, 2]})(), "cost must be a matrix"),
        (foreign("cost"), r"cost contains z, which is not one of its arguments \(t, q, v, a\)"),
        (foreign("torque"), r"torque contains z, which is not one .* \(q, v, a\)"),
        (foreign("constraints"), r"constraints\[0\] contains z"),
        (foreign("via"), r"via\[0\]\[0\] contains z, .* \(q, v\)"),
        (foreign("boundary"), r"the mark contains z, .* \(q0, v0, q1, v1\)"),
        (foreign("boundary", ca.SX(2.0)), "the mark: row 0 is 2 for every motion, not 1"),
        (foreign("constraints", 2.0), r"constraints\[0\]: row 0 is 2 for every motion, not 0 to 1"),
        (
            type("Guess", (FromRestToRest,), {"guess": lambda _, t: np.zeros(3)})(),
            r"guess must have shape \(5, 1\)",
        ),
    ],
)
def test_malformed_problems_are_named(problem: MotionProblem, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        go.solve(problem)


def test_saddles_are_left() -> None:
    class Well(FromRestToRest):
        """Rest at 0 is stationary, and not least: the cost falls to both sides."""

        def cost(self, t: Any, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Any:
            return a[0] ** 2 / 1e3 - 10.0 * q[0] ** 2 + q[0] ** 4

    found = go.solve(Well(goal=(0.0,)))
    assert found.objective < -10.0


def test_a_motion_of_no_cost_is_found() -> None:
    class Free(FromRestToRest):
        def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
            return [(q0, self.start), (q1, self.goal)]

    for goal in (0.0, 1.0):
        assert go.solve(Free(goal=(goal,))).objective == pytest.approx(0.0, abs=1e-12)
    assert go.solve(FromRestToRest(RODS, 0.5, *[(0.3, 0.8)] * 2)).objective == pytest.approx(
        0.0, abs=1e-12
    )


def test_an_end_that_cannot_be_met_is_named() -> None:
    class Beyond(FromRestToRest):
        def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
            return [(q0, 0.0), (ca.sin(q1), 2.0, "a sine of two")]

    found = go.solve(Beyond(), throw=False)
    assert not found.stats.success
    assert found.stats.worst_constraint == "a sine of two"


def test_rows_that_no_motion_changes_are_left_out() -> None:
    """As the height of a planar arm's hand."""

    class Planar(FromRestToRest):
        def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
            hand = ca.vertcat(ca.cos(q1), ca.sin(q1), 0.0)
            return [(q0, 0.0), (hand, [0.0, 1.0, 0.0]), (v0, 0.0), (v1, 0.0)]

        def guess(self, t: Array) -> Array:
            return t[:, None]

    assert go.solve(Planar())(1.0) == pytest.approx([np.pi / 2.0], abs=1e-6)


@pytest.mark.slow
def test_poses_and_velocities_of_the_hand_are_conditions() -> None:
    """The hand passes a point at a given velocity, and is never faster than a bound."""
    point = ARM.hand_pose(0.5 * (np.array(Q0) + Q1))[1]

    def velocity(q: ca.SX, v: ca.SX) -> ca.SX:
        return ca.jtimes(ARM.hand_pose(q)[1], q, v)

    class Past(FromRestToRest):
        def via(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
            return [(0.4, [(ARM.hand_pose(q)[1], point), (velocity(q, v)[0], 0.1)])]

        def constraints(self, t: Any, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Sequence[Any]:
            return [(-np.inf, ca.sumsqr(velocity(q, v)), 0.7**2, "speed of the hand")]

    found = go.solve(Past(HUMAN, 0.8, Q0, Q1))
    np.testing.assert_allclose(ARM.hand_pose(found(0.4))[1], point, atol=1e-6)
    step = 1e-5 * found(0.4, 1)
    ends = [ARM.hand_pose(found(0.4) + sign * step)[1][0] for sign in (1.0, -1.0)]
    assert (ends[0] - ends[1]) / 2e-5 == pytest.approx(0.1, abs=1e-4)
    places = np.array([ARM.hand_pose(q)[1] for q in found(np.linspace(0.0, 0.8, 401))])
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / 0.002
    assert 0.69 < speeds.max() < 0.7 + 1e-3


class LeastJerk(FromRestToRest):
    def cost(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Any:
        return 0.0

    def rate_cost(self, q: ca.SX, v: ca.SX, a: ca.SX, jerk: ca.SX, torque_rate: ca.SX) -> Any:
        return ca.dot(jerk, jerk)


def test_costs_of_jerk_have_continuous_accelerations() -> None:
    """From rest to rest with free accelerations at the ends, q^(6) = 0 and q''' = 0 there."""
    found = go.solve(LeastJerk())
    t = np.linspace(0.0, 1.0, 41)
    # q''' = c t (1 - t), integrated with q(0) = q'(0) = 0, q'(1) = 0 and q(1) = 1.
    expected = 2.5 * t**2 - 2.5 * t**4 + t**5
    np.testing.assert_allclose(found(t)[:, 0], expected, atol=1e-7)
    jumps = found(found.times[1:-1] - 1e-9, 2) - found(found.times[1:-1] + 1e-9, 2)
    np.testing.assert_allclose(jumps, 0.0, atol=1e-5)


@pytest.mark.slow
def test_the_rate_of_the_torque_is_its_derivative_in_time() -> None:
    class LeastTorqueChange(FromRestToRest):
        cost = LeastJerk.cost

        def rate_cost(self, q: ca.SX, v: ca.SX, a: ca.SX, jerk: ca.SX, torque_rate: ca.SX) -> Any:
            return ca.dot(torque_rate, torque_rate)

    found = go.solve(LeastTorqueChange(RODS, 1.0, (0.0, 0.5), (0.8, 1.2)))
    t = np.linspace(0.0, 1.0, 2001)
    rates = np.gradient(found.torques(t), t, axis=0)
    assert found.objective == pytest.approx(np.trapezoid(np.sum(rates**2, axis=1), t), rel=1e-3)
