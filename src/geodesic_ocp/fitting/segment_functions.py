"""Functions of one segment from which the nonlinear program of a fit is built.

A path is a polynomial through its values at Gauss-Lobatto nodes. It is a geodesic where the
Euler-Lagrange equation of its energy holds at the inner nodes (orthogonal collocation),

    d/ds (dT/dv) - dT/dq = 0,  T = v' G(q) v / 2.

The progress along it over time is a cubic of the fraction u of the duration, 0 to 1, whose rates at
the ends are estimated: between 0 and 3 each, it never moves backwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, cast, get_args

import casadi as ca
import numpy as np
from numpy.polynomial import legendre

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.grid import Grid

Measure = Literal["joint", "position"]


def as_measure(measure: str) -> Measure:
    """The argument, if it is one of the measures; ValueError otherwise."""
    if measure not in get_args(Measure):
        raise ValueError(f"measure must be one of {', '.join(get_args(Measure))}, got {measure!r}")
    return cast(Measure, measure)


@dataclass(frozen=True, eq=False)
class SegmentFunctions:
    """Residuals, geodesic equations and their derivatives for one segment.

    Attributes:
        metric: with the symbols `theta` as parameters.
        theta: (p, 1).
        model: whose hand is compared where the measure is "position".
        measure: what is compared with the observation.
        grid: of the nodes.
    """

    metric: Metric
    theta: ca.SX
    model: Model
    measure: Measure
    grid: Grid

    def __repr__(self) -> str:
        return f"SegmentFunctions({type(self.metric).__name__}, {self.measure}, {self.grid})"

    @property
    def dim(self) -> int:
        """Number n of joints."""
        return self.metric.dim

    @property
    def num_nodes(self) -> int:
        """Number of values of a path, n (degree + 1)."""
        return self.dim * self.grid.size

    @property
    def num_equations(self) -> int:
        """Number of equations of a path, n (degree - 1)."""
        return self.dim * (self.grid.size - 2)

    @cached_property
    def _at_nodes(self) -> tuple[Array, Array, Array]:
        """Matrices (inner nodes, nodes) of the values and first two derivatives by s."""
        slopes = self.grid.differentiation[0]
        return np.eye(self.grid.size)[1:-1], slopes[1:-1], (slopes @ slopes)[1:-1]

    # -- the geodesic equation at one node -----------------------------------------------------

    @cached_property
    def _equation(self) -> tuple[ca.SX, ca.SX]:
        """Symbols (q, v, a) (3 n, 1) and the Euler-Lagrange equation's left side (n, 1)."""
        q, v, a = (ca.SX.sym(name, self.dim) for name in "qva")
        energy = self.metric._energy(q, v)
        momentum = ca.gradient(energy, v)
        force = ca.jtimes(momentum, v, a) + ca.jtimes(momentum, q, v) - ca.gradient(energy, q)
        return ca.vertcat(q, v, a), ca.cse(ca.densify(force))

    @cached_property
    def node_equation(self) -> ca.Function:
        """(q, v, a), theta, scales (n,) -> the equation's left side over the scales (n,)."""
        state, force = self._equation
        scales = ca.SX.sym("scales", self.dim)
        return ca.Function("equation", [state, self.theta, scales], [force / scales])

    @cached_property
    def node_jacobian(self) -> ca.Function:
        """As `node_equation`, the derivatives by (q, v, a) and theta, columns first."""
        state, force = self._equation
        scales = ca.SX.sym("scales", self.dim)
        by = ca.jacobian(force / scales, ca.vertcat(state, self.theta))
        arguments = [state, self.theta, scales]
        return ca.Function("equation_jacobian", arguments, [ca.vec(ca.densify(ca.cse(by)))])

    @cached_property
    def node_hessian(self) -> ca.Function:
        """(q, v, a), theta, scales, factors (n,) -> Hessian of factors' equation, columns first."""
        state, force = self._equation
        scales, factors = ca.SX.sym("scales", self.dim), ca.SX.sym("factors", self.dim)
        both = ca.vertcat(state, self.theta)
        hessian = ca.hessian(ca.dot(factors, force / scales), both)[0]
        arguments = [state, self.theta, scales, factors]
        return ca.Function("equation_hessian", arguments, [ca.vec(ca.densify(ca.cse(hessian)))])

    # -- the residual at one sample ------------------------------------------------------------

    @cached_property
    def _residual(self) -> tuple[list[ca.SX], ca.SX, ca.SX]:
        """Arguments (unknowns x, fraction u, observation), the unknowns, half the squared error.

        The observation is a configuration, or the hand's position.
        """
        n = self.dim
        x, u = ca.SX.sym("x", self.num_nodes + 2), ca.SX.sym("u")
        start, end = x[self.num_nodes], x[self.num_nodes + 1]
        progress = start * u + (3 - 2 * start - end) * u**2 + (start + end - 2) * u**3
        q = ca.reshape(x[: self.num_nodes], n, self.grid.size) @ self._interpolation(progress)
        predicted = q if self.measure == "joint" else self.model.hand_pose(q)[1]
        observed = ca.SX.sym("y", predicted.shape[0])
        return [x, u, observed], x, ca.sumsqr(predicted - observed) / 2

    def _interpolation(self, s: ca.SX) -> ca.SX:
        """Values (nodes, 1) at s of the Lagrange polynomials of the nodes."""
        degree, z = self.grid.degree, 2 * s - 1
        inverse = np.linalg.inv(legendre.legvander(2.0 * self.grid.nodes - 1.0, degree))
        values = [ca.SX(1), z]
        for k in range(1, degree):  # the recurrence of Legendre's polynomials
            values.append(((2 * k + 1) * z * values[k] - k * values[k - 1]) / (k + 1))
        return ca.SX(inverse.T) @ ca.vertcat(*values)

    @cached_property
    def sample_error(self) -> ca.Function:
        """x, u, observation -> half the squared error."""
        arguments, _, error = self._residual
        return ca.Function("error", arguments, [error])

    @cached_property
    def sample_gradient(self) -> ca.Function:
        """x, u, observation -> its gradient by x."""
        arguments, x, error = self._residual
        return ca.Function("error_gradient", arguments, [ca.densify(ca.gradient(error, x))])

    @cached_property
    def sample_hessian(self) -> ca.Function:
        """x, u, observation -> upper triangle of its Hessian by x, columns first."""
        arguments, x, error = self._residual
        hessian = ca.densify(ca.cse(ca.hessian(error, x)[0]))
        upper = ca.densify(ca.triu(hessian))
        size = x.shape[0]
        entries = [row + column * size for column in range(size) for row in range(column + 1)]
        return ca.Function("error_hessian", arguments, [ca.vec(upper)[entries]])

    # -- whole segments ------------------------------------------------------------------------

    def states(self, nodes: ca.MX) -> ca.MX:
        """(q, v, a) (3 n, segments * inner nodes) of paths (n, segments * nodes)."""
        inner, size = self.grid.size - 2, self.grid.size
        count = nodes.shape[1] // size
        parts = []
        for matrix in self._at_nodes:
            every = ca.diagcat(*[ca.sparsify(ca.DM(matrix.T))] * count)
            parts.append(nodes @ every)
        assert parts[0].shape == (self.dim, count * inner)
        return ca.vertcat(*parts)

    @cached_property
    def assemble_jacobian(self) -> ca.Function:
        """Vec of `node_jacobian` at all inner nodes -> derivative of all equations by x and theta.

        (n (3 n + p), inner nodes) -> (equations * (p + num_nodes)), columns first, theta before x.
        """
        n, p, inner = self.dim, int(self.theta.shape[0]), self.grid.size - 2
        blocks = ca.MX.sym("blocks", n * (3 * n + p), inner)
        rows: list[ca.MX] = []
        for j in range(inner):
            block = ca.reshape(blocks[:, j], n, 3 * n + p)
            by_nodes = sum(
                ca.kron(ca.DM(matrix[j : j + 1]), block[:, k * n : (k + 1) * n])
                for k, matrix in enumerate(self._at_nodes)
            )
            rows.append(ca.horzcat(block[:, 3 * n :], by_nodes))
        return ca.Function("jacobian", [blocks], [ca.vec(ca.densify(ca.vertcat(*rows)))])

    @cached_property
    def assemble_hessian(self) -> ca.Function:
        """Vec of `node_hessian` at all inner nodes -> Hessian by theta and x.

        ((3 n + p)^2, inner nodes) -> upper triangle, columns first, of the Hessian by theta and the
        nodes of the path.
        """
        n, p, inner = self.dim, int(self.theta.shape[0]), self.grid.size - 2
        blocks = ca.MX.sym("blocks", (3 * n + p) ** 2, inner)
        total = ca.MX(p + self.num_nodes, p + self.num_nodes)
        for j in range(inner):
            block = ca.reshape(blocks[:, j], 3 * n + p, 3 * n + p)
            spread = ca.vertcat(
                *(ca.kron(ca.DM(matrix[j : j + 1]), ca.DM.eye(n)) for matrix in self._at_nodes)
            )
            spread = ca.sparsify(ca.diagcat(spread, ca.DM.eye(p)))
            total += spread.T @ block @ spread
        # theta last until here
        order = [*range(self.num_nodes, self.num_nodes + p), *range(self.num_nodes)]
        total = ca.densify(total)[order, order]
        size = p + self.num_nodes
        entries = [row + column * size for column in range(size) for row in range(column + 1)]
        return ca.Function("hessian", [blocks], [ca.vec(total)[entries]])
