"""Tables of joint angles (CSV): columns of other names, and samples that are missing.

A table may name its columns as it likes, if `columns` says which joint each one is, with its sign,
unit and offset. Cells may be empty or nan, see `Series`.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from geodesic_ocp.arrays import as_number
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.records import write_file
from geodesic_ocp.tables import new_table
from geodesic_ocp.trajectory.files.delimited import Table, read_csv
from geodesic_ocp.trajectory.files.series import Series
from geodesic_ocp.trajectory.files.text_lines import (
    ANGLES,
    named_failures,
    numbers,
    rate_of,
    read_lines,
    stated,
    stated_rate,
)
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.recording import ask_about_degrees


@dataclass(frozen=True)
class Column:
    """Which column of a table is a joint's angle: sign * value + offset, in its unit.

    Attributes:
        name: name of the column.
        sign: 1 or -1.
        unit: "rad" or "deg", of column and offset; None: that of the table, or radians for the
            offset in OpenSim's tables, which are converted as they state.
        offset: added to the angle.

    Raises:
        ValueError: another sign or unit.
    """

    name: str
    sign: float = 1.0
    unit: str | None = None
    offset: float = 0.0

    def __post_init__(self) -> None:
        if as_number(f"sign of {self.name}", self.sign) not in (1.0, -1.0):
            raise ValueError(f"sign of {self.name} must be 1 or -1, got {self.sign!r}")
        if self.unit is not None and self.unit.lower() not in ANGLES:
            raise ValueError(f"unit of {self.name} must be rad or deg, got {self.unit!r}")
        as_number(f"offset of {self.name}", self.offset)

    def radians(self, default: float = 1.0) -> float:
        """Return radians in the column's unit, or in another by default."""
        return default if self.unit is None else ANGLES[self.unit.lower()]


def as_columns(given: Any) -> dict[str, Column]:
    """Return columns by joint, from a mapping or from a table (CSV) ours,theirs,sign,unit,offset.

    Args:
        given: names of columns, or Column objects or mappings of their attributes, by joint (and
            the column of time, by "time"); or the path of a table, in which sign, unit and offset
            may be missing or empty.

    Raises:
        RecordingError: the file cannot be read, or its columns are others.
        ValueError: no joint, or attributes that a Column does not have.
    """
    if isinstance(given, (str, PathLike)):
        return _from_file(Path(given))
    if not isinstance(given, Mapping) or not given:
        raise ValueError(f"columns must give names of columns by joint, or a file, got {given!r}")
    found = {}
    for joint, each in given.items():
        try:
            known = {"name": each} if isinstance(each, str) else each
            found[joint] = each if isinstance(each, Column) else Column(**known)
        except TypeError:
            raise ValueError(
                f"columns[{joint!r}] must be the name of a column, or its name, sign, unit and "
                f"offset, got {each!r}"
            ) from None
    return found


def _from_file(file: Path) -> dict[str, Column]:
    with named_failures(file):
        rows = [row for row in csv.reader(read_lines(file)) if any(map(str.strip, row))]
        header = [cell.strip().lower() for cell in rows[0]] if rows else []
        known = ("ours", "theirs", "sign", "unit", "offset")
        if not {"ours", "theirs"} <= set(header) <= set(known):
            raise RecordingError(f"its header must be {','.join(known)}, is {','.join(header)!r}")
        found = {}
        for number, row in enumerate(rows[1:], 2):
            cells = {key: cell.strip() for key, cell in zip(header, row, strict=False)}
            given: dict[str, Any] = {key: text for key, text in cells.items() if text}
            joint = given.pop("ours", "")
            given["name"] = given.pop("theirs", "")
            if not joint or not given["name"] or joint in found:
                raise RecordingError(f"row {number} must name a joint of its own and a column")
            for key in ("sign", "offset"):
                if key in given:
                    (given[key],) = numbers(None, f"row {number}: {key}", [given[key]], 1)
            found[joint] = Column(**given)
        if not found:
            raise RecordingError("names no joint")
        return found


def read_table(
    file: Path,
    joints: Sequence[str] | None = None,
    columns: Any = None,
    fill: float | None = None,
    part: int | None = None,
    degrees_in: bool | None = None,
    rate: float | None = None,
) -> Motion:
    """Read the motion of these joints, or of all, from a table of joint angles.

    Args:
        joints: names, in the order of the result.
        columns: see `as_columns`.
        fill: longest gap [s] that is bridged by interpolation; None: none may be.
        part: number, from 1, of the part between longer gaps.
        degrees_in: whether angles are in degrees, if neither a note nor the columns say it.
        rate: rate [Hz] of a table without a column of time.

    Raises:
        Gaps: samples are missing, beyond those that are bridged.
        RecordingError: no unit or header, a missing joint, a row of the wrong length, or an entry
            that is not a number; the message names the line.
    """
    with named_failures(file):
        chosen = None if columns is None else as_columns(columns)
        of_time = None if chosen is None else chosen.pop("time", None)
        named = None if of_time is None else of_time.name
        table = read_csv(file, ANGLES, ("rad", "deg"), time=named, rate=rate)
        own = None if table.scale is None else table.scale != 1.0
        degrees = stated(file, "# unit: deg (degrees_in)", own=own, given=degrees_in)
        if degrees is not None:
            table = replace(table, scale=ANGLES["deg" if degrees else "rad"])
        series = _angles(file, table, joints, chosen)
        table.say_assumed(file)
        if table.time is not None:
            stated_rate(file, rate_of(series.time), rate)
        motion = series.motion(file, series.joint_names, fill=fill, part=part)
        return replace(motion, subject=table.subject)


def _angles(
    file: Path, table: Table, joints: Sequence[str] | None, columns: dict[str, Column] | None
) -> Series:
    """Return the angles [rad] of the joints."""
    rows = table.rows
    others = table.others
    if columns is None:
        names = {_bare(name): name for name in others}
        wanted = others if joints is None else list(joints)
        same = {j: j if j in others else names.get(_bare(j), j) for j in wanted}
        table.assumed.extend(f"{n!r} as {j}" for j, n in same.items() if n != j and n in others)
        columns = {joint: Column(name) for joint, name in same.items()}
        absent = "there is no joint {}; there are {}"
    else:
        absent = "there is no column {}; there are {}"
        wanted = wanted_of(columns, joints)
    chosen = [columns[joint] for joint in wanted]
    if missing := [each.name for each in chosen if each.name not in others]:
        raise RecordingError(absent.format(", ".join(missing), ", ".join(others)))
    names_of = [each.name for each in chosen]
    raw = rows.columns(names_of, missing=True)
    own = [each.name for each in chosen if each.unit is None]
    scales = dict(zip(own, table.scales_of(own), strict=True))
    factors = np.array([each.radians(scales.get(each.name, 1.0)) for each in chosen])
    if np.all(factors != 1.0):
        ask_about_degrees(str(file), raw)
    signs, offsets = (np.array([getattr(c, k) for c in chosen]) for k in ("sign", "offset"))
    return Series(table.times(), factors * (signs * raw + offsets), tuple(wanted))


def _bare(name: str) -> str:
    return name.lower().removesuffix("_joint")


def wanted_of(columns: Mapping[str, Column], joints: Sequence[str] | None) -> list[str]:
    """Return the joints that are read; RecordingError if there is no column of one."""
    wanted = list(columns) if joints is None else list(joints)
    if unknown := [joint for joint in wanted if joint not in columns]:
        raise RecordingError(f"columns give no joint {', '.join(unknown)}")
    return wanted


def mapped(motion: Motion, columns: Any, joints: Sequence[str] | None) -> Motion:
    """Return a motion [rad] with the joints that columns of other names are."""
    known = as_columns(columns)
    wanted = wanted_of(known, joints)
    chosen = [known[joint] for joint in wanted]
    raw = motion.select([each.name for each in chosen])
    signs, offsets = (np.array([getattr(c, k) for c in chosen]) for k in ("sign", "offset"))
    q = signs * raw.q + offsets * [each.radians() for each in chosen]
    return Motion(raw.time, q, tuple(wanted), subject=motion.subject)


_DOUBTS = "# doubts: "
_BETWEEN = "; "


def save_motion(path: str | PathLike[str], motion: Motion) -> Path:
    """Write a motion as the table (CSV) that `read_motion` reads, with all digits.

    Time in s, joint coordinates in rad or m, what is known of the subject, and doubts about the
    motion. Velocities, the coordinates before filtering, and the pose of the trunk are not written.

    >>> import tempfile
    >>> from pathlib import Path
    >>> arm, time = go.human_arm(), np.linspace(0.0, 1.0, 101)
    >>> motion = go.Motion(time, np.outer(time, np.full(7, 0.5)), arm.joint_names)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = go.trajectory.save_motion(Path(folder) / "motion.csv", motion)
    ...     again = go.read_motion(file, joints=arm.joint_names)
    >>> np.array_equal(again.q, motion.q)
    True

    Args:
        path: of the file, which ends in .csv.
        motion: motion that is written.

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
    if motion.doubts:
        lines.append(_DOUBTS + _BETWEEN.join(" ".join(each.split()) for each in motion.doubts))
    rows = np.column_stack([motion.time, motion.q]).tolist()
    table = new_table(("time", *motion.joint_names), rows).to_csv()
    return write_file(file, "\n".join([*lines, table]))


def noted_doubts(file: Path) -> tuple[str, ...]:
    """Return the doubts about its motion that `save_motion` wrote into a table."""
    found = [line for line in read_lines(file) if line.startswith(_DOUBTS)]
    return tuple(found[0].removeprefix(_DOUBTS).strip().split(_BETWEEN)) if found else ()
