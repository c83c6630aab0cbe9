"""Poses that a robot's hand takes over from a person, and configurations that attain them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr, as_vector
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.execution.limits import JointLimits
from geodesic_ocp.model.distances import signed_distances
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.inverse_kinematics import configurations, nearest_configuration
from geodesic_ocp.ocp.pose_search import CollisionAvoidance, PoseSearch, pose_difference
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup, merge_synergies
from geodesic_ocp.retargeting.settings import RetargetingSettings
from geodesic_ocp.synergies.analyse import Analysis

_GRAVITY = 9.81  # [m/s^2]
NO_COLLISIONS = CollisionAvoidance()
REACHED = 1e-6  # [m] and [rad]
# How near inverse kinematics comes to the configuration it starts from [rad or m].
_SETTLED = 1e-2


@dataclass(frozen=True, eq=False, repr=False)
class Pose(ShortRepr):
    """A target for the hand.

    Attributes:
        rotation: (3, 3), or None if it is free.
        position: (3,) [m], or None if it is free.
    """

    rotation: Array | None
    position: Array | None

    def reached_by(self, model: Model, q: Array) -> Pose:
        """Return the pose of the hand at q, with the same parts left free."""
        rotation, position = model.hand_pose(q)
        return Pose(
            None if self.rotation is None else rotation,
            None if self.position is None else position,
        )

    def error(self, model: Model, q: Array) -> tuple[float, float]:
        """Get distance [m] and angle [rad] of the hand at q from this pose; zero for free parts."""
        rotation, position = model.hand_pose(q)
        return pose_difference(
            rotation,
            position,
            rotation if self.rotation is None else self.rotation,
            position if self.position is None else self.position,
        )


def middle_of_ranges(arm: Model) -> tuple[Array, Array]:
    """Get middle and half width of the joints' ranges (n,); 0 and pi where they are unlimited."""
    finite = np.isfinite(arm.lower) & np.isfinite(arm.upper)
    lower, upper = (np.where(finite, each, 0.0) for each in (arm.lower, arm.upper))
    return (lower + upper) / 2.0, np.where(finite, (upper - lower) / 2.0, np.pi)


@lru_cache(maxsize=16)
def with_narrowed_limits(robot: Model, tolerance: float) -> Model:
    """Get the robot with limits narrowed by twice a tolerance, so that none is violated by it."""
    gap = np.minimum(2.0 * tolerance, (robot.upper - robot.lower) / 4.0)
    return robot.with_limits(robot.lower + gap, robot.upper - gap)


def nearest_configurations(
    arm: Model,
    near: Array,
    pose: Pose,
    limits: bool,
    weights: tuple[float, float],
    collisions: CollisionAvoidance = NO_COLLISIONS,
    enough: int = 1,
    settled: float = _SETTLED,
    least: int = 1,
) -> list[Array]:
    """Return configurations (n,) with a pose, the nearest first, or the one with the nearest pose.

    Args:
        arm: the robot.
        near: configuration (n,) from which they are sought.
        pose: pose of the hand.
        limits: whether joints stay within their limits.
        weights: weights of errors in position [1/m] and orientation [1/rad].
        collisions: bodies that are kept apart.
        enough, settled, least: see `configurations`.

    Raises:
        NotConverged: no configuration is clear of the collision bodies.
    """
    placed = arm, near, pose.position, pose.rotation
    search = PoseSearch.checked("retarget", *placed, limits=limits, collisions=collisions)
    try:
        return configurations(search, enough, settled, least)
    except NotConverged:
        return [nearest_configuration(search, weights)]


def checked_start(robot: Model, given: ArrayLike, settings: RetargetingSettings) -> Array:
    """Return the configuration (n,) to begin in.

    Raises:
        ValueError: it is outside the limits, or too close to a collision body.
    """
    start = as_vector("start", given, robot.dof)
    if settings.within_limits:
        for joint, value, low, high in zip(
            robot.joint_names, start, robot.lower, robot.upper, strict=True
        ):
            if not low <= value <= high:
                raise ValueError(
                    f"start: {joint} is at {value:.4g}, outside its limits {low:.4g} to {high:.4g}"
                )
    obstacles, links, pairs, margin = settings.collisions
    distances = signed_distances(robot, start, obstacles, links=links, pairs=pairs)
    for name, distance in distances.items():
        if distance < margin:
            raise ValueError(
                f"start: {name} is {distance:.3g} m, and must be at least {margin:.3g} m"
            )
    return start


def is_beyond(robot: Model, pose: Pose) -> bool:
    """Return whether the hand's position is farther from the base than the hand ever is."""
    if pose.position is None:
        return False
    joint = robot.frame_pose(robot.joint_names[0], np.zeros(robot.dof))[1]
    return float(np.linalg.norm(pose.position - joint)) > robot.reach


@dataclass(frozen=True, eq=False, repr=False)
class PoseMapping(ShortRepr):
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
    _shown = ("scale", "mirror")

    @classmethod
    def between(
        cls, model: Model, source: Alignment, target: Alignment, settings: RetargetingSettings
    ) -> PoseMapping:
        """Map poses: scaled by the ratio of lengths by default, mirrored if sides differ."""
        mirror, scale = settings.mirror, settings.scale
        if mirror is None:
            mirror = None not in (source.side, target.side) and source.side != target.side
        if scale is None:
            scale = target.length / source.length
        return cls(model, source, target, float(scale), bool(mirror))

    def __call__(self, q: Array) -> tuple[Array, Array]:
        """Return rotations (k, 3, 3) and positions (k, 3) [m] in the robot's base, for q (k, n)."""
        rotation, position = self.source.to_person(*self.model.hand_pose(q))
        return self.target.to_robot(rotation, position, scale=self.scale, mirror=self.mirror)


@dataclass(frozen=True, eq=False, repr=False)
class PairedArm(ShortRepr):
    """A person's arm, and the robot that takes over its motion.

    Attributes:
        analysis: analysis of the person's motion.
        robot: the arm.
        mapping: from the person's configurations to poses of the robot's hand.
        limits: limits of its joints.
        settings: settings of the retargeting.
        groups: how the person's synergies were dropped and merged.
        target_poses: rotations (k, 3, 3) and positions (k, 3) [m] of the hand, mapped from the
            person to the robot's base frame, at all samples.
    """

    analysis: Analysis
    robot: Model
    mapping: PoseMapping
    limits: JointLimits
    settings: RetargetingSettings
    groups: tuple[SynergyGroup, ...]
    target_poses: tuple[Array, Array]
    _shown = ("robot", "mapping")

    @classmethod
    def of(
        cls,
        analysis: Analysis,
        robot: Model,
        mapping: PoseMapping,
        limits: JointLimits,
        settings: RetargetingSettings,
    ) -> PairedArm:
        """Return the key poses of a motion, with synergies merged and poses mapped.

        Raises:
            ValueError: the lengths to drop and merge are out of range.
        """
        groups = merge_synergies(analysis.synergies, drop=settings.drop, merge=settings.merge)
        poses = mapping(analysis.motion.q)
        return cls(analysis, robot, mapping, limits, settings, groups, poses)

    @property
    def gravity(self) -> Array:
        """Gravity in the axes of the robot's base (3,) [m/s^2]."""
        return np.asarray(-_GRAVITY * np.asarray(self.mapping.target.base)[:, 2])

    @property
    def edges(self) -> Array:
        """Times in the recording at which groups begin and end [s]."""
        samples = [self.groups[0].start, *(group.stop for group in self.groups)]
        return np.asarray(self.analysis.motion.time[samples])

    @property
    def bounded(self) -> Model:
        """The robot, without limits of its joints' ranges if they need not be met."""
        if self.settings.within_limits:
            return self.robot
        infinite = np.full(self.robot.dof, np.inf)
        return self.robot.with_limits(-infinite, infinite)

    def target(self, sample: int) -> Pose:
        """Return the pose of the hand at a sample of the recording."""
        return self.as_pose(*(each[sample] for each in self.target_poses))

    def as_pose(self, rotation: Array, position: Array) -> Pose:
        """Return the pose error at a rotation and position, but for what settings leave free."""
        weights = self.settings.orientation_weight, self.settings.position_weight
        return Pose(
            *(
                each if weight > 0.0 else None
                for each, weight in zip((rotation, position), weights, strict=True)
            )
        )
