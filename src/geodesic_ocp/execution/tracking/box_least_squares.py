"""Least squares between bounds: a strictly convex quadratic program in a few variables."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged

_ROUNDS = 10  # changes of the set of bounds for each variable


def box_least_squares(hessian: Array, gradient: Array, lower: Array, upper: Array) -> Array:
    """The x (n,) that minimizes x' H x / 2 + g' x subject to lower <= x <= upper.

    By the active set method of Stark and Parker, "Bounded-variable least-squares", Computational
    Statistics 10 (1995): the objective decreases from one set of bounds to the next, so that the
    solution is found after finitely many.

    Args:
        hessian: H, symmetric and positive definite (n, n).
        gradient: g (n,).
        lower, upper: bounds (n,), which may be infinite or equal.

    Raises:
        NotConverged: too many sets of bounds, from rounding.
    """
    free = upper > lower
    x = np.clip(np.linalg.solve(hessian, -gradient), lower, upper)
    at_lower, at_upper = x <= lower, x >= upper
    free &= ~(at_lower | at_upper)
    tolerance = 1e-12 * (1.0 + np.abs(gradient).max())
    for _ in range(_ROUNDS * gradient.size):
        # To the minimum over the free variables, or to the first bound on the way there.
        while free.any():
            held = gradient[free] + hessian[np.ix_(free, ~free)] @ x[~free]
            wanted = np.linalg.solve(hessian[np.ix_(free, free)], -held)
            change = wanted - x[free]
            bound = np.where(change > 0.0, upper[free], lower[free])
            room = np.full(change.size, np.inf)
            np.divide(bound - x[free], change, out=room, where=change != 0.0)
            step = room.min()
            if step >= 1.0:
                x[free] = wanted
                break
            indices = np.flatnonzero(free)
            x[indices] += max(step, 0.0) * change
            first = indices[room <= step]
            x[first] = bound[room <= step]
            free[first] = False
        slope = hessian @ x + gradient
        inward = np.where(x <= lower, -slope, np.where(x >= upper, slope, 0.0))
        inward[free | (upper <= lower)] = 0.0
        best = int(np.argmax(inward))
        if inward[best] <= tolerance:
            return np.asarray(np.clip(x, lower, upper))
        free[best] = True
    raise NotConverged("the least-squares problem of a step was not solved: rescale it")
