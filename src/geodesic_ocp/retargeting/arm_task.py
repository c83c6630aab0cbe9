"""The retargeting of one arm, step by step: key poses, paths, trajectory, baseline."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.limits import JointLimits
from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory
from geodesic_ocp.execution.track_within_limits import track_within_limits
from geodesic_ocp.logarithm.pose_shooting import metric_of
from geodesic_ocp.manifold.metric import speeds_at
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup, merge_synergies
from geodesic_ocp.retargeting.poses.pose_mapping import PoseMapping
from geodesic_ocp.retargeting.poses.reachability import reachability
from geodesic_ocp.retargeting.poses.targets import REACHED, KeyPose, Pose, PoseFinder
from geodesic_ocp.retargeting.program.plan_paths import PlannedPaths
from geodesic_ocp.retargeting.program.start import Candidates, first_candidates
from geodesic_ocp.retargeting.program.waypoints import ArmWaypoints, has_elbow, mapped_offsets
from geodesic_ocp.retargeting.transfer import Transfer, plan_transfers, rest_at
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.synergies.synergy import Synergy
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.time_law import time_law

_GRAVITY = 9.81  # [m/s^2]
# Rate of the baseline's controller [Hz].
_BASELINE_RATE = 200.0
# Where holding the arm takes much of a joint's torque, it gets this many times as much as that: up
# to its limit, and beyond it if it is too weak to hold the arm at all.
_MOVING = 1.5
TOO_NEAR = "links would come too near at the pose; the path ends at the nearest one that is clear"
NEAR_MISS = "the path ends near the pose, which it would attain by a detour only"
# A cubic with end speeds of at most three times its mean is monotone (Fritsch and Carlson 1980).
_MONOTONE = 3.0


@dataclass(frozen=True, eq=False)
class ArmTask:
    """One arm's motion and the poses that the robot's hand has to reach.

    Attributes:
        analysis: of the person's motion.
        mapping: from the person's configurations to poses of the robot's hand.
        finder: inverse kinematics of the robot under the settings.
        limits: of the robot's joints.
        groups: the person's synergies, after dropping and merging.
        target_poses: rotations (k, 3, 3) and positions (k, 3) of the robot's hand at all samples.
        first: pose at the beginning.
        start: configuration of the robot to begin in (n,); None: any with that pose.
        targets: the pose at the end of each group; None for a rest.
        waypoints: what the program over all synergies knows about the arm; None for free geodesics.
        layers: configurations at the waypoints.
    """

    analysis: Analysis
    mapping: PoseMapping
    finder: PoseFinder
    limits: JointLimits
    groups: tuple[SynergyGroup, ...]
    target_poses: tuple[Array, Array]
    first: Pose
    start: Array | None
    targets: tuple[KeyPose | None, ...]
    waypoints: ArmWaypoints | None
    layers: tuple[Candidates, ...]

    @classmethod
    def prepare(
        cls,
        analysis: Analysis,
        mapping: PoseMapping,
        finder: PoseFinder,
        limits: JointLimits,
        start: ArrayLike | None,
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
        given = None if start is None else finder.first_configuration(poses[0], start)
        moving = [group.kind != "rest" for group in groups]
        requested = [pose for pose, moves in zip(poses[1:], moving, strict=True) if moves]
        if settings.constrained:
            moments = analysis.motion.time[_edge_samples(groups)]
            begins, ends = moments[:-1][moving], moments[1:][moving]
            samples = [groups[0].start, *(g.stop for g in groups if g.kind != "rest")]
            goals = requested
            if not goals:  # it stays at the first pose, planned as a path without length
                begins, ends, samples, goals = moments[:1], moments[-1:], samples * 2, poses[:1]
            offsets = None
            if has_elbow(mapping.model, mapping.source):
                offsets = mapped_offsets(mapping, analysis.motion.q[samples])
            waypoints = ArmWaypoints(
                arm=finder.arm,
                limited=settings.within_limits,
                alignment=mapping.target,
                begins=begins,
                ends=ends,
                poses=(poses[0], *goals),
                between=tuple(
                    Pose(
                        None if poses[0].rotation is None else rotation,
                        None if poses[0].position is None else position,
                    )
                    for rotation, position in zip(
                        *mapping(analysis.motion((begins + ends) / 2.0)), strict=True
                    )
                ),
                start=given,
                limits=limits,
                offsets=offsets,
                near_misses=settings.near_misses,
                weights=settings.pose_weights,
            )
            layers = tuple(_reached(first_candidates(waypoints), waypoints.poses, finder))
            found = [
                KeyPose(pose, layer.q[0], pose.error(finder.robot, layer.q[0]))
                for pose, layer in zip(waypoints.poses, layers, strict=True)
            ]
        else:
            given = finder.first_configuration(poses[0], None) if given is None else given
            waypoints, layers = None, ()
            first = KeyPose(poses[0], given, poses[0].error(finder.robot, given))
            found = [first, *finder.key_poses(given, requested)]
        each = iter(found[1:])
        return cls(
            analysis,
            mapping,
            finder,
            limits,
            groups,
            (rotations, positions),
            poses[0],
            given,
            tuple(next(each) if moves else None for moves in moving),
            waypoints,
            layers,
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
    def first_error(self) -> tuple[float, float]:
        """Distance [m] and angle [rad] of the first configurations from the first pose."""
        return self.first.error(self.robot, self.layers[0].q[0] if self.layers else self.begin)

    @property
    def begin(self) -> Array:
        """Configuration to begin in (n,), if there is only one."""
        assert self.start is not None
        return self.start

    @property
    def out_of_reach(self) -> dict[int, tuple[float, float]]:
        """Error [m], [rad] of the nearest pose; 0 is the first pose, k the end of synergy k."""
        far = {
            number: target.error
            for number, target in enumerate(self.targets, 1)
            if target is not None and not target.within_reach
        }
        # A given start need not have the first pose.
        missed = not self.layers[0].within_reach if self.layers else False
        return {0: self.first_error, **far} if missed else far

    def mounting_advice(self) -> str:
        """What mounting of the robot would bring more poses within reach; empty if none would."""
        if not self.out_of_reach or self.waypoints is None or self.first.position is None:
            return ""
        poses = self.waypoints.poses
        positions = np.array([pose.position for pose in poses])
        turned = None if poses[0].rotation is None else np.array([p.rotation for p in poses])
        scale = self.mapping.scale
        found = reachability(self.finder.arm, self.mapping.target, turned, positions, scale=scale)
        return found.advice.partition(". ")[2]  # the first sentence counts the poses

    @property
    def edges(self) -> Array:
        """Times in the recording at which groups begin and end [s]."""
        return np.asarray(self.motion.time[_edge_samples(self.groups)])

    def plan_one_by_one(self, throw: bool, progress: Callable[[int], object]) -> list[Transfer]:
        """Free geodesics, one for each group; see `plan_transfers`."""
        return plan_transfers(self.finder, self.begin, self.targets, throw=throw, progress=progress)

    def transfers(self, planned: PlannedPaths, number: int) -> list[Transfer]:
        """What the program over all synergies found for the arm with this number."""
        metric = metric_of(self.finder.arm)
        paths = iter(planned.paths[number])
        within = iter(planned.within_reach[number][1:])
        missed = iter(planned.near_misses[number][1:])
        q = planned.starts[number]
        found: list[Transfer] = []
        for target in self.targets:
            if target is None:
                found.append(rest_at(metric, q))
                continue
            path, is_reached, was_missed = next(paths), next(within), next(missed)
            status = planned.status
            q = path.nodes[-1]
            if not target.within_reach:
                status = "the pose is out of reach; the path ends at the nearest one"
            elif not is_reached:
                status = NEAR_MISS if was_missed else TOO_NEAR
            errors = target.pose.error(self.robot, q)
            found.append(
                Transfer(
                    path,
                    target.pose,
                    is_reached,
                    *errors,
                    iterations=planned.iterations,
                    success=planned.success,
                    status=status,
                )
            )
        return found

    @property
    def gravity(self) -> Array:
        """Acceleration of free fall in the axes of the robot's base (3,) [m/s^2]."""
        return np.asarray(-_GRAVITY * np.asarray(self.mapping.target.base)[:, 2])

    @property
    def _within_bounds(self) -> Model:
        """The robot, without limits of its joints' ranges if they need not be met."""
        robot = self.robot
        if self.finder.settings.within_limits:
            return robot
        return robot.with_limits(*np.full((2, robot.dof), np.inf) * [[-1.0], [1.0]])

    def paths_to_time(self, transfers: Sequence[Transfer]) -> ArmPaths:
        """What the trajectory is planned from.

        Warns:
            UserWarning: a joint is too weak to hold the arm at the end of a synergy. It is allowed
                more torque.
        """
        robot, settings = self._within_bounds, self.finder.settings
        paths = [transfer.path for transfer in transfers]
        ends = [paths[0].nodes[0], *(path.nodes[-1] for path in paths)]
        still = np.zeros(robot.dof)
        held = np.abs([robot.inverse_dynamics(q, still, still, self.gravity) for q in ends])
        limit, needed = self.limits.torque, held.max(axis=0)
        for joint in np.flatnonzero(needed > limit):
            warnings.warn(
                f"{robot.name} is too weak: to hold its arm {robot.joint_names[joint]} needs "
                f"{needed[joint]:.3g} of {limit[joint]:.3g} "
                f"{'N m' if robot.units[joint] == 'rad' else 'N'}; the motion uses more",
                UserWarning,
                4,
            )
        torque = np.maximum(settings.torque_share * limit, np.minimum(limit, _MOVING * needed))
        torque = np.where(needed > limit, _MOVING * needed, torque)
        limits = replace(self.limits, torque=torque)
        return ArmPaths(robot, limits, self.edges, paths, self.gravity)

    def synergies(
        self, transfers: Sequence[Transfer], planned: PlannedTrajectory, number: int
    ) -> tuple[Synergy, ...]:
        """The robot's synergies: paths with time laws of least acceleration.

        Durations and speeds at the ends are those of the trajectory; `number` is that of this arm
        in it.
        """
        times = planned.robot_time(self.edges)
        q, v, _, _ = planned.states(times, number)
        speed = speeds_at(metric_of(self.finder.arm), q, v)
        paths = [transfer.path for transfer in transfers]
        mean = np.array([path.length for path in paths]) / np.diff(times)
        fastest = np.minimum(np.append(mean, mean[-1]), np.append(mean[0], mean)) * _MONOTONE
        speed = np.minimum(speed, fastest)
        laws = [
            time_law(path.length, float(seconds), *ends, monotone=True)
            for path, seconds, ends in zip(paths, np.diff(times), pairwise(speed), strict=True)
        ]
        return tuple(
            Synergy(group.start, group.stop, float(time), path, law)
            for group, time, path, law in zip(self.groups, times[:-1], paths, laws, strict=True)
        )

    def track_hand(self, planned: PlannedTrajectory, start: Array) -> JointTrajectory:
        """The baseline: inverse kinematics within limits, in the time of the trajectory.

        It begins where the synergies begin, or at the first pose if they begin elsewhere.
        """
        motion, time = self.motion, planned.robot_time(self.motion.time)

        def poses(instants: Array) -> tuple[Array, Array]:
            # Robot time is a piecewise linear function of the recording's time.
            return self.mapping(motion(np.interp(instants, time, motion.time)))

        return track_within_limits(
            self._within_bounds,
            self.finder.configuration_near(start, self.first),
            time,
            poses,
            self.limits,
            rate=_BASELINE_RATE,
            turning=self.first.rotation is not None,
            placing=self.first.position is not None,
        )


def _reached(
    layers: Sequence[Candidates], poses: Sequence[Pose], finder: PoseFinder
) -> Iterator[Candidates]:
    """The candidates, after a more thorough search for poses that none of them attains."""
    for layer, pose in zip(layers, poses, strict=True):
        if layer.within_reach or finder.is_beyond(pose):
            yield layer
            continue
        q = finder.nearest(layer.q[0], pose)
        error, before = (max(pose.error(finder.robot, each)) for each in (q, layer.q[0]))
        if error <= REACHED:
            yield Candidates.attaining(q)
        elif error < before:
            yield Candidates(np.vstack([q, layer.q]), np.append(error, layer.errors))
        else:
            yield layer


def _edge_samples(groups: Sequence[SynergyGroup]) -> list[int]:
    """Samples (k + 1,) at which groups begin and end."""
    return [groups[0].start, *(group.stop for group in groups)]
