"""A person's arm and the robot that takes over its motion: poses of the hand, and of the elbow.

An elbow's offset is the part of shoulder to elbow perpendicular to shoulder to wrist, relative to
the length of the arm. It turns with the swivel angle (Tolani, Goswami, Badler, Graphical Models 62,
2000) and vanishes with the straight arm, where that angle is not defined.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import cumulative_trapezoid

from geodesic_ocp.arrays import Array, ShortRepr, as_vector
from geodesic_ocp.blocks import Terms
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.execution.limits import JointLimits, checked_start
from geodesic_ocp.model.distances import signed_distances
from geodesic_ocp.model.joint_axes import upright
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.inverse_kinematics import configurations, nearest_configuration
from geodesic_ocp.ocp.pose_search import (
    CollisionAvoidance,
    PoseSearch,
    pose_difference,
    stacked_error,
)
from geodesic_ocp.retargeting.arm_alignment import Alignment
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup, moving
from geodesic_ocp.retargeting.settings import RetargetingSettings
from geodesic_ocp.synergies.analyse import Analysis
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
        here = model.stacked_poses(self.hands, q)
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
        hands = self.hands or (model.hand,)
        _, squares = _pose_squares(model, hands).at("value", q, self.numbers)
        found = np.sqrt(squares).reshape(len(q), len(hands), 2)
        found *= [self.position is not None, self.rotation is not None]
        return found[..., 0], found[..., 1]


@lru_cache(maxsize=32)
def _pose_squares(model: Model, hands: tuple[str, ...]) -> Terms:
    """Return squared distance and angle of each hand from a pose, p: `Pose.numbers`."""
    count = len(hands)
    q = ca.SX.sym("q", model.dof)
    p = ca.SX.sym("p", 12 * count)
    rotation = ca.reshape(p[3 * count :], 3 * count, 3)
    error = stacked_error(model, hands, q, p[: 3 * count], rotation, ca.SX.eye(3))
    squares = [ca.sumsqr(each) for each in ca.vertsplit(error, 3)]
    return Terms(q, p, 0.0, ca.vertcat(*squares), lasting=True)


def middle_of_ranges(arm: Model) -> tuple[Array, Array]:
    """Get middle and half width of the joints' ranges (n,); 0 and pi where they are unlimited."""
    finite = np.isfinite(arm.lower) & np.isfinite(arm.upper)
    lower, upper = (np.where(finite, each, 0.0) for each in (arm.lower, arm.upper))
    return (lower + upper) / 2.0, np.where(finite, (upper - lower) / 2.0, np.pi)


@lru_cache(maxsize=16)
def with_narrowed_limits(robot: Model, gap: float) -> Model:
    """Get the robot with limits narrowed by a gap [rad or m], or by a quarter of a small range."""
    own = np.minimum(gap, (robot.upper - robot.lower) / 4.0)
    return robot.with_limits(robot.lower + own, robot.upper - own)


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

    The shoulder is that of the alignment unless its position (3,) is given, carried by the waist of
    a body.
    """
    if shoulder is None:
        shoulder = ca.DM(np.asarray(alignment.shoulder))
    if model.shared_joints:
        place = model.frame_pose(model.shared_joints[-1], upright(model))[1]
        _, moved = model.frame_pose(model.shared_joints[-1], q)
        shoulder = moved + waist_turn(model, q) @ (shoulder - place)
    _, elbow = model.frame_pose(str(alignment.elbow), q)
    _, wrist = model.frame_pose(str(alignment.wrist), q)
    upper = elbow - shoulder
    whole = wrist - shoulder
    along = ca.dot(upper, whole) / (ca.sumsqr(whole) + _SHORTEST)
    offset: ca.SX = (upper - along * whole) / alignment.length
    return offset


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
        mirror = settings.mirror
        scale = settings.scale
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

    def scaled(self, factor: float) -> PairedArm:
        """Return the same, with positions scaled by a factor, for all hands."""
        mappings = tuple(replace(each, scale=factor * each.scale) for each in self.mappings)
        scaled = replace(self, mappings=mappings)
        return replace(scaled, target_poses=scaled.mapping(self.analysis.motion.q))

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
