"""The height of a standing person from markers on head and feet."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.recordings.markers.markers import Markers

# Heights of markers above the ground when the person stands upright, as fractions of body height:
# the reference model of the Master Motor Map (hip 0.530, from there to the vertex 0.470), its
# markers of head and feet. LANK and LHEE include the height of the ankle, 0.039.
_HEAD = {"RFHD": 0.970, "LFHD": 0.970, "RBHD": 0.955, "LBHD": 0.955}
_FEET = {"RANK": 0.02075, "LANK": 0.02075, "RHEE": 0.0135, "LHEE": 0.0135}
_UPRIGHT = 90.0  # percentile of the heights over time: people bend more often than they stretch


def standing_height(positions: Markers) -> float | None:
    """Body height [m] from the markers of head and feet, in a space with z up; None without them.

    The mean over the pairs of a marker of the head and one of the feet of their vertical distance,
    divided by what it is at a height of 1 m, when the person stands as upright as at any time.
    """
    plain = {name.rpartition(":")[2].upper(): index for index, name in enumerate(positions.names)}
    pairs = [
        (positions.positions[:, plain[head], 2] - positions.positions[:, plain[foot], 2])
        / (_HEAD[head] - _FEET[foot])
        for head in _HEAD
        for foot in _FEET
        if head in plain and foot in plain
    ]
    known = [pair for pair in pairs if np.isfinite(pair).any()]
    if not known:
        return None
    height = float(np.mean([np.nanpercentile(pair, _UPRIGHT) for pair in known]))
    return height if 0.4 < height < 2.6 else None
