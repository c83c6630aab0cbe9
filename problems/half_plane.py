"""Half-plane: a geodesic of the hyperbolic plane, an arc of a circle centred on the boundary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

import geodesic_ocp as go


@dataclass(frozen=True)
class UpperHalfPlane(go.Metric):
    """Points (x, y) with y > 0: ds^2 = (dx^2 + dy^2) / y^2, of curvature -1."""

    dim = 2

    def matrix(self, q: Any) -> Any:
        return type(q).eye(2) / q[1] ** 2


@dataclass(frozen=True)
class HalfPlane(go.Problem):
    """From one point to another, at different x."""

    start: tuple[float, float] = (-0.8, 0.4)
    goal: tuple[float, float] = (1.0, 1.1)

    @property
    def metric(self) -> go.Metric:
        return UpperHalfPlane()

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start, "start"), (q1, self.goal, "goal")]

    @property
    def exact_length(self) -> float:
        """arcosh(1 + |a - b|^2 / (2 a_y b_y))."""
        squared = np.sum(np.subtract(self.start, self.goal) ** 2)
        return float(np.arccosh(1.0 + squared / (2.0 * self.start[1] * self.goal[1])))

    def exact(self, s: np.ndarray) -> np.ndarray:
        """(c + r tanh t, r / cosh t): t is the arc length from the highest point."""
        (x0, y0), (x1, y1) = self.start, self.goal
        centre = (x1**2 + y1**2 - x0**2 - y0**2) / (2.0 * (x1 - x0))
        radius = np.hypot(x0 - centre, y0)
        t0, t1 = (np.arctanh((x - centre) / radius) for x in (x0, x1))
        t = t0 + s * (t1 - t0)
        return np.column_stack([centre + radius * np.tanh(t), radius / np.cosh(t)])
