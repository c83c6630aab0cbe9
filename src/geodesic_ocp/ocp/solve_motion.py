"""Motions of least cost: guesses, and a program that is refined until the motion is known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, TypeAlias

import casadi as ca
import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from geodesic_ocp.arrays import Array, as_positive, real_array
from geodesic_ocp.blocks import in_rounds
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.ipopt import LIMITS, STOPPED, Outcome, Relay
from geodesic_ocp.ocp.callback import Callback, Iterate
from geodesic_ocp.ocp.conditions import Condition
from geodesic_ocp.ocp.motion_definition import MotionDefinition, MotionNLP, Phase, Piece
from geodesic_ocp.ocp.motion_problem import MotionPhases, MotionProblem
from geodesic_ocp.ocp.motion_program import bisected
from geodesic_ocp.ocp.motion_solution import MotionNumbers, MotionSolution, PhasedMotion
from geodesic_ocp.ocp.solution import Attempt, MeshIteration, Stats
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.timed_motion import TimedMotion

_TOLERANCE = 1e-4  # of conditions, each in its scale, and of the cost, relative
_ROUNDS = 12
_BISECTIONS = 5
_COMPARED = 2  # solutions on the first grid, of which the best is refined
_SWINGS = 6  # guesses beside the others
_ROUNDING = 1e-12  # of the unit of cost
_INSET = 1e-9  # of the duration of a phase
# Displacements of variables, in their units.
_TINY = 1e-6
_BESIDE = 1e-3
_TINY_OF_RATES = 1e-9  # jerk is larger by a power of the time of a segment
_IPOPT = {"tol": 1e-9, "max_iter": 500}
_NEAR = {"mu_init": 1e-6, "bound_push": 1e-6, "bound_frac": 1e-6}

MotionGuess: TypeAlias = Motion | TimedMotion
_Pieces: TypeAlias = tuple[Piece, ...]


def solve_motion(
    problem: MotionProblem | MotionPhases,
    *,
    grid: Grid | None = None,
    guess: MotionGuess | None = None,
    tolerance: float | None = None,
    throw: bool = True,
    callback: Callback | None = None,
    ipopt: Mapping[str, Any] | None = None,
    num_starts: int = 1,
) -> MotionSolution:
    """Return the motion of least cost, a local solution.

    The number of segments is doubled until the cost changes by less than the tolerance, relative,
    at most five times; the conditions hold between the points of the program to the tolerance, each
    in its scale.

    The search starts from the problem's own guess, where it gives one; else, if conditions hold
    along the motion, from a spline through what is known and from a swing beside it, of which the
    better one is refined. If they lead to no solution, the motion that would be best without
    these conditions follows, and other swings.

    Args:
        problem: an instance of a subclass of MotionProblem or MotionPhases.
        grid: breakpoints of every phase, in fractions of its duration, and degree of the
            polynomials (5 or more); the solution has this grid, and the times of via points.
        guess: motion to start from, alone: of any duration, which is stretched to that of the
            problem. A solution of the same or of a similar problem is a warm start.
        tolerance: of the cost, relative, and of the conditions; 1e-4 by default.
        throw: raise NotConverged if there is no solution; else return the last iterate, with
            `stats.success` False.
        callback: called with an `Iterate` in every iteration of Ipopt, and stops it by True.
        ipopt: options of Ipopt, by name.
        num_starts: solve from so many guesses, and return the best solution.

    Raises:
        ValueError: the problem or an argument is malformed.
        NotConverged: Ipopt found no solution, or a condition is violated between the points.
    """
    definition = MotionDefinition.of(problem, grid)
    own = first_guess(definition)
    given = None if guess is None else _stretched(guess, definition, own, grid is not None)
    search = _MotionSearch(
        definition=definition.measured(given or own),
        is_given=grid is not None,
        tolerance=_TOLERANCE if tolerance is None else as_positive("tolerance", tolerance),
        ipopt=dict(ipopt or {}),
        callback=callback,
    )
    best = search.best(own, given, num_starts)
    if throw and not best.stats.success:
        raise NotConverged(_failure(best, search.tolerance), best)
    return best


def _failure(last: MotionSolution, tolerance: float) -> str:
    stats = last.stats
    kind = type(last.problem).__name__
    worst = ""
    if stats.max_path_violation > tolerance and stats.worst_constraint not in stats.status:
        worst = f"; {stats.worst_constraint} is violated by {stats.max_path_violation:.2g}"
    tried = [each.guess or "the initial guess" for each in last.attempts]
    told = f" (tried: {', '.join(tried)})" if len(tried) > 1 else ""
    return f"{kind} was not solved: {stats.status}{worst}{told}"


@dataclass(frozen=True, eq=False)
class _Looked:
    """A motion with its violations, see `MotionDefinition.violations`."""

    motion: MotionSolution
    violated: dict[str, float]
    along: list[Array]

    def failed(self, status: str) -> _Looked:
        """Return it as the last iterate of a solve that failed."""
        stats = replace(self.motion.stats, success=False, status=status)
        return replace(self, motion=replace(self.motion, stats=stats))


@dataclass(eq=False)
class _MotionSearch:
    """A motion problem with everything that stays the same from one guess to the next.

    It remembers its programs, which all guesses on the same knots share.
    """

    definition: MotionDefinition
    is_given: bool  # whether the grid is
    tolerance: float
    ipopt: Mapping[str, Any]
    callback: Callback | None
    programs: dict[bytes, MotionNLP] = field(default_factory=dict)

    def best(self, own: _Pieces, given: _Pieces | None, wanted: int) -> MotionSolution:
        """Return the best solution from so many guesses; if there is none, the last iterate.

        If one is wanted, and the problem gives no guess, several are compared on the first grid.
        """
        is_known = given is not None or self._gives_guess or not self.definition.has_bounds
        enough = max(wanted, 1 if is_known else _COMPARED)
        first: list[_Looked] = []
        tried: list[MotionSolution] = []
        for name, pieces in self.starts(own, given):
            first.append(self._solved(pieces))
            one = first[-1].motion
            tried.append(replace(one, stats=replace(one.stats, guess=name)))
            if self._was_ended(one) or sum(each.stats.success for each in tried) >= enough:
                break
        order = sorted(
            range(len(tried)), key=lambda k: (not tried[k].stats.success, tried[k].objective)
        )
        found: list[MotionSolution] = []
        for k in () if self._was_ended(tried[-1]) else order:
            tried[k] = self._refined(replace(first[k], motion=tried[k]))
            if tried[k].stats.success:
                found.append(tried[k])
            if self._was_ended(tried[k]) or len(found) >= wanted:
                break
        ended = [each for each in tried if self._was_ended(each)]
        best = min(found or ended or tried[:1], key=lambda each: each.objective)
        attempts = tuple(
            Attempt.of(each.stats.guess, each.stats.mesh_history[-1].segments, each.stats)
            for each in tried
        )
        return replace(best, attempts=attempts)

    def _was_ended(self, one: MotionSolution) -> bool:
        """Return whether the user ended a solve, by the callback or a limit among the options."""
        return one.stats.status in {
            STOPPED,
            *(LIMITS[name] for name in self.ipopt if name in LIMITS),
        }

    @property
    def _gives_guess(self) -> bool:
        problems = [each.problem for each in self.definition.phases]
        return any(type(each).guess is not MotionProblem.guess for each in problems)

    def starts(self, own: _Pieces, given: _Pieces | None) -> Iterator[tuple[str, _Pieces]]:
        """Yield motions to start from, with names: a given one alone."""
        definition = self.definition
        if given is not None:
            yield "", given
            return
        yield "", own
        rng = np.random.default_rng(0)
        swings = (swung(definition, own, 2 + number // 2, rng) for number in range(_SWINGS))
        yield "swing 1", next(swings)
        if definition.has_bounds:
            yield "without limits", self._without_bounds(own)
        for number, pieces in enumerate(swings, 2):
            yield f"swing {number}", pieces

    def _without_bounds(self, own: _Pieces) -> _Pieces:
        definition = self.definition.without_bounds()
        found = replace(self, definition=definition, callback=None, programs={})._solved(own).motion
        return found.pieces if found.stats.success else own

    def _program(self, pieces: _Pieces) -> MotionNLP:
        """Return the program of motions with the knots of these."""
        numbers = [np.concatenate([each.fractions, each.more]) for each in pieces]
        key = b"|".join(each.tobytes() for each in numbers)
        if key not in self.programs:
            self.programs[key] = self.definition.nlp(pieces)
        return self.programs[key]

    def _solved(self, pieces: _Pieces, before: MotionSolution | None = None) -> _Looked:
        """Return the solution on the knots of a motion near to it, or the last iterate.

        `before`: solution from which the motion comes.
        """
        definition = self.definition
        nlp = self._program(pieces)
        x = definition.reduced(pieces)
        unit = self._unit(nlp, x)
        near = {} if before is None else _NEAR
        outcome = self._outcome(nlp, x, pieces, unit, near)
        if outcome.success and outcome.may_be_saddle:  # as from a symmetric guess
            beside = outcome.x + _BESIDE * np.random.default_rng(0).normal(size=x.size)
            other = self._outcome(nlp, beside, pieces, unit, {})
            if other.success and other.objective < outcome.objective:
                outcome = other
        stats = None if before is None else before.stats
        return self._solution(nlp, outcome, pieces, unit, stats)

    def _refined(self, first: _Looked) -> MotionSolution:
        """Return the solution on as many segments, with conditions at as many instants, as it takes
        to the tolerance.
        """
        groups = [group for phase in self.definition.phases for group in phase.groups]
        equalities = [each.name for one in groups if one.is_equality for each in one.conditions]

        def solve(start: tuple[_Pieces, MotionSolution] | None) -> _Looked:
            return first if start is None else self._solved(*start)

        def examine(
            number: int, found: _Looked
        ) -> tuple[_Looked, tuple[_Pieces, MotionSolution] | None]:
            motion = found.motion
            stats = motion.stats
            costs = [each.objective for each in stats.mesh_history]
            amount = stats.max_path_violation
            change = abs(costs[-1] - costs[-2]) if number else np.inf
            rounding = min(change, abs(costs[-1]))  # a cost that vanishes decreases no further
            is_met = amount <= self.tolerance
            if not stats.success and rounding <= _ROUNDING * motion.numbers.unit and is_met:
                told = replace(stats, success=True, status="the cost changes by rounding alone")
                return replace(found, motion=replace(motion, stats=told)), None
            if not stats.success:
                return found, None
            is_known = change <= self.tolerance * abs(costs[-1])
            between = max((found.violated[name] for name in equalities), default=0.0)
            is_fine = is_known and between <= self.tolerance
            is_settled = is_fine or number >= _BISECTIONS or self.is_given
            if is_met and is_settled:
                return found, None
            following = []
            for piece, amounts in zip(motion.pieces, found.along, strict=True):
                where = amounts[amounts[:, 1] > self.tolerance, 0]
                more = replace(piece, more=np.union1d(piece.more, where))
                following.append(more if is_settled else _halved(more))
            sizes = [each.more.size for each in motion.pieces]
            is_last = is_settled and sizes == [each.more.size for each in following]
            if is_last or number == _ROUNDS - 1:
                status = (
                    f"{stats.worst_constraint} is violated by {amount:.1e} between the instants of "
                    "the program"
                )
                return found.failed(status), None
            return found, (tuple(following), motion)

        return in_rounds(None, solve, examine, _ROUNDS).motion

    def _unit(self, nlp: MotionNLP, x: Array) -> float:
        """Return the cost of the guess, or of tiny motions where it is smaller.

        In this unit, Ipopt's tolerance is relative.
        """
        has_rate = any(each.has_rate for each in self.definition.phases)
        tiny = _TINY_OF_RATES if has_rate else _TINY
        beside = x + tiny * np.random.default_rng(0).normal(size=x.size)
        values = [abs(float(nlp.program.functions["nlp"](each, 1.0)[0])) for each in (x, beside)]
        return max(values) if 0.0 < max(values) < np.inf else 1.0

    def _outcome(
        self,
        nlp: MotionNLP,
        x: Array,
        pieces: _Pieces,
        unit: float,
        near: Mapping[str, Any],
    ) -> Outcome:
        relay = None
        if self.callback is not None:
            relay = self._relay(nlp, pieces, unit, self.callback)
        options = {**_IPOPT, **near, **self.ipopt}
        return nlp.program.solve(x, nlp.bounds, options, p=np.array([unit]), relay=relay)

    def _relay(self, nlp: MotionNLP, pieces: _Pieces, unit: float, callback: Callback) -> Relay:
        """Return what passes every iterate to a function, as a motion."""
        definition = self.definition

        def pass_on(number: int, values: dict[str, ca.DM]) -> object:
            motion = definition.pieces(values["x"].full()[:, 0], pieces)
            violation, _ = _worst(nlp, values["g"].full()[:, 0])
            shown = Iterate(
                number,
                unit * float(values["f"]),
                violation,
                PhasedMotion(definition.problem, motion),
            )
            return callback(shown)

        return Relay(nlp.program.size, nlp.program.size_g, 1, pass_on)

    def _solution(
        self,
        nlp: MotionNLP,
        outcome: Outcome,
        before: _Pieces,
        unit: float,
        previous: Stats | None,
    ) -> _Looked:
        """Return the motion of a solve, with its statistics after those of previous ones."""
        definition = self.definition
        pieces = definition.pieces(outcome.x, before)
        at_nodes, name = _worst(nlp, outcome.g)
        found, along = definition.violations(pieces)
        worst = max(found, key=lambda each: found[each], default="")
        anywhere = max(found.get(worst, 0.0), at_nodes)
        objective = unit * outcome.objective
        segments = sum(len(each.fractions) - 1 for each in pieces)
        this = MeshIteration(segments, outcome.iterations, outcome.seconds, objective, anywhere)
        history = () if previous is None else previous.mesh_history
        stats = Stats(
            success=outcome.success,
            status=outcome.status,
            iterations=outcome.iterations,
            seconds=outcome.seconds,
            variables=outcome.x.size,
            constraints=outcome.g.size,
            energy=sum(map(Phase.energy, definition.phases, pieces)),
            objective=objective,
            max_node_violation=at_nodes,
            worst_constraint=worst or name,
            max_path_violation=anywhere,
            mesh_history=(*history, this),
            guess="" if previous is None else previous.guess,
        )
        numbers = MotionNumbers(
            degree=definition.grid.degree,
            sizes=tuple(each.size for each in definition.phases),
            durations=tuple(each.duration for each in definition.phases),
            scales={each.name: each.scales for each in definition.conditions},
            unit=unit,
            lam_x=outcome.lam_x,
            lam_g=outcome.lam_g,
        )
        return _Looked(MotionSolution(definition.problem, pieces, stats, numbers), found, along)


def first_guess(definition: MotionDefinition) -> _Pieces:
    """Return a spline of every phase through its known coordinates, or its problem's own guess."""
    found: list[Piece] = []
    start = 0.0
    for number, phase in enumerate(definition.phases):
        known = _known(definition, number, found[-1] if found else None)
        found.append(_first_piece(phase, definition, start, known))
        start += phase.duration
    return tuple(found)


def _stretched(
    guess: MotionGuess, definition: MotionDefinition, own: _Pieces, is_given: bool
) -> _Pieces:
    """Return the pieces of a given motion, on the knots of another one, or of a solution if the
    grid is not given.
    """
    n = own[0].knots.shape[1] // 2
    dim = guess.q.shape[1] if isinstance(guess, Motion) else guess.metric.dim
    if dim != n:
        raise ValueError(f"guess has {dim} coordinates, the problem {n}")
    if isinstance(guess, MotionSolution) and len(guess.pieces) == len(own):
        shares = guess.durations
    else:
        shares = np.array([each.duration for each in own])
    whole = guess.time[[0, -1]] if isinstance(guess, Motion) else guess.times[[0, -1]]
    edges = whole[0] + np.ptp(whole) * np.append(0.0, np.cumsum(shares) / shares.sum())
    found = []
    start = 0.0
    for phase, piece, (begin, end) in zip(definition.phases, own, pairwise(edges), strict=True):
        fractions = piece.fractions
        if isinstance(guess, MotionSolution) and not is_given:
            inside = (guess.times - begin) / (end - begin)
            inside = inside[(inside > 0.0) & (inside < 1.0)]
            fractions = np.unique(np.concatenate([[0.0, 1.0], inside, phase.via_fractions]))
        inset = np.clip(fractions, _INSET, 1.0 - _INSET)  # at impacts, on the own side
        at = begin + (end - begin) * inset
        q = guess(at)
        v = guess(at, 1)
        duration = float(np.clip(end - begin, *phase.durations))
        faster = (end - begin) / duration
        found.append(_piece(start, duration, fractions, q, faster * v, definition))
        start += duration
    return tuple(found)


def _known(definition: MotionDefinition, number: int, before: Piece | None) -> Array:
    """Return what is known of a phase at its ends and via points (k, 2, n), NaN where nothing is.

    The start is where the phase before ends; the end where that of the next is known to start.
    """
    phases = definition.phases
    n = phases[0].metric.dim
    known = np.full((len(phases[number].via) + 2, 2, n), np.nan)
    known[[0, -1]] = _known_ends(phases[number], n)
    for row, conditions in zip(known[1:-1], phases[number].via, strict=True):
        row[:] = _filled(np.full(2 * n, np.nan), conditions).reshape(2, n)
    if before is not None:
        known[0, 0] = np.where(np.isnan(known[0, 0]), before.knots[-1, :n], known[0, 0])
    if number + 1 < len(phases):
        following = _known_ends(phases[number + 1], n)[0]
        known[-1] = np.where(np.isnan(known[-1]), following, known[-1])
    return known


def _known_ends(phase: Phase, n: int) -> Array:
    return _filled(np.full(4 * n, np.nan), phase.ends).reshape(2, 2, n)


def _filled(values: Array, conditions: Sequence[Condition]) -> Array:
    """Enter the values of bare coordinates."""
    for each in conditions:
        if each.coordinates is not None:
            values[list(each.coordinates)] = each.lower
    return values


def _first_piece(phase: Phase, definition: MotionDefinition, start: float, known: Array) -> Piece:
    n = phase.metric.dim
    edges = np.array([0.0, *phase.via_fractions, 1.0])
    fractions = _fractions(definition.grid, edges)
    own = phase.problem.guess(phase.duration * fractions)
    if own is not None and np.shape(own) != (len(fractions), n):
        raise ValueError(f"guess must have shape ({len(fractions)}, {n}), got {np.shape(own)}")
    points = _completed(edges, known[:, 0]) if own is None else real_array(own, "guess")
    if not np.all(np.isfinite(points)):
        raise ValueError("guess must be finite")
    clamped = tuple((2, np.zeros(n)) if np.isnan(v).any() else (1, v) for v in known[[0, -1], 1])
    at = phase.duration * (edges if own is None else fractions)
    curve = CubicSpline(at, points, bc_type=clamped)
    if own is None:
        given = np.isfinite(known[:, 1])
        curve = CubicHermiteSpline(at, points, np.where(given, known[:, 1], curve(at, 1)))
    times = phase.duration * fractions
    return _piece(start, phase.duration, fractions, curve(times), curve(times, 1), definition)


def _fractions(grid: Grid, edges: Array) -> Array:
    """Return fractions of a duration at the knots: breakpoints of a grid between all edges, or
    these and the edges if the breakpoints are not even.
    """
    if grid.ends:
        return np.union1d(grid.breakpoints, edges)
    count = max(1, -(-grid.segments // (len(edges) - 1)))
    parts = [np.linspace(a, b, count, endpoint=False) for a, b in pairwise(edges)]
    return np.append(np.concatenate(parts), 1.0)


def _piece(
    start: float,
    duration: float,
    fractions: Array,
    q: Array,
    v: Array,
    definition: MotionDefinition,
) -> Piece:
    """Return the piece of cubic polynomials through positions with velocities."""
    bubbles = np.zeros((len(fractions) - 1, definition.basis.bubbles, q.shape[1]))
    return Piece(start, duration, fractions, np.hstack([q, v]), bubbles, np.zeros(0))


def _completed(times: Array, points: Array) -> Array:
    """Return points (k, n) with linear interpolation where they are NaN; zero if all are."""
    result = np.zeros_like(points)
    for column, values in enumerate(points.T):
        if np.any(there := np.isfinite(values)):
            result[:, column] = np.interp(times, times[there], values[there])
    return result


def swung(
    definition: MotionDefinition, pieces: _Pieces, waves: int, rng: np.random.Generator
) -> _Pieces:
    """Return pieces with a sine of so many half-waves added, in a random direction, by one size of
    the problem.
    """
    n = definition.phases[0].metric.dim
    direction = rng.normal(size=n)
    direction /= np.linalg.norm(direction)
    found = []
    for phase, piece in zip(definition.phases, pieces, strict=True):
        angle = waves * np.pi * piece.fractions[:, None]
        aside = phase.size * direction
        faster = waves * np.pi / piece.duration * np.cos(angle) * aside
        knots = piece.knots + np.hstack([np.sin(angle) * aside, faster])
        found.append(replace(piece, knots=knots))
    return tuple(found)


def _halved(piece: Piece) -> Piece:
    """Return the same motion with twice as many segments."""
    halves = bisected(piece.basis, piece.times - piece.start, piece.knots, piece.coefficients)
    times, knots, coefficients = halves
    fractions = times / piece.duration
    return replace(piece, fractions=fractions, knots=knots, coefficients=coefficients)


def _worst(nlp: MotionNLP, g: Array) -> tuple[float, str]:
    """Return the largest violation at the instants of a program, and its condition."""
    lower, upper = nlp.program.bounds
    excess = np.maximum(lower - g, g - upper)
    found = [(float(excess[rows.numbers].max()), rows.condition.name) for rows in nlp.rows]
    amount, name = max(found, default=(0.0, ""))
    return max(amount, 0.0), name
