"""Great circle: the geodesic between two points of the unit sphere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

import geodesic_ocp as go


@dataclass(frozen=True)
class Sphere(go.Metric):
    """A sphere in colatitude t and longitude p: ds^2 = r^2 (dt^2 + sin^2 t dp^2)."""

    radius: float = 1.0
    dim = 2

    def matrix(self, q: Any) -> Any:
        return self.radius**2 * ca.diag(ca.vertcat(1.0, ca.sin(q[0]) ** 2))


@dataclass(frozen=True)
class GreatCircle(go.Problem):
    """From one point to another, each given as colatitude and longitude [rad]."""

    start: tuple[float, float] = (1.0, 0.0)
    goal: tuple[float, float] = (1.4, 1.9)
    radius: float = 1.0

    @property
    def metric(self) -> go.Metric:
        return Sphere(self.radius)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start, "start"), (q1, self.goal, "goal")]

    @property
    def exact_length(self) -> float:
        a, b = _on_sphere(self.start), _on_sphere(self.goal)
        return float(self.radius * np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))

    def exact(self, s: np.ndarray) -> np.ndarray:
        """Spherical linear interpolation, in colatitude and longitude."""
        a, b = _on_sphere(self.start), _on_sphere(self.goal)
        angle = self.exact_length / self.radius
        weights = np.sin(angle * np.column_stack([1.0 - s, s])) / np.sin(angle)
        x, y, z = (weights @ np.array([a, b])).T
        return np.column_stack([np.arccos(z), np.arctan2(y, x)])


def _on_sphere(q: tuple[float, float]) -> np.ndarray:
    t, p = q
    return np.array([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)])
