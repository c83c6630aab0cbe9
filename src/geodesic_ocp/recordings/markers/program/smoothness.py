"""Accelerations and jerks of sampled coordinates as a quadratic form."""

from __future__ import annotations

import numpy as np
import scipy

from geodesic_ocp.arrays import Array


def sample_shares(time: Array) -> Array:
    """The time (k,) [s] that each sample stands for: half of that to its neighbours."""
    steps = np.diff(time)
    shares: Array = np.convolve(steps, [0.5, 0.5])
    return shares


def roughness(time: Array, orders: dict[int, float]) -> scipy.sparse.csc_matrix:
    """Matrix R (k, k) with x' R x = sum over the orders n of the integral of (x^(n) / s_n)^2 dt.

    Derivatives are divided differences of the samples, so that the integral hardly depends on the
    sampling rate, and samples may be unevenly spaced.

    Args:
        time: increasing (k,) [s].
        orders: the expected size s_n of the derivative of every order n.
    """
    count = time.size
    total = scipy.sparse.csc_matrix((count, count))
    for order, size in orders.items():
        if count <= order:
            continue
        difference = scipy.sparse.identity(count, format="csc")
        for step in range(1, order + 1):
            weights = scipy.sparse.diags(step / (time[step:] - time[:-step]))
            difference = weights @ (difference[1:] - difference[:-1])
        widths = time[order:] - time[:-order]
        widths *= (time[-1] - time[0]) / widths.sum()
        total = total + difference.T @ scipy.sparse.diags(widths / size**2) @ difference
    return scipy.sparse.csc_matrix(total)
