"""Bounds of the positions, velocities and accelerations of one arm at the knots."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.program.reference import Course
from geodesic_ocp.execution.program.settings import TrajectorySettings

INSIDE = 1e-5  # how far inside the limits a program stays, relative
_TOUCHES = 1e-5  # of a position limit [rad or m]
_OUTSIDE = 5e-7  # [rad or m]; lets a path touch its position limits


def position_bounds(course: Course) -> tuple[Array, Array]:
    """Of the joints (n,) [rad or m], just outside the limits, and beyond the ends of paths."""
    robot, ends = course.arm.robot, course.junctions
    lower = np.minimum(robot.lower, ends.min(axis=0)) - _OUTSIDE
    upper = np.maximum(robot.upper, ends.max(axis=0)) + _OUTSIDE
    return lower, upper


def variable_bounds(course: Course, settings: TrajectorySettings) -> tuple[Array, Array]:
    """Of positions, and of velocities and accelerations relative to their limits, (knots, 3, n)."""
    arm, exact = course.arm, settings.tolerance is None
    upper = np.full((course.knots.count + 1, 3, arm.robot.dof), np.inf)
    for part, limit in ((1, arm.limits.velocity), (2, arm.limits.acceleration)):
        upper[:, part] = np.where(np.isfinite(limit), 1.0 - INSIDE, np.inf)
    lower = -upper
    lower[:, 0], upper[:, 0] = position_bounds(course)
    still = course.knots_at_rest.copy()
    if settings.rest:
        still[[0, -1]] = True
    lower[still, 1:] = upper[still, 1:] = 0.0
    if exact:
        ends = course.junctions
        for rests, first, last, q in zip(
            course.resting, course.at[:-1], course.at[1:], ends, strict=False
        ):
            knots = slice(first, last + 1) if rests else first
            lower[knots, 0] = upper[knots, 0] = q
        lower[-1, 0] = upper[-1, 0] = ends[-1]
        # At a limit a joint can only turn back.
        touches = np.minimum(ends - arm.robot.lower, arm.robot.upper - ends) < _TOUCHES
        edge, joint = np.nonzero(touches)
        lower[course.at[edge], 1, joint] = upper[course.at[edge], 1, joint] = 0.0
    return lower, upper
