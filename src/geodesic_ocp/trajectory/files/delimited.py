"""Delimited tables of recordings: notes, header and rows.

A table of joint angles or of markers (CSV) begins with notes, of which `unit` (rad or deg, or m, cm
or mm) is required unless the columns state theirs, while `height` [m], `mass` [kg] and `subject`
are optional::

    # unit: mm
    # height: 1.78
    time,RSHO_x,RSHO_y,RSHO_z,...

Columns may also be separated by semicolons or tabs, with decimal commas, and `Time (ms)` or
`RSx_joint [deg]` state a unit; a warning says what was assumed.
"""

from __future__ import annotations

import csv
import math
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.trajectory.files.text_lines import (
    is_time,
    name_and_unit,
    read_lines,
    times_at,
)
from geodesic_ocp.trajectory.motion import Subject

# What programs write for a missing number, as pandas.read_csv reads it, too.
_MISSING = ("", "nan", "-nan", "na", "n/a", "#n/a", "null", "none")


@dataclass(frozen=True)
class Rows:
    """Cells of a table as text."""

    names: tuple[str, ...]  # names of the columns
    cells: list[list[str]]  # one list of as many entries for each row
    lines: list[int]  # number of the line of each row

    def columns(self, names: Sequence[str], *, missing: bool = False) -> Array:
        """Return numbers in these columns (k, n), in this order; others may contain anything.

        Args:
            missing: read empty cells and nan as NaN; otherwise they are refused.

        Raises:
            RecordingError: an entry is not a finite number; the message names the line.
        """
        return self.at([self.names.index(name) for name in names], missing=missing)

    def at(self, indices: Sequence[int], *, missing: bool = False) -> Array:
        """Return numbers in the columns with these indices (k, n), see `columns`."""
        rows = [
            [
                math.nan
                if missing and row[index].lower() in _MISSING
                else _finite_number(f"line {line}", self.names[index], row[index])
                for index in indices
            ]
            for row, line in zip(self.cells, self.lines, strict=True)
        ]
        return np.array(rows, dtype=float).reshape(len(rows), len(indices))


def _finite_number(where: str, name: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        raise RecordingError(f"{where}: {name} is not a number: {text[:40]!r}") from None
    if not math.isfinite(number):
        raise RecordingError(f"{where}: {name} is {number}")
    return number


def split_line(line: str, separator: str | None) -> list[str]:
    """Return the entries of a line; a separator of None is any white space."""
    entries = (
        line.split() if separator is None else next(csv.reader([line], delimiter=separator), [])
    )
    return [entry.strip() for entry in entries]


def read_rows(
    lines: Sequence[str],
    start: int,
    names: Sequence[str],
    separator: str | None,
    expected: str = "the header {}",
    blank: str = " ,\t",
    ends: bool = True,
) -> Rows:
    """Return the rows that follow `start` lines.

    Args:
        lines: of the file.
        start: number of those before the table.
        names: names of the columns.
        separator: of the cells; None: white space.
        expected: how many cells there should be, for messages.
        blank: of these characters alone, lines are left out.
        ends: whether rows may end with separators, as those of programs often do.

    Raises:
        RecordingError: a row of another length than the names; the message names the line.
    """
    found = Rows(tuple(names), [], [])
    for number, line in enumerate(lines[start:], start + 1):
        if line.strip(blank):
            entries = split_line(line, separator)
            if ends:
                while len(entries) > len(names) and not entries[-1]:
                    entries.pop()
            if len(entries) != len(names):
                count = expected.format(len(names))
                raise RecordingError(f"line {number} has {len(entries)} entries, {count}")
            found.cells.append(entries)
            found.lines.append(number)
    return found


def check_names(where: str, names: Sequence[str]) -> None:
    """Raise RecordingError if a name occurs twice; the message begins with where they are."""
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise RecordingError(f"{where} names {', '.join(twice)} more than once")


def compare_count(file: Path, header: Mapping[str, str], key: str, what: str, found: int) -> None:
    """Yield a RuntimeWarning if a header states another count than was found."""
    if key in header and header[key] != str(found):
        warnings.warn(
            f"{file}: its header says {header[key][:40]} {what}, it has {found}; these are read",
            RuntimeWarning,
            stacklevel=4,
        )


@dataclass(frozen=True)
class Table:
    """Rows of a table with notes."""

    rows: Rows  # the rows; names without units
    # radians or metres in the unit of each column, by name; none where it states none
    scales: dict[str, float]
    scale: float | None  # those in the unit of the note; None without it
    examples: tuple[str, str]  # units that messages name
    time: str | None  # name of the column of time
    seconds: float  # seconds in its unit
    rate: float | None  # [Hz], given for a table without time
    subject: Subject  # the person
    assumed: list[str]  # what the file does not say outright, for a warning

    @property
    def others(self) -> list[str]:
        """Names of the columns but time."""
        return [name for name in self.rows.names if name != self.time]

    def times(self) -> Array:
        """Return the times (k,) [s]."""
        if self.time is None:
            return times_at(len(self.rows.cells), self.rate or math.nan)
        return self.seconds * self.rows.columns([self.time])[:, 0]

    def scales_of(self, names: Sequence[str]) -> Array:
        """Return the scales of columns; RecordingError if one has no unit."""
        if self.scale is None and not set(names) <= set(self.scales):
            raise _no_unit(self.examples)
        return np.array([self.scales.get(name, self.scale or 0.0) for name in names])

    def say_assumed(self, file: Path) -> None:
        """Yield a RuntimeWarning with everything that was assumed."""
        if self.assumed:
            warnings.warn(f"{file}: read with {'; '.join(self.assumed)}", RuntimeWarning, 4)


_SECONDS = {
    **dict.fromkeys(("s", "sec", "seconds"), 1.0),
    **dict.fromkeys(("ms", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nanoseconds"), 1e-9),
}
_SEPARATORS = {";": "semicolons", "\t": "tabs", ",": "commas"}


_OPTION = ", or its unit is given: degrees_in=True (--degrees-in) or False (--no-degrees-in)"


def _no_unit(examples: tuple[str, str], unit: str = "") -> RecordingError:
    return RecordingError(
        f"a line '# unit: {examples[0]}' or '# unit: {examples[1]}' must precede the header"
        + (f", not {unit[:40]!r}" if unit else "")
        + (_OPTION if "rad" in examples else "")
    )


def read_csv(
    file: Path,
    units: Mapping[str, float],
    examples: tuple[str, str],
    time: str | None = None,
    rate: float | None = None,
) -> Table:
    """Return a table with notes, in a known separation of columns.

    Args:
        units: radians or metres by the name of a unit.
        examples: units that messages name.
        time: name of the column of time; by default it is found.
        rate: rate [Hz] of a table without a column of time.

    Raises:
        RecordingError: no header, an unknown unit, notes that contradict each other or are not
            positive numbers, or a name that occurs twice; the message names the line.
        csv.Error: the file is not a table.
    """
    lines = read_lines(file)
    notes: dict[str, str] = {}
    first = 0
    while first < len(lines) and (lines[first].startswith("#") or not lines[first].strip()):
        key, colon, value = lines[first].lstrip("# ").partition(":")
        key = key.strip().lower()
        value = value.strip().rstrip(",; \t")
        known = key in ("unit", "height", "mass", "subject")
        if colon and notes.setdefault(key, value) != value and known:
            raise RecordingError(f"line {first + 1} gives the {key} again, with another value")
        first += 1
    if first == len(lines):
        raise RecordingError("has no header with the names of columns")
    unit = notes.get("unit", "")
    if unit and unit.lower() not in units:
        raise _no_unit(examples, unit)
    separator = next(each for each in (";", "\t", ",") if each in lines[first] or each == ",")
    cells = split_line(lines[first], separator)
    wanted = "time" if time is None else time
    times = [cell for cell in cells if cell == wanted] or [cell for cell in cells if is_time(cell)]
    if not (times or (rate and time is None)) or len(cells) < 1 + len(times[:1]):
        raise RecordingError(
            f"line {first + 1} must be a header with {wanted!r} and names of columns, "
            f"is {lines[first][:60]!r}; the rate of a table without time is given by rate "
            "(--sample-rate)"
        )
    assumed = [] if separator == "," else [f"{_SEPARATORS[separator]} between the columns"]
    names = []
    scales = {}
    seconds = 1.0
    for cell in cells:
        name, own = name_and_unit(cell)
        if cell in times[:1]:
            if own and own not in _SECONDS:
                raise RecordingError(
                    f"line {first + 1}: time must be in s, ms, us or ns, not {own!r}"
                )
            seconds = _SECONDS.get(own, 1.0)
            if cell != wanted:
                assumed.append(f"{cell!r} as the time in {own or 's'}")
        elif own in units:
            scales[name] = units[own]
        names.append(name if cell in times[:1] or own in units else cell)
    check_names("the header", names)
    height, mass = (_positive_number(notes, key) for key in ("height", "mass"))
    other = separator != ","
    blank = " ,\t" if other else " \t"
    rows = read_rows(lines, first + 1, names, separator, blank=blank, ends=other)
    if separator != "," and _has_decimal_commas(rows):
        assumed.append("decimal commas")
        points = [[cell.replace(",", ".") for cell in row] for row in rows.cells]
        rows = Rows(rows.names, points, rows.lines)
    subject = Subject(height, mass, notes.get("subject", ""))
    scale = units[unit.lower()] if unit else None
    at = names[cells.index(times[0])] if times else None
    return Table(rows, scales, scale, examples, at, seconds, rate, subject, assumed)


def _has_decimal_commas(rows: Rows) -> bool:
    cells = [cell for row in rows.cells[:20] for cell in row]
    return any(re.fullmatch(r"[-+]?\d*,\d+([eE][-+]?\d+)?", cell) for cell in cells)


def _positive_number(notes: Mapping[str, str], key: str) -> float | None:
    if key not in notes:
        return None
    try:
        number = float(notes[key])
    except ValueError:
        number = np.nan
    if not np.isfinite(number) or number <= 0.0:
        raise RecordingError(f"'# {key}: {notes[key][:40]}' must be a positive number")
    return number
