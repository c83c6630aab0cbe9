"""Positions of markers from files."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.formats.recognise import FORMATS, recognise
from geodesic_ocp.recordings.formats.text_lines import named_failures
from geodesic_ocp.recordings.markers.markers import (
    Axis,
    Markers,
    as_axis,
    check_plausible_size,
    with_z_up,
)


def read_markers(path: str | PathLike[str], *, up: Axis | None = None) -> Markers:
    """Read the positions of markers from a file: c3d, TRC, CSV of Vicon Nexus, TSV of Qualisys,
    Motion-BIDS, or a table with NAME_x, NAME_y, NAME_z.

    The content of the file tells its format. Positions are converted to metres, in the axes of
    the file unless `up` is given; a marker that was not seen is NaN.

    Args:
        path: path of the file.
        up: the axis of the file that points upwards, such as "y" or "-z"; the space is turned so
            that it becomes z, which `fit_markers` needs. Formats leave it open: TRC files for
            OpenSim mostly have y up, c3d files z.

    Raises:
        RecordingError: the file is missing, of an unknown format, or malformed, or its positions
            are not those of a person in the unit that it states; the message names the file, the
            line or frame, and what was expected there.
        ValueError: `up` is not an axis.
    """
    file = Path(path)
    if up is not None:
        as_axis(up)
    with named_failures(file):
        kind = recognise(file)
        if FORMATS[kind].content != "markers":
            raise RecordingError(
                f"{file}: {FORMATS[kind].label} has no markers; read it with go.read_motion"
            )
        markers: Markers = FORMATS[kind].read(file)
        check_plausible_size(markers)
    return markers if up is None else with_z_up(markers, up)
