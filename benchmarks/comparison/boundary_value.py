"""Logarithmic maps by scipy's `solve_bvp`, with Pinocchio's forward dynamics and derivatives."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_bvp

from comparison.pinocchio_aba import ForwardDynamics


class BoundaryValueSolver:
    """scipy's collocation from the straight line on 11 points, with analytic derivatives."""

    def __init__(self, dynamics: ForwardDynamics, tolerance: float = 1e-6) -> None:
        self._dynamics, self._tolerance = dynamics, tolerance
        self._mesh = np.linspace(0.0, 1.0, 11)

    def __call__(self, q0: np.ndarray, q1: np.ndarray) -> np.ndarray | None:
        """Initial velocity; None if scipy reports a failure."""
        n = q0.size
        at_start, at_end = np.zeros((2, 2 * n, 2 * n))
        at_start[:n, :n] = at_end[n:, :n] = np.eye(n)

        def conditions(ya: np.ndarray, yb: np.ndarray) -> np.ndarray:
            return np.concatenate([ya[:n] - q0, yb[:n] - q1])

        line = q0[:, None] + self._mesh * (q1 - q0)[:, None]
        guess = np.vstack([line, np.tile(q1 - q0, (self._mesh.size, 1)).T])
        with np.errstate(all="ignore"):
            found = solve_bvp(
                self._rates,
                conditions,
                self._mesh,
                guess,
                fun_jac=self._jacobians,
                bc_jac=lambda ya, yb: (at_start, at_end),
                tol=self._tolerance,
                max_nodes=1000,
            )
        return found.y[n:, 0] if found.success else None

    def _rates(self, s: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.stack([self._dynamics.rate(0.0, column) for column in y.T], axis=1)

    def _jacobians(self, s: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.stack([self._dynamics.jacobian(column) for column in y.T], axis=2)
