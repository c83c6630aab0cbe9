"""read_trajectory: joint trajectories from CSV, JSON and NumPy files."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.records import parse_json, read_arrays
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.trajectory_table import read_trajectory_table

_NANO = 1_000_000_000
_KINDS = ("position", "velocity", "acceleration", "effort")


def read_trajectory(file: str | PathLike[str]) -> JointTrajectory:
    """Read a joint trajectory: .csv, .json or .npz as written by `JointTrajectory.save`, or others.

    Other people's files are read as well. A CSV needs a header, a column for time [s] (time,
    time_from_start, timestamp or t), and one for each joint: its name alone, or followed by
    position, velocity, acceleration or effort, and by a unit in brackets (rad, deg or m; rad by
    default, and converted from deg). Lines that start with # are left out, except `# unit: deg`. A
    JSON file is the ROS 2 message trajectory_msgs/msg/JointTrajectory. An .npz has the arrays time
    (k,), position (k, n) and joint_names (n,), and may have velocity, acceleration, effort and
    units.

    Where a file has no velocities they are the derivatives of a cubic spline through the positions
    (not-a-knot), and where it has no accelerations those of a spline through the velocities:
    noise in what is given is amplified.

    Raises:
        ValueError: the file is missing, or malformed; names the file, and the line or field.
    """
    path = Path(file)
    if not path.is_file():
        raise RecordingError(f"{path}: there is no such file")
    readers = {".csv": read_trajectory_table, ".json": _from_json, ".npz": _from_npz}
    if path.suffix not in readers:
        raise RecordingError(f"{path}: must end in {', '.join(readers)}")
    try:
        time, arrays, names, units = readers[path.suffix](path)
        return _trajectory(time, arrays, names, units)
    except RecordingError:
        raise
    except UnicodeDecodeError:
        raise RecordingError(f"{path}: is not text in UTF-8") from None
    except ValueError as failure:
        raise RecordingError(f"{path}: {failure}") from None


def _trajectory(
    time: Array, arrays: dict[str, Array], names: tuple[str, ...], units: tuple[str, ...]
) -> JointTrajectory:
    """The trajectory, with derivatives of splines for those that are missing."""
    positions, velocities = arrays["position"], arrays.get("velocity")
    accelerations, efforts = arrays.get("acceleration"), arrays.get("effort")
    if velocities is None or accelerations is None:
        found = JointTrajectory.from_positions(time, positions, names, units)
        if velocities is None:
            velocities, between = found.velocities, found.accelerations
        else:
            between = make_interp_spline(time, velocities, k=3).derivative()(time)
        accelerations = between if accelerations is None else accelerations
    return JointTrajectory(time, positions, velocities, accelerations, names, units, efforts)


def _from_json(path: Path) -> tuple[Array, dict[str, Array], tuple[str, ...], tuple[str, ...]]:
    try:
        message = parse_json(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        raise
    except (ValueError, RecursionError) as failure:
        raise RecordingError(f"{path}: is not JSON: {failure}") from None
    names = message.get("joint_names") if isinstance(message, dict) else None
    points = message.get("points") if isinstance(message, dict) else None
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise RecordingError(f"{path}: joint_names must be a list of names")
    if not isinstance(points, list) or not points:
        raise RecordingError(f"{path}: points must be a list that is not empty")
    time = np.array([_instant(path, k, point) for k, point in enumerate(points)])
    arrays = {}
    fields = ("positions", "velocities", "accelerations", "effort")
    for kind, key in zip(_KINDS, fields, strict=True):
        rows = [point.get(key) or [] for point in points]
        if kind != "position" and not any(rows):
            continue
        for k, row in enumerate(rows):
            if not isinstance(row, list) or len(row) != len(names) or not _are_numbers(row):
                raise RecordingError(
                    f"{path}: points[{k}].{key} must be {len(names)} numbers, is {row!r:.60}"
                )
        arrays[kind] = np.array(rows, dtype=float)
    return time, arrays, tuple(names), ()


def _instant(path: Path, k: int, point: Any) -> float:
    since = point.get("time_from_start") if isinstance(point, dict) else None
    parts: list[Any] = [None]
    if isinstance(since, dict):
        parts = [since.get("sec"), since.get("nanosec", 0)]
    if not _are_numbers(parts):
        raise RecordingError(
            f"{path}: points[{k}].time_from_start must have the numbers sec and nanosec, "
            f"is {since!r:.60}"
        )
    return float(parts[0] + parts[1] / _NANO)


def _are_numbers(values: list[Any]) -> bool:
    return all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values)


def _from_npz(path: Path) -> tuple[Array, dict[str, Array], tuple[str, ...], tuple[str, ...]]:
    found = read_arrays(path)
    for name in ("time", "position", "joint_names"):
        if name not in found:
            raise RecordingError(
                f"{path}: has no array {name}, only {', '.join(found) or 'none at all'}"
            )
    arrays = {}
    for name in ("time", *_KINDS):
        if name in found:
            if found[name].dtype.kind not in "iuf":
                raise RecordingError(f"{path}: {name} must be numbers, has {found[name].dtype}")
            arrays[name] = np.asarray(found[name], dtype=float)
    names, units = (found.get(name, np.zeros(0)).ravel() for name in ("joint_names", "units"))
    return arrays.pop("time"), arrays, tuple(map(str, names)), tuple(map(str, units))
