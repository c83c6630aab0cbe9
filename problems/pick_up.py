"""Pick up: the arm reaches for a weight and carries it, two phases with dynamics of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
from swing import hanging_arm

import geodesic_ocp as go


@dataclass(frozen=True)
class _Stretch(go.MotionProblem):
    """A motion of an arm, with what it carries, from rest to rest between places of the hand."""

    arm: go.Model
    start: tuple[float, float]  # [m], y and z of the hand
    end: tuple[float, float]
    price: float  # of a second, in squared torque [(N m)^2]
    duration: tuple[float, float] = (0.3, 3.0)  # shortest and longest [s]

    @property
    def metric(self) -> go.Metric:
        return go.KineticEnergy(self.arm)

    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Any]:
        first, last = (self.arm.hand_pose(q)[1][1:] for q in (q0, q1))
        return [(first, self.start, "start"), (last, self.end, "end"), (v0, 0.0), (v1, 0.0)]

    def torque(self, q: ca.SX, v: ca.SX, a: ca.SX) -> Any:
        return self.arm.inverse_dynamics(q, v, a)

    def cost(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Any:
        return self.price + ca.dot(torque, torque)

    def constraints(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Sequence[Any]:
        return [(0.1, q[1], 2.6, "elbow")]  # [rad]


@dataclass(frozen=True)
class PickUp(go.ocp.MotionPhases):
    """From a hanging arm to a weight on a table, and with it onto a shelf, in the best times."""

    arm: go.Model = field(default_factory=hanging_arm)
    table: tuple[float, float] = (0.45, -0.35)  # y and z [m], from the shoulder
    shelf: tuple[float, float] = (0.5, 0.1)
    weight: float = 1.5  # [kg]
    price: float = 60.0  # of a second, in squared torque [(N m)^2]

    @property
    def phases(self) -> Sequence[go.MotionProblem]:
        hanging = (0.1, -0.75)
        reach = _Stretch(self.arm, hanging, self.table, self.price)
        loaded = self.arm.with_payload(self.weight)
        carry = replace(reach, arm=loaded, start=self.table, end=self.shelf)
        return reach, carry
