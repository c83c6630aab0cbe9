"""The Fréchet mean of points of a manifold."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, real_array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.logarithm.log import log
from geodesic_ocp.manifold.exp import exp
from geodesic_ocp.manifold.metric import Metric, as_metric

# Logarithms are accurate to 1e-9; the condition is met relative to the points' spread.
_TOLERANCE = 1e-8
# Means of equal points, or nearly equal ones, are as exact as their coordinates.
_ROUNDING = 4.0 * np.finfo(float).eps
_MAX_STEPS = 100
_SMALLEST_STEP = 1e-3


def frechet_mean(metric: Metric, points: ArrayLike, weights: ArrayLike | None = None) -> Array:
    """Fréchet mean (n,) of k points (k, n): the x that minimizes sum_i w_i d(x, x_i)^2.

    Its first-order condition is sum_i w_i Log_x(x_i) = 0 (Karcher, "Riemannian center of mass and
    mollifier smoothing", 1977). The gradient descent along that sum starts from the mean of the
    coordinates, and ends where the sum is at most 1e-8 of the points' spread. In a space of
    positive curvature, points that are far apart can have several means; this is one of them.

    Points are taken as they are, also where coordinates are periodic (`Metric.periods`).

    >>> import geodesic_ocp as go
    >>> metric = go.KineticEnergy(go.human_arm())
    >>> q0, q1 = [0.0, 0.1, -0.5, 0.8, 0.0, 0.0, 0.0], [0.6, 0.2, -0.9, 1.4, 0.1, 0.0, 0.1]
    >>> go.frechet_mean(metric, [q0, q1]).round(3)  # of two points: halfway along the geodesic
    array([ 0.185,  0.102, -0.742,  1.445,  0.11 , -0.528,  0.187])

    Args:
        metric: of the manifold.
        points: k points, at least one.
        weights: k positive numbers, of which only the ratios count; None: equal weights.

    Raises:
        ValueError: wrong shapes or values, or a point where the metric is not defined.
        NotConverged: a logarithm was not found, or the condition was not met.
    """
    n = as_metric(metric).dim
    samples = real_array(points, "points")
    if samples.ndim != 2 or samples.shape[1] != n or len(samples) == 0:
        raise ValueError(f"points must have shape (k, {n}) with k > 0, got {samples.shape}")
    for index, point in enumerate(samples):
        metric.point(f"points[{index}]", point)
    w = np.ones(len(samples)) if weights is None else real_array(weights, "weights")
    if w.shape != (len(samples),) or not np.all(np.isfinite(w)) or np.any(w <= 0.0):
        raise ValueError(
            f"weights must be {len(samples)} finite numbers above zero, got {weights!r}"
        )
    w = w / w.sum()

    x: Array = w @ samples
    step, smallest = 1.0, np.inf
    origin = direction = x
    for _ in range(_MAX_STEPS):
        logs = np.array([log(metric, x, point) for point in samples])
        gradient = w @ logs
        spread = max(metric.norm(x, each) for each in logs)
        size = metric.norm(x, gradient)
        if size <= _TOLERANCE * spread or np.all(np.abs(gradient) <= _ROUNDING * np.abs(x).max()):
            return x
        if size < smallest:
            smallest, origin, direction = size, x, gradient
        else:  # a step too far: repeat it with half the size
            step /= 2.0
            if step < _SMALLEST_STEP:
                break
        x = exp(metric, origin, step * direction)
    raise NotConverged(
        f"no mean of {len(samples)} points was found: at {origin} the mean of their logarithms has "
        f"norm {smallest:.1e}, the farthest point is {spread:.1e} away. They may lie too far apart "
        "to have a mean."
    )
