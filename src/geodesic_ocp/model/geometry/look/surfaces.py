"""Closed surfaces of simple shapes."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin
import scipy
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.geometry.look.mesh import Indices

# Vertices (k, 3) and triangles (m, 3), counter-clockwise seen from outside.
Surface: TypeAlias = tuple[Array, Indices]

SIDES = 32  # of the polygon in place of a circle


def box(half_sides: ArrayLike) -> Surface:
    """A box around the origin with these half lengths of its sides (3,)."""
    import trimesh

    return _surface(trimesh.creation.box(2.0 * np.asarray(half_sides, dtype=float)))


def ellipsoid(radii: ArrayLike) -> Surface:
    """An ellipsoid around the origin with semi-axes (3,), or a ball of this radius."""
    angles = np.linspace(-np.pi / 2.0, np.pi / 2.0, SIDES // 2 + 1)
    vertices, triangles = revolved(np.column_stack([np.cos(angles), np.sin(angles)]))
    return vertices * np.asarray(radii, dtype=float), triangles


def cylinder(radius: float, half_length: float, top: float = 1.0) -> Surface:
    """A cylinder along z around the origin, or a cone whose radius at the top is a multiple."""
    rim = [(1.0, -1.0), (top, 1.0)] if top > 0.0 else [(1.0, -1.0)]
    vertices, triangles = revolved([(0.0, -1.0), *rim, (0.0, 1.0)])
    return vertices * [radius, radius, half_length], triangles


def strut(start: Array, end: Array, radii: float | tuple[float, float]) -> Surface:
    """A capsule from start to end (3,), whose round ends may have different radii."""
    length = float(np.linalg.norm(end - start))
    first, last = (radii, radii) if isinstance(radii, (int, float)) else radii
    if length <= abs(last - first):  # one ball holds the other, or both are one
        vertices, triangles = ellipsoid(max(first, last))
        return vertices + (start if first > last else end), triangles
    # The cone touches both balls where their normals have this angle to the plane across.
    tilt = np.arcsin((first - last) / length)
    low = np.linspace(-np.pi / 2.0, tilt, SIDES // 4 + 2)
    high = np.linspace(tilt, np.pi / 2.0, SIDES // 4 + 2)
    size = max(first, last)
    profile = [
        *np.column_stack([first * np.cos(low), first * np.sin(low)]) / size,
        *np.column_stack([last * np.cos(high), last * np.sin(high) + length]) / size,
    ]
    vertices, triangles = revolved(profile)
    return moved((size * vertices, triangles), turn_to(end - start), start)


def revolved(profile: ArrayLike, sides: int = SIDES) -> Surface:
    """A profile (k, 2) of radii and increasing heights turned about z; its ends are on the axis.

    It is of unit size: triangles far smaller than that are lost.
    """
    points = np.asarray(profile, dtype=float)
    vertices, triangles = _revolved(tuple(map(tuple, points.tolist())), sides)
    return vertices.copy(), triangles.copy()


@lru_cache(maxsize=64)
def _revolved(profile: tuple[tuple[float, ...], ...], sides: int) -> Surface:
    import trimesh

    return _surface(trimesh.creation.revolve(np.array(profile), sections=sides))


def loft(sections: ArrayLike, caps: tuple[float, float], roundness: float = 2.0) -> Surface:
    """A smooth form along z through sections, with rounded ends.

    Args:
        sections: rows (k, 5) of z, increasing; centre x and y; half width along x and half depth
            along y. Between the rows they are interpolated without overshoot.
        caps: lengths of the lower and the upper end that are rounded off.
        roundness: exponent of the superellipses in place of ellipses; above 2 is squarer.
    """
    rows = np.asarray(sections, dtype=float)
    low, high = rows[0, 0], rows[-1, 0]
    lower, upper = (np.pi / 2.0 * np.linspace(0.0, 1.0, SIDES // 6) for _ in caps)
    middle = np.linspace(low + caps[0], high - caps[1], SIDES // 4 + 1)[1:-1]
    heights = np.concatenate(
        [low + caps[0] * (1.0 - np.cos(lower)), middle, high - caps[1] * (1.0 - np.sin(upper))]
    )
    shrunk = np.concatenate([np.sin(lower), np.ones(len(middle)), np.cos(upper)])
    levels = np.arange(len(heights)) / (len(heights) - 1.0)
    unit = np.column_stack([np.ones(len(heights)), levels])
    vertices, triangles = revolved([(0.0, 0.0), *unit[1:-1], (0.0, 1.0)], 3 * SIDES // 4)
    level = np.rint(vertices[:, 2] * (len(heights) - 1)).astype(np.int64)
    form = scipy.interpolate.PchipInterpolator(rows[:, 0], rows[:, 1:])(heights)[level]
    around = np.sign(vertices[:, :2]) * np.abs(vertices[:, :2]) ** (2.0 / roundness)
    across = form[:, :2] + around * form[:, 2:] * shrunk[level, None]
    return np.column_stack([across, heights[level]]), triangles


def hull(points: Array) -> Surface:
    """The convex hull of points (k, 3)."""
    import trimesh

    return _surface(trimesh.convex.convex_hull(points))


def moved(surface: Surface, rotation: Array, position: Array) -> Surface:
    """The surface turned by a rotation (3, 3), then shifted."""
    vertices, triangles = surface
    return vertices @ rotation.T + position, triangles


def turn_to(direction: Array) -> Array:
    """A rotation (3, 3) of the z axis to a direction (3,), of any length but zero."""
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), direction)
    return np.array(turn.matrix())


def _surface(mesh: Any) -> Surface:
    return np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.int64)
