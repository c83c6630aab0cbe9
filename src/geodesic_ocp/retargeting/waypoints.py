"""What a robot takes over from a person: poses of the hand, and waypoints of its own.

An elbow's offset is the part of shoulder to elbow perpendicular to shoulder to wrist, relative to
the length of the arm. It turns with the swivel angle (Tolani, Goswami, Badler, Graphical Models 62,
2000) and vanishes with the straight arm, where that angle is not defined.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import cumulative_trapezoid

from geodesic_ocp.arrays import Array, ShortRepr, as_vector
from geodesic_ocp.blocks import Terms
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.execution.limits import JointLimits, checked_start
from geodesic_ocp.model.distances import signed_distances
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.inverse_kinematics import configurations, nearest_configuration
from geodesic_ocp.ocp.pose_search import (
    CollisionAvoidance,
    PoseSearch,
    pose_difference,
    rotation_log,
    stacked_error,
)
from geodesic_ocp.retargeting.arm_alignment import Alignment
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup, moving
from geodesic_ocp.retargeting.settings import RetargetingSettings
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.synergies.scores import pose_differences
from geodesic_ocp.synergies.segment import speeds

_GRAVITY = 9.81  # [m/s^2]
NO_COLLISIONS = CollisionAvoidance()
REACHED = 1e-6  # [m] and [rad]
MISSED = 1e-4  # [m] and [rad], error beyond what is allowed from which a pose counts as missed
# How near inverse kinematics comes to the configuration it starts from [rad or m].
_SETTLED = 1e-2
_SHORTEST = 1e-4  # [m^2], squared distance from the shoulder to the wrist
_STEADY = 1e-3  # of the person's progress, which goes on in pauses


@dataclass(frozen=True, eq=False, repr=False)
class Pose(ShortRepr):
    """A target for the hand, or for h hands of a body at once, stacked.

    Attributes:
        rotation: (3 h, 3), or None if it is free.
        position: (3 h,) [m], or None if it is free.
        hands: names of the hands; empty: the hand of the model.
    """

    rotation: Array | None
    position: Array | None
    hands: tuple[str, ...] = ()

    @property
    def numbers(self) -> Array:
        """Position (3 h,), and rotation by columns (9 h,); zeros and identities where free."""
        count = max(1, len(self.hands))
        position = np.zeros(3 * count) if self.position is None else self.position
        rotation = np.tile(np.eye(3), (count, 1)) if self.rotation is None else self.rotation
        return np.concatenate([position, rotation.ravel(order="F")])

    def reached_by(self, model: Model, q: Array) -> Pose:
        """Return the pose of the hands at q, with the same parts left free."""
        here = model.stacked_poses(self.hands or (model.hand,), q)
        parts = zip((self.rotation, self.position), here, strict=True)
        rotation, position = (None if part is None else found for part, found in parts)
        return Pose(rotation, position, self.hands)

    def error(self, model: Model, q: Array) -> tuple[float, float]:
        """Get distance [m] and angle [rad] of the hand at q from this pose, the largest of several
        hands; zero for free parts.
        """
        distances, angles = self.errors(model, q[None])
        return float(distances.max()), float(angles.max())

    def errors(self, model: Model, q: Array) -> tuple[Array, Array]:
        """Get distances [m] and angles [rad] of the h hands at configurations (k, n), (k, h)."""
        here = model.stacked_poses(self.hands or (model.hand,), q)
        targets = (
            own if part is None else np.broadcast_to(part, own.shape)
            for part, own in zip((self.rotation, self.position), here, strict=True)
        )
        distances, angles = pose_differences(here, (next(targets), next(targets)))
        return distances.reshape(len(q), -1), angles.reshape(len(q), -1)


def middle_of_ranges(arm: Model) -> tuple[Array, Array]:
    """Get middle and half width of the joints' ranges (n,); 0 and pi where they are unlimited."""
    finite = np.isfinite(arm.lower) & np.isfinite(arm.upper)
    lower, upper = (np.where(finite, each, 0.0) for each in (arm.lower, arm.upper))
    return (lower + upper) / 2.0, np.where(finite, (upper - lower) / 2.0, np.pi)


@lru_cache(maxsize=16)
def with_narrowed_limits(robot: Model, tolerance: float) -> Model:
    """Get the robot with limits narrowed by twice a tolerance, so that none is violated by it."""
    gap = np.minimum(2.0 * tolerance, (robot.upper - robot.lower) / 4.0)
    return robot.with_limits(robot.lower + gap, robot.upper - gap)


def nearest_configurations(
    arm: Model,
    near: Array,
    pose: Pose,
    limits: bool,
    weights: tuple[float, float],
    collisions: CollisionAvoidance = NO_COLLISIONS,
    enough: int = 1,
    settled: float = _SETTLED,
    least: int = 1,
) -> list[Array]:
    """Return configurations (n,) with a pose, the nearest first, or the one with the nearest pose.

    Args:
        arm: the robot.
        near: configuration (n,) from which they are sought.
        pose: pose of the hand.
        limits: whether joints stay within their limits.
        weights: weights of errors in position [1/m] and orientation [1/rad].
        collisions: bodies that are kept apart.
        enough, settled, least: see `configurations`.

    Raises:
        NotConverged: no configuration is clear of the collision bodies.
    """
    placed = arm, near, pose.position, pose.rotation
    given: dict[str, Any] = {"limits": limits, "collisions": collisions, "hands": pose.hands}
    search = PoseSearch.checked("retarget", *placed, **given)
    try:
        return configurations(search, enough, settled, least)
    except NotConverged:
        return [nearest_configuration(search, weights)]


def start_of(robot: Model, given: ArrayLike, settings: RetargetingSettings) -> Array:
    """Return the configuration (n,) to begin in.

    Raises:
        ValueError: it is outside the limits, or too close to a collision body.
    """
    within = settings.within_limits
    start = checked_start(robot, given) if within else as_vector("start", given, robot.dof)
    for obstacles, links, pairs, margin in settings.each_apart:
        distances = signed_distances(robot, start, obstacles, links=links, pairs=pairs)
        for name, distance in distances.items():
            if distance < margin:
                raise ValueError(
                    f"start: {name} is {distance:.3g} m, and must be at least {margin:.3g} m"
                )
    return start


def has_elbow(model: Model, alignment: Alignment) -> bool:
    """Return whether the alignment names joints of the model as its elbow and its wrist."""
    names = alignment.elbow, alignment.wrist
    return all(name is not None and model.pin.existFrame(name) for name in names)


def elbow_offset(model: Model, alignment: Alignment, q: Any, shoulder: Any = None) -> ca.SX:
    """Return offset (3, 1) of the elbow in the axes of the base, in lengths of the arm.

    The shoulder is that of the alignment, carried by the waist of a body, unless its position (3,)
    is given.
    """
    if shoulder is None:
        shoulder = ca.DM(np.asarray(alignment.shoulder))
        if model.shared_joints:
            place = model.frame_pose(model.shared_joints[-1], upright(model))[1]
            _, moved = model.frame_pose(model.shared_joints[-1], q)
            shoulder = moved + waist_turn(model, q) @ (shoulder - place)
    _, elbow = model.frame_pose(str(alignment.elbow), q)
    _, wrist = model.frame_pose(str(alignment.wrist), q)
    upper, whole = elbow - shoulder, wrist - shoulder
    along = ca.dot(upper, whole) / (ca.sumsqr(whole) + _SHORTEST)
    offset: ca.SX = (upper - along * whole) / alignment.length
    return offset


def upright(model: Model) -> Array:
    """Return zero, or the configuration (n,) within the limits that is nearest to it."""
    return np.clip(np.zeros(model.dof), model.lower, model.upper)


def waist_turn(model: Model, q: Any) -> Any:
    """Return the rotation (3, 3) from upright of what carries all hands, in axes of the base.

    For k configurations (k, n): (k, 3, 3). The model has joints that move all hands.
    """
    at_rest = model.frame_pose(model.shared_joints[-1], upright(model))[0]
    return model.frame_pose(model.shared_joints[-1], q)[0] @ at_rest.T


def elbow_function(model: Model, alignment: Alignment) -> ca.Function:
    """Return the function of configurations (n, k) that gives their elbow offsets (3, k)."""
    q = ca.SX.sym("q", model.dof)
    return ca.Function("offset", [q], [elbow_offset(model, alignment, q)])


def gravity_on(alignment: Alignment) -> Array:
    """Return gravity in the axes of a robot's base (3,) [m/s^2]."""
    return np.asarray(-_GRAVITY * np.asarray(alignment.base)[:, 2])


@dataclass(frozen=True, eq=False, repr=False)
class PoseMapping(ShortRepr):
    """Maps configurations of a person's arm to poses of a robot's hand.

    Attributes:
        model: the person's arm.
        source, target: alignments of the person and of the robot.
        scale: factor of positions.
        mirror: whether left and right are exchanged.
        turned: whether the hand is turned by 180 degrees about its fingers, as a parallel gripper
            may be.
    """

    model: Model
    source: Alignment
    target: Alignment
    scale: float
    mirror: bool
    turned: bool = False
    _shown = ("scale", "mirror", "turned")

    @classmethod
    def between(
        cls, model: Model, source: Alignment, target: Alignment, settings: RetargetingSettings
    ) -> PoseMapping:
        """Map poses: scaled by the ratio of lengths by default, mirrored if sides differ."""
        mirror, scale = settings.mirror, settings.scale
        if mirror is None:
            mirror = None not in (source.side, target.side) and source.side != target.side
        if scale is None or scale == "fit":
            scale = target.length / source.length
        return cls(model, source, target, float(scale), bool(mirror))

    def __call__(self, q: Array) -> tuple[Array, Array]:
        """Return rotations (k, 3, 3) and positions (k, 3) [m] in the robot's base, for q (k, n)."""
        rotation, position = self.source.to_person(*self.model.hand_pose(q))
        if self.turned:
            rotation = rotation @ np.diag([-1.0, -1.0, 1.0])
        return self.target.to_robot(rotation, position, scale=self.scale, mirror=self.mirror)

    def waist_turns(self, q: Array) -> Array:
        """Return rotations (k, 3, 3) of the person's thorax from upright at q (k, n), in axes of
        the robot's base; the identity for a person without a trunk.
        """
        if not self.model.shared_joints:
            return np.tile(np.eye(3), (len(q), 1, 1))
        axes = np.asarray(self.source.base) @ np.diag([-1.0 if self.mirror else 1.0, 1.0, 1.0])
        turn = axes @ np.asarray(self.target.base).T
        return np.asarray(turn.T @ waist_turn(self.model, q) @ turn)

    def elbow_offsets(self, q: Array) -> Array:
        """Return offsets (k, 3) of the person's elbow at q (k, n), in axes of the robot's base."""
        offsets = elbow_function(self.model, self.source)(q.T).full().T
        offsets = offsets @ np.asarray(self.source.base)
        if self.mirror:
            offsets = offsets * np.array([-1.0, 1.0, 1.0])
        return np.asarray(offsets @ np.asarray(self.target.base).T)


@dataclass(frozen=True, eq=False, repr=False)
class PairedArm(ShortRepr):
    """A person's arm, and the robot that takes over its motion.

    A robot with several hands, a body, has one such pair for each: they have one waist, and one
    motion.

    Attributes:
        analysis: analysis of the person's motion.
        robot: the arm, or the body, whose `hand` is the one of the pair.
        mappings: from the person's configurations to poses of the robot's hands, of all in the
            order of `hands`.
        limits: limits of its joints.
        settings: settings of the retargeting.
        groups: how the person's synergies were dropped and merged.
        start: configuration (n,) to begin in; None: any with the first pose.
        target_poses: rotations (k, 3, 3) and positions (k, 3) [m] of the hand, mapped from the
            person to the robot's base frame, at all samples.
        body: number of the arm, or of the body, in trajectories of several.
    """

    analysis: Analysis
    robot: Model
    mappings: tuple[PoseMapping, ...]
    limits: JointLimits
    settings: RetargetingSettings
    groups: tuple[SynergyGroup, ...]
    start: Array | None
    target_poses: tuple[Array, Array]
    body: int
    _shown = ("robot", "mapping")

    @property
    def hands(self) -> tuple[str, ...]:
        """Names of the robot's hands, of which one is that of the pair."""
        return self.robot.hands if len(self.mappings) > 1 else (self.robot.hand,)

    @property
    def mapping(self) -> PoseMapping:
        """Mapping from the person's configurations to poses of the robot's hand."""
        return self.mappings[self.hands.index(self.robot.hand)]

    @property
    def of_hands(self) -> tuple[PairedArm, ...]:
        """The pairs of all hands of the robot."""
        if len(self.mappings) == 1:
            return (self,)
        q = self.analysis.motion.q
        return tuple(
            replace(self, robot=self.robot.with_hand(hand), target_poses=mapping(q))
            for hand, mapping in zip(self.hands, self.mappings, strict=True)
        )

    @property
    def name(self) -> str:
        """Name of the robot, and of the hand if it has several."""
        if len(self.mappings) == 1:
            return self.robot.name
        side = self.mapping.target.side
        return f"{self.robot.name}, {f'{side} hand' if side else self.robot.hand}"

    @property
    def turned(self) -> PairedArm:
        """The same, with the hand of an arm turned by 180 degrees about its fingers."""
        mapping = replace(self.mapping, turned=not self.mapping.turned)
        poses = mapping(self.analysis.motion.q)
        return replace(self, mappings=(mapping,), target_poses=poses)

    @property
    def gravity(self) -> Array:
        """Gravity in the axes of the robot's base (3,) [m/s^2]."""
        return gravity_on(self.mapping.target)

    @property
    def edges(self) -> Array:
        """Times in the recording at which groups begin and end [s]."""
        samples = [self.groups[0].start, *(group.stop for group in self.groups)]
        return np.asarray(self.analysis.motion.time[samples])

    @property
    def bounded(self) -> Model:
        """The robot, without limits of its joints' ranges if they need not be met."""
        if self.settings.within_limits:
            return self.robot
        infinite = np.full(self.robot.dof, np.inf)
        return self.robot.with_limits(-infinite, infinite)

    @cached_property
    def progress(self) -> tuple[Array, Array]:
        """Times of the recording (k,) [s], and which fraction of its length the person's path has
        by then (k,).
        """
        motion = self.analysis.motion
        upto = cumulative_trapezoid(speeds(self.analysis.metric, motion), motion.time, initial=0.0)
        steady = np.linspace(0.0, _STEADY, upto.size)
        return motion.time, upto / max(upto[-1], _STEADY) + steady

    @property
    def key_samples(self) -> list[int]:
        """Samples of the recording whose hand poses are attained: the first, and ends of groups."""
        moving = (group.stop for group in self.groups if group.kind != "rest")
        return [self.groups[0].start, *moving]

    def target(self, sample: int) -> Pose:
        """Return the pose of the hand at a sample of the recording."""
        return self.as_pose(*(each[sample] for each in self.target_poses))

    def mapped(self, q: Array) -> tuple[Array, Array]:
        """Return stacked poses of all hands for the person's configurations (k, n)."""
        rotations, positions = zip(*(mapping(q) for mapping in self.mappings), strict=True)
        return np.concatenate(rotations, axis=1), np.concatenate(positions, axis=1)

    def targets(self, q: Array) -> tuple[Pose, ...]:
        """Return the poses of all hands for the person's configurations (k, n)."""
        hands = self.hands if len(self.mappings) > 1 else ()
        poses = zip(*self.mapped(q), strict=True)
        return tuple(replace(self.as_pose(*each), hands=hands) for each in poses)

    def allowed_miss(self, sample: int) -> tuple[float, float]:
        """Return distance [m] and angle [rad] by which the pose at a sample may be missed.

        That is the tolerance, less what the person's hand drifts by in a rest that follows.
        """
        rests = [each for each in self.groups if each.kind == "rest" and each.start == sample]
        drift = np.max([(0.0, 0.0), *(self.drift(each) for each in rests)], axis=0)
        distance, angle = np.maximum(self.settings.allowed_miss - drift, 0.0)
        return float(distance), float(angle)

    def drift(self, group: SynergyGroup) -> tuple[float, float]:
        """Return distance [m] and angle [rad] between the poses at the ends of a group."""
        ends = [
            tuple(part[sample] for part in self.target_poses)
            for sample in (group.stop, group.start)
        ]
        distance, angle = pose_difference(*ends[0], *ends[1])
        weights = self.settings.position_weight, self.settings.orientation_weight
        return distance * (weights[0] > 0.0), angle * (weights[1] > 0.0)

    def is_missed(self, error: tuple[float, float]) -> bool:
        """Return whether a distance [m] and angle [rad] from a pose are beyond what is allowed."""
        return bool(np.any(error > np.asarray(self.settings.allowed_miss) + MISSED))

    def without_drifts(self) -> PairedArm:
        """Return the same, with movements in place of rests in which the hand drifts too far."""
        hands = self.of_hands
        groups = (
            moving(each)
            if each.kind == "rest" and any(hand.is_missed(hand.drift(each)) for hand in hands)
            else each
            for each in self.groups
        )
        return replace(self, groups=tuple(groups))

    def as_pose(self, rotation: Array, position: Array) -> Pose:
        """Return the pose with a rotation and a position, without what the settings leave free."""
        settings = self.settings
        return Pose(
            rotation if settings.orientation_weight > 0.0 else None,
            position if settings.position_weight > 0.0 else None,
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


# A joint that holds the arm with more than this share of its torque is too weak to move it; cost
# of the squared excess.
_SHARE, _WEAK = 0.8, 300.0


@lru_cache(maxsize=32)
def _waypoint_terms(
    arm: Model,
    hands: tuple[str, ...],
    alignments: tuple[Alignment, ...],
    rows: tuple[int, ...],
    torque: tuple[float, ...],
) -> Terms:
    """Return costs of an arm, these rows of the pose errors, and the squared distance and angle of
    each hand, for limits on torque (n,).
    """
    count = len(hands)
    edges = np.cumsum([0, *np.array([3, 9, 6, 3]) * count, 9, 3]).tolist()  # see `parameters`
    q, p = ca.SX.sym("q", arm.dof), ca.SX.sym("p", edges[-1])
    position, rotation, missed, offset, turn, weights = ca.vertsplit(p, edges)
    rotation = ca.reshape(rotation, 3 * count, 3)
    error = stacked_error(arm, hands, q, position, rotation, ca.SX.eye(3))
    middle, half = middle_of_ranges(arm)
    cost = ca.dot(missed, error**2) + weights[0] * ca.sumsqr((q - middle) / half) / arm.dof
    for number, alignment in enumerate(alignments):
        if has_elbow(arm, alignment):
            off = elbow_offset(arm, alignment, q) - offset[3 * number : 3 * number + 3]
            cost += weights[1] / count * ca.sumsqr(off)
    if arm.shared_joints:
        beside = ca.reshape(turn, 3, 3).T @ waist_turn(arm, q)
        cost += weights[2] * ca.sumsqr(rotation_log(beside))
    if limited := np.flatnonzero(np.isfinite(torque)).tolist():
        still = ca.SX.zeros(arm.dof)
        held = arm.inverse_dynamics(q, still, still, gravity_on(alignments[0]))
        for joint in limited:
            cost += _WEAK * ca.fmax(0.0, ca.fabs(held[joint] / torque[joint]) - _SHARE) ** 2
    # Of poses that may be missed, distance and angle are bounded, by their squares.
    squares = [ca.sumsqr(each) for each in ca.vertsplit(error, 3)]
    return Terms(q, p, cost, ca.vertcat(error[list(rows)], *squares))


_PEAK, _BRAKING = 1.5, 5.0


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

    @property
    def row_weights(self) -> Array:
        """Weights of those rows."""
        return np.asarray(np.repeat(self.weights, 3)[np.array(self.rows) % 6])

    @property
    def terms(self) -> Terms:
        """Costs and pose errors of the configurations at the waypoints."""
        torque = tuple(self.limits.torque.tolist())
        alignments = (self.alignment, *self.others)
        return _waypoint_terms(self.arm, self.hands, alignments, self.rows, torque)

    def parameters(self, number: int, missed: float, weights: ObjectiveWeights) -> Array:
        """Return the parameters of `terms` at a waypoint, whose costs are means over all waypoints.

        Args:
            number: number of the waypoint.
            missed: weight of the squared pose error; zero for a pose within reach.
            weights: weights of the objective.
        """
        pose, count = self.poses[number], len(self.hands)
        missed_rows = np.zeros(6 * count)
        missed_rows[list(self.rows)] = missed * (self.count + 1) * self.row_weights**2
        offset, likeness = np.zeros(3 * count), 0.0
        if self.offsets is not None:
            offset, likeness = self.offsets[number], weights.likeness
        turn, as_turned = np.eye(3), 0.0
        if self.turns is not None:
            turn, as_turned = self.turns[number], weights.likeness
        parts = (pose.numbers, missed_rows, offset, turn.ravel(order="F"))
        return np.concatenate([*parts, [weights.posture, likeness, as_turned]])


def arm_waypoints(pair: PairedArm, tolerance: float) -> ArmWaypoints:
    """Return the waypoints of a person's motion on a robot, of all its hands.

    Args:
        pair: person and robot.
        tolerance: tolerance of the paths' conditions.
    """
    settings, mappings, motion = pair.settings, pair.mappings, pair.analysis.motion
    moving = [group for group in pair.groups if group.kind != "rest"]
    samples = pair.key_samples
    begins = motion.time[[group.start for group in moving]]
    ends = motion.time[samples[1:]]
    if not moving:  # it stays at the first pose, planned as a path without length
        begins, ends, samples = pair.edges[:1], pair.edges[-1:], samples * 2
    begun, ended = (np.interp(times, *pair.progress) for times in (begins, ends))

    def target_at(numbers: Array) -> tuple[Pose, ...]:
        which = np.minimum(numbers.astype(int), begun.size - 1)
        upto = begun[which] + (numbers - which) * (ended - begun)[which]
        return pair.targets(motion(np.interp(upto, *pair.progress[::-1])))

    q, hands = motion.q[samples], pair.of_hands
    offsets = None
    if all(has_elbow(each.model, each.source) for each in mappings):
        offsets = np.hstack([each.elbow_offsets(q) for each in mappings])
    within = settings.within_limits
    allowed = (np.min([each.allowed_miss(sample) for each in hands], axis=0) for sample in samples)
    return ArmWaypoints(
        arm=with_narrowed_limits(pair.robot, tolerance) if within else pair.robot,
        limited=within,
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
        path_tolerance=settings.path_tolerance,
        others=tuple(each.target for each in mappings[1:]),
        turns=mappings[0].waist_turns(q),
    )
