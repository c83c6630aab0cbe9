"""Joint trajectories in files: tables, ROS messages, arrays."""

from __future__ import annotations

import csv
import re
import warnings
from dataclasses import dataclass, field, fields, replace
from os import PathLike
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from scipy.interpolate import make_interp_spline

from geodesic_ocp.arrays import Array, as_vector
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.records import convert, decoding, read_arrays, read_structured
from geodesic_ocp.trajectory.exports import NANO
from geodesic_ocp.trajectory.joint_trajectory import KINDS, JointTrajectory, last_digit

_TIME = re.compile(r"(time_from_start|timestamp|time|t)( *[\[(]s[\])])?", re.IGNORECASE)
_COLUMN = re.compile(
    r"(?P<joint>.+?)"
    r"(?:[ _./](?P<kind>position|velocity|acceleration|effort))?"
    r"(?: *[\[(](?P<unit>rad|deg|m|N)(?:[ */]?[a-z0-9^*/ ]*)[\])])?"
)
_FACTORS = {"rad": 1.0, "deg": np.pi / 180.0, "m": 1.0}


@dataclass(frozen=True, eq=False)
class _Stated:
    """Content of a file.

    Attributes:
        time: times (k,) [s].
        arrays: arrays (k, n) by "position" and so on.
        names, units: of the joints.
        digits: by kind, what the last digit of its numbers stands for (n,), where units were
            converted.
    """

    time: Array
    arrays: dict[str, Array]
    names: tuple[str, ...]
    units: tuple[str, ...] = ()
    digits: dict[str, Array] = field(default_factory=dict)


def read_trajectory(file: str | PathLike[str]) -> JointTrajectory:
    """Read a joint trajectory: .csv, .json or .npz as written by `JointTrajectory.save`, or others.

    Other people's files are read as well. A CSV needs a header, a column for time [s] (time,
    time_from_start, timestamp or t), and one for each joint: its name alone, or followed by
    position, velocity, acceleration or effort, and by a unit in brackets (rad, deg or m; rad by
    default, and converted from deg). Lines that start with # are left out, except `# unit: deg`. A
    JSON or YAML file is the ROS 2 message trajectory_msgs/msg/JointTrajectory, or a goal of the
    action control_msgs/action/FollowJointTrajectory, whose `trajectory` is that. An .npz has the
    arrays time (k,), position (k, n) and joint_names (n,), and may have velocity, acceleration,
    effort and units.

    Where a file has no velocities they are the derivatives of a cubic spline through the positions
    (not-a-knot), and where it has no accelerations those of a spline through the velocities:
    noise in what is given is amplified. `derived` names these. Times that are evenly spaced but for
    their last digit, such as 0.033, 0.067 and 0.1, are taken as evenly spaced. A point that repeats
    the one before it, time included, is left out with a UserWarning.

    >>> import tempfile
    >>> from pathlib import Path
    >>> rows = [[0.0, 0.0], [0.1, 9.0], [0.2, 18.0], [0.3, 27.0]]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "trajectory.csv"
    ...     np.savetxt(file, rows, delimiter=",", header="time,a [deg]", comments="")
    ...     trajectory = go.read_trajectory(file)
    >>> trajectory.joint_names, trajectory.velocities.round(3).ravel().tolist()
    (('a',), [1.571, 1.571, 1.571, 1.571])

    Args:
        file: path of the file.

    Raises:
        ValueError: the file is missing, or malformed; names the file, and the line or field. Two
            points of the same time differ.
        ImportError: YAML without PyYAML.
    """
    path = Path(file)
    if not path.is_file():
        raise RecordingError(f"{path}: there is no such file")
    readers = {".csv": _from_table, ".json": _from_message, ".npz": _from_npz}
    readers |= {".yaml": _from_message, ".yml": _from_message}
    if path.suffix not in readers:
        raise RecordingError(f"{path}: must end in {', '.join(readers)}")
    with decoding(path):
        try:
            content, repeated = _without_repeats(readers[path.suffix](path))
            trajectory = _trajectory(content)
        except UnicodeDecodeError:
            raise RecordingError(f"{path}: is not text in UTF-8") from None
    if repeated:
        warnings.warn(f"{path}: {repeated}", stacklevel=2)
    return trajectory


def _from_table(path: Path) -> _Stated:
    lines = path.read_text(encoding="utf-8-sig").split("\n")
    default = "rad"
    first = 0
    while first < len(lines) and (not lines[first].strip() or lines[first].startswith("#")):
        key, _, value = lines[first].lstrip("# ").partition(":")
        if key.strip().lower() == "unit":
            default = value.strip()
            if default not in _FACTORS:
                raise ValueError(
                    f"line {first + 1}: the unit must be rad, deg or m, is {default!r}"
                )
        first += 1
    if first == len(lines):
        raise ValueError("has no header")
    header = [name.strip() for name in next(csv.reader(lines[first:]))]
    at_time = [k for k, name in enumerate(header) if _TIME.fullmatch(name)]
    if len(at_time) != 1 or len(header) < 2:
        raise ValueError(
            f"line {first + 1} must be a header with time (time, time_from_start, "
            f"timestamp or t) and joints, separated by commas, is {','.join(header)[:60]!r}"
        )
    table = _numbers(lines, first + 1, len(header))
    columns: dict[str, dict[str, int]] = {}
    units: dict[str, str] = {}
    factors = np.ones(len(header))
    for k, name in enumerate(header):
        found = _COLUMN.fullmatch(name)
        if k in at_time:
            continue
        if found is None or found["kind"] in columns.get(found["joint"], {}):
            raise ValueError(
                f"line {first + 1}: column {k + 1}, {name!r}, "
                + ("has no joint's name" if found is None else "is there twice")
            )
        kind = found["kind"] or "position"
        columns.setdefault(found["joint"], {})[kind] = k
        if kind != "effort":
            unit = found["unit"] or default
            if unit not in _FACTORS or units.setdefault(found["joint"], unit) != unit:
                raise ValueError(
                    f"line {first + 1}: the unit of {name!r} must be rad, deg or m, and "
                    "the same in all columns of a joint"
                )
            factors[k] = _FACTORS[unit]
    arrays = {}
    digits = {}
    for kind in dict.fromkeys(kind for of_joint in columns.values() for kind in of_joint):
        missing = [joint for joint, of_joint in columns.items() if kind not in of_joint]
        if missing:
            raise ValueError(f"line {first + 1}: no {kind} of {', '.join(missing)}")
        chosen = [of_joint[kind] for of_joint in columns.values()]
        arrays[kind] = table[:, chosen] * factors[chosen]
        digits[kind] = last_digit(table[:, chosen]) * factors[chosen]
    if "position" not in arrays:
        raise ValueError(f"line {first + 1}: no joint has a position")
    names = tuple(columns)
    in_metres = tuple("m" if units[name] == "m" else "rad" for name in names)
    return _Stated(table[:, at_time[0]], arrays, names, in_metres, digits)


def _numbers(lines: list[str], start: int, columns: int) -> Array:
    """Return entries of the rows below the header; lines that start with # are left out."""
    table = []
    for number, row in enumerate(csv.reader(lines[start:]), start=start + 1):
        if row and not row[0].startswith("#"):
            if len(row) != columns:
                raise ValueError(f"line {number} has {len(row)} entries, the header {columns}")
            try:
                table.append(as_vector("row", row, columns))
            except ValueError:
                raise ValueError(f"line {number} must be finite numbers, is {row!r:.80}") from None
    if not table:
        raise ValueError("has no rows below its header")
    return np.array(table)


def _without_repeats(content: _Stated) -> tuple[_Stated, str]:
    """Return the content without points that repeat the one before, and a sentence on these.

    Raises:
        ValueError: two points of the same time differ.
    """
    same = np.flatnonzero(np.diff(content.time) == 0.0) + 1
    for k in same.tolist():
        for kind, values in content.arrays.items():
            if not np.array_equal(values[k], values[k - 1]):
                raise ValueError(
                    f"points {k - 1} and {k}, counted from 0, are both at {content.time[k]:.6g} s, "
                    f"and their {kind} differs: leave out one of them, or give it a time of its own"
                )
    if not same.size:
        return content, ""
    arrays = {kind: np.delete(each, same, axis=0) for kind, each in content.arrays.items()}
    listed = ", ".join(map(str, same.tolist()))
    left = replace(content, time=np.delete(content.time, same), arrays=arrays)
    return left, f"left out, as they repeat the point before: points {listed}, counted from 0"


def _trajectory(content: _Stated) -> JointTrajectory:
    """Return the trajectory, with derivatives of splines for those that are missing."""
    time = _even(content.time)
    arrays = content.arrays
    positions = arrays["position"]
    velocities = arrays.get("velocity")
    accelerations = arrays.get("acceleration")
    if velocities is None or accelerations is None:
        found = JointTrajectory.from_positions(time, positions, content.names, content.units)
        if accelerations is None:
            accelerations = found.accelerations
            if velocities is not None:
                accelerations = make_interp_spline(time, velocities, k=3).derivative()(time)
        velocities = found.velocities if velocities is None else velocities
    return JointTrajectory(
        time,
        positions,
        velocities,
        accelerations,
        content.names,
        content.units,
        arrays.get("effort"),
        tuple(kind for kind in KINDS[1:3] if kind not in arrays),
        content.digits,
    )


def _even(time: Array) -> Array:
    """Return evenly spaced times (k,) if the last digit of the given ones alone makes them uneven.

    Rounding moves each of them by at most half a digit, and the even ones between the first and the
    last by as much. Where there are fewer than two digits in a step, a sample that was left out
    looks the same.
    """
    if time.ndim != 1 or time.size < 2 or not np.all(np.isfinite(time)):
        return time  # the trajectory names what is wrong
    digit = last_digit(time)
    if np.ptp(np.diff(time)) < digit / 2.0:
        return time
    even = np.linspace(time[0], time[-1], time.size)
    is_rounded = np.abs(time - even).max() <= digit and 2.0 * digit <= even[1] - even[0]
    return even if is_rounded else time


@dataclass
class _Instant:
    sec: float
    nanosec: float = 0.0


@dataclass
class _Point:
    time_from_start: _Instant
    positions: list[float]
    velocities: list[float] | None = None
    accelerations: list[float] | None = None
    effort: list[float] | None = None


@dataclass
class _Message:
    joint_names: tuple[str, ...]
    points: Annotated[list[_Point], msgspec.Meta(min_length=1)]


def _from_message(path: Path) -> _Stated:
    record: Any = read_structured(path, "ROS 2 message")
    if isinstance(record, dict):  # a goal, or a message that holds one
        record = record.get("goal", record)
        record = record.get("trajectory", record) if isinstance(record, dict) else record
    message = convert(record, _Message, path)
    names = message.joint_names
    instants = [each.time_from_start for each in message.points]
    arrays = {}
    for kind, part in zip(KINDS, fields(_Point)[1:], strict=True):
        rows = [getattr(point, part.name) or [] for point in message.points]
        if kind != "position" and not any(rows):
            continue
        for k, row in enumerate(rows):
            if len(row) != len(names):
                raise ValueError(
                    f"points[{k}].{part.name} must be {len(names)} numbers, is {row!r:.60}"
                )
        arrays[kind] = np.array(rows)
    time = np.array([instant.sec + instant.nanosec / NANO for instant in instants])
    return _Stated(time, arrays, names)


def _from_npz(path: Path) -> _Stated:
    found = read_arrays(path)
    for name in ("time", "position", "joint_names"):
        if name not in found:
            raise ValueError(f"has no array {name}, only {', '.join(found) or 'none at all'}")
    arrays = {}
    for name in ("time", *KINDS):
        if name in found:
            if found[name].dtype.kind not in "iuf":
                raise ValueError(f"{name} must be numbers, has {found[name].dtype}")
            arrays[name] = np.asarray(found[name], dtype=float)
    names, units = (found.get(name, np.zeros(0)).ravel() for name in ("joint_names", "units"))
    return _Stated(arrays.pop("time"), arrays, tuple(map(str, names)), tuple(map(str, units)))
