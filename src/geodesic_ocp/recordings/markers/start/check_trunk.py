"""Whether the markers of a trunk stand upright, and are on the sides that their names say."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.markers.program.chosen_markers import ChosenMarkers
from geodesic_ocp.recordings.markers.start.frame_search import rigid_poses
from geodesic_ocp.recordings.markers.start.rigid_markers import (
    RIGID,
    rigid_errors,
    without_stray,
)

_LEANING = 60.0  # angle of the trunk from the vertical, in the mean over time, that is asked about
_FRAMES = 200
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
