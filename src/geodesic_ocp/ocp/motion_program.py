"""Motions in time as nonlinear programs: polynomials between knots, and blocks at points of them.

The variables are those of core/motion.h: position and velocity of a knot, then the coefficients of
the segment after it, and so on. Positions are polynomials of degree 3 + bubbles in each segment,
once continuously differentiable at the knots.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse

from geodesic_ocp.arrays import Array
from geodesic_ocp.cells import Cells
from geodesic_ocp.manifold.motion_kernels import SegmentBasis


def state_matrix(
    basis: SegmentBasis,
    times: Array,
    dim: int,
    at: Array,
    orders: Sequence[int] = (0, 1, 2),
    *,
    before: bool = False,
) -> scipy.sparse.csr_array:
    """Return the matrix from a motion's variables to (q, q', q'') at some instants.

    Args:
        basis: polynomials of each segment.
        times: of the knots (k + 1,) [s].
        dim: number n of coordinates.
        at: increasing (m,) [s]; at a knot, derivatives are those of the segment after it.
        orders: of the derivatives that are wanted.
        before: at a knot, derivatives are those of the segment before it.

    Returns:
        A matrix of n rows for each instant and order.
    """
    width = 2 + basis.bubbles
    durations = np.diff(times)
    segment = np.searchsorted(times[1:-1], at, "left" if before else "right")
    rows = scipy.sparse.lil_array((len(orders) * at.size, width * durations.size + 2))
    for k in np.unique(segment):
        here = np.flatnonzero(segment == k)
        values = _values(basis, (at[here] - times[k]) / durations[k], orders)
        local = _rows(values, durations[k], orders)
        own = slice(len(orders) * here[0], len(orders) * (here[-1] + 1))
        rows[own, k * width : (k + 1) * width + 2] = local.reshape(-1, width + 2)
    return scipy.sparse.csr_array(scipy.sparse.kron(rows, scipy.sparse.eye_array(dim)))


def state_cells(
    basis: SegmentBasis, times: Array, dim: int, s: Array, orders: Sequence[int] = (0, 1, 2)
) -> Cells:
    """Return the maps of `state_matrix` at the fractions s of all segments, cell by cell."""
    width = 2 + basis.bubbles
    durations = np.diff(times)
    first = width * np.arange(durations.size)[:, None, None]
    nodes = first + np.arange(width + 2)[:, None]
    values = _values(basis, s, orders)
    rows = np.array([_rows(values, duration, orders) for duration in durations])
    return Cells(dim * nodes + np.arange(dim), rows)


def _values(basis: SegmentBasis, s: Array, orders: Sequence[int]) -> Array:
    """Return derivatives of a segment's functions (k, orders, functions) at fractions s (k,).

    The functions are in the order of the variables: the segment's own before those of its end.
    """
    order = [0, 1, *range(4, 4 + basis.bubbles), 2, 3]
    return np.stack([basis.values(s, d) for d in orders])[:, order].transpose(2, 0, 1)


def _rows(values: Array, duration: float, orders: Sequence[int]) -> Array:
    """Return `_values` for a segment of this duration, by its variables."""
    scale = np.ones(values.shape[2])
    scale[[1, -1]] = duration  # velocities
    return np.asarray(values * scale / duration ** np.array(orders)[:, None])


def instants(times: Array, s: Array) -> Array:
    """Return the times of fractions s (m,) of all segments, (k m,)."""
    return np.asarray((times[:-1, None] + np.outer(np.diff(times), s)).ravel())


def variables(knots: Array, coefficients: Array) -> Array:
    """Return a motion's variables from its knots (k + 1, 2 n) and coefficients (k, bubbles, n)."""
    rows = np.hstack([knots[:-1], coefficients.reshape(len(coefficients), -1)])
    return np.append(rows, knots[-1])


def knots_of(x: Array, basis: SegmentBasis, dim: int) -> tuple[Array, Array]:
    """Return knots (k + 1, 2 n) and coefficients (k, bubbles, n) from a motion's variables."""
    rows = x[: -2 * dim].reshape(-1, (2 + basis.bubbles) * dim)
    knots = np.vstack([rows[:, : 2 * dim], x[-2 * dim :]])
    return knots, rows[:, 2 * dim :].reshape(len(rows), basis.bubbles, dim)


def bisected(
    basis: SegmentBasis, times: Array, knots: Array, coefficients: Array
) -> tuple[Array, Array, Array]:
    """Return times, knots and coefficients of the same motion with twice as many segments."""
    n = knots.shape[1] // 2
    durations = np.diff(times)[:, None]
    q = knots[:, :n]
    v = knots[:, n:]
    ends = [q[:-1], durations * v[:-1], q[1:], durations * v[1:]]
    segments = np.concatenate([np.stack(ends, axis=1), coefficients], axis=1)
    halves = np.stack([half @ segments for half in basis.halves], axis=1)
    halves = halves.reshape(-1, *halves.shape[2:])
    starts = np.hstack([halves[:, 0], halves[:, 1] / np.repeat(durations / 2.0, 2, axis=0)])
    middles = np.stack([times[:-1], (times[:-1] + times[1:]) / 2.0], axis=1)
    return np.append(middles, times[-1]), np.vstack([starts, knots[-1]]), halves[:, 4:]
