"""The expressions of a motion problem, its phases in order, and the nonlinear program of them.

A phase has the variables of `motion_program` in fractions of its duration, in units of its size,
and its duration in units of a first guess where that is free. Derivatives in time are then those in
fractions of the duration, divided by its powers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse
from numpy.polynomial.legendre import leggauss
from scipy.interpolate import CubicHermiteSpline

from geodesic_ocp.arrays import Array, ShortRepr, as_expression, as_number, as_positive
from geodesic_ocp.blocks import Block, BlockProgram, Terms
from geodesic_ocp.cells import Indices
from geodesic_ocp.manifold.metric import Metric, as_metric, speeds_at
from geodesic_ocp.manifold.motion_kernels import SegmentBasis
from geodesic_ocp.ocp.conditions import Condition, excess_over_bounds, stacked
from geodesic_ocp.ocp.motion_problem import MotionPhases, MotionProblem
from geodesic_ocp.ocp.motion_program import (
    instants,
    knots_of,
    state_cells,
    state_matrix,
    variables,
)
from geodesic_ocp.ocp.problem import NUMBERS, check_symbols, listed, numbered
from geodesic_ocp.ocp.scales import scales_of, size_of, with_beside
from geodesic_ocp.trajectory.grid import Grid

GRID = Grid(4, 7)  # of a phase, at first; polynomials of this degree
_CONSTANT = 1e-9  # violation by a row that no motion changes
_SAMPLES = 12  # of a segment, at which constraints are examined


@dataclass(frozen=True, eq=False, repr=False)
class Piece(ShortRepr):
    """The motion of one phase, polynomials of its time.

    Attributes:
        start, duration: when it begins, and how long it takes [s].
        fractions: of the duration at the knots (k + 1,), from 0 to 1.
        knots: positions and velocities (k + 1, 2 n).
        coefficients: of the segments' other polynomials (k, bubbles, n).
        more: fractions, besides those of the program, at which constraints hold.
    """

    start: float
    duration: float
    fractions: Array
    knots: Array
    coefficients: Array
    more: Array
    _shown = ("start", "duration")

    @property
    def times(self) -> Array:
        """Times of the knots (k + 1,) [s]."""
        return self.start + self.duration * self.fractions

    @property
    def basis(self) -> SegmentBasis:
        """Polynomials of a segment."""
        return basis_of(self.coefficients.shape[1] + 3)

    def states(self, fractions: Array, order: int) -> Array:
        """Return derivatives of this order at fractions (m,) of the duration, (m, n)."""
        segment = np.searchsorted(self.fractions[1:-1], fractions, "right")
        n = self.knots.shape[1] // 2
        positions = self.knots[:, :n]
        velocities = self.knots[:, n:]
        found = np.empty((len(fractions), n))
        for k in np.unique(segment):
            rows = segment == k
            share = self.fractions[k + 1] - self.fractions[k]
            seconds = share * self.duration
            s = (fractions[rows] - self.fractions[k]) / share
            ends = [positions[k], seconds * velocities[k]]
            ends += [positions[k + 1], seconds * velocities[k + 1]]
            values = self.basis.values(s, order) / seconds**order
            found[rows] = values.T @ np.vstack([ends, self.coefficients[k]])
        return found


@lru_cache
def basis_of(degree: int) -> SegmentBasis:
    """Return polynomials of a degree on a segment, with a quadrature that is exact beyond it."""
    return SegmentBasis(degree - 3, degree + 2)


@dataclass(frozen=True, eq=False)
class BoundedGroup:
    """Conditions along a motion that hold at the same instants.

    Attributes:
        conditions: the conditions.
        terms: their values at an instant, in their scales.
        is_equality: whether all of them are equalities.
    """

    conditions: tuple[Condition, ...]
    terms: Terms
    is_equality: bool


@dataclass(frozen=True, eq=False)
class Phase:
    """The expressions of one phase, in its states (q, v, a), jerk and time, or in both ends.

    Attributes:
        problem, metric: of the phase.
        durations: the shortest and the longest duration [s].
        state, jerk, time, at_ends, seconds: symbols of (q, v, a), q''', t, (q0, v0, q1, v1), and of
            the duration.
        cost, torque: expressions.
        ends, along, via: conditions; those of `via` at these fractions of the duration.
        size: of the problem in its coordinates, see `scales`.
        duration: of a first guess [s].
    """

    problem: MotionProblem
    metric: Metric
    durations: tuple[float, float]
    state: ca.SX
    jerk: ca.SX
    time: ca.SX
    at_ends: ca.SX
    seconds: ca.SX
    cost: ca.SX
    torque: ca.SX
    ends: tuple[Condition, ...]
    along: tuple[Condition, ...]
    via_fractions: Array
    via: tuple[tuple[Condition, ...], ...]
    size: float = 1.0
    duration: float = 1.0

    @classmethod
    def of(cls, problem: MotionProblem) -> Phase:
        """Call each method of the problem once; ValueError where the problem is malformed."""
        metric = as_metric(problem.metric)
        durations = _durations(problem)
        names = ("q", "v", "a", "j", "q0", "v0", "q1", "v1")
        q, v, a, jerk, q0, v0, q1, v1 = (ca.SX.sym(name, metric.dim) for name in names)
        t = ca.SX.sym("t")
        state = ca.vertcat(q, v, a)
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
        bounds = listed("constraints", problem.constraints(t, q, v, a, torque))
        along = [NUMBERS.inequality(*each, numbered(state)) for each in bounds]
        via = _via(problem, q, v)
        times = np.array([at for at, _, _ in via])
        if times.size and durations[0] < durations[1]:
            raise ValueError("via: times need a given duration; with a free one, take phases")
        if not np.all(np.diff(np.concatenate([[0.0], times, [durations[1]]])) > 0.0):
            raise ValueError(
                f"via: times must increase between 0 and {durations[1]:.6g} s, got "
                f"{', '.join(f'{at:.6g}' for at in times)}"
            )
        boundary = problem.boundary(q0, q1, v0, v1)
        return cls(
            problem=problem,
            metric=metric,
            durations=durations,
            state=state,
            jerk=jerk,
            time=t,
            at_ends=ca.vertcat(q0, v0, q1, v1),
            seconds=ca.SX.sym("T"),
            cost=ca.plus(*costs.values()),
            torque=torque,
            ends=equalities("boundary", boundary, q0, v0, q1, v1),
            along=tuple(_varying(along, (t, q, v, a))),
            via_fractions=times / durations[1],
            via=tuple(equalities(label, entries, q, v) for _, entries, label in via),
            duration=float(np.sqrt(np.prod(durations))),
        )

    @property
    def is_free(self) -> bool:
        """Whether the duration is found."""
        return self.durations[0] < self.durations[1]

    @property
    def conditions(self) -> list[Condition]:
        """All conditions."""
        return [*self.ends, *self.along, *(each for group in self.via for each in group)]

    def units(self, orders: int) -> Array:
        """Return units of positions and so many of their derivatives in time, (orders n,)."""
        each = self.size / self.duration ** np.arange(orders)
        return np.repeat(each, self.metric.dim)

    @cached_property
    def has_rate(self) -> bool:
        """Whether the running cost depends on the jerk, so that accelerations are continuous."""
        return bool(ca.depends_on(self.cost, self.jerk))

    @cached_property
    def orders(self) -> range:
        """Orders of the derivatives in the running cost."""
        return range(4 if self.has_rate else 3)

    @cached_property
    def running(self) -> Terms:
        """The running cost of an instant."""
        state = ca.vertcat(self.state, self.jerk) if self.has_rate else self.state
        cost = self.seconds * self.cost if self.is_free else self.cost
        return self._terms(state, cost, ca.SX(0, 1))

    @cached_property
    def groups(self) -> tuple[BoundedGroup, ...]:
        """Conditions along the motion: equalities, and all others."""
        equal = tuple(each for each in self.along if np.all(each.lower == each.upper))
        others = tuple(each for each in self.along if each not in equal)
        pairs = ((equal, True), (others, False))
        return tuple(
            BoundedGroup(group, self._terms(self.state, ca.SX(0.0), _in_scales(group)), is_equality)
            for group, is_equality in pairs
            if group
        )

    def _terms(self, state: ca.SX, objective: ca.SX, constraints: ca.SX) -> Terms:
        if not self.is_free:
            return Terms(state, self.time, objective, constraints)
        objective, constraints = self.in_fractions(objective, constraints)
        return Terms(ca.vertcat(state, self.seconds), self.time, objective, constraints)

    def in_fractions(self, *expressions: ca.SX) -> list[ca.SX]:
        """Return expressions of which v, a, jerk and t become those in fractions of the duration,
        and v at the ends.
        """
        n = self.metric.dim
        powers = ca.vertcat(*(ca.SX.ones(n) * self.seconds**order for order in range(3)))
        ends = ca.repmat(powers[: 2 * n], 2, 1)
        found = [
            (self.state, self.state / powers),
            (self.jerk, self.jerk / self.seconds**3),
            (self.time, self.time * self.seconds),
            (self.at_ends, self.at_ends / ends),
        ]
        old, new = (ca.vertcat(*each) for each in zip(*found, strict=True))
        return [ca.substitute(each, old, new) for each in expressions]

    def measured(self, piece: Piece) -> Phase:
        """Return the phase with its size and the scales of its conditions, from a first guess."""
        n = self.metric.dim
        q = piece.knots[:, :n]
        v = piece.knots[:, n:]
        size = size_of(self.metric, q) or 1.0
        own = replace(self, size=size, duration=piece.duration)
        accelerations = CubicHermiteSpline(piece.times, q, v)(piece.times, 2)
        at_ends = np.hstack([q[0], v[0], q[-1], v[-1]])[None]
        states = with_beside(np.hstack([q, v, accelerations]), own.units(3))
        times = np.tile(piece.duration * piece.fractions, 2)[:, None]
        in_time = np.append(own.units(3), 0.0)  # instants are held
        state = ca.vertcat(self.state, self.time)
        both = np.tile(own.units(2), 2)
        knots = states[:, : 2 * n]
        return replace(
            own,
            ends=scaled(self.ends, self.at_ends, at_ends, both),
            along=scaled(self.along, state, np.hstack([states, times]), in_time),
            via=tuple(scaled(each, self.state[: 2 * n], knots, both[: 2 * n]) for each in self.via),
        )

    def energy(self, piece: Piece) -> float:
        """Return int |q'|^2_G / 2 dt of a motion."""
        s, weights = piece.basis.rule
        at = instants(piece.fractions, s)
        speeds = speeds_at(self.metric, piece.states(at, 0), piece.states(at, 1))
        shares = piece.duration * np.outer(np.diff(piece.fractions), weights).ravel()
        return float(shares @ speeds**2 / 2.0)

    def instants(self, piece: Piece, is_equality: bool) -> Array:
        """Return fractions of the duration at which conditions along the motion are constrained.

        Equalities, such as a passive joint's, leave no freedom at more points than a polynomial of
        a segment has coefficients beyond position and velocity.
        """
        if is_equality:
            nodes, _ = leggauss(piece.basis.bubbles + 2)
            return instants(piece.fractions, (nodes + 1.0) / 2.0)
        inside = instants(piece.fractions, piece.basis.rule[0])
        return np.unique(np.concatenate([inside, piece.fractions, piece.more]))

    def violations(self, piece: Piece) -> tuple[dict[str, float], Array]:
        """Return the largest violation of each condition of a motion, at and between the instants
        of the program, by name, and that of all inequalities along it (m, 2): fractions, amounts.
        """
        s = np.unique(instants(piece.fractions, np.linspace(0.0, 1.0, _SAMPLES + 1)))
        states = np.hstack([piece.states(s, order) for order in range(3)])
        found = {}
        amounts = np.zeros(s.size)
        for each in self.along:
            function = ca.Function("g", [self.state, self.time], [each.expression])
            values = function(states.T, piece.duration * s[None, :]).full()
            excess = excess_over_bounds(each, values).max(axis=0, initial=0.0)
            found[each.name] = float(excess.max())
            if np.any(each.lower < each.upper):
                amounts = np.maximum(amounts, excess)
        at = [int(np.argmin(np.abs(piece.fractions - each))) for each in self.via_fractions]
        groups = [(self.at_ends, self.ends, piece.knots[[0, -1]].ravel())]
        knot = self.state[: 2 * self.metric.dim]
        groups += [(knot, each, piece.knots[k]) for each, k in zip(self.via, at, strict=True)]
        for symbols, conditions, values in groups:
            found |= excesses(conditions, symbols, values)
        return found, np.column_stack([s, amounts])


@dataclass(frozen=True, eq=False)
class ConstrainedRows:
    """Constraint functions of a program that are one condition.

    Attributes:
        condition: the condition.
        numbers: their numbers in the program (instants, m).
        phase: number of the phase.
    """

    condition: Condition
    numbers: Indices
    phase: int


@dataclass(frozen=True, eq=False)
class MotionNLP:
    """The nonlinear program of a motion whose parameter is a unit of cost.

    Attributes:
        program: its blocks.
        rows: its constraint functions by condition; those that keep accelerations continuous are
            none.
        bounds: lower and upper, of the variables (size,).
    """

    program: BlockProgram
    rows: tuple[ConstrainedRows, ...]
    bounds: tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class MotionDefinition:
    """The phases of a motion problem, and what joins them.

    Attributes:
        problem: the problem.
        phases: in order.
        ends: symbols (q0, v0, q1, v1) of the end of a phase and the start of the next.
        joins: equalities in these, one fewer than phases.
        grid: breakpoints of each phase at first, and degree of its polynomials.
    """

    problem: MotionProblem | MotionPhases
    phases: tuple[Phase, ...]
    ends: ca.SX
    joins: tuple[tuple[Condition, ...], ...]
    grid: Grid = GRID

    @classmethod
    def of(
        cls, problem: MotionProblem | MotionPhases, grid: Grid | None = None
    ) -> MotionDefinition:
        """Call each method of the problem once; ValueError where the problem is malformed."""
        if grid is not None and grid.degree < 5:
            raise ValueError(f"grid: motions have polynomials of degree 5 and more, got {grid}")
        if isinstance(problem, MotionProblem):
            return cls(problem, (Phase.of(problem),), ca.SX(), (), grid or GRID)
        phases = [Phase.of(each) for each in problem.phases]
        if not phases:
            raise ValueError(f"{type(problem).__name__} has no phases")
        dims = [each.metric.dim for each in phases]
        if len(set(dims)) > 1:
            raise ValueError(f"phases must have the same coordinates, they have {dims}")
        symbols = [ca.SX.sym(name, dims[0]) for name in ("q0", "v0", "q1", "v1")]
        joins = []
        for number in range(len(phases) - 1):
            label = f"join of phases {number} and {number + 1}"
            found = equalities(label, problem.join(number, *symbols), *symbols)
            joins.append(tuple(replace(each, name=f"{label}: {each.name}") for each in found))
        named = tuple(_named(each, f"phase {number}: ") for number, each in enumerate(phases))
        return cls(problem, named, ca.vertcat(*symbols), tuple(joins), grid or GRID)

    @property
    def basis(self) -> SegmentBasis:
        """Polynomials of a segment."""
        return basis_of(self.grid.degree)

    @property
    def has_bounds(self) -> bool:
        """Whether there are conditions along the motion."""
        return any(each.along for each in self.phases)

    @property
    def conditions(self) -> list[Condition]:
        """All conditions, those of the joins last."""
        own = [each for phase in self.phases for each in phase.conditions]
        return own + [each for group in self.joins for each in group]

    def without_bounds(self) -> MotionDefinition:
        """Return the problem without its conditions along the motion."""
        return replace(self, phases=tuple(replace(each, along=()) for each in self.phases))

    def measured(self, pieces: Sequence[Piece]) -> MotionDefinition:
        """Return the problem with its sizes and scales of its conditions, from a first guess."""
        pairs = zip(self.phases, pieces, strict=True)
        phases = tuple(phase.measured(piece) for phase, piece in pairs)
        n = phases[0].metric.dim
        joins = []
        for number, group in enumerate(self.joins):
            knots = [pieces[number].knots[-1], pieces[number + 1].knots[0]]
            units = np.concatenate([each.units(2) for each in phases[number : number + 2]])
            joins.append(scaled(group, self.ends, np.reshape(knots, (1, 4 * n)), units))
        return replace(self, phases=phases, joins=tuple(joins))

    def with_numbers(
        self, sizes: Sequence[float], durations: Sequence[float], scales: Mapping[str, Array]
    ) -> MotionDefinition:
        """Return the problem with sizes, durations and scales that were found before."""

        def known(group: Sequence[Condition]) -> tuple[Condition, ...]:
            return tuple(replace(each, scale=scales[each.name]) for each in group)

        phases = tuple(
            replace(
                phase,
                size=size,
                duration=duration,
                ends=known(phase.ends),
                along=known(phase.along),
                via=tuple(known(each) for each in phase.via),
            )
            for phase, size, duration in zip(self.phases, sizes, durations, strict=True)
        )
        return replace(self, phases=phases, joins=tuple(known(each) for each in self.joins))

    def reduced(self, pieces: Sequence[Piece]) -> Array:
        """Return a motion as variables of the program."""
        found = []
        for phase, piece in zip(self.phases, pieces, strict=True):
            units = np.repeat([phase.size, phase.size / piece.duration], phase.metric.dim)
            found.append(variables(piece.knots / units, piece.coefficients / phase.size))
        pairs = zip(self.phases, pieces, strict=True)
        free = [piece.duration / phase.duration for phase, piece in pairs if phase.is_free]
        return np.concatenate([*found, free])

    def pieces(self, x: Array, like: Sequence[Piece]) -> tuple[Piece, ...]:
        """Return the motion of variables, on the knots of another one."""
        found = []
        start = 0.0
        first = 0
        free = iter(x[self._layout(like)[1] :])
        for phase, piece in zip(self.phases, like, strict=True):
            n = phase.metric.dim
            own = x[first : first + piece.knots.size + piece.coefficients.size]
            first += own.size
            knots, coefficients = knots_of(own, self.basis, n)
            duration = phase.duration * float(next(free)) if phase.is_free else phase.durations[0]
            units = np.repeat([phase.size, phase.size / duration], n)
            found.append(
                replace(
                    piece,
                    start=start,
                    duration=duration,
                    knots=knots * units,
                    coefficients=coefficients * phase.size,
                )
            )
            start += duration
        return tuple(found)

    def _layout(self, pieces: Sequence[Piece]) -> tuple[list[int], int, list[int], int]:
        """Return first variables of all phases, their number, variables that are durations (-1 of
        given ones), and the number of all.
        """
        sizes = [each.knots.size + each.coefficients.size for each in pieces]
        firsts = np.cumsum([0, *sizes]).tolist()
        free = np.cumsum([each.is_free for each in self.phases])
        at = [
            int(firsts[-1] + number - 1) if each.is_free else -1
            for each, number in zip(self.phases, free, strict=True)
        ]
        return firsts[:-1], firsts[-1], at, firsts[-1] + int(free[-1])

    def nlp(self, pieces: Sequence[Piece]) -> MotionNLP:
        """Return the program of motions with the knots of these.

        Its constraints hold at some instants of every segment, and at more of them.
        """
        firsts, _, at_durations, size = self._layout(pieces)
        unit_of_cost = ca.MX.sym("unit")
        blocks: list[Block] = []
        rows: list[ConstrainedRows] = []
        lower_x = np.full(size, -np.inf)
        upper_x = np.full(size, np.inf)

        def add(block: Block, group: Sequence[Condition], phase: int) -> None:
            first = sum(each.size_g for each in blocks)
            numbers = first + np.arange(block.size_g).reshape(block.count, -1)
            parts = np.split(numbers, np.cumsum([each.size for each in group])[:-1], axis=1)
            rows.extend(
                ConstrainedRows(each, part, phase) for each, part in zip(group, parts, strict=True)
            )
            blocks.append(block)

        def at_knots(
            group: Sequence[Condition], symbols: ca.SX, knots: Sequence[tuple[int, int]]
        ) -> None:
            """Add conditions in (q, v) at knots, each the numbers of a phase and of its knot."""
            if not group:
                return
            n = self.phases[0].metric.dim
            actual = ca.SX(symbols)
            places = []
            scale = []
            free: dict[int, ca.SX] = {}
            for k, (number, knot) in enumerate(knots):
                phase = self.phases[number]
                first = firsts[number] + (2 + self.basis.bubbles) * n * knot
                places.append(np.arange(first, first + 2 * n))
                scale.append(np.full(2 * n, phase.size) if phase.is_free else phase.units(2))
                if phase.is_free:
                    free[number] = phase.seconds
                    velocities = slice((2 * k + 1) * n, (2 * k + 2) * n)
                    actual[velocities] = symbols[velocities] / phase.seconds
            expression = ca.substitute(_in_scales(group), symbols, actual)
            own = ca.vertcat(symbols, *free.values())
            at = [at_durations[number] for number in free]
            units = [self.phases[number].duration for number in free]
            lower, upper = _bounds(group, 1)
            factors = np.concatenate([*scale, units])[None]
            add(
                Block(
                    Terms(own, None, 0.0, expression),
                    np.concatenate([*places, at]).astype(int)[None],
                    None,
                    lower,
                    upper,
                    units=(np.zeros_like(factors), factors),
                ),
                group,
                knots[0][0],
            )

        for number, (phase, piece) in enumerate(zip(self.phases, pieces, strict=True)):
            place = _Places(phase, piece, self.basis, firsts[number], at_durations[number], size)
            if phase.is_free:
                lower_x[place.at_duration] = phase.durations[0] / phase.duration
                upper_x[place.at_duration] = phase.durations[1] / phase.duration
            s, weights = self.basis.rule
            at = instants(piece.fractions, s)
            shares = np.outer(np.diff(piece.fractions), weights).ravel()
            shares = shares if phase.is_free else piece.duration * shares
            times = at if phase.is_free else piece.duration * at
            blocks.append(
                Block(
                    phase.running,
                    place.cells(s) if place.is_alone else place.at(at, phase.orders),
                    times[:, None],
                    weights=ca.DM(shares) / unit_of_cost,
                    units=place.units(at.size, len(phase.orders)),
                )
            )
            if phase.has_rate and len(piece.fractions) > 2:
                blocks.append(place.jumps())
            for bounded in phase.groups:
                at = phase.instants(piece, bounded.is_equality)
                lower, upper = _bounds(bounded.conditions, at.size)
                times = at if phase.is_free else piece.duration * at
                block = Block(
                    bounded.terms,
                    place.at(at, range(3)),
                    times[:, None],
                    lower,
                    upper,
                    units=place.units(at.size, 3),
                )
                add(block, bounded.conditions, number)
            last = len(piece.fractions) - 1
            at_knots(phase.ends, phase.at_ends, [(number, 0), (number, last)])
            inner = [int(np.argmin(np.abs(piece.fractions - s))) for s in phase.via_fractions]
            for group, knot in zip(phase.via, inner, strict=True):
                at_knots(group, phase.state[: 2 * phase.metric.dim], [(number, knot)])
        for number, group in enumerate(self.joins):
            last = len(pieces[number].fractions) - 1
            at_knots(group, self.ends, [(number, last), (number + 1, 0)])
        return MotionNLP(BlockProgram(size, blocks, unit_of_cost), tuple(rows), (lower_x, upper_x))

    def violations(self, pieces: Sequence[Piece]) -> tuple[dict[str, float], list[Array]]:
        """Return the largest violation of each condition of a motion by name, and violations along
        each phase, see `Phase.violations`.
        """
        found: dict[str, float] = {}
        along = []
        for phase, piece in zip(self.phases, pieces, strict=True):
            own, amounts = phase.violations(piece)
            found |= own
            along.append(amounts)
        for number, group in enumerate(self.joins):
            knots = [pieces[number].knots[-1], pieces[number + 1].knots[0]]
            found |= excesses(group, self.ends, np.concatenate(knots))
        return found, along


@dataclass(frozen=True, eq=False)
class _Places:
    """Where the states of a phase are among the variables of a program."""

    phase: Phase
    piece: Piece
    basis: SegmentBasis
    first: int
    at_duration: int
    size: int

    @property
    def is_alone(self) -> bool:
        """Whether its variables are the first, and its duration is given."""
        return self.first == 0 and not self.phase.is_free

    def cells(self, s: Array) -> Any:
        """Return the states at fractions s of all segments, cell by cell."""
        n = self.phase.metric.dim
        return state_cells(self.basis, self.piece.fractions, n, s, self.phase.orders)

    def at(self, fractions: Array, orders: Sequence[int]) -> scipy.sparse.csr_array:
        """Return the matrix to the states at fractions of the duration, which follows if free."""
        n = self.phase.metric.dim
        matrix = self._shifted(state_matrix(self.basis, self.piece.fractions, n, fractions, orders))
        if not self.phase.is_free:
            return matrix
        count = fractions.size
        ones = (np.ones(count), (np.arange(count), np.full(count, self.at_duration)))
        durations = scipy.sparse.csr_array(ones, shape=(count, self.size))
        rows = np.arange(matrix.shape[0]).reshape(count, -1)
        order = np.column_stack([rows, matrix.shape[0] + np.arange(count)]).ravel()
        return scipy.sparse.csr_array(scipy.sparse.vstack([matrix, durations], "csr")[order])

    def jumps(self) -> Block:
        """Return the block that keeps accelerations continuous at inner knots."""
        n = self.phase.metric.dim
        fractions = self.piece.fractions
        after, before = (
            state_matrix(self.basis, fractions, n, fractions[1:-1], [2], before=each)
            for each in (False, True)
        )
        # As small as the variables are: accelerations are larger the finer the grid.
        widths = np.diff(fractions)
        scale = np.repeat(np.minimum(widths[1:], widths[:-1]) ** 2, n)[:, None]
        jump = Terms(self.phase.jerk, None, 0.0, self.phase.jerk)  # of q'', by any n symbols
        zeros = np.zeros((len(widths) - 1, n))
        return Block(jump, self._shifted((after - before).multiply(scale)), None, zeros, zeros)

    def units(self, count: int, orders: int) -> tuple[Array, Array]:
        """Return offset and scale of the states at so many instants."""
        phase = self.phase
        each = phase.units(orders)
        if phase.is_free:
            each = np.append(np.full(orders * phase.metric.dim, phase.size), phase.duration)
        units = np.tile(each, (count, 1))
        return np.zeros_like(units), units

    def _shifted(self, matrix: Any) -> scipy.sparse.csr_array:
        own = scipy.sparse.csr_array(matrix)
        entries = own.data, own.indices + self.first, own.indptr
        return scipy.sparse.csr_array(entries, shape=(own.shape[0], self.size))


def _durations(problem: MotionProblem) -> tuple[float, float]:
    """Return the shortest and the longest duration [s]."""
    given = problem.duration
    if not isinstance(given, Sequence):
        number = as_positive("duration", given, "s")
        return number, number
    shortest, longest = given if len(given) == 2 else (np.nan, np.nan)
    if not 0.0 < shortest < longest < np.inf:
        raise ValueError(
            f"duration must be positive [s], or the shortest and the longest one, got {given!r}"
        )
    return shortest, longest


def _via(problem: MotionProblem, q: ca.SX, v: ca.SX) -> list[tuple[float, Any, str]]:
    found = []
    for label, each in listed("via", problem.via(q, v)):
        if not isinstance(each, Sequence) or len(each) != 2:
            raise ValueError(f"{label} must be (time, equalities), got {each!r}")
        at, entries = each
        found.append((as_number(f"{label}: its time", at), entries, label))
    return found


def equalities(label: str, entries: Any, *symbols: ca.SX) -> tuple[Condition, ...]:
    """Return equalities of a problem in these symbols; ValueError if one is malformed."""
    known = numbered(*symbols)
    found = [NUMBERS.equality(*each, known) for each in listed(label, entries)]
    for condition in found:
        if not np.all(np.isfinite(condition.lower)):
            raise ValueError(f"{condition.name}: a value must be finite")
    return tuple(_varying(found, symbols))


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


def _named(phase: Phase, prefix: str) -> Phase:
    def named(group: Sequence[Condition]) -> tuple[Condition, ...]:
        return tuple(replace(each, name=prefix + each.name) for each in group)

    via = tuple(named(each) for each in phase.via)
    return replace(phase, ends=named(phase.ends), along=named(phase.along), via=via)


def scaled(
    group: Sequence[Condition], z: ca.SX, samples: Array, units: Array
) -> tuple[Condition, ...]:
    """Return conditions in z with their scales, see `scales_of`."""
    values = stacked(group)
    slopes = ca.densify(ca.jacobian(values, z))
    function = ca.Function("conditions", [z, ca.SX(0, 1)], [values, slopes])
    scales = scales_of(group, function, samples, units, np.zeros(0))
    return tuple(replace(each, scale=scales[each.name]) for each in group)


def excesses(group: Sequence[Condition], z: ca.SX, values: Array) -> dict[str, float]:
    """Return by how much conditions in z are violated, in their scales, by name."""
    found = {}
    for each in group:
        at = ca.Function("g", [z], [each.expression])(values).full()
        found[each.name] = float(excess_over_bounds(each, at).max(initial=0.0))
    return found


def _in_scales(conditions: Sequence[Condition]) -> ca.SX:
    scales = np.concatenate([each.scales for each in conditions])
    return stacked(conditions) / ca.DM(scales)


def _bounds(conditions: Sequence[Condition], count: int) -> tuple[Array, Array]:
    """Return bounds in the scales of conditions, (count, rows)."""
    lower, upper = ([getattr(c, side) / c.scale for c in conditions] for side in ("lower", "upper"))
    return np.tile(np.concatenate(lower), (count, 1)), np.tile(np.concatenate(upper), (count, 1))
