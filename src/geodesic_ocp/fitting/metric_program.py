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

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Protocol

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.blocks import Block, BlockProgram, Terms
from geodesic_ocp.fitting.recording_part import MAX_END_RATE, RecordingPart
from geodesic_ocp.ipopt import Ipopt, Outcome


class Start(Protocol):
    """Values of the variables and of the multipliers, such as an `Outcome`."""

    @property
    def x(self) -> Array:
        """Variables."""

    @property
    def lam_x(self) -> Array:
        """Multipliers of their bounds."""

    @property
    def lam_g(self) -> Array:
        """Multipliers of the equations."""


@dataclass(frozen=True, eq=False)
class StartValues:
    """A `Start` of given values."""

    x: Array
    lam_x: Array
    lam_g: Array


# Weight of the squared logarithm of each parameter relative to its initial value: negligible where
# the data determine it, it keeps combinations that they do not determine near these values.
_REGULARIZATION = 1e-6
_NEGLIGIBLE = 1e-3  # relative values much below this one are as zero to the logarithm
_IPOPT = {"tol": 1e-7, "max_iter": 200, "acceptable_iter": 0}
_WARM = {
    "warm_start_init_point": "yes",
    "mu_init": 1e-6,
    "warm_start_bound_push": 1e-8,
    "warm_start_mult_bound_push": 1e-8,
    "warm_start_slack_bound_push": 1e-8,
}


@dataclass(frozen=True, eq=False, repr=False)
class MetricProgram(ShortRepr):
    """The nonlinear program of a fit, for any weights of the recordings.

    Attributes:
        parts: the recordings.
        start: initial values of the parameters (p,), which are their units.
        lower, upper: their bounds (p,).
        free_ends: whether the ends of the paths are estimated; otherwise they are as observed.
    """

    parts: tuple[RecordingPart, ...]
    start: Array
    lower: Array
    upper: Array
    free_ends: bool

    _shown = ("size", "counts")

    @property
    def size(self) -> int:
        """Number p of parameters."""
        return self.start.size

    @cached_property
    def num_x(self) -> int:
        """Number of variables of a segment."""
        return self.parts[0].functions.num_nodes + 2

    @cached_property
    def counts(self) -> list[int]:
        """Number of segments of each recording."""
        return [part.count for part in self.parts]

    @cached_property
    def _first(self) -> list[int]:
        """Index of the first variable of each recording."""
        return [self.size + self.num_x * sum(self.counts[:k]) for k in range(len(self.parts))]

    @cached_property
    def program(self) -> BlockProgram:
        """All blocks; the weights of the recordings are its parameters."""
        p, weights = self.size, ca.MX.sym("weights", len(self.parts))
        pairs = list(zip(self.parts, self._first, strict=True))
        share = np.full(p, _REGULARIZATION)
        blocks = [Block(_change(), np.arange(p)[:, None], weights=share)]
        blocks += [part.errors(first, weights[k]) for k, (part, first) in enumerate(pairs)]
        blocks += [part.equations(first, self.start) for part, first in pairs]
        return BlockProgram(p + self.num_x * sum(self.counts), blocks, weights)

    @cached_property
    def _errors(self) -> ca.Function:
        """Half the mean squared error of each recording."""
        z = ca.MX.sym("z", self.program.size)
        pairs = zip(self.parts, self._first, strict=True)
        errors = [part.errors(first, 1.0).objective(z) for part, first in pairs]
        return ca.Function("errors", [z], [ca.vertcat(*errors)])

    @cached_property
    def _cold_solver(self) -> Ipopt:
        return self.program.solver(_IPOPT)

    @cached_property
    def _warm_solver(self) -> Ipopt:
        return self.program.solver({**_IPOPT, **_WARM})

    @cached_property
    def guess(self) -> Array:
        """The initial values of all variables."""
        parts = [np.ones(self.size)]
        for part in self.parts:
            nodes = part.observed.nodes.transpose(0, 2, 1).reshape(part.count, -1)
            parts.append(np.hstack([nodes, part.observed.end_rates]).ravel())
        return np.concatenate(parts)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Of the variables, those of the parameters included."""
        n, nodes = self.parts[0].functions.dim, self.num_x - 2
        lower, upper = np.full((2, sum(self.counts), self.num_x), np.inf)
        lower *= -1.0
        lower[:, nodes:], upper[:, nodes:] = 0.0, MAX_END_RATE
        if not self.free_ends:
            ends = [*range(n), *range(nodes - n, nodes)]
            given = self.guess[self.size :].reshape(-1, self.num_x)
            lower[:, ends] = upper[:, ends] = given[:, ends]
        return (
            np.concatenate([self.lower / self.start, lower.ravel()]),
            np.concatenate([self.upper / self.start, upper.ravel()]),
        )

    def solve(
        self, weights: Array, near: Start | None = None, fixed: dict[int, float] | None = None
    ) -> Outcome:
        """The solution for weights of the recordings.

        Args:
            weights: (recordings,).
            near: a solution for other weights, values or recordings from which to start.
            fixed: values of parameters that are not estimated, by index.
        """
        lower, upper = (bound.copy() for bound in self.bounds)
        start = (self.guess if near is None else near.x).copy()
        for index, value in (fixed or {}).items():
            lower[index] = upper[index] = start[index] = value / self.start[index]
        arguments = {"p": weights, "lbx": lower, "ubx": upper, "lbg": 0.0, "ubg": 0.0}
        arguments["x0"] = np.clip(start, lower, upper)
        if near is not None:
            more = {"lam_x0": near.lam_x, "lam_g0": near.lam_g}
            outcome = self._warm_solver(**arguments, **more)
            if outcome.success:
                return outcome
        outcome = self._cold_solver(**arguments)
        held = {index: float(value) for index, value in enumerate(self.start)}
        if outcome.success or near is not None or fixed is not None:
            return outcome
        # From poor initial values: first the paths alone, then the parameters as well.
        paths = self.solve(weights, fixed=held)
        return self.solve(weights, paths) if paths.success else outcome

    def start_of(self, chosen: Sequence[int], solution: Start) -> Start:
        """The part of a solution that belongs to some of the recordings, by index."""
        owners = np.repeat(np.arange(len(self.parts)), self.counts)
        segments = np.concatenate([np.flatnonzero(owners == index) for index in chosen])
        first = slice(0, self.size)
        m = self.parts[0].functions.num_equations

        def of_variables(values: Array) -> Array:
            rest = values[self.size :].reshape(-1, self.num_x)[segments]
            return np.concatenate([values[first], rest.ravel()])

        equations = solution.lam_g.reshape(-1, m)[segments].ravel()
        return StartValues(of_variables(solution.x), of_variables(solution.lam_x), equations)

    def mean_squares(self, z: Array) -> Array:
        """Mean squared error of each recording, (recordings,), in units of the deviation."""
        return np.asarray(2.0 * self._errors(z).full()[:, 0])


@lru_cache(maxsize=1)
def _change() -> Terms:
    """Squared logarithm of a relative value y; smooth at y = 0 as well."""
    y = ca.SX.sym("y")
    value = (ca.log((y**2 + _NEGLIGIBLE**2) / (1 + _NEGLIGIBLE**2)) / 2) ** 2
    return Terms(y, objective=value)
