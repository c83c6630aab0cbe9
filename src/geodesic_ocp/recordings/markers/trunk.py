"""Markers of rigid parts: their poses, and whether a trunk stands upright and is not mirrored."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.markers.chosen_markers import ChosenMarkers

#: Root mean square distance of the markers of a segment from a rigid body at most [m].
RIGID = 0.03
_FRAMES = 200


def rigid_errors(places: Array, points: Array) -> tuple[float, float]:
    """Root mean square distances [m] from a rigid body and from its mirror image.

    Medians over up to 200 frames with three points or more, infinite without any.

    Args:
        places: of the points on the body (m, 3) [m].
        points: observed (k, m, 3) [m], NaN where missing.
    """
    rows = np.flatnonzero(np.sum(~np.isnan(points[:, :, 0]), axis=1) >= 3)
    if not rows.size:
        return np.inf, np.inf
    rows = rows[np.unique(np.linspace(0, rows.size - 1, _FRAMES).round().astype(int))]
    proper, mirrored = np.median([_of_frame(places, points[row]) for row in rows], axis=0)
    return float(proper), float(mirrored)


def without_stray(places: Array, points: Array) -> NDArray[np.int64]:
    """Indices of the points but for one, if the others then are nearer to a rigid body.

    Args:
        places, points: see `rigid_errors`.
    """
    everything = np.arange(len(places))
    if len(places) <= 3 or rigid_errors(places, points)[0] <= RIGID:
        return everything
    rest = [np.delete(everything, each) for each in everything]
    return min(rest, key=lambda kept: rigid_errors(places[kept], points[:, kept])[0])


def _of_frame(places: Array, observed: Array) -> tuple[float, float]:
    """Distances by the singular values of the covariance (Kabsch, Acta Cryst. A 32, 1976)."""
    seen = ~np.isnan(observed[:, 0])
    own, there = places[seen], observed[seen]
    left, right = own - own.mean(axis=0), there - there.mean(axis=0)
    u, sizes, v = np.linalg.svd(left.T @ right)
    sign = np.sign(np.linalg.det(u @ v))
    squares = float((left**2).sum() + (right**2).sum() - 2.0 * (sizes[0] + sizes[1]))
    errors = [max(squares - 2.0 * turn * sizes[2], 0.0) for turn in (sign, -sign)]
    return float(np.sqrt(errors[0] / seen.sum())), float(np.sqrt(errors[1] / seen.sum()))


def rigid_poses(places: Array, observed: Array, time: Array) -> tuple[Array, Array]:
    """Rotations (k, 3, 3) and positions (k, 3) that place points on a rigid body's observed ones.

    By least squares in every frame with three points seen or more (Kabsch, Acta Crystallographica A
    32, 1976), in the others interpolated.

    Args:
        places: of the points on the body (m, 3) [m].
        observed: (k, m, 3) [m], NaN where missing.
        time: (k,) [s].

    Raises:
        ValueError: no frame shows three points that are not in line.
    """
    rotations, positions = np.zeros((time.size, 3, 3)), np.zeros((time.size, 3))
    known = np.zeros(time.size, dtype=bool)
    for k, seen in enumerate(~np.isnan(observed[:, :, 0])):
        if seen.sum() < 3:
            continue
        own, there = places[seen], observed[k, seen]
        left, right = own - own.mean(axis=0), there - there.mean(axis=0)
        u, sizes, v = np.linalg.svd(left.T @ right)
        if sizes[1] < 1e-4 * sizes[0]:
            continue
        flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))])
        rotations[k] = v.T @ flip @ u.T
        positions[k] = there.mean(axis=0) - rotations[k] @ own.mean(axis=0)
        known[k] = True
    if not known.any():
        raise ValueError(
            "base='free' needs three markers of the thorax (of the model's base) in one frame at "
            "least, not in line; give positions in the base's axes and base='fixed' otherwise"
        )
    at = np.clip(time, time[known][0], time[known][-1])
    if known.sum() == 1:
        return np.repeat(rotations[known], time.size, 0), np.repeat(positions[known], time.size, 0)
    turning = scipy.spatial.transform.Slerp(
        time[known], scipy.spatial.transform.Rotation.from_matrix(rotations[known])
    )
    moving = [np.interp(at, time[known], positions[known, axis]) for axis in range(3)]
    return turning(at).as_matrix(), np.stack(moving, axis=1)


_LEANING = 60.0  # angle of the trunk from the vertical, in the mean over time, that is asked about
_BETTER = 0.5  # share of their distances from a rigid trunk, below which markers are mirrored


def check_trunk(chosen: ChosenMarkers, observed: Array, *, ask_up: bool) -> None:
    """Check the markers of the thorax or, without three of them, the pelvis.

    Args:
        chosen: markers and where they are.
        observed: their positions (k, m, 3) [m], NaN where missing.
        ask_up: whether a person who does not stand upright is asked about.

    Raises:
        ValueError: the trunk is more than 60 deg from the vertical, in the mean over time; or its
            markers are those of a mirrored person.
    """
    for segment in ("thorax", "pelvis"):
        columns = [place for place, each in enumerate(chosen.segments) if each == segment]
        seen = ~np.isnan(observed[:, columns, 0])
        rows = np.flatnonzero(seen.sum(axis=1) >= 3)
        if rows.size:
            break
    else:
        return
    rows = rows[np.unique(np.linspace(0, rows.size - 1, _FRAMES).round().astype(int))]
    places, points = chosen.places[columns], observed[np.ix_(rows, columns)]
    proper, mirrored = rigid_errors(places, points)
    if proper > RIGID and mirrored < _BETTER * proper:
        raise ValueError(
            f"positions: the markers of the {segment} are those of a mirrored person "
            f"({1e3 * proper:.0f} mm from a rigid {segment}, {1e3 * mirrored:.0f} mm from a "
            "mirrored one): right and left may be exchanged in the names, or the axes left-handed"
        )
    if not ask_up:
        return
    kept = without_stray(places, points)
    _check_up(places[kept], points[:, kept], segment)


def _check_up(places: Array, points: Array, segment: str) -> None:
    try:
        rotations, _ = rigid_poses(places, points, np.arange(float(len(points))))
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
