"""Riemannian cubics and splines: closed forms, the equation they satisfy, and both routes."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from known_metrics import HalfPlane, PolarPlane, Sphere
from known_models import planar_arm
from scipy.integrate import simpson
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import geodesic_ocp as go
from geodesic_ocp.arrays import Array
from geodesic_ocp.logarithm import spline_search
from geodesic_ocp.logarithm.riemannian_spline import RiemannianSpline
from geodesic_ocp.manifold.metrics import default_joint_inertia
from geodesic_ocp.manifold.motion_kernels import SegmentBasis, second_order

ARM = go.human_arm()
HUMAN = go.KineticEnergy(ARM.with_armature(default_joint_inertia(ARM)))
RODS = go.KineticEnergy(planar_arm((1.0, 0.8), (1.3, 0.7), (0.4, 0.5), (0.2, 0.1)))
TIMES = np.linspace(0.0, 1.0, 21)
FEW = settings(max_examples=max(2, settings().max_examples // 5))  # of motions of an arm


class Rotations(go.Metric):
    """SO(3) in Euler angles x, y, z (intrinsic) with its bi-invariant metric |omega|^2."""

    dim = 3

    def matrix(self, q: Any) -> Any:
        jacobian = self.to_body(q)
        return jacobian.T @ jacobian

    @staticmethod
    def to_body(q: Any) -> Any:
        """From rates of the angles to the body's angular velocity."""
        c, s = ca.cos, ca.sin
        return ca.vertcat(
            ca.horzcat(c(q[1]) * c(q[2]), s(q[2]), 0),
            ca.horzcat(-c(q[1]) * s(q[2]), c(q[2]), 0),
            ca.horzcat(s(q[1]), 0, 1),
        )


def polar(x: Array, dx: Array) -> tuple[Array, Array]:
    r, phi = np.hypot(*x), np.arctan2(x[1], x[0])
    return np.array([r, phi]), np.array([x @ dx / r, (x[0] * dx[1] - x[1] * dx[0]) / r**2])


def test_cubics_of_a_constant_metric_are_polynomials() -> None:
    metric = go.Euclidean(3)
    points = np.array([[0.0, 1.0, 2.0], [0.5, 0.0, 1.0], [1.0, 1.0, 1.0], [0.0, 3.0, 1.0]])
    times = [0.0, 0.4, 1.1, 1.5]
    v0 = np.array([1.0, -2.0, 0.5])
    motion = go.spline(metric, times, points, v0=v0)
    expected = CubicSpline(times, points, bc_type=((1, v0), (2, np.zeros(3))))
    t = np.linspace(0.0, 1.5, 31)
    for order in range(3):
        value = expected(t, order)
        np.testing.assert_allclose(motion(t, order), value, atol=1e-12 * np.abs(value).max())
    points, weights = np.polynomial.legendre.leggauss(4)
    halves = [((a + b) / 2.0, (b - a) / 2.0) for a, b in pairwise(times)]
    squares = [h * weights @ np.sum(expected(m + h * points, 2) ** 2, axis=1) for m, h in halves]
    action = sum(squares) / 2.0
    assert motion.action == pytest.approx(action, rel=1e-12)


def test_the_plane_in_polar_coordinates_has_straight_cubics() -> None:
    curve = np.array([[1.0, 0.2], [0.3, 0.9], [-0.4, 0.5], [0.2, -0.6]])  # powers of t

    def at(t: float) -> tuple[Array, Array]:
        powers, slopes = t ** np.arange(4), np.arange(4) * t ** np.maximum(np.arange(4) - 1, 0)
        return powers @ curve, slopes @ curve

    (q0, v0), (q1, v1) = polar(*at(0.0)), polar(*at(1.0))
    motion = go.cubic(PolarPlane(), q0, v0, q1, v1, 1.0)
    expected = np.array([polar(*at(t))[0] for t in TIMES])
    np.testing.assert_allclose(motion(TIMES), expected, atol=1e-9)


@pytest.mark.parametrize(
    "metric",
    [Sphere(), HalfPlane(), pytest.param(HUMAN, marks=pytest.mark.slow)],
    ids=lambda m: type(m).__name__,
)
def test_cubic_time_laws_on_geodesics_are_cubics(metric: go.Metric) -> None:
    """D_t^3 q' = s'''' e = 0 and R(s'' e, s' e) s' e = 0 along a geodesic with unit velocity e."""
    q = np.full(metric.dim, 0.8)
    v = np.linspace(0.6, -0.3, metric.dim)
    s = np.polynomial.Polynomial([0.0, 0.4, 1.2, -0.6])
    rates = s.deriv()(np.array([0.0, 1.0]))
    line = go.logarithm.geodesic_from_velocity(metric, q, v)
    v1 = line.velocities(1.0) if hasattr(line, "velocities") else line(1.0, 1)
    motion = go.cubic(metric, q, rates[0] * v, line(1.0), rates[1] * v1, 1.0)
    np.testing.assert_allclose(motion(TIMES), line(s(TIMES)), atol=1e-8)


@pytest.mark.slow
def test_cubics_of_rotations_are_lie_quadratics() -> None:
    """The body's angular velocity satisfies V'' = V' x V + C (Noakes, 2003)."""
    metric = Rotations()
    ends = np.array([0.2, -0.3, 0.4]), np.array([-0.5, 0.6, 1.0])
    motion = go.cubic(metric, ends[0], [1.0, 2.0, -1.0], ends[1], [0.5, -1.0, 2.0], 1.0)
    t = np.linspace(0.0, 1.0, 2001)
    bodies = zip(motion(t), motion(t, 1), strict=True)
    velocity = np.array([ca.DM(metric.to_body(q)).full() @ v for q, v in bodies])
    first = np.gradient(velocity, t, axis=0, edge_order=2)
    second = np.gradient(first, t, axis=0, edge_order=2)
    constant = (second - np.cross(first, velocity))[5:-5]
    assert np.ptp(constant, axis=0).max() < 1e-3 * np.abs(constant).max()
    turn = Rotation.from_euler("XYZ", motion(1.0)).as_matrix()
    np.testing.assert_allclose(turn, Rotation.from_euler("XYZ", ends[1]).as_matrix(), atol=1e-9)


@pytest.mark.slow
@given(st.integers(0, 10_000))
@FEW
def test_cubics_of_an_arm_satisfy_their_equation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q0 = rng.uniform(ARM.lower, ARM.upper)
    q1 = q0 + rng.uniform(0.0, 0.5) * (rng.uniform(ARM.lower, ARM.upper) - q0)
    v0, v1 = rng.uniform(-3.0, 3.0, (2, 7))
    duration = rng.uniform(0.2, 1.0)
    motion = go.cubic(HUMAN, q0, v0, q1, v1, duration)
    t = np.linspace(0.0, duration, 7)
    scale = np.abs(motion.torques(t)).max() / duration**2
    assert np.abs(motion.residual(t)).max() < 1e-7 * scale * np.linalg.norm(
        np.linalg.inv(HUMAN.matrix(q0)), 2
    )
    energy = motion.hamiltonian(t)
    assert np.ptp(energy) < 1e-8 * (np.abs(energy).max() + motion.action / duration)
    np.testing.assert_allclose(motion(duration), q1, atol=1e-8)
    np.testing.assert_allclose(motion(duration, 1), v1, atol=1e-8)


def test_free_ends_are_natural() -> None:
    points = np.array([[0.3, 0, -0.2, 0.8, 0, 0, 0], [0.6, 0.2, -0.9, 1.4, 0.1, 0, 0.1]])
    motion = go.cubic(HUMAN, points[0], None, points[1], np.ones(7), 0.6)
    assert np.abs(motion.torques(0.0)).max() < 1e-8 * np.abs(motion.torques(0.6)).max()
    clamped = go.cubic(HUMAN, points[0], motion(0.0, 1), points[1], np.ones(7), 0.6)
    assert clamped.action == pytest.approx(motion.action, rel=1e-8)
    for change in np.eye(7)[:2]:
        v0 = motion(0.0, 1) + 0.1 * change
        other = go.cubic(HUMAN, points[0], v0, points[1], np.ones(7), 0.6)
        assert other.action > motion.action


def test_splines_are_twice_continuously_differentiable_and_least() -> None:
    rng = np.random.default_rng(3)
    times, points = [0.0, 0.3, 0.5, 0.9], np.cumsum(rng.uniform(-0.3, 0.3, (4, 7)), axis=0)
    motion = go.spline(HUMAN, times, points, v0=np.zeros(7), v1=np.zeros(7))
    np.testing.assert_allclose(motion(times), points, atol=1e-8)
    beside = np.array(times[1:-1])
    jump = motion(beside + 1e-7, 2) - motion(beside - 1e-7, 2)
    assert np.abs(jump).max() < 1e-5 * np.abs(motion(times, 2)).max()
    # Of cubics through the same states the spline has the least action.
    for knot in (1, 2):
        for sign in (-1.0, 1.0):
            velocities = motion(times, 1)
            velocities[knot] += sign * 0.05
            pieces = [
                go.cubic(HUMAN, points[k], velocities[k], points[k + 1], velocities[k + 1], t1 - t0)
                for k, (t0, t1) in enumerate(pairwise(times))
            ]
            assert sum(piece.action for piece in pieces) > motion.action


@pytest.mark.slow
def test_ipopt_finds_the_same_motions(monkeypatch: pytest.MonkeyPatch) -> None:
    metric, rng = Rotations(), np.random.default_rng(5)
    times, points = [0.0, 0.3, 0.7], np.cumsum(rng.uniform(-0.3, 0.3, (3, 3)), axis=0)
    compiled = go.spline(metric, times, points, v0=np.ones(3))
    monkeypatch.setattr(type(second_order(metric)), "available", lambda *_: False)
    monkeypatch.setattr(spline_search, "STEP", 1e-13)
    reference = go.spline(metric, times, points, v0=np.ones(3))
    assert reference.action == pytest.approx(compiled.action, rel=1e-9)
    t = np.linspace(0.0, 0.7, 15)
    np.testing.assert_allclose(reference(t), compiled(t), atol=1e-8)


def test_motions_are_sampled_as_trajectories() -> None:
    q0, q1 = np.zeros(7), np.full(7, 0.3)
    reach = go.cubic(HUMAN, q0, np.zeros(7), q1, np.zeros(7), 0.5)
    trajectory = reach.to_trajectory(200.0)
    assert trajectory.joint_names == tuple(ARM.joint_names)
    assert trajectory.duration == pytest.approx(0.5)
    np.testing.assert_allclose(trajectory.positions[-1], q1, atol=1e-8)
    between = np.array([0.1013, 0.2381])
    np.testing.assert_allclose(trajectory.states(between)[0], reach(between), atol=1e-7)
    motion = reach.to_motion(100.0)
    assert motion.q.shape == (51, 7)
    assert np.array_equal(motion.velocity, reach(motion.time, 1))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"times": [0.0, 0.0, 1.0]}, "times must be at least two increasing numbers"),
        ({"times": [0.0, 1.0]}, "2 times and 3 configurations"),
        ({"v0": [1.0, 2.0, 3.0]}, r"v0 must have shape \(2,\)"),
        ({"v1": [np.nan, 0.0]}, "v1 must be finite"),
        ({"configurations": [[1, 2], [3, 4], [5, np.inf]]}, r"configurations\[2\] must be finite"),
    ],
)
def test_bad_input_is_named(change: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {
        "times": [0.0, 0.5, 1.0],
        "configurations": [[1.0, 0.5], [1.2, 0.6], [1.0, 0.9]],
    }
    with pytest.raises(ValueError, match=message):
        go.spline(Sphere(), **{**arguments, **change})
    motion = go.spline(Sphere(), **arguments)
    with pytest.raises(ValueError, match="t must be from 0 to 1"):
        motion(1.5)
    with pytest.raises(ValueError, match="order must be 0, 1 or 2"):
        motion(0.5, 3)


@pytest.mark.parametrize(
    "metric", [RODS, pytest.param(HUMAN, marks=pytest.mark.slow)], ids=["rods", "arm"]
)
def test_certificates_tell_minima_from_other_stationary_motions(metric: go.Metric) -> None:
    rng = np.random.default_rng(7)
    times, points = [0.0, 0.3, 0.7], np.cumsum(rng.uniform(-0.3, 0.3, (3, metric.dim)), axis=0)
    for tension in (0.0, 3.0):
        motion = go.spline(metric, times, points, v0=np.zeros(metric.dim), tension=tension)
        assert motion.certificate.locally_minimizing
        assert motion.certificate.residual < 1e-8
        assert motion.certificate.boundary_residual < 1e-7
    assert go.spline(go.Euclidean(metric.dim), times, points).certificate.locally_minimizing


@pytest.mark.parametrize("length", np.array([0.5, 1.15, 1.9]) * np.pi)
def test_second_variation_on_a_great_circle(length: float) -> None:
    """From rest to rest along the equator, s(t), the action's second variation by the latitude d is

    int (d_tt + s_t^2 d)^2 + (s_tt^2 + 2 s_t s_ttt) d^2 dt.
    """
    s = np.polynomial.Polynomial([0.0, 0.0, 3.0 * length, -2.0 * length])
    times = np.linspace(0.0, 1.0, 5)
    derivatives = [s.deriv(k)(times) if k else s(times) for k in range(4)]
    zero = np.zeros(5)
    states = np.column_stack([zero + np.pi / 2.0, derivatives[0], zero, derivatives[1]])
    momenta = np.column_stack([zero, -derivatives[3], zero, derivatives[2]])
    is_free = np.ones((5, 4), dtype=bool)
    is_free[[0, -1]] = False
    starts = np.hstack([states, momenta])[:-1]
    motion = RiemannianSpline(Sphere(), times, starts, states[-1], 0.0, is_free)
    basis = SegmentBasis(14, 40)
    t, weights = basis.rule
    latitude, bend = (basis.values(t, order)[4:] for order in (0, 2))
    v, a, j = (s.deriv(k)(t) for k in (1, 2, 3))
    operator = bend + v**2 * latitude
    form = (weights * operator) @ operator.T + (
        weights * (a**2 + 2.0 * v * j) * latitude
    ) @ latitude.T
    assert motion.certificate.stationary
    assert motion.certificate.negative == np.sum(np.linalg.eigvalsh(form) < 0.0)
    assert motion.certificate.residual < 1e-12


def test_failures_name_their_cause() -> None:
    with pytest.raises(go.NotConverged, match="near a singularity or a boundary"):
        go.cubic(HalfPlane(), [0.0, -1.0], [1.0, 0.0], [1.0, 2.0], [0.0, 1.0], 1.0)
    ends = [0.0] * 2, [60.0] * 2, [0.5] * 2, [-80.0] * 2
    with pytest.raises(go.NotConverged, match="the velocities large"):
        go.cubic(RODS, *ends, 3.0)


@pytest.mark.parametrize(
    "metric", [Sphere(), HalfPlane(), Rotations()], ids=lambda m: type(m).__name__
)
def test_the_equation_holds_for_metrics_of_users(metric: go.Metric) -> None:
    q, v = np.full(metric.dim, 0.8), np.linspace(1.0, -0.5, metric.dim)
    motion = go.cubic(metric, q, v, q + 0.3, -v, 0.7)
    t = np.linspace(0.0, 0.7, 9)
    size = np.abs(motion(t, 2)).max() / 0.7**2
    assert np.abs(motion.residual(t)).max() < 1e-9 * size
    assert motion.certificate.locally_minimizing


@pytest.mark.slow
@pytest.mark.parametrize(
    ("metric", "duration"),
    [(Sphere(), 1e-4), (HalfPlane(), 1e4), pytest.param(HUMAN, 1e-4, marks=pytest.mark.slow)],
    ids=lambda each: type(each).__name__,
)
def test_motions_without_action_are_geodesics_at_any_speed(
    metric: go.Metric, duration: float
) -> None:
    """With free velocities at the ends, or those of a geodesic, none has less action than zero."""
    line = go.logarithm.geodesic_from_velocity(
        metric, np.full(metric.dim, 0.8), np.linspace(0.6, -0.3, metric.dim)
    )
    ends = line(0.0), line(1.0)
    speeds = line.velocity / duration, line(1.0, 1) / duration
    natural = go.cubic(metric, ends[0], None, ends[1], None, duration)
    given = go.cubic(metric, ends[0], speeds[0], ends[1], speeds[1], duration)
    still = go.cubic(metric, ends[0], 0.0 * ends[0], ends[0], 0.0 * ends[0], duration)
    shortest = go.geodesic(metric, *ends)
    for motion, path in ((natural, shortest), (given, line)):
        assert motion.action * duration**3 < 1e-12
        np.testing.assert_allclose(motion(duration * TIMES), path(TIMES), atol=1e-8)
    for motion in (natural, given, still):
        assert motion.certificate.locally_minimizing
        assert motion.certificate.residual < 1e-6


def test_the_action_is_that_of_the_integrated_motion() -> None:
    motion = go.cubic(HUMAN, np.zeros(7), 3.0 * np.ones(7), np.full(7, 0.4), -3.0 * np.ones(7), 0.8)
    t = np.linspace(0.0, 0.8, 1001)
    tensors = np.array([HUMAN.matrix(q) for q in motion(t)])
    torques = motion.torques(t)
    squares = np.sum(torques * np.linalg.solve(tensors, torques[..., None])[..., 0], axis=1)
    assert motion.action == pytest.approx(simpson(squares, x=t) / 2.0, rel=1e-9)


@pytest.mark.parametrize(
    "tension", [1e-4, 0.7, *(pytest.param(k, marks=pytest.mark.slow) for k in (8.0, 120.0))]
)
def test_splines_in_tension_of_a_constant_metric(tension: float) -> None:
    """q'''' = tension^2 q'': by the exponentials, with coefficients from the conditions."""
    ends, duration = np.array([[0.3, -1.0], [1.2, 0.4]]), 0.8
    given = go.Euclidean(2), ends[0], [1.0, 0.0], ends[1], None, duration
    motion = go.cubic(*given, tension=tension)
    t = np.linspace(0.0, duration, 9)

    def basis(t: Any, order: int) -> Array:
        """1, t and decaying exponentials from both ends."""
        first, last = np.exp(-tension * np.asarray(t)), np.exp(tension * (t - duration))
        line = [(np.ones_like(first), t + 0.0 * first), (0.0 * first, np.ones_like(first))]
        linear = line[order] if order < 2 else (0.0 * first, 0.0 * first)
        return np.array([*linear, (-tension) ** order * first, tension**order * last])

    rows = [basis(0.0, 0), basis(0.0, 1), basis(duration, 0), basis(duration, 2)]
    values = [ends[0], [1.0, 0.0], ends[1], [0.0, 0.0]]
    if tension > 0.1:  # else the exponentials cancel
        expected = basis(t, 0).T @ np.linalg.solve(rows, values)
        np.testing.assert_allclose(motion(t), expected, atol=1e-10)
    else:
        np.testing.assert_allclose(motion(t), go.cubic(*given)(t), atol=tension**2)
    assert motion.certificate.locally_minimizing
    assert motion.certificate.boundary_residual < 1e-9


@pytest.mark.slow
@given(st.floats(0.5, 60.0), st.integers(0, 1000))
@FEW
def test_splines_in_tension_satisfy_their_equation(tension: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    times, points = [0.0, 0.3, 0.7], np.cumsum(rng.uniform(-0.3, 0.3, (3, 7)), axis=0)
    motion = go.spline(HUMAN, times, points, v0=rng.uniform(-1.0, 1.0, 7), tension=tension)
    t = np.linspace(0.01, 0.29, 5)
    energy, size = motion.hamiltonian(t), np.abs(motion(t, 2)).max() * (1.0 / 0.3 + tension) ** 2
    assert np.ptp(energy) < 1e-8 * (np.abs(energy).max() + motion.action)
    assert np.abs(motion.residual(t)).max() < 1e-8 * size
    assert np.abs(motion.torques(0.7)).max() < 1e-8 * np.abs(motion.torques(t)).max()
    np.testing.assert_allclose(motion(times), points, atol=1e-8)


@pytest.mark.slow
def test_splines_tend_to_geodesics_as_the_tension_grows() -> None:
    """Within 1 / tension of the knots the speed changes; elsewhere it is a piecewise geodesic."""
    times, points = [0.0, 0.4, 1.0], np.array([[0.8, 0.0], [1.3, 0.9], [0.7, 1.6]])
    path = [go.geodesic(Sphere(), *pair) for pair in pairwise(points)]
    expected = np.array([path[0](0.5), path[1](0.5)])
    errors = []
    for tension in (20.0, 200.0, 2000.0):
        motion = go.spline(Sphere(), times, points, tension=tension)
        errors.append(np.abs(motion([0.2, 0.7]) - expected).max())
    assert errors[0] > 5.0 * errors[1] > 25.0 * errors[2]  # first order in 1 / tension


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_the_unit_of_time_does_not_matter(unit: float) -> None:
    """q(t / T) of the same ends; both routes."""
    q = np.array([[0.8, 1.0], [1.3, 1.9], [0.7, 2.6]])
    times, v0 = np.array([0.0, 0.4, 1.0]), np.array([1.0, -0.5])
    motion = go.spline(HalfPlane(), times, q, v0=v0, tension=3.0)
    scaled = go.spline(HalfPlane(), unit * times, q, v0=v0 / unit, tension=3.0 / unit)
    t = np.linspace(0.0, 1.0, 21)
    np.testing.assert_allclose(scaled(unit * t), motion(t), atol=1e-11)
    np.testing.assert_allclose(unit * scaled(unit * t, 1), motion(t, 1), atol=1e-9)
    assert scaled.action * unit**3 == pytest.approx(motion.action, rel=1e-9)
    assert scaled.certificate.locally_minimizing
    assert scaled.certificate.residual < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "duration"), [(19, 1e-4), (52, 1.0), (19, 1e4)])
def test_cubics_that_bend_sharply_are_certified_in_any_unit_of_time(
    arm: go.Model, seed: int, duration: float
) -> None:
    """As few polynomials as those that found them do not represent them."""
    rng = np.random.default_rng(seed)
    start, end = rng.uniform(0.5 * arm.lower, 0.5 * arm.upper, (2, 7))
    before, after = 0.5 * rng.normal(size=(2, 7)) / duration
    for first in (before, None):
        motion = go.cubic(go.KineticEnergy(arm), start, first, end, after, duration)
        assert motion.certificate.locally_minimizing
