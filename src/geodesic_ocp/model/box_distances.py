"""Distances between capsules and boxes, as expressions."""

from __future__ import annotations

from functools import lru_cache, reduce

import casadi as ca

from geodesic_ocp.model.primitives import Box

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
    turn, centre = ca.SX(ca.DM(box.rotation)), ca.SX(box.centre)
    if rotation is not None and position is not None:
        turn, centre = rotation @ turn, position + rotation @ centre
    half = ca.SX(box.size) / 2.0
    a, u = turn.T @ (start - centre), turn.T @ along
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
    a, half = ca.SX.sym("a", 3), ca.SX.sym("half", 3)
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
    low, high = ca.SX(0), ca.SX(1)
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
    middle, square = a + u / 2.0, ca.sumsqr(u)
    overlaps = ca.vertsplit(half + ca.fabs(u) / 2.0 - ca.fabs(middle))
    for k in range(3) if not square.is_zero() else ():
        i, j = (k + 1) % 3, (k + 2) % 3  # the axis is the k-th edge times u
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
