"""Poses that a robot's hand takes over from a person, and configurations that attain them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_vector
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.model.distances import signed_distances
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.inverse_kinematics import (
    inverse_kinematics_solutions,
    nearest_configuration,
)
from geodesic_ocp.ocp.pose_search import pose_difference
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.settings import RetargetingSettings

REACHED = 1e-6  # [m] and [rad]
# How near inverse kinematics comes to the configuration it starts from [rad or m].
_SETTLED, _ANYWHERE = 1e-2, 0.2
_SOLUTIONS, _ENDS = 5, 10  # of inverse kinematics
_FEWEST = 4  # ends of a path to choose from, if there are as many
_SAME = 0.1  # [rad or m]
_CLOSE = 1e-3  # [m] and [rad]


@dataclass(frozen=True, eq=False)
class Pose:
    """A target for the hand.

    Attributes:
        rotation: (3, 3), or None if it is free.
        position: (3,) [m], or None if it is free.
    """

    rotation: Array | None
    position: Array | None

    def reached_by(self, model: Model, q: Array) -> Pose:
        """The pose of the hand at q, with the same parts left free."""
        rotation, position = model.hand_pose(q)
        return Pose(
            None if self.rotation is None else rotation,
            None if self.position is None else position,
        )

    def error(self, model: Model, q: Array) -> tuple[float, float]:
        """Distance [m] and angle [rad] of the hand at q from this pose; zero for free parts."""
        rotation, position = model.hand_pose(q)
        return pose_difference(
            rotation,
            position,
            rotation if self.rotation is None else self.rotation,
            position if self.position is None else self.position,
        )


@dataclass(frozen=True, eq=False)
class KeyPose:
    """The target pose at the end of a synergy, and what inverse kinematics found for it.

    Attributes:
        pose: the target.
        configuration: with that pose, or with the nearest one (n,).
        error: distance [m] and angle [rad] of the hand from the target there.
    """

    pose: Pose
    configuration: Array
    error: tuple[float, float]

    @property
    def within_reach(self) -> bool:
        """Whether the configuration attains the target."""
        return max(self.error) <= REACHED


def middle_of_ranges(arm: Model) -> tuple[Array, Array]:
    """Middle and half width of the joints' ranges (n,); 0 and pi where they are unlimited."""
    finite = np.isfinite(arm.lower) & np.isfinite(arm.upper)
    lower, upper = (np.where(finite, each, 0.0) for each in (arm.lower, arm.upper))
    return (lower + upper) / 2.0, np.where(finite, (upper - lower) / 2.0, np.pi)


@lru_cache(maxsize=16)
def with_narrowed_limits(robot: Model, tolerance: float) -> Model:
    """The robot with limits narrowed by twice a tolerance, so that none is violated by it."""
    gap = np.minimum(2.0 * tolerance, (robot.upper - robot.lower) / 4.0)
    return robot.with_limits(robot.lower + gap, robot.upper - gap)


@dataclass(frozen=True, eq=False)
class PoseFinder:
    """Inverse kinematics of one robot under the settings of a retargeting.

    Attributes:
        robot: the arm.
        settings: of the retargeting.
        tolerance: of the paths' conditions.
    """

    robot: Model
    settings: RetargetingSettings
    tolerance: float

    @property
    def arm(self) -> Model:
        """The robot, with narrowed limits if they are to be met."""
        if not self.settings.within_limits:
            return self.robot
        return with_narrowed_limits(self.robot, self.tolerance)

    def first_configuration(self, pose: Pose, given: ArrayLike | None) -> Array:
        """Configuration (n,) to begin in: the given one, or one with the pose near mid-range.

        Raises:
            ValueError: the given one is outside the limits, or too close to a collision body.
            NotConverged: no configuration is clear of the collision bodies.
        """
        robot, arm, collisions = self.robot, self.arm, self.settings.collisions
        if given is None:
            return self._nearest(middle_of_ranges(arm)[0], pose, _SOLUTIONS)
        start = as_vector("start", given, robot.dof)
        if self.settings.within_limits:
            for joint, value, low, high in zip(
                robot.joint_names, start, robot.lower, robot.upper, strict=True
            ):
                if not low <= value <= high:
                    raise ValueError(
                        f"start: {joint} is at {value:.4g}, outside its limits {low:.4g} to "
                        f"{high:.4g}"
                    )
        obstacles, links, pairs, margin = collisions
        distances = signed_distances(robot, start, obstacles, links=links, pairs=pairs)
        for name, distance in distances.items():
            if distance < margin:
                raise ValueError(
                    f"start: {name} is {distance:.3g} m, and must be at least {margin:.3g} m"
                )
        return start

    def key_poses(self, start: Array, poses: Sequence[Pose]) -> list[KeyPose]:
        """Configurations with the poses, or the nearest to them, each near the one before."""
        found, near = [], start
        for pose in poses:
            near = self._nearest(near, pose, settled=_ANYWHERE)
            found.append(KeyPose(pose, near, pose.error(self.robot, near)))
        return found

    def end_configurations(self, near: Array, target: KeyPose) -> list[Array]:
        """Configurations in which a path may end, sorted by the energy of the straight line."""
        if not target.within_reach:
            return [self._nearest(near, target.pose)]
        try:
            found = self._solutions(near, target.pose, _ENDS, _ANYWHERE, least=_FEWEST)
        except NotConverged:  # from here; it was found from elsewhere
            return [target.configuration]
        distinct: list[Array] = []
        for q in found:
            if all(np.abs(q - other).max() > _SAME for other in distinct):
                distinct.append(q)
        return sorted(distinct, key=lambda q: line_energy(self.arm, near, q))

    def is_beyond(self, pose: Pose) -> bool:
        """Whether the hand's position is farther from the base than the hand ever is."""
        if pose.position is None:
            return False
        joint = self.robot.frame_pose(self.robot.joint_names[0], np.zeros(self.robot.dof))[1]
        return float(np.linalg.norm(pose.position - joint)) > self.robot.reach

    def nearest(self, near: Array, pose: Pose) -> Array:
        """A configuration with the pose, or that with the nearest pose."""
        return self._nearest(near, pose)

    def configuration_near(self, start: Array, pose: Pose) -> Array:
        """The start if it has the pose, else the nearest configuration with it."""
        if max(pose.error(self.robot, start)) <= _CLOSE:
            return start
        return self._nearest(start, pose)

    def _nearest(
        self, near: Array, pose: Pose, enough: int = 1, settled: float = _SETTLED
    ) -> Array:
        """The nearest of several configurations with the pose, or the nearest pose."""
        try:
            return self._solutions(near, pose, enough, settled)[0]
        except NotConverged:
            settings = self.settings
            return nearest_configuration(
                *(self.arm, near, pose.position, pose.rotation, settings.pose_weights),
                *(settings.within_limits, settings.collisions),
            )

    def _solutions(
        self, near: Array, pose: Pose, enough: int, settled: float = _SETTLED, least: int = 1
    ) -> list[Array]:
        within, collisions = self.settings.within_limits, self.settings.collisions
        return inverse_kinematics_solutions(
            *(self.arm, near, pose.position, pose.rotation, within, None, collisions),
            *(enough, settled, least),
        )


def line_energy(arm: Model, q0: Array, q1: Array) -> float:
    """Energy of the straight line, with the mass matrix at three of its points."""
    matrices = [arm.mass_matrix(q0 + s * (q1 - q0)) for s in (0.0, 0.5, 1.0)]
    return float((q1 - q0) @ np.mean(matrices, axis=0) @ (q1 - q0))


@dataclass(frozen=True, eq=False, repr=False)
class PoseMapping:
    """Maps configurations of a person's arm to poses of a robot's hand.

    Attributes:
        model: the person's arm.
        source, target: alignments of the person and of the robot.
        scale: factor of positions.
        mirror: whether left and right are exchanged.
    """

    model: Model
    source: Alignment
    target: Alignment
    scale: float
    mirror: bool

    def __repr__(self) -> str:
        mirrored = ", mirrored" if self.mirror else ""
        return f"PoseMapping(from {self.model.name}, scale {self.scale:.4g}{mirrored})"

    @classmethod
    def between(
        cls, model: Model, source: Alignment, target: Alignment, settings: RetargetingSettings
    ) -> PoseMapping:
        """By default scaled by the ratio of the arms' lengths, and mirrored if the sides differ."""
        mirror, scale = settings.mirror, settings.scale
        if mirror is None:
            mirror = None not in (source.side, target.side) and source.side != target.side
        if scale is None:
            scale = target.length / source.length
        return cls(model, source, target, float(scale), bool(mirror))

    def __call__(self, q: Array) -> tuple[Array, Array]:
        """Rotations (k, 3, 3) and positions (k, 3) [m] in the robot's base, for q (k, n)."""
        rotation, position = self.source.to_person(*self.model.hand_pose(q))
        return self.target.to_robot(rotation, position, scale=self.scale, mirror=self.mirror)
