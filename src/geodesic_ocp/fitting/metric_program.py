"""The nonlinear program of a fit: the paths of all segments and the parameters together.

The parameters come first in the order of the variables, and then the segments, num_x variables and
m equations each. Segments share the parameters only.

Variables: the parameters relative to their initial values; of every segment, the values of its path
at the nodes and the rates of progress at its ends. Objective: the weighted mean of the squared
errors. Constraints: every path is a geodesic of the metric with these parameters. This is inverse
optimal control in one level (the stationarity conditions of the inner problem are constraints;
Hatz, Schloeder, Bock, "Estimating parameters in optimal control problems", SIAM J. Sci. Comput. 34,
2012). Blocks are single nodes and samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.blocks import Block, BlockProgram, Terms
from geodesic_ocp.cells import Indices
from geodesic_ocp.fitting.recording_part import MAX_END_RATE, RecordingPart
from geodesic_ocp.ipopt import Ipopt, Outcome, Relay

# Weight of the squared logarithm of each parameter relative to its initial value: negligible where
# the data determine it, it keeps combinations that they do not determine near these values.
_REGULARIZATION = 1e-6
_NEGLIGIBLE = 1e-3  # relative values much below this one are as zero to the logarithm
_ACTIVE = 1e-6  # distance from a bound that is active
_FULFILLED = 1e-6  # conditions, in their units
_WORSE = 1e-6  # an error that is larger by so much, relative
# of parameters from poor initial values, their factor
_STEPS = 20
_STEP = 2.0
_LEAST_STEP = 0.01
_IPOPT = {"tol": 1e-7, "max_iter": 200, "acceptable_iter": 0}
_WARM = {
    "warm_start_init_point": "yes",
    "mu_init": 1e-6,
    "warm_start_bound_push": 1e-8,
    "warm_start_mult_bound_push": 1e-8,
    "warm_start_slack_bound_push": 1e-8,
}


@dataclass(frozen=True, eq=False, repr=False)
class LeastErrors(ShortRepr):
    """Derivatives of e_r(theta), half the least mean squared error of recording r.

    The least error over all predictions with these parameters, in units of the deviation; the
    parameters in units of their initial values. Of a segment, it is its share of the recording's.
    """

    values: Array  # (recordings,) or (segments,)
    gradients: Array  # (recordings, p) or (segments, p)
    hessians: Array  # (recordings, p, p) or (segments, p, p)

    def of_parameters(self, chosen: Indices) -> LeastErrors:
        """Return the derivatives by some of the parameters, by index."""
        hessians = self.hessians[:, chosen][:, :, chosen]
        return LeastErrors(self.values, self.gradients[:, chosen], hessians)


class _Listener:
    """Callback of solvers that are built once, which remembers whom to tell of iterations."""

    def __init__(self) -> None:
        self._report: Callable[[int], object] | None = None

    def listen(self, report: Callable[[int], object] | None) -> None:
        """Tell this function from now on; None: nobody."""
        self._report = report

    def __call__(self, number: int, values: object) -> None:
        del values
        if self._report is not None:
            self._report(number)


@dataclass(frozen=True, eq=False, repr=False)
class MetricProgram(ShortRepr):
    """The nonlinear program of a fit, for any weights of the segments."""

    parts: tuple[RecordingPart, ...]  # the recordings
    start: Array  # initial values of the parameters (p,), which are their units
    # lower, upper: their bounds (p,)
    lower: Array
    upper: Array
    free_ends: bool  # whether the ends of the paths are estimated; otherwise they are as observed
    are_shares: bool = False  # whether the parameters add up to one
    _shown = ("size", "counts")

    @property
    def size(self) -> int:
        """Number p of parameters."""
        return self.start.size

    @cached_property
    def num_x(self) -> int:
        """Number of variables of a segment."""
        return self.parts[0].terms.num_x

    @cached_property
    def counts(self) -> list[int]:
        """Number of segments of each recording."""
        return [part.count for part in self.parts]

    @cached_property
    def owners(self) -> Indices:
        """Index of the recording of every segment."""
        return np.repeat(np.arange(len(self.parts)), self.counts)

    @cached_property
    def _first(self) -> list[int]:
        """Index of the first variable of each recording."""
        return [self.size + self.num_x * sum(self.counts[:k]) for k in range(len(self.parts))]

    @cached_property
    def program(self) -> BlockProgram:
        """All blocks; the weights of the segments are its parameters."""
        p = self.size
        weights = ca.MX.sym("weights", sum(self.counts))
        near = Block(_change(), np.arange(p)[:, None], weights=np.full(p, _REGULARIZATION))
        edges = np.cumsum([0, *self.counts]).tolist()
        own = zip(self.parts, self._first, ca.vertsplit(weights, edges), strict=True)
        errors = [part.errors(first, weight) for part, first, weight in own]
        pairs = zip(self.parts, self._first, strict=True)
        equations = [part.equations(first, self.start) for part, first in pairs]
        size = p + self.num_x * sum(self.counts)
        total = _excess_of_shares(p)
        zero = np.zeros((1, 1))
        one = np.ones((1, p))
        shares = Block(
            total, np.arange(p)[None, :], None, zero, zero, None, (0.0 * one, one * self.start)
        )
        blocks = [near, *errors, *equations, *[shares][: self.are_shares]]
        return BlockProgram(size, blocks, weights)

    @cached_property
    def _errors(self) -> ca.Function:
        """Half the squared error of each segment, whose sum is the mean over the recording."""
        z = ca.MX.sym("z", self.program.size)
        pairs = zip(self.parts, self._first, strict=True)
        errors = [part.errors(first).objectives(z) for part, first in pairs]
        return ca.Function("errors", [z], [ca.vertcat(*errors)])

    def _of_recordings(self, values: Array) -> Array:
        """Return the sums over the segments of each recording of values (segments, ...)."""
        result = np.zeros((len(self.parts), *values.shape[1:]))
        np.add.at(result, self.owners, values)
        return result

    def mean_squares(self, z: Array) -> Array:
        """Return mean squared error of each recording, (recordings,), in units of the deviation."""
        return self._of_recordings(2.0 * self._errors(z).full()[:, 0])

    @cached_property
    def _listener(self) -> _Listener:
        return _Listener()

    def _solver(self, options: dict[str, Any]) -> Ipopt:
        program = self.program
        size_p = sum(self.counts)
        return program.solver(options, Relay(program.size, program.size_g, size_p, self._listener))

    @cached_property
    def _cold_solver(self) -> Ipopt:
        return self._solver(_IPOPT)

    @cached_property
    def _warm_solver(self) -> Ipopt:
        return self._solver({**_IPOPT, **_WARM})

    @cached_property
    def guess(self) -> Array:
        """The initial values of all variables."""
        parts = [np.ones(self.size)]
        for part in self.parts:
            own = part.coefficients.reshape(part.count, -1)
            parts.append(np.hstack([own, part.end_rates]).ravel())
        return np.concatenate(parts)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Bounds of the variables, those of the parameters included."""
        terms = self.parts[0].terms
        lower, upper = np.full((2, sum(self.counts), self.num_x), np.inf)
        lower *= -1.0
        rates = self.num_x - terms.num_rates
        lower[:, rates:] = 0.0
        upper[:, rates:] = MAX_END_RATE
        if not self.free_ends:
            ends = np.add.outer(terms.dim * np.array(terms.given), np.arange(terms.dim)).ravel()
            given = self.guess[self.size :].reshape(-1, self.num_x)
            lower[:, ends] = upper[:, ends] = given[:, ends]
        return (
            np.concatenate([self.lower / self.start, lower.ravel()]),
            np.concatenate([self.upper / self.start, upper.ravel()]),
        )

    def solve(
        self,
        weights: Array | None = None,
        near: Outcome | None = None,
        fixed: dict[int, float] | None = None,
        report: Callable[[int], object] | None = None,
    ) -> Outcome:
        """Return the solution for weights of the segments.

        Args:
            weights: (segments,); None: one.
            near: a solution for other weights, values or recordings from which to start.
            fixed: values of parameters that are not estimated, by index.
            report: called with the number of every iteration.
        """
        weights = np.ones(sum(self.counts)) if weights is None else weights
        self._listener.listen(report)
        lower, upper = (bound.copy() for bound in self.bounds)
        start = (self.guess if near is None else near.x).copy()
        for index, value in (fixed or {}).items():
            lower[index] = upper[index] = start[index] = value / self.start[index]
        x0 = np.clip(start, lower, upper)
        slack = np.zeros(self.program.size_g)
        if len(fixed or {}) == self.size:  # there is nothing left for shares to add up to
            slack[self._equations :] = np.inf
        given = {"p": weights, "lbx": lower, "ubx": upper, "lbg": -slack, "ubg": slack}
        # A start that fulfils the conditions bounds the least error from above.
        error, conditions = (each.full() for each in self.program.functions["nlp"](x0, weights))
        most = float(error[0, 0]) if np.abs(conditions).max() < _FULFILLED else np.inf

        def tried(solver: Ipopt, **more: Any) -> Outcome:
            found = solver(**{**given, "x0": x0, **more})
            if found.success and found.objective > most + _WORSE * (abs(most) + 1.0):
                return replace(found, success=False, status="Ipopt found only a larger error")
            return found

        if near is not None:
            outcome = tried(self._warm_solver, lam_x0=near.lam_x, lam_g0=near.lam_g)
            if outcome.success:
                return outcome
        outcome = tried(self._cold_solver)
        if outcome.success or fixed is not None:
            return outcome
        # From poor initial values: first the paths alone, then the parameters in small steps.
        known = dict(enumerate((start[: self.size] * self.start).tolist()))
        paths = self.solve(weights, near, known, report)
        for _ in range(_STEPS * paths.success):
            x0 = paths.x
            p = slice(self.size)
            narrow = lower.copy()
            wide = upper.copy()
            narrow[p] = np.maximum(lower[p], np.minimum(x0[p] / _STEP, x0[p] - _LEAST_STEP))
            wide[p] = np.minimum(upper[p], np.maximum(x0[p] * _STEP, x0[p] + _LEAST_STEP))
            more = {"lbx": narrow, "ubx": wide, "lam_x0": paths.lam_x, "lam_g0": paths.lam_g}
            most = paths.objective
            paths = tried(self._warm_solver, **more)
            if not paths.success:
                return paths
            stopped = (narrow > lower) & (paths.x < narrow + _ACTIVE)
            stopped |= (wide < upper) & (paths.x > wide - _ACTIVE)
            if not stopped[p].any():
                return paths
        return outcome

    def start_of(self, chosen: Sequence[int], solution: Outcome) -> Outcome:
        """Return the part of a solution that belongs to some of the recordings, by index."""
        segments = np.concatenate([np.flatnonzero(self.owners == index) for index in chosen])

        def of_variables(values: Array) -> Array:
            rest = values[self.size :].reshape(-1, self.num_x)[segments]
            return np.concatenate([values[: self.size], rest.ravel()])

        lam_g = np.append(self._multipliers(solution)[segments], solution.lam_g[self._equations :])
        x = of_variables(solution.x)
        lam_x = of_variables(solution.lam_x)
        return replace(solution, x=x, lam_x=lam_x, lam_g=lam_g)

    @property
    def _equations(self) -> int:
        """Number of equations of all segments."""
        return sum(self.counts) * self.parts[0].terms.num_equations

    def _multipliers(self, solution: Outcome) -> Array:
        """Return multipliers of the equations of each segment, (segments, m)."""
        return solution.lam_g[: self._equations].reshape(sum(self.counts), -1)

    def least_errors(self, solution: Outcome, by_segment: bool = False) -> LeastErrors:
        """Return derivatives by the parameters at the solution for equal weights.

        By the implicit function theorem, segment by segment.
        """
        z = solution.x
        ones = np.ones(sum(self.counts))
        p = self.size
        m = self.parts[0].terms.num_equations
        functions = self.program.functions
        factors = self._multipliers(solution)
        jacobian = functions["jac_g"](z, ones)[1].sparse().tocsr()
        upper = functions["hess_lag"](z, ones, 1.0, solution.lam_g).sparse()
        hessian = scipy.sparse.csc_array(upper + scipy.sparse.triu(upper, 1).T)
        lower_bound, upper_bound = self.bounds
        free = (z > lower_bound + _ACTIVE) & (z < upper_bound - _ACTIVE)
        gradients = np.zeros((sum(self.counts), p))
        hessians = self._curvatures(z, factors)
        for segment in range(len(gradients)):
            first = p + segment * self.num_x
            rows = slice(segment * m, (segment + 1) * m)
            columns = first + np.flatnonzero(free[first : first + self.num_x])
            equations = jacobian[rows]  # rows first: they are stored together
            by_theta = equations[:, :p].toarray()
            by_x = equations[:, columns].toarray()
            of_segment = hessian[:, columns]
            block = of_segment[columns].toarray()
            mixed = of_segment[:p].toarray()
            kkt = np.block([[block, by_x.T], [by_x, np.zeros((m, m))]])
            right = np.vstack([mixed.T, by_theta])
            hessians[segment] -= right.T @ np.linalg.lstsq(kkt, right, rcond=1e-13)[0]
            gradients[segment] = by_theta.T @ factors[segment]
        found = self._errors(z).full()[:, 0], gradients, hessians
        return LeastErrors(*(found if by_segment else map(self._of_recordings, found)))

    def _curvatures(self, z: Array, factors: Array) -> Array:
        """Return second derivatives (segments, p, p) of each one's equations by the parameters
        alone.

        Args:
            z: the variables.
            factors: of the equations of each segment, (segments, m).
        """
        p = self.size
        found = []
        for k, part in enumerate(self.parts):
            block = part.equations(self._first[k], self.start)
            own = block.of_instances(ca.DM(factors[self.owners == k].ravel()))
            inputs = [*block.arguments(ca.DM(z)), ca.DM.zeros(1, block.count), own]
            entries = block.terms.mapped("hessian", block.count, inputs)[0].full()
            rows, columns = block.terms.hessian_entries
            corner = rows >= block.terms.size - p
            hessians = np.zeros((part.count, p, p))
            sums = entries[corner].reshape(-1, part.count, block.count // part.count).sum(axis=2)
            at = rows[corner] - block.terms.size, columns[corner] - block.terms.size
            hessians[(slice(None), *at)] = sums.T * (self.start[at[0]] * self.start[at[1]])
            found.append(hessians)
        upper = np.concatenate(found)
        return np.asarray(upper + np.triu(upper, 1).swapaxes(1, 2))


@lru_cache(maxsize=1)
def _change() -> Terms:
    """Return squared logarithm of a relative value y; smooth at y = 0 as well."""
    y = ca.SX.sym("y")
    value = (ca.log((y**2 + _NEGLIGIBLE**2) / (1 + _NEGLIGIBLE**2)) / 2) ** 2
    return Terms(y, objective=value)


@lru_cache
def _excess_of_shares(size: int) -> Terms:
    """Return the sum of shares minus one."""
    y = ca.SX.sym("y", size)
    return Terms(y, constraints=ca.sum1(y) - 1.0)
