"""Derivatives of the program of a fit as sparse matrices, from those of its segments.

The parameters come first in the order of the variables, and then the segments, num_x variables and
m equations each. Segments share the parameters only.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array


def triangle(size: int) -> np.ndarray:
    """Rows and columns (2, size (size + 1) / 2) of an upper triangle, columns first."""
    return np.array([(i, j) for j in range(size) for i in range(j + 1)]).reshape(-1, 2).T


def place_jacobian(blocks: ca.MX, units: Array, m: int, num_x: int) -> ca.MX:
    """The derivative of the equations of all segments.

    Args:
        blocks: of a segment's equations by the p parameters and its nodes, columns first, one
            column a segment (m (p + nodes), segments).
        units: of the parameters (p,).
        m, num_x: numbers of equations and variables of a segment.
    """
    p, total = units.size, blocks.shape[1]
    nodes = blocks.shape[0] // m - p
    by_theta = [ca.vec(blocks[k * m : (k + 1) * m, :]) * float(units[k]) for k in range(p)]
    entries = ca.vertcat(*by_theta, ca.vec(blocks[p * m :, :]))
    segment = np.arange(total)[:, None, None]
    shape, within = (total, nodes, m), np.arange(nodes)[None, :, None]
    rows = np.broadcast_to(segment * m + np.arange(m), shape).ravel()
    columns = np.broadcast_to(p + segment * num_x + within, shape).ravel()
    return _sparse(
        (m * total, p + num_x * total),
        np.concatenate([np.tile(np.arange(m * total), p), rows]),
        np.concatenate([np.repeat(np.arange(p), m * total), columns]),
        entries,
    )


def place_hessian(
    triangles: Sequence[tuple[ca.MX, ca.MX]], units: Array, num_x: int, diagonal: ca.MX
) -> ca.MX:
    """Upper triangle of the Hessian of the Lagrangian.

    Args:
        triangles: of each recording, upper triangles of the Hessians of the errors by a segment's
            variables, and of the equations by the p parameters and the nodes, one column a segment.
        units: of the parameters (p,).
        num_x: number of variables of a segment.
        diagonal: added to the diagonal of the parameters (p, 1).
    """
    p = units.size
    size = p + num_x
    row, column = triangle(num_x)
    place = ca.DM.triplet(
        ((column + p) * (column + p + 1) // 2 + row + p).tolist(),
        list(range(row.size)),
        np.ones(row.size),
        size * (size + 1) // 2,
        row.size,
    )
    scales = np.concatenate([units, np.ones(num_x)])
    row, column = triangle(size)
    scale = ca.DM(scales[row] * scales[column])
    combined = []
    for of_errors, of_equations in triangles:
        more = ca.MX.zeros(row.size - of_equations.shape[0], of_errors.shape[1])
        whole = place @ of_errors + ca.vertcat(of_equations, more)
        combined.append(whole * ca.repmat(scale, 1, whole.shape[1]))
    every = ca.horzcat(*combined)
    first = triangle(p)
    corner, total = first.shape[1], every.shape[1]
    on_diagonal = ca.DM((first[1] == np.arange(p)[:, None]) * (first[0] == first[1]) * 1.0)
    of_parameters = ca.sum2(every[:corner, :]) + on_diagonal.T @ diagonal
    row, column = row[corner:], column[corner:]
    shift = num_x * np.arange(total)[:, None]
    return _sparse(
        (p + num_x * total,) * 2,
        np.concatenate([first[0], np.where(row < p, row, row + shift).ravel()]),
        np.concatenate([first[1], (column + shift).ravel()]),
        ca.vertcat(of_parameters, ca.vec(every[corner:, :])),
    )


def _sparse(shape: tuple[int, int], rows: np.ndarray, columns: np.ndarray, entries: ca.MX) -> ca.MX:
    """The matrix with these entries."""
    order = np.lexsort((rows, columns))  # CasADi's order, columns first
    pattern = ca.Sparsity.triplet(*shape, rows[order].tolist(), columns[order].tolist())
    assert pattern.nnz() == rows.size
    if np.array_equal(order, np.arange(rows.size)):
        return ca.MX(pattern, entries)
    return ca.MX(pattern, entries[order.tolist()])
