"""Poses that a robot's hand is to have, and configurations that have them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_vector
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.model.geometry.signed_distances import signed_distances
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.ik.inverse_kinematics import Clear, inverse_kinematics_solutions
from geodesic_ocp.ocp.ik.nearest import nearest_configuration
from geodesic_ocp.ocp.ik.pose_error import pose_miss

Formulation = Literal["constrained", "geodesic"]
# Conditions hold to this between the nodes, and limits are narrowed by twice as much.
TOLERANCE = 1e-6
REACHED = 1e-6  # [m] and [rad]
_SEVERAL = 8  # configurations of inverse kinematics
_SAME = 1e-3  # [rad or m]
_CLOSE = 1e-3  # [m] and [rad]


@dataclass(frozen=True, eq=False)
class Pose:
    """Where the hand is to be.

    Attributes:
        rotation: (3, 3), or None where it is left free.
        position: (3,) [m], or None.
    """

    rotation: Array | None
    position: Array | None

    def of(self, model: Model, q: Array) -> Pose:
        """The pose of the hand at q, as far as this one asks for it."""
        rotation, position = model.hand_pose(q)
        return Pose(
            None if self.rotation is None else rotation,
            None if self.position is None else position,
        )

    def miss(self, model: Model, q: Array) -> tuple[float, float]:
        """Distance [m] and angle [rad] from the hand at q; zero for what is left free."""
        rotation, position = model.hand_pose(q)
        away, angle = pose_miss(
            rotation,
            position,
            rotation if self.rotation is None else self.rotation,
            position if self.position is None else self.position,
        )
        return away, angle


@dataclass(frozen=True, eq=False)
class Goal:
    """A pose, and what inverse kinematics found of it.

    Attributes:
        pose: that is asked for.
        configuration: with that pose, or with the nearest (n,).
        missed: distance [m] and angle [rad] of the hand from the pose there.
    """

    pose: Pose
    configuration: Array
    missed: tuple[float, float]

    @property
    def within_reach(self) -> bool:
        """Whether the configuration has the pose."""
        return max(self.missed) <= REACHED


@dataclass(frozen=True)
class Conditions:
    """What holds for all synergies of a robot; see `retarget`."""

    formulation: Formulation
    limits: bool
    speed_limits: bool
    clear: Clear
    weights: tuple[float, float]
    energy_weight: float
    num_starts: int


@lru_cache(maxsize=16)
def narrowed(robot: Model) -> Model:
    """The robot with limits a little within its own: what is missed by the tolerance is not."""
    gap = np.minimum(2.0 * TOLERANCE, (robot.upper - robot.lower) / 4.0)
    return robot.with_limits(robot.lower + gap, robot.upper - gap)


def first_configuration(
    robot: Model, pose: Pose, conditions: Conditions, given: ArrayLike | None
) -> Array:
    """Configuration (n,) to begin in: one that is given, or that has the pose and is near mid-range.

    Raises:
        ValueError: the one that is given is outside the limits, or too near to a body.
        NotConverged: no configuration is clear of the bodies.
    """
    arm, clear = narrowed(robot) if conditions.limits else robot, conditions.clear
    if given is None:
        middle = np.where(np.isfinite(arm.upper - arm.lower), (arm.upper + arm.lower) / 2.0, 0.0)
        return _configuration(arm, middle, pose, conditions, _SEVERAL)
    start = as_vector("start", given, robot.dof)
    if conditions.limits:
        for joint, value, low, high in zip(
            robot.joint_names, start, robot.lower, robot.upper, strict=True
        ):
            if not low <= value <= high:
                raise ValueError(
                    f"start: {joint} is at {value:.4g}, outside its limits {low:.4g} to {high:.4g}"
                )
        start = np.clip(start, arm.lower, arm.upper)
    for name, distance in _clearances(robot, start, clear).items():
        if distance < clear.margin:
            raise ValueError(
                f"start: {name} is {distance:.3g} m, and must be {clear.margin:.3g} m at least"
            )
    return start


def _clearances(robot: Model, q: Array, clear: Clear) -> dict[str, float]:
    return signed_distances(robot, q, clear.obstacles, links=clear.links, pairs=clear.pairs)


def _configuration(
    arm: Model, near: Array, pose: Pose, conditions: Conditions, enough: int = 1
) -> Array:
    """The configuration with the pose, the nearest of so many, or the one nearest to it."""
    try:
        return _configurations(arm, near, pose, conditions, enough)[0]
    except NotConverged:
        given = (pose.position, pose.rotation, conditions.weights, conditions.limits)
        return nearest_configuration(arm, near, *given, conditions.clear)


def _configurations(
    arm: Model, near: Array, pose: Pose, conditions: Conditions, enough: int
) -> list[Array]:
    given = (pose.position, pose.rotation, conditions.limits, None, conditions.clear)
    return inverse_kinematics_solutions(arm, near, *given, enough)


def ends(arm: Model, near: Array, goal: Goal, conditions: Conditions) -> list[Array]:
    """Configurations in which a path may end, those to which a straight line costs least first."""
    if not goal.within_reach:
        return [_configuration(arm, near, goal.pose, conditions)]
    try:
        found = _configurations(arm, near, goal.pose, conditions, _SEVERAL)
    except NotConverged:  # from here; it was found from elsewhere
        return [goal.configuration]
    distinct: list[Array] = []
    for configuration in found:
        if all(np.abs(configuration - other).max() > _SAME for other in distinct):
            distinct.append(configuration)
    return sorted(distinct, key=lambda configuration: _cost(arm, near, configuration))


def _cost(arm: Model, q0: Array, q1: Array) -> float:
    """Energy of the straight line, with the mass matrix at three places of it."""
    matrices = [arm.mass_matrix(q0 + share * (q1 - q0)) for share in (0.0, 0.5, 1.0)]
    return float((q1 - q0) @ np.mean(matrices, axis=0) @ (q1 - q0))


def near_configuration(robot: Model, start: Array, pose: Pose, conditions: Conditions) -> Array:
    """The start, if it has the pose, or the configuration near it that has, or the nearest to it."""
    if max(pose.miss(robot, start)) <= _CLOSE:
        return start
    return _configuration(narrowed(robot) if conditions.limits else robot, start, pose, conditions)


def goals(robot: Model, start: Array, poses: Sequence[Pose], conditions: Conditions) -> list[Goal]:
    """Configurations with the poses, or the nearest to them, each found from the one before."""
    arm = narrowed(robot) if conditions.limits else robot
    found, near = [], start
    for pose in poses:
        near = _configuration(arm, near, pose, conditions)
        found.append(Goal(pose, near, pose.miss(robot, near)))
    return found
