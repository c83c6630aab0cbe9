"""When an arm comes nearest to obstacles, and in which direction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.distances import NearestPoints, nearest_points
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Obstacle

_NEAR = 0.01  # [m] beyond the least distance, within which bodies are about as near
_TINY = 1e-12  # [m]


def approach(
    model: Model, q: Array, obstacles: Sequence[Obstacle], links: Sequence[str] | None = None
) -> NearestPoints | None:
    """Where the links' collision bodies come nearest to an obstacle in configurations q.

    Args:
        model: with collision bodies.
        q: configurations (k, n) [rad or m].
        obstacles: that the links keep clear of.
        links: whose bodies count; None: all that move.

    Returns:
        None if there are no obstacles, or no collision bodies.
    """
    try:
        found = nearest_points(model, q, obstacles, links=links) if obstacles else {}
    except ValueError:  # a model without collision bodies
        return None
    if not found:
        return None
    pairs = list(found.values())
    starts, ends = np.array([(each.starts, each.ends) for each in pairs]).transpose(1, 0, 2, 3)
    distances = np.array([each.distances for each in pairs])
    nearest = distances.argmin(axis=0), np.arange(len(q))
    return NearestPoints(starts[nearest], ends[nearest], distances[nearest])


def gap_directions(near: NearestPoints) -> Array:
    """Unit vectors (m, 3) along the lines between the nearest points, where they are nearest.

    Of all configurations in which the bodies are about as near as they ever come.
    """
    lines, apart = near.ends - near.starts, near.distances
    narrow = (apart < apart.min() + _NEAR) & (np.abs(apart) > _TINY)
    return np.asarray(lines[narrow] / np.linalg.norm(lines[narrow], axis=1, keepdims=True))
