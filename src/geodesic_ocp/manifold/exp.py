"""The exponential map: the end point of a geodesic with a given initial velocity."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_positive, as_vector
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.manifold.kernels import integrate_by_scipy
from geodesic_ocp.manifold.metric import Metric, as_metric, over_rows, speeds_at

_UNIT_INTERVAL = np.array([0.0, 1.0])
# Initial tolerance of a step, relative to the tolerance of the end point, and its lower bound.
_STEP_FRACTION = 0.02
_FINEST_STEP_TOLERANCE = 1e-15
_SMALLEST = 1e-100  # tolerance of a step; its inverse square must not overflow
# Relative change of speed above which a geodesic is wrong.
_SPEED_CHANGE = 0.05
# A second integration with a tolerance larger by this factor shows how errors grow.
_LOOSER = 30.0
# The error of the end point is proportional to that of the steps if it is small, so the difference
# of the two overestimates it by far. Where geodesics diverge it decreases less: half is safe.
_ESTIMATE = 0.5
# Perturbation of the velocity, in units of its rounding, to which rounding errors of steps amount.
_ROUNDING = 4.0
# Differences of the velocity, relative to it, and the tolerance of a step of their integrations:
# the derivative is accurate to about their quotient and to the difference itself.
_DIFFERENCE = 1e-5
_DIFFERENCE_TOLERANCE = 1e-11


@over_rows
def exp(metric: Metric, q: Any, v: Any, *, tolerance: float = 1e-9) -> Array:
    """Return Exp_q(v): the point at time 1 of the geodesic from q with initial velocity v, (n,).

    sum_j g_ij q''_j + sum_jk Gamma_ijk q'_j q'_k = 0, q(0) = q, q'(0) = v, integrated with a method
    of order 8 and adaptive steps. For k points or velocities the result is (k, n).

    >>> metric = go.KineticEnergy(go.human_arm())
    >>> q, v = [0.3, 0.0, -0.2, 0.8, 0.0, 0.0, 0.0], [0.5, 0.2, 0.0, -0.3, 0.1, 0.0, 0.0]
    >>> go.exp(metric, q, v).round(3)
    array([ 0.868,  0.31 , -0.161,  0.126, -0.015,  0.452, -0.009])

    Args:
        metric: metric of the manifold.
        q: configuration (n,) [rad or m], or k of them (k, n).
        v: initial velocity (n,) [rad or m per unit of time], or k of them (k, n).
        tolerance: bound [rad or m] of the error of the end point, which is estimated from a second
            integration with a larger tolerance.

    Raises:
        ValueError: wrong shapes, numbers that are not finite, or the metric is not positive
            definite at q.
        IntegrationFailed: the metric becomes singular along the geodesic, or the tolerance cannot
            be reached; `time` and `state` say where.
    """
    metric = as_metric(metric)
    point = metric.point("q", q)
    velocity = as_vector("v", v, metric.dim)
    tolerance = as_positive("tolerance", tolerance)
    if not metric.has_constant_tensor and metric.kernels.available(at_once=False):
        end = metric.kernels.exp(point, velocity, _step_tolerance(tolerance), tolerance)
        if end is not None:
            return end
    positions, _ = sample_geodesic(metric, point, velocity, _UNIT_INTERVAL, tolerance=tolerance)
    return np.asarray(positions[-1])


def sample_geodesic(
    metric: Metric, q: Any, v: Any, times: ArrayLike, *, tolerance: float = 1e-9
) -> tuple[Array, Array]:
    """Return positions and velocities, (k, n) each, of the geodesic of `exp` at k increasing times.

    The geodesic starts at times[0], and every position is within the tolerance.

    Raises like `exp`.
    """
    point = metric.point("q", q)
    velocity = as_vector("v", v, metric.dim)
    instants = np.asarray(times, dtype=float)
    if metric.has_constant_tensor:
        line = point + np.outer(instants - instants[0], velocity)
        return line, np.tile(velocity, (instants.size, 1))
    per_step = _step_tolerance(tolerance)
    positions, _ = integrate_geodesic(metric, point, velocity, instants, _LOOSER * per_step)
    refined = False
    while True:
        looser = positions
        positions, velocities = integrate_geodesic(metric, point, velocity, instants, per_step)
        error = _ESTIMATE * float(np.abs(positions - looser).max())
        if refined and error <= tolerance:
            # Two integrations can agree by chance where rounding errors grow beyond the tolerance.
            for rounding in _ROUNDING * np.spacing(np.abs(velocity)) * np.array([[1.0], [-1.0]]):
                nearby, _ = integrate_geodesic(
                    metric, point, velocity + rounding, instants, per_step
                )
                error = max(error, float(np.abs(positions - nearby).max()))
        if error <= tolerance:
            _check_speed(metric, positions, velocities)
            return positions, velocities
        if per_step <= _FINEST_STEP_TOLERANCE:
            raise IntegrationFailed(
                f"exp from q = {point}: errors grow so fast along this geodesic that its points "
                f"are accurate to {error:.1e} at best, not to {tolerance:.1e}"
            )
        per_step = max(per_step / _LOOSER, _FINEST_STEP_TOLERANCE)
        refined = True


def _step_tolerance(tolerance: float) -> float:
    """Return initial tolerance of a step for this tolerance of the end point."""
    return max(_STEP_FRACTION * tolerance, _SMALLEST)


def _check_speed(metric: Metric, positions: Array, velocities: Array) -> None:
    """Reject a geodesic that rounding errors have deflected, near an infinitely distant boundary.

    There the distance to the boundary loses its digits, in both integrations alike.
    """
    squares = speeds_at(metric, positions, velocities) ** 2
    kept = np.abs(squares - squares[0]) <= _SPEED_CHANGE * squares[0]
    if not np.all(kept):
        first = int(np.argmin(kept))
        raise IntegrationFailed(
            f"exp from q = {positions[0]} with v = {velocities[0]}: the speed of a geodesic is "
            f"constant, but here it has changed from {np.sqrt(squares[0]):.4g} to "
            f"{np.sqrt(abs(squares[first])):.4g} at {positions[first]}: rounding errors dominate, "
            "as near a boundary or a singularity"
        )


def integrate_geodesic(
    metric: Metric,
    q: Array,
    v: Array,
    times: Array,
    step_tolerance: float,
    *,
    max_steps: int = 20_000,
) -> tuple[Array, Array]:
    """Integrate the geodesic once with a tolerance per step, without estimating the total error."""
    start = np.concatenate([q, v])
    try:
        if metric.kernels.available(at_once=False):
            states = metric.kernels.integrate(start, times, step_tolerance, max_steps)
        else:
            began = time.perf_counter()
            states = integrate_by_scipy(
                metric.geodesic_equation, start, times, step_tolerance, max_steps=max_steps
            )
            metric.kernels.used(time.perf_counter() - began)
    except IntegrationFailed as failure:
        state = np.asarray(failure.state)
        reached = state[: metric.dim]
        why = metric.near_singularity(reached)
        raise IntegrationFailed(
            f"exp from q = {q} with v = {v}: {failure}; {why or f'it had reached {reached}'}",
            failure.time,
            state,
        ) from None
    return states[:, : metric.dim], states[:, metric.dim :]


def exp_with_derivative(
    metric: Metric, q: Array, v: Array, *, max_steps: int
) -> tuple[Array, Array]:
    """Return Exp_q(v), (n,), and its derivative with respect to v, (n, n), to about five digits.

    Column j is the Jacobi field J with J(0) = 0 and J'(0) = e_j at time 1, from the difference of
    two geodesics. If the derivative is singular, Exp_q(v) is conjugate to q along the geodesic.

    Raises:
        IntegrationFailed: see `integrate_geodesic`.
    """
    size = _DIFFERENCE * float(np.abs(v).max())
    velocities = v + size * np.vstack([np.zeros(metric.dim), np.eye(metric.dim)])
    ends = np.array(
        [
            integrate_geodesic(
                metric, q, each, _UNIT_INTERVAL, _DIFFERENCE_TOLERANCE, max_steps=max_steps
            )[0][-1]
            for each in velocities
        ]
    )
    return ends[0], (ends[1:] - ends[0]).T / size
