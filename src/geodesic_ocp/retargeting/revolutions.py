"""Continuous joints between configurations: the shorter way around, within the limits."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metrics import metric_of
from geodesic_ocp.model.model import Model


@lru_cache(maxsize=32)
def periods(arm: Model, limited: bool) -> Array:
    """Return the periods (n,) of the joints: 2 pi for continuous ones, infinite for others.

    With limits, a joint must have a range of a revolution, so that there is a way to go around.
    """
    period = np.array(metric_of(arm).periods)
    if not limited:
        return period
    return np.where(arm.upper - arm.lower >= period, period, np.inf)


def shorter_way(change: Array, period: Array) -> Array:
    """Return changes (..., n) of joints with these periods (n,), by less than half of them."""
    return change - np.where(np.isfinite(period), period, 0.0) * np.round(change / period)


def unwrapped(q: Array, period: Array, bounds: tuple[Array, Array], middle: Array | None) -> Array:
    """Return configurations (m, n) with every joint turned the shorter way from one to the next.

    A joint that would leave its limits on the way keeps its coordinates.

    Args:
        q: configurations.
        period: periods of the joints (n,), infinite if they are not periodic.
        bounds: lower and upper limits (n,).
        middle: middle of the joints' ranges (n,), which joints come near to by whole revolutions;
            None: the first configuration stays as it is.
    """
    steps = shorter_way(np.diff(q, axis=0), period)
    result = np.vstack([q[:1], q[0] + np.cumsum(steps, axis=0)])
    if middle is not None:
        centre = (result.min(axis=0) + result.max(axis=0)) / 2.0
        result += middle + shorter_way(centre - middle, period) - centre
    lower, upper = bounds
    within = np.all((lower <= result) & (result <= upper), axis=0)
    return np.where(within & np.isfinite(period), result, q)
