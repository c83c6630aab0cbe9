"""Motions in tables of comma-separated values.

    # unit: rad
    # height: 1.78
    time,RSx_joint,RSz_joint,...
    0.00,0.1231,...

Lines that start with # come first; `unit` (rad or deg, of all joints) is required, `height` [m],
`mass` [kg] and `subject` are optional. Time is in seconds.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.trajectory.motion import Motion, Subject

_NOTES = ("unit", "height", "mass", "subject")
_UNITS = {"rad": 1.0, "deg": np.pi / 180.0}


def read_table(file: Path, joints: Sequence[str] | None = None) -> Motion:
    """Read the motion of these joints, or of all, from a table.

    Raises:
        RecordingError: no unit or header, a missing joint, a row of the wrong length, or an entry
            that is not a finite number; the message names the line.
    """
    lines = file.read_text(encoding="utf-8-sig").splitlines()
    notes: dict[str, str] = {}
    first = 0
    while first < len(lines) and (lines[first].startswith("#") or not lines[first].strip()):
        key, colon, value = lines[first].lstrip("# ").partition(":")
        key, value = key.strip().lower(), value.strip()
        if colon and notes.setdefault(key, value) != value and key in _NOTES:
            raise RecordingError(
                f"{file}: line {first + 1} gives the {key} again, with another value"
            )
        first += 1
    if first == len(lines):
        raise RecordingError(f"{file}: has no header with joint names")
    if notes.get("unit") not in _UNITS:
        raise RecordingError(
            f"{file}: a line '# unit: rad' or '# unit: deg' must precede the header"
            + (f", not '# unit: {notes['unit']}'" if "unit" in notes else "")
        )
    header = [name.strip() for name in next(csv.reader([lines[first]]))]
    if "time" not in header or len(header) < 2:
        raise RecordingError(
            f"{file}: line {first + 1} must be a header with 'time' and joint names, "
            f"is {lines[first][:60]!r}"
            + ("; separate columns by commas" if ";" in lines[first] else "")
        )
    twice = sorted({name for name in header if header.count(name) > 1})
    if twice:
        raise RecordingError(f"{file}: the header names {', '.join(twice)} more than once")
    others = [name for name in header if name != "time"]
    wanted = list(joints) if joints is not None else others
    missing = [name for name in wanted if name not in others]
    if missing:
        raise RecordingError(
            f"{file}: there is no joint {', '.join(missing)}; there are {', '.join(others)}"
        )
    values = _rows(file, lines, first + 1, header, ["time", *wanted])
    subject = Subject(
        _positive_number(file, notes, "height"),
        _positive_number(file, notes, "mass"),
        notes.get("subject", ""),
    )
    angles = _UNITS[notes["unit"]] * values[:, 1:]
    try:
        return Motion(values[:, 0], angles, tuple(wanted), subject=subject)
    except ValueError as failure:
        raise RecordingError(f"{file}: {failure}") from None


def _rows(
    file: Path, lines: list[str], start: int, header: list[str], wanted: list[str]
) -> np.ndarray:
    """Numbers in these columns, in this order; the other columns may contain anything."""
    rows = []
    columns = [header.index(name) for name in wanted]
    for number, row in enumerate(csv.reader(lines[start:]), start=start + 1):
        if not row:
            continue
        if len(row) != len(header):
            raise RecordingError(
                f"{file}: line {number} has {len(row)} entries, the header {len(header)}"
            )
        numbers = []
        for column in columns:
            try:
                numbers.append(float(row[column]))
            except ValueError:
                raise RecordingError(
                    f"{file}: line {number}: {header[column]} is not a number: {row[column][:40]!r}"
                ) from None
            if not np.isfinite(numbers[-1]):
                raise RecordingError(f"{file}: line {number}: {header[column]} is {numbers[-1]}")
        rows.append(numbers)
    return np.array(rows, dtype=float).reshape(len(rows), len(wanted))


def _positive_number(file: Path, notes: dict[str, str], key: str) -> float | None:
    if key not in notes:
        return None
    try:
        number = float(notes[key])
    except ValueError:
        number = np.nan
    if not np.isfinite(number) or number <= 0.0:
        raise RecordingError(f"{file}: '# {key}: {notes[key]}' must be a positive number")
    return number
