"""Geometric primitives: balls, capsules, boxes and half-spaces; segments' distances from boxes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, reduce
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_positive, as_rotation, as_vector, is_symbolic, settle

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
            settle(self, **{key: _point(key, getattr(self, key))})
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
        settle(self, centre=_point("centre", self.centre))
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
            settle(self, **{key: _point(key, getattr(self, key))})
        if not is_symbolic(self.size) and not min(self.size) > 0.0:
            raise ValueError(f"size must be positive [m], got {self.size}")
        rows = as_rotation("rotation", self.rotation).tolist()
        settle(self, rotation=tuple(map(tuple, rows)))


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
        settle(self, point=_point("point", self.point))
        if isinstance(self.normal, ca.SX):
            raise ValueError("normal must be numbers; only the plane's point may be a parameter")
        normal = as_vector("normal", self.normal, 3)
        if not np.linalg.norm(normal) > 0.0:
            raise ValueError("normal must not be zero")
        settle(self, normal=_point("normal", normal / np.linalg.norm(normal)))


Body: TypeAlias = Capsule | Ball
Obstacle: TypeAlias = Capsule | Ball | Box | HalfSpace
# Bodies, or a function that reads them from a file on first use.
Bodies: TypeAlias = tuple[Body, ...] | Callable[[], tuple[Body, ...]]


def _check_radius(body: Body) -> None:
    if not is_symbolic(body.radius):
        settle(body, radius=as_positive("radius", body.radius, "m"))


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


_PARALLEL = 1e-8  # relative: keeps t unique where a segment is parallel to a face or an edge
_TOUCHING = 1e-20  # [m^2]: keeps the distance differentiable at zero
_GRID = 2.0**40  # t is rounded to multiples of its inverse


def box_distance(
    start: ca.SX,
    along: ca.SX,
    box: Box,
    rotation: ca.SX | None = None,
    position: ca.SX | None = None,
) -> tuple[ca.SX, ca.SX, ca.SX, list[ca.SX]]:
    """Return the signed distance [m] between a segment and a box, their nearest points (3, 1), and
    the distance's gradients by start and vector of the segment, for the t at which it is least.

    Where they are apart, it is exact: d(t)^2 = sum_i max(|p_i(t)| - h_i, 0)^2, in axes of the box
    and with half sizes h, is convex in the segment's parameter t, and its derivative is piecewise
    linear. Where they overlap, it is minus the shortest translation that separates them, along the
    normal of a face or of a face of the Minkowski sum that an edge and the segment span. It is
    continuous, with a gradient of length one by the position of the box, and differentiable except
    where the nearest feature changes inside.

    Args:
        start, along: start of the segment, and the vector to its end, (3, 1) [m].
        box: the box.
        rotation, position: pose of the frame that the box is fixed to; None: the base frame.
    """
    turn = ca.SX(ca.DM(box.rotation))
    centre = ca.SX(box.centre)
    if rotation is not None and position is not None:
        turn = rotation @ turn
        centre = position + rotation @ centre
    half = ca.SX(box.size) / 2.0
    a = turn.T @ (start - centre)
    u = turn.T @ along
    t = _nearest_parameter(a, u, half)
    here = a + t * u
    there = _clipped(here, -half, half)
    apart = ca.sqrt(ca.sumsqr(here - there) + _TOUCHING)
    overlap, by_a, by_u = _overlap(bool(u.is_zero()))(a, u, half)
    normal = (here - there) / apart
    gradients = [turn @ (normal - by_a), turn @ (t * normal - by_u)]
    return ca.SX(apart - overlap), centre + turn @ here, centre + turn @ there, gradients


@lru_cache(maxsize=2)
def _overlap(is_point: bool) -> ca.Function:
    """Return the function (a, u, half) -> overlap of a box and a segment, 0 if they are apart, and
    its gradients by a and u.
    """
    a = ca.SX.sym("a", 3)
    half = ca.SX.sym("half", 3)
    u = ca.SX.sym("u", 3)
    overlap = ca.fmax(_penetration(a, ca.SX.zeros(3) if is_point else u, half), 0.0)
    outputs = [overlap, *(ca.gradient(overlap, each) for each in (a, u))]
    return ca.Function("overlap", [a, u, half], outputs)


def _nearest_parameter(a: ca.SX, u: ca.SX, half: ca.SX) -> ca.SX:
    """Return the t from 0 to 1 at which the point a + t u of a segment is nearest to a box.

    The derivative of d(t)^2 / 2 is monotone and linear between six known values of t. A number in
    the interval of its root is found by comparisons alone and rounded, which is constant for
    CasADi, and one step of Newton's method from there gives t and its derivatives.
    """
    square = ca.sumsqr(u)
    if square.is_zero():
        return ca.SX(0)
    low = ca.SX(0)
    high = ca.SX(1)
    for k in range(3):
        for side in (-half[k], half[k]):
            t = ca.fmin(ca.fmax((side - a[k]) / u[k], 0.0), 1.0)  # 0 for 0 / 0, as fmax(nan, 0) is
            beyond = ca.dot(_outside(a + t * u, half), u) > 0.0
            low = ca.fmax(low, t * (1 - beyond))
            high = ca.fmin(high, t + (1.0 - t) * (1 - beyond))
    t = ca.floor((low + high) / 2.0 * _GRID) / _GRID
    p = a + t * u
    slope = ca.dot(ca.fabs(p) > half, u**2) + _PARALLEL * square
    return ca.fmin(ca.fmax(t - ca.dot(_outside(p, half), u) / slope, 0.0), 1.0)


def _penetration(a: ca.SX, u: ca.SX, half: ca.SX) -> ca.SX:
    """Return the least overlap of a box and a segment along six axes; not positive if apart.

    Separating axes: Gottschalk, Lin, Manocha, "OBBTree" (1996).
    """
    middle = a + u / 2.0
    square = ca.sumsqr(u)
    overlaps = ca.vertsplit(half + ca.fabs(u) / 2.0 - ca.fabs(middle))
    for k in range(3) if not square.is_zero() else ():
        # the axis is the k-th edge times u
        i = (k + 1) % 3
        j = (k + 2) % 3
        across = u[i] ** 2 + u[j] ** 2
        reach = half[i] * ca.fabs(u[j]) + half[j] * ca.fabs(u[i])
        overlap = reach - ca.fabs(middle[i] * u[j] - middle[j] * u[i])
        parallel = across <= _PARALLEL * square  # then one of the faces separates them as well
        overlaps.append(
            ca.if_else(parallel, overlaps[0], overlap / ca.sqrt(across + parallel * square))
        )
    return reduce(ca.fmin, overlaps)


def _outside(p: ca.SX, half: ca.SX) -> ca.SX:
    """Return the vector (3, 1) from the nearest point of a box."""
    return p - _clipped(p, -half, half)


def _clipped(p: ca.SX, low: ca.SX, high: ca.SX) -> ca.SX:
    return ca.fmin(ca.fmax(p, low), high)
