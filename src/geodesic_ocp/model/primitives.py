"""Geometric primitives for distances: balls, capsules and boxes, on links or fixed, half-spaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_positive, as_rotation, as_vector, is_symbolic

Point: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True)
class Capsule:
    """All points within a radius of a segment.

    Attributes:
        start, end: end points of the segment, (3,) [m], in the link's frame or the base frame.
        radius: [m].
        link: frame of the model that the capsule is fixed to; None if it does not move.
        name: its name in constraints and messages; the link's by default.

    Points and radius may be SX expressions, such as a problem's `parameters`.

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
        centre: (3,) [m], in the link's frame or the base frame.
        radius, link, name: see `Capsule`.

    Raises:
        ValueError: see `Capsule`.
    """

    centre: Point
    radius: float
    link: str | None = None
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", _point("centre", self.centre))
        _check_radius(self)


@dataclass(frozen=True)
class Box:
    """A solid cuboid, as an obstacle.

    Attributes:
        centre: (3,) [m], in the link's frame or the base frame.
        size: lengths of its edges along its own axes, (3,) [m], as in URDF.
        rotation: rotation of its axes, (3, 3), in the link's frame or the base frame.
        link, name: see `Capsule`.

    Centre and size may be SX expressions, such as a problem's `parameters`.

    Raises:
        ValueError: wrong shapes, sizes that are not positive, or a matrix that is no rotation.
    """

    centre: Point
    size: Point
    rotation: tuple[Point, Point, Point] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    link: str | None = None
    name: str = ""

    def __post_init__(self) -> None:
        for key in ("centre", "size"):
            object.__setattr__(self, key, _point(key, getattr(self, key)))
        if not is_symbolic(self.size) and not min(self.size) > 0.0:
            raise ValueError(f"size must be positive [m], got {self.size}")
        rows = as_rotation("rotation", self.rotation).tolist()
        object.__setattr__(self, "rotation", tuple(map(tuple, rows)))


@dataclass(frozen=True)
class HalfSpace:
    """All points behind a fixed plane, such as a table or a wall.

    Attributes:
        point: any point of the plane, (3,) [m], in the base frame.
        normal: outward normal, pointing into free space, (3,); normalized here.
        name: its name in constraints and messages.

    Raises:
        ValueError: wrong shapes, or a zero normal.
    """

    point: Point
    normal: Point
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", _point("point", self.point))
        if isinstance(self.normal, ca.SX):
            raise ValueError("normal must be numbers; only the plane's point may be a parameter")
        normal = as_vector("normal", self.normal, 3)
        if not np.linalg.norm(normal) > 0.0:
            raise ValueError("normal must not be zero")
        object.__setattr__(self, "normal", _point("normal", normal / np.linalg.norm(normal)))


Body: TypeAlias = Capsule | Ball
Obstacle: TypeAlias = Capsule | Ball | Box | HalfSpace
# Bodies, or a function that reads them from a file on first use.
Bodies: TypeAlias = tuple[Body, ...] | Callable[[], tuple[Body, ...]]


def _check_radius(body: Body) -> None:
    if not is_symbolic(body.radius):
        object.__setattr__(body, "radius", as_positive("radius", body.radius, "m"))


def _point(name: str, value: Any) -> Point:
    """Return the value as three numbers; symbolic expressions are returned unchanged."""
    if isinstance(value, ca.SX):
        if value.shape != (3, 1):
            raise ValueError(f"{name} must have shape (3, 1), got {value.shape}")
        return value  # type: ignore[return-value]
    x, y, z = as_vector(name, value, 3).tolist()
    return x, y, z


def as_capsule(body: Body) -> Capsule:
    """Return the body as a capsule; a ball becomes a capsule of length zero."""
    if isinstance(body, Capsule):
        return body
    return Capsule(body.centre, body.centre, body.radius, body.link, body.name)


def core_points(body: Capsule | Ball | Box) -> tuple[Array, float]:
    """Return points (k, 3) [m] and a radius [m]: the body is all that is within the radius of their
    convex hull.
    """
    if isinstance(body, Box):
        signs = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T
        return signs * body.size @ np.transpose(body.rotation) + body.centre, 0.0
    capsule = as_capsule(body)
    return np.array([capsule.start, capsule.end]), capsule.radius
