"""Choice of the view from which a motion is seen best."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.arm_shapes import DIRECTIONS, Postures
from geodesic_ocp.drawing.camera import Camera
from geodesic_ocp.model.primitives import Ball, Box, Capsule, HalfSpace, Obstacle, core_points

_FLAT = 1e-6  # extent along an axis, relative to the largest, of a motion in a plane
_STEP = 15.0  # [deg] between the azimuths that are compared
_ELEVATIONS = (0.0, 20.0, 40.0)  # [deg]
_SIMPLE = 0.06  # what a view along an axis is worth, relative to all of the motion
_HIDDEN = 0.6  # what it costs if the hand is always hidden
_STEEP = 0.2  # what it costs to look straight down
_OVERLAP = 0.5  # what it costs if arm and obstacles overlap
_GAP = 0.6  # what it costs if the line between nearest points is seen end-on
_BEHIND = 0.2  # what it costs if the arm is as far behind the body as it is long
_EDGE_ON = 1.0  # what it costs if a plane is not seen edge-on
_SEEN = 1e-6
_ROUGH = DIRECTIONS[::4]


def plane_of(postures: Postures) -> Camera | None:
    """Get the view onto the plane of two axes in which everything moves; None if there is none."""
    extents = np.ptp(postures.joints.reshape(-1, 3), axis=0)
    flat = extents <= _FLAT * extents.max()
    planes = {2: (0, 1), 0: (1, 2), 1: (0, 2)}  # by the axis along which nothing moves
    return next((Camera.of_axes(plane) for axis, plane in planes.items() if flat[axis]), None)


def best_view(
    postures: Postures,
    paths: Array | None = None,
    obstacles: Sequence[Obstacle] = (),
    nearest: Array | None = None,
    closest: int | None = None,
) -> Camera:
    """Return the view, with z up, that shows most of a motion, and its distance from obstacles.

    Convex bodies that are apart appear apart in every view across the line between their nearest
    points. What counts is the extent of the path in the figure, overlaps of arm and obstacles, and
    whether bodies hide the hand; planes such as a table are seen edge-on.

    Args:
        postures: at some instants.
        paths: paths of the hand and other points, (k, 3) [m]; the joints' by default.
        obstacles: obstacles of which those that do not move count.
        nearest: directions (m, 3) of lines between points that come nearest, see `approach`.
        closest: the instant at which they do, when an overlap would hide most.
    """
    flat = plane_of(postures)
    if flat is not None:
        return flat
    azimuths = list(np.arange(-180.0, 180.0, _STEP))
    for obstacle in obstacles:
        if isinstance(obstacle, HalfSpace):
            x, y, _ = obstacle.normal
            azimuths += [float(np.rad2deg(np.arctan2(x, -y))), float(np.rad2deg(np.arctan2(-x, y)))]
    views = [Camera.around_z(azimuth, above) for above in _ELEVATIONS for azimuth in azimuths]
    way = np.concatenate([postures.joints.reshape(-1, 3), *([] if paths is None else [paths])])
    lines = np.zeros((0, 3)) if nearest is None else nearest
    return max(views, key=lambda view: _worth(view, postures, way, obstacles, lines, closest))


def across(view: Camera, postures: Postures) -> Camera:
    """Return the view at a right angle to a view with z up from which the hands are hidden less."""
    x, y, _ = view.towards
    azimuth = float(np.rad2deg(np.arctan2(y, x)))
    views = [Camera.around_z(azimuth + turn, 0.0) for turn in (90.0, -90.0)]
    return min(views, key=lambda other: _hidden(other, postures))


def _worth(
    view: Camera,
    postures: Postures,
    way: Array,
    obstacles: Sequence[Obstacle],
    lines: Array,
    closest: int | None,
) -> float:
    flat = view.plane(way)
    spread = np.linalg.norm(flat - flat.mean(axis=0), ord="nuc")
    worth = float(spread / np.linalg.norm(way - way.mean(axis=0), ord="nuc"))
    worth += _SIMPLE * (view.axis is not None) - _HIDDEN * _hidden(view, postures)
    worth -= _STEEP * abs(float(view.towards[2]))
    if bodies := postures.still:
        behind = view.depth(np.concatenate(bodies)).mean() - view.depth(postures.joints).mean()
        worth -= _BEHIND * float(np.clip(behind / np.ptp(way, axis=0).max(), -1.0, 1.0))
    if len(lines):
        worth -= _GAP * float(np.mean(np.abs(lines @ view.towards)))
    for obstacle in obstacles:
        if isinstance(obstacle, HalfSpace):
            worth -= _EDGE_ON * float(abs(view.towards @ np.array(obstacle.normal)) > _SEEN)
        elif obstacle.link is None:
            overlaps = _overlaps(view, postures, obstacle)
            most = overlaps.mean() if closest is None else overlaps[closest]
            worth -= _OVERLAP * float(overlaps.mean() + 2.0 * most) / len(obstacles)
    return worth


def _hidden(view: Camera, postures: Postures) -> float:
    """Return share of the joints that move, hands included, that are behind bodies that do not."""
    moves = np.any(np.ptp(postures.joints, axis=0) > _SEEN, axis=-1)
    if not np.any(moves):
        return 0.0
    joints = postures.joints[:, moves].reshape(-1, 3)
    hidden = np.zeros(len(joints), dtype=bool)
    places = view.plane(joints) @ _ROUGH.T
    depths = view.depth(joints)
    for body in postures.still:
        inside = np.all(places < (view.plane(body) @ _ROUGH.T).max(axis=0), axis=1)
        hidden |= inside & (depths < view.depth(body).mean())
    return float(hidden.mean())


def _overlaps(view: Camera, postures: Postures, body: Capsule | Ball | Box) -> Array:
    """Return overlaps (k,) of an obstacle and the moving bodies, relative to its least width."""
    core, radius = core_points(body)
    places = view.plane(core) @ _ROUGH.T
    nearest = places.min(axis=0) - radius  # of the obstacle, by direction
    width = float((np.ptp(places, axis=0) + 2.0 * radius).min())
    overlaps = []
    for points in postures.moving:
        farthest = (view.plane(points) @ _ROUGH.T).max(axis=-2)
        # The gap along the direction that separates them best.
        overlaps.append(np.clip(-np.max(nearest - farthest, axis=-1), 0.0, width))
    if not overlaps:
        return np.zeros(len(postures))
    return np.asarray(np.max(overlaps, axis=0) / width)
