"""Waypoints of a robot: poses of its hands at the ends of movements, and their costs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import cast

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.blocks import Terms
from geodesic_ocp.execution.limits import JointLimits
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.pose_search import (
    rotation_log,
    stacked_error,
)
from geodesic_ocp.retargeting.arm_alignment import Alignment
from geodesic_ocp.retargeting.paired_arm import (
    PairedArm,
    Pose,
    elbow_offset,
    gravity_on,
    has_elbow,
    middle_of_ranges,
    waist_turn,
    with_narrowed_limits,
)


@dataclass(frozen=True)
class ObjectiveWeights:
    """Weights and units of the objective's terms.

    The objective is action / `action` + `stretch` times the time added / `duration`, plus the means
    over the waypoints of `posture` times the mean squared distance of the joints from the middle of
    their ranges, in half ranges, and of `likeness` times the squared distance of the elbow's offset
    from the person's, in lengths of the arm; of a body with a waist, times the mean of that over
    the hands and the squared angle [rad] between the turns of the thorax and of the waist.

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


# A joint that holds the arm with more than the first share of its torque is too weak to move it,
# one with more than the second nearly so to hold it. Costs of the squared excess, linear from some
# 0.05 on.
WEAK = (0.8, 300.0)
TOO_WEAK = (0.95, 1e4)
_EXCESS = 0.05


def weakness(
    arm: Model,
    q: ca.SX,
    torque: Sequence[float],
    gravity: Array | ca.SX,
    costs: Sequence[tuple[float, float]] = (WEAK, TOO_WEAK),
) -> ca.SX:
    """Return the cost of joints that holding the arm takes much of their limits on torque (n,)."""
    cost = ca.SX(0.0)
    if limited := np.flatnonzero(np.isfinite(torque)).tolist():
        still = ca.SX.zeros(arm.dof)
        held = arm.inverse_dynamics(q, still, still, gravity)
        for joint in limited:
            for share, weight in costs:
                excess = ca.fmax(0.0, ca.fabs(held[joint] / torque[joint]) - share) / _EXCESS
                cost += 2.0 * weight * _EXCESS**2 * (ca.sqrt(1.0 + excess**2) - 1.0)
    return cost


@lru_cache(maxsize=32)
def _waypoint_terms(
    arm: Model,
    hands: tuple[str, ...],
    elbows: tuple[tuple[float, None, str | None, str | None], ...],
    rows: tuple[int, ...],
    torque: tuple[float, ...],
) -> Terms:
    """Return costs of an arm, these rows of the pose errors, and the squared distance and angle of
    each hand, for limits on torque (n,), wherever the arm is mounted.

    Of each arm `elbows` has length, side, elbow and wrist, see `Alignment`.
    """
    count = len(hands)
    edges = np.cumsum([0, *np.array([3, 9, 6, 3, 3]) * count, 9, 3, 3]).tolist()  # see `parameters`
    q = ca.SX.sym("q", arm.dof)
    p = ca.SX.sym("p", edges[-1])
    position, rotation, missed, offset, shoulder, turn, gravity, weights = ca.vertsplit(p, edges)
    rotation = ca.reshape(rotation, 3 * count, 3)
    error = stacked_error(arm, hands, q, position, rotation, ca.SX.eye(3))
    middle, half = middle_of_ranges(arm)
    cost = ca.dot(missed, error**2) + weights[0] * ca.sumsqr((q - middle) / half) / arm.dof
    for number, elbow in enumerate(elbows):
        alignment = Alignment(np.zeros(3), np.eye(3), np.eye(3), *elbow)
        if has_elbow(arm, alignment):
            own = slice(3 * number, 3 * number + 3)
            off = elbow_offset(arm, alignment, q, shoulder[own]) - offset[own]
            cost += weights[1] / count * ca.sumsqr(off)
    if arm.shared_joints:
        beside = ca.reshape(turn, 3, 3).T @ waist_turn(arm, q)
        cost += weights[2] * ca.sumsqr(rotation_log(beside))
    cost += weakness(arm, q, torque, gravity)
    # Of poses that may be missed, distance and angle are bounded, by their squares.
    squares = [ca.sumsqr(each) for each in ca.vertsplit(error, 3)]
    return Terms(q, p, cost, ca.vertcat(error[list(rows)], *squares))


_PEAK = 1.5
_BRAKING = 5.0
_ROOM = 2e-3  # [rad or m] that nodes keep from the limits, for what lies between them


@dataclass(frozen=True, eq=False, repr=False)
class ArmWaypoints(ShortRepr):
    """Poses that the hand of one arm, or the hands of a body, pass one after the other.

    Attributes:
        arm: the robot; its limits bound the paths.
        limited: whether they do.
        alignment: alignment with a person's arm.
        begins, ends: times [s] in the recording at which the m movements begin and end, (m,) each;
            between two movements the arm rests.
        poses: poses of the hands at the start and at the end of each movement, m + 1 of them.
        target_at: poses of the person's hands, mapped to the robot, after so many movements (k,):
            0.5 is halfway through the first, by the person's progress.
        start: configuration (n,) to begin in; None: any with the first pose.
        limits: limits of the joints.
        offsets: offsets of the person's h elbows at the waypoints (m + 1, 3 h), see `elbow_offset`;
            None: not known.
        allowed: distance [m] and angle [rad] by which each pose may be missed, m + 1 of them;
            empty: not at all.
        weights: weights of position and orientation errors [1/m], [1/rad], for poses out of reach.
        path_tolerance: see `RetargetingSettings`.
        others: alignments of the other hands of a body, in the order of its hands, of which
            `alignment` is that of the first.
        room: by how much [rad or m] paths may leave the limits of `arm` between their nodes.
        turns: rotations of the person's thorax from upright at the waypoints (m + 1, 3, 3), in axes
            of the base; None: not known.
    """

    arm: Model
    limited: bool
    alignment: Alignment
    begins: Array
    ends: Array
    poses: tuple[Pose, ...]
    target_at: Callable[[Array], tuple[Pose, ...]]
    start: Array | None
    limits: JointLimits
    offsets: Array | None
    allowed: tuple[tuple[float, float], ...] = ()
    weights: tuple[float, float] = (1.0, 1.0)
    path_tolerance: tuple[float, float] = (np.inf, np.inf)
    others: tuple[Alignment, ...] = ()
    turns: Array | None = None
    room: float = 0.0
    _shown = ("arm", "limited", "count")

    @property
    def hands(self) -> tuple[str, ...]:
        """Names of the hands."""
        return self.arm.hands if self.others else (self.arm.hand,)

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

    def needed_times(self, changes: Array) -> Array:
        """Return the least times (..., n) [s] in which joints move by changes (..., n), from rest
        at one end through the other: with the largest acceleration up to the largest speed.

        As neighbours help, and limits of jerk hinder, these predict the trajectory's times well.
        """
        v = self.limits.velocity
        a = self.limits.acceleration
        way = np.abs(changes)
        with np.errstate(invalid="ignore"):  # without limits, no time is needed
            reached = v / (2.0 * a)
            times = np.where(way <= v * reached, np.sqrt(2.0 * way / a), way / v + reached)
        return np.nan_to_num(times)

    @property
    def count(self) -> int:
        """Number m of movements."""
        return len(self.begins)

    @property
    def rows(self) -> tuple[int, ...]:
        """Return which rows of the pose errors count, of six for each hand."""
        first = self.poses[0]
        place = () if first.position is None else (0, 1, 2)
        own = (*place, *(() if first.rotation is None else (3, 4, 5)))
        return tuple(6 * number + row for number in range(len(self.hands)) for row in own)

    def is_allowed(self, number: int, q: Array) -> NDArray[np.bool_]:
        """Return whether configurations (k, n) miss a waypoint's pose by no more than allowed."""
        bound = self.allowed[number] if self.allowed else (0.0, 0.0)
        distances, angles = self.poses[number].errors(self.arm, q)
        return np.asarray(((distances <= bound[0]) & (angles <= bound[1])).all(axis=1))

    def strong_enough(self, q: Array) -> NDArray[np.bool_]:
        """Return whether joints can hold the arm at configurations (k, n), (k,)."""
        still = np.zeros_like(q)
        gravity = gravity_on(self.alignment)
        held = np.abs(self.arm.inverse_dynamics(q, still, still, gravity))
        return np.asarray(np.all(held <= self.limits.torque, axis=1))

    @property
    def path_limits(self) -> tuple[Array, Array]:
        """Limits of the joints along the paths (n,)."""
        lower = self.arm.lower
        upper = self.arm.upper
        room = np.minimum(self.room, (upper - lower) / 2.0)
        return lower - room, upper + room

    @cached_property
    def halfway(self) -> tuple[Pose, ...]:
        """Poses of the person's hands halfway through the m movements."""
        return self.target_at(np.arange(0.5, self.count))

    @property
    def row_weights(self) -> Array:
        """Weights of those rows."""
        return np.asarray(np.repeat(self.weights, 3)[np.array(self.rows) % 6])

    @property
    def terms(self) -> Terms:
        """Costs and pose errors of the configurations at the waypoints."""
        torque = tuple(self.limits.torque.tolist())
        elbows = tuple((each.length, None, each.elbow, each.wrist) for each in self._alignments)
        return _waypoint_terms(self.arm, self.hands, elbows, self.rows, torque)

    @property
    def _alignments(self) -> tuple[Alignment, ...]:
        return (self.alignment, *self.others)

    def likeness(self, number: int, weights: ObjectiveWeights) -> tuple[Array, Array, list[float]]:
        """Return the elbows' offsets (3 h,) at a waypoint, the thorax's turn (9,), and the weights
        of posture, offsets and turn; zero of what is not known.
        """
        offset = np.zeros(3 * len(self.hands))
        turn = np.eye(3)
        if self.offsets is not None:
            offset = self.offsets[number]
        if self.turns is not None:
            turn = self.turns[number]
        known = [weights.likeness * (each is not None) for each in (self.offsets, self.turns)]
        return offset, turn.ravel(order="F"), [weights.posture, *known]

    def parameters(self, number: int, missed: Array, weights: ObjectiveWeights) -> Array:
        """Return parameters (k, .) of `terms` at a waypoint, whose costs are means over all
        waypoints.

        Args:
            number: number of the waypoint.
            missed: weights (k,) of the squared pose error; zero for a pose within reach.
            weights: weights of the objective.
        """
        pose = self.poses[number]
        count = len(self.hands)
        offset, turn, own = self.likeness(number, weights)
        shoulders = [np.asarray(each.shoulder) for each in self._alignments]
        parts = pose.numbers, np.zeros(6 * count), offset, *shoulders, turn
        values = np.concatenate([*parts, gravity_on(self.alignment), own])
        found = np.tile(values, (len(missed), 1))
        rows = pose.numbers.size + np.array(self.rows)
        found[:, rows] = missed[:, None] * (self.count + 1) * self.row_weights**2
        return found


@lru_cache(maxsize=8)
def arm_waypoints(pair: PairedArm, tolerance: float) -> ArmWaypoints:
    """Return the waypoints of a person's motion on a robot, of all its hands.

    Args:
        pair: person and robot.
        tolerance: tolerance of the paths' conditions.
    """
    settings = pair.settings
    mappings = pair.mappings
    motion = pair.analysis.motion
    room = max(_ROOM - 2.0 * tolerance, 0.0)
    moving = [group for group in pair.groups if group.kind != "rest"]
    samples = pair.key_samples
    begins = motion.time[[group.start for group in moving]]
    ends = motion.time[samples[1:]]
    if not moving:  # it stays at the first pose, planned as a path without length
        begins = pair.edges[:1]
        ends = pair.edges[-1:]
        samples = samples * 2
    begun, ended = (np.interp(times, *pair.progress) for times in (begins, ends))

    def target_at(numbers: Array) -> tuple[Pose, ...]:
        which = np.minimum(numbers.astype(int), begun.size - 1)
        upto = begun[which] + (numbers - which) * (ended - begun)[which]
        return pair.targets(motion(np.interp(upto, *pair.progress[::-1])))

    q = motion.q[samples]
    hands = pair.of_hands
    offsets = None
    if all(has_elbow(each.model, each.source) for each in mappings):
        offsets = np.hstack([each.elbow_offsets(q) for each in mappings])
    within = settings.within_limits
    allowed = (np.min([each.allowed_miss(sample) for each in hands], axis=0) for sample in samples)
    return ArmWaypoints(
        arm=with_narrowed_limits(pair.robot, 2.0 * tolerance + room) if within else pair.robot,
        limited=within,
        room=room,
        alignment=mappings[0].target,
        begins=begins,
        ends=ends,
        poses=pair.targets(q),
        target_at=target_at,
        start=pair.start,
        limits=pair.limits,
        offsets=offsets,
        allowed=tuple((float(distance), float(angle)) for distance, angle in allowed),
        weights=settings.pose_weights,
        path_tolerance=cast(tuple[float, float], settings.path_tolerance),
        others=tuple(each.target for each in mappings[1:]),
        turns=mappings[0].waist_turns(q),
    )
