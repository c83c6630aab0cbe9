"""A robot's motion beside inverse kinematics under the same limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.joint_limits import JointLimits
from geodesic_ocp.execution.tracking.motion_measures import MotionMeasures, motion_measures
from geodesic_ocp.execution.tracking.track_within_limits import Solver, track_within_limits
from geodesic_ocp.model.model import Model
from geodesic_ocp.synergies.baselines.track_hand import Poses
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

_NAMES = {"built-in": "inverse kinematics (QP)", "pink": "inverse kinematics (pink)"}
# Offsets of the elbow (k, 3), of the robot in configurations (k, n), of the person at times (k,).
ElbowOffsets = tuple[Callable[[Array], Array], Callable[[Array], Array]]


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
    solvers: Sequence[Solver] = ("built-in",),
    name: str = "geodesic synergies",
) -> dict[str, MotionMeasures]:
    """Measures of a trajectory, and of inverse kinematics that tracks the hand (`measures_table`).

    All begin in one configuration and are under the same limits on joints, speeds and
    accelerations, from rest to rest. The hand is tracked in the time of the trajectory, and once
    more in the person's own time.

    Args:
        robot: the arm, payload included.
        trajectory: evenly sampled.
        recorded: times in the recording to which its k samples correspond (k,) [s].
        poses: of the hand, mapped from the person, as a function of times in the recording.
        limits: of the joints.
        gravity: acceleration of free fall in the axes of the robot's base (3,) [m/s^2].
        elbow_offsets: of the robot and of the person, in lengths of the arm.
        turning, placing, solvers: of inverse kinematics, see `track_within_limits`.
        name: of the trajectory.

    Raises:
        ValueError: uneven samples, or arguments of the wrong shape.
    """
    rate, time = trajectory.rate, np.array(recorded, dtype=float)
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

    found = {name: measured(trajectory, time)}
    own = trajectory.time[0] + np.array([0.0, time[-1] - time[0]])
    for solver in solvers:
        for suffix, span, at in (
            ("", trajectory.time, time),
            (", the person's time", own, own - own[0] + time[0]),
        ):

            def in_time(instants: Array, span: Array = span, at: Array = at) -> tuple[Array, Array]:
                return poses(np.interp(instants, span, at))

            tracked = track_within_limits(
                *(robot, trajectory.positions[0], span, in_time, limits),
                rate=rate,
                turning=turning,
                placing=placing,
                solver=solver,
            )
            targets = np.interp(tracked.time + span[0], span, at)
            found[_NAMES[solver] + suffix] = measured(tracked, targets)
    return found
