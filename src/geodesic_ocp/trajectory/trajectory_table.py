"""Joint trajectories in tables of comma-separated values."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError

_TIME = re.compile(r"(time_from_start|timestamp|time|t)( *[\[(]s[\])])?", re.IGNORECASE)
_COLUMN = re.compile(
    r"(?P<joint>.+?)"
    r"(?:[ _./](?P<kind>position|velocity|acceleration|effort))?"
    r"(?: *[\[(](?P<unit>rad|deg|m|N)(?:[ */]?[a-z0-9^*/ ]*)[\])])?"
)
_FACTORS = {"rad": 1.0, "deg": np.pi / 180.0, "m": 1.0}


def read_trajectory_table(
    path: Path,
) -> tuple[Array, dict[str, Array], tuple[str, ...], tuple[str, ...]]:
    """Time (k,), arrays (k, n) by "position" and so on, names and units of the joints.

    Raises:
        RecordingError: no header with time and joints, a joint without a position, or an entry
            that is not a finite number; names the line.
    """
    lines = path.read_text(encoding="utf-8-sig").split("\n")
    default, first = "rad", 0
    while first < len(lines) and (not lines[first].strip() or lines[first].startswith("#")):
        key, _, value = lines[first].lstrip("# ").partition(":")
        if key.strip().lower() == "unit":
            default = value.strip()
            if default not in _FACTORS:
                raise RecordingError(
                    f"{path}: line {first + 1}: the unit must be rad, deg or m, is {default!r}"
                )
        first += 1
    if first == len(lines):
        raise RecordingError(f"{path}: has no header")
    header = [name.strip() for name in next(csv.reader(lines[first:]))]
    at_time = [k for k, name in enumerate(header) if _TIME.fullmatch(name)]
    if len(at_time) != 1 or len(header) < 2:
        raise RecordingError(
            f"{path}: line {first + 1} must be a header with time (time, time_from_start, "
            f"timestamp or t) and joints, separated by commas, is {','.join(header)[:60]!r}"
        )
    table = _numbers(path, lines, first + 1, header)
    columns: dict[str, dict[str, int]] = {}
    units: dict[str, str] = {}
    for k, name in enumerate(header):
        found = _COLUMN.fullmatch(name)
        if k in at_time:
            continue
        if found is None or found["kind"] in columns.get(found["joint"], {}):
            raise RecordingError(
                f"{path}: line {first + 1}: column {k + 1}, {name!r}, "
                + ("has no joint's name" if found is None else "is there twice")
            )
        kind = found["kind"] or "position"
        columns.setdefault(found["joint"], {})[kind] = k
        if kind != "effort":
            unit = found["unit"] or default
            if unit not in _FACTORS or units.setdefault(found["joint"], unit) != unit:
                raise RecordingError(
                    f"{path}: line {first + 1}: the unit of {name!r} must be rad, deg or m, and "
                    "the same in all columns of a joint"
                )
            table[:, k] *= _FACTORS[unit]
    arrays = {}
    for kind in dict.fromkeys(kind for of_joint in columns.values() for kind in of_joint):
        missing = [joint for joint, of_joint in columns.items() if kind not in of_joint]
        if missing:
            raise RecordingError(f"{path}: line {first + 1}: no {kind} of {', '.join(missing)}")
        arrays[kind] = table[:, [of_joint[kind] for of_joint in columns.values()]]
    if "position" not in arrays:
        raise RecordingError(f"{path}: line {first + 1}: no joint has a position")
    names = tuple(columns)
    in_metres = tuple("m" if units[name] == "m" else "rad" for name in names)
    return table[:, at_time[0]], arrays, names, in_metres


def _numbers(path: Path, lines: list[str], start: int, header: list[str]) -> Array:
    rows = []
    for number, row in enumerate(csv.reader(lines[start:]), start=start + 1):
        if not row or row[0].startswith("#"):
            continue
        if len(row) != len(header):
            raise RecordingError(
                f"{path}: line {number} has {len(row)} entries, the header {len(header)}"
            )
        try:
            values = [float(entry) for entry in row]
        except ValueError:
            values = [np.nan]
        if not np.all(np.isfinite(values)):
            raise RecordingError(f"{path}: line {number} must be finite numbers, is {row!r:.80}")
        rows.append(values)
    if not rows:
        raise RecordingError(f"{path}: has no rows below its header")
    return np.array(rows)
