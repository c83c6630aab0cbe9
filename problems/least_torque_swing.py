"""Least torque: a swing of the arm in gravity with little effort, within limits of speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
from swing import hanging_arm

import geodesic_ocp as go


@dataclass(frozen=True)
class LeastTorqueSwing(go.MotionProblem):
    """From hanging at rest to a raised forearm at rest, int |tau|^2 dt least, gravity included."""

    arm: go.Model = field(default_factory=hanging_arm)
    duration: float = 1.2  # [s]
    goal: tuple[float, float] = (1.0, 0.8)  # [rad]
    speed: float = 4.0  # [rad/s]
    payload: float = 0.5  # [kg]

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.arm)

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
        return [(q0, 0.0, "start"), (q1, self.goal, "goal"), (v0, 0.0), (v1, 0.0)]

    def torque(self, q: ca.SX, v: ca.SX, a: ca.SX) -> Any:
        return self.arm.with_payload(self.payload).inverse_dynamics(q, v, a)

    def cost(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Any:
        return ca.dot(torque, torque)

    def constraints(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Sequence[Any]:
        return [(-self.speed, v, self.speed, "speed")]
