"""Transcription: a problem on a grid as a nonlinear program.

Variables are the positions at the grid's nodes; velocities at the nodes follow from the
differentiation matrix, the energy from Gauss-Lobatto quadrature on the same nodes (a high-order
variational integrator: Marsden and West, Acta Numerica 2001; Ober-Bloebaum, Junge, Marsden, ESAIM
COCV 2011). Gradient and Hessian of the Lagrangian are assembled from those of one node, which
CasADi differentiates once: with E the selection of a segment's nodes and D its differentiation,

    H = sum_k w_k [E_k; D_k]' (d^2 l / d(q, v)^2)_k [E_k; D_k].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.ocp.nlp.conditions import Conditions, Term, stacked
from geodesic_ocp.ocp.nlp.hessian import assemble, on_diagonal, on_ends, on_node, segment_matrices
from geodesic_ocp.trajectory.grid import Grid


@dataclass(frozen=True)
class Units:
    """Origin (n,) and unit of the NLP's coordinates, and its unit of energy.

    The NLP sees y = (q - origin) / length and the energy / scale, so that Ipopt's tolerances mean
    the same for a twitch and a swing, a child's arm and a crane, and velocities, formed from y,
    keep their digits where the path is short.
    """

    origin: Array
    length: float
    scale: float

    @property
    def parameters(self) -> Array:
        """The first of the NLP's parameters p, (n + 2,)."""
        return np.array([self.scale, self.length, *self.origin])

    def with_values(self, values: Array) -> Array:
        """The NLP's parameters p, (n + 2 + k,): these, and the values of the problem's own."""
        return np.concatenate([self.parameters, values])

    def scaled(self, q: Array) -> Array:
        """Scaled positions for positions (k, n)."""
        return np.asarray((q - self.origin) / self.length)

    def positions(self, y: Array) -> Array:
        """Positions (k, n) for scaled ones."""
        return np.asarray(self.origin + self.length * y)


@dataclass(frozen=True)
class Transcription:
    """The NLP in x = scaled positions at the nodes, one after the other, and p of `Units`.

    Attributes:
        grid: of the nodes.
        dim: number n of coordinates.
        size_p: number n + 2 + k of parameters.
        size_ends: number of constraints at the ends, the first of all.
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
    objective: ca.Function
    constraints: ca.Function
    hessian: ca.Function

    def energy(self, nodes: Array, values: Array | tuple[()] = ()) -> float:
        """Energy and cost of the path through nodes (size, n)."""
        units = Units(nodes[0], 1.0, 1.0)
        p = units.with_values(np.array(values))
        return float(self.objective(units.scaled(nodes).ravel(), p)[0])

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


@dataclass(frozen=True, eq=False)
class Blocks:
    """Functions of single nodes, of which the NLP on any grid is made, with their derivatives.

    Attributes:
        dim: n of the metric.
        own: number of the problem's parameters.
        joins: number of via points at which the velocity is continuous.
        at_ends, at_nodes, at_via, in_segments: the conditions.
        lagrangian: energy and cost, with the conditions in q and v.
    """

    dim: int
    own: int
    joins: int
    at_ends: _Block
    at_nodes: _Block
    at_via: tuple[_Block, ...]
    in_segments: _Block
    lagrangian: _Block

    @classmethod
    def of(cls, metric: Metric, terms: Conditions) -> Blocks:
        """Of least energy in the metric under these conditions."""
        own, q, state = terms.p, terms.q, ca.vertcat(terms.q, terms.v)
        ends = ca.vertcat(terms.q0, terms.q1, terms.v0, terms.v1)
        density = metric.inner(q, terms.v, terms.v) / 2 + terms.cost
        return cls(
            dim=metric.dim,
            own=own.shape[0],
            joins=len(terms.smooth),
            at_ends=_Block("ends", ends, own, terms.ends),
            at_nodes=_Block("node", q, own, terms.still),
            at_via=tuple(_Block("via", q, own, station) for station in terms.via),
            in_segments=_Block("moving", state, own, terms.moving),
            lagrangian=_Block("energy", state, own, terms.moving, density),
        )


def transcribe(blocks: Blocks, grid: Grid) -> Transcription:
    """The NLP of these functions on the grid."""
    n, at_ends, at_nodes, at_via = blocks.dim, blocks.at_ends, blocks.at_nodes, blocks.at_via
    in_segments, lagrangian = blocks.in_segments, blocks.lagrangian
    x, p = ca.MX.sym("x", n * grid.size), ca.MX.sym("p", n + 2 + blocks.own)
    scale, length, origin, values = p[0], p[1], p[2 : n + 2], p[n + 2 :]
    scaled = ca.reshape(x, n, grid.size)
    positions = ca.repmat(origin, 1, grid.size) + length * scaled
    select, differentiate = segment_matrices(grid)
    slopes = length * (scaled @ differentiate.T)
    states = ca.vertcat(positions @ select.T, slopes)
    ends = ca.vertcat(positions[:, 0], positions[:, -1], slopes[:, 0], slopes[:, -1])
    weights = ca.DM(grid.weights.ravel()).T

    density, slope = lagrangian.first(states, values)
    f = ca.dot(weights, density) / scale
    slope = slope * ca.repmat(weights, 2 * n, 1)
    gradient = ca.vec(slope[:n, :] @ select + slope[n:, :] @ differentiate) * (length / scale)
    g = ca.vertcat(
        at_ends.value(ends, values),
        *(
            block.value(positions[:, node], values)
            for block, node in zip(at_via, grid.via_nodes, strict=True)
        ),
        *(_jump(slopes, grid, station) for station in grid.via_segments if blocks.joins),
        ca.vec(at_nodes.value(positions, values)),
        ca.vec(in_segments.value(states, values)),
    )

    lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", g.shape[0])
    of_via = np.cumsum([at_ends.size, *(block.size for block in at_via)]).tolist()
    first = of_via[-1] + n * blocks.joins
    second = first + at_nodes.size * grid.size
    lam_nodes = ca.reshape(lam_g[first:second], at_nodes.size, grid.size)
    lam_moving = ca.reshape(lam_g[second:], in_segments.size, grid.collocations)
    factors = ca.vertcat(weights * lam_f / scale, lam_moving)
    hessian = assemble(lagrangian.second(states, values, factors), grid, n)
    if at_nodes.size:
        hessian += on_diagonal(at_nodes.second(positions, values, lam_nodes), grid, n)
    if at_ends.size:
        hessian += on_ends(at_ends.second(ends, values, lam_g[: at_ends.size]), grid, n)
    for number, (block, node) in enumerate(zip(at_via, grid.via_nodes, strict=True)):
        factors = lam_g[of_via[number] : of_via[number + 1]]
        second_derivatives = block.second(positions[:, node], values, factors)
        hessian += on_node(second_derivatives, grid, n, node)

    return Transcription(
        grid,
        n,
        p.shape[0],
        at_ends.size,
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


def _jump(slopes: ca.MX, grid: Grid, station: int) -> ca.MX:
    """By how much the velocity after a segment's end differs from that before, (n, 1)."""
    after = station * (grid.degree + 1)
    return slopes[:, after] - slopes[:, after - 1]


class _Block:
    """Functions of one node's (or both ends') symbols, evaluated at many columns at once.

    Args:
        name: of the functions.
        symbols: (m, 1), different in every column.
        own: the problem's parameters (k, 1), the same in all.
        terms: whose expressions are the functions.
        density: a function before those.
    """

    def __init__(
        self,
        name: str,
        symbols: ca.SX,
        own: ca.SX,
        terms: Sequence[Term],
        density: ca.SX | None = None,
    ) -> None:
        outputs = stacked(terms) if density is None else ca.vertcat(density, stacked(terms))
        self._name, self._symbols, self._own = name, symbols, own
        self._outputs = ca.densify(outputs)
        self.size = int(outputs.shape[0])

    @cached_property
    def _value(self) -> ca.Function:
        return self._function("", [self._outputs])

    @cached_property
    def _first(self) -> ca.Function:
        gradient = ca.densify(ca.cse(ca.gradient(self._outputs[0], self._symbols)))
        return self._function("_gradient", [self._outputs[0], gradient])

    @cached_property
    def _second(self) -> ca.Function:
        weights = ca.SX.sym("factors", self.size)
        hessian, _ = ca.hessian(ca.dot(weights, self._outputs), self._symbols)
        return self._function("_hessian", [ca.vec(ca.densify(ca.cse(hessian)))], weights)

    def _function(self, suffix: str, outputs: list[ca.SX], *more: ca.SX) -> ca.Function:
        own = [self._own] if self._own.shape[0] else []
        return ca.Function(self._name + suffix, [self._symbols, *own, *more], outputs)

    def value(self, columns: ca.MX, values: ca.MX) -> ca.MX:
        """All outputs, (size, columns)."""
        if not self.size:
            return ca.MX(0, columns.shape[1])
        return self._mapped(self._value, columns, values)[0]

    def first(self, columns: ca.MX, values: ca.MX) -> tuple[ca.MX, ca.MX]:
        """The first output (1, columns) and its gradient (symbols, columns)."""
        value, slope = self._mapped(self._first, columns, values)
        return value, slope

    def second(self, columns: ca.MX, values: ca.MX, factors: ca.MX) -> ca.MX:
        """Hessian of factors' * outputs, (symbols^2, columns)."""
        return self._mapped(self._second, columns, values, factors)[0]

    def _mapped(
        self, function: ca.Function, columns: ca.MX, values: ca.MX, *more: ca.MX
    ) -> list[ca.MX]:
        count = columns.shape[1]
        own = [ca.repmat(values, 1, count)] if self._own.shape[0] else []
        return list(function.map(count).call([columns, *own, *more]))
