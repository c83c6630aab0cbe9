"""A retargeted motion beside inverse kinematics under the same limits."""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy.interpolate import PchipInterpolator

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.motion_measures import (
    ElbowOffsets,
    MotionMeasures,
    compare_with_tracking,
)
from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory
from geodesic_ocp.retargeting.key_poses import PoseMapping
from geodesic_ocp.retargeting.waypoints import (
    elbow_offset,
    has_elbow,
    mapped_offsets,
)
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion


def compare_under_equal_limits(
    planned: PlannedTrajectory,
    motion: Motion,
    mapping: PoseMapping,
    *,
    arm: int = 0,
    rate: float = 100.0,
    turning: bool = True,
    placing: bool = True,
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
        turning, placing: turning and placing of inverse kinematics, see `track_within_limits`.

    Returns:
        Measures by the name of the method, see `measures_table`.
    """
    own = planned.arms[arm]
    robot = own.robot
    time = np.arange(int(np.ceil(planned.duration * rate - 1e-6)) + 1) / rate
    q, v, a, _ = planned.states(time, arm)
    if planned.rest:
        v[-1] = a[-1] = 0.0
    trajectory = JointTrajectory(time, q, v, a, robot.joint_names, robot.units)
    clock = PchipInterpolator(planned.robot_edges, planned.edges)
    recorded = clock(np.minimum(time, planned.robot_edges[-1]))

    def poses(instants: Array) -> tuple[Array, Array]:
        return mapping(motion(np.clip(instants, motion.time[0], motion.time[-1])))

    return compare_with_tracking(
        *(robot, trajectory, recorded, poses, own.limits),
        gravity=own.gravity,
        elbow_offsets=_elbow_offsets(mapping, motion, planned, arm),
        turning=turning,
        placing=placing,
    )


def _elbow_offsets(
    mapping: PoseMapping, motion: Motion, planned: PlannedTrajectory, arm: int
) -> ElbowOffsets | None:
    """Return offsets of the elbows of the robot and of the person, if both are known."""
    robot = planned.arms[arm].robot
    if not (has_elbow(robot, mapping.target) and has_elbow(mapping.model, mapping.source)):
        return None
    symbol = ca.SX.sym("q", robot.dof)
    offset = ca.Function("offset", [symbol], [elbow_offset(robot, mapping.target, symbol)])

    def of_robot(q: Array) -> Array:
        return np.asarray(offset(q.T).full().T)

    def of_person(instants: Array) -> Array:
        return mapped_offsets(mapping, motion(np.clip(instants, motion.time[0], motion.time[-1])))

    return of_robot, of_person
