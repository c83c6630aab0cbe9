"""Via point: the hand passes a mark on its way; configuration and time there are optimal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca

import geodesic_ocp as go


@dataclass(frozen=True)
class ViaPoint(go.Problem):
    """From a configuration past a mark to a point, within the joint limits.

    The path of least energy has a corner at the mark, where elbow and wrist change their velocities
    instantly, at one speed. `continuous_velocity_at_via` rounds it within the pieces of the path
    beside the mark: the speed swings there, the more narrowly the finer the grid.
    """

    arm: go.Model = field(default_factory=go.human_arm)
    start: tuple[float, ...] = (0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1)  # [rad]
    mark: tuple[float, float, float] = (0.30, 0.30, -0.20)  # [m], from the shoulder
    target: tuple[float, float, float] = (0.10, 0.45, -0.05)  # [m]
    continuous_velocity_at_via: bool = False

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.arm)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start, "start"), (self.arm.hand_pose(q1)[1], self.target, "hand")]

    def via(self, q: ca.SX) -> Sequence[Sequence[Any]]:
        return [[(self.arm.hand_pose(q)[1], self.mark, "mark")]]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [(self.arm.lower, q, self.arm.upper, "joint limits")]
