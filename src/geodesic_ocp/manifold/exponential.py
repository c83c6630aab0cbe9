"""The exponential map: where a geodesic arrives."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_positive, as_vector
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.manifold.metric import Metric, as_metric

# The error of each step is held this much below the tolerance that is asked of the end point.
_STEP_SHARE = 0.02


def exp(metric: Metric, q: Any, v: Any, *, tolerance: float = 1e-9) -> Array:
    """Exp_q(v): the point at time 1 of the geodesic through q (n,) with velocity v (n,).

    sum_j g_ij q''_j + sum_jk Gamma_ijk q'_j q'_k = 0, q(0) = q, q'(0) = v, integrated with order 8
    and a step that adapts; `tolerance` [rad or m] is for the end point.

    Raises:
        ValueError: wrong shapes or numbers that are not finite, or the metric is singular at q.
        IntegrationFailed: the metric becomes singular on the way, or the tolerance is unreachable.
    """
    positions, _ = trajectory(metric, q, v, np.array([0.0, 1.0]), tolerance=tolerance)
    return np.asarray(positions[-1])


def trajectory(
    metric: Metric,
    q: Any,
    v: Any,
    times: ArrayLike,
    *,
    tolerance: float = 1e-9,
    max_steps: int = 20_000,
) -> tuple[Array, Array]:
    """Positions and velocities, (k, n) each, at k increasing times of the geodesic of `exp`.

    The geodesic starts at times[0]; `max_steps` bounds the work.
    """
    metric = as_metric(metric)
    start = np.concatenate([metric.point("q", q), as_vector("v", v, metric.dim)])
    tolerance = as_positive("tolerance", tolerance)
    instants = np.asarray(times, dtype=float)
    if instants.ndim != 1 or instants.size < 2 or not np.all(np.diff(instants) > 0):
        raise ValueError("times must be at least two increasing numbers")
    try:
        states = metric.geodesic_integrator(
            start, instants, _STEP_SHARE * tolerance, max_steps=max_steps
        )
    except IntegrationFailed as failure:
        raise IntegrationFailed(f"exp from q = {start[: metric.dim]}: {failure}") from None
    return states[:, : metric.dim], states[:, metric.dim :]
