"""Which markers of a recording are fitted, and where they belong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.recordings.markers.program.body import MarkedBody
from geodesic_ocp.recordings.markers.sets.known_marker_sets import MARKER_SETS
from geodesic_ocp.recordings.markers.sets.marker_set import MarkerSet


@dataclass(frozen=True, eq=False)
class ChosenMarkers:
    """Markers of a recording that a marker set places on a body.

    Attributes:
        set_name: name of the marker set.
        names: in the recording (m,).
        columns: of the recording (m,).
        segments: that they are fixed to.
        places: on these segments, at the height of the body's model (m, 3) [m].
        uncertainty: of the places (m,) [m].
        left_out: names of the recording that are not used.
    """

    set_name: str
    names: tuple[str, ...]
    columns: NDArray[np.int64]
    segments: tuple[str, ...]
    places: Array
    uncertainty: Array
    left_out: tuple[str, ...]


def choose_markers(
    body: MarkedBody, positions: Markers, marker_set: MarkerSet | None, height_factor: float
) -> ChosenMarkers:
    """The markers that a set, or of the known sets the one with most of them, places on the body.

    Offsets in metres are divided by `height_factor`, by which the body is to be scaled.

    Raises:
        ValueError: no marker is seen at all; the set has no marker of the recording on this body;
            or it gives offsets as fractions of a height that the model does not have.
    """
    candidates = [marker_set] if marker_set is not None else [*MARKER_SETS, _frames(body)]
    if body.height is None:
        if marker_set is not None and marker_set.unit == "height":
            raise ValueError(
                f"marker_set {marker_set.name!r} gives offsets as fractions of the body height, "
                f"which {body.model.name!r} does not have; give them in metres (unit='m')"
            )
        candidates = [each for each in candidates if each.unit == "m"]
    if np.isnan(positions.positions).all():
        raise ValueError("positions: no marker is seen in any sample")
    matches = [_on_body(body, positions, each) for each in candidates]
    best = int(np.argmax([len(match) for match in matches]))
    match, used = matches[best], candidates[best]
    if not match:
        known = marker_set.name if marker_set is not None else "the known marker sets"
        raise ValueError(
            f"none of the markers {', '.join(positions.names[:20])} is one of {known} on "
            f"{body.model.name!r}; say where they are with marker_set=MarkerSet(...), "
            "or in a file (--marker-set)"
        )
    unit = float(body.height or 0.0) if used.unit == "height" else 1.0 / height_factor
    return ChosenMarkers(
        used.name,
        tuple(match),
        np.array([positions.names.index(name) for name in match]),
        tuple(used.places[marker][0] for marker in match.values()),
        unit * np.array([used.places[marker][1] for marker in match.values()]),
        np.array([used.uncertainty_of(marker) for marker in match.values()]),
        tuple(name for name in positions.names if name not in match),
    )


def _on_body(body: MarkedBody, positions: Markers, used: MarkerSet) -> dict[str, str]:
    seen = np.flatnonzero(~np.isnan(positions.positions[:, :, 0]).all(axis=0))
    names = tuple(positions.names[column] for column in seen)
    found = used.matching(names)
    return {name: marker for name, marker in found.items() if body.has(used.places[marker][0])}


def _frames(body: MarkedBody) -> MarkerSet:
    """The frames of the model as points that may be recorded by their names."""
    frames = [str(frame.name) for frame in list(body.model.pin.frames)[1:]]
    places = {frame: (frame, (0.0, 0.0, 0.0)) for frame in frames}
    return MarkerSet("frames of the model", places, "m", 0.0)
