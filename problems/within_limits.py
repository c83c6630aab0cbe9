"""Within limits: the arm is raised; the wrist stops where the geodesic would bend it further."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

import geodesic_ocp as go


@dataclass(frozen=True)
class WithinLimits(go.Problem):
    """From one posture to another; compare `go.geodesic(problem.metric, start, goal)`."""

    arm: go.Model = field(default_factory=go.human_arm)
    start: tuple[float, ...] = (-0.3, 0.0, -0.6, 0.3, 0.0, 0.0, 0.0)  # [rad]
    goal: tuple[float, ...] = (1.4, 0.2, -0.6, 0.3, 0.0, 0.0, 0.0)

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.arm)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start, "start"), (q1, self.goal, "goal")]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [(self.arm.lower, q, self.arm.upper, "joint limits")]
