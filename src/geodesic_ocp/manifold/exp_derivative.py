"""Derivative of the exponential map: Jacobi fields that vanish at the start."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric


def exp_with_derivative(
    metric: Metric, q: Array, v: Array, step_tolerance: float, *, max_steps: int
) -> tuple[Array, Array]:
    """Exp_q(v), (n,), and its derivative with respect to v, (n, n).

    Column j is the Jacobi field J with J(0) = 0 and J'(0) = e_j at time 1. The geodesic equation is
    integrated together with its variational equation. If the derivative is singular, Exp_q(v) is
    conjugate to q along the geodesic.

    Raises:
        IntegrationFailed: see `Integrator`.
    """
    n = metric.dim
    start = np.concatenate([q, v, np.zeros(n * n), np.eye(n).ravel()])
    states = metric.variation_integrator(
        start, np.array([0.0, 1.0]), step_tolerance, max_steps=max_steps
    )
    return states[-1, :n], states[-1, 2 * n : (2 + n) * n].reshape(n, n).T
