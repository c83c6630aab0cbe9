"""Both arms at once: one system of fourteen joints, whose hands meet in front of the chest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from matplotlib.axes import Axes

import geodesic_ocp as go

SHOULDERS = ((-0.2, 0.0, 0.0), (0.2, 0.0, 0.0))  # [m] from the base of the neck


def both_arms() -> go.Model:
    """Both arms of a person; the hand (end-effector) is the left one."""
    return go.model.combine(go.human_arm("left"), go.human_arm("right"), placements=SHOULDERS)


@dataclass(frozen=True)
class BothArms(go.Problem):
    """From a configuration to one with the hands at a given offset; their position is free."""

    arms: go.Model = field(default_factory=both_arms)
    left: tuple[float, ...] = (0.3, -0.1, 0.4, 0.9, 0.1, 0.0, 0.1)  # [rad]
    right: tuple[float, ...] = (0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1)
    height: float = -0.1  # [m] of both hands, from the shoulders
    offset: tuple[float, float, float] = (0.1, 0.0, 0.0)  # [m] from the left hand to the right

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.arms)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        _, left = self.arms.hand_pose(q1)
        _, right = self.arms.with_hand("human right arm/hand").hand_pose(q1)
        return [
            (q0, (*self.left, *self.right), "start"),
            (right - left, self.offset, "hands"),
            (left[2], self.height, "height"),
        ]

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Any]:
        return [(self.arms.lower, q, self.arms.upper, "joint limits")]

    def draw(self, axes: Axes, path: go.Path, columns: tuple[int, int]) -> None:
        """The path of the right hand, beside that of the left."""
        q = path(np.linspace(0.0, 1.0, 101))
        _, hand = self.arms.frame_pose("human right arm/hand", q)
        axes.plot(*hand[:, columns].T, color="#e07b00", linestyle="--", label="right hand")
