"""The retargeting of one arm, step by step: key poses, paths, trajectory, baseline."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metrics.kinetic_energy import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup, merge_synergies
from geodesic_ocp.retargeting.pose_mapping import PoseMapping
from geodesic_ocp.retargeting.targets import REACHED, KeyPose, Pose, PoseFinder
from geodesic_ocp.retargeting.time_scaling import ArmPaths, TimeScaling, handover_speeds
from geodesic_ocp.retargeting.transfer import Transfer, plan_transfers, velocity_limits
from geodesic_ocp.synergies.analysis import Analysis
from geodesic_ocp.synergies.baselines.track_hand import steps_between, track_poses
from geodesic_ocp.synergies.observed_velocity import speeds
from geodesic_ocp.synergies.synergy import Synergy
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion


@dataclass(frozen=True, eq=False)
class ArmTask:
    """One arm's motion and the poses that the robot's hand has to reach.

    Attributes:
        analysis: of the person's motion.
        mapping: from the person's configurations to poses of the robot's hand.
        finder: inverse kinematics of the robot under the settings.
        groups: the person's synergies, after dropping and merging.
        target_poses: rotations (k, 3, 3) and positions (k, 3) of the robot's hand at all samples.
        first: pose at the beginning.
        start: configuration of the robot to begin in (n,).
        start_error: its distance from the first pose [m], [rad]; zero if it was given.
        targets: the pose at the end of each group; None for a rest.
    """

    analysis: Analysis
    mapping: PoseMapping
    finder: PoseFinder
    groups: tuple[SynergyGroup, ...]
    target_poses: tuple[Array, Array]
    first: Pose
    start: Array
    start_error: tuple[float, float]
    targets: tuple[KeyPose | None, ...]

    @classmethod
    def prepare(
        cls, analysis: Analysis, mapping: PoseMapping, finder: PoseFinder, start: ArrayLike | None
    ) -> ArmTask:
        """With the poses mapped to the robot, and configurations found for them.

        Raises:
            ValueError: the given start, or the lengths to drop and merge, are out of range.
            NotConverged: no configuration is clear of collision bodies.
        """
        settings = finder.settings
        groups = merge_synergies(analysis.synergies, drop=settings.drop, merge=settings.merge)
        rotations, positions = mapping(analysis.motion.q)
        poses = [
            Pose(
                rotations[k] if settings.orientation_weight > 0.0 else None,
                positions[k] if settings.position_weight > 0.0 else None,
            )
            for k in _edge_samples(groups)
        ]
        begin = finder.first_configuration(poses[0], start)
        moving = [group.kind != "rest" for group in groups]
        requested = [pose for pose, moves in zip(poses[1:], moving, strict=True) if moves]
        found = iter(finder.key_poses(begin, requested))
        return cls(
            analysis,
            mapping,
            finder,
            groups,
            (rotations, positions),
            poses[0],
            begin,
            (0.0, 0.0) if start is not None else poses[0].error(finder.robot, begin),
            tuple(next(found) if moves else None for moves in moving),
        )

    @property
    def robot(self) -> Model:
        """The arm."""
        return self.finder.robot

    @property
    def motion(self) -> Motion:
        """The person's motion."""
        return self.analysis.motion

    @property
    def out_of_reach(self) -> dict[int, tuple[float, float]]:
        """Error [m], [rad] of the nearest pose by number of the pose; 0 is the first."""
        far = {
            number + 1: target.error
            for number, target in enumerate(self.targets)
            if target is not None and not target.within_reach
        }
        return far if max(self.start_error) <= REACHED else {0: self.start_error, **far}

    @property
    def edges(self) -> Array:
        """Times in the recording at which groups begin and end [s]."""
        return np.asarray(self.motion.time[_edge_samples(self.groups)])

    def plan(self, throw: bool, progress: Callable[[int], object]) -> list[Transfer]:
        """The robot's paths, one for each group; see `plan_transfers`."""
        durations = np.diff(self.edges).tolist()
        return plan_transfers(
            self.finder, self.start, self.targets, durations, throw=throw, progress=progress
        )

    def paths_to_time(self, transfers: Sequence[Transfer]) -> ArmPaths:
        """The paths, the speeds at their ends, and the joints' speed limits."""
        settings = self.finder.settings
        of_person = speeds(KineticEnergy(self.mapping.model), self.motion)
        synergies = self.analysis.synergies
        lengths = [
            sum(synergies[number].length for number in group.members) for group in self.groups
        ]
        paths = [transfer.path for transfer in transfers]
        handover = handover_speeds(
            of_person[_edge_samples(self.groups)],
            np.array(lengths),
            np.diff(self.edges),
            np.array([path.length for path in paths]),
        )
        if settings.rest:
            handover[[0, -1]] = 0.0
        fastest = velocity_limits(self.robot)
        limits = fastest if settings.speed_limits else np.full_like(fastest, np.inf)
        return ArmPaths(self.edges, paths, handover, limits)

    def trajectory(
        self, transfers: Sequence[Transfer], scaling: TimeScaling, number: int
    ) -> tuple[tuple[Synergy, ...], JointTrajectory]:
        """The robot's synergies, and its trajectory at the samples of the recording.

        `number` is that of this arm in the time scaling.
        """
        time = scaling(self.motion.time)
        synergies = tuple(
            Synergy(group.start, group.stop, float(time[group.start]), transfer.path, law)
            for group, transfer, law in zip(
                self.groups, transfers, scaling.laws[number], strict=True
            )
        )
        positions, velocities, accelerations = np.empty((3, time.size, self.robot.dof))
        for synergy in synergies:
            # A shared sample belongs to the synergy that begins there.
            here = slice(synergy.start, synergy.stop + 1)
            positions[here], velocities[here], accelerations[here] = synergy.states(time[here])
        names = self.robot.joint_names
        return synergies, JointTrajectory(time, positions, velocities, accelerations, names)

    def track_hand(self, scaling: TimeScaling) -> Motion:
        """The baseline: a velocity controller that tracks the hand along its whole path."""
        motion, time = self.motion, scaling(self.motion.time)

        def poses(instants: Array) -> tuple[Array, Array]:
            # Robot time is a linear function of the recording's time between two samples.
            return self.mapping(motion(np.interp(instants, time, motion.time)))

        # From a given start away from the first pose, it would first rush to that pose.
        start = self.finder.configuration_near(self.start, self.first)
        tracked = track_poses(
            *(self.robot, start, time, poses),
            counts=steps_between(motion),
            turning=self.first.rotation is not None,
            placing=self.first.position is not None,
        )
        return replace(tracked, subject=motion.subject)


def _edge_samples(groups: Sequence[SynergyGroup]) -> list[int]:
    """Samples (k + 1,) at which groups begin and end."""
    return [groups[0].start, *(group.stop for group in groups)]
