"""A small capsule around a set of points."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, real_array
from geodesic_ocp.model.primitives import Capsule, Point

_FLAT = 1e-12  # [m]
_MAX_EVALUATIONS = 1500


def enclosing_capsule(points: ArrayLike, link: str | None = None, name: str = "") -> Capsule:
    """A capsule of small, not necessarily minimal, volume that contains all points (k, 3) [m].

    The volume is reduced by the Nelder-Mead simplex method from the best of six initial axes: the
    coordinate axes and the principal axes of the points.

    Raises:
        ValueError: there are no points, they are not finite, or they all coincide.
    """
    cloud = real_array(points)
    if cloud.ndim != 2 or cloud.shape[1] != 3 or not len(cloud) or not np.isfinite(cloud).all():
        raise ValueError(f"points must be finite, of shape (k, 3), got {cloud.shape}")
    if float(np.ptp(cloud, axis=0).max()) <= _FLAT:
        raise ValueError("points must not all coincide")
    start, end, radius = _fitted(hull_vertices(cloud).tobytes())
    return Capsule(start, end, radius, link, name)


@lru_cache(maxsize=4096)  # a robot is often loaded several times
def _fitted(vertices: bytes) -> tuple[Point, Point, float]:
    """End points and radius [m] of a capsule around the vertices (k, 3)."""
    cloud = np.frombuffer(vertices).reshape(-1, 3)
    size = float(np.ptp(cloud, axis=0).max())
    principal = np.linalg.svd(cloud - cloud.mean(axis=0), full_matrices=True)[2]
    fits = [_segment_along(cloud, axis) for axis in (*np.eye(3), *principal)]
    best = min(fits, key=lambda ends: _volume(ends, cloud))
    found = scipy.optimize.minimize(
        lambda ends: _volume(ends, cloud) / size**3,
        best,
        method="Nelder-Mead",
        options={"maxfev": _MAX_EVALUATIONS, "xatol": 1e-3 * size, "fatol": 1e-5, "adaptive": True},
    )
    ends = min((best, found.x), key=lambda ends: _volume(ends, cloud))
    start, end = ends.reshape(2, 3)
    # Slightly larger, so that rounding leaves no point outside.
    radius = float(distances_to_segment(cloud, start, end).max()) + 1e-9 * size
    return tuple(start.tolist()), tuple(end.tolist()), radius


def distances_to_segment(points: Array, start: Array, end: Array) -> Array:
    """Distances (k,) of points (k, 3) to a segment."""
    along = end - start
    fraction = (points - start) @ along / max(float(along @ along), np.finfo(float).tiny)
    nearest = start + np.clip(fraction, 0.0, 1.0)[:, None] * along
    return np.asarray(np.linalg.norm(points - nearest, axis=1))


def hull_vertices(cloud: Array) -> Array:
    """The points (k, 3) at the corners of the convex hull of points."""
    try:
        return np.asarray(cloud[scipy.spatial.ConvexHull(cloud).vertices])
    except scipy.spatial.QhullError:  # flat, or fewer than four points
        return cloud


def _segment_along(cloud: Array, axis: Array) -> Array:
    """End points (6,) of a segment along the axis whose round caps just contain the points."""
    middle = (cloud.max(axis=0) + cloud.min(axis=0)) / 2.0
    height = (cloud - middle) @ axis
    radial = cloud - middle - height[:, None] * axis
    radius = np.linalg.norm(radial, axis=1).max()
    cap = np.sqrt(np.maximum(radius**2 - np.sum(radial**2, axis=1), 0.0))
    low, high = float((height + cap).min()), float((height - cap).max())
    if low > high:
        low = high = (low + high) / 2.0
    return np.concatenate([middle + low * axis, middle + high * axis])


def _volume(ends: Array, cloud: Array) -> float:
    start, end = ends.reshape(2, 3)
    radius = float(distances_to_segment(cloud, start, end).max())
    length = float(np.linalg.norm(end - start))
    return np.pi * radius**2 * (length + 4.0 / 3.0 * radius)
