"""Markers of rigid parts: their poses, and whether a trunk stands upright and is not mirrored."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.markers.chosen_markers import ChosenMarkers
from geodesic_ocp.recordings.markers.markers import evenly

_RIGID = 0.03  # root mean square distance of the markers of a segment from a rigid body at most [m]
_FRAMES = 200  # that are considered
_LEANING = 60.0  # angle of the trunk from the vertical, in the mean over time, that is asked about
_BETTER = 0.5  # share of their distances from a rigid trunk, below which markers are mirrored


def _in_three(points: Array) -> NDArray[np.int64]:
    """Return indices of the frames in which three points or more are seen."""
    return np.flatnonzero(np.sum(~np.isnan(points[:, :, 0]), axis=1) >= 3)


def _aligned(places: Array, points: Array) -> tuple[Array, ...]:
    """Fit rigid motions to the points of frames (k, m, 3) from places on a body (m, 3).

    By least squares (Kabsch, Acta Crystallographica A 32, 1976).

    Returns:
        Rotations (k, 3, 3) and positions (k, 3) of the body; sizes (k, 3) of the covariance's
        singular values; mean square distances of the points from the body and from its mirror
        image (2, k).
    """
    seen = ~np.isnan(points[:, :, :1])
    count = seen.sum(axis=1)
    own = (seen * places).sum(axis=1) / count
    there = np.nansum(points, axis=1) / count
    left, right = seen * (places - own[:, None]), np.nan_to_num(points - there[:, None])
    u, sizes, v = np.linalg.svd(np.swapaxes(left, 1, 2) @ right)
    sign = np.sign(np.linalg.det(u @ v))
    squares = (left**2 + right**2).sum(axis=(1, 2)) - 2.0 * (sizes[:, 0] + sizes[:, 1])
    off = [squares - 2.0 * turn * sizes[:, 2] for turn in (sign, -sign)]
    u[:, :, 2] *= sign[:, None]
    rotations = np.swapaxes(u @ v, 1, 2)
    positions = there - np.einsum("kij,kj->ki", rotations, own)
    return rotations, positions, sizes, np.maximum(off, 0.0) / count[:, 0]


def rigid_errors(places: Array, points: Array) -> tuple[float, float]:
    """Return root mean square distances [m] from a rigid body and from its mirror image.

    Medians over up to 200 frames with three points or more, infinite without any.

    Args:
        places: places of the points on the body (m, 3) [m].
        points: observed (k, m, 3) [m], NaN where missing.
    """
    rows = _in_three(points)
    if not rows.size:
        return np.inf, np.inf
    *_, squares = _aligned(places, points[rows[evenly(rows.size, _FRAMES)]])
    proper, mirrored = np.median(np.sqrt(squares), axis=1).tolist()
    return proper, mirrored


def without_stray(places: Array, points: Array) -> NDArray[np.int64]:
    """Return indices of the points but for one, if the others then are nearer to a rigid body.

    Args:
        places, points: see `rigid_errors`.
    """
    everything = np.arange(len(places))
    if len(places) <= 3 or rigid_errors(places, points)[0] <= _RIGID:
        return everything
    rest = [np.delete(everything, each) for each in everything]
    return min(rest, key=lambda kept: rigid_errors(places[kept], points[:, kept])[0])


def rigid_poses(places: Array, observed: Array, time: Array) -> tuple[Array, Array]:
    """Return rotations (k, 3, 3) and positions (k, 3) that place points on a rigid body's observed
    ones.

    By least squares in every frame with three points seen or more, in the others interpolated.

    Args:
        places: places of the points on the body (m, 3) [m].
        observed: (k, m, 3) [m], NaN where missing.
        time: (k,) [s].

    Raises:
        ValueError: no frame shows three points that are not in line.
    """
    rows = _in_three(observed)
    rotations, positions, sizes, _ = _aligned(places, observed[rows])
    usable = ~(sizes[:, 1] < 1e-4 * sizes[:, 0])
    rotations, positions, known = rotations[usable], positions[usable], time[rows[usable]]
    if not known.size:
        raise ValueError(
            "base='free' needs three markers of the thorax (of the model's base) in one frame at "
            "least, not in line; give positions in the base's axes and base='fixed' otherwise"
        )
    if known.size == 1:
        return np.repeat(rotations, time.size, 0), np.repeat(positions, time.size, 0)
    at = np.clip(time, known[0], known[-1])
    turns = scipy.spatial.transform.Rotation.from_matrix(rotations)
    turning = scipy.spatial.transform.Slerp(known, turns)
    moving = scipy.interpolate.make_interp_spline(known, positions, k=1)
    return turning(at).as_matrix(), moving(at)


def check_trunk(chosen: ChosenMarkers, *, ask_up: bool) -> None:
    """Check the markers of the thorax or, without three of them, the pelvis.

    Args:
        chosen: markers and where they are.
        ask_up: whether a person who does not stand upright is asked about.

    Raises:
        ValueError: the trunk is more than 60 deg from the vertical, in the mean over time; or its
            markers are those of a mirrored person.
    """
    for segment in ("thorax", "pelvis"):
        columns = np.flatnonzero([each == segment for each in chosen.segments])
        rows = _in_three(chosen.observed[:, columns])
        if rows.size:
            break
    else:
        return
    rows = rows[evenly(rows.size, _FRAMES)]
    places, points = chosen.places[columns], chosen.observed[np.ix_(rows, columns)]
    proper, mirrored = rigid_errors(places, points)
    if proper > _RIGID and mirrored < _BETTER * proper:
        raise ValueError(
            f"positions: the markers of the {segment} are those of a mirrored person "
            f"({1e3 * proper:.0f} mm from a rigid {segment}, {1e3 * mirrored:.0f} mm from a "
            "mirrored one): right and left may be exchanged in the names, or the axes left-handed"
        )
    if not ask_up:
        return
    kept = without_stray(places, points)
    try:
        rotations, _ = rigid_poses(places[kept], points[:, kept], np.arange(float(len(points))))
    except ValueError:  # all in line
        return
    upwards = rotations[:, :, 2].mean(axis=0)
    length = float(np.linalg.norm(upwards))
    if length < 0.5:  # no direction is up on average
        return
    angle = float(np.rad2deg(np.arccos(np.clip(upwards[2] / length, -1.0, 1.0))))
    if angle > _LEANING:
        axis = int(np.argmax(np.abs(upwards)))
        name = ("-" if upwards[axis] < 0.0 else "") + "xyz"[axis]
        raise ValueError(
            f"positions: the {segment} is {angle:.0f} deg from the vertical z, on average: is "
            f"{name} up? Then pass up={name!r} (--up {name}); pass up='z' if z is up and the "
            "person lies"
        )
