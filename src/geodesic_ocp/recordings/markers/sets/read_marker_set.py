"""as_marker_set: a marker set from its file."""

from __future__ import annotations

from dataclasses import fields
from os import PathLike
from pathlib import Path

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.read_convention_record import read_convention_record
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
    file = Path(given)
    record = read_convention_record(file)
    known = [each.name for each in fields(MarkerSet)]
    if not isinstance(record, dict) or "places" not in record or not set(record) <= set(known):
        raise RecordingError(
            f"{file}: a marker set has the keys {', '.join(known)}, of which 'places' is required"
        )
    try:
        return MarkerSet(**{"name": file.stem, **record})
    except (AttributeError, TypeError, ValueError) as failure:
        raise RecordingError(f"{file}: {failure}") from None
