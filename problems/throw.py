"""Throw: the parabola of a free mass in gravity is a geodesic of the Jacobi metric."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

import geodesic_ocp as go

GRAVITY = 9.81  # [m/s^2]


def free_mass(mass: float = 0.5) -> go.Model:
    """A mass [kg] that slides along x and z."""
    model = pin.Model()
    model.name = "free mass"
    across = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "across")
    up = model.addJoint(across, pin.JointModelPZ(), pin.SE3.Identity(), "up")
    ball = pin.Inertia(mass, np.zeros(3), 1e-3 * np.eye(3))
    model.appendBodyToJoint(up, ball, pin.SE3.Identity())
    model.gravity = pin.Motion(np.array([0.0, 0.0, -GRAVITY]), np.zeros(3))
    model.addFrame(pin.Frame("ball", up, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return go.Model(model, "ball")


@dataclass(frozen=True)
class Throw(go.Problem):
    """From the hand to a basket, each given as (x, z) [m], with constant total energy.

    Of the two parabolas the flatter one, which is found from the straight line.
    """

    ball: go.Model = field(default_factory=free_mass)
    start: tuple[float, float] = (0.0, 1.8)
    goal: tuple[float, float] = (4.0, 3.0)
    speed: float = 12.0  # [m/s] at the start

    @property
    def metric(self) -> go.Metric:
        kinetic = self.ball.mass * self.speed**2 / 2.0
        return go.manifold.JacobiMetric(self.ball, kinetic + self.ball.potential_energy(self.start))

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Any]:
        return [(q0, self.start, "hand"), (q1, self.goal, "basket")]

    def exact(self, s: np.ndarray) -> np.ndarray:
        """The parabola x t, z(x), at equal steps of the Jacobi length sqrt(2) int (E - V) dt."""
        x, z = np.subtract(self.goal, self.start)
        # z = x tan a - g x^2 (1 + tan^2 a) / (2 v^2), the smaller tan a.
        drop = GRAVITY * x**2 / (2.0 * self.speed**2)
        tangent = (x - np.sqrt(x**2 - 4.0 * drop * (drop + z))) / (2.0 * drop)
        across = self.speed / np.sqrt(1.0 + tangent**2)
        up, duration = across * tangent, x / across

        def squared_speed(t: np.ndarray) -> np.ndarray:
            """The integral of |v|^2 over time up to t, proportional to the Jacobi length."""
            return self.speed**2 * t - up * GRAVITY * t**2 + GRAVITY**2 * t**3 / 3.0

        t = s * duration
        for _ in range(50):  # Newton's method
            v = across**2 + (up - GRAVITY * t) ** 2
            t = t - (squared_speed(t) - s * squared_speed(np.array(duration))) / v
        return np.asarray(self.start) + np.column_stack([across * t, up * t - GRAVITY * t**2 / 2.0])
