"""Two links with all mass at the tip: a curve in joint space, a straight line in the plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

import geodesic_ocp as go


def tip_mass_arm(lengths: tuple[float, float] = (1.0, 0.8), mass: float = 2.0) -> go.Model:
    """Two massless links, lengths in m, that rotate about z, and a mass [kg] at the tip."""
    model = pin.Model()
    model.name = "tip-mass arm"
    elbow = pin.SE3(np.eye(3), np.array([lengths[0], 0.0, 0.0]))
    tip = pin.SE3(np.eye(3), np.array([lengths[1], 0.0, 0.0]))
    first = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "shoulder")
    second = model.addJoint(first, pin.JointModelRZ(), elbow, "elbow")
    model.appendBodyToJoint(second, pin.Inertia(mass, np.zeros(3), np.zeros((3, 3))), tip)
    model.addFrame(pin.Frame("tip", second, tip, pin.FrameType.OP_FRAME))
    return go.Model(model, "tip")


@dataclass(frozen=True)
class TipMass(go.Problem):
    """From one configuration to another, elbow on the same side; the tip moves as a free mass."""

    arm: go.Model = field(default_factory=tip_mass_arm)
    start: tuple[float, float] = (0.2, 1.2)  # [rad]
    goal: tuple[float, float] = (1.1, 0.6)

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.arm)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start, "start"), (q1, self.goal, "goal")]

    @property
    def exact_length(self) -> float:
        tips = self.arm.hand_pose([self.start, self.goal])[1]
        return float(np.sqrt(self.arm.mass) * np.linalg.norm(tips[1] - tips[0]))

    def exact(self, s: np.ndarray) -> np.ndarray:
        """Inverse kinematics of the straight line, by the law of cosines."""
        tips = self.arm.hand_pose([self.start, self.goal])[1][:, :2]
        x, y = (np.outer(1.0 - s, tips[0]) + np.outer(s, tips[1])).T
        a = float(self.arm.pin.jointPlacements[2].translation[0])
        tip = self.arm.pin.frames[self.arm.pin.getFrameId(self.arm.hand)]
        b = float(tip.placement.translation[0])
        elbow = np.arccos((x**2 + y**2 - a**2 - b**2) / (2.0 * a * b))
        shoulder = np.arctan2(y, x) - np.arctan2(b * np.sin(elbow), a + b * np.cos(elbow))
        return np.column_stack([shoulder, elbow])
