"""Bodies for distances: balls and capsules of links or in space, half-spaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize
from scipy.spatial import ConvexHull, QhullError

from geodesic_ocp.arrays import Array, as_positive, as_vector, is_symbolic

Point: TypeAlias = tuple[float, float, float]

_FLAT = 1e-12  # [m]
_STEPS = 4000  # of the search for a small capsule


@dataclass(frozen=True)
class Capsule:
    """All points within a radius of a segment.

    Attributes:
        start, end: of the segment, (3,) [m], in the axes of the link's frame or the base's.
        radius: [m].
        link: frame of the model that the body is fixed to; None: it stands still.
        name: by which conditions and messages call it; the link's by default.

    Places and radius may be SX expressions, as of a problem's `parameters`.

    Raises:
        ValueError: wrong shapes, numbers that are not finite, or a radius that is not positive.
    """

    start: Point
    end: Point
    radius: float
    link: str | None = None
    name: str = ""

    def __post_init__(self) -> None:
        for key in ("start", "end"):
            object.__setattr__(self, key, _point(key, getattr(self, key)))
        _check_radius(self)


@dataclass(frozen=True)
class Ball:
    """All points within a radius of a centre: a solid sphere.

    Attributes:
        centre: (3,) [m], in the axes of the link's frame or the base's.
        radius, link, name: as of a `Capsule`.

    Raises:
        ValueError: as of a `Capsule`.
    """

    centre: Point
    radius: float
    link: str | None = None
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", _point("centre", self.centre))
        _check_radius(self)


@dataclass(frozen=True)
class HalfSpace:
    """All points behind a plane that stands still, such as a table or a wall.

    Attributes:
        point: of the plane, (3,) [m], in the base's axes.
        normal: out of the body, towards where there is room, (3,); of any length but zero.
        name: by which conditions and messages call it.

    Raises:
        ValueError: wrong shapes, or a normal of no length.
    """

    point: Point
    normal: Point
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", _point("point", self.point))
        if isinstance(self.normal, ca.SX):
            raise ValueError("normal must be numbers; a plane's point may be a parameter")
        normal = as_vector("normal", self.normal, 3)
        if not np.linalg.norm(normal) > 0.0:
            raise ValueError("normal must not be zero")
        object.__setattr__(self, "normal", _point("normal", normal / np.linalg.norm(normal)))


Body: TypeAlias = Capsule | Ball
Obstacle: TypeAlias = Capsule | Ball | HalfSpace
# Bodies, or what reads them from a file when they are asked for.
Bodies: TypeAlias = tuple[Body, ...] | Callable[[], tuple[Body, ...]]


def _check_radius(body: Body) -> None:
    if not is_symbolic(body.radius):
        object.__setattr__(body, "radius", as_positive("radius", body.radius, "m"))


def _point(name: str, value: Any) -> Point:
    """The value as three numbers; expressions, as of a problem's parameters, stay what they are."""
    if isinstance(value, ca.SX):
        if value.shape != (3, 1):
            raise ValueError(f"{name} must have shape (3, 1), got {value.shape}")
        return value  # type: ignore[return-value]
    x, y, z = as_vector(name, value, 3).tolist()
    return x, y, z


def as_capsule(body: Body) -> Capsule:
    """The body as a capsule; a ball is one of no length."""
    if isinstance(body, Capsule):
        return body
    return Capsule(body.centre, body.centre, body.radius, body.link, body.name)


def enclosing_capsule(points: ArrayLike, link: str | None = None, name: str = "") -> Capsule:
    """A capsule (not the smallest, but a small one) with all points (k, 3) [m] in it.

    Its volume is brought down by the simplex method of Nelder and Mead from the best of six axes:
    the coordinates' and the points' principal ones.

    Raises:
        ValueError: there are no points, they are not finite, or all are one.
    """
    cloud = np.array(points, dtype=float)
    if cloud.ndim != 2 or cloud.shape[1] != 3 or not len(cloud) or not np.isfinite(cloud).all():
        raise ValueError(f"points must be finite, of shape (k, 3), got {cloud.shape}")
    size = float(np.ptp(cloud, axis=0).max())
    if size <= _FLAT:
        raise ValueError("points must not all be one")
    cloud = _corners(cloud)
    principal = np.linalg.svd(cloud - cloud.mean(axis=0), full_matrices=True)[2]
    fits = [_along(cloud, axis) for axis in (*np.eye(3), *principal)]
    best = min(fits, key=lambda ends: _volume(ends, cloud))
    found = minimize(
        lambda ends: _volume(ends, cloud) / size**3,
        best,
        method="Nelder-Mead",
        options={"maxfev": _STEPS, "xatol": 1e-6 * size, "fatol": 1e-9, "adaptive": True},
    )
    ends = min((best, found.x), key=lambda ends: _volume(ends, cloud))
    start, end = ends.reshape(2, 3)
    # A breath wider than the points, which rounding would leave outside.
    radius = float(distances_to_segment(cloud, start, end).max()) + 1e-9 * size
    return Capsule(_point("start", start), _point("end", end), radius, link, name)


def distances_to_segment(points: Array, start: Array, end: Array) -> Array:
    """Distances (k,) of points (k, 3) to a segment."""
    along = end - start
    share = (points - start) @ along / max(float(along @ along), np.finfo(float).tiny)
    nearest = start + np.clip(share, 0.0, 1.0)[:, None] * along
    return np.asarray(np.linalg.norm(points - nearest, axis=1))


def _corners(cloud: Array) -> Array:
    try:
        return np.asarray(cloud[ConvexHull(cloud).vertices])
    except QhullError:  # flat, or fewer than four points
        return cloud


def _along(cloud: Array, axis: Array) -> Array:
    """Ends (6,) of a segment along the axis, with round caps that just hold the points."""
    middle = (cloud.max(axis=0) + cloud.min(axis=0)) / 2.0
    height = (cloud - middle) @ axis
    across = cloud - middle - height[:, None] * axis
    radius = np.linalg.norm(across, axis=1).max()
    cap = np.sqrt(np.maximum(radius**2 - np.sum(across**2, axis=1), 0.0))
    low, high = float((height + cap).min()), float((height - cap).max())
    if low > high:
        low = high = (low + high) / 2.0
    return np.concatenate([middle + low * axis, middle + high * axis])


def _volume(ends: Array, cloud: Array) -> float:
    start, end = ends.reshape(2, 3)
    radius = float(distances_to_segment(cloud, start, end).max())
    length = float(np.linalg.norm(end - start))
    return np.pi * radius**2 * (length + 4.0 / 3.0 * radius)
