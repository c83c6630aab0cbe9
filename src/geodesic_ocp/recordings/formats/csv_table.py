"""Motions in tables of comma-separated values.

    # unit: rad
    # height: 1.78
    time,RSx_joint,RSz_joint,...
    0.00,0.1231,...

Lines that start with # come first; `unit` (rad or deg, of all joints) is required, `height` [m],
`mass` [kg] and `subject` are optional. Time is in seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.formats.csv_text import read_csv_text
from geodesic_ocp.recordings.plausible import ask_about_degrees
from geodesic_ocp.recordings.units import ANGLES
from geodesic_ocp.trajectory.motion import Motion


def read_table(file: Path, joints: Sequence[str] | None = None) -> Motion:
    """Read the motion of these joints, or of all, from a table.

    Raises:
        RecordingError: no unit or header, a missing joint, a row of the wrong length, or an entry
            that is not a finite number; the message names the line.
    """
    table = read_csv_text(file, ANGLES, ("rad", "deg"))
    others = [name for name in table.header if name != "time"]
    wanted = list(joints) if joints is not None else others
    missing = [name for name in wanted if name not in others]
    if missing:
        raise RecordingError(
            f"{file}: there is no joint {', '.join(missing)}; there are {', '.join(others)}"
        )
    values = table.columns(["time", *wanted])
    if table.scale != 1.0:
        ask_about_degrees(str(file), values[:, 1:])
    try:
        angles = table.scale * values[:, 1:]
        return Motion(values[:, 0], angles, tuple(wanted), subject=table.subject)
    except ValueError as failure:
        raise RecordingError(f"{file}: {failure}") from None
