"""The geodesic equation by Pinocchio's articulated-body algorithm, independent of the package.

Without gravity and joint torques a mechanical system moves along geodesics of its inertia matrix,
so that q'' is the forward dynamics at zero torque.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

import geodesic_ocp as go


class ForwardDynamics:
    """States y = (q, v) of a model without gravity and torques; numeric, one state at a time."""

    def __init__(self, model: go.Model) -> None:
        self._model = pin.Model(model.pin)
        self._model.gravity = pin.Motion.Zero()
        self._data = self._model.createData()
        self._torque = np.zeros(model.dof)
        self.dof = model.dof

    def rate(self, _: float, y: np.ndarray) -> np.ndarray:
        """Y' = (v, q'')."""
        q, v = y[: self.dof], y[self.dof :]
        return np.concatenate([v, pin.aba(self._model, self._data, q, v, self._torque)])

    def jacobian(self, y: np.ndarray) -> np.ndarray:
        """Derivative of `rate` by y, analytic."""
        n, data = self.dof, self._data
        pin.computeABADerivatives(self._model, data, y[:n], y[n:], self._torque)
        result = np.zeros((2 * n, 2 * n))
        result[:n, n:] = np.eye(n)
        result[n:, :n], result[n:, n:] = data.ddq_dq, data.ddq_dv
        return result

    def exp(self, q: np.ndarray, v: np.ndarray, tolerance: float = 1e-12) -> np.ndarray:
        """Exp_q(v) by scipy's DOP853; NaN if the integration fails."""
        start = np.concatenate([q, v])
        tolerances = {"rtol": tolerance, "atol": tolerance / 10.0}
        result = solve_ivp(self.rate, (0.0, 1.0), start, method="DOP853", **tolerances)
        return result.y[: self.dof, -1] if result.success else np.full(self.dof, np.nan)

    def exp_runge_kutta(self, q: np.ndarray, v: np.ndarray, steps: int = 200) -> np.ndarray:
        """Exp_q(v) by the classical Runge-Kutta method with steps of one size."""
        y, h = np.concatenate([q, v]), 1.0 / steps
        for _ in range(steps):
            k1 = self.rate(0.0, y)
            k2 = self.rate(0.0, y + h / 2.0 * k1)
            k3 = self.rate(0.0, y + h / 2.0 * k2)
            k4 = self.rate(0.0, y + h * k3)
            y = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        return y[: self.dof]

    def endpoint_error(self, q0: np.ndarray, velocity: np.ndarray, q1: np.ndarray) -> float:
        """Largest difference between Exp_q0(velocity) and q1 in any coordinate; inf on failure."""
        error = np.abs(self.exp(q0, velocity) - q1).max()
        return float(error) if np.isfinite(error) else np.inf
