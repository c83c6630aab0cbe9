"""The exponential map: where a geodesic arrives."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_positive, as_vector
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.over_rows import over_rows

# The error of each step is held this much below the tolerance at first, and at most.
_STEP_SHARE = 0.02
_FINEST_STEP_TOLERANCE = 1e-13
_SMALLEST = 1e-100  # tolerance of a step; its square must not overflow
# A speed that changes more is wrong; positions are still right where it changes less.
_SPEED_CHANGE = 0.05
# A second integration with steps this much looser tells how errors grow on the way.
_LOOSER = 30.0
# The end point's error falls with that of the steps, in proportion where it is small: by thirty.
# Where geodesics run apart it falls by less, and is taken for half of the difference.
_ESTIMATE = 0.5


@over_rows
def exp(metric: Metric, q: Any, v: Any, *, tolerance: float = 1e-9) -> Array:
    """Exp_q(v): the point at time 1 of the geodesic through q (n,) with velocity v (n,).

    sum_j g_ij q''_j + sum_jk Gamma_ijk q'_j q'_k = 0, q(0) = q, q'(0) = v, integrated with order 8
    and a step that adapts. `tolerance` [rad or m] is for the end point: the error is estimated from
    a second, looser integration, and the steps are refined until it is small enough.

    For k points or velocities (k, n), or both: k arrivals (k, n).

    Raises:
        ValueError: wrong shapes or numbers that are not finite, or the metric is no metric at q.
        IntegrationFailed: the metric becomes singular on the way, or the tolerance is unreachable;
            `time` and `state` say where.
    """
    positions, _ = sample_geodesic(metric, q, v, np.array([0.0, 1.0]), tolerance=tolerance)
    return np.asarray(positions[-1])


def sample_geodesic(
    metric: Metric, q: Any, v: Any, times: ArrayLike, *, tolerance: float = 1e-9
) -> tuple[Array, Array]:
    """Positions and velocities, (k, n) each, at k increasing times of the geodesic of `exp`.

    The geodesic starts at times[0]; every position is within the tolerance. Raises as `exp` does.
    """
    metric = as_metric(metric)
    point, velocity = metric.point("q", q), as_vector("v", v, metric.dim)
    tolerance = as_positive("tolerance", tolerance)
    instants = np.asarray(times, dtype=float)
    if instants.ndim != 1 or instants.size < 2 or not np.all(np.diff(instants) > 0):
        raise ValueError("times must be at least two increasing numbers")
    of_steps = max(_STEP_SHARE * tolerance, _SMALLEST)
    positions, _ = integrate_geodesic(metric, point, velocity, instants, _LOOSER * of_steps)
    while True:
        looser = positions
        positions, velocities = integrate_geodesic(metric, point, velocity, instants, of_steps)
        error = _ESTIMATE * float(np.abs(positions - looser).max())
        if error <= tolerance:
            _check_speed(metric, positions, velocities)
            return positions, velocities
        if of_steps <= _FINEST_STEP_TOLERANCE:
            raise IntegrationFailed(
                f"exp from q = {point}: errors grow so fast along this geodesic that its points "
                f"are known to {error:.1e} at best, not to {tolerance:.1e}"
            )
        of_steps = max(of_steps / _LOOSER, _FINEST_STEP_TOLERANCE)


def _check_speed(metric: Metric, positions: Array, velocities: Array) -> None:
    """Find a geodesic that rounding has turned away: near a boundary that is infinitely far.

    There the distance to the boundary has lost its digits, in every integration alike.
    """
    squares = np.einsum(
        "ki,kij,kj->k", velocities, [metric.matrix(q) for q in positions], velocities
    )
    kept = np.abs(squares - squares[0]) <= _SPEED_CHANGE * squares[0]
    if not np.all(kept):
        first = int(np.argmin(kept))
        raise IntegrationFailed(
            f"exp from q = {positions[0]} with v = {velocities[0]}: geodesics keep their speed, "
            f"but this one's has changed from {np.sqrt(squares[0]):.4g} to "
            f"{np.sqrt(abs(squares[first])):.4g} at {positions[first]}: rounding has the "
            "better of it, as near a boundary or a singularity"
        )


def integrate_geodesic(
    metric: Metric,
    q: Array,
    v: Array,
    times: Array,
    of_steps: float,
    *,
    max_steps: int = 20_000,
) -> tuple[Array, Array]:
    """One integration of the geodesic with this error of a step: `sample_geodesic` without its check."""
    try:
        states = metric.geodesic_integrator(
            np.concatenate([q, v]), times, of_steps, max_steps=max_steps
        )
    except IntegrationFailed as failure:
        state = np.asarray(failure.state)
        reached = state[: metric.dim]
        why = metric.near_singularity(reached)
        raise IntegrationFailed(
            f"exp from q = {q} with v = {v}: {failure}. It had come to "
            f"{f'where {why}' if why else reached}",
            failure.time,
            state,
        ) from None
    return states[:, : metric.dim], states[:, metric.dim :]
