"""The Riemannian distance, of pairs or as a matrix of all pairs, and the Fréchet mean."""

from __future__ import annotations

import re
import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, real_array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.logarithm.images import checked_periods, circular_mean
from geodesic_ocp.logarithm.log import log
from geodesic_ocp.manifold.exp import exp
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.progress import Progress, no_progress, shows_progress

_AT_ONCE = 1024  # pairs of a matrix between two reports of progress
# Of the mean: logarithms are accurate to 1e-9; the condition is met relative to the points' spread.
_TOLERANCE = 1e-8
# Means of equal points, or nearly equal ones, are as exact as their coordinates.
_ROUNDING = 4.0 * np.finfo(float).eps
_MAX_STEPS = 100
_SMALLEST_STEP = 1e-3


@shows_progress
def distance(
    metric: Metric,
    q0: ArrayLike,
    q1: ArrayLike | None = None,
    *,
    num_starts: int = 1,
    seed: int = 0,
    solver: str | None = None,
    wrap: bool = True,
    throw: bool = True,
    progress: Progress | None = None,
) -> Any:
    """Return length |Log_q0(q1)| of the geodesic of `log`, a float; for k pairs an array (k,).

    Without `q1`, the symmetric matrix (k, k) of the distances between k points `q0` (k, n).

    >>> go.distance(go.Euclidean(2), [0.0, 0.0], [3.0, 4.0])
    5.0
    >>> go.distance(go.Euclidean(2), [[0.0, 0.0], [3.0, 4.0], [0.0, 1.0]]).round(2)
    array([[0.  , 5.  , 1.  ],
           [5.  , 0.  , 4.24],
           [1.  , 4.24, 0.  ]])

    Args:
        metric: metric of the manifold.
        q0, q1: points (n,), or k points (k, n).
        num_starts, seed, solver, wrap, throw: see `log`; with `throw=False` distances that are not
            found are NaN.
        progress: of a matrix, called with what is done, the number of pairs, and the total.

    Raises:
        ValueError: as `log`; or without `q1`, not several points.
        NotConverged: as `log`.
    """
    given: dict[str, Any] = {"num_starts": num_starts, "seed": seed, "solver": solver}
    given["wrap"] = wrap
    given["throw"] = throw
    if q1 is None:
        return _distances(metric, real_array(q0, "q0"), given, progress or no_progress)
    velocity = log(metric, q0, q1, **given)
    points = np.broadcast_to(np.asarray(q0, dtype=float), velocity.shape)
    found = np.atleast_2d(points), np.atleast_2d(velocity)
    known = np.isfinite(found[1]).all(axis=1)
    lengths = np.full(known.size, np.nan)
    lengths[known] = [metric.norm(*each) for each in zip(*(a[known] for a in found), strict=True)]
    return float(lengths[0]) if velocity.ndim == 1 else lengths


def _distances(metric: Metric, points: Array, given: dict[str, Any], progress: Progress) -> Array:
    """Return the symmetric matrix of distances between points (k, n)."""
    if points.ndim != 2 or len(points) < 2:
        raise ValueError(f"without q1, q0 must be several points (k, n), got {points.shape}")
    rows, columns = np.triu_indices(len(points), 1)
    result = np.zeros((len(points), len(points)))
    failures: list[str] = []
    for first in range(0, rows.size, _AT_ONCE):
        row, column = (each[first : first + _AT_ONCE] for each in (rows, columns))
        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                lengths = distance(metric, points[row], points[column], **given)
        except (NotConverged, ValueError) as failure:
            pair = re.match(r"row (\d+): ", str(failure))
            if pair is not None:
                at = int(pair[1])
                rest = str(failure)[pair.end() :]
                failure.args = (f"points {row[at]} and {column[at]}: {rest}",)
            raise
        for each in caught:  # others than of rows that are not found are passed on
            if (text := str(each.message)).startswith("log: "):
                failures.append(text)
            else:
                warnings.warn_explicit(each.message, each.category, each.filename, each.lineno)
        result[row, column] = result[column, row] = lengths
        progress("distances", min(first + _AT_ONCE, rows.size), rows.size)
    if (unknown := np.isnan(result[rows, columns])).any():
        pairs = zip(rows[unknown].tolist(), columns[unknown].tolist(), strict=True)
        shown = ", ".join(map(str, list(pairs)[:10])) + ", ..." * (int(unknown.sum()) > 10)
        warnings.warn(
            f"{int(unknown.sum())} of {rows.size} distances are nan, of points {shown}; "
            f"{failures[0]}",
            RuntimeWarning,
            stacklevel=3,
        )
    return result


def frechet_mean(
    metric: Metric, points: ArrayLike, weights: ArrayLike | None = None, *, wrap: bool = True
) -> Array:
    """Return fréchet mean (n,) of k points (k, n): the x that minimizes sum_i w_i d(x, x_i)^2.

    Its first-order condition is sum_i w_i Log_x(x_i) = 0 (Karcher, "Riemannian center of mass and
    mollifier smoothing", 1977). The gradient descent along that sum starts from the mean of the
    coordinates, and ends where the sum is at most 1e-8 of the points' spread. In a space of
    positive curvature, points that are far apart can have several means; this is one of them.

    Of continuous joints, and of other coordinates with `Metric.periods`, the nearest images of the
    points count: the mean of 3.0 and -3.0 rad is pi, not zero. The descent starts there from the
    mean on the circle, within half a period of the first point.

    >>> metric = go.KineticEnergy(go.human_arm())
    >>> q0, q1 = [0.0, 0.1, -0.5, 0.8, 0.0, 0.0, 0.0], [0.6, 0.2, -0.9, 1.4, 0.1, 0.0, 0.1]
    >>> go.frechet_mean(metric, [q0, q1]).round(3)  # of two points: halfway along the geodesic
    array([ 0.185,  0.102, -0.742,  1.445,  0.11 , -0.528,  0.187])

    Args:
        metric: metric of the manifold.
        points: k points, at least one.
        weights: k positive numbers, of which only the ratios count; None: equal weights.
        wrap: see `log`; with False points are taken as they are.

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
    if wrap:
        periods = checked_periods(metric, samples[0])
        for column in np.flatnonzero(np.isfinite(periods)):
            x[column] = circular_mean(samples[:, column], w, periods[column])
    step = 1.0
    smallest = np.inf
    origin = direction = x
    for _ in range(_MAX_STEPS):
        logs = log(metric, x, samples, wrap=wrap)
        gradient = w @ logs
        spread = max(metric.norm(x, each) for each in logs)
        size = metric.norm(x, gradient)
        if size <= _TOLERANCE * spread or np.all(np.abs(gradient) <= _ROUNDING * np.abs(x).max()):
            return x
        if size < smallest:
            smallest = size
            origin = x
            direction = gradient
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
