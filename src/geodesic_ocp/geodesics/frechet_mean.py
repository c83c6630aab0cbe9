"""The Fréchet mean of points of a manifold."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.geodesics.log import log
from geodesic_ocp.manifold.exp import exp
from geodesic_ocp.manifold.metric import Metric, as_metric

# Logarithms are right to 1e-9; the condition is met to this share of the points' spread.
_TOLERANCE = 1e-8
_MAX_STEPS = 100
_SMALLEST_STEP = 1e-3


def frechet_mean(metric: Metric, points: ArrayLike, weights: ArrayLike | None = None) -> Array:
    """Fréchet mean (n,) of k points (k, n): where sum_i w_i d(x, x_i)^2 is least.

    Its first-order condition is sum_i w_i Log_x(x_i) = 0 (Karcher, "Riemannian center of mass and
    mollifier smoothing", 1977). The iteration steps along that sum, from the mean of the
    coordinates, and ends where it is at most 1e-8 of the points' spread. Of points that are far
    apart, in a space of positive curvature, there can be several such x; this is one of them.

    Points are taken as they are, also where coordinates come round (`Metric.periods`).

    Args:
        metric: of the manifold.
        points: k points, at least one.
        weights: k numbers above zero, of which only the ratios count; None: all the same.

    Raises:
        ValueError: wrong shapes or values, or a point where there is no metric.
        NotConverged: a logarithm was not found, or the condition was not met.
    """
    n = as_metric(metric).dim
    many = np.array(points, dtype=float)
    if many.ndim != 2 or many.shape[1] != n or len(many) == 0:
        raise ValueError(f"points must have shape (k, {n}) with k > 0, got {many.shape}")
    for index, point in enumerate(many):
        metric.point(f"points[{index}]", point)
    shares = np.ones(len(many)) if weights is None else np.array(weights, dtype=float)
    if shares.shape != (len(many),) or not np.all(np.isfinite(shares)) or np.any(shares <= 0.0):
        raise ValueError(f"weights must be {len(many)} finite numbers above zero, got {weights!r}")
    shares = shares / shares.sum()

    x: Array = shares @ many
    step, smallest = 1.0, np.inf
    origin = direction = x
    for _ in range(_MAX_STEPS):
        logs = np.array([log(metric, x, point) for point in many])
        gradient = shares @ logs
        spread = max(metric.norm(x, each) for each in logs)
        size = metric.norm(x, gradient)
        if size <= _TOLERANCE * spread:
            return x
        if size < smallest:
            smallest, origin, direction = size, x, gradient
        else:  # too far: back, and half the way
            step /= 2.0
            if step < _SMALLEST_STEP:
                break
        x = exp(metric, origin, step * direction)
    raise NotConverged(
        f"no mean was found of {len(many)} points: at {origin} the mean of the logarithms is still "
        f"{smallest:.1e} long, of {spread:.1e} to the farthest point. They may lie too far apart to"
        " have one."
    )
