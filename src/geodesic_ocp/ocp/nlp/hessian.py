"""Hessians of the NLP, assembled from those of single nodes."""

from __future__ import annotations

import casadi as ca
import numpy as np

from geodesic_ocp.trajectory.grid import Grid


def segment_matrices(grid: Grid) -> tuple[ca.DM, ca.DM]:
    """E and D, sparse (collocations, nodes): values and slopes at each segment's own nodes."""
    width = grid.degree + 1
    select, differentiate = (ca.DM(grid.collocations, grid.size) for _ in range(2))
    for segment in range(grid.segments):
        rows = slice(segment * width, (segment + 1) * width)
        columns = slice(segment * grid.degree, segment * grid.degree + width)
        select[rows, columns] = ca.DM.eye(width)
        differentiate[rows, columns] = ca.DM(grid.differentiation[segment])
    return select, differentiate


def assemble(blocks: ca.MX, grid: Grid, n: int) -> ca.MX:
    """Upper triangle of sum_k [E_k; D_k]' H_k [E_k; D_k] from vec(H_k), (4 n^2, collocations)."""
    width = grid.degree + 1
    slope = grid.differentiation[0]
    first, second = np.triu_indices(width)  # the pairs (a, b) of a segment's nodes with a <= b
    nodes = np.arange(width)[:, None]
    at_first, at_second = (nodes == first).astype(float), (nodes == second).astype(float)
    along_first, along_second = slope[:, first], slope[:, second]
    products = [
        at_first * at_second,  # q q
        along_first * at_second,  # v q
        at_first * along_second,  # q v
        along_first * along_second,  # v v
    ]
    # Rows of vec(H_k) by the four quarters of H_k, in the order of the products.
    entry_of = np.arange(4 * n * n).reshape(2 * n, 2 * n, order="F")
    quarters = [entry_of[:n, :n], entry_of[n:, :n], entry_of[:n, n:], entry_of[n:, n:]]

    # Entry (a, i), (b, j) of the segment's matrix lies in row (i, j), column (a, b) of the sum.
    row = (n * first)[None, None, :] + np.arange(n)[:, None, None]
    column = (n * second)[None, None, :] + np.arange(n)[None, :, None]
    row, column = np.broadcast_arrays(row, column)
    entry = np.arange(n * n)[:, None] + n * n * np.arange(first.size)
    entry = entry.reshape(n, n, first.size, order="F")
    upper = row <= column
    total = ca.MX(n * grid.size, n * grid.size)
    for segment in range(grid.segments):
        here = blocks[:, segment * width : (segment + 1) * width]
        steeper = grid.widths[0] / grid.widths[segment]  # slopes than in the first segment
        powers = (1.0, steeper, steeper, steeper**2)
        sums = sum(
            here[quarter.ravel(order="F").tolist(), :] @ ca.sparsify(ca.DM(power * product))
            for quarter, product, power in zip(quarters, products, powers, strict=True)
        )
        shift = segment * grid.degree * n
        sparsity, mapping = _triplets(
            row[upper] + shift, column[upper] + shift, n * grid.size, entry[upper]
        )
        total += ca.MX(sparsity, ca.vec(ca.densify(sums))[mapping])
    return total


def _triplets(
    rows: np.ndarray, columns: np.ndarray, size: int, entries: np.ndarray
) -> tuple[ca.Sparsity, list[int]]:
    """Sparsity of these entries, and their indices in its order (columns first)."""
    order = np.lexsort((rows, columns))
    sparsity = ca.Sparsity.triplet(size, size, rows[order].tolist(), columns[order].tolist())
    return sparsity, entries[order].tolist()


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
