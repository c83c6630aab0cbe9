"""The retargeting of one arm: the robot's synergies, its motion, and the baseline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.limits import JointLimits
from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory
from geodesic_ocp.manifold.metrics import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.arm_task import ArmTask
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup
from geodesic_ocp.retargeting.poses.pose_mapping import PoseMapping
from geodesic_ocp.retargeting.transfer import Transfer
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.synergies.scores import MotionErrors, action, pose_errors
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
        limits: of its joints.
        synergies: for each group the path with a time law of least acceleration, in the robot's
            time; the trajectory stays near them, and rounds the corners where they meet.
        trajectory: what the robot executes, at a uniform rate.
        motion: that motion at the samples of the recording, in robot time.
        target_poses: rotations (k, 3, 3) and positions (k, 3) [m] of the hand, mapped from the
            person to the robot's base frame, at all samples.
        baseline: inverse kinematics within the same limits, which tracks the hand along its whole
            path, in the same time.
        gravity: in the axes of the robot's base (3,) [m/s^2].
        out_of_reach: distance [m] and angle [rad] of the nearest pose, for poses out of reach, by
            number of the pose: 0 is the first pose, k the end of synergy k, counted from 1.
    """

    analysis: Analysis
    robot: Model
    mapping: PoseMapping
    groups: tuple[SynergyGroup, ...]
    transfers: tuple[Transfer, ...]
    limits: JointLimits
    synergies: tuple[Synergy, ...]
    trajectory: JointTrajectory
    motion: Motion
    target_poses: tuple[Array, Array]
    baseline: JointTrajectory
    gravity: Array
    out_of_reach: Mapping[int, tuple[float, float]]

    def __repr__(self) -> str:
        worst = max(max(each.position_error, each.rotation_error) for each in self.transfers)
        return (
            f"RetargetedArm({self.title}: {len(self.analysis.synergies)} synergies become "
            f"{len(self.groups)}, largest hand pose error {worst:.1e} m or rad)"
        )

    @classmethod
    def of(
        cls,
        task: ArmTask,
        transfers: Sequence[Transfer],
        planned: PlannedTrajectory,
        number: int,
        rate: float,
    ) -> RetargetedArm:
        """The result for the arm with this number in a trajectory, sampled at a rate [Hz]."""
        robot, recorded = task.robot, task.analysis.motion
        times = planned.robot_time(recorded.time)
        q, v, _, _ = planned.states(times, number)
        q = np.clip(q, robot.lower, robot.upper) if task.finder.settings.within_limits else q
        columns = slice(*np.cumsum([0, *(arm.robot.dof for arm in planned.arms)])[number:][:2])
        return cls(
            analysis=task.analysis,
            robot=robot,
            mapping=task.mapping,
            groups=task.groups,
            transfers=tuple(transfers),
            limits=task.limits,
            synergies=task.synergies(transfers, planned, number),
            trajectory=_of_joints(planned.sampled(rate), columns, robot),
            motion=Motion(times, q, robot.joint_names, v, recorded.subject),
            target_poses=task.target_poses,
            baseline=task.track_hand(planned, q[0]),
            out_of_reach=task.out_of_reach,
            gravity=task.gravity,
        )

    @cached_property
    def tracked(self) -> Motion:
        """The baseline at the samples of the recording, in robot time."""
        times = self.motion.time
        q, v, _ = self.baseline.states(times)
        return Motion(times, q, self.robot.joint_names, v, self.motion.subject)

    @cached_property
    def statistics(self) -> Mapping[str, MotionStatistics]:
        """Of the "synergies", and of "ik", inverse kinematics in the same time."""
        return {"synergies": self._statistics(self.motion), "ik": self._statistics(self.tracked)}

    def _statistics(self, motion: Motion) -> MotionStatistics:
        robot = self.robot
        assert motion.velocity is not None
        errors: MotionErrors = pose_errors(robot.hand_pose(motion.q), self.target_poses)
        outside = np.maximum(robot.lower - motion.q, motion.q - robot.upper)
        return MotionStatistics(
            action=action(KineticEnergy(robot), motion),
            peak_speed=float((np.abs(motion.velocity) / self.limits.velocity).max()),
            position=errors.position,
            orientation=errors.orientation,
            limit_violation=max(0.0, float(outside.max())),
        )

    @property
    def has_speed_limits(self) -> bool:
        """Whether any joint has a speed limit."""
        return bool(np.any(np.isfinite(self.limits.velocity)))

    @property
    def title(self) -> str:
        """Names of the person's arm and of the robot."""
        mirrored = " (mirrored)" if self.mapping.mirror else ""
        return f"{self.analysis.model.name}{mirrored} on {self.robot.name}"


def _of_joints(trajectory: JointTrajectory, columns: slice, robot: Model) -> JointTrajectory:
    """The trajectory of one arm, whose joints have these columns."""
    return JointTrajectory(
        trajectory.time,
        trajectory.positions[:, columns],
        trajectory.velocities[:, columns],
        trajectory.accelerations[:, columns],
        robot.joint_names,
        robot.units,
        None if trajectory.efforts is None else trajectory.efforts[:, columns],
    )
