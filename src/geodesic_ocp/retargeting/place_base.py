"""place_base: where the base of a robot stands, so that its hand attains a person's poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, ShortRepr, as_vector
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.execution.limits import JointLimits
from geodesic_ocp.model.joint_axes import upright
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.retargeting.arm_alignment import Alignment
from geodesic_ocp.retargeting.candidates import (
    Candidates,
    RememberedLacks,
    attained,
    best_candidates,
    can_hold,
    first_candidates,
    graph_weights,
    own_lacks,
)
from geodesic_ocp.retargeting.paired_arm import (
    PairedArm,
    PoseMapping,
)
from geodesic_ocp.retargeting.pairing import paired_arms
from geodesic_ocp.retargeting.place_program import PlaceProgram, middle_of_shoulders, yawed
from geodesic_ocp.retargeting.reachability import nearest_of_each, random_starts
from geodesic_ocp.retargeting.settings import RetargetingSettings, motion_clearance
from geodesic_ocp.retargeting.waypoints import (
    ArmWaypoints,
    ObjectiveWeights,
    arm_waypoints,
)
from geodesic_ocp.synergies.analyse import Analysis

_DEFAULT = RetargetingSettings()
_SHIFTS = (-0.3, 0.3)  # [m], [rad]
_TURNS = (-np.pi / 2.0, np.pi / 2.0)  # [m], [rad]
_TRIED = 64  # mountings for which poses within reach are counted
_RATIO = 1.1673039782614187  # x^5 = x + 1: its powers cover four dimensions evenly (Roberts)
_STEPS = 20  # of inverse kinematics, from each of
_STARTS = 6
_MOST_POSES = 24  # that are counted
_CHOSEN = 8  # mountings for which configurations are chosen
_ROUGHLY = 8  # from so many starts; for the best of these, from as many as elsewhere
# The best one is improved until all poses are within reach, with these factors of positions, and
# then with smaller ones where the scale is left to `retarget`.
_SAME = (1.0, 1.0)
_SMALLER = (0.95, 0.9)
_TOLERANCE = 1e-6
_WITHIN = 1e-4  # [m] and [rad]


@dataclass(frozen=True, eq=False, repr=False)
class BasePlacement(ShortRepr):
    """Where a robot's base stands, compared with its default alignment.

    Attributes:
        alignments: to be passed to `retarget`, one for each hand.
        shift: how far the base is moved to the person's right, forward and up (3,) [m].
        yaw: angle by which it is turned to the left about the vertical through its shoulder [rad].
        mirrored: whether left and right of the motion are exchanged, other than by default.
        factor: factor of positions, in addition to their scale; below 1 only where `retarget` moves
            a robot that attains more poses with it.
        count: number of poses of the hand, at the ends of the synergies.
        reached, reached_before: number of these within reach, and with the default alignment:
            within the tolerance, in configurations in which links are apart and joints strong
            enough to hold the arm.
        cost, cost_before: objective of the best configurations with the poses, joined by straight
            lines: action, time beyond the person's, likeness and detours, in units of the action
            with the default alignment; of all recordings.
    """

    alignments: tuple[Alignment, ...]
    shift: Array
    yaw: float
    mirrored: bool
    factor: float
    count: int
    reached: int
    reached_before: int
    cost: float
    cost_before: float
    _shown = ("shift", "yaw", "mirrored", "count", "reached", "reached_before")

    @property
    def alignment(self) -> Alignment:
        """That of the hand, or of the first of several."""
        return self.alignments[0]

    @property
    def gains(self) -> bool:
        """Whether more poses are within reach than with the default alignment."""
        return self.reached > self.reached_before

    @property
    def reason(self) -> str:
        """Why a robot is moved here by default, a clause."""
        return "it does not attain all poses" if self.gains else "its motion is slow or fails"

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
        if self.factor < 1.0:
            parts.append(f"positions scaled by a further {self.factor:.3g}")
        return (
            f"base {', '.join(parts) or 'at its default place'}: {self.reached} of {self.count} "
            f"poses within reach, {self.reached_before} at the default place; cost "
            f"{self.cost:.3g}, {self.cost_before:.3g} there"
        )


def place_base(
    robot: Model,
    analyses: Analysis | Sequence[Analysis],
    *,
    alignment: Alignment | Sequence[Alignment] | None = None,
    person_alignment: Alignment | Sequence[Alignment] | None = None,
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
    configurations, which keeps links apart, improves on the best one. Positions are scaled as for
    the default place; with the scale "fit" that is done afterwards, by `retarget`. Obstacles, which
    settings place in the frame of the base, move with it.

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> arm = go.human_arm("left", height=1.78)
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv", arm.joint_names)
    >>> reach = go.Motion(motion.time[270:430], motion.q[270:430], motion.joint_names)
    >>> analysis = go.analyse(arm, reach)
    >>> placed = go.retargeting.place_base(
    ...     *(go.human_arm("left", height=1.5), analysis), sideways=(0.0, 0.0), yaw=(0.0, 0.0)
    ... )
    >>> placed.reached_before, placed.reached, placed.count
    (4, 4, 4)

    Args:
        robot: the arm, or a body with several hands.
        analyses: analysis of one motion, or of many that are to be taken over from one place.
        alignment: alignment of the robot at its default place, or one for each of several hands;
            None: that of `align`.
        person_alignment: likewise of the person's arm, if it is not a `human_arm`.
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
        aligned = [alignment], [person_alignment]
        given_arm = [each], [as_model(robot)], *aligned, [limits], None, settings
        pairs += paired_arms(*given_arm)[:1]  # of a body that of the first hand
    if mirrored and (settings.mirror is not None or pairs[0].mapping.target.side is None):
        raise ValueError(
            "mirrored: the side of the alignment must be known, and settings.mirror be None"
        )
    if mirrored and len(pairs[0].hands) > 1:
        raise ValueError("mirrored: for a robot with one hand")
    lower, upper = np.transpose(bounds)
    clearance = motion_clearance([as_model(robot)], settings)
    return _BaseSearch(tuple(pairs), lower, upper, mirrored, clearance).best()


def best_place(pair: PairedArm, clearance: Clearance | None) -> tuple[PairedArm, BasePlacement]:
    """Return a pair at the best place within the default bounds of `place_base`.

    If it does not attain all poses and their scale is not given, a longer arm takes positions as
    they are, or they are scaled down, where that attains more.
    """
    lower, upper = np.transpose([_SHIFTS, _SHIFTS, _SHIFTS, _TURNS])
    search = _BaseSearch((pair,), lower, upper, False, clearance)
    tried = search.improved(search.begun(), _SAME)
    found = search.placement(tried)
    scale = pair.mapping.scale
    if pair.settings.scale is None and scale > 1.0 and found.reached < found.count:
        other = replace(search, pairs=(pair.scaled(1.0 / scale),)).best()
        if other.reached > found.reached:
            found = replace(other, factor=1.0 / scale, reached_before=found.reached_before)
    if pair.settings.scale is None and found.reached < found.count:
        other = search.placement(search.improved(tried, _SMALLER))
        found = other if other.reached > found.reached else found
    return _at(pair, found.alignments, found.factor), found


def _as_bounds(name: str, given: tuple[float, float]) -> Array:
    bounds = as_vector(name, given, 2)
    if bounds[0] > bounds[1]:
        raise ValueError(f"{name}: the least must not be above the largest, got {given!r}")
    return bounds


@dataclass(frozen=True, eq=False)
class _Mounted:
    """A mounting, and candidates at the waypoints of each recording."""

    place: Array  # right, forward, up [m], yaw [rad]
    mirrored: bool
    factor: float  # of positions
    arms: tuple[ArmWaypoints, ...]
    layers: tuple[tuple[Candidates, ...], ...]
    reached: int
    cost: float


def _rank(mounted: _Mounted) -> tuple[int, float, float]:
    return -mounted.reached, -mounted.factor, mounted.cost


@dataclass(frozen=True, eq=False)
class _BaseSearch:
    """Search of mountings (4,), shift [m] and yaw [rad], between bounds."""

    pairs: tuple[PairedArm, ...]
    lower: Array
    upper: Array
    mirrored: bool
    clearance: Clearance | None

    @property
    def robot(self) -> Model:
        return self.pairs[0].robot

    def best(self) -> BasePlacement:
        """Return the best place, with positions as they are."""
        return self.placement(self.improved(self.begun(), _SAME))

    def begun(self) -> list[_Mounted]:
        """Return the default place and the best of those that cover the bounds, the better last."""
        within = bool(np.all(self.lower <= 0.0) and np.all(self.upper >= 0.0))
        tried = [self._before] if within else []
        roughly = [self.mounted(*each, _ROUGHLY) for each in self._most_within_reach()]
        for each in sorted(roughly, key=_rank)[:1]:
            tried.append(self.mounted(each.place, each.mirrored))
        return sorted(tried, key=_rank, reverse=True)

    def improved(self, tried: list[_Mounted], factors: Sequence[float]) -> list[_Mounted]:
        """Return what has been tried, and the last one improved with factors of positions, one
        after the other until all poses are attained, and with the same as long as that gains any.
        """
        tried = list(tried)
        gains = True
        for factor in factors:
            found = tried[-1]
            most = max(each.reached for each in tried)
            if factor == found.factor and not gains:
                continue
            polished = self._polished(found, factor)
            tried.append(self.mounted(polished, found.mirrored, factor=factor))
            gains = tried[-1].reached > most
            if max(most, tried[-1].reached) == self._count:
                break
        return tried

    @cached_property
    def _before(self) -> _Mounted:
        return self.mounted(np.zeros(4), False)

    @property
    def _count(self) -> int:
        """Number of poses, of all recordings."""
        return sum(each.count + 1 for each in self._before.arms)

    def placement(self, tried: Sequence[_Mounted]) -> BasePlacement:
        """Return the best of those that have been tried."""
        found = min(tried, key=_rank)
        before = self._before
        return BasePlacement(
            self.alignments(found.place, found.mirrored),
            found.place[:3],
            float(found.place[3]),
            found.mirrored,
            found.factor,
            self._count,
            found.reached,
            before.reached,
            found.cost,
            before.cost,
        )

    def alignments(self, place: Array, mirrored: bool) -> tuple[Alignment, ...]:
        """Return the alignments of all hands with the robot at a place."""
        default = [mapping.target for mapping in self.pairs[0].mappings]
        if not (np.any(place) or mirrored):
            return tuple(default)
        up = np.asarray(default[0].base)
        base = up @ yawed(-place[3])
        turn = base @ up.T
        centre = middle_of_shoulders(default)
        found = []
        for each in default:
            shoulder = centre + turn @ (np.asarray(each.shoulder) - centre) - base @ place[:3]
            side = each.side
            if mirrored:
                side = "left" if side == "right" else "right"
            own = turn @ np.asarray(each.base)
            found.append(replace(each, base=own, shoulder=shoulder, side=side))
        return tuple(found)

    def mounted(
        self, place: Array, mirrored: bool, *num_starts: int, factor: float = 1.0
    ) -> _Mounted:
        """Return the mounting at a place, with poses within reach and cost, from so many starts."""
        arms = self._waypoints(self.alignments(place, mirrored), factor)
        layers = tuple(first_candidates(arm, *num_starts) for arm in arms)
        reached = 0
        cost = 0.0
        for arm, own, weights in zip(arms, layers, self._weights, strict=True):
            reached += sum(attained(arm, own, self._lacks))
            cost += best_candidates(arm, weights, own).cost
        return _Mounted(place, mirrored, factor, arms, layers, reached, cost)

    def _waypoints(
        self, alignments: Sequence[Alignment], factor: float = 1.0
    ) -> tuple[ArmWaypoints, ...]:
        placed = (_at(pair, alignments, factor) for pair in self.pairs)
        return tuple(arm_waypoints(each, _TOLERANCE) for each in placed)

    @cached_property
    def _default(self) -> tuple[ArmWaypoints, ...]:
        return self._waypoints(self.alignments(np.zeros(4), False))

    @cached_property
    def _weights(self) -> tuple[ObjectiveWeights, ...]:
        """Weights of the objective, of each recording."""
        settings = self.pairs[0].settings
        return tuple(graph_weights(arm, first_candidates(arm), settings) for arm in self._default)

    @cached_property
    def _lacks(self) -> RememberedLacks | None:
        return own_lacks(self.clearance, self._default[:1], 0)

    def _polished(self, start: _Mounted, factor: float) -> Array:
        """Return the place improved by a program in place and configurations, which keeps links
        apart, with a factor of positions.
        """
        aligned = self.alignments(np.zeros(4), start.mirrored)
        arms = self._waypoints(aligned, factor)
        bounds = (self.lower, self.upper)
        program = PlaceProgram(arms, self._weights, aligned, *bounds, self.clearance)
        given = zip(start.arms, self._weights, start.layers, strict=True)
        q = np.vstack([best_candidates(*each, self._lacks).q for each in given])
        return np.clip(_rounded(program.solve(start.place, q)), *bounds)

    def _most_within_reach(self) -> list[tuple[Array, bool]]:
        """Return the places with the most poses within reach, of many that cover the bounds."""
        width = self.upper - self.lower
        steps = _RATIO ** -np.arange(1.0, 5.0)
        points = np.mod(0.5 + np.arange(1.0, _TRIED + 1.0)[:, None] * steps, 1.0)
        places = np.clip(_rounded(self.lower + width * points), self.lower, self.upper)
        tried = [(each, side) for side in (False, True)[: 1 + self.mirrored] for each in places]
        random = random_starts(self.robot, sum(len(pair.key_samples) for pair in self.pairs))
        every = np.arange(len(random))
        q, missed = self._nearest([(np.zeros(4), False)], every, random, 2 * _STEPS)
        # Those farthest from reach decide.
        some = np.argsort(-np.where(missed[0] <= _WITHIN, 0.0, missed[0]), kind="stable")
        some = some[:_MOST_POSES]
        starts = np.concatenate([q[0, some, None], random[some, : _STARTS - 1]], axis=1)
        q, missed = self._nearest(tried, some, starts, _STEPS)
        reached = missed <= _WITHIN
        held = np.zeros(missed.shape, dtype=bool)
        held[reached] = list(can_hold(self._default[0], self._lacks, q[reached]))
        away = np.minimum(missed, 1.0).sum(axis=1).round(3)
        order = np.lexsort((away, -held.sum(axis=1), -reached.sum(axis=1)))
        return [tried[number] for number in order[:_CHOSEN]]

    def _nearest(
        self,
        places: Sequence[tuple[Array, bool]],
        some: NDArray[np.int64],
        starts: Array,
        steps: int,
    ) -> tuple[Array, Array]:
        """Return configurations (c, k, n) nearest to some poses at c places, and what they miss.

        That is the sum of distance and angle (c, k) over the hands, each of which is sought by
        itself, with a waist that is upright.
        """
        robot = self.robot
        turning = self.pairs[0].settings.orientation_weight > 0.0
        still = dict(zip(robot.joint_names, upright(robot).tolist(), strict=True))
        waist = {name: still[name] for name in robot.shared_joints}
        robot = robot.with_limits(waist, waist)
        q = np.tile(upright(robot), (len(places), len(some), 1))
        missed = np.zeros(q.shape[:2])
        for number, hand in enumerate(self.pairs[0].hands):
            poses = zip(*(self._key_poses(number, *each) for each in places), strict=True)
            rotations, positions = (np.stack(each)[:, some] for each in poses)
            turned = rotations if turning else None
            arm = robot.with_hand(hand)
            found = nearest_of_each(arm, turned, positions, starts, steps)
            chain = [str(robot.pin.names[each]) for each in robot.pin.supports[arm.joint_of(hand)]]
            own = [column for column, name in enumerate(robot.joint_names) if name in chain]
            q[..., own] = found.q[..., own]
            missed += found.distances + found.angles
        return q, missed

    def _key_poses(self, hand: int, place: Array, mirrored: bool) -> tuple[Array, Array]:
        """Return a hand's poses at the ends of the synergies (k, ...), of all recordings."""
        alignments = self.alignments(place, mirrored)
        found = [
            _mappings(pair, alignments)[hand](pair.analysis.motion.q[pair.key_samples])
            for pair in self.pairs
        ]
        rotations, positions = map(np.concatenate, zip(*found, strict=True))
        return rotations, positions


def _mappings(pair: PairedArm, alignments: Sequence[Alignment]) -> tuple[PoseMapping, ...]:
    """Return the mappings with other alignments of the robot's hands."""
    between = PoseMapping.between
    return tuple(
        replace(between(old.model, old.source, new, pair.settings), scale=old.scale)
        for old, new in zip(pair.mappings, alignments, strict=True)
    )


def _at(pair: PairedArm, alignments: Sequence[Alignment], factor: float) -> PairedArm:
    """Return the pair with other alignments of the robot's hands, and a factor of the scale."""
    if tuple(alignments) == tuple(each.target for each in pair.mappings) and factor == 1.0:
        return pair
    return replace(pair, mappings=_mappings(pair, alignments)).scaled(factor)


def _rounded(place: Array) -> Array:
    """Round to millimetres and a tenth of a degree, as a base can be set up."""
    shift = np.round(place[..., :3], 3)
    yaw = np.round(np.degrees(place[..., 3:]), 1)
    return np.concatenate([shift, np.radians(yaw)], axis=-1) + 0.0
