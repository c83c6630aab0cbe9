"""Motions of least cost as classes: a running cost in q, q', q'', torque and time.

The default cost is that of Riemannian cubics, int |D_t q'|^2_G / 2 dt = int tau' G^-1 tau / 2 dt.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from geodesic_ocp.arrays import (
    Array,
    ShortRepr,
    as_expression,
    as_number,
    as_positive,
    real_array,
)
from geodesic_ocp.blocks import Block, BlockProgram, Terms, in_rounds
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.manifold.motion_kernels import SegmentBasis
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.ocp.conditions import Condition, excess_over_bounds, stacked
from geodesic_ocp.ocp.motion_program import (
    bisected,
    instants,
    knots_of,
    state_cells,
    state_matrix,
    variables,
)
from geodesic_ocp.ocp.problem import NUMBERS, Equality, Inequality, check_symbols, listed, numbered
from geodesic_ocp.ocp.scales import scales_of, size_of, with_beside
from geodesic_ocp.trajectory.timed_motion import TimedMotion

_BASIS = SegmentBasis(4, 9)
_SEGMENTS = 4  # of the first program, at least
_ROUNDS = 12
_BISECTIONS = 5
_SAMPLES = 12  # of a segment, at which constraints are examined
_VIOLATION = 1e-4  # of a constraint between the points, in its scale
_CHANGE = 1e-4  # of the cost from one round to the next, relative
_CONSTANT = 1e-9  # violation by a row that no motion changes
_ROUNDING = 1e-12  # of the unit of cost
# displacements of variables, in their units
_TINY = 1e-6
_BESIDE = 1e-3
_TINY_OF_RATES = 1e-9  # jerk is larger by a power of the time of a segment
_IPOPT = {"tol": 1e-9, "max_iter": 500}
_NEAR = {"mu_init": 1e-6, "bound_push": 1e-6, "bound_frac": 1e-6}


class MotionProblem(ABC):
    """A motion q(t), t in [0, duration], of least int cost dt under conditions.

    A subclass, usually a frozen dataclass whose fields all have defaults, defines `metric`,
    `duration` and `boundary`, and if needed `cost`, `torque`, `constraints`, `via` and `guess`.
    Expressions are built from CasADi SX symbols.

    Attributes:
        metric: metric of the manifold.
        duration: duration of the motion [s].
        obstacles: stationary obstacles that `go.show` draws; no condition by themselves.
    """

    metric: Metric
    duration: float
    obstacles: Sequence[Obstacle] = ()

    @abstractmethod
    def boundary(self, q0: ca.SX, q1: ca.SX, v0: ca.SX, v1: ca.SX) -> Sequence[Equality]:
        """Return equalities (expression, value[, name]) in positions and velocities at both ends.

        What they leave free is optimal.
        """

    def definition(self) -> Any:
        """Return the expressions of the problem; ValueError if it is malformed."""
        return _Parsed.of(self)

    def cost(self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX) -> Any:
        """Return the running cost: by default tau' G(q)^-1 tau / 2, tau the `torque`."""
        return ca.dot(torque, ca.solve(self.metric.matrix(q), torque)) / 2.0

    def rate_cost(self, q: ca.SX, v: ca.SX, a: ca.SX, jerk: ca.SX, torque_rate: ca.SX) -> Any:
        """Return what jerk q''' and rate of the `torque` add to the running cost: zero.

        If the jerk occurs in it, accelerations and torques are continuous.
        """
        return 0.0

    def torque(self, q: ca.SX, v: ca.SX, a: ca.SX) -> Any:
        """Return the generalised force of the motion: by default G a + Gamma(v, v), no gravity.

        With gravity it is `model.inverse_dynamics(q, v, a)`.
        """
        return self.metric.matrix(q) @ a + self.metric._christoffel_force(q, v, v)

    def constraints(
        self, t: ca.SX, q: ca.SX, v: ca.SX, a: ca.SX, torque: ca.SX
    ) -> Sequence[Inequality]:
        """Return bounds (lower, expression, upper[, name]) along the motion."""
        return ()

    def via(self, q: ca.SX, v: ca.SX) -> Sequence[tuple[float, Sequence[Equality]]]:
        """Return times between 0 and duration [s], increasing, each with its equalities."""
        return ()

    def guess(self, t: Array) -> Array | None:
        """Return positions (len(t), n) to start from; None: a cubic spline through what is known.

        Coordinates that no condition determines stay at those of the nearest end, or zero.
        """
        return None


@dataclass(frozen=True, eq=False, repr=False)
class MotionSolution(TimedMotion, ShortRepr):
    """A motion of polynomials in time, a solution of a `MotionProblem` or its last iterate.

    Attributes:
        problem: what was solved.
        times: of the knots (k + 1,) [s].
        knots: positions and velocities (k + 1, 2 n).
        coefficients: of the segments' other polynomials (k, bubbles, n).
        success: whether the motion is stationary, and all conditions hold.
        status: how the solver stopped, a sentence.
        cost: int cost dt.
        violation: largest violation of a condition, in its scale, and the condition's name.
        costs: of the rounds of the refinement.
        seconds, iterations: of Ipopt, in all rounds.
    """

    problem: MotionProblem
    times: Array
    knots: Array
    coefficients: Array
    success: bool
    status: str
    cost: float
    violation: tuple[float, str]
    costs: tuple[float, ...]
    seconds: float
    iterations: int

    _shown = ("status", "cost", "duration", "iterations", "seconds")

    @property
    def metric(self) -> Metric:  # type: ignore[override]
        """Metric of the problem."""
        return self.problem.metric

    def states(self, t: Array, order: int) -> Array:
        """Return derivatives of this order at times (k,) within the motion, (k, n)."""
        segment = np.searchsorted(self.times[1:-1], t, "right")
        n = self.metric.dim
        durations = np.diff(self.times)
        q = self.knots[:, :n]
        v = self.knots[:, n:]
        result = np.empty((len(t), n))
        for k in np.unique(segment):
            rows = segment == k
            T = durations[k]
            values = _BASIS.values((t[rows] - self.times[k]) / T, order) / T**order
            ends = np.stack([q[k], T * v[k], q[k + 1], T * v[k + 1]])
            result[rows] = values.T @ np.vstack([ends, self.coefficients[k]])
        return result

    def torques(self, t: ArrayLike) -> Array:
        """Return the problem's torques at t, (n,) for a number, or (k, n) [N m or N]."""
        parsed = _Parsed.of(self.problem)
        at = self.checked(t)
        function = ca.Function("torque", [parsed.state], [parsed.torque])
        states = np.hstack([self.states(at, order) for order in range(3)])
        values = np.array([function(state).full()[:, 0] for state in states]).reshape(len(at), -1)
        return values[0] if np.ndim(t) == 0 else values


@dataclass(frozen=True, eq=False)
class _Parsed:
    """The expressions of a problem, in the states (q, v, a) and time or in both ends."""

    problem: MotionProblem
    metric: Metric
    duration: float
    state: ca.SX
    jerk: ca.SX
    time: ca.SX
    at_ends: ca.SX
    cost: ca.SX
    torque: ca.SX
    ends: tuple[Condition, ...]
    along: tuple[Condition, ...]
    via_times: Array
    via: tuple[tuple[Condition, ...], ...]
    size: float = 1.0  # of the problem in its coordinates, see `scales`

    @classmethod
    def of(cls, problem: MotionProblem) -> _Parsed:
        """Call each method of the problem once; ValueError where the problem is malformed."""
        metric = as_metric(problem.metric)
        duration = as_positive("duration", problem.duration, "s")
        names = ("q", "v", "a", "j", "q0", "v0", "q1", "v1")
        q, v, a, jerk, q0, v0, q1, v1 = (ca.SX.sym(name, metric.dim) for name in names)
        t = ca.SX.sym("t")
        state = ca.vertcat(q, v, a)
        at_ends = ca.vertcat(q0, v0, q1, v1)
        torque = as_expression("torque", problem.torque(q, v, a))
        if torque.shape != (metric.dim, 1):
            raise ValueError(f"torque must have shape ({metric.dim}, 1), got {torque.shape}")
        check_symbols("torque", torque, (q, v, a))
        rate = ca.jtimes(torque, state, ca.vertcat(v, a, jerk))
        costs = {
            "cost": problem.cost(t, q, v, a, torque),
            "rate_cost": problem.rate_cost(q, v, a, jerk, rate),
        }
        costs = {name: as_expression(name, each) for name, each in costs.items()}
        for name, each in costs.items():
            if each.shape != (1, 1):
                raise ValueError(f"{name} must be a scalar, got shape {each.shape}")
            arguments = (t, q, v, a) if name == "cost" else (q, v, a, jerk)
            check_symbols(name, each, arguments)
        cost = ca.plus(*costs.values())

        def equalities(label: str, entries: Any, *symbols: ca.SX) -> tuple[Condition, ...]:
            known = numbered(*symbols)
            found = [NUMBERS.equality(*each, known) for each in listed(label, entries)]
            for condition in found:
                if not np.all(np.isfinite(condition.lower)):
                    raise ValueError(f"{condition.name}: a value must be finite")
            return tuple(_varying(found, symbols))

        bounds = listed("constraints", problem.constraints(t, q, v, a, torque))
        along = [NUMBERS.inequality(*each, numbered(state)) for each in bounds]
        via = []
        for label, each in listed("via", problem.via(q, v)):
            if not isinstance(each, Sequence) or len(each) != 2:
                raise ValueError(f"{label} must be (time, equalities), got {each!r}")
            via.append((*each, label))
        times = np.array([as_number(f"{label}: its time", at) for at, _, label in via])
        if not np.all(np.diff(np.concatenate([[0.0], times, [duration]])) > 0.0):
            raise ValueError(
                f"via: times must increase between 0 and {duration:.6g} s, got "
                f"{', '.join(f'{at:.6g}' for at in times)}"
            )
        return cls(
            problem,
            metric,
            duration,
            state,
            jerk,
            t,
            at_ends,
            cost,
            torque,
            ends=equalities("boundary", problem.boundary(q0, q1, v0, v1), q0, v0, q1, v1),
            along=tuple(_varying(along, (t, q, v, a))),
            via_times=times,
            via=tuple(equalities(label, entries, q, v) for _, entries, label in via),
        )

    def first_guess(self) -> _Motion:
        """Return the spline through the known coordinates, or the problem's own guess."""
        n = self.metric.dim
        edges = np.array([0.0, *self.via_times, self.duration])
        count = max(1, -(-_SEGMENTS // (len(edges) - 1)))
        parts = [np.linspace(a, b, count, endpoint=False) for a, b in pairwise(edges)]
        times = np.append(np.concatenate(parts), self.duration)
        known = np.full((len(edges), 2, n), np.nan)  # positions and velocities
        ends = known[[0, -1]].ravel()
        for condition in self.ends:
            _fill(ends, condition)
        known[[0, -1]] = ends.reshape(2, 2, n)
        for row, conditions in zip(known[1:-1], self.via, strict=True):
            flat = row.ravel()
            for condition in conditions:
                _fill(flat, condition)
            row[:] = flat.reshape(2, n)
        own = self.problem.guess(times)
        if own is not None and np.shape(own) != (len(times), n):
            raise ValueError(f"guess must have shape ({len(times)}, {n}), got {np.shape(own)}")
        points = _completed(edges, known[:, 0]) if own is None else real_array(own, "guess")
        if not np.all(np.isfinite(points)):
            raise ValueError("guess must be finite")
        clamped = tuple(
            (2, np.zeros(n)) if np.isnan(v).any() else (1, v) for v in known[[0, -1], 1]
        )
        at = edges if own is None else times
        curve = CubicSpline(at, points, bc_type=clamped)
        if own is None:
            given = np.isfinite(known[:, 1])
            curve = CubicHermiteSpline(at, points, np.where(given, known[:, 1], curve(at, 1)))
        knots = np.hstack([curve(times), curve(times, 1)])
        return _Motion(times, knots, np.zeros((len(times) - 1, _BASIS.bubbles, n)), np.zeros(0))

    def measured(self, guess: _Motion) -> _Parsed:
        """Return the problem with its size and the scales of its conditions, from a first guess."""
        n = self.metric.dim
        q = guess.knots[:, :n]
        v = guess.knots[:, n:]
        size = size_of(self.metric, q) or 1.0
        curve = CubicHermiteSpline(guess.times, q, v)
        accelerations = curve(guess.times, 2)
        at_ends = np.hstack([q[0], v[0], q[-1], v[-1]])[None]
        units = self._units(size, 3)
        states = with_beside(np.hstack([q, v, accelerations]), units)
        times = np.tile(guess.times, 2)[:, None]

        def scaled(
            group: Sequence[Condition], z: ca.SX, samples: Array, units: Array
        ) -> tuple[Condition, ...]:
            values = stacked(group)
            slopes = ca.densify(ca.jacobian(values, z))
            function = ca.Function("conditions", [z, ca.SX(0, 1)], [values, slopes])
            scales = scales_of(group, function, samples, units, np.zeros(0))
            return tuple(replace(each, scale=scales[each.name]) for each in group)

        in_time = np.append(units, 0.0)  # instants are held
        state = ca.vertcat(self.state, self.time)
        both = np.tile(self._units(size, 2), 2)
        knots = states[:, : 2 * n]
        return replace(
            self,
            size=size,
            ends=scaled(self.ends, self.at_ends, at_ends, both),
            along=scaled(self.along, state, np.hstack([states, times]), in_time),
            via=tuple(scaled(each, self.state[: 2 * n], knots, both[: 2 * n]) for each in self.via),
        )

    def _units(self, size: float, orders: int) -> Array:
        """Return units of positions and so many of their derivatives, (orders n,)."""
        each = size / self.duration ** np.arange(orders)
        return np.repeat(each, self.metric.dim)

    @cached_property
    def has_rate(self) -> bool:
        """Whether the running cost depends on the jerk, so that accelerations are continuous."""
        return bool(ca.depends_on(self.cost, self.jerk))

    @cached_property
    def running(self) -> Terms:
        """The running cost of an instant, in (q, v, a), or in (q, v, a, jerk) if that occurs."""
        state = ca.vertcat(self.state, self.jerk) if self.has_rate else self.state
        return Terms(state, self.time, self.cost)

    def reduced(self, motion: _Motion) -> Array:
        """Return a motion as variables of the program, in units of the size and the duration."""
        knots = motion.knots / self._units(self.size, 2)
        return variables(knots, motion.coefficients / self.size)

    def knots_of(self, x: Array) -> tuple[Array, Array]:
        """Return knots and coefficients from variables of the program."""
        knots, coefficients = knots_of(x, _BASIS, self.metric.dim)
        return knots * self._units(self.size, 2), coefficients * self.size

    def program(self, times: Array, more: Array) -> BlockProgram:
        """Return the program of motions with knots at these times; its parameter is a unit of cost.

        Its constraints hold at some instants of every segment, and at more of them.
        """
        n = self.metric.dim
        durations = np.diff(times)
        s, weights = _BASIS.rule
        at = instants(times, s)
        size = (len(durations) * (2 + _BASIS.bubbles) + 2) * n
        orders = range(self.running.size // n)
        reduced = times / self.duration
        cells = state_cells(_BASIS, reduced, n, s, orders)
        unit_of_cost = ca.MX.sym("unit")
        in_time = ca.DM(np.outer(durations, weights).ravel()) / unit_of_cost
        units = self._in_units(at.size, len(orders))
        blocks = [Block(self.running, cells, at[:, None], weights=in_time, units=units)]
        if self.has_rate and len(durations) > 1:
            after, before = (
                state_matrix(_BASIS, reduced, n, reduced[1:-1], [2], before=each)
                for each in (False, True)
            )
            # As small as the variables are: accelerations are larger the finer the grid.
            widths = np.diff(reduced)
            scale = np.repeat(np.minimum(widths[1:], widths[:-1]) ** 2, n)[:, None]
            jump = Terms(self.jerk, None, 0.0, self.jerk)  # of q'', by any n symbols
            zeros = np.zeros((len(durations) - 1, n))
            blocks.append(Block(jump, (after - before).multiply(scale), None, zeros, zeros))
        if self.along:
            at = np.unique(np.concatenate([at, times, more]))
            terms = Terms(self.state, self.time, 0.0, _in_scales(self.along))
            places = state_matrix(_BASIS, reduced, n, at / self.duration)
            lower, upper = _bounds(self.along, at.size)
            units = self._in_units(at.size, 3)
            blocks.append(Block(terms, places, at[:, None], lower, upper, units=units))
        knots = [0, *(int(np.argmin(np.abs(times - at))) for at in self.via_times), len(durations)]
        first = (2 + _BASIS.bubbles) * n * np.array(knots)
        places = first[:, None] + np.arange(2 * n)
        at_knots = [(self.at_ends, self.ends, places[[0, -1]].reshape(1, -1))]
        inner = zip(self.via, places[1:-1], strict=True)
        at_knots += [(self.state[: 2 * n], each, place[None, :]) for each, place in inner]
        for symbols, conditions, place in at_knots:
            if conditions:
                terms = Terms(symbols, None, 0.0, _in_scales(conditions))
                lower, upper = _bounds(conditions, 1)
                both = np.tile(self._units(self.size, 2), terms.size // (2 * n))[None]
                in_units = np.zeros_like(both), both
                blocks.append(Block(terms, place, None, lower, upper, units=in_units))
        return BlockProgram(size, blocks, unit_of_cost)

    def _in_units(self, count: int, orders: int) -> tuple[Array, Array]:
        """Return offset and scale of the states at so many instants."""
        units = np.tile(self._units(self.size, orders), (count, 1))
        return np.zeros_like(units), units

    def violations(self, motion: MotionSolution) -> tuple[tuple[float, str], Array]:
        """Return the largest violation between the instants of the program, with its condition,
        and the times of all that are larger than what is allowed.
        """
        t = np.unique(instants(motion.times, np.linspace(0.0, 1.0, _SAMPLES + 1)))
        states = np.hstack([motion.states(t, order) for order in range(3)])
        worst = (0.0, "")
        where = [np.zeros(0)]
        for condition in self.along:
            function = ca.Function("g", [self.state, self.time], [condition.expression])
            found = function(states.T, t[None, :]).full().T
            excess = excess_over_bounds(condition, found.T).max(axis=0, initial=0.0)
            worst = max(worst, (float(excess.max()), condition.name))
            where.append(t[excess > _VIOLATION])
        ends = motion.knots[[0, -1]].reshape(1, -1)
        at = [int(np.argmin(np.abs(motion.times - each))) for each in self.via_times]
        groups = [(self.at_ends, self.ends, ends)]
        n = self.metric.dim
        groups += [
            (self.state[: 2 * n], each, motion.knots[[knot]])
            for each, knot in zip(self.via, at, strict=True)
        ]
        for symbols, conditions, values in groups:
            for condition in conditions:
                found = ca.Function("g", [symbols], [condition.expression])(values.T).full().T
                amount = float(excess_over_bounds(condition, found.T).max(initial=0.0))
                worst = max(worst, (amount, condition.name))
        return worst, np.unique(np.concatenate(where))


@dataclass(frozen=True, eq=False)
class _Motion:
    """Knots at times, the segments' coefficients, and more times at which constraints hold."""

    times: Array
    knots: Array
    coefficients: Array
    more: Array


def _varying(conditions: Sequence[Condition], symbols: Sequence[ca.SX]) -> Iterator[Condition]:
    """Yield the rows of conditions that depend on the motion; ValueError if another is violated.

    Such rows occur as the height of a planar arm's hand. They would make Jacobians singular.
    """
    for each in conditions:
        check_symbols(each.name, each.expression, symbols)
        varies = np.array([bool(ca.symvar(row)) for row in ca.vertsplit(each.expression)])
        for k in np.flatnonzero(~varies):
            value = float(each.expression[int(k)])
            low = each.lower[k]
            high = each.upper[k]
            if not low - _CONSTANT <= value <= high + _CONSTANT:
                allowed = f"{low:.6g}" if low == high else f"{low:.6g} to {high:.6g}"
                raise ValueError(
                    f"{each.name}: row {k} is {value:.6g} for every motion, not {allowed}"
                )
        if np.all(varies):
            yield each
        elif np.any(varies):
            rows = each.expression[np.flatnonzero(varies).tolist()]
            bounds = each.lower[varies], each.upper[varies]
            yield Condition(each.name, rows, *bounds, None)


def _in_scales(conditions: Sequence[Condition]) -> ca.SX:
    scales = np.concatenate([each.scales for each in conditions])
    return stacked(conditions) / ca.DM(scales)


def _bounds(conditions: Sequence[Condition], count: int) -> tuple[Array, Array]:
    """Return bounds in the scales of conditions, (count, rows)."""
    lower, upper = ([getattr(c, side) / c.scale for c in conditions] for side in ("lower", "upper"))
    return np.tile(np.concatenate(lower), (count, 1)), np.tile(np.concatenate(upper), (count, 1))


def _fill(values: Array, condition: Condition) -> None:
    """Enter the values of bare coordinates."""
    if condition.coordinates is not None:
        values[list(condition.coordinates)] = condition.lower


def _completed(times: Array, points: Array) -> Array:
    """Return points (k, n) with linear interpolation where they are NaN; zero if all are."""
    result = np.zeros_like(points)
    for column, values in enumerate(points.T):
        if np.any(there := np.isfinite(values)):
            result[:, column] = np.interp(times, times[there], values[there])
    return result


def solve_motion(problem: MotionProblem, *, throw: bool = True) -> MotionSolution:
    """Return the motion of least cost, a local solution.

    The number of segments is doubled until the cost changes by less than 1e-4, relative, at most
    five times; the constraints hold between the points of the program to 1e-4, each in its scale.

    Args:
        problem: an instance of a subclass of MotionProblem.
        throw: raise NotConverged if there is no solution; else return the last iterate, with
            `success` False.

    Raises:
        ValueError: the problem is malformed.
        NotConverged: Ipopt found no solution, or a constraint is violated between the points.
    """
    parsed = _Parsed.of(problem)
    first = parsed.first_guess()
    parsed = parsed.measured(first)
    costs: list[float] = []
    seconds = 0.0
    iterations = 0
    unit = 1.0

    def solved(start: _Motion) -> tuple[MotionSolution, Array]:
        nonlocal seconds, iterations, unit
        x = parsed.reduced(start)
        program = parsed.program(start.times, start.more)
        free = np.full(x.size, np.inf)
        unit = unit_of(program, x)
        options = _IPOPT | (_NEAR if costs else {})
        outcome = program.solve(x, (-free, free), options, p=np.array([unit]))
        if outcome.success and outcome.may_be_saddle:  # as from a symmetric guess
            beside = outcome.x + _BESIDE * np.random.default_rng(0).normal(size=x.size)
            other = program.solve(beside, (-free, free), _IPOPT, p=np.array([unit]))
            if other.success and other.objective < outcome.objective:
                outcome = other
        costs.append(unit * outcome.objective)
        seconds = seconds + outcome.seconds
        iterations = iterations + outcome.iterations
        motion = MotionSolution(
            problem,
            start.times,
            *parsed.knots_of(outcome.x),
            success=outcome.success,
            status=outcome.status,
            cost=costs[-1],
            violation=(0.0, ""),
            costs=tuple(costs),
            seconds=seconds,
            iterations=iterations,
        )
        return motion, start.more

    def unit_of(program: BlockProgram, x: Array) -> float:
        """Return the cost of the guess, or of tiny motions where it is smaller.

        In this unit, Ipopt's tolerance is relative.
        """
        tiny = _TINY_OF_RATES if parsed.has_rate else _TINY
        beside = x + tiny * np.random.default_rng(0).normal(size=x.size)
        values = [abs(float(program.functions["nlp"](each, 1.0)[0])) for each in (x, beside)]
        return max(values) if 0.0 < max(values) < np.inf else 1.0

    def examined(
        number: int, result: tuple[MotionSolution, Array]
    ) -> tuple[tuple[MotionSolution, Array], _Motion | None]:
        motion, more = result
        (amount, name), where = parsed.violations(motion)
        motion = replace(motion, violation=(amount, name))
        following = motion.times, motion.knots, motion.coefficients
        change = abs(costs[-1] - costs[-2]) if number else np.inf
        rounding = min(change, abs(costs[-1]))  # a cost that vanishes does not decrease further
        if not motion.success and rounding <= _ROUNDING * unit and amount <= _VIOLATION:
            status = "the cost changes by rounding alone"
            return (replace(motion, success=True, status=status), more), None
        if not motion.success:
            return (motion, more), None
        is_settled = change <= _CHANGE * abs(costs[-1]) or number >= _BISECTIONS
        if amount <= _VIOLATION and is_settled:
            return (motion, more), None
        if number == _ROUNDS - 1:
            status = f"{name} is violated by {amount:.1e} between the instants of the program"
            return (replace(motion, success=False, status=status), more), None
        if not is_settled:
            following = bisected(_BASIS, *following)
        return (motion, more), _Motion(*following, np.union1d(more, where))

    found, _ = in_rounds(first, solved, examined, _ROUNDS)
    if throw and not found.success:
        amount, name = found.violation
        is_new = amount > _VIOLATION and name not in found.status
        worst = f"; {name} is violated by {amount:.2g}" if is_new else ""
        raise NotConverged(f"{type(problem).__name__} was not solved: {found.status}{worst}", found)
    return found
