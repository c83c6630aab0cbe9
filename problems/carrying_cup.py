"""Carrying a cup: the hand moves to a point; its tilt on the way is bounded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

import geodesic_ocp as go


@dataclass(frozen=True)
class CarryingCup(go.Problem):
    """From a configuration with the cup upright to a point, within the joint limits."""

    arm: go.Model = field(default_factory=go.human_arm)
    start: tuple[float, ...] = (0.2, 0.1, -0.4, 1.3, 0.1, 0.0, 0.1)  # [rad]
    target: tuple[float, ...] = (0.20, 0.42, -0.05)  # [m], from the shoulder
    tilt: float = np.deg2rad(10.0)  # [rad]

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.arm)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start, "start"), (self.arm.hand_pose(q1)[1], self.target, "table")]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        upright = self.arm.hand_pose(self.start)[0].T @ [0.0, 0.0, 1.0]  # in the hand's frame
        rotation, _ = self.arm.hand_pose(q)
        cosine = ca.dot(rotation[2, :].T, ca.DM(upright))  # of the cup's tilt
        return [
            (self.arm.lower, q, self.arm.upper, "joint limits"),
            (np.cos(self.tilt), cosine, np.inf, "level"),
        ]
