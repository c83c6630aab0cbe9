"""Distance to a path, whatever the timing on it."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array


def nearest_on_path(points: Array, path: Array) -> Array:
    """The point (k, n) nearest to each of the points (k, n) on the polyline through path (m, n).

    On the chord from p_i to p_(i+1) it is p_i + u (p_(i+1) - p_i) with u in [0, 1]; distances are
    Euclidean. Chords rather than samples are searched: the spacing of the samples along the path
    then does not add to the distance.
    """
    chords = np.diff(path, axis=0)
    squares = np.sum(chords**2, axis=1)
    squares[squares == 0.0] = 1.0  # a chord of length zero is the point itself
    nearest = np.empty_like(points)
    for row, point in enumerate(points):
        along = np.clip(np.sum((point - path[:-1]) * chords, axis=1) / squares, 0.0, 1.0)
        candidates = path[:-1] + along[:, None] * chords
        nearest[row] = candidates[np.argmin(np.sum((candidates - point) ** 2, axis=1))]
    return nearest
