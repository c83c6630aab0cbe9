"""Motions in time as nonlinear programs: polynomials between knots, and blocks at points of them.

The variables are those of core/motion.h: position and velocity of a knot, then the coefficients of
the segment after it, and so on. Positions are polynomials of degree 3 + bubbles in each segment,
once continuously differentiable at the knots.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.motion_kernels import SegmentBasis


def state_matrix(basis: SegmentBasis, times: Array, dim: int, at: Array) -> scipy.sparse.csr_array:
    """Return the matrix from a motion's variables to (q, q', q'') at some instants.

    Args:
        basis: polynomials of each segment.
        times: of the knots (k + 1,) [s].
        dim: number n of coordinates.
        at: increasing (m,) [s]; at a knot, q'' is that of the segment after it.

    Returns:
        A matrix of 3 n rows for each instant.
    """
    width, durations = 2 + basis.bubbles, np.diff(times)
    order = [0, 1, *range(4, width + 2), 2, 3]  # of the functions by their variables
    segment = np.searchsorted(times[1:-1], at, "right")
    rows = scipy.sparse.lil_array((3 * at.size, width * durations.size + 2))
    for k in np.unique(segment):
        here, duration = np.flatnonzero(segment == k), durations[k]
        scale = np.ones(width + 2)
        scale[[1, 3]] = duration
        s = (at[here] - times[k]) / duration
        values = [basis.values(s, d) * scale[:, None] / duration**d for d in range(3)]
        local = np.stack(values, axis=-1)[order].transpose(1, 2, 0).reshape(-1, width + 2)
        rows[3 * here[0] : 3 * here[-1] + 3, k * width : (k + 1) * width + 2] = local
    return scipy.sparse.csr_array(scipy.sparse.kron(rows, scipy.sparse.eye_array(dim)))


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
    q, v = knots[:, :n], knots[:, n:]
    ends = [q[:-1], durations * v[:-1], q[1:], durations * v[1:]]
    segments = np.concatenate([np.stack(ends, axis=1), coefficients], axis=1)
    halves = np.stack([half @ segments for half in basis.halves], axis=1)
    halves = halves.reshape(-1, *halves.shape[2:])
    starts = np.hstack([halves[:, 0], halves[:, 1] / np.repeat(durations / 2.0, 2, axis=0)])
    middles = np.stack([times[:-1], (times[:-1] + times[1:]) / 2.0], axis=1)
    return np.append(middles, times[-1]), np.vstack([starts, knots[-1]]), halves[:, 4:]
