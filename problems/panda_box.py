"""Panda and a box: the robot's hand moves around a box of balls to the other side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

import geodesic_ocp as go


def panda() -> go.Model:
    """The robot with capsules around its meshes; needs `pip install example-robot-data`."""
    return go.load_model("panda")


@dataclass(frozen=True)
class PandaBox(go.Problem):
    """From a configuration on one side of the box to a point on the other, within joint limits."""

    robot: go.Model = field(default_factory=panda)
    start: tuple[float, ...] = (-0.8, 0.6, 0.0, -1.8, 0.0, 2.4, 0.8)  # [rad]
    target: tuple[float, float, float] = (0.40, 0.40, 0.25)  # [m], from the robot's base
    centre: tuple[float, float, float] = (0.50, 0.0, 0.20)  # [m], of the box
    counts: tuple[int, int, int] = (2, 2, 2)  # of balls along x, y and z
    radius: float = 0.1  # [m] of a ball
    margin: float = 0.01  # [m]
    links: tuple[str, ...] = ("panda_link5", "panda_link6", "panda_hand")

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.robot)

    @property
    def obstacles(self) -> Sequence[go.Ball]:
        steps = [
            1.5 * self.radius * (np.arange(count) - (count - 1) / 2.0) for count in self.counts
        ]
        centres = np.array(np.meshgrid(*steps)).reshape(3, -1).T + self.centre
        return [
            go.Ball(tuple(centre), self.radius, name=f"ball {k}")
            for k, centre in enumerate(centres)
        ]

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start, "start"), (self.robot.hand_pose(q1)[1], self.target, "hand")]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [
            (self.robot.lower, q, self.robot.upper, "joint limits"),
            *go.distances.clearance_constraints(
                self.robot, q, self.obstacles, links=self.links, margin=self.margin
            ),
        ]

    def guess(self, s: np.ndarray) -> np.ndarray:
        """The straight line to a configuration at the target, with the elbow raised on the way."""
        start = np.array(self.start)
        goal = go.ocp.inverse_kinematics(self.robot, start * [-1, 1, 1, 1, 1, 1, 1], self.target)
        return (
            start
            + s[:, None] * (goal - start)
            - np.outer(np.sin(np.pi * s), [0, 0.6, 0, 0.4, 0, 0, 0])
        )
