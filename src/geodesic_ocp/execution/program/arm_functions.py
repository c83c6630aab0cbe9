"""The terms of one arm in the program of a trajectory, as symbolic blocks.

Variables of a knot: position q, velocity and acceleration relative to their limits. Between two
knots a duration h apart the jerk is constant, so that

    v1 = v0 + h (a0 + a1) / 2,    q1 = q0 + h v0 + h^2 (2 a0 + a1) / 6.

Position and velocity are polynomials between their Bezier coefficients, which are kept within the
limits: q0, q0 + h v0 / 3, q1 - h v1 / 3, q1, and v0, v0 + h a0 / 2, v1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.program.blocks import Block, Indices
from geodesic_ocp.ocp.ik.pose_error import rotation_log

# Units of joints without limits [rad/s, rad/s^2].
_SPEED, _ACCELERATION = 1.0, 10.0


@dataclass(frozen=True, eq=False)
class ArmFunctions:
    """Blocks of one arm; x of an arm is (knots, 3, n).

    Attributes:
        arm: with its limits.
        first: index in x of its first variable.
    """

    arm: ArmPaths
    first: int

    @property
    def dof(self) -> int:
        """Number n of joints."""
        return self.arm.robot.dof

    @cached_property
    def speed_unit(self) -> Array:
        """Units (n,) of the velocities."""
        limit = self.arm.limits.velocity
        return np.where(np.isfinite(limit), limit, _SPEED)

    @cached_property
    def acceleration_unit(self) -> Array:
        """Units (n,) of the accelerations."""
        limit = self.arm.limits.acceleration
        return np.where(np.isfinite(limit), limit, _ACCELERATION)

    def indices(self, knots: Indices, parts: int = 3) -> Indices:
        """Of the position, or also velocity and acceleration, at knots (k,): (k, parts n)."""
        n = self.dof
        return np.asarray(self.first + 3 * n * knots[:, None] + np.arange(parts * n))

    @cached_property
    def limited_torques(self) -> np.ndarray:
        """Joints whose torques are limited."""
        return np.flatnonzero(np.isfinite(self.arm.limits.torque))

    def at_knots(self, count: int) -> Block:
        """Distance from the paths and acceleration.

        Parameters: point of the path, matrix of the distance, weight of the acceleration.
        """
        n = self.dof
        z, p = ca.SX.sym("z", 3 * n), ca.SX.sym("p", n + n * n + 1)
        q, _, a = ca.vertsplit(z, n)
        offset, matrix = q - p[:n], ca.reshape(p[n : n + n * n], n, n)
        objective = ca.dot(offset, matrix @ offset) + p[-1] * ca.sumsqr(a)
        return Block(z, p, objective, ca.SX(0, 1), self.indices(np.arange(count)))

    def torques(self, knots: Indices) -> Block:
        """Torques relative to their limits at some of the knots."""
        z, arm, limited = ca.SX.sym("z", 3 * self.dof), self.arm, self.limited_torques
        q, v, a = ca.vertsplit(z, self.dof)
        speed, acceleration = v * self.speed_unit, a * self.acceleration_unit
        force = arm.robot.inverse_dynamics(q, speed, acceleration, ca.SX(arm.gravity))
        shares = force[limited.tolist()] / arm.limits.torque[limited]
        return Block(z, ca.SX(0, 1), ca.SX(0), shares, self.indices(knots))

    def motion(self, interval: Indices) -> Block:
        """The two equations of motion of every joint in every piece, and the cost of the jerk.

        Parameters: duration as a fraction of the interval's, weight of the jerk.

        Args:
            interval: number of the interval of every piece.
        """
        n = self.dof
        z, p = ca.SX.sym("z", 6 * n + 1), ca.SX.sym("p", 2)
        q0, v0, a0, q1, v1, a1 = ca.vertsplit(z[:-1], n)
        h, ratio = p[0] * z[-1], self.acceleration_unit / self.speed_unit
        growth = self.speed_unit * v0 + h * self.acceleration_unit * (2 * a0 + a1) / 6
        equations = ca.vertcat(v0 + h * ratio * (a0 + a1) / 2 - v1, q0 + h * growth - q1)
        knots = np.arange(interval.size)
        columns = [self.indices(knots), self.indices(knots + 1), interval[:, None]]
        return Block(z, p, p[1] * ca.sumsqr(a1 - a0), equations, np.hstack(columns))

    def between_knots(self, interval: Indices, kind: str, pairs: Indices) -> Block:
        """A limit between the knots, of one joint in one piece each.

        "jerk": relative to its limit; "velocity": the Bezier coefficient in the middle, relative to
        its limit; "position": the two in between. Parameters: see `units_between_knots`.

        Args:
            interval: number of the interval of every piece.
            kind: of limit.
            pairs: (k, 2), numbers of the piece and of the joint.
        """
        z, p = ca.SX.sym("z", 7), ca.SX.sym("p", 4)
        q0, v0, a0, q1, v1, a1, duration = ca.vertsplit(z)
        fraction, speed, growth, jerk = ca.vertsplit(p)
        h = fraction * duration
        rows = {
            "jerk": (a1 - a0) * growth / (h * jerk),
            "velocity": v0 + h * growth * a0 / (2 * speed),
            "position": ca.vertcat(q0 + h * speed * v0 / 3, q1 - h * speed * v1 / 3),
        }
        piece, joint = pairs.T
        first = self.first + 3 * self.dof * piece + joint
        offsets = self.dof * np.arange(6)  # the states of a knot are followed by the next one's
        columns = np.hstack([first[:, None] + offsets, interval[piece][:, None]])
        return Block(z, p, ca.SX(0), rows[kind], columns)

    def units_between_knots(self, fraction: Array, pairs: Indices) -> Array:
        """Parameters of `between_knots`: duration of the piece as a fraction, and units, (k, 4)."""
        piece, joint = pairs.T
        jerk = self.arm.limits.jerk
        units = (self.speed_unit, self.acceleration_unit, np.where(np.isfinite(jerk), jerk, 1.0))
        return np.stack([fraction[piece], *(unit[joint] for unit in units)], axis=1)

    def hand_poses(self, knots: Indices) -> Block:
        """Errors of the hand's position [m] and orientation, as a rotation vector [rad].

        Parameters: the intended rotation, columns first, and position.
        """
        q, p = ca.SX.sym("q", self.dof), ca.SX.sym("p", 12)
        rotation, position = self.arm.robot.hand_pose(q)
        turned = rotation_log(ca.reshape(p[:9], 3, 3).T @ rotation)
        errors = ca.vertcat(position - p[9:], turned)
        return Block(q, p, ca.SX(0), errors, self.indices(knots, 1))

    def end_speeds(self, knots: Indices) -> Block:
        """Squared difference of velocities from given ones; parameters: those, and a weight."""
        n = self.dof
        v, p = ca.SX.sym("v", n), ca.SX.sym("p", n + 1)
        objective = p[-1] * ca.sumsqr(v - p[:n])
        return Block(v, p, objective, ca.SX(0, 1), self.indices(knots, 2)[:, n:])
