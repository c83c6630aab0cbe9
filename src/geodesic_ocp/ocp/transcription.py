"""Transcription: a problem on a grid as a nonlinear program, a sum of blocks.

Variables are the positions at the grid's nodes; velocities at the nodes follow from the
differentiation matrix. Path constraints hold at the nodes; energy and cost are integrated by
`Grid.quadrature`, more accurately than the nodes would allow (a high-order variational integrator:
Marsden and West, Acta Numerica 2001; Ober-Bloebaum, Junge, Marsden, ESAIM COCV 2011).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse

from geodesic_ocp.arrays import Array, ShortRepr, evaluate
from geodesic_ocp.blocks import Block, BlockProgram, Terms
from geodesic_ocp.cells import Cells, Indices
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.ocp.conditions import Condition, Conditions, Group, stacked
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

    def parameters(self, grid: Grid, values: Array | tuple[()] = ()) -> Array:
        """Return the NLP's parameters p, (n + 2 + k + segments,), with those of the problem."""
        return np.concatenate([[self.scale, self.length], self.origin, values, grid.widths])

    def scaled(self, q: Array) -> Array:
        """Return scaled positions for positions (k, n)."""
        return np.asarray((q - self.origin) / self.length)

    def positions(self, y: Array) -> Array:
        """Return positions (k, n) for scaled ones."""
        return np.asarray(self.origin + self.length * y)


class CompiledEnergy(Terms):
    """v' G(q) v / 2 with derivatives from the metric's compiled library.

    Args:
        metric: G.
        conditions: conditions whose symbols are used.
        file: the library.
    """

    def __init__(self, metric: Metric, conditions: Conditions, file: str) -> None:
        c = conditions
        n = metric.dim
        super().__init__(ca.vertcat(c.q, c.v), c.p, metric.energy_density(c.q, c.v))
        self.in_use["energy"] = metric.kernels
        self._derivatives = {}
        for name in ("gradient", "hessian"):
            self._derivatives[name] = ca.external(f"energy_{name}", file)
            with suppress(RuntimeError):  # of several states at once
                self._derivatives[name] = ca.external(f"energy_{name}s", file)
        # The library gives l_q, l_v, and by columns l_qq, l_qv and G.
        by_columns = 2 * n + np.arange(3 * n**2).reshape(n, 3 * n, order="F")
        qq, qv, vv = np.split(by_columns, 3, axis=1)
        self._entries = np.block([[qq, qv], [qv.T, vv]])[self.hessian_entries].tolist()

    @cached_property
    def hessian_entries(self) -> tuple[Indices, Indices]:
        """Rows and columns of the upper triangle, columns first."""
        column, row = np.tril_indices(self.size)
        return row, column

    def mapped(self, name: str, count: int, arguments: Sequence[Any]) -> list[ca.MX]:
        """Return outputs of one of the functions for so many instances, one column each."""
        columns = arguments[0]
        if name in ("value", "gradient"):
            density, gradient = self._at("gradient", columns, count)
            return [density, gradient if name == "gradient" else ca.MX(0, count)]
        if name == "hessian":
            entries = self._at("hessian", columns, count)[1][self._entries, :]
            return [entries * (ca.DM.ones(len(self._entries), 1) @ arguments[2])]
        return super().mapped(name, count, arguments)

    def _at(self, name: str, columns: ca.MX, count: int) -> list[ca.MX]:
        """Return densities and derivatives at states, one column each."""
        function = self._derivatives[name]
        lanes = function.size2_in(0)
        rest = ca.repmat(columns[:, -1], 1, -count % lanes)
        found = function.map(-(-count // lanes)).call([ca.horzcat(columns, rest)])
        return [each[:, :count] for each in found]


@dataclass(frozen=True, eq=False)
class PathTerms:
    """All terms of a problem, which are the same on every grid.

    Attributes:
        conditions: conditions of the problem, whose symbols are used.
        energy: integrand of energy and cost, in q and v.
        at_ends: conditions in q0, q1, v0, v1.
        at_nodes: in q, by groups.
        at_via: in q, of each via point.
        in_segments: in q and v.
    """

    conditions: Conditions = field(repr=False)
    energy: Terms
    at_ends: Terms
    at_nodes: tuple[Group, ...] = field(repr=False)
    at_via: tuple[Terms, ...]
    in_segments: Terms

    @classmethod
    def of(cls, metric: Metric, conditions: Conditions) -> PathTerms:
        """Return the terms for least energy in the metric under these conditions.

        Derivatives of the energy are compiled where that is possible and there is no running cost.
        """
        c = conditions
        state = ca.vertcat(c.q, c.v)

        def bounded(symbols: ca.SX, group: tuple[Condition, ...]) -> Terms:
            return Terms(symbols, c.p, 0.0, stacked(group))

        energy = None
        if c.cost.is_zero() and (file := metric.kernels.file):
            try:
                energy = CompiledEnergy(metric, c, file)
            except RuntimeError:  # the file has been removed
                energy = None
        return cls(
            conditions=c,
            energy=energy or Terms(state, c.p, metric.energy_density(c.q, c.v) + c.cost),
            at_ends=bounded(ca.vertcat(c.q0, c.q1, c.v0, c.v1), c.ends),
            at_nodes=tuple(c.groups),
            at_via=tuple(bounded(c.q, each) for each in c.via),
            in_segments=bounded(state, c.along_qv),
        )


@dataclass(frozen=True, eq=False, repr=False)
class Transcription(ShortRepr):
    """The NLP in x = scaled positions at the nodes, one after the other, and p of `Units`.

    It is the same on all grids that differ in the widths of their segments, which are among the
    entries of p, before the scales by which constraint functions are divided. Its constraint
    functions are those at the ends; at one via point after the other, then the jumps of the
    velocity there; in q at one node after the other; in q and v at one node after the other of one
    segment after the other (`Conditions`, in its order).

    Attributes:
        terms: terms of the problem.
        grid: grid of the nodes, with equal segments.
        s: parameters of the nodes, by which distances are part of the program or not.
        linear: matrix (rows, size * n) of linear constraint functions of x, the last of all.
    """

    terms: PathTerms
    grid: Grid
    s: Array
    linear: scipy.sparse.sparray | None = None
    _shown = ("grid",)

    @property
    def dim(self) -> int:
        """Number n of coordinates."""
        return int(self.terms.conditions.q.numel())

    @property
    def size_p(self) -> int:
        """Number n + 2 + k + segments of parameters, and one for every constraint function."""
        return self._size_numbers + self.program.size_g

    @property
    def _size_numbers(self) -> int:
        return self.dim + 2 + int(self.terms.conditions.p.numel()) + self.grid.segments

    @property
    def size_ends(self) -> int:
        """Number of constraints at the ends, the first of all."""
        return self.terms.at_ends.size_g

    @cached_property
    def program(self) -> BlockProgram:
        """All blocks, without bounds of the constraint functions, which are divided by scales."""
        p = ca.MX.sym("p", self._size_numbers)
        blocks = self.blocks(p)
        scales = ca.MX.sym("scales", sum(each.size_g for each in blocks))
        return BlockProgram(self.dim * self.grid.size, blocks, p, scales=scales)

    def blocks(self, p: ca.MX | ca.DM, first: int = 0) -> list[Block]:
        """Return energy and conditions, with p in the place of the parameters.

        Args:
            p: parameters, but the scales of constraint functions.
            first: index of the first of the variables.
        """
        n = self.dim
        grid = self.grid
        terms = self.terms
        scale, length, origin, values, widths = ca.vertsplit(
            p, [0, 1, 2, n + 2, self._size_numbers - grid.segments, self._size_numbers]
        )
        at = first + np.arange(n * grid.size).reshape(grid.size, n)
        inside = at[grid.degree * np.arange(grid.segments)[:, None] + np.arange(grid.degree + 1)]
        steeper = 1.0 / (grid.segments * widths)  # than on equal segments
        slope = length * steeper
        zero = ca.DM.zeros(1, n)
        one = ca.DM.ones(1, n)

        def block(
            each: Terms, places: Any, units: tuple[Any, Any], weights: ca.MX | None = None
        ) -> Block:
            shared = ca.DM.ones(units[1].shape[0], 1) @ values.T
            return Block(each, places, shared, None, None, weights, units)

        def states(each: Terms, rows: Array, weights: ca.MX | None = None) -> Block:
            """Return positions and velocities at points of all segments."""
            every = ca.DM.ones(len(rows) * grid.segments, 1)
            of_slopes = ca.vec(ca.DM.ones(len(rows), 1) @ slope.T) @ one
            units = every @ ca.horzcat(origin.T, zero), ca.horzcat(every @ one * length, of_slopes)
            return block(each, Cells(inside, rows), units, weights)

        def positions(each: Terms, nodes: Sequence[int]) -> Block:
            every = ca.DM.ones(len(nodes), 1)
            return block(each, at[list(nodes)], (every @ origin.T, every @ one * length))

        def slope_at(segment: int, node: int) -> Array:
            """Return weights (size,) of the nodes for the slope at one, on equal segments."""
            row = np.zeros(grid.size)
            nodes = grid.degree * segment + np.arange(grid.degree + 1)
            row[nodes] = grid.differentiation[segment][node]
            return row

        def placed(*weights: Array) -> scipy.sparse.sparray:
            """Return the matrix from x to coordinates that are these sums over the nodes."""
            found = scipy.sparse.coo_array(scipy.sparse.kron(np.stack(weights), np.eye(n)))
            shape = found.shape[0], int(at.max()) + 1
            return scipy.sparse.coo_array((found.data, (found.row, first + found.col)), shape)

        quadrature = grid.quadrature
        rows = np.stack([quadrature.values, quadrature.slopes[0]], axis=1)
        ends = []
        if terms.at_ends.size_g:
            first_node = np.eye(1, grid.size)[0]
            last_node = np.eye(1, grid.size, grid.size - 1)[0]
            slopes = slope_at(0, 0), slope_at(grid.segments - 1, -1)
            matrix = placed(first_node, last_node, *slopes)
            scales = length * one, length * one, slope[0] * one, slope[-1] * one
            offset = ca.horzcat(origin.T, origin.T, zero, zero)
            ends = [block(terms.at_ends, matrix, (offset, ca.horzcat(*scales)))]
        via = [
            positions(each, [node]) for each, node in zip(terms.at_via, grid.via_nodes, strict=True)
        ]
        jumps = []
        if terms.conditions.via_continuity:
            after = ca.SX.sym("after", n)
            before = ca.SX.sym("before", n)
            jump = Terms(ca.vertcat(after, before), terms.conditions.p, 0.0, after - before)
            for segment in grid.via_segments:
                matrix = placed(slope_at(segment, 0), slope_at(segment - 1, -1))
                units = ca.horzcat(slope[segment] * one, slope[segment - 1] * one)
                jumps.append(block(jump, matrix, (ca.horzcat(zero, zero), units)))
        weights = ca.DM(quadrature.weights) / (steeper @ ca.DM.ones(1, len(rows))) / scale
        blocks = [states(terms.energy, rows, ca.vec(weights.T)), *ends, *via, *jumps]
        every = range(grid.size)
        inner = {
            each: replace(positions(each, every), values=None)
            for each in dict.fromkeys(group.inner for group in terms.at_nodes)
            if each is not None
        }
        for group in terms.at_nodes:
            if group.inner is None:
                blocks.append(positions(group.terms, every))
                continue
            nodes, own = group.at_nodes(self.s)
            if not nodes.size:
                continue
            places = group.inner.size_g * nodes[:, None] + group.indices[own]
            points = inner[group.inner]
            blocks.append(Block(group.terms, places, group.numbers[own], inner=points))
        if terms.in_segments.size_g:
            at_own = np.stack([np.eye(grid.degree + 1), grid.differentiation[0]], axis=1)
            blocks.append(states(terms.in_segments, at_own))
        if self.linear is not None and self.linear.shape[0]:
            blocks.append(Block(Terms(z := ca.SX.sym("z"), constraints=z), self.linear))
        return blocks

    @property
    def value(self) -> ca.Function:
        """(x, p) -> f, g; f in the unit of energy."""
        return self.program.functions["nlp"]

    @property
    def differentiable(self) -> ca.Function:
        """The same function, which CasADi can differentiate; slower."""
        return replace(self.program, differentiable=True).functions["nlp"]

    @property
    def objective(self) -> ca.Function:
        """(x, p) -> f, gradient."""
        return self.program.functions["grad_f"]

    @property
    def constraints(self) -> ca.Function:
        """(x, p) -> g, its Jacobian."""
        return self.program.functions["jac_g"]

    @property
    def hessian(self) -> ca.Function:
        """(x, p, lam_f, lam_g) -> upper triangle of the Lagrangian's Hessian."""
        return self.program.functions["hess_lag"]

    def parameters(
        self,
        units: Units,
        grid: Grid,
        values: Array | tuple[()] = (),
        scales: Array | None = None,
    ) -> Array:
        """Return the NLP's parameters p, with those of the problem, and scales of the constraint
        functions; None: ones.
        """
        scales = np.ones(self.program.size_g) if scales is None else scales
        return np.concatenate([units.parameters(grid, values), scales])

    def energy(self, grid: Grid, nodes: Array, values: Array | tuple[()] = ()) -> float:
        """Return energy and cost of the path through nodes (size, n) of a grid of this shape."""
        units = Units(nodes[0], 1.0, 1.0)
        p = self.parameters(units, grid, values)
        return float(evaluate(self.value, units.scaled(nodes).ravel(), p)[0].item())

    def full_hessian(self, x: Array, p: Array, lam_g: Array) -> Array:
        """Return symmetric Hessian of the Lagrangian with lam_f = 1, as a matrix."""
        upper = evaluate(self.hessian, x, p, 1.0, lam_g)
        return np.asarray(np.triu(upper) + np.triu(upper, 1).T)

    @cached_property
    def momentum(self) -> ca.Function:
        """(x, p) -> p0 = -dE/dq0 (n,) at the first node, and its derivative (n, n) by the last.

        The inner nodes follow the ends so that dE/dq_inner stays zero: with the blocks of E's
        Hessian, dp0/dq1 = H_0i H_ii^-1 H_i1 - H_01.
        """
        n = self.dim
        last = self.dim * (self.grid.size - 1)
        x = ca.MX.sym("x", n * self.grid.size)
        p = ca.MX.sym("p", self.size_p)
        scale = p[0]
        length = p[1]
        _, gradient = self.objective(x, p)
        upper = self.hessian(x, p, 1.0, ca.MX(self.program.size_g, 1))
        hessian = ca.triu2symm(upper)
        inner = ca.solve(hessian[n:last, n:last], hessian[n:last, last:], "ldl")
        by_goal = ca.densify(hessian[:n, n:last] @ inner - hessian[:n, last:])
        outputs = [-gradient[:n] * scale / length, by_goal * scale / length**2]
        return ca.Function("momentum", [x, p], outputs)
