"""Flat plane in polar coordinates: the metric varies, yet geodesics are straight lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

import geodesic_ocp as go


@dataclass(frozen=True)
class Polar(go.Metric):
    """The plane in radius and angle: ds^2 = dr^2 + r^2 dp^2."""

    dim = 2

    def matrix(self, q: Any) -> Any:
        return ca.diag(ca.vertcat(1.0, q[0] ** 2))


@dataclass(frozen=True)
class PolarPlane(go.Problem):
    """From one point to another, each given as radius [m] and angle [rad]."""

    start: tuple[float, float] = (1.0, 0.0)
    goal: tuple[float, float] = (2.0, 1.8)

    @property
    def metric(self) -> go.Metric:
        return Polar()

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start, "start"), (q1, self.goal, "goal")]

    @property
    def exact_length(self) -> float:
        return float(np.linalg.norm(_in_plane(self.goal) - _in_plane(self.start)))

    def exact(self, s: np.ndarray) -> np.ndarray:
        """The straight line, in radius and angle."""
        line = np.outer(1.0 - s, _in_plane(self.start)) + np.outer(s, _in_plane(self.goal))
        return np.column_stack([np.hypot(*line.T), np.arctan2(line[:, 1], line[:, 0])])


def _in_plane(q: tuple[float, float]) -> np.ndarray:
    radius, angle = q
    return radius * np.array([np.cos(angle), np.sin(angle)])
