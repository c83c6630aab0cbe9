"""Within limits: the arm is raised; the wrist stops at a limit that the geodesic would exceed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from matplotlib.axes import Axes

import geodesic_ocp as go


@dataclass(frozen=True)
class WithinLimits(go.Problem):
    """From one configuration to another, with and without joint limits in the picture."""

    arm: go.Model = field(default_factory=go.human_arm)
    start: tuple[float, ...] = (-0.3, 0.0, -0.6, 0.3, 0.0, 0.0, 0.0)  # [rad]
    goal: tuple[float, ...] = (1.4, 0.2, -0.6, 0.3, 0.0, 0.0, 0.0)
    limits: bool = True

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.arm)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start, "start"), (q1, self.goal, "goal")]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [(self.arm.lower, q, self.arm.upper, "joint limits")] if self.limits else []

    def draw(self, axes: Axes, path: go.Path, columns: tuple[int, int]) -> None:
        """The hand's path without joint limits."""
        geodesic = go.geodesic(self.metric, self.start, self.goal)
        hand = self.arm.hand_pose(geodesic(np.linspace(0.0, 1.0, 101)))[1][:, columns]
        axes.plot(*hand.T, color="#e07b00", linestyle="--", label="without limits")
