"""Least time: a planar arm in gravity swings up as soon as its weak motors let it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from swing import hanging_arm

import geodesic_ocp as go


@dataclass(frozen=True)
class LeastTime(go.MotionProblem):
    """From hanging at rest to a raised arm at rest in the least time, within limits of torque."""

    arm: go.Model = field(default_factory=hanging_arm)
    duration: tuple[float, float] = (0.2, 4.0)  # shortest and longest [s]
    goal: tuple[float, float] = (1.6, 0.6)  # [rad]
    torque_limit: tuple[float, float] = (12.0, 5.0)  # [N m]

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.arm)

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
        return [(q0, 0.0, "start"), (q1, self.goal, "goal"), (v0, 0.0), (v1, 0.0)]

    def torque(self, q: ca.SX, v: ca.SX, a: ca.SX) -> Any:
        return self.arm.inverse_dynamics(q, v, a)

    def cost(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Any:
        return 1.0

    def constraints(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Sequence[Any]:
        limit = np.array(self.torque_limit)
        return [(-limit, torque, limit, "torque")]
