"""Hessians of the NLP, assembled from those at single points of its segments."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.trajectory.grid import Grid

_SPARSE = 0.5  # matrices with a smaller fraction of entries other than zero are stored as sparse
# CasADi's own product of dense matrices is several times slower.
_BLAS = ("classic",) if getattr(ca, "has_blas", lambda _: False)("classic") else ()


def segment_matrices(grid: Grid, values: Array, slopes: Array) -> tuple[ca.DM, ca.DM]:
    """E and D, sparse (segments * m, nodes): values and slopes at m points of each segment.

    Args:
        grid: of the nodes.
        values: (m, degree + 1), from the values at a segment's nodes to those at its points.
        slopes: (segments, m, degree + 1), to the derivatives by s at its points.
    """
    segments, m, width = slopes.shape
    row, column = np.indices((segments * m, width))
    column += grid.degree * (row // m)
    size = (segments * m, grid.size)
    every = np.tile(values, (segments, 1)), slopes.reshape(-1, width)
    value, slope = (_sparse(row, column, entries, size) for entries in every)
    return value, slope


def assemble(blocks: ca.MX, grid: Grid, values: Array, slopes: Array, n: int) -> ca.MX:
    """Upper triangle of sum_k [E_k; D_k]' H_k [E_k; D_k] from vec(H_k), (4 n^2, segments * m).

    With H_k = [Q C'; C V], the block of nodes a and b is the sum over k of

        e_a e_b Q + (d_a e_b + e_a d_b) (C + C')/2 + d_a d_b V + (d_a e_b - e_a d_b) (C - C')/2.

    Three terms are symmetric and one is antisymmetric, so that half of their entries suffice.
    Values and slopes are those of `segment_matrices`, of whose rows e and d are entries.
    """
    segments, m, width = slopes.shape
    first, second = np.triu_indices(width)  # the pairs (a, b) of a segment's nodes with a <= b
    half = n * (n + 1) // 2
    split, join = _halves(n)
    parts = split @ blocks
    sums = []
    for segment in range(segments):
        here = parts[:, segment * m : (segment + 1) * m]
        symmetric = ca.horzcat(*(here[k * half : (k + 1) * half, :] for k in range(3)))
        e, d = values, slopes[segment]
        de, ed = d[:, first] * e[:, second], e[:, first] * d[:, second]
        products = np.vstack([e[:, first] * e[:, second], de + ed, d[:, first] * d[:, second]])
        both = _product(symmetric, products), _product(here[3 * half :, :], de - ed)
        sums.append(ca.vec(join @ ca.vertcat(*both)))
    # Segments share nodes with their neighbours alone.
    odd = ca.vertcat(ca.MX(0, 1), *sums[1::2])
    return _placed(ca.vertcat(*sums[::2]), grid, n, 0) + _placed(odd, grid, n, 1)


def _product(matrix: ca.MX, factors: Array) -> ca.MX:
    few = np.count_nonzero(factors) < _SPARSE * factors.size
    return ca.densify(ca.mtimes(matrix, ca.sparsify(ca.DM(factors)) if few else factors, *_BLAS))


def _halves(n: int) -> tuple[ca.DM, ca.DM]:
    """From vec(H_k) to half of the entries of Q, (C + C')/2, V and (C - C')/2, and back.

    The second matrix joins the halves of a symmetric and an antisymmetric matrix to their sum, in
    the order of columns.
    """
    entry = np.arange(4 * n * n).reshape(2 * n, 2 * n, order="F")
    upper, strict = np.triu_indices(n), np.triu_indices(n, 1)
    position, velocity, mixed = entry[:n, :n], entry[n:, n:], entry[n:, :n]
    unit = np.eye(4 * n * n)
    split = [unit[each[upper]] + unit[each.T[upper]] for each in (position, mixed, velocity)]
    split.append(unit[mixed[strict]] - unit[mixed.T[strict]])
    entry, unit = np.arange(n * n).reshape(n, n, order="F"), np.eye(n * n)
    join = [np.maximum(unit[entry[upper]], unit[entry.T[upper]])]
    join.append(unit[entry[strict]] - unit[entry.T[strict]])
    return ca.sparsify(ca.DM(np.vstack(split) / 2.0)), ca.sparsify(ca.DM(np.vstack(join).T))


def _placed(blocks: ca.MX, grid: Grid, n: int, start: int) -> ca.MX:
    """Upper triangle from the blocks, by columns, of every second segment's pairs of nodes."""
    first, second = np.triu_indices(grid.degree + 1)
    shift = grid.degree * np.arange(start, grid.segments, 2)[:, None]
    row = n * (shift + first)[:, :, None, None] + np.arange(n)
    column = n * (shift + second)[:, :, None, None] + np.arange(n)[:, None]
    row, column = (each.ravel() for each in np.broadcast_arrays(row, column))
    entry = np.flatnonzero(row <= column)
    entry = entry[np.lexsort((row[entry], column[entry]))]  # CasADi's order, columns first
    size = (n * grid.size, n * grid.size)
    pattern = ca.Sparsity.triplet(*size, row[entry].tolist(), column[entry].tolist())
    return ca.MX(pattern, blocks[entry.tolist()])


def _sparse(
    row: NDArray[np.int64], column: NDArray[np.int64], entries: Array, size: tuple[int, int]
) -> ca.DM:
    """The matrix with these entries at (row, column), without its zeros."""
    kept = entries != 0.0
    return ca.DM.triplet(row[kept].tolist(), column[kept].tolist(), entries[kept], *size)


def on_diagonal(blocks: ca.MX, grid: Grid, n: int) -> ca.MX:
    """Block-diagonal matrix of vec(H_k), (n^2, nodes)."""
    return ca.diagcat(*(ca.reshape(blocks[:, k], n, n) for k in range(grid.size)))


def on_node(block: ca.MX, grid: Grid, n: int, node: int) -> ca.MX:
    """vec(H), (n^2, 1), of one node, as of all nodes."""
    rows = np.zeros((1, grid.size))
    rows[0, node] = 1.0
    return _spread(ca.reshape(block, n, n), rows)


def on_ends(block: ca.MX, grid: Grid, n: int) -> ca.MX:
    """vec(H), (16 n^2, 1), of positions and velocities at both ends, as of all nodes."""
    width = grid.degree + 1
    rows = np.zeros((4, grid.size))
    rows[0, 0] = rows[1, -1] = 1.0
    rows[2, :width] = grid.differentiation[0][0]
    rows[3, -width:] = grid.differentiation[-1][-1]
    return _spread(ca.reshape(block, 4 * n, 4 * n), rows)


def _spread(matrix: ca.MX, rows: np.ndarray) -> ca.MX:
    """The Hessian in what each of the rows makes of all nodes, as one in the nodes."""
    n = matrix.shape[0] // len(rows)
    to_rows = ca.sparsify(ca.DM(np.kron(rows, np.eye(n))))
    return to_rows.T @ matrix @ to_rows
