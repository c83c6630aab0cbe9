"""Markers in tables of comma-separated values.

    # unit: mm
    time,RSHO_x,RSHO_y,RSHO_z,RELB_x,...
    0.00,103.2,...

Lines that start with # come first; `unit` (m, cm or mm) is required, `height` [m], `mass` [kg] and
`subject` are optional. Time is in seconds. A marker is missing where its three cells are empty.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.formats.csv_table import read_csv_text
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.recordings.units import LENGTHS


def read_marker_table(file: Path) -> Markers:
    """Read all markers in a table; columns that are not of a marker are left out.

    Raises:
        RecordingError: no unit, header or marker, a row of the wrong length, or an entry that is
            not a finite number; the message names the line.
    """
    table = read_csv_text(file, LENGTHS, ("mm", "m"))
    ends = [f"_{axis}" for axis in "xyz"]
    names = [name.removesuffix("_x") for name in table.header if name.endswith("_x")]
    names = [name for name in names if all(name + end in table.header for end in ends)]
    if not names:
        raise RecordingError(f"{file}: the header names no marker by NAME_x, NAME_y, NAME_z")
    time = table.columns(["time"])[:, 0]
    values = table.columns([name + end for name in names for end in ends], blank=np.nan)
    try:
        positions = table.scale * values.reshape(len(time), len(names), 3)
        return Markers(time, tuple(names), positions, table.subject)
    except ValueError as failure:
        raise RecordingError(f"{file}: {failure}") from None
