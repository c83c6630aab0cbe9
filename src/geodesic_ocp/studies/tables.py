"""The tidy tables of many recordings: what each column holds, and in which unit.

recordings.csv has one row for each recording and method, synergies.csv one for each synergy, and
failures.csv one for each recording without a result. Units are the suffix of a column's name.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from math import isfinite
from os import PathLike
from pathlib import Path, PurePosixPath
from typing import Any, Literal, get_args

import numpy as np

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.records import replacing
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.synergies.scores import MotionErrors, motion_errors
from geodesic_ocp.synergies.synergy import Synergy
from geodesic_ocp.trajectory.motion import Motion

Kind = Literal["text", "integer", "number"]
Cell = str | int | float | None  # None where a value is not known or does not apply
Row = dict[str, Cell]


@dataclass(frozen=True)
class TableColumn:
    """A column of a tidy table.

    Attributes:
        name: machine-friendly, with the unit as suffix.
        kind: of its values; integers and numbers may be missing.
        meaning: in words.
    """

    name: str
    kind: Kind
    meaning: str

    def __post_init__(self) -> None:
        if self.kind not in get_args(Kind):
            raise ValueError(f"kind must be one of {', '.join(get_args(Kind))}, got {self.kind!r}")

    def __repr__(self) -> str:
        return f"TableColumn({self.name}: {self.kind})"

    def parsed(self, text: str) -> Cell:
        """The value that a CSV file holds as this text; empty text is a missing value.

        Raises:
            ValueError: the text is not of this kind.
        """
        if self.kind == "text":
            return text
        if not text:
            return None
        return int(text) if self.kind == "integer" else float(text)


# What identifies a recording in every table.
IDENTITY_COLUMNS = (
    TableColumn("recording", "text", "names the recording: the file and the side"),
    TableColumn("file", "text", "the recording's file, relative to the folder that was given"),
    TableColumn("subject", "text", "the person; recordings of one person are not independent"),
    TableColumn(
        "subject_from",
        "text",
        "table, path, or file that names the subject, else folder name or file name",
    ),
    TableColumn("trial", "text", "the repetition, within the subject"),
    TableColumn("side", "text", "right or left"),
)

RECORDING_COLUMNS = (
    *IDENTITY_COLUMNS,
    TableColumn("height_m", "number", "body height of the model [m]"),
    TableColumn("height_from", "text", "given, table, file, markers, or assumed"),
    TableColumn("mass_kg", "number", "body mass of the model [kg]"),
    TableColumn("mass_from", "text", "given, table, file, or assumed"),
    TableColumn("marker_error_m", "number", "mean distance of markers from the fitted ones [m]"),
    TableColumn("samples", "integer", "number of samples"),
    TableColumn("duration_s", "number", "from the first sample to the last [s]"),
    TableColumn("rate_hz", "number", "mean sampling rate [Hz]"),
    TableColumn("cutoff_hz", "number", "of the filter [Hz]; missing where there is none"),
    TableColumn("noise_rad", "number", "root mean square over joints of the recording's noise"),
    TableColumn("metric", "text", "in which the motion is cut and planned, in words"),
    TableColumn("threshold_rad", "number", "of the segmentation; missing for optimal segments"),
    TableColumn("method", "text", "key of the method, see `Analysis.errors`"),
    TableColumn("method_label", "text", "the method in words, as in `Analysis.table`"),
    TableColumn("segments", "integer", "of the method; missing if the method has none"),
    TableColumn("joint_error_rad", "number", "mean absolute error of a joint [rad]"),
    TableColumn("position_error_m", "number", "mean error of the hand's position [m]"),
    TableColumn("orientation_error_rad", "number", "mean error of the hand's orientation [rad]"),
    TableColumn("joint_error_unfiltered_rad", "number", "against the unfiltered recording [rad]"),
    TableColumn("position_error_unfiltered_m", "number", "against the unfiltered recording [m]"),
    TableColumn(
        "orientation_error_unfiltered_rad", "number", "against the unfiltered recording [rad]"
    ),
    TableColumn("computation_s", "number", "time that the whole recording took [s]"),
    TableColumn("settings", "text", "identifies the settings of the analysis"),
)

SYNERGY_COLUMNS = (
    *IDENTITY_COLUMNS,
    TableColumn("metric", "text", "of the geodesic, in words"),
    TableColumn("synergy", "integer", "number of the synergy in the recording, from 1"),
    TableColumn("start_sample", "integer", "index of its first sample, from 0"),
    TableColumn("stop_sample", "integer", "index of its last sample"),
    TableColumn("start_time_s", "number", "of its first sample, on the recording's clock [s]"),
    TableColumn("duration_s", "number", "[s]"),
    TableColumn("length", "number", "in the metric's unit: sqrt(kg) m, of straight lines rad"),
    TableColumn("mean_speed", "number", "length over duration [unit of the length per s]"),
    TableColumn("peak_speed", "number", "largest speed of its time law [unit of the length per s]"),
    TableColumn("joint_error_rad", "number", "mean over its samples and joints [rad]"),
    TableColumn("position_error_m", "number", "mean over its samples [m]"),
    TableColumn("orientation_error_rad", "number", "mean over its samples [rad]"),
    TableColumn("settings", "text", "identifies the settings of the analysis"),
)

FAILURE_COLUMNS = (
    *IDENTITY_COLUMNS,
    TableColumn("kind", "text", "file, solver, process, same (as another), missing or error"),
    TableColumn("reason", "text", "in one sentence"),
)

TABLES: dict[str, tuple[TableColumn, ...]] = {
    "recordings": RECORDING_COLUMNS,
    "synergies": SYNERGY_COLUMNS,
    "failures": FAILURE_COLUMNS,
}


_METHODS = {
    "kinetic_energy": "geodesics, kinetic energy",
    "joint_inertia": "geodesics, kinetic energy with joint inertia",
    "euclidean_same_segments": "straight lines, same segments",
    "euclidean": "straight lines, zero-velocity segments",
    "ik": "inverse kinematics of the hand",
}


def recording_rows(analysis: Analysis) -> list[Row]:
    """One row for each method; errors of a method without geodesics are missing."""
    motion = analysis.motion
    used = motion.filter
    same: Row = {
        "samples": len(motion),
        "duration_s": motion.duration,
        "rate_hz": motion.rate,
        "cutoff_hz": None if used is None else _finite(used.bandwidth),
        "noise_rad": None if used is None else _finite(float(np.sqrt(np.mean(used.noise**2)))),
        "metric": analysis.metric_name,
        "threshold_rad": analysis.threshold,
    }
    own = analysis.table().rows[0][0]
    rows: list[Row] = []
    for method in ("riemannian", *_METHODS):
        if method not in (*analysis.errors, *analysis.not_found):
            continue
        rows.append(
            same
            | {
                "method": method,
                "method_label": str(own) if method == "riemannian" else _METHODS[method],
                "segments": analysis.segment_counts.get(method),
            }
            | _errors(analysis.errors.get(method))
            | _errors(analysis.errors_unfiltered.get(method), "_unfiltered")
        )
    return rows


def synergy_rows(analysis: Analysis) -> list[Row]:
    """One row for each synergy, with the mean errors over its samples."""
    rows: list[Row] = []
    for number, synergy in enumerate(analysis.synergies, 1):
        parts = (_part(motion, synergy) for motion in (analysis.motion, analysis.predicted))
        own: Row = {
            "metric": analysis.metric_name,
            "synergy": number,
            "start_sample": synergy.start,
            "stop_sample": synergy.stop,
            "start_time_s": synergy.start_time,
            "duration_s": synergy.duration,
            "length": synergy.length,
            "mean_speed": _finite(synergy.length / synergy.duration),
            "peak_speed": peak_speed(synergy),
        }
        rows.append(own | _errors(motion_errors(analysis.model, *parts)))
    return rows


def peak_speed(synergy: Synergy) -> float:
    """The largest speed of a synergy's time law, a piecewise parabola, exactly."""
    law = synergy.law
    times = [law.knots]
    start, stop = law(law.knots[:-1], 2), law((law.knots[:-1] + law.knots[1:]) / 2.0, 2)
    change = 2.0 * (stop - start)  # of the acceleration over each interval
    with np.errstate(divide="ignore", invalid="ignore"):
        share = -start / change
    inside = (share > 0.0) & (share < 1.0)
    times.append((law.knots[:-1] + share * np.diff(law.knots))[inside])
    return float(np.max(law(np.concatenate(times), 1)))


def _part(motion: Motion, synergy: Synergy) -> Motion:
    rows = slice(synergy.start, synergy.stop + 1)
    return Motion(motion.time[rows], motion.q[rows], motion.joint_names)


def _errors(errors: MotionErrors | None, suffix: str = "") -> Row:
    return {
        f"joint_error{suffix}_rad": None if errors is None else _finite(errors.joint),
        f"position_error{suffix}_m": None if errors is None else _finite(errors.position),
        f"orientation_error{suffix}_rad": None if errors is None else _finite(errors.orientation),
    }


def _finite(number: float) -> float | None:
    return number if isfinite(number) else None


def named_file(text: str) -> str:
    """A path in a table as it is compared with those that `path_ends` gives."""
    return str(PurePosixPath(text.replace("\\", "/").removeprefix("./").lstrip("/")))


def path_ends(file: str) -> Iterator[str]:
    """What a table may call a file, the longest first, and with its suffix before without.

    >>> list(path_ends("S1/reach_1.5.c3d"))
    ['S1/reach_1.5.c3d', 'S1/reach_1.5', 'reach_1.5.c3d', 'reach_1.5']
    """
    path = PurePosixPath(file)
    parts = [part for part in path.parts if part != "/"]
    for start in range(len(parts)):
        for name in dict.fromkeys((path.name, path.stem)):
            yield "/".join([*parts[start:-1], name])


PARQUET_HINT = "Parquet needs pyarrow: pip install 'geodesic_ocp[parquet]'"


def has_parquet() -> bool:
    """Whether tables can be written as Parquet."""
    return find_spec("pyarrow") is not None


def write_parquet(file: Path, columns: Sequence[TableColumn], rows: Sequence[Row]) -> None:
    """Write rows of these columns; needs pyarrow."""
    import pyarrow
    import pyarrow.parquet

    types = {"text": pyarrow.string(), "integer": pyarrow.int64(), "number": pyarrow.float64()}
    arrays = {
        column.name: pyarrow.array(
            [row.get(column.name, "" if column.kind == "text" else None) for row in rows],
            type=types[column.kind],
        )
        for column in columns
    }
    pyarrow.parquet.write_table(pyarrow.table(arrays), file)


def read_parquet(file: Path) -> tuple[list[str], list[tuple[str, list[Any]]]]:
    """Names of the columns, and the rows, each with its place in the file.

    Raises:
        RecordingError: the file cannot be read.
        ImportError: pyarrow is not installed.
    """
    if not has_parquet():
        raise ImportError(f"{file}: {PARQUET_HINT}")
    import pyarrow
    import pyarrow.parquet

    try:
        table = pyarrow.parquet.read_table(file)
        columns = [column.to_pylist() for column in table.columns]
    except (OSError, ValueError, pyarrow.ArrowException) as error:  # ValueError: text is not UTF-8
        raise RecordingError(f"{file}: cannot be read as Parquet: {error}") from None
    rows = zip(*columns, strict=True)
    return list(table.column_names), [(f"row {k}", list(row)) for k, row in enumerate(rows, 1)]


def read_text_table(file: Path) -> tuple[list[str], list[tuple[str, list[str]]]]:
    """Names of the columns of a CSV file, and its lines, each with its place in the file.

    Raises:
        RecordingError: the file cannot be read, or a line does not fit the columns.
    """
    lines: list[tuple[str, list[str]]] = []
    number = 0
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.reader(stream, strict=True)
            names = next(reader, [])
            number = reader.line_num
            for values in reader:
                where = f"line {number + 1}"
                number = reader.line_num
                if values and len(values) != len(names):
                    raise RecordingError(
                        f"{file}: {where}: {len(values)} values under {len(names)} columns"
                    )
                if values:
                    lines.append((where, values))
    except UnicodeDecodeError as error:
        raise RecordingError(f"{file}: is not text in UTF-8: {error}") from None
    except csv.Error as error:
        raise RecordingError(f"{file}: line {number + 1}: is not CSV: {error}") from None
    except OSError as error:
        raise RecordingError(f"{file}: cannot be read: {error}") from None
    if len(names) == 1 and {";", "\t"} & set(names[0]):
        raise RecordingError(f"{file}: line 1: separate columns by commas, got {names[0][:60]!r}")
    if not names:
        raise RecordingError(f"{file}: line 1: is empty, expected the names of columns")
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise RecordingError(f"{file}: line 1: column {', '.join(twice)} is there twice")
    return names, lines


# Without these a table says nothing about subjects; other columns may be missing.
_NEEDED = {
    "recordings": ("recording", "subject", "method", "duration_s", "joint_error_rad"),
    "synergies": ("recording", "subject", "duration_s", "length"),
    "failures": ("recording", "reason"),
}
_NOT_NEGATIVE = ("joint_error", "position_error", "orientation_error", "duration", "length", "segm")
_KEYS = {"recordings": ("recording", "method"), "synergies": ("recording", "synergy")}


def read_rows(file: Path, table: str) -> list[Row]:
    """The rows of one of `TABLES`; columns that it does not define are text.

    Raises:
        RecordingError: the file is missing or cannot be read, a column that is needed is missing, a
            value is not a number, or a row is there twice; names file, line (of Parquet, row) and
            column.
        ImportError: a Parquet file without the extra `parquet`.
    """
    if not file.is_file():
        raise RecordingError(f"{file}: there is no such file")
    read = read_parquet if file.suffix.lower() == ".parquet" else read_text_table
    names, lines = read(file)
    if missing := [name for name in _NEEDED[table] if name not in names]:
        raise RecordingError(
            f"{file}: line 1: column {', '.join(missing)} is missing; is it the table of {table}?"
        )
    columns = {column.name: column for column in TABLES[table]}
    rows: list[Row] = []
    seen: dict[tuple[Cell, ...], str] = {}
    for where, values in lines:
        row: Row = {}
        for name, value in zip(names, values, strict=True):
            row[name] = _checked(value, columns.get(name), f"{file}: {where}, column {name}")
        if key := tuple(row[name] for name in _KEYS.get(table, ()) if name in row):
            if key in seen:
                what = ", ".join(map(str, key))
                raise RecordingError(f"{file}: {where}: {what} is there already, in {seen[key]}")
            seen[key] = where
        rows.append(row)
    return rows


def _checked(value: Any, column: TableColumn | None, where: str) -> Cell:
    """The value of a cell, None where it is missing; `where` opens the message if it is wrong."""
    if column is None or column.kind == "text":
        return "" if value is None else str(value)
    if isinstance(value, str):
        try:
            value = column.parsed(value.strip())
        except ValueError:
            raise RecordingError(f"{where}: {value!r} is not a number") from None
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise RecordingError(f"{where}: {value!r} is not a number")
    if math.isinf(value):
        raise RecordingError(f"{where}: {value!r} is not finite")
    if value < 0 and column.name.startswith(_NOT_NEGATIVE):
        raise RecordingError(f"{where}: {value!r} is negative")
    return value


def write_rows(folder: str | PathLike[str], name: str, rows: Sequence[Row]) -> list[Path]:
    """Write a tidy table as CSV, and as Parquet with the extra; each file as a whole.

    Args:
        folder: of the files, which exists.
        name: of the table, one of `TABLES`.
        rows: values by column; those that are left out are missing.

    Returns:
        The files' paths.

    Raises:
        ValueError: a row has a value that is in no column.
        OSError: a file cannot be written.
    """
    columns = TABLES[name]
    known = {column.name for column in columns}
    for row in rows:
        if extra := set(row) - known:
            raise ValueError(f"{name} has no column {', '.join(sorted(extra))}")
    folder = Path(folder)
    written = [folder / f"{name}.csv"]
    with replacing(written[0]) as file:
        _write_csv(file, columns, rows)
    if has_parquet():
        written.append(folder / f"{name}.parquet")
        with replacing(written[1]) as file:
            write_parquet(file, columns, rows)
    return written


def _write_csv(file: Path, columns: Sequence[TableColumn], rows: Sequence[Row]) -> None:
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([column.name for column in columns])
        for row in rows:
            writer.writerow([row.get(column.name) for column in columns])  # None is empty
