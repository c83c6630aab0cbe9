"""Waypoints of one arm, the time between them, and the terms of its configurations there.

An elbow's offset is the part of shoulder to elbow perpendicular to shoulder to wrist, relative to
the length of the arm. It turns with the swivel angle (Tolani, Goswami, Badler, Graphical Models 62,
2000) and vanishes with the straight arm, where that angle is not defined.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.blocks import Terms
from geodesic_ocp.execution.limits import JointLimits
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.pose_search import rotation_log
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.key_poses import (
    PairedArm,
    Pose,
    PoseMapping,
    checked_start,
    middle_of_ranges,
    with_narrowed_limits,
)

_SHORTEST = 1e-4  # [m^2], squared distance from the shoulder to the wrist


def has_elbow(model: Model, alignment: Alignment) -> bool:
    """Return whether the alignment names joints of the model as its elbow and its wrist."""
    names = alignment.elbow, alignment.wrist
    return all(name is not None and model.pin.existFrame(name) for name in names)


def elbow_offset(model: Model, alignment: Alignment, q: Any) -> ca.SX:
    """Return offset (3, 1) of the elbow in the axes of the base, in lengths of the arm."""
    shoulder = ca.DM(np.asarray(alignment.shoulder))
    _, elbow = model.frame_pose(str(alignment.elbow), q)
    _, wrist = model.frame_pose(str(alignment.wrist), q)
    upper, whole = elbow - shoulder, wrist - shoulder
    along = ca.dot(upper, whole) / (ca.sumsqr(whole) + _SHORTEST)
    offset: ca.SX = (upper - along * whole) / alignment.length
    return offset


def mapped_offsets(mapping: PoseMapping, q: Array) -> Array:
    """Return the person's elbow offsets (k, 3), in the axes of the robot's base, at q (k, n)."""
    source, target = mapping.source, mapping.target
    symbol = ca.SX.sym("q", mapping.model.dof)
    function = ca.Function("offset", [symbol], [elbow_offset(mapping.model, source, symbol)])
    offsets = np.atleast_2d(function(q.T).full().T)
    in_person = offsets @ np.asarray(source.base)
    if mapping.mirror:
        in_person = in_person * np.array([-1.0, 1.0, 1.0])
    return np.asarray(in_person @ np.asarray(target.base).T)


@dataclass(frozen=True)
class ObjectiveWeights:
    """Weights and units of the objective's terms.

    The objective is action / `action` + `stretch` times the time added / `duration`, plus the means
    over the waypoints of `posture` times the mean squared distance of the joints from the middle of
    their ranges, in half ranges, and of `likeness` times the squared distance of the elbow's offset
    from the person's, in lengths of the arm.

    Attributes:
        action: unit of the action [J s].
        duration: duration of the recording's part [s].
        stretch, posture, likeness: weights.
        detour: weight in the graph alone, of the squared distance of the hand from the person's
            halfway through the movements, mean over these.
    """

    action: float
    duration: float
    stretch: float
    posture: float
    likeness: float
    detour: float


_GRAVITY = 9.81  # [m/s^2]
# A joint that holds the arm with more than this share of its torque is too weak to move it; cost
# of the squared excess.
_SHARE, _WEAK = 0.8, 300.0
NUM_PARAMETERS = 12 + 6 + 3 + 2


def parameters(
    pose: Pose, missed: Array, offset: Array | None, posture: float, likeness: float
) -> Array:
    """Return the parameters of a waypoint.

    Args:
        pose: pose of the hand.
        missed: weights of the squared pose errors (6,); zero for a pose within reach.
        offset: offset of the person's elbow (3,); None: not known.
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
    """Return torques that hold the arm still, of the joints with a limit, by their numbers."""
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
    """Return costs and pose errors of an arm, for these rows of the error and limits on torque
    (n,).
    """
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


_PEAK, _BRAKING = 1.5, 5.0


@dataclass(frozen=True, eq=False, repr=False)
class ArmWaypoints(ShortRepr):
    """Poses that the hand of one arm passes, one after the other.

    Attributes:
        arm: the robot; its limits bound the paths.
        limited: whether they do.
        alignment: alignment with a person's arm.
        begins, ends: times [s] in the recording at which the m movements begin and end, (m,) each;
            between two movements the arm rests.
        poses: poses of the hand at the start and at the end of each movement, m + 1 of them.
        between: poses of the person's hand, mapped to the robot, halfway through each movement.
        start: configuration (n,) to begin in; None: any with the first pose.
        limits: limits of the joints.
        offsets: offsets of the person's elbow at the waypoints (m + 1, 3), see `elbow_offset`;
            None: not known.
        near_misses: errors of poses [m], [rad] that are accepted to avoid a detour.
        weights: weights of position and orientation errors [1/m], [1/rad], for poses out of reach.
    """

    arm: Model
    limited: bool
    alignment: Alignment
    begins: Array
    ends: Array
    poses: tuple[Pose, ...]
    between: tuple[Pose, ...]
    start: Array | None
    limits: JointLimits
    offsets: Array | None
    near_misses: float = 0.0
    weights: tuple[float, float] = (1.0, 1.0)
    _shown = ("arm", "limited", "count")

    @property
    def durations(self) -> Array:
        """Durations of the movements (m,) [s]."""
        return np.asarray(self.ends - self.begins)

    @property
    def speed(self) -> Array:
        """Largest mean speed of the joints in each movement (m, n); infinite without limits.

        From rest to rest the peak of a speed is 1.5 times its mean, and an acceleration a, first
        forward and then backward, allows a mean speed of a T / 4 over a time T, and limited jerk
        less.
        """
        by_acceleration = self.limits.acceleration * self.durations[:, None] / _BRAKING
        return np.minimum(self.limits.velocity / _PEAK, by_acceleration)

    @property
    def count(self) -> int:
        """Number m of movements."""
        return len(self.begins)

    @property
    def rows(self) -> tuple[int, ...]:
        """Return which of the six rows of the pose error count."""
        first = self.poses[0]
        place = () if first.position is None else (0, 1, 2)
        return (*place, *(() if first.rotation is None else (3, 4, 5)))

    @property
    def row_weights(self) -> Array:
        """Weights of those rows."""
        return np.repeat(self.weights, 3)[list(self.rows)]

    @property
    def terms(self) -> Terms:
        """Costs and pose errors of the configurations at the waypoints."""
        torque = tuple(self.limits.torque.tolist())
        return waypoint_terms(self.arm, self.alignment, self.rows, torque)


def arm_waypoints(pair: PairedArm, start: ArrayLike | None, tolerance: float) -> ArmWaypoints:
    """Return the waypoints of a person's motion on a robot.

    Args:
        pair: person and robot.
        start: configuration (n,) to begin in; None: any with the first pose.
        tolerance: tolerance of the paths' conditions.

    Raises:
        ValueError: the start is out of range.
    """
    settings, mapping, motion = pair.settings, pair.mapping, pair.analysis.motion
    moving = [group for group in pair.groups if group.kind != "rest"]
    samples = [pair.groups[0].start, *(group.stop for group in moving)]
    begins = motion.time[[group.start for group in moving]]
    ends = motion.time[samples[1:]]
    if not moving:  # it stays at the first pose, planned as a path without length
        begins, ends, samples = pair.edges[:1], pair.edges[-1:], samples * 2
    between = mapping(motion((begins + ends) / 2.0))
    offsets = None
    if has_elbow(mapping.model, mapping.source):
        offsets = mapped_offsets(mapping, motion.q[samples])
    within = settings.within_limits
    return ArmWaypoints(
        arm=with_narrowed_limits(pair.robot, tolerance) if within else pair.robot,
        limited=within,
        alignment=mapping.target,
        begins=begins,
        ends=ends,
        poses=tuple(pair.target(sample) for sample in samples),
        between=tuple(pair.as_pose(*each) for each in zip(*between, strict=True)),
        start=None if start is None else checked_start(pair.robot, start, settings),
        limits=pair.limits,
        offsets=offsets,
        near_misses=settings.near_misses,
        weights=settings.pose_weights,
    )
