"""Images of a goal: points whole periods away from it, which are the same where coordinates are
periodic.

A revolution of a continuous joint is an isometry, so that the images are a lattice. The shortest
geodesic mostly ends at the image with the shortest straight line, but not always. Lengths of
straight lines do not depend on the direction, and neither do distances that are sought by them.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from geodesic_ocp.arrays import Array, real_array
from geodesic_ocp.manifold.metric import Metric, speeds_at

# Straight lines up to this much longer than the shortest one are compared by their geodesics.
# benchmarks/images.py: on six arms without joint inertia, 99 % of the shortest geodesics of 300
# random pairs are those of lines at most 1.21 times as long (all, 1.48); with joint inertia all are
# of lines at most 1.08 times as long.
LONGER = 1.25
_MAX_PERIODIC = 6  # coordinates of which images one period to either side are tried


def near_images(metric: Metric, q0: Array, q1: Array) -> list[Array]:
    """Return the images of q1 to which the shortest geodesic from q0 may lead.

    They are those with the shortest straight line, which comes first, or with one that is at most
    `LONGER` times as long, among the nearest ones in every coordinate and the next ones on the
    other side.

    Raises:
        ValueError: the metric's periods are wrong.
    """
    images, lengths = _sorted_images(metric, q0, q1, (0, 1))
    count = int(np.sum(np.isfinite(lengths) & (lengths <= LONGER * lengths[0])))
    return images[: max(count, 1)]


def all_images(metric: Metric, q0: Array, q1: Array) -> list[Array]:
    """Return the nearest image of q1 in every coordinate, and those a period to either side, by the
    lengths of their straight lines.

    Raises:
        ValueError: the metric's periods are wrong.
    """
    return _sorted_images(metric, q0, q1, (0, 1, -1))[0]


def circular_mean(angles: Array, weights: Array, period: float) -> float:
    """Return the x that minimizes sum_i w_i d(x, a_i)^2 on a circle, within half a period of a_0.

    Cut open anywhere between two angles, the circle has their weighted mean as its only candidate:
    the best of these is the minimum.

    Args:
        angles: a (k,).
        weights: w (k,), whose sum is 1.
        period: of the circle.
    """
    from_first = angles - angles[0]
    from_first -= period * np.round(from_first / period)
    order = np.argsort(from_first)
    opened = from_first[order] + period * np.tri(angles.size, k=-1)
    means = opened @ weights[order]
    sums = (opened - means[:, None]) ** 2 @ weights[order]
    mean = means[np.argmin(sums)]
    return float(angles[0] + mean - period * np.round(mean / period))


def _sorted_images(
    metric: Metric, q0: Array, q1: Array, periods_back: tuple[int, ...]
) -> tuple[list[Array], Array]:
    """Return images of q1, and the lengths of the straight lines to them, the shortest first.

    Args:
        metric: metric of the manifold.
        q0, q1: the ends (n,).
        periods_back: by how many periods images differ from the nearest one in a coordinate, in the
            direction from q1 to q0.
    """
    periods = checked_periods(metric, q1)
    periodic = np.flatnonzero(np.isfinite(periods))
    if not periodic.size:
        return [q1], np.zeros(1)
    # Whole numbers of periods from q1 itself, whose coordinates are kept to the last digit.
    ahead = (q1 - q0)[periodic] / periods[periodic]
    nearest = -np.round(ahead)
    fractions = ahead + nearest
    side = np.where(fractions < 0.0, 1.0, -1.0)
    # Of many coordinates, those closest to half a period away matter most.
    doubtful = np.argsort(-np.abs(fractions))[:_MAX_PERIODIC]
    back = np.array(list(product(periods_back, repeat=doubtful.size)), dtype=float)
    revolutions = np.tile(nearest, (len(back), 1))
    revolutions[:, doubtful] += back * side[doubtful]
    images = np.tile(q1, (len(back), 1))
    images[:, periodic] += revolutions * periods[periodic]
    lengths = line_lengths(metric, q0, images)
    order = np.argsort(lengths, kind="stable")
    return list(images[order]), lengths[order]


def line_lengths(metric: Metric, q0: Array, images: Array) -> Array:
    """Return lengths of the straight lines from q0 to images (k, n); infinite if a line leaves the
    metric's domain.
    """
    # Gauss's rule: inertia matrices along one and a half revolutions have three waves.
    points, weights = np.polynomial.legendre.leggauss(8)
    change = images - q0
    positions = (q0 + images)[:, None] / 2.0 + points[:, None] / 2.0 * change[:, None]
    velocities = np.repeat(change, points.size, axis=0)
    speeds = speeds_at(metric, positions.reshape(velocities.shape), velocities)
    lengths = speeds.reshape(-1, points.size) @ weights / 2.0
    return np.where(np.isfinite(lengths), lengths, np.inf)


def checked_periods(metric: Metric, q: Array) -> Array:
    """Return the metric's periods (n,); ValueError if the metric at q is not the same a period
    away.
    """
    if metric.periods is None:
        return np.full(metric.dim, np.inf)
    name = type(metric).__name__
    try:
        periods = real_array(metric.periods)
    except (TypeError, ValueError):
        periods = np.zeros(0)
    if periods.shape != (metric.dim,) or not np.all(periods > 0.0):
        raise ValueError(
            f"{name}.periods must be {metric.dim} positive numbers (inf where a coordinate is not "
            f"periodic), got {metric.periods!r}"
        )
    tensor = metric.matrix(q)
    for coordinate in np.flatnonzero(np.isfinite(periods)):
        shifted = q.copy()
        shifted[coordinate] += periods[coordinate]
        difference = np.abs(metric.matrix(shifted) - tensor).max()
        if not difference <= 1e-6 * np.abs(tensor).max():  # rounding is far below
            raise ValueError(
                f"{name}.periods: the metric is not the same at {q} and {periods[coordinate]:g} "
                f"further in q[{coordinate}]"
            )
    return periods
