"""Polynomials in cells as linear maps: values and slopes at points, from coordinates at nodes."""

from __future__ import annotations

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
    """

    indices: Indices  # indices of the coordinates at the nodes in x, (cells, nodes, n)
    rows: Array  # (points, r, nodes), or of every cell (cells, points, r, nodes)
    # indices in x of what all instances share, below those of the nodes
    shared: tuple[int, ...] = ()

    @property
    def matrix(self) -> tuple[Indices, Indices, Array]:
        """Rows, columns and entries of the matrix from x to the variables of all instances."""
        (cells, _, n) = self.indices.shape
        (points, rows, _) = self.rows.shape[-3:]
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
        (row, i) = np.divmod(pattern[0], n)
        to = pattern[1]
        places = []
        found = []
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

        With blocks H_st of rows s and t, the block of nodes a and b is the sum over k, s and t of
        A_sa A_tb H_st, one product of dense matrices for all cells with the same rows.
        """
        (_, nodes, n) = self.indices.shape
        (points, rows, _) = self.rows.shape[-3:]
        first, second = np.triu_indices(nodes)  # the pairs (a, b) of a cell's nodes with a <= b
        height = len(pattern[0])
        place = np.full((rows * n, rows * n), height)
        place[pattern] = place[pattern[::-1]] = np.arange(height)
        if np.any(place == height):
            entries = ca.vertcat(entries, ca.MX.zeros(1, entries.shape[1]))
        height = entries.shape[0]
        by_rows = place.reshape(rows, n, rows, n).transpose(0, 2, 3, 1)[:, :, None]  # s, t, 1, j, i

        def added_up(entries: ca.MX, of: Array) -> ca.MX:
            """Return the blocks of all pairs of nodes, of cells with these rows (points, r, nodes):
            by columns a pair, a cell, j and i.
            """
            column = np.arange(entries.shape[1]).reshape(-1, points).T
            at = height * column[:, None, None, :, None, None] + by_rows
            factors = of[:, :, None, first] * of[:, None, :, second]
            factors = factors.reshape(-1, first.size)
            return _product(_arranged(entries, at, len(factors)), factors)

        # All cells with the same rows in one product: fewer operations to build, and quicker ones.
        alike = self.indices.reshape(len(self._of_cells), -1, nodes, n)
        every = ca.horzsplit(entries, entries.shape[1] // len(alike))
        sums = [ca.vec(added_up(*each)) for each in zip(every, self._of_cells, strict=True)]
        row = alike[:, :, first].transpose(0, 2, 1, 3)[:, :, :, None, :]
        column = alike[:, :, second].transpose(0, 2, 1, 3)[:, :, :, :, None]
        row, column = (each.ravel() for each in np.broadcast_arrays(row, column))
        upper = np.flatnonzero(row <= column)
        return row[upper], column[upper], ca.vertcat(*sums)[upper.tolist()]


def _arranged(matrix: ca.MX, order: Indices, columns: int) -> ca.MX:
    """Return the entries of a dense matrix in another order, by columns, as so many columns."""
    entries = ca.densify(matrix).nz[order.ravel().tolist()]
    return ca.reshape(entries, entries.numel() // columns, columns)


def _product(matrix: ca.MX, factors: Array) -> ca.MX:
    few = np.count_nonzero(factors) < _SPARSE * factors.size
    return ca.densify(ca.mtimes(matrix, ca.sparsify(ca.DM(factors)) if few else factors, *_BLAS))


def as_dm(matrix: Any) -> ca.DM:
    """Return a sparse matrix of SciPy as one of CasADi."""
    matrix = scipy.sparse.csc_array(matrix)
    matrix.sum_duplicates()
    rows, columns = matrix.shape
    pattern = ca.Sparsity(rows, columns, matrix.indptr.tolist(), matrix.indices.tolist())
    return ca.DM(pattern, matrix.data.tolist())
