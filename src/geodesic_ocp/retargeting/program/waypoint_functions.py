"""Terms of a configuration at a waypoint: pose error, posture, likeness, torque of gravity."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Terms
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.ik.pose_error import rotation_log
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.poses.targets import Pose, middle_of_ranges
from geodesic_ocp.retargeting.program.elbow_offset import elbow_offset, has_elbow

_GRAVITY = 9.81  # [m/s^2]
# A joint that holds the arm with more than this share of its torque is too weak to move it; cost
# of the squared excess.
_SHARE, _WEAK = 0.8, 300.0
NUM_PARAMETERS = 12 + 6 + 3 + 2


def parameters(
    pose: Pose, missed: Array, offset: Array | None, posture: float, likeness: float
) -> Array:
    """The parameters of a waypoint.

    Args:
        pose: of the hand.
        missed: weights of the squared pose errors (6,); zero for a pose within reach.
        offset: of the person's elbow (3,); None: not known.
        posture, likeness: weights of these terms.
    """
    position = np.zeros(3) if pose.position is None else pose.position
    rotation = np.eye(3) if pose.rotation is None else pose.rotation
    known = offset is not None
    return np.concatenate(
        [
            *(position, rotation.ravel(order="F"), missed),
            *(offset if known else np.zeros(3), [posture, likeness if known else 0.0]),
        ]
    )


def limited_torques(
    arm: Model, alignment: Alignment, q: ca.SX, torque: tuple[float, ...]
) -> list[tuple[int, ca.SX]]:
    """Torques that hold the arm still, of the joints with a limit, by their numbers."""
    limited = np.flatnonzero(np.isfinite(torque)).tolist()
    if not limited:
        return []
    still = ca.SX.zeros(arm.dof)
    held = arm.inverse_dynamics(q, still, still, -_GRAVITY * np.asarray(alignment.base)[:, 2])
    return [(joint, held[joint]) for joint in limited]


@lru_cache(maxsize=32)
def waypoint_terms(
    arm: Model, alignment: Alignment, rows: tuple[int, ...], torque: tuple[float, ...]
) -> Terms:
    """Costs and pose errors of an arm, for these rows of the error and limits on torque (n,)."""
    q, p = ca.SX.sym("q", arm.dof), ca.SX.sym("p", NUM_PARAMETERS)
    position, rotation, missed, offset, weights = ca.vertsplit(p, [0, 3, 12, 18, 21, 23])
    hand_rotation, hand_position = arm.hand_pose(q)
    error = ca.vertcat(
        hand_position - position, rotation_log(ca.reshape(rotation, 3, 3).T @ hand_rotation)
    )
    middle, half = middle_of_ranges(arm)
    cost = ca.dot(missed, error**2) + weights[0] * ca.sumsqr((q - middle) / half) / arm.dof
    if has_elbow(arm, alignment):
        cost += weights[1] * ca.sumsqr(elbow_offset(arm, alignment, q) - offset)
    for joint, held in limited_torques(arm, alignment, q, torque):
        cost += _WEAK * ca.fmax(0.0, ca.fabs(held / torque[joint]) - _SHARE) ** 2
    return Terms(q, p, cost, error[list(rows)])
