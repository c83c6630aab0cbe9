"""place_base: where the base of a robot stands, so that its hand attains a person's poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr, as_vector
from geodesic_ocp.blocks import Block, BlockProgram, Terms
from geodesic_ocp.execution.limits import JointLimits
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.ocp.pose_search import rotation_log
from geodesic_ocp.retargeting.arm_alignment import Alignment
from geodesic_ocp.retargeting.candidates import (
    Lacks,
    find_start,
    first_candidates,
    graph_weights,
    own_lacks,
)
from geodesic_ocp.retargeting.paired_arm import (
    PairedArm,
    PoseMapping,
    elbow_offset,
    has_elbow,
    middle_of_ranges,
)
from geodesic_ocp.retargeting.pairing import paired_arms
from geodesic_ocp.retargeting.reachability import NearestPoses, nearest_of_each, random_starts
from geodesic_ocp.retargeting.settings import RetargetingSettings, motion_clearance
from geodesic_ocp.retargeting.waypoints import ArmWaypoints, ObjectiveWeights, arm_waypoints
from geodesic_ocp.synergies.analyse import Analysis

_DEFAULT = RetargetingSettings()
_SHIFTS, _TURNS = (-0.3, 0.3), (-np.pi / 2.0, np.pi / 2.0)  # [m], [rad]
_TRIED = 64  # mountings for which poses within reach are counted
_RATIO = 1.1673039782614187  # x^5 = x + 1: its powers cover four dimensions evenly (Roberts)
_STEPS = 20  # of inverse kinematics, from each of
_STARTS = 6
_MOST_POSES = 24  # that are counted
_CHOSEN = 8  # mountings for which configurations are chosen
_POLISHED = 2
_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class BasePlacement(ShortRepr):
    """Where a robot's base stands, compared with its default alignment.

    Attributes:
        alignment: to be passed to `retarget`.
        shift: how far the base is moved to the person's right, forward and up (3,) [m].
        yaw: angle by which it is turned to the left about the vertical through its shoulder [rad].
        mirrored: whether left and right of the motion are exchanged, other than by default.
        count: number of poses of the hand, at the ends of the synergies.
        reached, reached_before: number of these within reach, and with the default alignment.
        cost, cost_before: objective of the best configurations with the poses, joined by straight
            lines: action, time beyond the person's, likeness, detours and links that are too near,
            in units of the action with the default alignment; of all recordings.
    """

    alignment: Alignment
    shift: Array
    yaw: float
    mirrored: bool
    count: int
    reached: int
    reached_before: int
    cost: float
    cost_before: float
    _shown = ("shift", "yaw", "mirrored", "count", "reached", "reached_before")

    def __str__(self) -> str:
        ways = (("right", "left"), ("forward", "backward"), ("up", "down"))
        parts = [
            f"{abs(distance):.3f} m {names[int(distance < 0.0)]}"
            for distance, names in zip(self.shift, ways, strict=True)
            if distance
        ]
        if self.yaw:
            side = "left" if self.yaw > 0.0 else "right"
            parts.append(f"turned by {abs(np.degrees(self.yaw)):.1f} degrees to the {side}")
        if self.mirrored:
            parts.append("the motion mirrored")
        return (
            f"base {', '.join(parts) or 'at its default place'}: {self.reached} of {self.count} "
            f"poses within reach, {self.reached_before} at the default place"
        )


def place_base(
    robot: Model,
    analyses: Analysis | Sequence[Analysis],
    *,
    alignment: Alignment | None = None,
    limits: JointLimits | None = None,
    settings: RetargetingSettings = _DEFAULT,
    sideways: tuple[float, float] = _SHIFTS,
    distance: tuple[float, float] = _SHIFTS,
    height: tuple[float, float] = _SHIFTS,
    yaw: tuple[float, float] = _TURNS,
    mirrored: bool = False,
) -> BasePlacement:
    """Find where a robot's base should stand to take over motions of a person.

    Of the places within the bounds, that with the most poses of the hand within reach, and among
    these the one whose configurations cost least, see `BasePlacement.cost`. Poses within reach are
    counted at places that cover the bounds evenly, configurations are chosen at the best of these,
    as `retarget` chooses those from which it starts, and a nonlinear program in place and
    configurations improves on the best two. Positions are scaled as for the default place; with
    the scale "fit" that is done afterwards, by `retarget`. Obstacles, which settings place in the
    frame of the base, move with it.

    Args:
        robot: the arm.
        analyses: analysis of one motion, or of many that are to be taken over from one place.
        alignment: alignment of the robot at its default place; None: that of `align`.
        limits: limits of the robot's joints; None: those of `joint_limits`.
        settings: settings of the retargeting.
        sideways, distance, height: least and largest shift of the base from the default place, to
            the person's right, forward and up [m].
        yaw: least and largest angle by which it is turned to the left [rad].
        mirrored: whether to try the motion with left and right exchanged as well.

    Raises:
        ValueError: arguments of the wrong type or shape, bounds without a place between them, or
            settings that leave the position of the hand free, or `mirrored` and settings or an
            alignment that do not leave it open.
    """
    given = [analyses] if isinstance(analyses, Analysis) else list(analyses)
    if not given:
        raise ValueError("analyses: there must be at least one")
    names = ("sideways", "distance", "height", "yaw")
    bounds = [
        _as_bounds(*each) for each in zip(names, (sideways, distance, height, yaw), strict=True)
    ]
    if settings.position_weight == 0.0:
        raise ValueError("settings: position_weight must be above zero to place a robot")
    if settings.scale == "fit":
        settings = replace(settings, scale=None)
    pairs: list[PairedArm] = []
    for each in given:
        limits = pairs[0].limits if pairs else limits
        given_arm = [each], [as_model(robot)], [alignment], None, [limits], None, settings
        pairs += paired_arms(*given_arm)
    if mirrored and (settings.mirror is not None or pairs[0].mapping.target.side is None):
        raise ValueError(
            "mirrored: the side of the alignment must be known, and settings.mirror be None"
        )
    if len(pairs) > len(given):
        raise ValueError("robot: must have one hand; load one of its arms")
    lower, upper = np.transpose(bounds)
    return _BaseSearch(tuple(pairs), lower, upper, mirrored).best()


def _as_bounds(name: str, given: tuple[float, float]) -> Array:
    bounds = as_vector(name, given, 2)
    if bounds[0] > bounds[1]:
        raise ValueError(f"{name}: the least must not be above the largest, got {given!r}")
    return bounds


@dataclass(frozen=True, eq=False)
class _Mounted:
    """A mounting, and the configurations chosen for each recording."""

    place: Array  # right, forward, up [m], yaw [rad]
    mirrored: bool
    arms: tuple[ArmWaypoints, ...]
    q: tuple[Array, ...]
    reached: int
    cost: float


def _rank(mounted: _Mounted) -> tuple[int, float]:
    return -mounted.reached, mounted.cost


@dataclass(frozen=True, eq=False)
class _BaseSearch:
    """Search of mountings (4,), shift [m] and yaw [rad], between bounds."""

    pairs: tuple[PairedArm, ...]
    lower: Array
    upper: Array
    mirrored: bool

    @property
    def robot(self) -> Model:
        return self.pairs[0].robot

    def best(self) -> BasePlacement:
        """Return the best of those that are tried."""
        before = self.mounted(np.zeros(4), False)
        within = bool(np.all(self.lower <= 0.0) and np.all(self.upper >= 0.0))
        tried = [before] if within else []
        tried += [self.mounted(*each) for each in self._most_within_reach()]
        for each in sorted(tried, key=_rank)[:_POLISHED]:
            tried.append(self.mounted(self._polished(each), each.mirrored))
        found = min(tried, key=_rank)
        return BasePlacement(
            self.alignment(found.place, found.mirrored),
            found.place[:3],
            float(found.place[3]),
            found.mirrored,
            sum(each.count + 1 for each in found.arms),
            *(found.reached, before.reached, found.cost, before.cost),
        )

    def alignment(self, place: Array, mirrored: bool) -> Alignment:
        """Return the alignment with the robot at a place."""
        default = self.pairs[0].mapping.target
        base = np.asarray(default.base) @ _yawed(-place[3])
        shoulder = np.asarray(default.shoulder) - base @ place[:3]
        side = default.side
        if mirrored:
            side = "left" if side == "right" else "right"
        return replace(default, base=base, shoulder=shoulder, side=side)

    def mounted(self, place: Array, mirrored: bool) -> _Mounted:
        """Return the mounting at a place, with the best configurations."""
        arms = self._waypoints(self.alignment(place, mirrored))
        q, reached, cost = list[Array](), 0, 0.0
        for arm, weights in zip(arms, self._weights, strict=True):
            layers = first_candidates(arm)
            found = find_start(arm, weights, layers, self._lacks)
            reached += sum(layer.within_reach for layer in layers)
            cost += found.cost
            q.append(found.q)
        return _Mounted(place, mirrored, arms, tuple(q), reached, cost)

    def _waypoints(self, alignment: Alignment) -> tuple[ArmWaypoints, ...]:
        found = []
        for pair in self.pairs:
            mapping = _mapped(pair, alignment)
            poses = mapping(pair.analysis.motion.q)
            found.append(
                arm_waypoints(replace(pair, mappings=(mapping,), target_poses=poses), _TOLERANCE)
            )
        return tuple(found)

    @cached_property
    def _default(self) -> tuple[ArmWaypoints, ...]:
        return self._waypoints(self.pairs[0].mapping.target)

    @cached_property
    def _weights(self) -> tuple[ObjectiveWeights, ...]:
        """Weights of the objective, of each recording."""
        settings = self.pairs[0].settings
        return tuple(graph_weights(arm, first_candidates(arm), settings) for arm in self._default)

    @cached_property
    def _lacks(self) -> Lacks | None:
        clearance = motion_clearance([self.robot], self.pairs[0].settings)
        return own_lacks(clearance, self._default[:1], 0)

    def _most_within_reach(self) -> list[tuple[Array, bool]]:
        """Return the places with the most poses within reach, of many that cover the bounds."""
        width = self.upper - self.lower
        steps = _RATIO ** -np.arange(1.0, 5.0)
        points = np.mod(0.5 + np.arange(1.0, _TRIED + 1.0)[:, None] * steps, 1.0)
        places = np.clip(_rounded(self.lower + width * points), self.lower, self.upper)
        tried = [(each, side) for side in (False, True)[: 1 + self.mirrored] for each in places]
        free = self.pairs[0].settings.orientation_weight == 0.0

        def nearest(rotations: Array, positions: Array, starts: Array, steps: int) -> NearestPoses:
            turned = None if free else rotations
            return nearest_of_each(self.robot, turned, positions, starts, steps)

        rotations, positions = self._key_poses(np.zeros(4), False)
        random = random_starts(self.robot, len(positions))
        found = nearest(rotations[None], positions[None], random, 2 * _STEPS)
        # Those farthest from reach decide, and next to them those farthest from the shoulder.
        away = np.linalg.norm(positions - np.asarray(self.pairs[0].mapping.target.shoulder), axis=1)
        missed = np.where(found.within_reach, 0.0, found.distances + found.angles)[0]
        some = np.lexsort((-away, -missed))[:_MOST_POSES]
        starts = np.concatenate([found.q[0, some, None], random[some, : _STARTS - 1]], axis=1)
        poses = zip(*(self._key_poses(*each) for each in tried), strict=True)
        rotations, positions = (np.stack(each)[:, some] for each in poses)
        found = nearest(rotations, positions, starts, _STEPS)
        missed = np.minimum(found.distances + found.angles, 1.0).sum(axis=1).round(3)
        order = np.lexsort((missed, -found.within_reach.sum(axis=1)))
        return [tried[number] for number in order[:_CHOSEN]]

    def _key_poses(self, place: Array, mirrored: bool) -> tuple[Array, Array]:
        """Return the hand's poses at the ends of the synergies (k, ...), of all recordings."""
        alignment = self.alignment(place, mirrored)
        found = [
            _mapped(pair, alignment)(pair.analysis.motion.q[pair.key_samples])
            for pair in self.pairs
        ]
        rotations, positions = map(np.concatenate, zip(*found, strict=True))
        return rotations, positions

    def _polished(self, start: _Mounted) -> Array:
        """Return the place improved by a program in place and configurations."""
        n, first = self.robot.dof, 4
        default = self._waypoints(self.alignment(np.zeros(4), start.mirrored))
        alignment = default[0].alignment
        shoulder, base = np.asarray(alignment.shoulder), np.asarray(alignment.base)
        places, values, steps, lines = [], [], [], []
        for arm, weights in zip(default, self._weights, strict=True):
            rows = first + np.arange((arm.count + 1) * n).reshape(-1, n)
            first += rows.size
            for number, (row, pose) in enumerate(zip(rows, arm.poses, strict=True)):
                rotation = np.eye(3) if pose.rotation is None else pose.rotation
                offset = np.zeros(3) if arm.offsets is None else arm.offsets[number]
                likeness = 0.0 if arm.offsets is None else weights.likeness / (arm.count + 1)
                posture = weights.posture / (arm.count + 1)
                parts = (shoulder, base.T, pose.position - shoulder, rotation.T, offset)
                values.append(np.hstack([*map(np.ravel, parts), likeness, posture]))
                places.append([0, 1, 2, 3, *row])
            for number, duration in enumerate(arm.durations):
                late = duration * weights.stretch / weights.duration
                steps.append([*rows[number], *rows[number + 1]])
                speed = arm.speed[number] * duration
                lines.append([1.0 / (duration * weights.action), late, *(1.0 / speed)])
        arm = default[0]
        blocks = [
            Block(_pose_terms(arm.arm, alignment, arm.rows), np.array(places), np.array(values)),
            Block(_line_terms(arm.arm), np.array(steps), np.array(lines)),
        ]
        repeated = (first - 4) // n
        lower = np.concatenate([self.lower, np.tile(arm.arm.lower, repeated)])
        upper = np.concatenate([self.upper, np.tile(arm.arm.upper, repeated)])
        x = np.concatenate([start.place, *(each.ravel() for each in start.q)])
        found = BlockProgram(first, blocks).solve(x, (lower, upper), _IPOPT)
        return np.clip(_rounded(found.x[:4]), self.lower, self.upper)


def _mapped(pair: PairedArm, alignment: Alignment) -> PoseMapping:
    """Return the mapping with another alignment of the robot."""
    return PoseMapping.between(pair.mapping.model, pair.mapping.source, alignment, pair.settings)


_IPOPT = {"tol": 1e-4, "max_iter": 60}
_EXACT = 1e5  # weight of squared pose errors [1/m^2], [1/rad^2]


def _rounded(place: Array) -> Array:
    """Round to millimetres and a tenth of a degree, as a base can be set up."""
    shift, yaw = np.round(place[..., :3], 3), np.round(np.degrees(place[..., 3:]), 1)
    return np.concatenate([shift, np.radians(yaw)], axis=-1) + 0.0


def _yawed(angle: float | ca.SX) -> ca.SX | Array:
    """Return the rotation by an angle about z."""
    if isinstance(angle, ca.SX):
        c, s = ca.cos(angle), ca.sin(angle)
        return ca.blockcat([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@lru_cache(maxsize=16)
def _pose_terms(robot: Model, alignment: Alignment, rows: tuple[int, ...]) -> Terms:
    """Return pose errors and posture in place and configuration; p as in `_polished`."""
    place, q, p = ca.SX.sym("place", 4), ca.SX.sym("q", robot.dof), ca.SX.sym("p", 29)
    shoulder, base, reach, rotation, offset, weights = ca.vertsplit(p, [0, 3, 12, 15, 24, 27, 29])
    base = ca.reshape(base, 3, 3)
    turned = base @ _yawed(-place[3])
    turn = turned @ base.T
    shoulder = shoulder - turned @ place[:3]
    hand_rotation, hand_position = robot.hand_pose(q)
    target = turn @ ca.reshape(rotation, 3, 3)
    error = ca.vertcat(
        hand_position - shoulder - turn @ reach, rotation_log(target.T @ hand_rotation)
    )[list(rows)]
    middle, half = middle_of_ranges(robot)
    cost = _EXACT * ca.sumsqr(error) / 2.0 + weights[1] * ca.sumsqr((q - middle) / half) / robot.dof
    if has_elbow(robot, alignment):
        own = elbow_offset(robot, alignment, q, shoulder)
        cost += weights[0] * ca.sumsqr(own - turn @ offset)
    return Terms(ca.vertcat(place, q), p, cost)


@lru_cache(maxsize=16)
def _line_terms(robot: Model) -> Terms:
    """Return action and lateness of the straight line between two configurations."""
    n = robot.dof
    z, p = ca.SX.sym("z", 2 * n), ca.SX.sym("p", 2 + n)
    change = z[n:] - z[:n]
    action = ca.bilin(robot.mass_matrix((z[:n] + z[n:]) / 2.0), change, change) / 2.0
    late = ca.fmax(0.0, ca.fabs(change * p[2:]) - 1.0) ** 2
    return Terms(z, p, action * p[0] + p[1] * ca.sum1(late))
