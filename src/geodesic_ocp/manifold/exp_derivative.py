"""Derivatives of the exponential map: Jacobi fields that start at zero."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric


def exp_with_derivative(
    metric: Metric, q: Array, v: Array, of_steps: float, *, max_steps: int
) -> tuple[Array, Array]:
    """Exp_q(v), (n,), and its derivative by v, (n, n): column j is the Jacobi field of v_j at 1.

    One integration of the geodesic equation with its variational equation, with this error of a
    step. Where the derivative is singular, Exp_q(v) is conjugate to q along the geodesic.

    Raises:
        IntegrationFailed: see `Integrator`.
    """
    n = metric.dim
    start = np.concatenate([q, v, np.zeros(n * n), np.eye(n).ravel()])
    states = metric.variation_integrator(start, np.array([0.0, 1.0]), of_steps, max_steps=max_steps)
    return states[-1, :n], states[-1, 2 * n : (2 + n) * n].reshape(n, n).T
