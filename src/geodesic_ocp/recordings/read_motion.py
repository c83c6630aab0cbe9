"""Motions from files."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.formats.csv_table import read_table
from geodesic_ocp.recordings.formats.mmm import read_mmm
from geodesic_ocp.trajectory.motion import Motion

_READERS = {".xml": read_mmm, ".csv": read_table}


def read_motion(path: str | Path, joints: Sequence[str] | None = None) -> Motion:
    """Read a recorded motion from a file: MMM (.xml, both layouts) or a table (.csv).

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv")
    >>> len(motion), motion.joint_names[:3]
    (840, ('LSx_joint', 'LSz_joint', 'LSy_joint'))

    Args:
        path: of the file.
        joints: names of the joints to read, in the order of the result; all by default.

    Raises:
        RecordingError: the file is missing, of an unknown format, or malformed; the message names
            the file, the line or element, and what was expected there.
    """
    file = Path(path)
    if not file.is_file():
        what = "is a folder, not a file" if file.is_dir() else "there is no such file"
        raise RecordingError(f"{file}: {what}")
    if joints is not None and (isinstance(joints, str) or not joints):
        raise ValueError(f"joints must be a sequence of names or None, got {joints!r}")
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise RecordingError(f"{file}: a recording ends in .xml (MMM) or .csv, not {file.suffix!r}")
    try:
        return reader(file, joints)
    except OSError as failure:
        raise RecordingError(f"{file}: cannot be read: {failure.strerror}") from None
    except csv.Error as failure:
        raise RecordingError(f"{file}: is not a table: {failure}") from None
    except UnicodeDecodeError as failure:
        raise RecordingError(f"{file}: is not text in UTF-8 (byte {failure.start})") from None
