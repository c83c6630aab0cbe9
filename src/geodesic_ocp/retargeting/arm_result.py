"""The retargeting of one arm: the robot's synergies, its motion, and the baseline."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metrics.kinetic_energy import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup
from geodesic_ocp.retargeting.pose_mapping import PoseMapping
from geodesic_ocp.retargeting.transfer import Transfer, velocity_limits
from geodesic_ocp.synergies.analysis import Analysis
from geodesic_ocp.synergies.scores.evaluate import MotionErrors, action, pose_errors
from geodesic_ocp.synergies.synergy import Synergy
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion


@dataclass(frozen=True)
class MotionStatistics:
    """Statistics of one motion of a robot.

    Attributes:
        action: int 1/2 |q'|_G^2 dt of the whole motion [J s].
        peak_speed: largest ratio of a joint's speed to its limit; 0 if there are no limits.
        position, orientation: mean distance [m] and angle [rad] of the hand from the person's,
            mapped to the robot, over all samples.
        limit_violation: largest excess of a joint over its limits [rad or m].
    """

    action: float
    peak_speed: float
    position: float
    orientation: float
    limit_violation: float


@dataclass(frozen=True, eq=False, repr=False)
class RetargetedArm:
    """One arm of a retargeting.

    Attributes:
        analysis: of the person's motion.
        robot: the arm.
        mapping: from the person's configurations to poses of the robot's hand.
        groups: how the person's synergies were dropped and merged.
        transfers: for each group the path, and the error of the hand's pose at its end.
        synergies: for each group the path and its time law, in the robot's time.
        trajectory: at the samples of the recording, in robot time.
        target_poses: rotations (k, 3, 3) and positions (k, 3) [m] of the hand, mapped from the
            person to the robot's base frame, at all samples.
        baseline: a velocity controller that tracks the hand along its whole path.
        out_of_reach: distance [m] and angle [rad] of the nearest pose, for poses out of reach, by
            number of the pose (0 is the first, k + 1 the end of synergy k).
    """

    analysis: Analysis
    robot: Model
    mapping: PoseMapping
    groups: tuple[SynergyGroup, ...]
    transfers: tuple[Transfer, ...]
    synergies: tuple[Synergy, ...]
    trajectory: JointTrajectory
    target_poses: tuple[Array, Array]
    baseline: Motion
    out_of_reach: Mapping[int, tuple[float, float]]

    def __repr__(self) -> str:
        worst = max(max(each.position_error, each.rotation_error) for each in self.transfers)
        return (
            f"RetargetedArm({self.title}: {len(self.analysis.synergies)} synergies become "
            f"{len(self.groups)}, largest hand pose error {worst:.1e} m or rad)"
        )

    @cached_property
    def motion(self) -> Motion:
        """The robot's motion at the samples of the recording, in robot time."""
        found = self.trajectory
        subject = self.analysis.motion.subject
        return Motion(found.time, found.positions, found.joint_names, found.velocities, subject)

    @cached_property
    def statistics(self) -> Mapping[str, MotionStatistics]:
        """Of the "synergies", and of "ik", inverse kinematics in the same time."""
        return {"synergies": self._statistics(self.motion), "ik": self._statistics(self.baseline)}

    def _statistics(self, motion: Motion) -> MotionStatistics:
        robot = self.robot
        assert motion.velocity is not None
        errors: MotionErrors = pose_errors(robot.hand_pose(motion.q), self.target_poses)
        outside = np.maximum(robot.lower - motion.q, motion.q - robot.upper)
        return MotionStatistics(
            action=action(KineticEnergy(robot), motion),
            peak_speed=float((np.abs(motion.velocity) / velocity_limits(robot)).max()),
            position=errors.position,
            orientation=errors.orientation,
            limit_violation=max(0.0, float(outside.max())),
        )

    @property
    def has_speed_limits(self) -> bool:
        """Whether any joint has a speed limit."""
        return bool(np.any(np.isfinite(velocity_limits(self.robot))))

    @property
    def title(self) -> str:
        """Names of the person's arm and of the robot."""
        mirrored = " (mirrored)" if self.mapping.mirror else ""
        return f"{self.analysis.model.name}{mirrored} on {self.robot.name}"
