"""The nonlinear program of a fit: the paths of all segments and the parameters together.

The parameters come first in the order of the variables, and then the segments, num_x variables and
m equations each. Segments share the parameters only.

Variables: the parameters relative to their initial values; of every segment, the values of its path
at the nodes and the rates of progress at its ends. Objective: the weighted mean of the squared
errors. Constraints: every path is a geodesic of the metric with these parameters. This is inverse
optimal control in one level (the stationarity conditions of the inner problem are constraints;
Hatz, Schloeder, Bock, "Estimating parameters in optimal control problems", SIAM J. Sci. Comput. 34,
2012). First and second derivatives are exact, and assembled from those of single nodes and samples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Protocol

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.fitting.recording_part import MAX_END_RATE, RecordingPart
from geodesic_ocp.ipopt import Ipopt, Outcome


def triangle(size: int) -> np.ndarray:
    """Rows and columns (2, size (size + 1) / 2) of an upper triangle, columns first."""
    return np.array([(i, j) for j in range(size) for i in range(j + 1)]).reshape(-1, 2).T


def place_jacobian(blocks: ca.MX, units: Array, m: int, num_x: int) -> ca.MX:
    """The derivative of the equations of all segments.

    Args:
        blocks: of a segment's equations by the p parameters and its nodes, columns first, one
            column a segment (m (p + nodes), segments).
        units: of the parameters (p,).
        m, num_x: numbers of equations and variables of a segment.
    """
    p, total = units.size, blocks.shape[1]
    nodes = blocks.shape[0] // m - p
    by_theta = [ca.vec(blocks[k * m : (k + 1) * m, :]) * float(units[k]) for k in range(p)]
    entries = ca.vertcat(*by_theta, ca.vec(blocks[p * m :, :]))
    segment = np.arange(total)[:, None, None]
    shape, within = (total, nodes, m), np.arange(nodes)[None, :, None]
    rows = np.broadcast_to(segment * m + np.arange(m), shape).ravel()
    columns = np.broadcast_to(p + segment * num_x + within, shape).ravel()
    return _sparse(
        (m * total, p + num_x * total),
        np.concatenate([np.tile(np.arange(m * total), p), rows]),
        np.concatenate([np.repeat(np.arange(p), m * total), columns]),
        entries,
    )


def place_hessian(
    triangles: Sequence[tuple[ca.MX, ca.MX]], units: Array, num_x: int, diagonal: ca.MX
) -> ca.MX:
    """Upper triangle of the Hessian of the Lagrangian.

    Args:
        triangles: of each recording, upper triangles of the Hessians of the errors by a segment's
            variables, and of the equations by the p parameters and the nodes, one column a segment.
        units: of the parameters (p,).
        num_x: number of variables of a segment.
        diagonal: added to the diagonal of the parameters (p, 1).
    """
    p = units.size
    size = p + num_x
    row, column = triangle(num_x)
    place = ca.DM.triplet(
        ((column + p) * (column + p + 1) // 2 + row + p).tolist(),
        list(range(row.size)),
        np.ones(row.size),
        size * (size + 1) // 2,
        row.size,
    )
    scales = np.concatenate([units, np.ones(num_x)])
    row, column = triangle(size)
    scale = ca.DM(scales[row] * scales[column])
    combined = []
    for of_errors, of_equations in triangles:
        more = ca.MX.zeros(row.size - of_equations.shape[0], of_errors.shape[1])
        whole = place @ of_errors + ca.vertcat(of_equations, more)
        combined.append(whole * ca.repmat(scale, 1, whole.shape[1]))
    every = ca.horzcat(*combined)
    first = triangle(p)
    corner, total = first.shape[1], every.shape[1]
    on_diagonal = ca.DM((first[1] == np.arange(p)[:, None]) * (first[0] == first[1]) * 1.0)
    of_parameters = ca.sum2(every[:corner, :]) + on_diagonal.T @ diagonal
    row, column = row[corner:], column[corner:]
    shift = num_x * np.arange(total)[:, None]
    return _sparse(
        (p + num_x * total,) * 2,
        np.concatenate([first[0], np.where(row < p, row, row + shift).ravel()]),
        np.concatenate([first[1], (column + shift).ravel()]),
        ca.vertcat(of_parameters, ca.vec(every[corner:, :])),
    )


def _sparse(shape: tuple[int, int], rows: np.ndarray, columns: np.ndarray, entries: ca.MX) -> ca.MX:
    """The matrix with these entries."""
    order = np.lexsort((rows, columns))  # CasADi's order, columns first
    pattern = ca.Sparsity.triplet(*shape, rows[order].tolist(), columns[order].tolist())
    assert pattern.nnz() == rows.size
    if np.array_equal(order, np.arange(rows.size)):
        return ca.MX(pattern, entries)
    return ca.MX(pattern, entries[order.tolist()])


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


@dataclass(frozen=True, eq=False)
class MetricProgram:
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

    def __repr__(self) -> str:
        return (
            f"MetricProgram({self.size} parameters, {len(self.parts)} recordings, "
            f"{sum(self.counts)} segments)"
        )

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
    def _symbols(self) -> tuple[ca.MX, ca.MX, ca.MX]:
        """Variables, weights of the recordings, and theta."""
        z = ca.MX.sym("z", self.size + self.num_x * sum(self.counts))
        weights = ca.MX.sym("weights", len(self.parts))
        return z, weights, z[: self.size] * ca.DM(self.start)

    def _split(self, z: ca.MX) -> list[ca.MX]:
        """The variables of the segments of each recording, (num_x, count)."""
        edges = self.size + self.num_x * np.cumsum([0, *self.counts])
        return [
            ca.reshape(z[int(a) : int(b)], self.num_x, count)
            for a, b, count in zip(edges[:-1], edges[1:], self.counts, strict=True)
        ]

    @cached_property
    def functions(self) -> dict[str, ca.Function]:
        """The program and its exact derivatives, as nlpsol takes them."""
        z, weights, theta = self._symbols
        split = self._split(z)
        pairs = list(zip(self.parts, split, strict=True))
        errors = [ca.sum2(part.errors(x)) for part, x in pairs]
        change, slope, curvature = _change().map(self.size)(z[: self.size].T)
        f = ca.dot(weights, ca.vertcat(*errors)) + _REGULARIZATION * ca.sum2(change)
        g = ca.vertcat(*(ca.vec(part.equations(x, theta)) for part, x in pairs))
        gradients = [
            weights[k] * ca.vec(part.error_gradients(x)) for k, (part, x) in enumerate(pairs)
        ]
        gradient = ca.densify(ca.vertcat(_REGULARIZATION * slope.T, *gradients))
        blocks = ca.horzcat(*(part.equation_jacobians(x, theta) for part, x in pairs))
        equations = self.parts[0].functions.num_equations
        jacobian = place_jacobian(blocks, self.start, equations, self.num_x)

        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.shape[0])
        edges = equations * np.cumsum([0, *self.counts])
        triangles = []
        for k, (part, x) in enumerate(pairs):
            factors = ca.reshape(lam_g[int(edges[k]) : int(edges[k + 1])], equations, part.count)
            of_errors = lam_f * weights[k] * part.error_hessians(x)
            triangles.append((of_errors, part.equation_hessians(x, theta, factors)))
        diagonal = lam_f * _REGULARIZATION * curvature.T
        hessian = place_hessian(triangles, self.start, self.num_x, diagonal)
        names = ["x", "p"]
        return {
            "nlp": ca.Function("nlp", [z, weights], [f, g], names, ["f", "g"]),
            "grad_f": ca.Function(
                "nlp_grad_f", [z, weights], [f, gradient], names, ["f", "grad_f_x"]
            ),
            "jac_g": ca.Function("nlp_jac_g", [z, weights], [g, jacobian], names, ["g", "jac_g_x"]),
            "hess_lag": ca.Function(
                "nlp_hess_l",
                [z, weights, lam_f, lam_g],
                [hessian],
                [*names, "lam_f", "lam_g"],
                ["triu_hess_gamma_x_x"],
            ),
            "errors": ca.Function("errors", [z], [ca.vertcat(*errors)]),
            "corners": ca.Function("corners", [z, lam_g], [self._corners(triangles)]),
        }

    def _corners(self, triangles: Sequence[tuple[ca.MX, ca.MX]]) -> ca.MX:
        """Upper triangles of the Hessians of factors' equations by theta, one column a recording.

        In units of the initial values.
        """
        row, column = triangle(self.size)
        scale = ca.DM(self.start[row] * self.start[column])
        return ca.horzcat(*(ca.sum2(each[: row.size, :]) * scale for _, each in triangles))

    def _solver(self, options: Mapping[str, Any]) -> Ipopt:
        derivatives = {name: self.functions[name] for name in ("grad_f", "jac_g", "hess_lag")}
        return Ipopt(self.functions["nlp"], derivatives, options)

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
        return np.asarray(2.0 * self.functions["errors"](z).full()[:, 0])


@lru_cache(maxsize=1)
def _change() -> ca.Function:
    """Squared logarithm of a relative value y, and two derivatives; smooth at y = 0 as well."""
    y = ca.SX.sym("y")
    value = (ca.log((y**2 + _NEGLIGIBLE**2) / (1 + _NEGLIGIBLE**2)) / 2) ** 2
    second, first = ca.hessian(value, y)
    return ca.Function("change", [y], [value, first, second])
