"""Two uniform links that rotate by pi: three geodesics join these configurations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes

import geodesic_ocp as go


def two_rods(length: float = 1.0, mass: float = 1.0) -> go.Model:
    """Two uniform rods [m], [kg] in a plane, rotating about z."""
    model = pin.Model()
    model.name = "two rods"
    moment = mass * length**2 / 12.0
    rod = pin.Inertia(mass, np.array([length / 2.0, 0.0, 0.0]), np.diag([1e-6, moment, moment]))
    end = pin.SE3(np.eye(3), np.array([length, 0.0, 0.0]))
    joint = 0
    for name, placement in (("shoulder", pin.SE3.Identity()), ("elbow", end)):
        joint = model.addJoint(joint, pin.JointModelRZ(), placement, name)
        model.appendBodyToJoint(joint, rod, pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", joint, end, pin.FrameType.OP_FRAME))
    return go.Model(model, "tip")


START = (-np.pi / 4.0, -np.pi / 4.0)  # [rad]
GOAL = (3.0 * np.pi / 4.0, 3.0 * np.pi / 4.0)
# Initial velocities and Morse indices of the other two, as go.geodesics(metric, START, GOAL) finds
# them.
OTHERS = (
    ((5.673378751735185, -12.124980959788726), 0),
    ((5.679886847074039, -11.795839761875387), 1),
)


@dataclass(frozen=True)
class TwoLinkChallenge(go.Problem):
    """The shortest of the three; `go.geodesics` finds all, and which are locally minimizing."""

    arm: go.Model = field(default_factory=two_rods)
    start: tuple[float, float] = START
    goal: tuple[float, float] = GOAL

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.arm)

    @property
    def grid(self) -> go.Grid:
        return go.Grid(4, 24)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start, "start"), (q1, self.goal, "goal")]

    def draw(self, axes: Axes, path: go.Path, columns: tuple[int, int]) -> None:
        """The other two geodesics."""
        if (self.start, self.goal) != (START, GOAL):
            return
        for velocity, index in OTHERS:
            other = go.logarithm.geodesic_from_velocity(path.metric, START, velocity)
            name = f"length {other.length:.4f}, index {index}"
            style = "--" if index == 0 else ":"
            axes.plot(*other(np.linspace(0.0, 1.0, 201)).T, style, color="#e07b00", label=name)
