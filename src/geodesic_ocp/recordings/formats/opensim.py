"""OpenSim's tables of joint coordinates: motions (.mot) and storages (.sto).

Coordinates
    version=1
    nRows=2
    nColumns=3
    inDegrees=yes
    endheader
    time    elbow_flexion    pelvis_tx
    0.00    42.1             0.31

Columns are separated by tabs, commas or blanks. `inDegrees` is about rotations; translations are in
metres. In the state files of OpenSim 4, of the columns /jointset/shoulder/elv_angle/value and
.../speed the first is the coordinate elv_angle and the second is not read.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.angle_convention import AngleConvention
from geodesic_ocp.recordings.conventions.angle_segments import (
    ConvertedAngles,
    fits,
    segments_of_angles,
)
from geodesic_ocp.recordings.conventions.joint_angles import JOINTS, joint_angles
from geodesic_ocp.recordings.conventions.known_angle_conventions import ANGLE_CONVENTIONS
from geodesic_ocp.recordings.conventions.osim_convention import (
    OsimConvention,
    as_osim_convention,
    model_segments,
    read_osim,
)
from geodesic_ocp.recordings.conventions.read_angle_convention import as_angle_convention
from geodesic_ocp.recordings.formats.csv_table import finite_number
from geodesic_ocp.recordings.recording import ask_about_degrees, check_radians
from geodesic_ocp.trajectory.motion import Motion

_TRANSLATION = re.compile(r"(_t|_?trans_?)[xyz]$", re.IGNORECASE)
_STATE = re.compile(r"/jointset/[^/]+/(?P<coordinate>[^/]+)/(?P<kind>value|speed)$")


@dataclass(frozen=True, eq=False, repr=False)
class CoordinateTable:
    """Joint coordinates over time.

    Attributes:
        time: (k,) [s].
        names: names of the n coordinates.
        values: (k, n) [rad, or m for translations].
    """

    time: Array
    names: tuple[str, ...]
    values: Array

    def __repr__(self) -> str:
        return f"CoordinateTable({len(self.time)} samples of {len(self.names)} coordinates)"


def is_translation(name: str) -> bool:
    """Return whether a coordinate of this name is a length, such as pelvis_tx or box_transX."""
    return _TRANSLATION.search(name) is not None


def read_coordinates(file: Path, translations: Sequence[str] = ()) -> CoordinateTable:
    """Read all coordinates of a .mot or .sto file.

    A header whose nRows or nColumns is not what follows gives a RuntimeWarning.

    Args:
        file: to read.
        translations: names of coordinates in metres, beside those that `is_translation` knows.

    Raises:
        RecordingError: no header, no unit of the angles, or a broken row; names the line.
        ValueError: angles that should be in radians look like degrees.
    """
    lines = file.read_text(encoding="utf-8-sig").splitlines()
    header, first = _header(file, lines)
    factor = _radians(file, header)
    while first < len(lines) and not lines[first].strip(" ,\t"):
        first += 1
    if first == len(lines):
        raise RecordingError(f"{file}: no line with the names of columns follows endheader")
    separator = next((each for each in "\t," if each in lines[first]), None)
    labels = _entries(lines[first], separator)
    if labels[0].lower() != "time" or len(labels) < 2:
        raise RecordingError(
            f"{file}: line {first + 1} must name the columns, time first, is {lines[first][:60]!r}"
        )
    if not all(labels):
        raise RecordingError(f"{file}: line {first + 1}: column {labels.index('') + 1} has no name")
    rows = []
    for number, line in enumerate(lines[first + 1 :], start=first + 2):
        if line.strip(" ,\t"):
            rows.append(_numbers(file, number, _entries(line, separator), labels))
    _compare(file, header, "nrows", "rows", len(rows))
    _compare(file, header, "ncolumns", "columns", len(labels))
    values = np.array(rows, dtype=float).reshape(len(rows), len(labels))
    states = [_STATE.search(label) for label in labels]
    kept = [
        i for i, state in enumerate(states) if i and (state is None or state["kind"] == "value")
    ]
    if any(states):  # a file of states also has muscles' states, which are no coordinates
        kept = [i for i in kept if states[i] is not None]
    names = [labels[i] if (state := states[i]) is None else state["coordinate"] for i in kept]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise RecordingError(f"{file}: line {first + 1} names {', '.join(twice)} more than once")
    lengths = [is_translation(name) or name in translations for name in names]
    angles = [i for i, length in enumerate(lengths) if not length]
    turns = values[:, [kept[i] for i in angles]]
    if factor == 1.0:
        check_radians([names[i] for i in angles], turns)
    else:
        ask_about_degrees(str(file), turns)
    return CoordinateTable(
        values[:, 0], tuple(names), values[:, kept] * np.where(lengths, 1.0, factor)
    )


def _header(file: Path, lines: list[str]) -> tuple[dict[str, str], int]:
    """Keys (in lower case) and values before endheader, and the index of the line after it."""
    header: dict[str, str] = {}
    for number, line in enumerate(lines):
        text = line.strip(" ,\t")
        if text.lower() == "endheader":
            return header, number + 1
        key, equals, value = text.partition("=")
        if equals:
            header[key.strip().lower()] = value.strip()
    raise RecordingError(f"{file}: no line 'endheader' ends the header")


def _radians(file: Path, header: dict[str, str]) -> float:
    kind = header.get("datatype", "double").lower()
    if kind != "double":
        raise RecordingError(
            f"{file}: its DataType is {kind}; joint coordinates are of type double"
        )
    degrees = header.get("indegrees", "").lower()
    if degrees not in ("yes", "no"):
        given = f", not 'inDegrees={degrees}'" if degrees else ""
        raise RecordingError(f"{file}: its header must have inDegrees=yes or inDegrees=no{given}")
    return np.pi / 180.0 if degrees == "yes" else 1.0


def _entries(line: str, separator: str | None) -> list[str]:
    """Entries of a line without the empty ones at its end."""
    entries = [entry.strip() for entry in line.split(separator)]
    while entries and not entries[-1]:
        entries.pop()
    return entries


def _numbers(file: Path, number: int, entries: list[str], labels: list[str]) -> list[float]:
    if len(entries) != len(labels):
        raise RecordingError(
            f"{file}: line {number} has {len(entries)} entries, the names of columns {len(labels)}"
        )
    where = f"{file}: line {number}"
    return [finite_number(where, *each) for each in zip(labels, entries, strict=True)]


def _compare(file: Path, header: dict[str, str], key: str, what: str, found: int) -> None:
    if key in header and header[key] != str(found):
        warnings.warn(
            f"{file}: its header says {header[key]} {what}, it has {found}; these are read",
            RuntimeWarning,
            stacklevel=3,
        )


def read_opensim(
    file: Path,
    joints: Sequence[str] | None = None,
    convention: AngleConvention | OsimConvention | str | Path | None = None,
) -> Motion:
    """Read the motion of these joints from a .mot or .sto file.

    Columns with the names of the Master Motor Map's joints are read as they are. Others are
    converted by the model (.osim) with which they were computed, by a convention of angles, or by
    the built-in one that fits their names. If none fits, or the joints asked for are columns, the
    motion is that of the columns.

    Args:
        file: to read.
        joints: names, in the order of the result.
        convention: the model's file or an OsimConvention; or an AngleConvention, the name of a
            built-in one, or a JSON file of either.

    Raises:
        RecordingError: the file or the model is malformed, or the columns do not give the joints;
            names the line or element, or the columns.
    """
    by_model = as_osim_convention(convention)
    if by_model is not None:
        return _by_model(file, joints, by_model)
    given = as_angle_convention(convention)  # type: ignore[arg-type] # no OsimConvention is left
    table = read_coordinates(file, given.position if given is not None else ())
    named = [name for name in table.names if name in JOINTS]
    if given is None and (named or (joints is not None and set(joints) <= set(table.names))):
        return _plain(file, table, named if joints is None else joints)
    chosen = given or _fitting(table.names)
    if chosen is None:
        if joints is None:
            return _plain(file, table, table.names)
        raise RecordingError(
            f"{file}: no known convention of joint angles fits its columns "
            f"{', '.join(table.names)}; describe their rotations by convention= (--convention): "
            "the file of the model (.osim) that they were computed with, an AngleConvention, or a "
            "JSON file of either"
        )
    columns = dict(zip(table.names, table.values.T, strict=True))
    try:
        converted = segments_of_angles(chosen, table.time, columns)
    except ValueError as failure:
        raise RecordingError(f"{file}: {failure}") from None
    return _motion(file, joints, converted, f"convention {chosen.name}")


def _by_model(file: Path, joints: Sequence[str] | None, convention: OsimConvention) -> Motion:
    model = read_osim(Path(convention.model))
    table = read_coordinates(file, model.translations)
    unclear = [name for name in model.rotations if name in table.names and is_translation(name)]
    if unclear:
        raise RecordingError(
            f"{file}: {', '.join(unclear)} would be read in metres by its name, but rotates in "
            f"{model.file}; rename it in both"
        )
    columns = dict(zip(table.names, table.values.T, strict=True))
    try:
        converted = model_segments(file, model, convention, table.time, columns)
    except ValueError as failure:
        told = str(failure).startswith((str(file), str(model.file)))
        raise RecordingError(str(failure) if told else f"{file}: {failure}") from None
    return _motion(file, joints, converted, f"model {model.file.name}")


def _motion(
    file: Path, joints: Sequence[str] | None, converted: ConvertedAngles, source: str
) -> Motion:
    try:
        return joint_angles(converted.orientations, joints)
    except ValueError as failure:
        why = "".join(
            f"; {segment}: {reason}"
            for segment, reason in converted.reasons.items()
            if joints is None or segment in str(failure)
        )
        raise RecordingError(f"{file}: {source}: {failure}{why}") from None


def _fitting(names: Sequence[str]) -> AngleConvention | None:
    """The built-in convention that uses most of these columns."""
    best = max(ANGLE_CONVENTIONS.values(), key=lambda each: fits(each, set(names)))
    return best if fits(best, set(names)) else None


def _plain(file: Path, table: CoordinateTable, joints: Sequence[str]) -> Motion:
    missing = [name for name in joints if name not in table.names]
    if missing:
        raise RecordingError(
            f"{file}: there is no joint {', '.join(missing)}; there are {', '.join(table.names)}"
        )
    chosen = [table.names.index(name) for name in joints]
    try:
        return Motion(table.time, np.ascontiguousarray(table.values[:, chosen]), tuple(joints))
    except ValueError as failure:
        raise RecordingError(f"{file}: {failure}") from None
