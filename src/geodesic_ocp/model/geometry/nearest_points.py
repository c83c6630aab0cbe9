"""Nearest points of collision bodies, obstacles and each other, in many configurations at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array, is_symbolic
from geodesic_ocp.model.geometry.segment_distances import closest_points
from geodesic_ocp.model.geometry.signed_distances import add_named, bodies_apart
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Body, HalfSpace, Obstacle, as_capsule


@dataclass(frozen=True, eq=False, repr=False)
class NearestPoints:
    """Where two bodies come closest, in k configurations.

    Attributes:
        starts, ends: the points on the surface of either, (k, 3) [m] in the base frame.
        distances: between them, (k,) [m]; negative where the bodies overlap.
    """

    starts: Array
    ends: Array
    distances: Array

    def __repr__(self) -> str:
        return f"NearestPoints({len(self.distances)} configurations)"


def nearest_points(
    model: Model,
    q: Array,
    obstacles: Sequence[Obstacle] = (),
    *,
    links: Sequence[str] | None = None,
    pairs: Sequence[tuple[str, str]] = (),
) -> dict[str, NearestPoints]:
    """Nearest points by the names of `signed_distances`, whose arguments and errors these are.

    Args:
        model, obstacles, links, pairs: see `signed_distances`; obstacles are numbers.
        q: configurations (k, n) [rad or m].

    Raises:
        ValueError: an obstacle depends on symbols, or see `signed_distances`.
    """
    found: dict[str, NearestPoints] = {}
    for name, body, other in bodies_apart(model, obstacles, links, pairs):
        for nearest in _nearest(model, q, body, other):
            add_named(found, name, nearest)
    return found


def has_symbols(obstacle: Obstacle) -> bool:
    """Whether an obstacle is given by expressions in place of numbers."""
    if isinstance(obstacle, HalfSpace):
        return is_symbolic(obstacle.point)
    body = as_capsule(obstacle)
    return is_symbolic(body.start, body.end, body.radius)


def _nearest(model: Model, q: Array, body: Body, other: Obstacle) -> list[NearestPoints]:
    if has_symbols(other):
        raise ValueError(f"obstacles must be numbers here, got {other!r}")
    ends, radius = _segments(model, q, body), body.radius
    if isinstance(other, HalfSpace):
        normal = np.array(other.normal)
        used = ends[:1] if np.array_equal(*_ends(body)) else ends
        heights = [(end - np.array(other.point)) @ normal for end in used]
        return [
            NearestPoints(end - radius * normal, end - height[:, None] * normal, height - radius)
            for end, height in zip(used, heights, strict=True)
        ]
    here, there = closest_points(*ends, *_segments(model, q, other))
    apart = np.linalg.norm(there - here, axis=1)
    # Segments that intersect have no direction; any one serves.
    direction = np.tile([0.0, 0.0, 1.0], (len(q), 1))
    np.divide(there - here, apart[:, None], out=direction, where=apart[:, None] > 0.0)
    starts, stops = here + radius * direction, there - other.radius * direction
    return [NearestPoints(starts, stops, apart - (radius + other.radius))]


def _ends(body: Body) -> tuple[Array, Array]:
    capsule = as_capsule(body)
    return np.array(capsule.start), np.array(capsule.end)


def _segments(model: Model, q: Array, body: Body) -> list[Array]:
    """Both ends (k, 3) [m] of the segment of a capsule in the base frame."""
    if body.link is None:
        return [np.tile(end, (len(q), 1)) for end in _ends(body)]
    rotations, positions = model.frame_pose(body.link, q)
    return [rotations @ end + positions for end in _ends(body)]
