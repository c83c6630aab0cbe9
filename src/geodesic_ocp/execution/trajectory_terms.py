"""Terms of one arm in the program of a trajectory, and bounds of its variables.

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
from geodesic_ocp.blocks import Block, Terms
from geodesic_ocp.cells import Indices
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.reference import INSIDE, Course, Reference
from geodesic_ocp.ocp.pose_search import rotation_log


@dataclass(frozen=True)
class TrajectorySettings:
    """Terms of a trajectory's program: limits, boundary conditions, distance from the paths.

    Attributes:
        rest: whether it begins and ends at rest.
        tolerance: tolerance of the hand's pose at the ends of paths [m], [rad]; None: the
            configuration is met exactly.
        deviation_weight: deviation weight of the squared distance from the paths, relative to the
            default.
    """

    rest: bool = True
    tolerance: tuple[float, float] | None = None
    deviation_weight: float = 1.0


_TOUCHES = 1e-5  # of a position limit [rad or m]
_OUTSIDE = 5e-7  # [rad or m]; lets a path touch its position limits


def position_bounds(course: Course) -> tuple[Array, Array]:
    """Return ranges of the joints (n,), just outside the limits, and beyond the ends of paths."""
    robot, ends = course.arm.robot, course.arm.ends
    lower = np.minimum(robot.lower, ends.min(axis=0)) - _OUTSIDE
    upper = np.maximum(robot.upper, ends.max(axis=0)) + _OUTSIDE
    return lower, upper


def variable_bounds(course: Course, settings: TrajectorySettings) -> tuple[Array, Array]:
    """Return bounds of positions, scaled velocities and accelerations, (knots, 3, n)."""
    arm = course.arm
    upper = np.full((course.knots.count + 1, 3, arm.robot.dof), np.inf)
    for part, limit in ((1, arm.limits.velocity), (2, arm.limits.acceleration)):
        upper[:, part] = np.where(np.isfinite(limit), 1.0 - INSIDE, np.inf)
    lower = -upper
    lower[:, 0], upper[:, 0] = position_bounds(course)
    still = course.knots_at_rest
    if settings.rest:
        still[[0, -1]] = True
    lower[still, 1:] = upper[still, 1:] = 0.0
    if settings.tolerance is None:
        given = course.resting[course.path_of]
        given[course.at] = True
        lower[given, 0] = upper[given, 0] = arm.ends[course.path_of[given]]
        lower[-1, 0] = upper[-1, 0] = arm.ends[-1]
        # At a limit a joint can only turn back.
        room = np.minimum(arm.ends - arm.robot.lower, arm.robot.upper - arm.ends)
        edge, joint = np.nonzero(room < _TOUCHES)
        lower[course.at[edge], 1, joint] = upper[course.at[edge], 1, joint] = 0.0
    return lower, upper


_UNLIMITED = np.array([[1.0], [1.0], [10.0], [1.0]])  # units of joints without limits
# Weights of squared accelerations, one at the limit, and of squared differences from the intended
# speeds at the ends, relative to the limits.
_SMOOTH, _END_SPEED = 2e-3, 0.1


@dataclass(frozen=True, eq=False)
class ArmTerms:
    """Terms of one arm, whose variables are (knots, 3, n).

    Attributes:
        course: its paths over the knots.
        first: index of its first variable.
    """

    course: Course
    first: int

    @property
    def arm(self) -> ArmPaths:
        """The arm with its limits."""
        return self.course.arm

    @property
    def dof(self) -> int:
        """Number n of joints."""
        return self.arm.robot.dof

    @cached_property
    def units(self) -> Array:
        """Scales of positions, velocities, accelerations, jerks (4, n): the limits, if any."""
        limits = self.arm.limits
        found = np.array([np.ones(self.dof), limits.velocity, limits.acceleration, limits.jerk])
        return np.where(np.isfinite(found), found, _UNLIMITED)

    def indices(self, knots: Indices, parts: int = 3) -> Indices:
        """Return indices of the position, or also its derivatives, at knots: (k, parts n)."""
        n = self.dof
        return np.asarray(self.first + 3 * n * knots[:, None] + np.arange(parts * n))

    def deviation(self, reference: Reference, shares: Array, weight: float) -> Block:
        """Return squared distances from points of the paths, and squared accelerations.

        Args:
            reference: the points.
            shares: shares of every knot in an integral over time (knots,).
            weight: weight of the distances.
        """
        n, count = self.dof, shares.size
        z, p = ca.SX.sym("z", 3 * n), ca.SX.sym("p", n + n * n + 1)
        q, _, a = ca.vertsplit(z, n)
        offset, matrix = q - p[:n], ca.reshape(p[n : n + n * n], n, n)
        objective = ca.dot(offset, matrix @ offset) + p[-1] * ca.sumsqr(a)
        matrices = weight * shares[:, None, None] * reference.weights(self.arm)
        smooth = _SMOOTH * shares[:, None]
        values = np.hstack([reference.positions, matrices.reshape(count, -1), smooth])
        return Block(Terms(z, p, objective), self.indices(np.arange(count)), values)

    def motion(self, steps: Array, exact: bool) -> Block:
        """Return the two equations of motion of every joint in every piece, and the cost of the
        jerk.

        Args:
            steps: weights of the squared changes of the accelerations (pieces,).
            exact: whether the positions are given where the arm rests.
        """
        n, knots = self.dof, self.course.knots
        z, p = ca.SX.sym("z", 6 * n + 1), ca.SX.sym("p", 2)
        q0, v0, a0, q1, v1, a1 = ca.vertsplit(z[:-1], n)
        h, (_, speed, growth, _) = p[0] * z[-1], self.units
        mean = speed * v0 + h * growth * (2 * a0 + a1) / 6
        equations = ca.vertcat(v0 + h * growth / speed * (a0 + a1) / 2 - v1, q0 + h * mean - q1)
        piece = np.arange(knots.count)
        columns = [self.indices(piece), self.indices(piece + 1), knots.interval[:, None]]
        upper = np.zeros((knots.count, 2 * n))
        # Fixed variables meet the equations of a rest; without these, the others are independent.
        upper[self.course.pieces_at_rest, : 2 * n if exact else n] = np.inf
        values = np.stack([knots.fraction, steps], axis=1)
        objective = p[1] * ca.sumsqr(a1 - a0)
        return Block(Terms(z, p, objective, equations), np.hstack(columns), values, -upper, upper)

    def between_knots(self, kind: str, pairs: Indices) -> Block:
        """Return a limit between the knots, of one joint in one piece each.

        Args:
            kind: "jerk"; "velocity", the Bezier coefficient in the middle; "position", the two.
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
        (piece, joint), knots = pairs.T, self.course.knots
        first = self.first + 3 * self.dof * piece + joint
        offsets = self.dof * np.arange(6)  # the states of a knot are followed by the next one's
        columns = np.hstack([first[:, None] + offsets, knots.interval[piece][:, None]])
        values = np.column_stack([knots.fraction[piece], *self.units[1:, joint]])
        upper = np.full((len(pairs), 1), 1.0 - INSIDE)
        lower = -upper
        if kind == "position":
            low, high = position_bounds(self.course)
            lower, upper = (np.repeat(side[joint, None], 2, axis=1) for side in (low, high))
        return Block(Terms(z, p, 0.0, rows[kind]), columns, values, lower, upper)

    def torques(self, knots: Indices, shares: Array) -> Block:
        """Return torques at some of the knots (k,), within shares (k, n) of their limits."""
        z, arm = ca.SX.sym("z", 3 * self.dof), self.arm
        q, v, a = ca.vertsplit(z, self.dof)
        _, speed, growth, _ = self.units
        force = arm.robot.inverse_dynamics(q, v * speed, a * growth, ca.SX(arm.gravity))
        limited = np.flatnonzero(np.isfinite(arm.limits.torque))
        used = force[limited.tolist()] / arm.limits.torque[limited]
        upper = shares[:, limited]
        return Block(Terms(z, constraints=used), self.indices(knots), None, -upper, upper)

    def hand_poses(self, tolerance: tuple[float, float]) -> Block:
        """Return errors of the hand's position [m] and rotation vector [rad] at the ends of the
        paths.

        Each is within a box inside the ball of its tolerance: the box's sides are linear.
        """
        q, p = ca.SX.sym("q", self.dof), ca.SX.sym("p", 12)
        rotation, position = self.arm.robot.hand_pose(q)
        turned = rotation_log(ca.reshape(p[:9], 3, 3).T @ rotation)
        errors = ca.vertcat(position - p[9:], turned)
        rotations, positions = self.arm.robot.hand_pose(self.arm.ends)
        columns = rotations.transpose(0, 2, 1).reshape(len(rotations), 9)
        box = np.repeat(tolerance, 3) * (1.0 - INSIDE) / np.sqrt(3.0)
        upper = np.tile(box, (len(rotations), 1))
        values, indices = np.hstack([columns, positions]), self.indices(self.course.at, 1)
        return Block(Terms(q, p, 0.0, errors), indices, values, -upper, upper)

    def end_speeds(self) -> Block:
        """Return squared differences of the velocities at both ends from the person's progress."""
        n, arm, durations = self.dof, self.arm, np.diff(self.arm.edges)
        v, p = ca.SX.sym("v", n), ca.SX.sym("p", n)
        first, last = arm.paths[0](0.0, 1) / durations[0], arm.paths[-1](1.0, 1) / durations[-1]
        objective = _END_SPEED * ca.sumsqr(v - p)
        knots = np.array([0, self.course.knots.count])
        intended = np.clip(np.array([first, last]) / self.units[1], -0.9, 0.9)
        return Block(Terms(v, p, objective), self.indices(knots, 2)[:, n:], intended)
