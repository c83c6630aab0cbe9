"""Derivative of the exponential map: Jacobi fields that vanish at the start."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric

_UNIT_INTERVAL = np.array([0.0, 1.0])
# Differences of the velocity, relative to it, and the tolerance of a step of their integrations:
# the derivative is accurate to about their quotient and to the difference itself.
_DIFFERENCE, _DIFFERENCE_TOLERANCE = 1e-5, 1e-11


def exp_with_derivative(
    metric: Metric, q: Array, v: Array, step_tolerance: float, *, max_steps: int
) -> tuple[Array, Array]:
    """Exp_q(v), (n,), and its derivative with respect to v, (n, n).

    Column j is the Jacobi field J with J(0) = 0 and J'(0) = e_j at time 1. If the derivative is
    singular, Exp_q(v) is conjugate to q along the geodesic. Interpreted, the geodesic equation is
    integrated together with its variational equation. Compiled, n + 1 geodesics are integrated:
    their differences give the derivative to about five digits, in a fraction of the time.

    Raises:
        IntegrationFailed: see `Integrator`.
    """
    if metric.kernels.available(at_once=False):
        return _by_differences(metric, q, v, max_steps)
    n = metric.dim
    start = np.concatenate([q, v, np.zeros(n * n), np.eye(n).ravel()])
    states = metric.variation_integrator(start, _UNIT_INTERVAL, step_tolerance, max_steps=max_steps)
    return states[-1, :n], states[-1, 2 * n : (2 + n) * n].reshape(n, n).T


def _by_differences(metric: Metric, q: Array, v: Array, max_steps: int) -> tuple[Array, Array]:
    n, size = metric.dim, _DIFFERENCE * float(np.abs(v).max())
    starts = np.tile(np.concatenate([q, v]), (n + 1, 1))
    starts[1:, n:] += size * np.eye(n)
    ends = np.array(
        [
            metric.kernels.integrate(start, _UNIT_INTERVAL, _DIFFERENCE_TOLERANCE, max_steps)[-1]
            for start in starts
        ]
    )[:, :n]
    return ends[0], (ends[1:] - ends[0]).T / size
