"""Transcription: a problem on a grid as a nonlinear program.

Variables are the positions at the grid's nodes; velocities at the nodes follow from the
differentiation matrix. Path constraints hold at the nodes; energy and cost are integrated by
`Grid.quadrature`, more accurately than the nodes would allow (a high-order variational integrator:
Marsden and West, Acta Numerica 2001; Ober-Bloebaum, Junge, Marsden, ESAIM COCV 2011). Gradient and
Hessian of the Lagrangian are assembled from those at one point, which CasADi differentiates once:
with E and D from the nodes to values and slopes at the points,

    H = sum_k w_k [E_k; D_k]' (d^2 l / d(q, v)^2)_k [E_k; D_k].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.ocp.nlp.hessian import assemble, on_diagonal, on_ends, on_node, segment_matrices
from geodesic_ocp.ocp.nlp.node_functions import NodeFunctions
from geodesic_ocp.ocp.nlp.widths import Widths
from geodesic_ocp.trajectory.grid import Grid


@dataclass(frozen=True)
class Units:
    """Origin (n,) and unit of the NLP's coordinates, and its unit of energy.

    The NLP works on y = (q - origin) / length and energy / scale, so that Ipopt's tolerances have
    the same meaning for small and large motions, a child's arm and a crane. Velocities are formed
    from y, so that short paths lose no digits.
    """

    origin: Array
    length: float
    scale: float

    @property
    def parameters(self) -> Array:
        """The first of the NLP's parameters p, (n + 2,)."""
        return np.array([self.scale, self.length, *self.origin])

    def with_values(self, values: Array) -> Array:
        """The NLP's parameters p, (n + 2 + k,): these, and the problem's parameters."""
        return np.concatenate([self.parameters, values])

    def scaled(self, q: Array) -> Array:
        """Scaled positions for positions (k, n)."""
        return np.asarray((q - self.origin) / self.length)

    def positions(self, y: Array) -> Array:
        """Positions (k, n) for scaled ones."""
        return np.asarray(self.origin + self.length * y)


@dataclass(frozen=True, repr=False)
class Transcription:
    """The NLP in x = scaled positions at the nodes, one after the other, and p of `Units`.

    Attributes:
        grid: of the nodes.
        dim: number n of coordinates.
        size_p: number n + 2 + k of parameters.
        size_ends: number of constraints at the ends, the first of all.
        value: (x, p) -> f, which CasADi can differentiate.
        objective: (x, p) -> (f, gradient); f is the energy and the cost in the unit of energy.
        constraints: (x, p) -> g: at the ends; at one via point after the other, then the jumps of
            the velocity there; in q at one node after the other; in q and v at one node after the
            other of one segment after the other (`Conditions`, in its order).
        hessian: (x, p, lam_f, lam_g) -> upper triangle of the Lagrangian's Hessian.
    """

    grid: Grid
    dim: int
    size_p: int
    size_ends: int
    value: ca.Function
    objective: ca.Function
    constraints: ca.Function
    hessian: ca.Function

    def __repr__(self) -> str:
        variables, constraints = self.dim * self.grid.size, self.constraints.size1_out(0)
        return f"Transcription({self.grid!r}, {variables} variables, {constraints} constraints)"

    def energy(self, nodes: Array, values: Array | tuple[()] = ()) -> float:
        """Energy and cost of the path through nodes (size, n)."""
        units = Units(nodes[0], 1.0, 1.0)
        p = units.with_values(np.array(values))
        return float(self.value(units.scaled(nodes).ravel(), p))

    def full_hessian(self, x: Array, p: Array, lam_g: Array) -> Array:
        """Symmetric Hessian of the Lagrangian with lam_f = 1, as a matrix."""
        upper = evaluate(self.hessian, x, p, 1.0, lam_g)
        return np.asarray(np.triu(upper) + np.triu(upper, 1).T)

    def on(self, grid: Grid) -> Transcription:
        """With the segments' widths in a grid, in place of those at the end of p."""
        given = ca.MX.sym("p", self.size_p - grid.segments)
        values = ca.vertcat(given, grid.widths)
        bound = []
        for function in (self.value, self.objective, self.constraints, self.hessian):
            x, _, *more = function.mx_in()
            outputs = function.call([x, values, *more])
            names = function.name_in(), function.name_out()
            bound.append(ca.Function(function.name(), [x, given, *more], outputs, *names))
        return Transcription(grid, self.dim, given.shape[0], self.size_ends, *bound)

    @cached_property
    def momentum(self) -> ca.Function:
        """(x, p) -> p0 = -dE/dq0 (n,) at the first node, and its derivative (n, n) by the last.

        The inner nodes follow the ends so that dE/dq_inner stays zero: with the blocks of E's
        Hessian, dp0/dq1 = H_0i H_ii^-1 H_i1 - H_01.
        """
        n, last = self.dim, self.dim * (self.grid.size - 1)
        x, p = ca.MX.sym("x", n * self.grid.size), ca.MX.sym("p", self.size_p)
        scale, length = p[0], p[1]
        _, gradient = self.objective(x, p)
        upper = self.hessian(x, p, 1.0, ca.MX(self.constraints.size1_out(0), 1))
        hessian = ca.triu2symm(upper)
        inner = ca.solve(hessian[n:last, n:last], hessian[n:last, last:], "ldl")
        by_goal = ca.densify(hessian[:n, n:last] @ inner - hessian[:n, last:])
        outputs = [-gradient[:n] * scale / length, by_goal * scale / length**2]
        return ca.Function("momentum", [x, p], outputs)


def transcribe(functions: NodeFunctions, grid: Grid) -> Transcription:
    """The NLP of these functions on the grid."""
    if grid.ends is None:
        return _transcription(functions, grid, with_widths=False)
    return transcribe_shape(functions, grid).on(grid)


def transcribe_shape(functions: NodeFunctions, grid: Grid) -> Transcription:
    """The NLP on all grids that differ in the widths of their segments, the last entries of p."""
    return _transcription(functions, replace(grid, ends=None), with_widths=True)


def _transcription(functions: NodeFunctions, grid: Grid, with_widths: bool) -> Transcription:
    n, at_ends, at_nodes = functions.dim, functions.at_ends, functions.at_nodes
    at_via, in_segments = functions.at_via, functions.in_segments
    lagrangian = functions.lagrangian
    size_p = n + 2 + functions.num_parameters
    x = ca.MX.sym("x", n * grid.size)
    p = ca.MX.sym("p", size_p + with_widths * grid.segments)
    scale, length, origin, values = p[0], p[1], p[2 : n + 2], p[n + 2 : size_p]
    widths = Widths(grid, p[size_p:] if with_widths else None)
    scaled = ca.reshape(x, n, grid.size)
    positions = ca.repmat(origin, 1, grid.size) + length * scaled
    at_own_nodes = np.eye(grid.degree + 1), grid.differentiation
    select, differentiate = segment_matrices(grid, *at_own_nodes)
    slopes = widths.scale_rows(length * (scaled @ differentiate.T))
    states = ca.vertcat(positions @ select.T, slopes)
    ends = ca.vertcat(positions[:, 0], positions[:, -1], slopes[:, 0], slopes[:, -1])

    at_points = grid.quadrature.values, grid.quadrature.slopes
    interpolate, derive = segment_matrices(grid, *at_points)
    integrand = ca.vertcat(
        positions @ interpolate.T, widths.scale_rows(length * (scaled @ derive.T))
    )
    weights = widths.scale_weights(ca.DM(grid.quadrature.weights.ravel()).T)
    density, slope = lagrangian.first(integrand, values)
    f = ca.dot(weights, density) / scale
    value = ca.dot(weights, lagrangian.value(integrand, values)) / scale
    slope = slope * ca.repmat(weights, 2 * n, 1)
    by_slope = widths.scale_rows(slope[n:, :]) @ derive
    gradient = ca.vec(slope[:n, :] @ interpolate + by_slope) * (length / scale)
    g = ca.vertcat(
        at_ends.value(ends, values),
        *(
            function.value(positions[:, node], values)
            for function, node in zip(at_via, grid.via_nodes, strict=True)
        ),
        *(_jump(slopes, grid, at) for at in grid.via_segments if functions.num_continuous_via),
        ca.vec(at_nodes.value(positions, values)),
        ca.vec(in_segments.value(states, values)),
    )

    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.shape[0])
    of_via = np.cumsum([at_ends.size, *(function.size for function in at_via)]).tolist()
    first = of_via[-1] + n * functions.num_continuous_via
    second = first + at_nodes.size * grid.size
    lam_nodes = ca.reshape(lam_g[first:second], at_nodes.size, grid.size)
    lam_moving = ca.reshape(lam_g[second:], in_segments.size, grid.collocations)
    second_derivatives = lagrangian.second(integrand, values, weights * lam_f / scale)
    hessian = assemble(widths.scale_hessians(second_derivatives), grid, *at_points, n)
    if in_segments.size:
        second_derivatives = in_segments.second(states, values, lam_moving)
        hessian += assemble(widths.scale_hessians(second_derivatives), grid, *at_own_nodes, n)
    if at_nodes.size:
        hessian += on_diagonal(at_nodes.second(positions, values, lam_nodes), grid, n)
    if at_ends.size:
        second_derivatives = at_ends.second(ends, values, lam_g[: at_ends.size])
        hessian += on_ends(widths.scale_at_ends(second_derivatives), grid, n)
    for number, (function, node) in enumerate(zip(at_via, grid.via_nodes, strict=True)):
        factors = lam_g[of_via[number] : of_via[number + 1]]
        second_derivatives = function.second(positions[:, node], values, factors)
        hessian += on_node(second_derivatives, grid, n, node)

    return Transcription(
        grid,
        n,
        p.shape[0],
        at_ends.size,
        ca.Function("nlp_f", [x, p], [value], ["x", "p"], ["f"]),
        ca.Function("nlp_grad_f", [x, p], [f, gradient], ["x", "p"], ["f", "grad_f_x"]),
        ca.Function("nlp_g", [x, p], [g], ["x", "p"], ["g"]),
        ca.Function(
            "nlp_hess_l",
            [x, p, lam_f, lam_g],
            [ca.triu(hessian) * length**2],
            ["x", "p", "lam_f", "lam_g"],
            ["triu_hess_gamma_x_x"],
        ),
    )


def _jump(slopes: ca.MX, grid: Grid, segment: int) -> ca.MX:
    """Jump of the velocity at the end of a segment, (n, 1)."""
    after = segment * (grid.degree + 1)
    return slopes[:, after] - slopes[:, after - 1]
