"""Rounds of a trajectory's program: solve, check densely, enforce what was violated, and again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import at_rows, in_rounds
from geodesic_ocp.cells import Indices
from geodesic_ocp.execution.arm_paths import (
    INSIDE,
    OUTSIDE,
    ArmPaths,
    JointSpline,
    Knots,
    KnotStates,
    Reference,
    hand_speeds,
    stretched,
    through,
    union_of_edges,
)
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.execution.limits import QUANTITIES, LimitShares
from geodesic_ocp.execution.trajectory_program import (
    TrajectoryProgram,
    Watched,
    WatchedArm,
    jerks_between,
)
from geodesic_ocp.ipopt import Outcome
from geodesic_ocp.trajectory.interpolation import JERK_OVERSHOOT

TOLERANCE = 1e-6  # of limits, relative, or [rad or m] of positions and distances
# of every piece, both ends included, for torques and for distances
_SAMPLES = 21
_FEW = 7
_NEARBY = 0.05  # [m] above its bound at a knot, from which on a distance is computed between knots


@dataclass(frozen=True, eq=False)
class ArmCheck:
    """Shares of an arm's limits in every piece of its spline.

    Attributes:
        arm: arm with its limits.
        spline: spline of its joints.
    """

    arm: ArmPaths
    spline: JointSpline

    @cached_property
    def pieces(self) -> Mapping[str, Array]:
        """Largest shares in every piece (k, n) by the kind of limit; all are exact.

        Positions count from the ends of their ranges: one and the distance beyond [rad or m].
        Jerks are those of a controller's interpolation around the end of a piece.
        """
        spline = self.spline
        limits = self.arm.limits
        (lower, upper) = self.arm.ranges
        low, high = spline.extreme_positions
        beyond = np.maximum(lower - low, high - upper)
        _, _, a, jerk = spline(spline.curve.x)
        jerk[-1] = 0.0  # of the rest that follows
        growth = np.abs(a) / limits.acceleration
        return {
            "position": 1.0 + OUTSIDE + beyond,
            "velocity": spline.extreme_velocities / limits.velocity,
            "acceleration": np.maximum(growth[:-1], growth[1:]),
            "jerk": np.max(np.abs(jerks_between(jerk[:-1], jerk[1:])), axis=0) / limits.jerk,
        }

    @cached_property
    def sampled(self) -> Mapping[str, Array]:
        """Shares at evenly spaced times in every piece, (k, samples, n), by the kind of limit.

        Rates of torques are differences of second order; of the hand there is one share.
        """
        arm = self.arm
        limits = self.arm.limits
        time = self.spline.within_pieces(_SAMPLES)
        shape = (*time.shape, arm.robot.dof)
        found = {"torque": np.zeros(shape), "torque_rate": np.zeros(shape)}
        found["hand_speed"] = np.zeros((*time.shape, 1))
        q, v, a, _ = self.spline(time.ravel())
        if np.isfinite([limits.torque, limits.torque_rate]).any():
            force = arm.robot.inverse_dynamics(q, v, a, arm.gravity).reshape(shape)
            rate = np.gradient(force, axis=1, edge_order=2) / np.diff(time[:, :2])[..., None]
            found["torque"] = np.abs(force) / limits.torque
            found["torque_rate"] = np.abs(rate) / limits.torque_rate
        if np.isfinite(limits.hand_speed):
            speed = hand_speeds(arm.robot, q, v).reshape(*time.shape, 1)
            found["hand_speed"] = speed / limits.hand_speed
        return found

    @property
    def largest(self) -> dict[str, Array]:
        """Largest shares of the whole spline (n,), by the kind of limit."""
        shares = {kind: of_pieces.max(axis=0) for kind, of_pieces in self.pieces.items()}
        return shares | {kind: each.max(axis=(0, 1)) for kind, each in self.sampled.items()}

    @property
    def shares(self) -> LimitShares:
        """Largest shares of the whole spline, without positions."""
        of_joints = {name: self.largest[name] for name in QUANTITIES}
        jerks = np.abs(self.spline(self.spline.curve.x)[3]).max(axis=0)
        of_joints["jerk"] = jerks / self.arm.limits.jerk
        return LimitShares(**of_joints, hand_speed=float(self.largest["hand_speed"][0]))

    @property
    def worst(self) -> tuple[float, str]:
        """Return the worst excess over a limit, relative or [rad or m], and a clause on it."""
        largest = self.largest
        kind = max(largest, key=lambda name: float(largest[name].max()))
        joint = int(largest[kind].argmax())
        whose = "the hand" if kind == "hand_speed" else self.arm.robot.joint_names[joint]
        name = f"the {kind.removeprefix('hand_').replace('_', ' ')} of {whose} exceeds its limit"
        return float(largest[kind][joint]) - 1.0, name


# Shares of the limits, one and [rad] for positions, from which on a limit is enforced as well where
# it is exceeded elsewhere.
_NEAR = {"velocity": 0.98, "position": 1.0 - 0.01, "jerk": 0.2}
# a share, and [m]
_NEAR_SAMPLED = 0.85
_NEAR_DISTANCE = 0.01
# Share of the hand's speed from which on its limit is enforced at first; everywhere if most pieces
# have it.
_FAST = 0.5
# what lies between knots is corrected by a little more
_MORE = 1.2
_ROUNDING = 2e-6
_NONE: Indices = np.zeros(0, dtype=np.int64)


def watched_at_first(program: TrajectoryProgram, states: KnotStates) -> Watched:
    """Return jerks of joints that take longer than a piece to reach their accelerations, and speeds
    of the hand where it is fast.

    Args:
        program: program with its knots.
        states: states at the knots to start from.
    """
    steps = program.knots.steps(states.durations)[:, None]
    arms = []
    for terms, (q, v, _) in zip(program.terms, states.arms, strict=True):
        # From rest, the overshoot of a controller's interpolation left out.
        jerk = terms.arm.limits.jerk / (1.0 + JERK_OVERSHOOT)
        slow = np.argwhere(jerk * steps < terms.units[2])
        least = _FAST * terms.arm.limits.hand_speed
        sampled = {}
        if np.isfinite(least):
            fast = hand_speeds(terms.arm.robot, q, v) > least
            (pieces,) = np.nonzero(fast[:-1] | fast[1:])
            pieces = np.arange(len(q) - 1) if 2 * pieces.size > len(q) - 1 else pieces
            if pieces.size:
                sampled["hand_speed"] = pieces, np.full((len(q) - 1, 1), 1.0 - INSIDE)
        arms.append(WatchedArm({"jerk": slow} if slow.size else {}, sampled))
    lower = np.where(program.fixed_knots[:, None], -np.inf, program.clearance.lower)
    return Watched(tuple(arms), {}, lower)


def tightened(found: TrajectoryAttempt) -> Watched:
    """Return the constraints of the round that follows."""
    arms = map(_arm, found.watched.arms, found.checks)
    lack = found.program.clearance.lower - found.distances
    close, more = _at_knots_of(lack, -_NEAR_DISTANCE, 0.0, TOLERANCE)
    knots = dict(found.watched.knots)
    for index in np.flatnonzero(lack.max(axis=(0, 1)) > TOLERANCE).tolist():
        knots[index] = np.union1d(knots.get(index, _NONE), np.flatnonzero(close[:, index]))
    return Watched(tuple(arms), knots, found.watched.distances + more)


def _arm(watched: WatchedArm, check: ArmCheck) -> WatchedArm:
    pieces = dict(watched.pieces)
    for kind, near in _NEAR.items():
        shares = check.pieces[kind]
        if shares.max() > 1.0 + TOLERANCE:
            known = pieces.get(kind, np.zeros((0, 2), dtype=np.int64))
            pieces[kind] = np.unique(np.vstack([known, np.argwhere(shares > near)]), axis=0)
    sampled = dict(watched.sampled)
    for kind, shares in check.sampled.items():
        if shares.max() <= 1.0 + TOLERANCE:
            continue
        if kind != "torque":  # the program keeps a mean, or the speed at quarters of pieces
            rows = shares.mean(axis=1) if kind == "torque_rate" else shares[:, 5::10].max(axis=1)
            rows = rows - 1.0
            largest = shares.max(axis=1) - 1.0
            close = np.maximum(rows - _NEAR_SAMPLED + 1.0, largest) > 0.0
            more = _beyond(largest, 0.0, np.maximum(rows, -INSIDE))
        else:
            close, more = _at_knots_of(shares - 1.0, _NEAR_SAMPLED - 1.0, -INSIDE, 0.0)
        numbers, allowed = sampled.get(kind, (_NONE, np.full(close.shape, 1.0 - INSIDE)))
        numbers = np.union1d(numbers, np.flatnonzero(close.any(axis=1)))
        sampled[kind] = numbers, allowed * (1.0 - np.minimum(more, 0.5))
    return WatchedArm(pieces, sampled)


def _at_knots_of(
    excess: Array, near: float, kept: float, tolerance: float
) -> tuple[NDArray[np.bool_], Array]:
    """Return knots at which limits are to be enforced, and what is to be taken off there, each
    (knots, m).

    The program will keep limits at knots: what values exceed them by in between is taken off.

    Args:
        excess: excess of values over their limits (pieces, samples, m).
        near: excess of a value at a knot from which on its limit is enforced there.
        kept: excess that the program allows at knots.
        tolerance: tolerance of values between knots.
    """
    largest = excess.max(axis=1)
    at_knots = np.concatenate([excess[:, 0], excess[-1:, -1]])
    beyond = largest > tolerance
    ends = np.maximum(np.maximum(at_knots[:-1], at_knots[1:]), kept)
    more = _beyond(largest, tolerance, ends)
    return (at_knots > near) | (_at_both_ends(beyond) > 0.0), _at_both_ends(more)


def _beyond(largest: Array, tolerance: float, kept: Array) -> Array:
    """Return what is to be taken off in every piece."""
    return np.where(largest > tolerance, _MORE * (largest - kept) + _ROUNDING, 0.0)


def _at_both_ends(of_pieces: Array) -> Array:
    """Return at the knots, the larger one of two successive pieces."""
    padded = np.pad(of_pieces, ((1, 1), (0, 0)))
    return np.maximum(padded[:-1], padded[1:])


MOST_ROUNDS = 15
_COARSE = 2.0  # spacing of the knots by which durations are first found
_OTHER_COUNT = 0.15  # change of the number of knots that is worth it, once durations are known
# The nearest points of the paths are found anew until the duration changes by less than this.
_SETTLED = 0.005
# From this round on, a trajectory that exceeds limits by no more than this is slowed down as a
# whole: in all its rates it is then within them.
_LATE = 3
_SLIGHTLY = 0.02
# The first guess, and others if Ipopt fails from it: time stretched more, stops in corners, and the
# most iterations. A round takes twenty as a rule: where it takes many, another start is quicker.
_STARTS = ((1.3, False, 100), (2.0, False, 100), (1.3, True, 400), (3.0, True, 400))


@dataclass(frozen=True, eq=False)
class TrajectoryAttempt:
    """Outcome of a round.

    Attributes:
        program: program that was solved.
        states: at its knots.
        watched: its constraints.
        checks: checks of the arms, with their splines.
        distances: in every piece (pieces, samples, m) [m].
        excess: largest excess over a limit, relative or [rad or m].
        change: change of the duration in this round, relative.
        outcome: outcome of Ipopt.
        status: in words.
        iterations: iterations of Ipopt.
    """

    program: TrajectoryProgram
    states: KnotStates
    watched: Watched
    checks: tuple[ArmCheck, ...]
    distances: Array
    excess: float
    change: float
    outcome: Outcome
    status: str
    iterations: int

    @property
    def success(self) -> bool:
        """True if all limits are kept."""
        return self.outcome.success and self.excess <= TOLERANCE


def solve_in_rounds(
    arms: Sequence[ArmPaths],
    clearance: Clearance,
    *,
    rest: bool,
    deviation_weight: float,
    progress: Callable[[int], object],
) -> TrajectoryAttempt:
    """Return the trajectory within all limits, or the best attempt."""
    edges = union_of_edges(arms)
    knots = Knots.spaced(edges, np.diff(edges))
    program = TrajectoryProgram(arms, clearance, rest, deviation_weight, knots)
    attempts: list[TrajectoryAttempt] = []
    for more, stops, most in _STARTS:
        attempts.append(_from_start(_first_guess(program, more, stops), progress, most))
        if attempts[-1].success:
            break
    best = min(attempts, key=lambda attempt: (not attempt.success, attempt.excess))
    return replace(best, iterations=sum(attempt.iterations for attempt in attempts))


# The program of a round with the states to start from, the references, and its constraints.
_Start: TypeAlias = tuple[TrajectoryProgram, KnotStates, Sequence[Reference], Watched]


def _from_start(first: _Start, progress: Callable[[int], object], most: int) -> TrajectoryAttempt:
    attempts: list[TrajectoryAttempt] = []

    def solve(given: _Start) -> TrajectoryAttempt:
        progress(len(attempts))
        attempts.append(_attempt(given, most))
        return attempts[-1]

    def examine(number: int, found: TrajectoryAttempt) -> tuple[TrajectoryAttempt, _Start | None]:
        if not found.outcome.success or (found.success and found.change <= _SETTLED):
            return found, None
        if number >= _LATE and TOLERANCE < found.excess <= _SLIGHTLY:
            attempts.append(replace(slowed(found, 1.0 + found.excess), iterations=0))
            if attempts[-1].success:
                return attempts[-1], None
        program = found.program
        states = found.states
        fitting = Knots.spaced(program.knots.edges, states.durations)
        if number == 0 and abs(fitting.count / program.knots.count - 1.0) > _OTHER_COUNT:
            program = replace(program, knots=fitting)
            time = fitting.times(states.durations)
            splines = (np.array(check.spline(time)[:3]) for check in found.checks)
            states = KnotStates(states.durations, tuple(splines))
            watched = watched_at_first(program, states)
        else:
            watched = tightened(found)
        pairs = zip(program.terms, states.arms, strict=True)
        nearest = [terms.nearest(q) for terms, (q, _, _) in pairs]
        return found, (program, states, nearest, watched)

    found = in_rounds(first, solve, examine, MOST_ROUNDS)
    kept = next((each for each in reversed(attempts) if each.success), found)
    return replace(kept, iterations=sum(each.iterations for each in attempts))


def _attempt(start: _Start, most: int) -> TrajectoryAttempt:
    program, before, references, watched = start
    outcome = program.solve(before, references, watched, most)
    change = abs(program.states(outcome.x).durations.sum() / before.durations.sum() - 1.0)
    return _checked(program, program.states(outcome.x), watched, change, outcome)


def slowed(found: TrajectoryAttempt, slower: float) -> TrajectoryAttempt:
    """Return the same motion, so many times slower, with the iterations that found it."""
    if slower == 1.0:
        return found
    arms = tuple(states / slower ** np.arange(3.0)[:, None, None] for states in found.states.arms)
    states = KnotStates(found.states.durations * slower, arms)
    given = found.program, states, found.watched, found.excess, found.outcome
    return replace(_checked(*given), iterations=found.iterations)


def _checked(
    program: TrajectoryProgram,
    states: KnotStates,
    watched: Watched,
    change: float,
    outcome: Outcome,
) -> TrajectoryAttempt:
    """Return the attempt with these states at the knots, checked densely."""
    clearance = program.clearance
    # Splines have none of the rounding that the program's equations leave at the knots.
    time = program.knots.times(states.durations)
    checks = []
    for arm, (q, v, _) in zip(program.arms, states.arms, strict=True):
        curve = CubicSpline(time, q, bc_type=((1, v[0]), (1, v[-1])))
        checks.append(ArmCheck(arm, JointSpline(curve)))
    distances = _distances(clearance, [check.spline for check in checks])
    found = [check.worst for check in checks]
    if clearance.names:
        lack = (clearance.lower - distances).max(axis=(0, 1))
        index = int(lack.argmax())
        found.append((float(lack[index]), f"the distance {clearance.names[index]} is too small"))
    excess, worst = max(found, key=lambda pair: pair[0])
    status = "within all limits" if outcome.success else outcome.status
    if excess > TOLERANCE:
        status = f"{outcome.status}; {worst} by {excess:.2g}"
    return TrajectoryAttempt(
        program,
        states,
        watched,
        tuple(checks),
        distances,
        excess,
        change,
        outcome,
        status,
        outcome.iterations,
    )


def _distances(clearance: Clearance, splines: Sequence[JointSpline]) -> Array:
    """Return distances in every piece (pieces, samples, m) [m]; infinite between knots where they
    are large.
    """

    def at(function: ca.Function, times: Array) -> Array:
        q = np.hstack([spline(times.ravel())[0] for spline in splines])
        return at_rows(function, q).reshape(*times.shape, -1)

    times = splines[0].within_pieces(_FEW)
    knots = at(clearance.function, np.append(times[:, 0], times[-1, -1]))
    found = np.full((*times.shape, len(clearance.names)), np.inf)
    found[:, 0] = knots[:-1]
    found[:, -1] = knots[1:]
    near = np.flatnonzero(np.any(knots < clearance.lower + _NEARBY, axis=0)).tolist()
    if near:
        found[:, 1:-1, near] = at(clearance.row(*near), times[:, 1:-1])
    return found


def _first_guess(coarse: TrajectoryProgram, more: float, stops: bool) -> _Start:
    """Return the paths in time that is stretched until limits are nearly kept, times `more`.

    Args:
        coarse: program with knots for the person's durations.
        more: by which time is stretched further.
        stops: whether the arms stop in corners.
    """
    arms = coarse.arms
    rest = coarse.rest
    edges = coarse.knots.edges
    references = [terms.as_recorded(rest, stops) for terms in coarse.terms]
    durations = stretched(arms, references, coarse.knots, rest)
    program = replace(coarse, knots=Knots.spaced(edges, durations, _COARSE))
    references = [terms.as_recorded(rest, stops) for terms in program.terms]
    states = through(references, program.knots, more * durations, rest)
    pairs = zip(program.terms, references, strict=True)
    references = [terms.timed(reference) for terms, reference in pairs]
    return program, states, references, watched_at_first(program, states)
