"""Distances between many pairs of segments at once, as numbers.

Closest points of two segments: Ericson, Real-Time Collision Detection (2005), 5.1.9.
"""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array


def segment_distances(start: Array, end: Array, other_start: Array, other_end: Array) -> Array:
    """Distances (...) [m] between segments, whose ends are (..., 3) each."""
    here, there = closest_points(start, end, other_start, other_end)
    return np.asarray(np.linalg.norm(here - there, axis=-1))


def closest_points(
    start: Array, end: Array, other_start: Array, other_end: Array
) -> tuple[Array, Array]:
    """The points (..., 3) [m] at which segments come closest, whose ends are (..., 3) each."""
    u, w, between = end - start, other_end - other_start, start - other_start
    a, b, e = _dot(u, u), _dot(u, w), _dot(w, w)
    c, f = _dot(u, between), _dot(w, between)
    s = _clipped_ratio(b * f - c * e, a * e - b * b)
    t = _clipped_ratio(b * s + f, e)
    s = _clipped_ratio(b * t - c, a)
    return start + s[..., None] * u, other_start + t[..., None] * w


def _dot(one: Array, other: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", one, other))


def _clipped_ratio(numerator: Array, denominator: Array) -> Array:
    """The ratio from 0 to 1; 0 where the denominator is zero: points, and parallel segments."""
    some = denominator > np.finfo(float).tiny
    ratio = np.divide(numerator, denominator, out=np.zeros(numerator.shape), where=some)
    return np.asarray(np.clip(ratio, 0.0, 1.0))
