"""Around a disc: the shortest path in the plane past an obstacle, two tangents and an arc."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

import geodesic_ocp as go


@dataclass(frozen=True)
class AroundDisc(go.Problem):
    """From (-1, 0) to (1, 0) [m] around a disc at the origin, on its upper side."""

    radius: float = 0.5  # [m]

    @property
    def metric(self) -> go.Metric:
        return go.Euclidean(2)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, (-1.0, 0.0), "start"), (q1, (1.0, 0.0), "goal")]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [(self.radius, ca.norm_2(q), np.inf, "distance to the centre")]

    def guess(self, s: np.ndarray) -> np.ndarray:
        return np.column_stack([2.0 * s - 1.0, np.sin(np.pi * s)])

    @property
    def obstacles(self) -> Sequence[go.Ball]:
        return [go.Ball((0.0, 0.0, 0.0), self.radius, name="disc")]

    @property
    def exact_length(self) -> float:
        return float(2.0 * (np.sqrt(1.0 - self.radius**2) + self.radius * np.arcsin(self.radius)))
