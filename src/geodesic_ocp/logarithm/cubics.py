"""Riemannian cubics and splines: motions of least covariant acceleration, also in tension."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_not_negative, as_positive, as_vector, real_array
from geodesic_ocp.logarithm.riemannian_spline import RiemannianSpline
from geodesic_ocp.logarithm.spline_search import least_action
from geodesic_ocp.manifold.metric import Metric, as_metric


def cubic(
    metric: Metric,
    q0: ArrayLike,
    v0: ArrayLike | None,
    q1: ArrayLike,
    v1: ArrayLike | None,
    duration: float,
    *,
    tension: float = 0.0,
) -> RiemannianSpline:
    """Return the Riemannian cubic between two positions and velocities.

    It minimizes int |D_t q'|^2_G dt locally, D_t q' = q'' + G^-1 Gamma(q', q') (Noakes, Heinzinger,
    Paden 1989; Crouch, Silva Leite 1995), and satisfies D_t^3 q' + R(D_t q', q') q' = 0. In tension
    it minimizes int (|D_t q'|^2_G + tension^2 |q'|^2_G) dt, and the equation has -tension^2 D_t q'
    in addition (Silva Leite, Camarinha, Crouch 2000): it tends to the geodesic as the tension
    grows. The result was integrated from its states: positions and velocities meet to 1e-9 in
    units of the interval, and the second variation of the discrete action is positive.

    >>> import geodesic_ocp as go
    >>> arm = go.human_arm()
    >>> metric = go.KineticEnergy(arm.with_armature(go.manifold.default_joint_inertia(arm)))
    >>> q0, q1 = [0.3, 0.0, -0.2, 0.8, 0.0, 0.0, 0.0], [0.6, 0.2, -0.9, 1.4, 0.1, 0.0, 0.1]
    >>> reach = go.cubic(metric, q0, [0.0] * 7, q1, [0.0] * 7, 0.5)
    >>> reach(0.25).round(3)
    array([ 0.408,  0.118, -0.537,  1.197,  0.05 ,  0.009,  0.063])

    Args:
        metric: metric of the manifold.
        q0, q1: the ends (n,).
        v0, v1: velocities there (n,) [per s]; None leaves one free, so that D_t q' is zero there.
        duration: time from q0 to q1 [s].
        tension: weight of the speed [1/s].

    Raises:
        ValueError: wrong shapes, numbers that are not finite, a negative tension, or a metric that
            is not positive definite at the ends.
        NotConverged: no cubic was found.
    """
    metric, times = as_metric(metric), np.array([0.0, as_positive("duration", duration, "s")])
    points = np.array([metric.point("q0", q0), metric.point("q1", q1)])
    return _spline(metric, times, points, v0, v1, tension)


def spline(
    metric: Metric,
    times: ArrayLike,
    configurations: Sequence[ArrayLike] | Array,
    *,
    v0: ArrayLike | None = None,
    v1: ArrayLike | None = None,
    tension: float = 0.0,
) -> RiemannianSpline:
    """Return the Riemannian cubic spline through configurations at given times.

    It minimizes int |D_t q'|^2_G dt locally among the motions through the configurations: between
    them it is a Riemannian cubic, at them it is twice continuously differentiable. In tension it
    minimizes int (|D_t q'|^2_G + tension^2 |q'|^2_G) dt, see `cubic`, and tends to the geodesics
    between the configurations as the tension grows.

    Args:
        metric: metric of the manifold.
        times: increasing (k,) [s], at least two.
        configurations: (k, n).
        v0, v1: velocities at the ends (n,) [per s]: zeros for rest, None for natural ends, at which
            D_t q' is zero.
        tension: weight of the speed [1/s].

    Raises:
        ValueError: wrong shapes, numbers that are not finite, times that do not increase, a
            negative tension, or a metric that is not positive definite at a configuration.
        NotConverged: no spline was found.
    """
    metric = as_metric(metric)
    instants = real_array(times, "times")
    increasing = instants.ndim == 1 and np.all(np.diff(instants) > 0.0)
    if not (increasing and len(instants) > 1 and np.all(np.isfinite(instants))):
        raise ValueError("times must be at least two increasing numbers")
    count = len(configurations) if hasattr(configurations, "__len__") else 0
    if count != len(instants):
        raise ValueError(
            f"there must be one configuration for each time, got {len(instants)} times and "
            f"{count} configurations"
        )
    named = enumerate(configurations)
    points = np.array([metric.point(f"configurations[{i}]", q) for i, q in named])
    return _spline(metric, instants, points, v0, v1, tension)


def _spline(
    metric: Metric,
    times: Array,
    points: Array,
    v0: ArrayLike | None,
    v1: ArrayLike | None,
    tension: float,
) -> RiemannianSpline:
    tension = as_not_negative("tension", tension, "1/s")
    named = ("v0", v0), ("v1", v1)
    velocities = [None if v is None else as_vector(name, v, metric.dim) for name, v in named]
    unit = float(np.diff(times).mean())
    knots = np.hstack([points, np.zeros_like(points)])
    is_free = np.repeat([[False, True]], len(times), axis=0)
    for row, velocity in zip((0, -1), velocities, strict=True):
        if velocity is not None:
            knots[row, metric.dim :], is_free[row, 1] = unit * velocity, False
    is_free = np.repeat(is_free, metric.dim, axis=1)
    return least_action(metric, times / unit, knots, is_free, unit * tension).slower(unit)
