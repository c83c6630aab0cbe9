"""Solutions of motion problems: the motion with its statistics, multipliers and certificate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import scipy
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr, as_integer, evaluate
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.ocp.certificate import stationarity_and_index
from geodesic_ocp.ocp.motion_definition import MotionDefinition, MotionNLP, Piece
from geodesic_ocp.ocp.motion_problem import MotionPhases, MotionProblem
from geodesic_ocp.ocp.solution import Attempt, SavedSolution, Stats
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.timed_motion import TimedMotion

# In the scaled program: an unbalanced force, and the force of a condition that is active.
_BALANCE = 1e-5
_ACTIVE = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class MotionNumbers(ShortRepr):
    """What defines the last program of a solve, besides its problem and its knots.

    Attributes:
        degree: of the polynomials.
        sizes, durations: of every phase, in which the program is scaled.
        scales: of the rows of every condition, by name.
        unit: of the objective.
        lam_x, lam_g: multipliers of the bounds of variables, and of the constraint functions.
    """

    degree: int
    sizes: tuple[float, ...]
    durations: tuple[float, ...]
    scales: Mapping[str, Array]
    unit: float
    lam_x: Array
    lam_g: Array
    _shown = ("degree", "sizes", "durations", "unit")


@dataclass(frozen=True)
class SecondVariation:
    """Certificate of a motion among those that meet its problem's conditions.

    Attributes:
        stationary: whether the cost does not change to first order.
        morse_index: number of independent directions in which the cost of a stationary motion
            decreases to second order; None if it is not stationary.
        active: names of the conditions along the motion that exert a force.
    """

    stationary: bool
    morse_index: int | None
    active: tuple[str, ...]

    @property
    def locally_minimizing(self) -> bool:
        """Whether the motion is a local minimum, to second order, on its knots."""
        return self.stationary and self.morse_index == 0

    def __str__(self) -> str:
        if not self.stationary:
            return "not stationary"
        index = f"stationary, not locally minimizing: Morse index {self.morse_index}"
        verdict = "locally minimizing" if self.locally_minimizing else index
        return f"{verdict}; active: {', '.join(self.active)}" if self.active else verdict


@dataclass(frozen=True, eq=False, repr=False)
class PhasedMotion(TimedMotion, ShortRepr):
    """A motion of polynomials in time, one phase after the other.

    Attributes:
        problem: the problem whose phases they are.
        pieces: the motion of every phase.
    """

    problem: MotionProblem | MotionPhases
    pieces: tuple[Piece, ...]

    _shown = ("duration",)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what was found: CasADi's expressions are built again from the problem."""
        return type(self), tuple(getattr(self, each.name) for each in fields(self))

    @property
    def metric(self) -> Metric:  # type: ignore[override]
        """Metric of the problem."""
        return self.problem.metric

    @property
    def times(self) -> Array:  # type: ignore[override]
        """Times of the knots of all phases, increasing [s]."""
        first = self.pieces[0].times
        return np.concatenate([first, *(each.times[1:] for each in self.pieces[1:])])

    @property
    def durations(self) -> Array:
        """Durations of the phases [s]."""
        return np.array([each.duration for each in self.pieces])

    def states(self, t: Array, order: int) -> Array:
        """Return derivatives of this order at times (k,) within the motion, (k, n).

        Where two phases meet, they are those of the later one.
        """
        found = np.empty((len(t), self.metric.dim))
        for number, rows in self._by_phase(t):
            piece = self.pieces[number]
            fractions = np.clip((t[rows] - piece.start) / piece.duration, 0.0, 1.0)
            found[rows] = piece.states(fractions, order)
        return found

    def torques(self, t: ArrayLike) -> Array:
        """Return the torques of the problem's phases at t, (n,) for a number, or (k, n) [N m or
        N].
        """
        at = self.checked(t)
        states = np.hstack([self.states(at, order) for order in range(3)])
        found = np.empty((len(at), self.metric.dim))
        for number, rows in self._by_phase(at):
            phase = self._definition.phases[number]
            function = ca.Function("torque", [phase.state], [phase.torque])
            found[rows] = function(states[rows].T).full().T
        return found[0] if np.ndim(t) == 0 else found

    def _by_phase(self, t: Array) -> list[tuple[int, Any]]:
        starts = [each.start for each in self.pieces[1:]]
        phase = np.searchsorted(starts, t, "right")
        return [(int(number), phase == number) for number in np.unique(phase)]

    def resample(self, count: int) -> Array:
        """Return positions (count, n) at equal intervals of time, both ends included."""
        count = as_integer("count", count, 2)
        return self(np.linspace(self.times[0], self.times[-1], count))

    @cached_property
    def _definition(self) -> MotionDefinition:
        return MotionDefinition.of(self.problem)


@dataclass(frozen=True, eq=False, repr=False)
class MotionSolution(PhasedMotion, SavedSolution):
    """The motion of least cost under a problem's conditions, or the last iterate towards one.

    Attributes:
        stats: statistics of the solve; `stats.success` distinguishes a solution from an iterate.
        numbers: of the last program.
        attempts: all that was tried, in order.
    """

    stats: Stats
    numbers: MotionNumbers
    attempts: tuple[Attempt, ...] = ()

    def __repr__(self) -> str:
        stats = self.stats
        kind = type(self.problem).__name__
        if not stats.success:
            return f"Solution of {kind}: not solved, {stats.status}"
        return (
            f"Solution of {kind}: objective {stats.objective:.6g}, duration {self.duration:.6g} s\n"
            f"  {stats.status} in {stats.total_iterations} iterations, "
            f"{stats.total_seconds:.2g} s; largest violation {stats.max_path_violation:.1e}"
        )

    @cached_property
    def _definition(self) -> MotionDefinition:
        numbers = self.numbers
        definition = MotionDefinition.of(self.problem, Grid(1, numbers.degree))
        return definition.with_numbers(numbers.sizes, numbers.durations, numbers.scales)

    @property
    def energy(self) -> float:
        """Int |q'|^2_G / 2 dt."""
        pairs = zip(self._definition.phases, self.pieces, strict=True)
        return sum(phase.energy(piece) for phase, piece in pairs)

    @cached_property
    def nlp(self) -> MotionNLP:
        """The last program of the solve."""
        return self._definition.nlp(self.pieces)

    @cached_property
    def multipliers(self) -> Mapping[str, Array]:
        """Derivatives of the least cost by the value of each condition, by its name, with Ipopt's
        sign (positive for an active upper bound): (m,) at ends, via points and joins, (k, m) along
        a phase at the times of `multiplier_times`.
        """
        found = {}
        for rows in self.nlp.rows:
            scales = rows.condition.scales
            values = self.numbers.unit * self.numbers.lam_g[rows.numbers] / scales
            is_along = len(rows.numbers) > 1
            found[rows.condition.name] = values if is_along else values[0]
        return found

    @cached_property
    def multiplier_times(self) -> Mapping[str, Array]:
        """Times (k,) [s] at which each condition along a phase holds in the program, by name."""
        return {
            each.name: piece.start + piece.duration * phase.instants(piece, group.is_equality)
            for phase, piece in zip(self._definition.phases, self.pieces, strict=True)
            for group in phase.groups
            for each in group.conditions
        }

    @cached_property
    def certificate(self) -> SecondVariation:
        """The certificate: whether the cost decreases in any direction in which the active
        conditions remain satisfied, to second order.
        """
        nlp = self.nlp
        x = self._definition.reduced(self.pieces)
        p = np.array([self.numbers.unit])
        functions = nlp.program.functions
        lam_x = self.numbers.lam_x
        lam_g = self.numbers.lam_g
        _, gradient = evaluate(functions["grad_f"], x, p)
        _, jacobian = evaluate(functions["jac_g"], x, p)
        balance = gradient[:, 0] + jacobian.T @ lam_g + lam_x
        lower, upper = nlp.program.bounds
        forces = np.abs(lam_g) * np.linalg.norm(jacobian, axis=1)
        is_active = (lower == upper) | (forces > _ACTIVE)
        along = [each for each in nlp.rows if len(each.numbers) > 1]
        active = tuple(each.condition.name for each in along if np.any(is_active[each.numbers]))
        if not self.stats.success or np.abs(balance).max() > _BALANCE:
            return SecondVariation(False, None, active)
        hessian = evaluate(functions["hess_lag"], x, p, 1.0, lam_g)
        hessian = hessian + np.triu(hessian, 1).T
        is_free = np.abs(lam_x) <= _ACTIVE
        tangent = np.eye(x.size)[:, is_free]
        if np.any(is_active):
            tangent = tangent @ scipy.linalg.null_space(jacobian[is_active] @ tangent)
        reduced = tangent.T @ hessian @ tangent
        _, index = stationarity_and_index(np.zeros(len(reduced)), reduced)
        return SecondVariation(True, index, active)

    def record(self) -> dict[str, Any]:
        """Return the solution as JSON values: pieces of the motion [rad or m, s], statistics,
        multipliers; the problem as `Solution.record` does.
        """
        return self.recorded(
            pieces=[asdict(each) for each in self.pieces],
            numbers=asdict(self.numbers),
            multipliers=dict(self.multipliers),
            attempts=[asdict(each) for each in self.attempts],
        )
