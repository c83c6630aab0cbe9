"""Rounds of the program: solve, check densely, mind what was violated, solve again.

Variables: durations of the intervals between edges, no shorter than the person's; positions,
velocities and accelerations of all arms at the knots. Objective: the time beyond the person's, the
mean squared distance from the paths, and small weights on accelerations and jerks, which are taken
relative to their limits. Every arm passes the ends of its paths at its edges.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.blocks import Block, BlockProgram, Terms, in_rounds
from geodesic_ocp.cells import Indices
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.execution.limits import QUANTITIES, LimitShares
from geodesic_ocp.execution.reference import (
    INSIDE,
    Course,
    JointSpline,
    Knots,
    KnotStates,
    Reference,
    stretched,
    through,
    union_of_edges,
)
from geodesic_ocp.execution.trajectory_terms import (
    ArmTerms,
    TrajectorySettings,
    position_bounds,
    variable_bounds,
)
from geodesic_ocp.ipopt import Outcome


@dataclass(frozen=True, eq=False)
class WatchedArm:
    """Limits of one arm.

    Attributes:
        pieces: pieces by kind of limit ("jerk", "velocity", "position"): numbers (k, 2) of pieces
            and joints.
        torques: numbers of the knots at which torques are limited (k,).
        torque_shares: torque shares of the limits that torques may reach at the knots, (knots, n);
            less than all where a torque is larger between the knots.
    """

    pieces: Mapping[str, Indices]
    torques: Indices
    torque_shares: Array


@dataclass(frozen=True, eq=False)
class WatchedDistances:
    """Distances of one clearance.

    Attributes:
        clearance: the distances.
        knots: at which each is kept, by its index.
        lower: bounds at all knots (knots, m) [m]; more than the clearance's where a distance is
            smaller between the knots, -inf where the configuration is given.
    """

    clearance: Clearance
    knots: Mapping[int, Indices]
    lower: Array


@dataclass(frozen=True, eq=False)
class Watched:
    """Constraints of a program, beside those that it always has.

    Attributes:
        arms: limits of each arm.
        clearances: distances of each clearance.
    """

    arms: tuple[WatchedArm, ...]
    clearances: tuple[WatchedDistances, ...]


TOLERANCE = 1e-6  # of limits, relative, or [rad or m] of positions and distances
_SAMPLES, _FEW = 21, 7  # of every piece, both ends included, for torques and for distances


@dataclass(frozen=True, eq=False)
class ArmCheck:
    """Shares of an arm's limits in every piece of its spline.

    Attributes:
        arm: arm with its limits.
        spline: spline of its joints.
        position_bounds: (n,) each [rad or m].
    """

    arm: ArmPaths
    spline: JointSpline
    position_bounds: tuple[Array, Array]

    @cached_property
    def pieces(self) -> Mapping[str, Array]:
        """Largest shares in every piece (k, n) by the kind of limit; all are exact.

        Positions count from their bounds: one and the distance beyond them [rad or m].
        """
        spline, limits = self.spline, self.arm.limits
        low, high = spline.extreme_positions
        beyond = np.maximum(self.position_bounds[0] - low, high - self.position_bounds[1])
        _, _, a, jerk = spline(spline.curve.x)
        growth = np.abs(a) / limits.acceleration
        return {
            "position": 1.0 + beyond,
            "velocity": spline.extreme_velocities / limits.velocity,
            "acceleration": np.maximum(growth[:-1], growth[1:]),
            "jerk": np.abs(jerk[:-1]) / limits.jerk,
        }

    @cached_property
    def torques(self) -> Array:
        """Shares of the torques at evenly spaced times in every piece, (k, samples, n)."""
        limit = self.arm.limits.torque
        shape = (self.spline.curve.x.size - 1, _SAMPLES, limit.size)
        if not np.any(np.isfinite(limit)):
            return np.zeros(shape)
        states = self.spline(self.spline.within_pieces(_SAMPLES).ravel())[:3]
        force = self.arm.robot.inverse_dynamics(*states, self.arm.gravity)
        return np.asarray((np.abs(force) / limit).reshape(shape))

    @property
    def largest(self) -> dict[str, Array]:
        """Largest shares of the whole spline (n,), by the kind of limit."""
        shares = {kind: of_pieces.max(axis=0) for kind, of_pieces in self.pieces.items()}
        return {**shares, "torque": self.torques.max(axis=(0, 1))}

    @property
    def shares(self) -> LimitShares:
        """Largest shares of the whole spline, without positions."""
        return LimitShares(**{name: self.largest[name] for name in QUANTITIES})

    @property
    def worst(self) -> tuple[float, str]:
        """Return the worst excess over a limit, relative or [rad or m], and a clause on it."""
        largest = self.largest
        kind = max(largest, key=lambda name: float(largest[name].max()))
        joint = int(largest[kind].argmax())
        name = f"the {kind} of {self.arm.robot.joint_names[joint]} exceeds its limit"
        return float(largest[kind][joint]) - 1.0, name


def distances_in_pieces(clearance: Clearance, splines: Sequence[JointSpline]) -> Array:
    """Return distances at evenly spaced times in every piece, (pieces, samples, m) [m]."""
    times = splines[0].within_pieces(_FEW)
    q = np.hstack([spline(times.ravel())[0] for spline in splines])
    found = evaluate(clearance.function.map(len(q)), q.T).T
    return np.asarray(found.reshape(*times.shape, -1))


# The objective counts time beyond the person's as a fraction of the person's; squared distances and
# jerks are integrated over the trajectory's time.
_DISTANCE = 0.1  # from the paths [rad] that costs, if kept up, as much as the time it is kept up
_UNEVEN = 0.05  # of the squared stretch of an interval
_SHORT = 0.2  # intervals shorter than this [s] may be stretched more
_JERK, _JERK_TIME = 1e-3, 0.05  # when an acceleration changes by its limit in this time [s]
_IPOPT = {
    "tol": 1e-6,
    "constr_viol_tol": 1e-9,
    "dual_inf_tol": 1e-3,
    "acceptable_iter": 0,
    "mu_strategy": "adaptive",
    "bound_relax_factor": 1e-9,
}


@dataclass(frozen=True, eq=False)
class TrajectoryProgram:
    """The program for given knots.

    Attributes:
        arms: arms with their paths and limits.
        knots: in time.
        settings: settings of the trajectory.
    """

    arms: Sequence[ArmPaths]
    knots: Knots
    settings: TrajectorySettings

    @cached_property
    def courses(self) -> tuple[Course, ...]:
        """Paths of the arms over the knots."""
        return tuple(Course(arm, self.knots) for arm in self.arms)

    @cached_property
    def terms(self) -> tuple[ArmTerms, ...]:
        """Terms of the arms."""
        first, found = self.knots.person.size, []
        for course in self.courses:
            found.append(ArmTerms(course, first))
            first += 3 * course.arm.robot.dof * (self.knots.count + 1)
        return tuple(found)

    def solve(
        self, start: KnotStates, references: Sequence[Reference], watched: Watched, most: int
    ) -> Outcome:
        """Return the solution near references, with the limits that are to be minded.

        Args:
            start: states at the knots.
            references: references of the arms.
            watched: constraints.
            most: number of Ipopt's iterations.
        """
        x, blocks = self.as_x(start), self._blocks(start.durations, references, watched)
        options = {**_IPOPT, "max_iter": most}
        return BlockProgram(x.size, blocks).solve(x, self.bounds, options)

    def _blocks(
        self, durations: Array, references: Sequence[Reference], watched: Watched
    ) -> list[Block]:
        """Return integrals over time are by the trapezoidal rule for these durations (m,)."""
        knots, settings = self.knots, self.settings
        total = float(knots.person.sum())
        steps = durations[knots.interval] * knots.fraction
        shares = np.convolve(steps, [0.5, 0.5]) / total
        distance = settings.deviation_weight / _DISTANCE**2
        jerk = _JERK * _JERK_TIME**2 / (total * steps)
        blocks = [self._stretch(total)]
        for k, (terms, reference) in enumerate(zip(self.terms, references, strict=True)):
            blocks.append(terms.deviation(reference, shares, distance))
            blocks.append(terms.motion(jerk, settings.tolerance is None))
            limits = watched.arms[k]
            blocks += [terms.between_knots(kind, pairs) for kind, pairs in limits.pieces.items()]
            if limits.torques.size:
                allowed = limits.torque_shares[limits.torques]
                blocks.append(terms.torques(limits.torques, allowed))
            if settings.tolerance is not None:
                blocks.append(terms.hand_poses(settings.tolerance))
            if not settings.rest:
                blocks.append(terms.end_speeds())
        for kept in watched.clearances:
            blocks += [self._distance(kept, index) for index in kept.knots]
        return blocks

    def _distance(self, kept: WatchedDistances, index: int) -> Block:
        """Return one distance at some of the knots."""
        knots, q = kept.knots[index], ca.SX.sym("q", kept.clearance.dof)
        distance = kept.clearance.row(index)(q)
        columns = np.hstack([terms.indices(knots, 1) for terms in self.terms])
        lower = kept.lower[knots, index, None]
        upper = np.full_like(lower, np.inf)
        return Block(Terms(q, constraints=distance), columns, None, lower, upper)

    def _stretch(self, total: float) -> Block:
        """Get the time beyond the person's, and its square, so that no interval bears all of it."""
        person = self.knots.person
        duration, p = ca.SX.sym("T"), ca.SX.sym("p", 3)
        more = duration - p[0]
        objective = p[1] * more + p[2] * more**2
        uneven = _UNEVEN / (total * (person + _SHORT))
        values = np.stack([person, np.full(person.size, 1.0 / total), uneven], axis=1)
        return Block(Terms(duration, p, objective), np.arange(person.size)[:, None], values)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Bounds of the variables."""
        person = self.knots.person
        sides = [variable_bounds(course, self.settings) for course in self.courses]
        lower, upper = zip(*sides, strict=True)
        return (
            np.concatenate([person, *map(np.ravel, lower)]),
            np.concatenate([np.full(person.size, np.inf), *map(np.ravel, upper)]),
        )

    @cached_property
    def fixed_knots(self) -> NDArray[np.bool_]:
        """Knots at which the configuration of every arm is given, (knots,)."""
        lower, upper = (np.hstack(self.states(bound).positions) for bound in self.bounds)
        return np.asarray(np.all(lower == upper, axis=1))

    def as_x(self, states: KnotStates) -> Array:
        """Return vector of the variables."""
        states_of = states.positions, states.velocities, states.accelerations
        pairs = zip(self.terms, *states_of, strict=True)
        arms = [(np.stack(own, axis=1) / terms.units[:3]).ravel() for terms, *own in pairs]
        return np.concatenate([states.durations, *arms])

    def states(self, x: Array) -> KnotStates:
        """Return values of the variables from their vector."""
        found = []
        for terms in self.terms:
            size = 3 * terms.dof * (self.knots.count + 1)
            own = x[terms.first : terms.first + size].reshape(-1, 3, terms.dof)
            found.append((own * terms.units[:3]).transpose(1, 0, 2))
        return KnotStates(x[: self.knots.person.size], *zip(*found, strict=True))


# Shares of the limits, one and [rad] for positions, from which on a limit is minded as well where
# it is exceeded elsewhere.
_NEAR = {"velocity": 0.98, "position": 1.0 - 0.01, "jerk": 0.2}
_NEAR_TORQUE, _NEAR_DISTANCE = 0.85, 0.01  # a share, and [m]
_MORE, _ROUNDING = 1.2, 2e-6  # what lies between knots is corrected by a little more


def watched_at_first(
    program: TrajectoryProgram, durations: Array, clearances: Sequence[Clearance]
) -> Watched:
    """Return jerks of joints that take longer than a piece to reach their accelerations, and no
    more.

    Args:
        program: program with its knots.
        durations: durations of the intervals (m,) [s].
        clearances: distances to be kept.
    """
    count, given = program.knots.count + 1, program.fixed_knots[:, None]
    steps, arms = np.diff(program.knots.times(durations))[:, None], []
    for terms in program.terms:
        slow = np.argwhere(terms.arm.limits.jerk * steps < terms.units[2])
        pieces = {"jerk": slow} if slow.size else {}
        shares = np.full((count, terms.dof), 1.0 - INSIDE)
        arms.append(WatchedArm(pieces, np.zeros(0, dtype=np.int64), shares))
    distances = [
        WatchedDistances(each, {}, np.where(given, -np.inf, each.lower)) for each in clearances
    ]
    return Watched(tuple(arms), tuple(distances))


def tightened(watched: Watched, checks: Sequence[ArmCheck], distances: Sequence[Array]) -> Watched:
    """Return the constraints of the next round.

    Args:
        watched: those of the last round.
        checks: checks of its result.
        distances: in every piece (pieces, samples, m) [m], of each clearance.
    """
    arms = [_arm(each, check) for each, check in zip(watched.arms, checks, strict=True)]
    kept = [_kept(each, at) for each, at in zip(watched.clearances, distances, strict=True)]
    return Watched(tuple(arms), tuple(kept))


def _arm(watched: WatchedArm, check: ArmCheck) -> WatchedArm:
    pieces = dict(watched.pieces)
    for kind, near in _NEAR.items():
        shares = check.pieces[kind]
        if shares.max() > 1.0 + TOLERANCE:
            known = pieces.get(kind, np.zeros((0, 2), dtype=np.int64))
            pieces[kind] = np.unique(np.vstack([known, np.argwhere(shares > near)]), axis=0)
    if check.torques.max() <= 1.0 + TOLERANCE:
        return WatchedArm(pieces, watched.torques, watched.torque_shares)
    close, more = _at_knots_of(check.torques - 1.0, _NEAR_TORQUE - 1.0, -INSIDE, 0.0)
    knots = np.union1d(watched.torques, np.flatnonzero(close.any(axis=1)))
    return WatchedArm(pieces, knots, watched.torque_shares * (1.0 - np.minimum(more, 0.5)))


def _kept(watched: WatchedDistances, found: Array) -> WatchedDistances:
    """Return distances to keep from now on, given those that were found (pieces, samples, m)."""
    lack, knots = watched.clearance.lower - found, dict(watched.knots)
    close, more = _at_knots_of(lack, -_NEAR_DISTANCE, 0.0, TOLERANCE)
    for index in np.flatnonzero(lack.max(axis=(0, 1)) > TOLERANCE).tolist():
        known: Indices = knots.get(index, np.zeros(0, dtype=np.int64))
        knots[index] = np.union1d(known, np.flatnonzero(close[:, index]))
    return WatchedDistances(watched.clearance, knots, watched.lower + more)


def _at_knots_of(
    excess: Array, near: float, kept: float, tolerance: float
) -> tuple[NDArray[np.bool_], Array]:
    """Return knots at which limits are to be minded, and what is to be taken off there, (knots, m)
    each.

    The program will keep limits at knots: what values exceed them by in between is taken off.

    Args:
        excess: excess of values over their limits (pieces, samples, m).
        near: excess of a value at a knot from which on its limit is minded there.
        kept: excess that the program allows at knots.
        tolerance: tolerance of values between knots.
    """
    largest, at_knots = excess.max(axis=1), np.concatenate([excess[:, 0], excess[-1:, -1]])
    beyond = largest > tolerance
    ends = np.maximum(np.maximum(at_knots[:-1], at_knots[1:]), kept)
    more = np.where(beyond, _MORE * (largest - ends) + _ROUNDING, 0.0)
    return (at_knots > near) | (_at_both_ends(beyond) > 0.0), _at_both_ends(more)


def _at_both_ends(of_pieces: Array) -> Array:
    """Return at the knots, the larger one of two successive pieces."""
    padded = np.pad(of_pieces, ((1, 1), (0, 0)))
    return np.maximum(padded[:-1], padded[1:])


MOST_ROUNDS = 15
_OTHER_COUNT = 0.15  # change of the number of knots that is worth it, once durations are known
# The nearest points of the paths are found anew until the duration changes by less than this.
_SETTLED = 0.005
# The first guess, and others if Ipopt fails from it: time stretched more, and stops in corners. A
# round takes twenty iterations as a rule: where it takes many, another start is quicker.
_STARTS = ((1.3, False), (2.0, False), (1.3, True), (3.0, True))
_ITERATIONS = (100, 100, 400, 400)


@dataclass(frozen=True, eq=False)
class TrajectoryAttempt:
    """Outcome of a round.

    Attributes:
        program: program that was solved.
        states: at its knots.
        watched: its constraints.
        checks: checks of the arms, with their splines.
        distances: in every piece (pieces, samples, m) [m], of each clearance.
        excess: largest excess over a limit, relative or [rad or m].
        change: change of the duration in this round, relative.
        solved: whether Ipopt found a solution.
        status: in words.
        iterations: iterations of Ipopt.
    """

    program: TrajectoryProgram
    states: KnotStates
    watched: Watched
    checks: tuple[ArmCheck, ...]
    distances: tuple[Array, ...]
    excess: float
    change: float
    solved: bool
    status: str
    iterations: int

    @property
    def success(self) -> bool:
        """True if all limits are kept."""
        return self.solved and self.excess <= TOLERANCE

    @property
    def knots(self) -> Knots:
        """Knots of the trajectory in time."""
        return self.program.knots

    @property
    def durations(self) -> Array:
        """Durations of the intervals (m,) [s]."""
        return self.states.durations

    @property
    def least_distances(self) -> tuple[Array, ...]:
        """Least distance of each clearance (m,) [m]."""
        return tuple(each.min(axis=(0, 1)) for each in self.distances)


def solve_in_rounds(
    arms: Sequence[ArmPaths],
    settings: TrajectorySettings,
    clearances: Sequence[Clearance],
    progress: Callable[[int], object],
) -> TrajectoryAttempt:
    """Return the trajectory within all limits, or the best attempt."""
    attempts: list[TrajectoryAttempt] = []
    for start, most in zip(_STARTS, _ITERATIONS, strict=True):
        attempts.append(_from_start(arms, settings, clearances, progress, start, most))
        if attempts[-1].success:
            break
    best = min(attempts, key=lambda attempt: (not attempt.success, attempt.excess))
    return replace(best, iterations=sum(attempt.iterations for attempt in attempts))


def _from_start(
    arms: Sequence[ArmPaths],
    settings: TrajectorySettings,
    clearances: Sequence[Clearance],
    progress: Callable[[int], object],
    start: tuple[float, bool],
    most: int,
) -> TrajectoryAttempt:
    program, states, references = _first_guess(arms, settings, *start)
    watched = watched_at_first(program, states.durations, clearances)
    first: _Start = program, states, references, watched
    attempts: list[TrajectoryAttempt] = []

    def solve(given: _Start) -> TrajectoryAttempt:
        progress(len(attempts))
        attempts.append(_attempt(*given, most))
        return attempts[-1]

    def examine(number: int, found: TrajectoryAttempt) -> tuple[TrajectoryAttempt, _Start | None]:
        if not found.solved or (found.success and found.change <= _SETTLED):
            return found, None
        program, states = found.program, found.states
        watched = tightened(found.watched, found.checks, found.distances)
        if number == 0:
            fitting = Knots.spaced(program.knots.edges, states.durations)
            if abs(fitting.count / program.knots.count - 1.0) > _OTHER_COUNT:
                program = replace(program, knots=fitting)
                states = _at_knots(program, found.checks, states.durations)
                watched = watched_at_first(program, states.durations, clearances)
        pairs = zip(program.courses, states.positions, strict=True)
        return found, (program, states, [course.nearest(q) for course, q in pairs], watched)

    found = in_rounds(first, solve, examine, MOST_ROUNDS)
    kept = next((each for each in reversed(attempts) if each.success), found)
    return replace(kept, iterations=sum(each.iterations for each in attempts))


# The program of a round with the states to start from, the references, and its constraints.
_Start: TypeAlias = tuple[TrajectoryProgram, KnotStates, Sequence[Reference], Watched]


def _attempt(
    program: TrajectoryProgram,
    before: KnotStates,
    references: Sequence[Reference],
    watched: Watched,
    most: int,
) -> TrajectoryAttempt:
    outcome = program.solve(before, references, watched, most)
    states = program.states(outcome.x)
    checks = tuple(
        ArmCheck(course.arm, spline, position_bounds(course))
        for course, spline in zip(program.courses, _splines(program, states), strict=True)
    )
    splines = [check.spline for check in checks]
    clearances = [each.clearance for each in watched.clearances]
    distances = tuple(distances_in_pieces(each, splines) for each in clearances)
    excess, worst = _worst(checks, clearances, distances)
    status = "within all limits" if outcome.success else outcome.status
    if excess > TOLERANCE:
        status = f"{outcome.status}; {worst} by {excess:.2g}"
    change = abs(states.durations.sum() / before.durations.sum() - 1.0)
    return TrajectoryAttempt(
        *(program, states, watched, checks, distances, excess, change),
        *(outcome.success, status, outcome.iterations),
    )


def _first_guess(
    arms: Sequence[ArmPaths], settings: TrajectorySettings, more: float, stops: bool
) -> tuple[TrajectoryProgram, KnotStates, list[Reference]]:
    """Return the paths in time that is stretched until limits are nearly kept, times `more`."""
    edges = union_of_edges(arms)
    coarse = TrajectoryProgram(arms, Knots.spaced(edges, np.diff(edges)), settings)
    references = [course.as_recorded(settings.rest, stops) for course in coarse.courses]
    durations = stretched(arms, references, coarse.knots, settings.rest)
    program = TrajectoryProgram(arms, Knots.spaced(edges, durations), settings)
    references = [course.as_recorded(settings.rest, stops) for course in program.courses]
    states = through(references, program.knots, more * durations, settings.rest)
    return program, states, references


def _at_knots(
    program: TrajectoryProgram, checks: Sequence[ArmCheck], durations: Array
) -> KnotStates:
    """Return states of splines at the knots of another program."""
    time = program.knots.times(durations)
    states = [check.spline(time)[:3] for check in checks]
    return KnotStates(durations, *zip(*states, strict=True))


def _worst(
    checks: Sequence[ArmCheck], clearances: Sequence[Clearance], distances: Sequence[Array]
) -> tuple[float, str]:
    """Return largest excess over a limit, relative or [rad or m], and a clause that names it."""
    found = [check.worst for check in checks]
    for clearance, values in zip(clearances, distances, strict=True):
        lack = (clearance.lower - values).max(axis=(0, 1))
        index = int(lack.argmax())
        found.append((float(lack[index]), f"the distance {clearance.names[index]} is too small"))
    return max(found, key=lambda pair: pair[0])


def _splines(program: TrajectoryProgram, states: KnotStates) -> list[JointSpline]:
    """Return without the rounding that the program's equations leave at the knots."""
    time = program.knots.times(states.durations)
    return [
        JointSpline.through(time, q, v[[0, -1]])
        for q, v in zip(states.positions, states.velocities, strict=True)
    ]
