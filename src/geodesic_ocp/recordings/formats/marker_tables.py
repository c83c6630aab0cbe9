"""Tables of markers: comma-separated values and TRC.

A TRC file, of Motion Analysis, begins with five lines: line 2 names the entries of line 3, among
them Units; line 4 names the markers after Frame# and Time, one in three columns; line 5 names the
coordinates X1, Y1, Z1. Cells are separated by tabs, commas or white space; names that are not three
columns apart are in the order of the columns, before which one may be blank. A marker is missing
where its three cells are empty or nan, in TRC also where they are exactly zero. Counts in
the header, which programs that edit such files often leave as they were, are compared with a
warning. Time is in seconds.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.recordings.markers.people import distinct_labels
from geodesic_ocp.trajectory.files.delimited import (
    Rows,
    compare_count,
    read_csv,
    read_rows,
    split_line,
)
from geodesic_ocp.trajectory.files.text_lines import LENGTHS, named_failures, read_lines


def read_marker_table(file: Path) -> Markers:
    """Read all markers in a table; columns that are not of a marker are left out.

    Raises:
        RecordingError: no unit, header or marker, a row of the wrong length, or an entry that is
            not a finite number; the message names the line.
    """
    with named_failures(file):
        table = read_csv(file, LENGTHS, ("mm", "m"))
        rows = table.rows
        names = [name.removesuffix("_x") for name in rows.names if name.endswith("_x")]
        names = [name for name in names if {f"{name}_y", f"{name}_z"} <= set(rows.names)]
        if not names:
            raise RecordingError("the header names no marker by NAME_x, NAME_y, NAME_z")
        columns = [f"{name}_{axis}" for name in names for axis in "xyz"]
        cells = table.scales_of(columns) * rows.columns(columns, missing=True)
        table.say_assumed(file)
        positions = cells.reshape(-1, len(names), 3)
        return Markers(table.times(), tuple(names), positions, table.subject)


def read_trc(file: Path) -> Markers:
    """Read all markers of a TRC file that have a name.

    Raises:
        RecordingError: the header is incomplete or its unit unknown, or a row is too short, too
            long or not of numbers; the message names the line.
    """
    with named_failures(file):
        lines = "\n".join(read_lines(file)).splitlines()
        if len(lines) < 5:
            raise RecordingError(f"is cut off after {len(lines)} lines, within the header")
        # Programs write several tabs, or commas, between the entries of lines 2 and 3.
        keys, values = (
            re.split(r"\s+" if "\t" in line else r"[\s,]+", line.strip()) for line in lines[1:3]
        )
        header = dict(zip(keys, values, strict=False))
        cells = _trc_cells(lines[3])
        unit = header.get("Units", "")
        if unit.lower() not in LENGTHS:
            raise RecordingError(f"line 3 must give Units m, cm or mm, not {unit[:40]!r}")
        if len(cells) < 3 or cells[0].lower().rstrip("#") != "frame" or cells[1].lower() != "time":
            raise RecordingError(
                f"line 4 must name Frame#, Time and the markers, is {lines[3][:60]!r}"
            )
        named = [(index, name) for index, name in enumerate(cells) if index >= 2 and name]
        names = [name for _, name in named]
        if not named:
            raise RecordingError("line 4 names no markers")
        names = distinct_labels(file, names)
        first = 4
        while first < len(lines) and _is_axes(lines[first]):
            first += 1
        axes = [cell for line in lines[4:first] for cell in _trc_cells(line) if cell]
        starts = _starts([index for index, _ in named], len(cells), len(axes))
        columns = ["frame", "the time", *(max(starts) + 1) * [""]]
        for name, index in zip(names, starts, strict=True):
            columns[index : index + 3] = 3 * [name]
        expected = f"{{}} are needed for frame, time and {len(names)} markers"
        separator = _trc_separator(lines[first]) if first < len(lines) else None
        row = split_line(lines[first].rstrip(), separator) if first < len(lines) else []
        if len(row) > len(columns) and not row[2] and row[-1]:  # a blank column before the markers
            columns.insert(2, "")
            starts = [index + 1 for index in starts]
        rows = read_rows(lines, first, columns, separator, expected)
        compare_count(file, header, "NumFrames", "frames", len(rows.cells))
        compare_count(file, header, "NumMarkers", "markers", len(names))
        indices = [index + k for index in starts for k in range(3)]
        positions = rows.at(indices, missing=True).reshape(-1, len(names), 3)
        check_whole(rows, names, positions)
        positions[np.all(positions == 0.0, axis=2)] = np.nan
        return Markers(rows.at([1])[:, 0], tuple(names), LENGTHS[unit.lower()] * positions)


def check_whole(rows: Rows, names: Sequence[str], positions: Array) -> None:
    """Raise RecordingError, with the line, if a marker has some of its coordinates (k, m, 3)
    only.
    """
    some = np.isnan(positions).any(axis=2) & ~np.isnan(positions).all(axis=2)
    for row, marker in np.argwhere(some)[:1].tolist():
        raise RecordingError(
            f"line {rows.lines[row]}: {names[marker]} has some of its three coordinates only"
        )


def _starts(named: Sequence[int], count: int, axes: int) -> list[int]:
    """Return the first column of every marker: names are three columns apart, where some may be
    empty, or else those of all markers.

    Args:
        named: indices of the cells with names in line 4.
        count: number of its cells.
        axes: number of the coordinates X1, Y1, Z1, ... in line 5; 0 without it.
    """
    if all((index - 2) % 3 == 0 for index in named) and count > len(named) + 2:
        return list(named)
    if axes and axes != 3 * len(named):
        raise RecordingError(
            f"line 4 names {len(named)} markers, which must be three columns apart, but line 5 has "
            f"{axes} coordinates"
        )
    return [2 + 3 * place for place in range(len(named))]


def _trc_separator(line: str) -> str | None:
    return next((each for each in "\t," if each in line), None)


def _trc_cells(line: str) -> list[str]:
    return split_line(line, _trc_separator(line))


def _is_axes(line: str) -> bool:
    """Return whether this is the line X1, Y1, Z1, ..., or an empty one."""
    return all(re.fullmatch(r"[XYZ]\d+|", cell) for cell in _trc_cells(line))
