"""Rotations about axes, and the angles of three successive ones, continuous over time."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from geodesic_ocp.arrays import Array, as_choice, as_vector

# Cosine of the second angle below which the other two are not determined one by one: rounding
# errors of 1e-16 in a matrix become 1e-9 rad in the angles at this one.
_LOCKED = 1e-7
_HALF_TURN = np.full(3, np.pi)


AXES = ("x", "y", "z", "-x", "-y", "-z")


def direction(axis: str | ArrayLike) -> Array:
    """Return unit vector (3,) of an axis: "x", "-y", ... or three numbers; ValueError otherwise."""
    if isinstance(axis, str):
        as_choice("axis", axis, AXES, " or 3 numbers")
        return np.asarray(np.eye(3)["xyz".index(axis[-1])] * (-1.0 if axis[0] == "-" else 1.0))
    vector = as_vector("axis", axis, 3)
    length = float(np.linalg.norm(vector))
    if length < 1e-6:
        raise ValueError(f"axis must not be zero, got {axis!r}")
    return vector / length


def axis_rotation(axis: str | ArrayLike, angles: ArrayLike) -> Array:
    """Return matrices (..., 3, 3) of rotations about an axis by angles (...) [rad].

    About x, y and z the entries are exact to their own size: near gimbal lock, small ones matter.
    """
    angle = np.asarray(angles, dtype=float)
    if not (isinstance(axis, str) and axis in AXES[:3]):
        vectors = np.multiply.outer(angle, direction(axis))
        return np.asarray(scipy.spatial.transform.Rotation.from_rotvec(vectors).as_matrix())
    i = AXES.index(axis)
    j = (i + 1) % 3
    k = (i + 2) % 3
    matrix = np.zeros((*angle.shape, 3, 3))
    matrix[..., i, i] = 1.0
    matrix[..., j, j] = matrix[..., k, k] = np.cos(angle)
    matrix[..., k, j] = np.sin(angle)
    matrix[..., j, k] = -matrix[..., k, j]
    return matrix


def successive_rotations(axes: str, angles: Array) -> Array:
    """Return the product R_axes[0](angles[:, 0]) R_axes[1](angles[:, 1]) ...: (k, 3, 3)."""
    product = np.broadcast_to(np.eye(3), (len(angles), 3, 3))
    for axis, column in zip(axes, angles.T, strict=True):
        product = product @ axis_rotation(axis, column)
    return product


def continuous_angles(
    rotations: Array, axes: str, lower: Array = -_HALF_TURN, upper: Array = _HALF_TURN
) -> Array:
    """Return angles (a, b, c) with R = R_i(a) R_j(b) R_k(c) about different axes i, j, k, e.g.
    "xzy".

    R is also given by (a + pi, pi - b, c + pi) and by whole turns of each angle. At the first
    sample the angles are those nearest to the limits; after it each step is the shorter one, so
    that no angle jumps by a branch. Where b = +-90 degrees (gimbal lock) only a sum or difference
    of a and c is determined; the other one is interpolated over time.

    Args:
        rotations: (k, 3, 3).
        axes: the axes i, j and k.
        lower: limits (3,) within which the angles begin where they can [rad].
        upper: the same.

    Returns:
        (k, 3) [rad], not limited to any range.
    """
    i, j, k = ("xyz".index(axis) for axis in axes)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    cosine = np.hypot(rotations[:, i, i], rotations[:, i, j])
    b = np.arctan2(sign * rotations[:, i, k], cosine)
    a = np.arctan2(-sign * rotations[:, j, k], rotations[:, k, k])
    c = np.arctan2(-sign * rotations[:, i, j], rotations[:, i, i])
    # At b = +-pi/2, R = R_i(a + s c) R_j(b), with s = +-1 the sign of b times that of the axes.
    together = np.arctan2(sign * rotations[:, k, j], rotations[:, j, j])
    free = np.flatnonzero(cosine > _LOCKED)
    if free.size == 0:
        return np.stack([np.unwrap(together), b, np.zeros(len(b))], axis=1)
    first = np.stack([a, b, c], axis=1)[free]
    second = np.stack([a + np.pi, np.pi - b, c + np.pi], axis=1)[free]
    stays = np.sum(_turn(np.diff(first, axis=0)) ** 2, axis=1)
    leaves = np.sum(_turn(second[1:] - first[:-1]) ** 2, axis=1)
    changed = np.concatenate([[0], np.cumsum(leaves < stays)]) % 2 == 1
    branches = np.where(changed[:, None], second, first), np.where(changed[:, None], first, second)
    starts = [_nearest_turn(branch[0], lower, upper) for branch in branches]
    outside = [np.sum(np.maximum(0.0, np.maximum(lower - s, s - upper))) for s in starts]
    best = 0 if outside[0] <= outside[1] + 1e-9 else 1
    angles = np.unwrap(branches[best], axis=0)
    angles += starts[best] - angles[0]
    if free.size == len(rotations):
        return angles
    return _filled(free, angles, b, together, sign * np.sign(b))


def _turn(angle: Array) -> Array:
    """Return the angle without whole turns, in [-pi, pi)."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def _nearest_turn(angles: Array, lower: Array, upper: Array) -> Array:
    """Return the angles plus the whole turns that bring them nearest to the limits."""
    turns = angles + 2.0 * np.pi * np.arange(-2, 3)[:, None]
    outside = np.maximum(0.0, np.maximum(lower - turns, turns - upper))
    # of several without violation, the one nearest to zero
    chosen = np.argmin(outside + 1e-6 * np.abs(turns), axis=0)
    result: Array = np.take_along_axis(turns, chosen[None], axis=0)[0]
    return result


def _filled(free: NDArray[np.intp], angles: Array, b: Array, together: Array, s: Array) -> Array:
    """Return the angles at all samples from those at `free` ones, and from a + s c at the others.

    Args:
        free: indices of the samples that are not locked.
        angles: angles there, (n, 3).
        b: second angle at all samples (k,).
        together: a + s c (k,) where b = +-pi/2.
        s: 1 or -1 (k,).
    """
    every = np.arange(len(b))
    filled = np.stack([np.interp(every, free, column) for column in angles.T], axis=1)
    locked = np.setdiff1d(every, free)
    both = np.stack([b[locked], np.pi - b[locked]])
    away = _turn(both - filled[locked, 1])
    filled[locked, 1] += np.where(np.abs(away[0]) <= np.abs(away[1]), away[0], away[1])
    error = _turn((together - filled[:, 0] - s * filled[:, 2])[locked])
    filled[locked, 0] += 0.5 * error
    filled[locked, 2] += 0.5 * s[locked] * error
    return filled
