"""The nonlinear program of a fit: the paths of all segments and the parameters together.

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
from functools import cached_property
from typing import Any, Protocol

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.fitting.program.observed_segments import ObservedSegments
from geodesic_ocp.fitting.program.segment_functions import SegmentFunctions
from geodesic_ocp.ipopt import Ipopt, Outcome

_MAX_END_RATE = 3.0
# Weight of the squared relative change of the parameters: negligible wherever the data determine
# them, it keeps combinations that the data do not determine near their initial values.
_REGULARIZATION = 1e-5
_IPOPT = {"tol": 1e-7, "max_iter": 200, "acceptable_iter": 0}
_WARM = {
    "warm_start_init_point": "yes",
    "mu_init": 1e-6,
    "warm_start_bound_push": 1e-8,
    "warm_start_mult_bound_push": 1e-8,
    "warm_start_slack_bound_push": 1e-8,
}


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


@dataclass(frozen=True, eq=False)
class RecordingPart:
    """One recording's contribution: its data and the functions of its model.

    Attributes:
        functions: of one segment.
        observed: the data.
        deviation: standard deviation of the error that serves as unit [rad or m].
    """

    functions: SegmentFunctions
    observed: ObservedSegments
    deviation: float

    def __repr__(self) -> str:
        return f"RecordingPart({self.observed.recording.name!r}, {self.count} segments)"

    @cached_property
    def count(self) -> int:
        """Number of segments."""
        return len(self.observed.segments)

    @cached_property
    def _data(self) -> Array:
        """Observations (m, k) of the samples."""
        if self.functions.measure == "joint":
            return self.observed.samples.T
        return np.asarray(self.functions.model.hand_pose(self.observed.samples)[1].T)

    @cached_property
    def _owner_matrix(self) -> ca.DM:
        """(k, count), sums over the samples of each segment, as means of the recording."""
        k = self.observed.owners.size
        matrix = np.zeros((k, self.count))
        matrix[np.arange(k), self.observed.owners] = 1.0 / (k * self.deviation**2)
        return ca.sparsify(ca.DM(matrix))

    def _samples(self, x: ca.MX) -> list[ca.MX | ca.DM]:
        repeated = x[:, self.observed.owners.tolist()]
        return [repeated, ca.DM(self.observed.fractions[None]), ca.DM(self._data)]

    def errors(self, x: ca.MX) -> ca.MX:
        """Half the mean squared error of each segment's samples, relative, (1, count)."""
        function = self.functions.sample_error.map(self.observed.owners.size)
        return function(*self._samples(x)) @ self._owner_matrix

    def error_gradients(self, x: ca.MX) -> ca.MX:
        """Their gradients by x (num_x, count)."""
        function = self.functions.sample_gradient.map(self.observed.owners.size)
        return function(*self._samples(x)) @ self._owner_matrix

    def error_hessians(self, x: ca.MX) -> ca.MX:
        """Upper triangles of their Hessians by x, (num_x (num_x + 1) / 2, count)."""
        function = self.functions.sample_hessian.map(self.observed.owners.size)
        return function(*self._samples(x)) @ self._owner_matrix

    def _at_nodes(self, x: ca.MX, theta: ca.MX) -> list[ca.MX | ca.DM]:
        f = self.functions
        nodes = ca.reshape(x[: f.num_nodes, :], f.dim, f.grid.size * self.count)
        inner = f.grid.size - 2
        scales = np.repeat(self.observed.scales.T, inner, axis=1)
        return [f.states(nodes), ca.repmat(theta, 1, inner * self.count), ca.DM(scales)]

    def equations(self, x: ca.MX, theta: ca.MX) -> ca.MX:
        """Left sides of the geodesic equations (equations, count)."""
        f = self.functions
        every = f.node_equation.map(self.count * (f.grid.size - 2))(*self._at_nodes(x, theta))
        return ca.reshape(every, f.num_equations, self.count)

    def equation_jacobians(self, x: ca.MX, theta: ca.MX) -> ca.MX:
        """Their derivatives by theta and nodes, columns first, (.., count)."""
        f = self.functions
        every = f.node_jacobian.map(self.count * (f.grid.size - 2))(*self._at_nodes(x, theta))
        return f.assemble_jacobian.map(self.count)(every)

    def equation_hessians(self, x: ca.MX, theta: ca.MX, factors: ca.MX) -> ca.MX:
        """Upper triangles of the Hessians of factors' equations by theta and nodes, (.., count)."""
        f = self.functions
        inner = f.grid.size - 2
        per_node = ca.reshape(factors, f.dim, inner * self.count)
        arguments = [*self._at_nodes(x, theta), per_node]
        every = f.node_hessian.map(self.count * inner)(*arguments)
        return f.assemble_hessian.map(self.count)(every)


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
        change = z[: self.size] - 1.0
        f = ca.dot(weights, ca.vertcat(*errors)) + _REGULARIZATION / 2 * ca.sumsqr(change)
        g = ca.vertcat(*(ca.vec(part.equations(x, theta)) for part, x in pairs))
        gradients = [
            weights[k] * ca.vec(part.error_gradients(x)) for k, (part, x) in enumerate(pairs)
        ]
        gradient = ca.densify(ca.vertcat(_REGULARIZATION * change, *gradients))
        jacobian = self._jacobian([part.equation_jacobians(x, theta) for part, x in pairs])

        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.shape[0])
        equations = self.parts[0].functions.num_equations
        edges = equations * np.cumsum([0, *self.counts])
        triangles = []
        for k, (part, x) in enumerate(pairs):
            factors = ca.reshape(lam_g[int(edges[k]) : int(edges[k + 1])], equations, part.count)
            of_errors = lam_f * weights[k] * part.error_hessians(x)
            triangles.append((of_errors, part.equation_hessians(x, theta, factors)))
        hessian = self._hessian(triangles, lam_f)
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
        p = self.size
        row, column = np.array([(i, j) for j in range(p) for i in range(j + 1)]).T
        scale = ca.DM(self.start[row] * self.start[column])
        return ca.horzcat(*(ca.sum2(each[: row.size, :]) * scale for _, each in triangles))

    def _jacobian(self, blocks: Sequence[ca.MX]) -> ca.MX:
        """The derivative of all equations, from the segments' blocks by theta and nodes."""
        functions, p = self.parts[0].functions, self.size
        m, nodes, total = functions.num_equations, functions.num_nodes, sum(self.counts)
        every = ca.horzcat(*blocks)  # (m (p + nodes), total)
        by_theta = [ca.vec(every[k * m : (k + 1) * m, :]) * float(self.start[k]) for k in range(p)]
        entries = ca.vertcat(*by_theta, ca.vec(every[p * m :, :]))
        rows = [np.tile(np.arange(m * total), p)]
        columns = [np.repeat(np.arange(p), m * total)]
        segment = np.arange(total)[:, None, None]
        shape = (total, nodes, m)
        rows.append(np.broadcast_to(segment * m + np.arange(m), shape).ravel())
        within = np.arange(nodes)[None, :, None]
        columns.append(np.broadcast_to(p + segment * self.num_x + within, shape).ravel())
        return _sparse(
            (m * total, p + self.num_x * total),
            np.concatenate(rows),
            np.concatenate(columns),
            entries,
        )

    def _hessian(self, triangles: Sequence[tuple[ca.MX, ca.MX]], lam_f: ca.MX) -> ca.MX:
        """Upper triangle of the Lagrangian's Hessian from those of the segments.

        Of each recording: Hessians of the errors by x, and of the equations by theta and nodes.
        """
        p, num_x, total = self.size, self.num_x, sum(self.counts)
        size = p + num_x
        row, column = np.array([(i, j) for j in range(num_x) for i in range(j + 1)]).T
        place = ca.DM.triplet(
            ((column + p) * (column + p + 1) // 2 + row + p).tolist(),
            list(range(row.size)),
            np.ones(row.size),
            size * (size + 1) // 2,
            row.size,
        )
        units = np.concatenate([self.start, np.ones(num_x)])
        row, column = np.array([(i, j) for j in range(size) for i in range(j + 1)]).T
        scale = ca.DM(units[row] * units[column])
        combined = []
        for of_errors, of_equations in triangles:
            more = ca.MX.zeros(size * (size + 1) // 2 - of_equations.shape[0], of_errors.shape[1])
            whole = place @ of_errors + ca.vertcat(of_equations, more)
            combined.append(whole * ca.repmat(scale, 1, whole.shape[1]))
        every = ca.horzcat(*combined)
        corner = p * (p + 1) // 2
        diagonal = ca.DM([float(i == j) for j in range(p) for i in range(j + 1)])
        own = ca.sum2(every[:corner, :]) + lam_f * _REGULARIZATION * diagonal
        entries = ca.vertcat(own, ca.vec(every[corner:, :]))
        first = np.array([(i, j) for j in range(p) for i in range(j + 1)]).reshape(-1, 2)
        row, column = row[corner:], column[corner:]
        shift = num_x * np.arange(total)[:, None]
        rows = np.where(row < p, row, row + shift).ravel()
        columns = (column + shift).ravel()
        return _sparse(
            (p + num_x * total,) * 2,
            np.concatenate([first[:, 0], rows]),
            np.concatenate([first[:, 1], columns]),
            entries,
        )

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
        lower[:, nodes:], upper[:, nodes:] = 0.0, _MAX_END_RATE
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
        return self._cold_solver(**arguments)

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


def _sparse(shape: tuple[int, int], rows: np.ndarray, columns: np.ndarray, entries: ca.MX) -> ca.MX:
    """The matrix with these entries."""
    order = np.lexsort((rows, columns))  # CasADi's order, columns first
    pattern = ca.Sparsity.triplet(*shape, rows[order].tolist(), columns[order].tolist())
    assert pattern.nnz() == rows.size
    if np.array_equal(order, np.arange(rows.size)):
        return ca.MX(pattern, entries)
    return ca.MX(pattern, entries[order.tolist()])
