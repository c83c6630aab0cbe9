"""The one nonlinear program of the package: a sum of small functions of a few variables each.

f(x) = sum_k w_k f_b(z_k, p_k) and g(x) = (g_b(z_k, p_k))_bk over kinds b of terms and their
instances k, with z_k = offset_k + scale_k * (A_k x): some of the variables, or values and slopes of
polynomials between them. First and second derivatives are exact: those of one instance are
generated once as a function, compiled, mapped over the instances, and added up in the places of
their variables.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import Any, TypeAlias, TypeVar

import casadi as ca
import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.compiled.library import Library
from geodesic_ocp.ipopt import Ipopt, Outcome

Indices: TypeAlias = NDArray[np.int64]
Start = TypeVar("Start")
Found = TypeVar("Found")
_MANY = 200  # instructions from which on a function is compiled
_SPARSE = 0.5  # matrices with a smaller fraction of entries other than zero are stored as sparse
# CasADi's own product of dense matrices is several times slower.
_BLAS = ("classic",) if getattr(ca, "has_blas", lambda _: False)("classic") else ()


class Terms:
    """An objective f(z, p) and constraint functions g(z, p) of one instance, with derivatives.

    Args:
        variables: symbols z (size, 1).
        parameters: symbols p (k, 1).
        objective: f, a scalar.
        constraints: g (m, 1).
    """

    def __init__(
        self,
        variables: ca.SX,
        parameters: ca.SX | None = None,
        objective: ca.SX | float = 0.0,
        constraints: ca.SX | None = None,
    ) -> None:
        self._z, self._p = variables, ca.SX(0, 1) if parameters is None else parameters
        self._f = ca.SX(objective)
        self._g = ca.SX(0, 1) if constraints is None else ca.densify(constraints)
        self.size, self.size_g = int(self._z.numel()), int(self._g.numel())
        self.size_p = int(self._p.numel())
        self.has_objective = not self._f.is_zero()

    @cached_property
    def value(self) -> ca.Function:
        """(z, p) -> f, g."""
        return self._function("value", [], [self._f, self._g])

    @cached_property
    def gradient(self) -> ca.Function:
        """(z, p) -> f and its gradient."""
        return self._function("gradient", [], [self._f, ca.gradient(self._f, self._z)])

    @cached_property
    def jacobian(self) -> ca.Function:
        """(z, p) -> g and the entries of its Jacobian."""
        return self._function("jacobian", [], [self._g, ca.vec(self._slopes.nz[:])])

    @cached_property
    def hessian(self) -> ca.Function:
        """(z, p, lam_f, lam_g) -> entries of the Lagrangian's Hessian, its upper triangle."""
        factors, hessian = self._curvature
        return self._function("hessian", factors, [ca.vec(hessian.nz[:])])

    def mapped(self, name: str, count: int, arguments: Sequence[Any]) -> list[ca.MX]:
        """Outputs of one of these functions for so many instances, one column each."""
        compiled = None if name == "value" else self._compiled.get(name)
        function = compiled or getattr(self, name)
        return list(function.map(count).call(list(arguments)))

    @cached_property
    def _compiled(self) -> dict[str, ca.Function]:
        """The derivatives that take long enough, from a library, where there is a compiler."""
        names = [("gradient", self.has_objective), ("jacobian", self.size_g > 0), ("hessian", True)]
        functions = {name: getattr(self, name) for name, has in names if has}
        functions = {
            name: each for name, each in functions.items() if each.n_instructions() > _MANY
        }
        if not functions:
            return {}
        text = "".join(each.serialize() for each in functions.values())
        file = Library(lambda: functions, sha256(text.encode()).hexdigest()).file
        try:
            return {name: ca.external(name, file) for name in functions} if file else {}
        except RuntimeError:  # the file has been removed
            return {}

    @cached_property
    def jacobian_entries(self) -> tuple[Indices, Indices]:
        """Rows and columns of the Jacobian's entries."""
        return _triplets(self._slopes.sparsity())

    @cached_property
    def hessian_entries(self) -> tuple[Indices, Indices]:
        """Rows and columns of the Hessian's entries."""
        return _triplets(self._curvature[1].sparsity())

    @cached_property
    def _slopes(self) -> ca.SX:
        return ca.SX(ca.jacobian(self._g, self._z))

    @cached_property
    def _curvature(self) -> tuple[list[ca.SX], ca.SX]:
        lam_f, lam_g = ca.SX.sym("lam_f"), ca.SX.sym("lam_g", self.size_g)
        hessian, _ = ca.hessian(lam_f * self._f + ca.dot(lam_g, self._g), self._z)
        return [lam_f, lam_g], ca.triu(ca.SX(hessian))

    def _function(self, name: str, more: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
        tidy = [ca.cse(ca.densify(each)) for each in outputs]
        return ca.Function(name, [self._z, self._p, *more], tidy)


@dataclass(frozen=True, eq=False)
class Cells:
    """Values and derivatives, at points of cells, of polynomials through the nodes of the cell.

    Variables of the instance of cell c and point k are, one row after the other,
    sum_a rows[k, r, a] x[indices[c, a]], the same combinations in all cells, and then some that all
    instances share.

    Attributes:
        indices: of the coordinates at the nodes in x, (cells, nodes, n).
        rows: (points, r, nodes).
        shared: indices in x of what all instances share, below those of the nodes.
    """

    indices: Indices
    rows: Array
    shared: tuple[int, ...] = ()

    @property
    def matrix(self) -> tuple[Indices, Indices, Array]:
        """Rows, columns and entries of the matrix from x to the variables of all instances."""
        (cells, _, n), (points, rows, _) = self.indices.shape, self.rows.shape
        point, row, node = np.nonzero(self.rows)
        cell, at, i = np.ix_(np.arange(cells), np.arange(point.size), np.arange(n))
        size = rows * n + len(self.shared)
        of_z = (cell * points + point[at]) * size + row[at] * n + i
        entries = np.broadcast_to(self.rows[point, row, node][at], of_z.shape)
        last = size * np.arange(cells * points)[:, None] + rows * n + np.arange(len(self.shared))
        return (
            np.concatenate([of_z.ravel(), last.ravel()]),
            np.concatenate(
                [self.indices[cell, node[at], i].ravel(), np.tile(self.shared, cells * points)]
            ).astype(np.int64),
            np.concatenate([entries.ravel(), np.ones(last.size)]),
        )

    def hessians(
        self, pattern: tuple[Indices, Indices], entries: ca.MX
    ) -> tuple[Indices, Indices, ca.MX]:
        """Rows, columns and entries of the sums of A_k' H_k A_k, their upper triangles.

        Args:
            pattern: rows and columns of the entries of an H_k, its upper triangle.
            entries: one column a point.
        """
        size = self.rows.shape[1] * self.indices.shape[2]
        of_nodes = pattern[1] < size
        own = pattern[0][of_nodes], pattern[1][of_nodes]
        parts = [self._of_nodes(own, entries[np.flatnonzero(of_nodes).tolist(), :])]
        corner = pattern[0] >= size
        if np.any(corner):
            at = np.array(self.shared, dtype=np.int64)
            row, column = (at[each[corner] - size] for each in pattern)
            total = ca.sum2(entries[np.flatnonzero(corner).tolist(), :])
            parts.append((np.minimum(row, column), np.maximum(row, column), total))
        mixed = ~of_nodes & ~corner
        if np.any(mixed):
            kept = pattern[0][mixed], pattern[1][mixed] - size
            parts.append(self._mixed(kept, entries[np.flatnonzero(mixed).tolist(), :]))
        rows, columns, values = zip(*parts, strict=True)
        return np.concatenate(rows), np.concatenate(columns), ca.vertcat(*values)

    def _mixed(
        self, pattern: tuple[Indices, Indices], entries: ca.MX
    ) -> tuple[Indices, Indices, ca.MX]:
        """By the nodes and what is shared: sum_k A_sa H_st over points and rows s, of node a."""
        cells, nodes, n = self.indices.shape
        (row, i), to = np.divmod(pattern[0], n), pattern[1]
        places, found = [], []
        for s in np.unique(row).tolist():
            here = np.flatnonzero(row == s)
            factors = scipy.sparse.kron(scipy.sparse.eye(cells), self.rows[:, s])
            found.append(ca.vec(entries[here.tolist(), :] @ as_dm(factors)))
            at = self.indices[:, :, i[here]].ravel()
            places.append((np.tile(np.array(self.shared)[to[here]], cells * nodes), at))
        rows, columns = zip(*places, strict=True)
        return np.concatenate(rows), np.concatenate(columns), ca.vertcat(*found)

    def _of_nodes(
        self, pattern: tuple[Indices, Indices], entries: ca.MX
    ) -> tuple[Indices, Indices, ca.MX]:
        """By the nodes alone.

        With blocks H_st of rows s and t, the block of nodes a and b is the sum over k, s <= t of

            (A_sa A_tb + A_ta A_sb) (H_st + H_st')/2 + (A_sa A_tb - A_ta A_sb) (H_st - H_st')/2,

        half the first term where s = t: half of the entries of symmetric and antisymmetric matrices
        suffice.
        """
        (cells, nodes, n), (points, rows, _) = self.indices.shape, self.rows.shape
        first, second = np.triu_indices(nodes)  # the pairs (a, b) of a cell's nodes with a <= b
        pairs = [(s, t) for s in range(rows) for t in range(s, rows)]
        split, join = _halves(n, pairs, pattern)
        half = n * (n + 1) // 2
        parts = split @ entries
        of = self.rows.swapaxes(0, 1)
        both = {
            (s, t): (of[s][:, first] * of[t][:, second]) for s in range(rows) for t in range(rows)
        }
        even = np.vstack([both[s, t] + both[t, s] * (s != t) for s, t in pairs])
        odd = np.vstack(
            [np.zeros((0, first.size)), *(both[p] - both[p[::-1]] for p in pairs if p[0] != p[1])]
        )
        sums = []
        for cell in range(cells):
            here = parts[:, cell * points : (cell + 1) * points]
            symmetric = [here[k * half : (k + 1) * half, :] for k in range(len(pairs))]
            halves = [_product(ca.horzcat(*symmetric), even)]
            if odd.size:
                rest, size = here[len(pairs) * half :, :], n * (n - 1) // 2
                skew = [rest[k * size : (k + 1) * size, :] for k in range(len(odd) // points)]
                halves.append(_product(ca.horzcat(*skew), odd))
            sums.append(
                ca.vec(join[:, : sum(each.shape[0] for each in halves)] @ ca.vertcat(*halves))
            )
        at = self.indices[:, first][:, :, None, :], self.indices[:, second][:, :, :, None]
        row, column = (each.ravel() for each in np.broadcast_arrays(*at))
        upper = np.flatnonzero(row <= column)
        return row[upper], column[upper], ca.vertcat(*sums)[upper.tolist()]


def _product(matrix: ca.MX, factors: Array) -> ca.MX:
    few = np.count_nonzero(factors) < _SPARSE * factors.size
    return ca.densify(ca.mtimes(matrix, ca.sparsify(ca.DM(factors)) if few else factors, *_BLAS))


def _halves(
    n: int, pairs: Sequence[tuple[int, int]], pattern: tuple[Indices, Indices]
) -> tuple[ca.DM, ca.DM]:
    """From entries of H to half of those of (H_st + H_st')/2 and (H_st - H_st')/2, and back.

    The second matrix joins the halves of a symmetric and an antisymmetric matrix to their sum, in
    the order of columns.
    """
    size = n * (max(t for _, t in pairs) + 1)
    place = np.full((size, size), len(pattern[0]))  # where there is no entry: a row of zeros
    place[pattern] = place[pattern[::-1]] = np.arange(len(pattern[0]))
    unit = np.vstack([np.eye(len(pattern[0])), np.zeros(len(pattern[0]))])
    upper, strict = np.triu_indices(n), np.triu_indices(n, 1)
    blocks = {(s, t): place[s * n : (s + 1) * n, t * n : (t + 1) * n] for s, t in pairs}
    split = [unit[each[upper]] + unit[each.T[upper]] for each in blocks.values()]
    split += [unit[blocks[s, t][strict]] - unit[blocks[s, t].T[strict]] for s, t in pairs if s != t]
    entry, of_block = np.arange(n * n).reshape(n, n, order="F"), np.eye(n * n)
    join = [np.maximum(of_block[entry[upper]], of_block[entry.T[upper]])]
    join.append(of_block[entry[strict]] - of_block[entry.T[strict]])
    return ca.sparsify(ca.DM(np.vstack(split) / 2.0)), ca.sparsify(ca.DM(np.vstack(join).T))


@dataclass(frozen=True, eq=False)
class Block:
    """Instances of one kind of terms. Numbers may be expressions in the program's parameters.

    Attributes:
        terms: of an instance.
        places: of the variables of every instance in x: indices (instances, size), all different in
            a row; a sparse matrix (instances * size, number of variables); or cells.
        values: of the parameters, (instances, k).
        lower, upper: bounds of the constraint functions, (instances, m).
        weights: of the objective (instances,); None: one.
        units: offset and scale of the variables (rows of places, size); None: zero and one.
        groups: for each instance the row of `places` with its variables, of terms without
            constraints; None: each has its own.
    """

    terms: Terms
    places: Indices | scipy.sparse.sparray | Cells
    values: Array | ca.MX | None = None
    lower: Array | None = None
    upper: Array | None = None
    weights: Array | ca.MX | ca.DM | None = None
    units: tuple[Any, Any] | None = None
    groups: Indices | None = None

    @property
    def count(self) -> int:
        """Number of instances."""
        return self.num_places if self.groups is None else self.groups.size

    @cached_property
    def num_places(self) -> int:
        """Number of different sets of variables."""
        if isinstance(self.places, Cells):
            return len(self.places.indices) * len(self.places.rows)
        rows = int(self.places.shape[0])
        return rows if isinstance(self.places, np.ndarray) else rows // max(self.terms.size, 1)

    @property
    def size_g(self) -> int:
        """Number of constraint functions of all instances."""
        return self.terms.size_g * self.count

    @cached_property
    def _matrix(self) -> tuple[Indices, Indices, Array]:
        """Rows, columns and entries of the matrix A of all instances, in the order of rows."""
        if isinstance(self.places, np.ndarray):
            size = self.places.size
            return np.arange(size), self.places.ravel(), np.ones(size)
        if isinstance(self.places, Cells):
            rows, columns, entries = self.places.matrix
        else:
            matrix = self.places.tocoo()
            rows, columns, entries = matrix.row.astype(np.int64), matrix.col, matrix.data
        order = np.argsort(rows, kind="stable")
        return rows[order], columns[order], entries[order]

    def arguments(self, x: ca.MX) -> list[ca.MX | ca.DM]:
        """Variables and parameters of all instances, one column each."""
        rows, columns, entries = self._matrix
        if isinstance(self.places, np.ndarray):
            z = x[columns.tolist()]
        else:
            shape = self.terms.size * self.num_places, x.shape[0]
            z = ca.DM.triplet(rows.tolist(), columns.tolist(), entries, *shape) @ x
        z = ca.reshape(ca.densify(z), self.terms.size, self.num_places)
        if self.units is not None:
            offset, scale = (_columns(each) for each in self.units)
            z = offset + scale * z
        if self.groups is not None:
            z = z[:, self.groups.tolist()]
        values = ca.DM(0, self.count) if self.values is None else _columns(self.values)
        return [z, values]

    def objective(self, x: ca.MX) -> ca.MX:
        """The weighted sum of the objective of all instances."""
        return _weighted(self, self.terms.mapped("value", self.count, self.arguments(x))[0])

    def spread(self, at: Indices, values: ca.MX) -> tuple[Indices, Indices, Array, ca.MX]:
        """Entries of all instances by their variables, as entries by x.

        Args:
            at: the variable of each entry of an instance.
            values: one column an instance, by variables in their units.

        Returns:
            Numbers of the entries, variables in x, coefficients, and the entries.
        """
        values = self._summed(values)
        if self.units is not None:
            values = values * _columns(self.units[1])[at.tolist(), :]
        number, entry = self._expanded(self._of_instances(at))
        return number, self._matrix[1][entry], self._matrix[2][entry], ca.vec(values)

    def _of_instances(self, at: Indices) -> Indices:
        """Rows of the matrix A for some of the variables of every instance, in order."""
        return np.asarray((self.terms.size * np.arange(self.num_places)[:, None] + at).ravel())

    def _summed(self, values: ca.MX) -> ca.MX:
        """Values of instances, one column each, added up where they have the same variables."""
        if self.groups is None:
            return values
        ones, each = np.ones(self.count), np.arange(self.count)
        shape = self.count, self.num_places
        return values @ as_dm(scipy.sparse.csc_array((ones, (each, self.groups)), shape))

    def _expanded(self, rows: Indices) -> tuple[Indices, Indices]:
        """For rows of A, the number of the row in the list and each of its entries in `_matrix`."""
        starts = np.searchsorted(self._matrix[0], np.arange(self.terms.size * self.num_places + 1))
        lengths = np.diff(starts)[rows]
        number = np.repeat(np.arange(rows.size), lengths)
        within = np.arange(number.size) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        return number, starts[rows][number] + within

    def curvature(self, values: ca.MX) -> _Entries:
        """The Hessian by x from the entries of those of all instances, one column each."""
        first, second = pattern = self.terms.hessian_entries
        values = self._summed(values)
        if self.units is not None:
            scale = _columns(self.units[1])
            values = values * (scale[first.tolist(), :] * scale[second.tolist(), :])
        if isinstance(self.places, Cells):
            row, column, entries = self.places.hessians(pattern, values)
            return _Entries(row, column, entries)
        _, columns, factors = self._matrix
        number, one = self._expanded(self._of_instances(first))
        # Every entry of the one row of A with every entry of the other.
        again, other = self._expanded(self._of_instances(second)[number])
        number, one = number[again], one[again]
        row, column = columns[one], columns[other]
        off_diagonal = np.tile(first != second, self.num_places)[number]
        coefficient = factors[one] * factors[other]
        coefficient *= np.where((row == column) & off_diagonal, 2.0, 1.0)
        kept = off_diagonal | (row <= column)
        row, column = np.minimum(row, column), np.maximum(row, column)
        return _Entries(row[kept], column[kept], ca.vec(values), number[kept], coefficient[kept])


@dataclass(frozen=True, eq=False)
class _Entries:
    """Entries of a sparse matrix: `values[source] * factors` is added at (row, column)."""

    row: Indices
    column: Indices
    values: ca.MX
    source: Indices | None = None
    factors: Array | None = None


@dataclass(frozen=True, eq=False)
class BlockProgram:
    """The program of all blocks: x, p -> f, g, with blocks and their instances in order.

    Attributes:
        size: number of variables.
        blocks: the kinds of terms.
        parameters: symbols of the parameters p in which numbers of the blocks are expressed.
        quadratic: Q (size, size) and b (size,) of a term x' Q x / 2 - b' x; None: there is none.
    """

    size: int
    blocks: Sequence[Block]
    parameters: ca.MX | None = None
    quadratic: tuple[scipy.sparse.sparray, Array] | None = None

    @property
    def size_g(self) -> int:
        """Number of constraint functions."""
        return sum(block.size_g for block in self.blocks)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Of the constraint functions."""
        sides = [(each.lower, each.upper) for each in self.blocks if each.size_g]
        lower, upper = zip(*sides, strict=True) if sides else ((), ())
        return _joined(lower), _joined(upper)

    def solve(self, x: Array, bounds: tuple[Array, Array], options: Mapping[str, Any]) -> Outcome:
        """The solution by Ipopt from x, within bounds of the variables.

        Args:
            x: (size,).
            bounds: lower and upper (size,).
            options: of Ipopt.
        """
        lower, upper = bounds
        lower_g, upper_g = self.bounds
        return self.solver(options)(
            x0=np.clip(x, lower, upper), lbx=lower, ubx=upper, lbg=lower_g, ubg=upper_g
        )

    def solver(self, options: Mapping[str, Any], relay: ca.Callback | None = None) -> Ipopt:
        """Ipopt for this program; the relay is called in every iteration."""
        derivatives = {name: self.functions[name] for name in ("grad_f", "jac_g", "hess_lag")}
        return Ipopt(self.functions["nlp"], derivatives, options, relay)

    @cached_property
    def functions(self) -> dict[str, ca.Function]:
        """nlp, grad_f, jac_g, hess_lag: the program and its derivatives, as nlpsol takes them."""
        x = ca.MX.sym("x", self.size)
        p = ca.MX.sym("p", 0) if self.parameters is None else self.parameters
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", self.size_g)
        arguments = [block.arguments(x) for block in self.blocks]
        pairs = list(zip(self.blocks, arguments, strict=True))
        f, g = ca.MX(0), []
        for block, (z, values) in pairs:
            of_each, constraints = block.terms.mapped("value", block.count, [z, values])
            f += _weighted(block, of_each) if block.terms.has_objective else 0
            g.append(ca.vec(constraints))
        again, gradient = self._gradient(pairs)
        if self.quadratic is not None:
            bent, linear = as_dm(self.quadratic[0]) @ x, ca.DM(self.quadratic[1])
            more = ca.dot(x, bent) / 2 - ca.dot(linear, x)
            f, again, gradient = f + more, again + more, ca.densify(gradient + bent - linear)
        names, constraints = ["x", "p"], ca.vertcat(ca.MX(0, 1), *g)
        functions = {
            "nlp": ([x, p], [f, constraints], names, ["f", "g"]),
            "grad_f": ([x, p], [again, gradient], names, ["f", "grad_f_x"]),
            "jac_g": ([x, p], [constraints, self._jacobian(pairs)], names, ["g", "jac_g_x"]),
            "hess_lag": (
                *([x, p, lam_f, lam_g], [self._hessian(pairs, lam_f, lam_g)]),
                *([*names, "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]),
            ),
        }
        return {name: ca.Function(name, *each) for name, each in functions.items()}

    def _gradient(self, pairs: Sequence[tuple[Block, Any]]) -> tuple[ca.MX, ca.MX]:
        f, parts = ca.MX(0), []
        for block, (z, values) in pairs:
            if block.terms.has_objective:
                of_each, slopes = block.terms.mapped("gradient", block.count, [z, values])
                f += _weighted(block, of_each)
                if block.weights is not None:
                    slopes = slopes * (ca.DM.ones(block.terms.size, 1) @ _columns(block.weights))
                source, at, factors, entries = block.spread(np.arange(block.terms.size), slopes)
                parts.append(_Entries(at, np.zeros_like(at), entries, source, factors))
        return f, ca.densify(_assembled((self.size, 1), parts))

    def _jacobian(self, pairs: Sequence[tuple[Block, Any]]) -> ca.MX:
        first, parts = 0, []
        for block, (z, values) in pairs:
            if block.size_g:
                _, slopes = block.terms.mapped("jacobian", block.count, [z, values])
                rows, columns = block.terms.jacobian_entries
                source, at, factors, entries = block.spread(columns, slopes)
                instance, entry = np.divmod(source, max(columns.size, 1))
                row = first + block.terms.size_g * instance + rows[entry]
                parts.append(_Entries(row, at, entries, source, factors))
                first += block.size_g
        return _assembled((self.size_g, self.size), parts)

    def _hessian(self, pairs: Sequence[tuple[Block, Any]], lam_f: ca.MX, lam_g: ca.MX) -> ca.MX:
        first, parts = 0, []
        for block, (z, values) in pairs:
            own = lam_g[first : first + block.size_g]
            first += block.size_g
            if block.terms.hessian_entries[0].size:
                weights: ca.MX | ca.DM = ca.DM.ones(1, block.count)
                if block.weights is not None:
                    weights = _columns(block.weights)
                factors = ca.reshape(own, block.terms.size_g, block.count)
                inputs = [z, values, lam_f * weights, factors]
                parts.append(block.curvature(*block.terms.mapped("hessian", block.count, inputs)))
        if self.quadratic is not None:
            upper = scipy.sparse.triu(self.quadratic[0]).tocoo()
            parts.append(_Entries(upper.row, upper.col, lam_f * ca.DM(upper.data)))
        return _assembled((self.size, self.size), parts)


def single_block(terms: Terms, options: Mapping[str, Any] | None = None) -> Ipopt:
    """Ipopt for a program of one instance, whose variables and parameters are its own."""
    p = ca.MX.sym("p", terms.size_p)
    block = Block(terms, np.arange(terms.size)[None, :], p.T)
    return BlockProgram(terms.size, [block], p).solver(options or {})


def _columns(values: Array | ca.MX | ca.DM) -> ca.MX | ca.DM:
    """Numbers of instances (instances, m), one column each."""
    if isinstance(values, (ca.MX, ca.DM)):
        return values.T
    return ca.DM(np.atleast_2d(np.transpose(values)))


def _weighted(block: Block, values: ca.MX) -> ca.MX:
    return ca.sum2(values if block.weights is None else values * _columns(block.weights))


def _joined(parts: Sequence[Any]) -> Array:
    return np.concatenate([np.zeros(0), *(np.ravel(part) for part in parts)])


def _triplets(pattern: ca.Sparsity) -> tuple[Indices, Indices]:
    rows, columns = pattern.get_triplet()
    return np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64)


def _assembled(shape: tuple[int, int], parts: Sequence[_Entries]) -> ca.MX:
    """Sparse matrix with the entries added up in their places."""
    if not parts:
        return ca.MX(*shape)
    rows = np.concatenate([part.row for part in parts])
    columns = np.concatenate([part.column for part in parts])
    entries, sources, factors, first = [], [], [], 0
    for part in parts:
        entries.append(ca.densify(part.values))
        count = int(part.values.numel())
        own = np.arange(count) if part.source is None else part.source
        sources.append(first + own)
        factors.append(np.ones(own.size) if part.factors is None else part.factors)
        first += count
    # CasADi's order is by columns.
    unique, places = np.unique(columns * shape[0] + rows, return_inverse=True)
    pattern = ca.Sparsity.triplet(
        *shape, (unique % shape[0]).tolist(), (unique // shape[0]).tolist()
    )
    source, factor = np.concatenate(sources), np.concatenate(factors)
    every = ca.vertcat(*entries)
    if unique.size == rows.size and np.all(factor == 1.0):
        order = np.empty(rows.size, dtype=np.int64)
        order[places.ravel()] = source
        return ca.MX(pattern, every[order.tolist()])
    adder = scipy.sparse.csc_array((factor, (places.ravel(), source)), (unique.size, first))
    return ca.MX(pattern, ca.densify(as_dm(adder) @ every))


def as_dm(matrix: Any) -> ca.DM:
    """A sparse matrix of SciPy as one of CasADi."""
    matrix = scipy.sparse.csc_array(matrix)
    matrix.sum_duplicates()
    rows, columns = matrix.shape
    pattern = ca.Sparsity(rows, columns, matrix.indptr.tolist(), matrix.indices.tolist())
    return ca.DM(pattern, matrix.data)


def in_rounds(
    start: Start,
    solve: Callable[[Start], Found],
    judged: Callable[[int, Found], tuple[Found, Start | None]],
    most: int,
) -> Found:
    """Solve, look between the instants, add rows or nodes where that is needed, solve again.

    Args:
        start: from which the first round begins, whatever `solve` takes.
        solve: the solution from a start, or the last iterate.
        judged: number of the round and what it found -> the same, with a verdict if it is the last
            one, and the start of the next round; None: there is none.
        most: number of rounds.
    """
    for number in range(most):
        found, following = judged(number, solve(start))
        if following is None:
            break
        start = following
    return found
