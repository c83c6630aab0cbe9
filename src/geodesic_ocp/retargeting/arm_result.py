"""The retargeting of one arm: the robot's synergies, its motion, and the baseline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.execution.motion_measures import (
    MotionMeasures,
    compare_with_tracking,
)
from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory
from geodesic_ocp.execution.track_within_limits import track_within_limits
from geodesic_ocp.manifold.metric import Metric, speeds_at
from geodesic_ocp.manifold.metrics import KineticEnergy, metric_of
from geodesic_ocp.retargeting.candidates import Candidates
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup
from geodesic_ocp.retargeting.paired_arm import (
    MISSED,
    REACHED,
    PairedArm,
    Pose,
    PoseMapping,
    elbow_function,
    has_elbow,
    nearest_configurations,
)
from geodesic_ocp.retargeting.place_base import BasePlacement
from geodesic_ocp.retargeting.synergy_paths import PlannedPaths
from geodesic_ocp.synergies.scores import MotionErrors, action, pose_errors
from geodesic_ocp.synergies.synergy import Synergy
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.time_law import time_law

OUT_OF_REACH = "the pose is out of reach; the path ends near it"
TOO_NEAR = (
    "links would come too near each other or an obstacle at the pose; the path ends at the nearest "
    "one that is clear"
)
OTHER_HAND = "the path ends near the pose, as another hand's is missed"
NEAR_MISS = "the path ends near the pose, which it would attain by a detour only"

_BASELINE_RATE = 200.0  # [Hz], of the controller
_CLOSE = 1e-3  # [m] and [rad]
# of the baseline, and how near to each other [rad or m]
_STARTS = 20
_ANYWHERE = 0.2
# A cubic with end speeds of at most three times its mean is monotone (Fritsch and Carlson 1980).
_MONOTONE = 3.0


# Distance [m] and angle [rad] by number of the pose: 0 is the first pose, k the end of synergy k,
# counted from 1.
PoseErrors = Mapping[int, tuple[float, float]]


@dataclass(frozen=True, eq=False, repr=False)
class Transfer(ShortRepr):
    """A path of a robot to a target pose of its hand.

    Attributes:
        path: path of least energy under the constraints; of zero length if the arm rests.
        pose: the target.
        within_reach: whether inverse kinematics found a configuration with that pose; True of a
            rest, for which none is sought.
        position_error, rotation_error: position error and rotation error of the hand at the path's
            end [m], [rad].
        iterations: iterations of Ipopt, on all grids.
        success: whether the solver found the path.
        status: how it stopped, a sentence.
    """

    path: Path
    pose: Pose
    within_reach: bool
    position_error: float
    rotation_error: float
    iterations: int
    success: bool
    status: str
    _shown = ("position_error", "rotation_error", "status")


def unattained(pair: PairedArm, layers: Sequence[Candidates]) -> PoseErrors:
    """Return poses that none of the candidates at the waypoints attains."""
    numbers = [k for k, group in enumerate(pair.groups, 1) if group.kind != "rest"]
    found = {}
    for number, sample, layer in zip((0, *numbers), pair.key_samples, layers, strict=False):
        error = pair.target(sample).error(pair.robot, layer.q[0])
        # A given start need not have the first pose.
        if not layer.within_reach and max(error) > REACHED:
            found[number] = error
    return found


def transfers_on(pair: PairedArm, paths: PlannedPaths, out_of_reach: PoseErrors) -> list[Transfer]:
    """Return the transfers of an arm, or of one hand of a body, from the program over all
    synergies.
    """
    own = paths.paths[pair.body]
    moved = zip(own, paths.within_reach[pair.body][1:], strict=True)
    found = list[Transfer]()
    q = own[0].nodes[0]
    at = 0  # number of the waypoint
    for number, group in enumerate(pair.groups, 1):
        if group.kind == "rest":
            found.append(at_rest(pair, group, q))
            continue
        at += 1
        path, is_attained = next(moved)
        q = path.nodes[-1]
        pose = pair.target(group.stop)
        status = paths.status
        errors = pose.error(pair.robot, q)
        is_attained |= len(pair.hands) > 1 and max(errors) <= MISSED  # where another hand is not
        if number in out_of_reach:
            status = OUT_OF_REACH
        elif not is_attained and pair.is_missed(errors):
            status = TOO_NEAR
        elif not is_attained:
            on_purpose = len(pair.hands) == 1 or paths.near_misses[pair.body][at]
            status = NEAR_MISS if on_purpose else OTHER_HAND
        found.append(
            Transfer(path, pose, is_attained, *errors, paths.iterations, paths.success, status)
        )
    return found


def at_rest(pair: PairedArm, group: SynergyGroup, q: Array) -> Transfer:
    """Return the arm at rest in a configuration (n,)."""
    still = line(metric_of(pair.robot), q, q)
    pose = pair.target(group.stop)
    return Transfer(still, pose, True, *pose.error(pair.robot, q), 0, True, "the arm rests")


def line(metric: Metric, q0: Array, q1: Array) -> Path:
    """Return the straight line between two configurations."""
    return Path(metric, Grid(1, 2), np.array([q0, (q0 + q1) / 2.0, q1]))


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
class RetargetedArm(PairedArm):
    """One arm of a retargeting; see also the attributes of the person's and the robot's arm.

    Attributes:
        transfers: for each group the path, and the error of the hand's pose at its end.
        synergies: for each group the path with a time law of least acceleration, in the robot's
            time; the trajectory stays near them, and rounds the corners where they meet.
        trajectory: what the robot executes, at a uniform rate.
        motion: the motion at the samples of the recording, in robot time.
        out_of_reach: distance [m] and angle [rad] of the nearest pose that inverse kinematics
            found, for poses out of reach, by number of the pose: 0 is the first pose, k the end of
            synergy k, counted from 1. `pose_errors` has what the motion achieves.
        placement: where the base stands, as not all poses are attained at its default place;
            None: where the alignment has it that was given, or the default.
        first: the result for the first hand of a body, whose motion and baseline are those of all;
            None: this is it.
    """

    transfers: tuple[Transfer, ...]
    synergies: tuple[Synergy, ...]
    trajectory: JointTrajectory
    motion: Motion
    out_of_reach: PoseErrors
    placement: BasePlacement | None = None
    first: RetargetedArm | None = None

    def __repr__(self) -> str:
        distance, angle = np.max(list(self.pose_errors.values()), axis=0)
        return (
            f"RetargetedArm({self.title}: {len(self.analysis.synergies)} synergies become "
            f"{len(self.groups)}, hand off its poses by at most {distance:.2g} m, {angle:.2g} rad)"
        )

    @cached_property
    def pose_errors(self) -> PoseErrors:
        """Distance [m] and angle [rad] of the hand from each pose, also out of reach or at a rest.

        By number of the pose, as in `out_of_reach`.
        """
        begin = self.transfers[0].path.nodes[0]
        ends = ((each.position_error, each.rotation_error) for each in self.transfers)
        first = self.target(self.groups[0].start).error(self.robot, begin)
        return dict(enumerate([first, *ends]))

    @property
    def missed(self) -> PoseErrors:
        """Those of the pose errors that are beyond `RetargetingSettings.pose_tolerance`.

        A given start need not have the first pose.
        """
        counted = (
            self.pose_errors.items() if self.start is None else [*self.pose_errors.items()][1:]
        )
        return {number: error for number, error in counted if self.is_missed(error)}

    @classmethod
    def retargeted(
        cls,
        pair: PairedArm,
        transfers: Sequence[Transfer],
        out_of_reach: PoseErrors,
        planned: PlannedTrajectory,
        rate: float,
        placement: BasePlacement | None,
    ) -> RetargetedArm:
        """Get the result for an arm in a trajectory, sampled at a rate [Hz]."""
        robot = pair.robot
        recorded = pair.analysis.motion
        number = pair.body
        times = planned.robot_time(recorded.time)
        q, v, _, _ = planned.states(times, number)
        q = np.clip(q, robot.lower, robot.upper) if pair.settings.within_limits else q
        return cls(
            **{each.name: getattr(pair, each.name) for each in fields(PairedArm)},
            transfers=tuple(transfers),
            synergies=_timed(pair, transfers, planned),
            trajectory=planned.sampled(rate, number),
            motion=Motion(times, q, robot.joint_names, v, recorded.subject),
            out_of_reach=out_of_reach,
            placement=placement,
        )

    @cached_property
    def baseline(self) -> JointTrajectory:
        """Inverse kinematics that tracks the hand on its whole way, in the same time and limits; of
        a body, all its hands.

        It begins in that of several configurations with the first pose from which the hand follows
        best; if a start was given, in that or in the nearest one with the pose. If no configuration
        near that pose is clear of obstacles, it begins where the synergies do.
        """
        if self.first is not None:
            return self.first.baseline
        motion = self.analysis.motion
        time = self.motion.time
        settings = self.settings
        begin = self.groups[0].start
        (pose,) = self.targets(motion.q[begin : begin + 1])
        start = self.motion.q[0]
        is_there = max(pose.error(self.robot, start)) <= _CLOSE
        is_given = self.start is not None
        starts = [start] if is_there else []
        count = 1 if is_given else _STARTS
        if len(starts) < count:
            placed = settings.within_limits, settings.pose_weights, settings.collisions
            try:
                starts += nearest_configurations(
                    self.bounded, start, pose, *placed, enough=count, settled=_ANYWHERE, least=count
                )
            except NotConverged:  # none near the pose is clear of obstacles
                starts = [start]

        def poses(instants: Array) -> tuple[Array, Array]:
            # Robot time is a piecewise linear function of the recording's time.
            return self.mapped(motion(np.interp(instants, time, motion.time)))

        return track_within_limits(
            self.bounded,
            starts[:count],
            time,
            poses,
            self.limits,
            rate=_BASELINE_RATE,
            turning=pose.rotation is not None,
            placing=pose.position is not None,
            hands=self.hands,
        )

    @cached_property
    def tracked(self) -> Motion:
        """The baseline at the samples of the recording, in robot time."""
        times = self.motion.time
        tracked = self.baseline
        q, v = (  # its speeds are constant over each step
            np.column_stack([np.interp(times, tracked.time, each) for each in states.T])
            for states in (tracked.positions, tracked.velocities)
        )
        return Motion(times, q, self.robot.joint_names, v, self.motion.subject)

    @cached_property
    def statistics(self) -> Mapping[str, MotionStatistics]:
        """Statistics of the "synergies", and of "ik", inverse kinematics in the same time."""
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

    def seconds(self, group: SynergyGroup) -> float:
        """Return the person's time for one of the groups [s]."""
        time = self.analysis.motion.time
        return float(time[group.stop] - time[group.start])

    @property
    def has_speed_limits(self) -> bool:
        """True if any joint has a speed limit."""
        return bool(np.any(np.isfinite(self.limits.velocity)))

    @property
    def title(self) -> str:
        """Names of the person's arm and of the robot."""
        mirrored = " (mirrored)" if self.mapping.mirror else ""
        turned = ", gripper turned by 180 degrees" if self.mapping.turned else ""
        moved = ", base moved" if self.placement else ""
        return f"{self.analysis.model.name}{mirrored} on {self.name}{turned}{moved}"


def _timed(
    pair: PairedArm, transfers: Sequence[Transfer], planned: PlannedTrajectory
) -> tuple[Synergy, ...]:
    """Return the robot's synergies: paths with time laws of least acceleration.

    Durations and speeds at the ends are those of the trajectory.
    """
    times = planned.robot_time(pair.edges)
    q, v, _, _ = planned.states(times, pair.body)
    paths = [transfer.path for transfer in transfers]
    mean = np.array([path.length for path in paths]) / np.diff(times)
    fastest = np.minimum(np.append(mean, mean[-1]), np.append(mean[0], mean)) * _MONOTONE
    speed = np.minimum(speeds_at(metric_of(pair.robot), q, v), fastest)
    found = []
    for group, path, span, ends in zip(
        pair.groups, paths, pairwise(times), pairwise(speed), strict=True
    ):
        law = time_law(path.length, float(span[1] - span[0]), *ends, monotone=True)
        found.append(Synergy(group.start, group.stop, float(span[0]), path, law))
    return tuple(found)


def compare_under_equal_limits(
    planned: PlannedTrajectory,
    motion: Motion,
    mapping: PoseMapping,
    *,
    arm: int = 0,
    rate: float = 100.0,
    turning: bool = True,
    placing: bool = True,
    starts: ArrayLike | None = None,
    body: PairedArm | None = None,
) -> dict[str, MotionMeasures]:
    """Return measures of an arm's planned motion, and of inverse kinematics of the person's hand.

    The person's time at a time of the robot is interpolated between the ends of synergies, monotone
    and without jumps of its rate (Fritsch, Carlson, SIAM J. Numerical Analysis 17, 1980).

    Args:
        planned: the motion of all arms.
        motion: the person's.
        mapping: mapping of its hand to the robot's.
        arm: number of the arm.
        rate: rate of the samples and of inverse kinematics [Hz].
        turning, placing, starts: of inverse kinematics, see `compare_with_tracking`.
        body: the hand of a body whose errors are measured; its other hands are tracked with it.

    Returns:
        Measures by the name of the method, see `measures_table`.
    """
    own = planned.arms[arm]
    robot = own.robot if body is None else own.robot.with_hand(body.robot.hand)
    trajectory = planned.sampled(rate, arm)
    clock = PchipInterpolator(planned.robot_edges, planned.edges)
    recorded = clock(np.minimum(trajectory.time, planned.robot_edges[-1]))

    def posture(instants: Array) -> Array:
        return motion(np.clip(instants, *motion.time[[0, -1]]))

    offsets = None
    if has_elbow(robot, mapping.target) and has_elbow(mapping.model, mapping.source):
        offset = elbow_function(robot, mapping.target)
        offsets = (
            lambda q: np.asarray(offset(q.T).full().T),
            lambda instants: mapping.elbow_offsets(posture(instants)),
        )
    return compare_with_tracking(
        robot,
        trajectory,
        recorded,
        lambda instants: mapping(posture(instants)),
        own.limits,
        gravity=own.gravity,
        together=None
        if body is None
        else (body.hands, lambda instants: body.mapped(posture(instants))),
        elbow_offsets=offsets,
        turning=turning,
        placing=placing,
        starts=starts,
    )
