"""Markers in TRC files, the table of Motion Analysis that OpenSim reads.

Line 1 begins with PathFileType; line 2 names the entries of line 3, among them Units; line 4 names
the markers after Frame# and Time, one in three columns; line 5 names the coordinates X1, Y1, Z1,
and rows follow. Cells are separated by tabs, or by blanks if the file has no tabs. A marker is
missing where its cells are empty or nan, or where all three are exactly zero. The counts of frames
and markers in line 3, which programs that edit such files often leave as they were, are compared
with a warning.

# unit: mm
    time,RSHO_x,RSHO_y,RSHO_z,RELB_x,...
    0.00,103.2,...

Lines that start with # come first; `unit` (m, cm or mm) is required, `height` [m], `mass` [kg] and
`subject` are optional. Time is in seconds. A marker is missing where its three cells are empty.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.formats.csv_table import finite_number, read_csv_text
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.recordings.units import LENGTHS

_MISSING = ("", "nan", "-nan")


def read_trc(file: Path) -> Markers:
    """Read all markers that have a name.

    Raises:
        RecordingError: the header is incomplete or its unit unknown, or a row is too short, too
            long or not of numbers; the message names the line.
    """
    lines = _text(file).splitlines()
    if len(lines) < 5:
        raise RecordingError(f"{file}: is cut off after {len(lines)} lines, within the header")
    header = dict(zip(_cells(lines[1]), _cells(lines[2]), strict=False))
    scale = _scale(file, header)
    names = _markers(file, lines)
    width = max(names.values()) + 3
    times, rows = [], []
    for number, line in enumerate(lines[4:], start=5):
        cells = _cells(line)
        if not any(cells) or (number <= 6 and _is_axes(cells)):
            continue
        where = f"{file}: line {number}"
        if len(cells) < width or any(cells[width:]):
            raise RecordingError(
                f"{where} has {len(cells)} entries, {width} are needed for frame, time and "
                f"{len(names)} markers"
            )
        times.append(finite_number(where, "the time", cells[1]))
        rows.append(
            [_position(where, name, cells[column : column + 3]) for name, column in names.items()]
        )
    _compare(file, header, "NumFrames", "frames", len(rows))
    _compare(file, header, "NumMarkers", "markers", len(names))
    positions = np.array(rows, dtype=float).reshape(len(times), len(names), 3)
    positions[np.all(positions == 0.0, axis=2)] = np.nan
    try:
        return Markers(np.array(times), tuple(names), scale * positions)
    except ValueError as failure:
        raise RecordingError(f"{file}: {failure}") from None


def _text(file: Path) -> str:
    """Text in UTF-8, or in Latin 1, in which older programs write paths and names."""
    content = file.read_bytes()
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.split("\t")] if "\t" in line else line.split()


def _compare(file: Path, header: dict[str, str], key: str, what: str, found: int) -> None:
    if key in header and header[key] != str(found):
        warnings.warn(
            f"{file}: its header says {header[key][:40]} {what}, it has {found}; these are read",
            RuntimeWarning,
            stacklevel=5,
        )


def _scale(file: Path, header: dict[str, str]) -> float:
    """Metres in the unit of the file."""
    unit = header.get("Units", "")
    if unit.lower() not in LENGTHS:
        raise RecordingError(f"{file}: line 3 must give Units m, cm or mm, not {unit[:40]!r}")
    return LENGTHS[unit.lower()]


def _markers(file: Path, lines: list[str]) -> dict[str, int]:
    """The column of x of every named marker."""
    cells = _cells(lines[3])
    if len(cells) < 3 or cells[0].lower().rstrip("#") != "frame" or cells[1].lower() != "time":
        raise RecordingError(
            f"{file}: line 4 must name Frame#, Time and the markers, is {lines[3][:60]!r}"
        )
    named = [(index, name) for index, name in enumerate(cells) if index >= 2 and name]
    if not named:
        raise RecordingError(f"{file}: line 4 names no markers")
    names = [name for _, name in named]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise RecordingError(f"{file}: line 4 names {', '.join(twice)} more than once")
    if all((index - 2) % 3 == 0 for index, _ in named) and len(cells) > len(names) + 2:
        return {name: index for index, name in named}
    if any(index != place for place, (index, _) in enumerate(named, start=2)):
        raise RecordingError(f"{file}: line 4: the names of markers must be three columns apart")
    return {name: 2 + 3 * place for place, name in enumerate(names)}


def _is_axes(cells: list[str]) -> bool:
    """Return whether this is the line X1, Y1, Z1, ..."""
    return all(re.fullmatch(r"[XYZ]\d+", cell) for cell in cells if cell)


def _position(where: str, name: str, cells: list[str]) -> list[float]:
    """Coordinates of a marker, nan where it is missing."""
    missing = [cell.lower() in _MISSING for cell in cells]
    if all(missing):
        return [np.nan] * 3
    if any(missing):
        raise RecordingError(f"{where}: {name} has some of its three coordinates only")
    return [finite_number(where, name, cell) for cell in cells]


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
