"""When an arm comes nearest to obstacles, and in which direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.geometry.nearest_points import nearest_points
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Obstacle

_NEAR = 0.01  # [m] beyond the least distance, within which bodies are about as near
_TINY = 1e-12  # [m]


@dataclass(frozen=True, eq=False, repr=False)
class Approach:
    """The distances of an arm from obstacles.

    Attributes:
        distances: least one in each of k configurations, (k,) [m].
        directions: unit vectors (m, 3) along the lines between the points that are nearest, of all
            bodies and configurations in which they are about as near as they ever come.
        points: the two that are nearest of all, (2, 3) [m].
    """

    distances: Array
    directions: Array
    points: Array

    def __repr__(self) -> str:
        return f"Approach(least {self.distances.min():.3g} m)"


def approach(
    model: Model, q: Array, obstacles: Sequence[Obstacle], links: Sequence[str] | None = None
) -> Approach | None:
    """How near the links' collision bodies come to obstacles in configurations q.

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
    apart = np.array([each.distances for each in found.values()])
    lines = np.array([each.ends - each.starts for each in found.values()])
    near = (apart < apart.min() + _NEAR) & (np.abs(apart) > _TINY)
    directions = lines[near] / np.linalg.norm(lines[near], axis=1, keepdims=True)
    pair, instant = np.unravel_index(int(np.argmin(apart)), apart.shape)
    nearest = list(found.values())[pair]
    points = np.array([nearest.starts[instant], nearest.ends[instant]])
    return Approach(apart.min(axis=0), directions, points)
