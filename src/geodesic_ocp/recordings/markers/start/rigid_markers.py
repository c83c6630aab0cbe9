"""Whether markers move as those of a rigid body."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array

#: Root mean square distance of the markers of a segment from a rigid body at most [m].
RIGID = 0.03
_FRAMES = 200


def rigid_errors(places: Array, points: Array) -> tuple[float, float]:
    """Root mean square distances [m] from a rigid body and from its mirror image.

    Medians over up to 200 frames with three points or more, infinite without any.

    Args:
        places: of the points on the body (m, 3) [m].
        points: observed (k, m, 3) [m], NaN where missing.
    """
    rows = np.flatnonzero(np.sum(~np.isnan(points[:, :, 0]), axis=1) >= 3)
    if not rows.size:
        return np.inf, np.inf
    rows = rows[np.unique(np.linspace(0, rows.size - 1, _FRAMES).round().astype(int))]
    proper, mirrored = np.median([_of_frame(places, points[row]) for row in rows], axis=0)
    return float(proper), float(mirrored)


def without_stray(places: Array, points: Array) -> NDArray[np.int64]:
    """Indices of the points but for one, if the others then are nearer to a rigid body.

    Args:
        places, points: see `rigid_errors`.
    """
    everything = np.arange(len(places))
    if len(places) <= 3 or rigid_errors(places, points)[0] <= RIGID:
        return everything
    rest = [np.delete(everything, each) for each in everything]
    return min(rest, key=lambda kept: rigid_errors(places[kept], points[:, kept])[0])


def _of_frame(places: Array, observed: Array) -> tuple[float, float]:
    """Distances by the singular values of the covariance (Kabsch, Acta Cryst. A 32, 1976)."""
    seen = ~np.isnan(observed[:, 0])
    own, there = places[seen], observed[seen]
    left, right = own - own.mean(axis=0), there - there.mean(axis=0)
    u, sizes, v = np.linalg.svd(left.T @ right)
    sign = np.sign(np.linalg.det(u @ v))
    squares = float((left**2).sum() + (right**2).sum() - 2.0 * (sizes[0] + sizes[1]))
    errors = [max(squares - 2.0 * turn * sizes[2], 0.0) for turn in (sign, -sign)]
    return float(np.sqrt(errors[0] / seen.sum())), float(np.sqrt(errors[1] / seen.sum()))
