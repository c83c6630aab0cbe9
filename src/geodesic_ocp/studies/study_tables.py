"""The tables of many recordings: their columns, and how they are read and written.

recordings.csv has one row for each recording and method, synergies.csv one for each synergy,
profiles.csv one for each recording and joint inertia, and failures.csv one for each recording
without a result. Units are the suffix of a column's name.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from importlib.util import find_spec
from math import isfinite
from os import PathLike
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.records import replacing
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.synergies.scores import MotionErrors, motion_errors
from geodesic_ocp.synergies.synergy import Synergy
from geodesic_ocp.synergies.uncertainty import Uncertainty
from geodesic_ocp.trajectory.recording import range_of_motion

if TYPE_CHECKING:
    from pandas import DataFrame

Kind = Literal["text", "integer", "number"]  # of a column; integers and numbers may be missing
Row = dict[str, str | int | float | None]
Entry = TypeVar("Entry")  # what a table says about a file

# The kind of each column, and its meaning where the name does not say it.
IDENTITY: dict[str, Kind] = {
    "recording": "text",  # the file and the side
    "file": "text",  # relative to the folder that was given
    "subject": "text",  # the person; recordings of one person are not independent
    "subject_from": "text",  # table, path, file (that names the subject), folder name or file name
    "trial": "text",  # the repetition, within the subject
    "side": "text",
}
_ERRORS: dict[str, Kind] = {
    "joint_error_rad": "number",  # means over samples (and joints)
    "position_error_m": "number",
    "orientation_error_rad": "number",
}
RECORDINGS: dict[str, Kind] = {
    **IDENTITY,
    "height_m": "number",  # of the model
    "height_from": "text",  # given, table, file, markers, or assumed
    "mass_kg": "number",
    "mass_from": "text",  # given, table, file, or assumed
    "marker_error_m": "number",  # mean distance of markers from the fitted ones
    "doubts": "text",  # why the motion may not be what was recorded, see `Motion.doubts`
    "samples": "integer",
    "duration_s": "number",
    "rate_hz": "number",  # mean sampling rate
    "range_rad": "number",  # largest range of a joint's angle
    "cutoff_hz": "number",  # of the filter
    "noise_rad": "number",  # root mean square over joints
    "metric": "text",  # in which the motion is segmented and planned
    "cuts": "text",  # how the motion was segmented, see `Analysis.cuts`
    "method": "text",  # key in `Analysis.errors`
    "method_label": "text",  # the method in words, as in `Analysis.table`
    "segments": "integer",  # of the method; missing if the method has none
    "segments_found": "integer",  # with a geodesic; errors are means over their samples
    # What 90 % of motions with the recording's noise have, and its stable cuts; on request.
    "segments_low": "integer",
    "segments_high": "integer",
    "stable_cuts": "integer",
    "joint_error_low_rad": "number",
    "joint_error_high_rad": "number",
    **_ERRORS,
    **{name.replace("_error_", "_error_unfiltered_"): kind for name, kind in _ERRORS.items()},
    "computation_s": "number",
    "settings": "text",  # identifies the settings of the analysis
}
SYNERGIES: dict[str, Kind] = {
    **IDENTITY,
    "metric": "text",
    "synergy": "integer",  # number in the recording, from 1
    "start_sample": "integer",  # from 0
    "stop_sample": "integer",
    "start_time_s": "number",  # on the recording's clock
    "duration_s": "number",
    "length": "number",  # in the metric's unit: sqrt(kg) m, of straight lines rad
    "mean_speed": "number",  # length over duration
    "peak_speed": "number",  # of its time law
    "start_comes_back": "number",  # share of motions with its noise that are cut here; on request
    **_ERRORS,
    "settings": "text",
}
PROFILES: dict[str, Kind] = {
    **IDENTITY,
    "curve": "text",  # what is fitted to the segments: "geodesic"
    "joint_inertia_m_r2": "number",  # relative to m r^2 of the arm
    "rms_error_rad": "number",  # the least of the joints, over all curves of this joint inertia
    "m_r2_kg_m2": "number",  # moving mass times squared reach of the arm
}
TABLES: dict[str, dict[str, Kind]] = {
    "recordings": RECORDINGS,
    "synergies": SYNERGIES,
    "profiles": PROFILES,
    # Kinds of failures: file, solver, process, same (as another), missing, passive or error.
    "failures": {**IDENTITY, "kind": "text", "reason": "text"},
}


def recording_rows(
    analysis: Analysis,
    second_order: bool = True,
    effort: bool = False,
    spread: Uncertainty | None = None,
) -> list[Row]:
    """Return one row for each method; errors of a method without any geodesic are missing, those of
    one that has geodesics for some segments are means over these.

    The uncertainty, if it is given, is in the row of the geodesics of the analysis.

    Those of second order are compiled anew for every person, which takes most of a second.
    """
    motion = analysis.motion
    used = analysis.motion.filter
    same: Row = {
        "doubts": "; ".join(motion.doubts),
        "samples": len(motion),
        "duration_s": motion.duration,
        "rate_hz": motion.rate,
        "range_rad": range_of_motion(motion),
        "cutoff_hz": None if used is None else _finite(used.bandwidth),
        "noise_rad": None if used is None else _finite(float(np.sqrt(np.mean(used.noise**2)))),
        "metric": analysis.metric_name,
        "cuts": analysis.cuts,
    }
    labels = analysis.labels()
    rows = [
        same
        | {
            "method": method,
            "method_label": labels.get(method, labels["riemannian"]),  # which is the same metric
            "segments": analysis.segment_counts.get(method),
            "segments_found": analysis.segments_found(method),
        }
        | _errors(analysis.errors.get(method))
        | _errors(analysis.errors_unfiltered.get(method), "_unfiltered")
        for method in dict.fromkeys((*analysis.errors, *analysis.not_found))
    ]
    if spread is not None:
        (low, high) = spread.count_range
        (least, most) = spread.error_range("joint")
        rows[0] |= {"segments_low": low, "segments_high": high}
        rows[0] |= {"stable_cuts": int(spread.stable.sum())}
        rows[0] |= {"joint_error_low_rad": least, "joint_error_high_rad": most}
    if not second_order:
        return rows
    errors_of = partial(analysis.second_order_errors, effort=effort)
    unfiltered = errors_of(unfiltered=True) if analysis.errors_unfiltered else {}
    for name, errors in errors_of().items():
        own: Row = {
            "method": key_of(name),
            "method_label": name,
            "segments": len(analysis.segments),
            "segments_found": 0 if errors is None else len(analysis.segments),
        }
        rows.append(same | own | _errors(errors) | _errors(unfiltered.get(name), "_unfiltered"))
    return rows


def key_of(label: str) -> str:
    """Return the method of a label of second order: "Riemannian cubics" -> "riemannian_cubics"."""
    return label.lower().replace(" ", "_")


def synergy_rows(analysis: Analysis, spread: Uncertainty | None = None) -> list[Row]:
    """Return one row for each synergy, with the mean errors over its samples."""
    rows: list[Row] = []
    for number, synergy in enumerate(analysis.synergies, 1):
        ends = synergy.start, synergy.stop
        parts = (motion.part(*ends) for motion in (analysis.motion, analysis.predicted))
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
        if spread is not None and number > 1:
            own["start_comes_back"] = float(spread.near[number - 2])
        rows.append(own | _errors(motion_errors(analysis.model, *parts)))
    return rows


def peak_speed(synergy: Synergy) -> float:
    """Return the largest speed of a synergy's time law, a piecewise parabola, exactly."""
    law = synergy.law
    start = law(law.knots[:-1], 2)
    stop = law((law.knots[:-1] + law.knots[1:]) / 2.0, 2)
    change = 2.0 * (stop - start)  # of the acceleration over each interval
    with np.errstate(divide="ignore", invalid="ignore"):
        share = -start / change
    inside = (share > 0.0) & (share < 1.0)
    extrema = (law.knots[:-1] + share * np.diff(law.knots))[inside]
    return float(np.max(law(np.concatenate([law.knots, extrema]), 1)))


def _errors(errors: MotionErrors | None, suffix: str = "") -> Row:
    found = (None,) * 3 if errors is None else errors.means
    names = (name.replace("_error_", f"_error{suffix}_") for name in _ERRORS)
    return {
        name: None if value is None else _finite(value)
        for name, value in zip(names, found, strict=True)
    }


def _finite(number: float) -> float | None:
    return number if isfinite(number) else None


def doubtful_recordings(rows: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return a sentence on the recordings whose motion may not be what was recorded, if any."""
    found = [f"{row['recording']} ({row['doubts']})" for row in rows if row.get("doubts")]
    return [f"Doubtful, but in the means: {'; '.join(found)}."] if found else []


def path_ends(file: str) -> Iterator[str]:
    """Yield what a table may call a file, the longest first, and with its suffix before without.

    >>> list(path_ends("S1/reach_1.5.c3d"))
    ['S1/reach_1.5.c3d', 'S1/reach_1.5', 'reach_1.5.c3d', 'reach_1.5']
    """
    path = PurePosixPath(file)
    parts = [part for part in path.parts if part != "/"]
    for start in range(len(parts)):
        for name in dict.fromkeys((path.name, path.stem)):
            yield "/".join([*parts[start:-1], name])


PARQUET_HINT = "Parquet needs pyarrow: pip install 'geodesic_ocp[people]'"


def has_parquet() -> bool:
    """Return True if tables can be written as Parquet."""
    return find_spec("pyarrow") is not None


def read_text_table(file: Path) -> tuple[list[str], list[tuple[str, list[str]]]]:
    """Return the names of the columns of a CSV file, and its lines, each with its place.

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


def read_file_table(
    table: str | PathLike[str],
    new_entry: Callable[[dict[str, str]], Entry],
    needed: Sequence[str] = ("file",),
) -> dict[str, Entry]:
    """Return what a CSV table says about files, by the path in its column file.

    Args:
        new_entry: makes the entry of a file from its row.
        needed: columns that must be there.

    Raises:
        RecordingError: the table cannot be read, lacks a column, has a wrong entry, or lines of one
            file that differ.
    """
    path = Path(table)
    names, lines = read_text_table(path)
    if missing := [name for name in needed if name not in names]:
        raise RecordingError(f"{path}: line 1: there is no column {' or '.join(missing)}")
    entries: dict[str, Entry] = {}
    places: dict[str, str] = {}
    for where, values in lines:
        row = dict(zip(names, values, strict=True))
        file = str(PurePosixPath(row["file"].replace("\\", "/").removeprefix("./").lstrip("/")))
        try:
            entry = new_entry(row)
        except ValueError as failure:
            raise RecordingError(f"{path}: {where}: {failure}") from None
        if entries.setdefault(file, entry) != entry:
            raise RecordingError(f"{path}: {places[file]} and {where} differ about {file}")
        places.setdefault(file, where)
    return entries


def entry_of_file(entries: Mapping[str, Entry], file: str) -> Entry | None:
    """Return the entry whose path is the end of this one; None if there is none.

    The longest path counts, and of two as long the one with the suffix. A single entry may also
    give more of the path than is known of the file.
    """
    ends = list(path_ends(file))
    for end in ends:
        if end in entries:
            return entries[end]
    for whole in [end for end in ends if end.count("/") == ends[0].count("/")]:
        longer = [key for key in entries if key.endswith(f"/{whole}")]
        if longer:
            return entries[longer[0]] if len(longer) == 1 else None
    return None


# Without these a table says nothing about subjects; other columns may be missing.
_NEEDED = {
    "recordings": ("recording", "subject", "method", "duration_s", "joint_error_rad"),
    "synergies": ("recording", "subject", "duration_s", "length"),
    "profiles": ("recording", "curve", "joint_inertia_m_r2", "rms_error_rad", "m_r2_kg_m2"),
    "failures": ("recording", "reason"),
}
_NOT_NEGATIVE = (
    "joint_error",
    "position_error",
    "orientation_error",
    "duration",
    "length",
    "segm",
    "rms",
)
_KEYS = {
    "recordings": ["recording", "method"],
    "synergies": ["recording", "synergy"],
    "profiles": ["recording", "curve", "joint_inertia_m_r2"],
}


def new_rows(rows: Iterable[Mapping[str, Any]], table: str) -> DataFrame:
    """Return rows as one of `TABLES`, whose columns are all there; others are text.

    Raises:
        ValueError: an entry is not of its column's kind.
    """
    from pandas import DataFrame

    frame = DataFrame([*rows], dtype=object)
    kinds = TABLES[table]
    frame = frame.reindex(columns=[*dict.fromkeys([*kinds, *frame.columns])])
    for name in frame.columns:
        kind = kinds.get(name, "text")
        column = frame[name]
        if kind == "text":
            frame[name] = column.where(column.notna(), "").map(str).astype(object)
        else:
            frame[name] = column.astype("Int64" if kind == "integer" else "float64")
    return frame


def read_table(file: Path, table: str) -> DataFrame:
    """Read one of `TABLES`; columns that it does not define are text.

    Raises:
        RecordingError: the file is missing or cannot be read, a column that is needed is missing, a
            value is not a number, or a row is there twice; names file, line (of Parquet, row) and
            column.
        ImportError: a Parquet file without the extra `parquet`.
    """
    from pandas import DataFrame, Series, read_parquet

    if not file.is_file():
        raise RecordingError(f"{file}: there is no such file")
    if file.suffix.lower() == ".parquet":
        if not has_parquet():
            raise ImportError(f"{file}: {PARQUET_HINT}")
        try:
            frame = read_parquet(file).astype(object)
        except (OSError, ValueError, TypeError, ArithmeticError, LookupError) as error:
            raise RecordingError(f"{file}: cannot be read as Parquet: {error}") from None
        places = [f"row {k}" for k in range(1, len(frame) + 1)]
    else:
        names, lines = read_text_table(file)
        places = [where for where, _ in lines]
        frame = DataFrame([values for _, values in lines], columns=names, dtype=object)
    if missing := [name for name in _NEEDED[table] if name not in frame.columns]:
        raise RecordingError(
            f"{file}: line 1: column {', '.join(missing)} is missing; is it the table of {table}?"
        )
    for name, kind in TABLES[table].items():
        if name in frame.columns and kind != "text":
            values = zip(frame[name], places, strict=True)
            numbers = [
                _number(value, kind, name, f"{file}: {where}, column {name}")
                for value, where in values
            ]
            frame[name] = Series(numbers, dtype=object)
    keys = [name for name in _KEYS.get(table, ()) if name in frame.columns]
    for k in np.flatnonzero(frame.duplicated(keys)) if keys else ():
        key = frame.loc[k, keys]
        first = places[int(np.flatnonzero((frame[keys] == key).all(axis=1))[0])]
        what = ", ".join(map(str, key))
        raise RecordingError(f"{file}: {places[k]}: {what} is there already, in {first}")
    return new_rows(frame.to_dict("records"), table)


def _number(value: Any, kind: Kind, name: str, where: str) -> int | float | None:
    """Return the value of a cell, None where it is missing; `where` opens an error's message."""
    from pandas import isna

    if isna(value) or (isinstance(value, str) and not value.strip()):
        return None
    try:
        if isinstance(value, bool | bytes):
            raise ValueError
        number = int(value) if kind == "integer" else float(value)
    except (TypeError, ValueError):
        raise RecordingError(f"{where}: {value!r} is not a number") from None
    if not isfinite(number):
        raise RecordingError(f"{where}: {number!r} is not finite")
    if number < 0 and name.startswith(_NOT_NEGATIVE):
        raise RecordingError(f"{where}: {number!r} is negative")
    return number


def write_table(folder: str | PathLike[str], name: str, rows: Iterable[Row]) -> list[Path]:
    """Write one of `TABLES` as CSV, and as Parquet with the extra; each file as a whole.

    Args:
        folder: folder of the files, which exists.
        rows: values by column; those that are left out are missing.

    Returns:
        The files' paths.

    Raises:
        ValueError: a row has a value that is in no column.
        OSError: a file cannot be written.
    """
    frame = new_rows(rows, name)
    if extra := set(frame.columns) - set(TABLES[name]):
        raise ValueError(f"{name} has no column {', '.join(sorted(extra))}")
    written = [Path(folder) / f"{name}.csv"]
    with replacing(written[0]) as file:
        frame.to_csv(file, index=False)
    if has_parquet():
        written.append(Path(folder) / f"{name}.parquet")
        with replacing(written[1]) as file:
            frame.to_parquet(file, index=False)
    return written
