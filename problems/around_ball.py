"""Around a ball: the hand moves to a point behind a lamp; no part of the arm touches the lamp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

import geodesic_ocp as go


@dataclass(frozen=True)
class AroundBall(go.Problem):
    """From a configuration to a point, within the joint limits and past a ball."""

    arm: go.Model = field(default_factory=go.human_arm)
    start: tuple[float, ...] = (0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1)  # [rad]
    target: tuple[float, float, float] = (0.10, 0.45, 0.10)  # [m], from the shoulder
    centre: tuple[float, float, float] = (0.20, 0.35, -0.15)  # [m]
    radius: float = 0.06  # [m]
    margin: float = 0.01  # [m]

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.arm)

    @property
    def obstacles(self) -> Sequence[go.Ball]:
        return [go.Ball(self.centre, self.radius, name="lamp")]

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start, "start"), (self.arm.hand_pose(q1)[1], self.target, "hand")]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [
            (self.arm.lower, q, self.arm.upper, "joint limits"),
            *go.distances.clearance_constraints(self.arm, q, self.obstacles, margin=self.margin),
        ]
