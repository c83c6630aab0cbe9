"""Quintic Hermite interpolation of sampled positions, velocities and accelerations."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array

# Powers of s in [0, 1] of the quintic with q, h q', h^2 q'' at 0 and 1: coefficients (6, 6).
_ENDS = np.array(
    [
        [1, 0, 0, 0, 0, 0],
        [0, 1, 0, 0, 0, 0],
        [0, 0, 2, 0, 0, 0],
        [1, 1, 1, 1, 1, 1],
        [0, 1, 2, 3, 4, 5],
        [0, 0, 2, 6, 12, 20],
    ],
    dtype=float,
)
_COEFFICIENTS = np.linalg.inv(_ENDS)


def quintic_hermite(
    time: Array, positions: Array, velocities: Array, accelerations: Array, instants: Array
) -> tuple[Array, Array, Array, Array]:
    """Positions and their first three derivatives (m, n) at instants (m,) within increasing times.

    The interpolant is twice continuously differentiable; its error is of order six in the step.
    """
    interval = np.clip(np.searchsorted(time, instants, side="right") - 1, 0, len(time) - 2)
    step = np.diff(time)[interval][:, None]
    s = (instants[:, None] - time[interval][:, None]) / step
    start = positions[interval]  # subtracted, so that no digits of short intervals are lost
    ends = np.stack(
        [
            np.zeros_like(start),
            step * velocities[interval],
            step**2 * accelerations[interval],
            positions[interval + 1] - start,
            step * velocities[interval + 1],
            step**2 * accelerations[interval + 1],
        ]
    )
    powers = np.einsum("ab,bmn->amn", _COEFFICIENTS, ends)
    results = []
    for order in range(4):
        value = np.zeros_like(start)
        for power in range(5, order - 1, -1):
            factor = float(np.prod(np.arange(power - order + 1, power + 1)))
            value = value * s + factor * powers[power]
        results.append(value / step**order)
    results[0] = results[0] + start
    return results[0], results[1], results[2], results[3]
