"""Key poses: a Riemannian spline of the arm through positions of the hand, past an obstacle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

import geodesic_ocp as go


@dataclass(frozen=True)
class KeyPoses(go.MotionProblem):
    """From rest to rest, with the hand at given places at given times past a ball."""

    arm: go.Model = field(default_factory=go.human_arm)
    duration: float = 1.4  # [s]
    start: tuple[float, ...] = (0.3, 0.0, -0.2, 0.8, 0.0, 0.0, 0.0)  # [rad]
    places: tuple[tuple[float, ...], ...] = ((0.30, 0.35, 0.05), (0.35, 0.25, -0.10))  # [m]
    times: tuple[float, ...] = (0.6,)  # of all places but the last [s]
    obstacles: tuple[go.Ball, ...] = (go.Ball((0.16, 0.42, 0.0), 0.08, name="ball"),)
    margin: float = 0.02  # [m]

    @property
    def metric(self) -> go.Metric:
        inertia = go.manifold.default_joint_inertia(self.arm)
        return go.KineticEnergy(self.arm.with_armature(inertia))

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
        last = self.arm.hand_pose(q1)[1]
        return [(q0, self.start), (v0, 0.0), (v1, 0.0), (last, self.places[-1], "last place")]

    def via(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        hand = self.arm.hand_pose(q)[1]
        pairs = zip(self.times, self.places[:-1], strict=True)
        return [(at, [(hand, place)]) for at, place in pairs]

    def constraints(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Sequence[Any]:
        near = go.distances.clearance_constraints(
            self.arm, q, obstacles=self.obstacles, margin=self.margin
        )
        return [(self.arm.lower, q, self.arm.upper, "joint limits"), *near]

    def guess(self, t: np.ndarray) -> np.ndarray:
        return np.tile(self.start, (len(t), 1))
