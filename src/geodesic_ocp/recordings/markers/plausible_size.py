"""Whether positions of markers can be those of a person in metres."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.recordings.markers.markers import Markers

# Markers of people in one room are not farther apart, nor farther from its origin; those of the
# smallest movements that are recorded, of one hand, are farther apart [m].
_WIDEST, _FARTHEST, _NARROWEST = 10.0, 100.0, 0.05
_IN_MM = ": are the numbers mm or cm? A file must state their unit, Markers must be in m"
_IN_M = ": are the numbers m or cm? A file must state their unit, Markers must be in m"


def check_plausible_size(markers: Markers) -> None:
    """Check markers for another unit of length than m.

    The size is that of the markers of a sample, the median over the samples in which two or more
    are seen; a few markers that are far away do not count.

    Raises:
        ValueError: they are more than 10 m or, if three or more, less than 5 cm apart, or most are
            more than 100 m from the origin; asks for the unit.
    """
    positions = markers.positions
    seen = ~np.isnan(positions[:, :, 0])
    if not seen.any():
        return
    away = float(np.median(np.abs(positions[seen]).max(axis=1)))
    if away > _FARTHEST:
        raise ValueError(f"half of the markers are over {away:.4g} m from the origin{_IN_MM}")
    rows = positions[seen.sum(axis=1) > 1]
    if not len(rows):
        return
    with np.errstate(over="ignore"):  # damaged files have numbers of any size
        middle = np.nanmedian(rows, axis=1, keepdims=True)
        # Half of the markers are within this size.
        around = np.nanmedian(np.linalg.norm(rows - middle, axis=2), axis=1)
        size = 2.0 * float(np.median(around))
        widest = float(np.max(np.nanmax(rows, axis=1) - np.nanmin(rows, axis=1)))
    if size > _WIDEST:
        raise ValueError(f"the markers of a sample are {size:.4g} m apart{_IN_MM}")
    if len(markers.names) >= 3 and widest < _NARROWEST:
        raise ValueError(f"all markers of a sample are within {widest:.3g} m{_IN_M}")
