"""A cup in motion: the Riemannian cubic of an arm that keeps a cup nearly upright."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

import geodesic_ocp as go


@dataclass(frozen=True)
class LevelCubic(go.MotionProblem):
    """From rest to rest: the hand moves to a point; the tilt of the cup on the way is bounded."""

    arm: go.Model = field(default_factory=go.human_arm)
    duration: float = 1.0  # [s]
    start: tuple[float, ...] = (0.2, 0.1, -0.4, 1.3, 0.1, 0.0, 0.1)  # [rad]
    target: tuple[float, ...] = (0.20, 0.42, -0.05)  # [m], from the shoulder
    tilt: float = np.deg2rad(10.0)  # [rad]

    @property
    def metric(self) -> go.Metric:
        inertia = go.manifold.default_joint_inertia(self.arm)
        return go.KineticEnergy(self.arm.with_armature(inertia))

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
        hand = self.arm.hand_pose(q1)[1]
        return [(q0, self.start), (hand, self.target, "table"), (v0, 0.0), (v1, 0.0)]

    def constraints(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Sequence[Any]:
        upright = self.arm.hand_pose(self.start)[0].T @ [0.0, 0.0, 1.0]  # in the hand's frame
        cosine = ca.dot(self.arm.hand_pose(q)[0][2, :].T, ca.DM(upright))
        return [
            (self.arm.lower, q, self.arm.upper, "joint limits"),
            (np.cos(self.tilt), cosine, np.inf, "level"),
        ]
