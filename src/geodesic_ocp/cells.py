"""Polynomials in cells as linear maps: values and slopes at points, from coordinates at nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import casadi as ca
import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array

Indices: TypeAlias = NDArray[np.int64]
_SPARSE = 0.5  # matrices with a smaller fraction of entries other than zero are stored as sparse
# CasADi's own product of dense matrices is several times slower.
_BLAS = ("classic",) if getattr(ca, "has_blas", lambda _: False)("classic") else ()


@dataclass(frozen=True, eq=False)
class Cells:
    """Values and derivatives, at points of cells, of polynomials through the nodes of the cell.

    Variables of the instance of cell c and point k are, one row after the other,
    sum_a rows[k, r, a] x[indices[c, a]], the same combinations in all cells unless rows are given
    for each, and then some that all instances share.

    Attributes:
        indices: indices of the coordinates at the nodes in x, (cells, nodes, n).
        rows: (points, r, nodes), or of every cell (cells, points, r, nodes).
        shared: indices in x of what all instances share, below those of the nodes.
    """

    indices: Indices
    rows: Array
    shared: tuple[int, ...] = ()

    @property
    def matrix(self) -> tuple[Indices, Indices, Array]:
        """Rows, columns and entries of the matrix from x to the variables of all instances."""
        (cells, _, n), (points, rows, _) = self.indices.shape, self.rows.shape[-3:]
        point, row, node = np.nonzero(self._of_cells.any(axis=0))
        cell, at, i = np.ix_(np.arange(cells), np.arange(point.size), np.arange(n))
        size = rows * n + len(self.shared)
        of_z = (cell * points + point[at]) * size + row[at] * n + i
        used = np.broadcast_to(self._of_cells[:, point, row, node], (cells, point.size))
        entries = np.broadcast_to(used[:, :, None], of_z.shape)
        last = size * np.arange(cells * points)[:, None] + rows * n + np.arange(len(self.shared))
        return (
            np.concatenate([of_z.ravel(), last.ravel()]),
            np.concatenate(
                [self.indices[cell, node[at], i].ravel(), np.tile(self.shared, cells * points)]
            ).astype(np.int64),
            np.concatenate([entries.ravel(), np.ones(last.size)]),
        )

    @property
    def _of_cells(self) -> Array:
        """Rows of every cell (cells, points, r, nodes), or of all, (1, points, r, nodes)."""
        return self.rows if self.rows.ndim == 4 else self.rows[None]

    def hessians(
        self, pattern: tuple[Indices, Indices], entries: ca.MX
    ) -> tuple[Indices, Indices, ca.MX]:
        """Return rows, columns and entries of the sums of A_k' H_k A_k, their upper triangles.

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
        """Return mixed derivatives, sum_k A_sa H_st: by the nodes and what is shared."""
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
        """Return the second derivatives by the nodes alone.

        With blocks H_st of rows s and t, the block of nodes a and b is the sum over k, s <= t of

            (A_sa A_tb + A_ta A_sb) (H_st + H_st')/2 + (A_sa A_tb - A_ta A_sb) (H_st - H_st')/2,

        half the first term where s = t: half of the entries of symmetric and antisymmetric matrices
        suffice.
        """
        (_, nodes, n), (points, rows, _) = self.indices.shape, self.rows.shape[-3:]
        first, second = np.triu_indices(nodes)  # the pairs (a, b) of a cell's nodes with a <= b
        pairs = [(s, t) for s in range(rows) for t in range(s, rows)]
        split, join = _halves(n, pairs, pattern)
        half = n * (n + 1) // 2
        parts = split @ entries

        def factors(of: Array) -> tuple[Array, Array]:
            both = {
                (s, t): of[:, s][:, first] * of[:, t][:, second]
                for s in range(rows)
                for t in range(rows)
            }
            even = np.vstack([both[s, t] + both[t, s] * (s != t) for s, t in pairs])
            odd = [both[p] - both[p[::-1]] for p in pairs if p[0] != p[1]]
            return even, np.vstack([np.zeros((0, first.size)), *odd])

        def added_up(parts: ca.MX, of: Array) -> ca.MX:
            """Return the blocks of all pairs of nodes, of cells with these rows."""
            cells, halves = parts.shape[1] // points, []
            rows = [0, len(pairs) * half, parts.shape[0]]
            for each, own in zip(ca.vertsplit(parts, rows), factors(of), strict=True):
                if own.size:
                    blocks, height = len(own) // points, each.shape[0] * points // len(own)
                    at = np.arange(each.numel()).reshape(cells, points, blocks, height)
                    together = _arranged(each, at.transpose(2, 1, 0, 3), len(own))
                    back = np.arange(first.size * cells * height).reshape(first.size, cells, height)
                    product = _product(together, own)
                    halves.append(_arranged(product, back.transpose(1, 0, 2), first.size * cells))
            return ca.vec(join[:, : sum(each.shape[0] for each in halves)] @ ca.vertcat(*halves))

        # All cells with the same rows in one product: fewer operations to build, and quicker ones.
        every = ca.horzsplit(parts, parts.shape[1] // len(self._of_cells))
        sums = [added_up(*each) for each in zip(every, self._of_cells, strict=True)]
        at = self.indices[:, first][:, :, None, :], self.indices[:, second][:, :, :, None]
        row, column = (each.ravel() for each in np.broadcast_arrays(*at))
        upper = np.flatnonzero(row <= column)
        return row[upper], column[upper], ca.vertcat(*sums)[upper.tolist()]


def _arranged(matrix: ca.MX, order: Indices, columns: int) -> ca.MX:
    """Return the entries of a dense matrix in another order, by columns, as so many columns."""
    entries = ca.densify(matrix).nz[order.ravel().tolist()]
    return ca.reshape(entries, entries.numel() // columns, columns)


def _product(matrix: ca.MX, factors: Array) -> ca.MX:
    few = np.count_nonzero(factors) < _SPARSE * factors.size
    return ca.densify(ca.mtimes(matrix, ca.sparsify(ca.DM(factors)) if few else factors, *_BLAS))


def _halves(
    n: int, pairs: Sequence[tuple[int, int]], pattern: tuple[Indices, Indices]
) -> tuple[ca.DM, ca.DM]:
    """Turn entries of H into half of (H_st + H_st')/2 and (H_st - H_st')/2, and back.

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


def as_dm(matrix: Any) -> ca.DM:
    """Return a sparse matrix of SciPy as one of CasADi."""
    matrix = scipy.sparse.csc_array(matrix)
    matrix.sum_duplicates()
    rows, columns = matrix.shape
    pattern = ca.Sparsity(rows, columns, matrix.indptr.tolist(), matrix.indices.tolist())
    return ca.DM(pattern, matrix.data)
