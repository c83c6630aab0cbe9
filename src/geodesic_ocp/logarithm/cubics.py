"""Riemannian cubics and splines: motions of least covariant acceleration, also in tension."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import (
    Array,
    as_not_negative,
    as_positive,
    as_rotation,
    as_vector,
    real_array,
)
from geodesic_ocp.logarithm.free_ends import FreeSpline
from geodesic_ocp.logarithm.hand_target import HandTarget
from geodesic_ocp.logarithm.riemannian_spline import RiemannianSpline
from geodesic_ocp.logarithm.spline_search import least_action
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.inverse_kinematics import inverse_kinematics

_MOST = 2000.0  # tension times duration


def cubic(
    metric: Metric,
    q0: ArrayLike,
    v0: ArrayLike | None,
    q1: ArrayLike | None,
    v1: ArrayLike | None,
    duration: float,
    *,
    position: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    tension: float = 0.0,
) -> RiemannianSpline:
    """Return the Riemannian cubic between two positions and velocities.

    It minimizes int |D_t q'|^2_G dt locally, D_t q' = q'' + G^-1 Gamma(q', q') (Noakes, Heinzinger,
    Paden 1989; Crouch, Silva Leite 1995), and satisfies D_t^3 q' + R(D_t q', q') q' = 0. In tension
    it minimizes int (|D_t q'|^2_G + tension^2 |q'|^2_G) dt, and the equation has -tension^2 D_t q'
    in addition (Silva Leite, Camarinha, Crouch 2000): it tends to the geodesic as the tension
    grows. Where a pose of the hand is given in place of q1, the end is optimal: the momentum p
    there has no component along the configurations with this pose.

    The result was integrated from its states: positions, and velocities times the interval, meet
    to 1e-9, and the second variation of the discrete action is positive for fixed ends.

    >>> arm = go.human_arm()
    >>> metric = go.KineticEnergy(arm.with_armature(go.manifold.default_joint_inertia(arm)))
    >>> q0, q1 = [0.3, 0.0, -0.2, 0.8, 0.0, 0.0, 0.0], [0.6, 0.2, -0.9, 1.4, 0.1, 0.0, 0.1]
    >>> reach = go.cubic(metric, q0, [0.0] * 7, q1, [0.0] * 7, 0.5)
    >>> reach(0.25).round(3)
    array([ 0.408,  0.118, -0.537,  1.197,  0.05 ,  0.009,  0.063])

    Args:
        metric: metric of the manifold.
        q0, q1: the ends (n,); q1 is None where the pose of the hand is given.
        v0, v1: velocities there (n,) [per s]; None leaves one free, so that D_t q' is zero there.
        duration: time from q0 to q1 [s].
        position: of the hand (end-effector) at the end (3,) [m], in the base's frame; joint limits
            are no condition, neither there nor on the way.
        rotation: of the hand at the end (3, 3).
        tension: weight of the speed [1/s].

    Raises:
        ValueError: wrong shapes, numbers that are not finite, a negative tension, or a metric that
            is not positive definite at the ends; both q1 and a pose, or neither.
        NotConverged: no cubic was found, or no configuration with the pose.
    """
    metric = as_metric(metric)
    times = np.array([0.0, as_positive("duration", duration, "s")])
    hand = _hand(metric, position, rotation)
    if (q1 is None) != (hand is not None):
        raise ValueError("give q1, or None and a position or rotation of the hand at the end")
    if hand is not None and v0 is None and v1 is None and tension == 0.0:
        raise ValueError(
            "every geodesic to the pose of the hand has no acceleration: give v0, v1 or a tension"
        )
    points = [metric.point("q0", q0)]
    if q1 is not None:
        points.append(metric.point("q1", q1))
    return _spline(metric, times, points, v0, v1, tension, hand)


def spline(
    metric: Metric,
    times: ArrayLike,
    configurations: Sequence[ArrayLike | None] | Array,
    *,
    v0: ArrayLike | None = None,
    v1: ArrayLike | None = None,
    position: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    time_bounds: tuple[ArrayLike, ArrayLike] | None = None,
    tension: float = 0.0,
) -> RiemannianSpline:
    """Return the Riemannian cubic spline through configurations at given times.

    It minimizes int |D_t q'|^2_G dt locally among the motions through the configurations: between
    them it is a Riemannian cubic, at them it is twice continuously differentiable. In tension it
    minimizes int (|D_t q'|^2_G + tension^2 |q'|^2_G) dt, see `cubic`, and tends to the geodesics
    between the configurations as the tension grows.

    With bounds of the times, those between the ends are optimal: the Hamiltonian does not jump at
    them, or a bound is active, see `MotionCertificate`. This is a local minimum near `times`, with
    no interval shorter than a tenth of the mean one, or half of the shortest in `times`.

    >>> times, points = [0.0, 1.0, 2.0], [[0.0], [1.0], [0.0]]
    >>> motion = go.spline(go.Euclidean(1), times, points, v0=[0.0], v1=[0.0])
    >>> motion(0.5).round(3)
    array([0.5])

    Args:
        metric: metric of the manifold.
        times: increasing (k,) [s], at least two.
        configurations: (k, n); the last is None where a pose of the hand is given.
        v0, v1: velocities at the ends (n,) [per s]: zeros for rest, None for natural ends, at which
            D_t q' is zero.
        position: of the hand (end-effector) at the end (3,) [m], in the base's frame.
        rotation: of the hand at the end (3, 3).
        time_bounds: lower and upper bounds of the times between the ends, (k - 2,) or a number each
            [s]; None: they are given.
        tension: weight of the speed [1/s].

    Raises:
        ValueError: wrong shapes, numbers that are not finite, times that do not increase or are not
            within their bounds, a negative tension, or a metric that is not positive definite at a
            configuration.
        NotConverged: no spline was found.
    """
    metric = as_metric(metric)
    instants = real_array(times, "times")
    increasing = instants.ndim == 1 and np.all(np.diff(instants) > 0.0)
    if not (increasing and len(instants) > 1 and np.all(np.isfinite(instants))):
        raise ValueError("times must be at least two increasing numbers")
    hand = _hand(metric, position, rotation)
    count = len(configurations) if hasattr(configurations, "__len__") else 0
    if count != len(instants):
        raise ValueError(
            f"there must be one configuration for each time, got {len(instants)} times and "
            f"{count} configurations"
        )
    if (configurations[-1] is None) != (hand is not None):
        raise ValueError(
            "the last configuration is None if a position or rotation of the hand is given there, "
            "and only then"
        )
    bounds = None if time_bounds is None else _time_bounds(time_bounds, instants)
    named = enumerate(configurations[: count - (hand is not None)])
    points = [metric.point(f"configurations[{i}]", q) for i, q in named if q is not None]
    return _spline(metric, instants, points, v0, v1, tension, hand, bounds)


def _time_bounds(given: tuple[ArrayLike, ArrayLike], times: Array) -> Array:
    """Return bounds (2, k - 2) of the times between the ends."""
    inner = times[1:-1]
    if not inner.size:
        raise ValueError("time_bounds: there are no times between the ends")
    try:
        lower, upper = (np.broadcast_to(real_array(each), inner.shape) for each in given)
    except (TypeError, ValueError):
        raise ValueError(
            f"time_bounds must be two numbers or arrays of {inner.size}, got {given!r}"
        ) from None
    within = np.all((times[0] <= lower) & (lower <= inner) & (inner <= upper))
    if not (within and np.all(upper <= times[-1])):
        raise ValueError(
            f"time_bounds must enclose the times between the ends and lie within {times[0]:.6g} "
            f"and {times[-1]:.6g}, got {given!r}"
        )
    return np.array([lower, upper])


def _hand(
    metric: Metric, position: ArrayLike | None, rotation: ArrayLike | None
) -> HandTarget | None:
    """Return the pose of the hand that is given, if any."""
    if position is None and rotation is None:
        return None
    model = getattr(metric, "model", None)
    if not isinstance(model, Model):
        raise ValueError(f"position and rotation need a metric with a model, got {metric!r}")
    return HandTarget(
        model,
        None if position is None else as_vector("position", position, 3),
        None if rotation is None else as_rotation("rotation", rotation),
    )


def _spline(
    metric: Metric,
    times: Array,
    points: list[Array],
    v0: ArrayLike | None,
    v1: ArrayLike | None,
    tension: float,
    hand: HandTarget | None,
    bounds: Array | None = None,
) -> RiemannianSpline:
    if hand is not None:
        pose = hand.position, hand.rotation
        points = [*points, inverse_kinematics(hand.model, points[-1], *pose, limits=False)]
    tension = as_not_negative("tension", tension, "1/s")
    most = _MOST / float(times[-1] - times[0])
    if tension > most:
        raise ValueError(
            f"tension must be at most {most:.4g} /s for this duration, got {tension:g}: beyond, "
            "the curve is piecewise geodesic to a thousandth of the duration"
        )
    named = ("v0", v0), ("v1", v1)
    velocities = [None if v is None else as_vector(name, v, metric.dim) for name, v in named]
    unit = float(np.diff(times).mean())
    knots = np.hstack([points, np.zeros((len(points), metric.dim))])
    is_free = np.repeat([[False, True]], len(times), axis=0)
    for row, velocity in zip((0, -1), velocities, strict=True):
        if velocity is not None:
            knots[row, metric.dim :] = unit * velocity
            is_free[row, 1] = False
    is_free = np.repeat(is_free, metric.dim, axis=1)
    given = metric, times / unit, knots, is_free, unit * tension
    if hand is None and bounds is None:
        return least_action(*given).slower(unit)
    free = FreeSpline(*given, None if bounds is None else bounds / unit, hand)
    return free.solved().slower(unit)
