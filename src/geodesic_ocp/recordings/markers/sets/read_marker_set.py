"""as_marker_set: a marker set from its file."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from geodesic_ocp.recordings.conventions.read_convention_record import from_record
from geodesic_ocp.recordings.markers.sets.marker_set import MarkerSet


def as_marker_set(given: MarkerSet | str | PathLike[str] | None) -> MarkerSet | None:
    """The marker set itself, or the one in a JSON or TOML file with the attributes as its keys.

        {"name": "laboratory", "unit": "m", "uncertainty": {"dial": 0.02},
         "places": {"dial": ["left forearm", [-0.03, 0.0, -0.22]]}}

    Raises:
        RecordingError: the file is missing or malformed, or its keys or values are others.
        ValueError: the argument is neither a marker set nor a path.
    """
    if given is None or isinstance(given, MarkerSet):
        return given
    if not isinstance(given, (str, PathLike)):
        raise ValueError(f"marker_set must be a MarkerSet or a file, got {given!r}")
    return from_record(MarkerSet, Path(given), "places", "a marker set")
