"""Reach to a point: the hand's position is given, the final configuration is optimal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

import geodesic_ocp as go


@dataclass(frozen=True)
class ReachToPoint(go.Problem):
    """From a configuration to a point in front of the shoulder, within the joint limits."""

    model: go.Model = field(default_factory=go.human_arm)
    start: tuple[float, ...] = (0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1)  # [rad]
    target: tuple[float, ...] = (0.10, 0.45, -0.05)  # [m], from the shoulder

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.model)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start, "start"), (self.model.hand_pose(q1)[1], self.target, "hand")]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [(self.model.lower, q, self.model.upper, "joint limits")]
