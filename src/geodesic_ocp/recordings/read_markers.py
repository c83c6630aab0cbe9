"""Positions of markers from files."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.formats.recognise import FORMATS, MARKERS, recognise
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.recordings.named_failures import named_failures


def read_markers(path: str | PathLike[str]) -> Markers:
    """Read the positions of markers from a file: c3d, TRC or a table with NAME_x, NAME_y, NAME_z.

    The format is told by the content of the file. Positions are converted to metres, in the axes of
    the file; a marker that was not seen is NaN.

    Raises:
        RecordingError: the file is missing, of an unknown format, or malformed; the message names
            the file, the line or frame, and what was expected there.
    """
    file = Path(path)
    with named_failures(file):
        kind = recognise(file)
        if kind not in MARKERS:
            raise RecordingError(
                f"{file}: {FORMATS[kind]} has no markers; read it with go.read_motion"
            )
        return _read(kind, file)


def _read(kind: str, file: Path) -> Markers:
    """Each reader is imported when it is needed."""
    if kind == "c3d":
        from geodesic_ocp.recordings.formats.markers.c3d import read_c3d

        return read_c3d(file)
    if kind == "trc":
        from geodesic_ocp.recordings.formats.markers.trc import read_trc

        return read_trc(file)
    from geodesic_ocp.recordings.formats.markers.marker_table import (
        read_marker_table,
    )

    return read_marker_table(file)
