"""Measures by which motions of a robot are compared, and inverse kinematics beside a motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.execution.check_trajectory import check_trajectory
from geodesic_ocp.execution.limits import QUANTITIES, JointLimits
from geodesic_ocp.execution.track_within_limits import track_within_limits
from geodesic_ocp.manifold.metric import speeds_at
from geodesic_ocp.manifold.metrics import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.synergies.baselines import Poses
from geodesic_ocp.synergies.scores import pose_differences
from geodesic_ocp.tables import new_table
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

if TYPE_CHECKING:
    from pandas import DataFrame

_HIGHEST = 10.0  # [Hz]
_LEAST = 0.05  # of the largest amplitude: higher frequencies are cut off from there on
_PADDING = 4  # powers of two
_COLUMNS = {  # of `measures_table`
    "time [s]": "duration",
    "action [J s]": "action",
    "torque, rms [N m]": "torque",
    "jerk, rms [rad/s^3]": "jerk",
    "smoothness of the hand": "smoothness",
    "elbow, beside the person's [arm length]": "elbow",
    "hand, mean [m]": "position",
    "largest [m]": "largest_position",
    "hand, mean [rad]": "rotation",
    "largest [rad]": "largest_rotation",
    "outside joint limits [rad or m]": "outside",
}
_TRACKED = "inverse kinematics (QP)"
# Offsets of the elbow (k, 3), of the robot in configurations (k, n), of the person at times (k,).
ElbowOffsets = tuple[Callable[[Array], Array], Callable[[Array], Array]]


def spectral_arc_length(speed: Array, rate: float) -> float:
    """Return minus the length of the normalized amplitude spectrum of a speed (k,) sampled at a
    rate [Hz].

    Nearer to zero for smoother movements, independent of amplitude and duration. By Balasubramanian
    et al., "On the analysis of movement smoothness", J. NeuroEngineering and Rehabilitation 12
    (2015), with its parameters: up to 10 Hz, as long as the amplitude is at least 0.05. NaN without
    any movement.
    """
    size = 2 ** (int(np.ceil(np.log2(speed.size))) + _PADDING)
    amplitude = np.abs(np.fft.rfft(speed, size))
    if not amplitude.max() > 0.0:
        return float("nan")
    amplitude = (amplitude / amplitude.max())[np.fft.rfftfreq(size, 1.0 / rate) <= _HIGHEST]
    last = int(np.flatnonzero(amplitude >= _LEAST)[-1])
    rises = np.diff(amplitude[: last + 1])
    return -float(np.sum(np.hypot(1.0 / max(last, 1), rises)))


@dataclass(frozen=True, repr=False)
class MotionMeasures(ShortRepr):
    """Measures of one motion of a robot.

    Attributes:
        duration: [s].
        action: int 1/2 |q'|_G^2 dt [J s].
        torque: root mean square over time of the norm of the joints' torques, gravity included
            [N m].
        jerk: likewise of their jerk, from sample to sample [rad/s^3].
        smoothness: spectral arc length of the hand's speed; nearer to zero is smoother.
        elbow: mean distance of the elbow's offset from the person's, in lengths of the arm; NaN
            where it is not known.
        position, largest_position: distance of the hand from its target, mean and largest [m].
        rotation, largest_rotation: angle between them [rad].
        outside: largest excess of a joint over its range [rad or m].
        usage: largest share of the limits, by "velocity", "acceleration", "jerk" and "torque".
    """

    duration: float
    action: float
    torque: float
    jerk: float
    smoothness: float
    elbow: float
    position: float
    largest_position: float
    rotation: float
    largest_rotation: float
    outside: float
    usage: Mapping[str, float]

    _shown = ("duration", "action", "torque", "position", "rotation", "usage")


def motion_measures(
    robot: Model,
    trajectory: JointTrajectory,
    targets: tuple[Array, Array],
    limits: JointLimits,
    *,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
    elbow_offsets: tuple[Array, Array] | None = None,
) -> MotionMeasures:
    """Return measures of a trajectory whose hand should pass targets.

    Jerk depends on the rate of the samples: compare trajectories of one rate.

    >>> import numpy as np
    >>> import geodesic_ocp as go
    >>> arm, q = go.human_arm(), [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1]
    >>> path = go.geodesic(go.KineticEnergy(arm), q, [1.2, -0.2, -0.9, 1.6, -0.3, 0.1, 0.4])
    >>> limits = go.execution.joint_limits(arm, velocity=4.0, acceleration=20.0, jerk=400.0)
    >>> paths = go.execution.ArmPaths(arm, limits, np.array([0.0, 1.0]), [path])
    >>> planned = go.execution.plan_trajectory(paths)
    >>> trajectory = planned.sampled(100.0)
    >>> targets = arm.hand_pose(trajectory.positions)
    >>> measures = go.execution.motion_measures(arm, trajectory, targets, limits)
    >>> measures.duration, round(measures.action, 2), measures.position
    (1.0, 0.21, 0.0)

    Args:
        robot: the arm, payload included.
        trajectory: trajectory of its joints, evenly sampled.
        targets: rotations (k, 3, 3) and positions (k, 3) [m] of the hand at the k samples.
        limits: limits of the joints.
        gravity: acceleration of free fall in the axes of the robot's base (3,) [m/s^2].
        elbow_offsets: where the elbow is beside the line from shoulder to hand at the samples, of
            the robot and of the person, (k, 3) each, in lengths of the arm.

    Raises:
        ValueError: uneven samples, or arrays of another shape.
    """
    rate = trajectory.rate
    count = len(trajectory.time)
    if rate is None:
        raise ValueError("trajectory must be sampled evenly; see JointTrajectory.at_rate")
    rotations, positions = targets
    if rotations.shape != (count, 3, 3) or positions.shape != (count, 3):
        raise ValueError(
            f"targets must be rotations ({count}, 3, 3) and positions ({count}, 3), got shapes "
            f"{rotations.shape} and {positions.shape}"
        )
    q = trajectory.positions
    v = trajectory.velocities
    a = trajectory.accelerations
    poses = robot.hand_pose(q)
    distance, angle = pose_differences(poses, targets)
    hand_speed = np.linalg.norm(np.gradient(poses[1], axis=0), axis=1) * rate
    offsets = np.full((1, 3), np.nan)
    if elbow_offsets is not None:
        offsets = elbow_offsets[0] - elbow_offsets[1]
    usage = check_trajectory(trajectory, robot, limits, gravity=gravity).usage
    power = speeds_at(KineticEnergy(robot), q, v) ** 2 / 2.0
    return MotionMeasures(
        duration=trajectory.duration,
        action=float(np.trapezoid(power, trajectory.time)),
        torque=_root_mean_square(robot.inverse_dynamics(q, v, a, gravity)),
        jerk=_root_mean_square(np.diff(a, axis=0) * rate),
        smoothness=spectral_arc_length(hand_speed, rate),
        elbow=float(np.linalg.norm(offsets, axis=1).mean()),
        position=float(distance.mean()),
        largest_position=float(distance.max()),
        rotation=float(angle.mean()),
        largest_rotation=float(angle.max()),
        outside=max(0.0, float(np.max([robot.lower - q, q - robot.upper]))),
        usage={name: float(usage[name].max()) for name in (*QUANTITIES, "hand_speed")},
    )


def measures_table(measures: Mapping[str, MotionMeasures]) -> DataFrame:
    """Return one row for each motion by its name."""
    # few robots have these limits
    rows = []
    rare = ("torque_rate", "hand_speed")
    some = [kind for kind in rare if any(each.usage[kind] for each in measures.values())]
    kinds = [*QUANTITIES[:4], *some]
    for name, each in measures.items():
        values = [getattr(each, attribute) for attribute in _COLUMNS.values()]
        shares = [each.usage[kind] for kind in kinds]
        rows.append((name, *values, *shares))
    header = ("motion", *_COLUMNS, *(f"{kind} [limit]" for kind in kinds))
    return new_table(header, rows)


def _root_mean_square(values: Array) -> float:
    """Return the root mean square of the norms of the rows (k, n)."""
    return float(np.sqrt(np.mean(np.sum(values**2, axis=1))))


def compare_with_tracking(
    robot: Model,
    trajectory: JointTrajectory,
    recorded: ArrayLike,
    poses: Poses,
    limits: JointLimits,
    *,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
    elbow_offsets: ElbowOffsets | None = None,
    turning: bool = True,
    placing: bool = True,
    starts: ArrayLike | None = None,
    together: tuple[Sequence[str], Poses] | None = None,
) -> dict[str, MotionMeasures]:
    """Return measures of a trajectory, and of inverse kinematics that tracks the hand
    (`measures_table`).

    All are under the same limits on joints, speeds and accelerations, from rest to rest. The hand
    is tracked in the time of the trajectory, and once more in the person's own time.

    >>> import numpy as np
    >>> import geodesic_ocp as go
    >>> arm, q = go.human_arm(), [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1]
    >>> path = go.geodesic(go.KineticEnergy(arm), q, [1.2, -0.2, -0.9, 1.6, -0.3, 0.1, 0.4])
    >>> limits = go.execution.joint_limits(arm, velocity=4.0, acceleration=20.0, jerk=400.0)
    >>> paths = go.execution.ArmPaths(arm, limits, np.array([0.0, 1.0]), [path])
    >>> planned = go.execution.plan_trajectory(paths)
    >>> trajectory = planned.sampled(100.0)
    >>> poses = lambda times: arm.hand_pose(path(times))  # of a recording of 1 s
    >>> list(go.execution.compare_with_tracking(arm, trajectory, trajectory.time, poses, limits))
    ['geodesic synergies', 'inverse kinematics (QP)', "inverse kinematics (QP), the person's time"]

    Args:
        robot: the arm, payload included.
        trajectory: evenly sampled.
        recorded: times in the recording to which its k samples correspond (k,) [s].
        poses: poses of the hand, mapped from the person, as a function of times in the recording.
        limits: limits of the joints.
        gravity: acceleration of free fall in the axes of the robot's base (3,) [m/s^2].
        elbow_offsets: elbow offsets of the robot and of the person, in lengths of the arm.
        turning, placing: settings of inverse kinematics, see `track_within_limits`.
        starts: where it begins, likewise; None: where the trajectory begins.
        together: all hands of a body, that are tracked with this one, and their stacked poses, see
            `track_within_limits`.

    Raises:
        ValueError: uneven samples, or arguments of the wrong shape.
    """
    rate = trajectory.rate
    time = np.array(recorded, dtype=float)
    if rate is None or time.shape != trajectory.time.shape:
        raise ValueError(
            f"trajectory must be sampled evenly, and recorded have shape {trajectory.time.shape}, "
            f"got {time.shape}"
        )

    def measured(motion: JointTrajectory, at: Array) -> MotionMeasures:
        offsets = None
        if elbow_offsets is not None:
            offsets = elbow_offsets[0](motion.positions), elbow_offsets[1](at)
        return motion_measures(
            robot, motion, poses(at), limits, gravity=gravity, elbow_offsets=offsets
        )

    found = {"geodesic synergies": measured(trajectory, time)}
    hands, tracked_poses = ((), poses) if together is None else together
    begin = trajectory.positions[0] if starts is None else starts
    own = trajectory.time[0] + np.array([0.0, time[-1] - time[0]])
    clocks = {"": (trajectory.time, time), ", the person's time": (own, time[[0, -1]])}
    for suffix, clock in clocks.items():

        def in_time(instants: Array, clock: tuple[Array, Array] = clock) -> tuple[Array, Array]:
            return tracked_poses(np.interp(instants, *clock))

        tracked = track_within_limits(
            robot,
            begin,
            clock[0],
            in_time,
            limits,
            rate=rate,
            turning=turning,
            placing=placing,
            hands=hands,
        )
        targets = np.interp(tracked.time + clock[0][0], *clock)
        found[_TRACKED + suffix] = measured(tracked, targets)
    return found
