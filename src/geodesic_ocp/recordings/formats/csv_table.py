"""Comma-separated tables of joint angles: numbers, headers and units.

# unit: rad
    # height: 1.78
    time,RSx_joint,RSz_joint,...
    0.00,0.1231,...

Lines that start with # come first; `unit` (rad or deg, of all joints) is required, `height` [m],
`mass` [kg] and `subject` are optional. Time is in seconds.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.recording import ask_about_degrees
from geodesic_ocp.recordings.units import ANGLES
from geodesic_ocp.records import write_file
from geodesic_ocp.tables import new_table
from geodesic_ocp.trajectory.motion import Motion, Subject


def finite_number(where: str, name: str, text: str) -> float:
    """The number in a cell.

    Args:
        where: the file and the line.
        name: name of the column.
        text: in the cell.

    Raises:
        RecordingError: the text is not a finite number.
    """
    try:
        number = float(text)
    except ValueError:
        raise RecordingError(f"{where}: {name} is not a number: {text[:40]!r}") from None
    if not math.isfinite(number):
        raise RecordingError(f"{where}: {name} is {number}")
    return number


_NOTES = ("unit", "height", "mass", "subject")


@dataclass(frozen=True)
class CsvText:
    """A table whose lines with # come first, then a header with the column `time`, then rows.

    Attributes:
        file: from which it was read.
        scale: scale of its unit, to radians or metres.
        subject: the person that its notes describe.
        header: names of the columns.
        lines: lines of the rows, as text.
        start: number of lines before them.
    """

    file: Path
    scale: float
    subject: Subject
    header: tuple[str, ...]
    lines: tuple[str, ...]
    start: int

    def columns(self, names: Sequence[str], blank: float | None = None) -> Array:
        """Numbers in these columns (k, n), in this order; the others may contain anything.

        Args:
            names: names of the columns.
            blank: what an empty cell, or one with nan, stands for; None refuses it.

        Raises:
            RecordingError: a row of the wrong length, or an entry that is not a finite number.
        """
        rows = []
        indices = [self.header.index(name) for name in names]
        reader = csv.reader(self.lines)
        for row in reader:
            where = f"{self.file}: line {self.start + reader.line_num}"
            if not row:
                continue
            if len(row) != len(self.header):
                raise RecordingError(
                    f"{where} has {len(row)} entries, the header {len(self.header)}"
                )
            cells = [row[index] for index in indices]
            rows.append([_number(where, *each, blank) for each in zip(names, cells, strict=True)])
        return np.array(rows, dtype=float).reshape(len(rows), len(names))


def read_csv_text(file: Path, units: dict[str, float], examples: tuple[str, str]) -> CsvText:
    """Read the notes and the header of a table; `examples` are the units that messages name.

    Raises:
        RecordingError: no unit or header, notes that contradict each other or are not positive
            numbers, or a name that occurs twice; the message names the line.
        UnicodeDecodeError, csv.Error: the file is not text, or not a table.
    """
    lines = file.read_text(encoding="utf-8-sig").splitlines()
    notes: dict[str, str] = {}
    first = 0
    while first < len(lines) and (lines[first].startswith("#") or not lines[first].strip()):
        key, colon, value = lines[first].lstrip("# ").partition(":")
        key, value = key.strip().lower(), value.strip().rstrip(",; \t")
        if colon and notes.setdefault(key, value) != value and key in _NOTES:
            raise RecordingError(
                f"{file}: line {first + 1} gives the {key} again, with another value"
            )
        first += 1
    if first == len(lines):
        raise RecordingError(f"{file}: has no header with the names of columns")
    unit = notes.get("unit", "")
    if unit.lower() not in units:
        raise RecordingError(
            f"{file}: a line '# unit: {examples[0]}' or '# unit: {examples[1]}' must precede the "
            f"header{f', not {unit[:40]!r}' if unit else ''}"
        )
    header = tuple(name.strip() for name in next(csv.reader([lines[first]]), []))
    if "time" not in header or len(header) < 2:
        raise RecordingError(
            f"{file}: line {first + 1} must be a header with 'time' and names of columns, "
            f"is {lines[first][:60]!r}" + _hint(lines[first], header)
        )
    twice = sorted({name for name in header if header.count(name) > 1})
    if twice:
        raise RecordingError(f"{file}: the header names {', '.join(twice)} more than once")
    subject = Subject(
        _positive_number(file, notes, "height"),
        _positive_number(file, notes, "mass"),
        notes.get("subject", ""),
    )
    scale = units[unit.lower()]
    return CsvText(file, scale, subject, header, tuple(lines[first + 1 :]), first + 1)


def _hint(line: str, header: Sequence[str]) -> str:
    """Return what may be wrong with a header, as the end of a message."""
    if {";", "\t"} & set(line):
        return "; separate columns by commas, and write decimals with a point"
    like = next((name for name in header if re.match(r"time\b|t\b|zeit\b", name, re.I)), None)
    return f"; if {like!r} is the time in seconds, name it time" if like is not None else ""


def _number(where: str, name: str, text: str, blank: float | None) -> float:
    if blank is not None and text.strip().lower() in ("", "nan"):
        return blank
    return finite_number(where, name, text)


def _positive_number(file: Path, notes: dict[str, str], key: str) -> float | None:
    if key not in notes:
        return None
    try:
        number = float(notes[key])
    except ValueError:
        number = np.nan
    if not np.isfinite(number) or number <= 0.0:
        raise RecordingError(f"{file}: '# {key}: {notes[key][:40]}' must be a positive number")
    return number


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


def save_motion(path: str | PathLike[str], motion: Motion) -> Path:
    """Write a motion as the table (CSV) that `read_motion` reads, with all digits.

    Time in s, joint coordinates in rad or m, and what is known of the subject. Velocities, the
    coordinates before filtering, and the pose of the trunk are not written.

    Raises:
        ValueError: the name of the file does not end in .csv.
        OSError: the file cannot be written.
    """
    file = Path(path)
    if file.suffix.lower() != ".csv":
        raise ValueError(f"path must end in .csv, got {file.name!r}")
    subject = motion.subject
    notes = {"unit": "rad", "height": subject.height, "mass": subject.mass}
    lines = [f"# {key}: {value}" for key, value in notes.items() if value is not None]
    if subject.name:
        lines.append(f"# subject: {' '.join(subject.name.split())}")
    rows = np.column_stack([motion.time, motion.q]).tolist()
    table = new_table(("time", *motion.joint_names), rows).to_csv()
    return write_file(file, "\n".join([*lines, table]))
