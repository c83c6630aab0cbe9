"""Swing: a relaxed arm falls and rises in gravity, a geodesic of the Jacobi metric."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

import geodesic_ocp as go

GRAVITY = 9.81  # [m/s^2]


def hanging_arm(lengths: tuple[float, float] = (0.33, 0.44), mass: float = 3.4) -> go.Model:
    """An upper arm and a forearm with hand, lengths in m; the mass [kg] is proportional to length.

    The joints rotate about x, in the plane of y (forward) and z (up); at zero the arm hangs down.
    """
    model = pin.Model()
    model.name = "hanging arm"
    joint, placement = 0, pin.SE3.Identity()
    for name, length in zip(("shoulder", "elbow"), lengths, strict=True):
        joint = model.addJoint(joint, pin.JointModelRX(), placement, name)
        rod_mass = mass * length / sum(lengths)
        moment = rod_mass * length**2 / 12.0
        rod = pin.Inertia(
            rod_mass, np.array([0.0, 0.0, -length / 2.0]), np.diag([moment, moment, 1e-4])
        )
        model.appendBodyToJoint(joint, rod, pin.SE3.Identity())
        placement = pin.SE3(np.eye(3), np.array([0.0, 0.0, -length]))
    model.gravity = pin.Motion(np.array([0.0, 0.0, -GRAVITY]), np.zeros(3))
    model.addFrame(pin.Frame("hand", joint, placement, pin.FrameType.OP_FRAME))
    return go.Model(model, "hand")


@dataclass(frozen=True)
class Swing(go.Problem):
    """From behind the body to the front, at the speed given by conservation of energy.

    The elbow flexes passively and swings out. With much less energy, or beyond the first conjugate
    point, the swing is not locally minimizing and is not found from the straight line.
    """

    arm: go.Model = field(default_factory=hanging_arm)
    start: tuple[float, float] = (-0.9, 0.9)  # [rad]
    goal: tuple[float, float] = (0.2, 0.3)
    speed: float = 2.5  # |q'(t)| at the start, in the norm of the kinetic energy metric

    @property
    def metric(self) -> go.Metric:
        return go.manifold.JacobiMetric(
            self.arm, self.speed**2 / 2.0 + self.arm.potential_energy(self.start)
        )

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start, "start"), (q1, self.goal, "goal")]
