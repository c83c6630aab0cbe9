"""Sparse matrices of CasADi from entries at given places."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.int64]


def placed(shape: tuple[int, int], rows: Index, columns: Index, entries: ca.MX) -> ca.MX:
    """The matrix with these entries, each at a place of its own."""
    order = np.lexsort((rows, columns))  # CasADi's order, columns first
    pattern = ca.Sparsity.triplet(*shape, rows[order].tolist(), columns[order].tolist())
    return ca.MX(pattern, entries[order.tolist()])


def constant(shape: tuple[int, int], rows: Index, columns: Index, entries: object) -> ca.DM:
    """The numerical matrix with these entries; those at one place are added."""
    values = np.asarray(entries, dtype=float)
    kept = values != 0.0
    return ca.DM.triplet(rows[kept].tolist(), columns[kept].tolist(), ca.DM(values[kept]), *shape)


def blocks_on_diagonal(shape: tuple[int, int], starts: Index, size: int, blocks: ca.MX) -> ca.MX:
    """Upper triangles of square blocks (size^2, k), columns first, on the diagonal at k starts."""
    column, row = (each.ravel() for each in np.indices((size, size)))
    kept = np.flatnonzero(row <= column)
    rows = (starts[:, None] + row[kept]).ravel()
    columns = (starts[:, None] + column[kept]).ravel()
    return placed(shape, rows, columns, ca.vec(blocks[kept.tolist(), :]))
