"""Tables of laboratories: Vicon Nexus' CSV, Qualisys' TSV, and the tables of Motion-BIDS.

A CSV of Vicon Nexus has sections, each of its name, its rate, and a table; that of the markers is::

    Trajectories
    100
    ,,Anna:RSHO,,,Anna:RELB,,
    Frame,Sub Frame,X,Y,Z,X,Y,Z
    ,,mm,mm,mm,mm,mm,mm
    1,0,100.0,200.0,1400.0,,,

A TSV of Qualisys Track Manager has lines KEY value, among them FREQUENCY and MARKER_NAMES, then
perhaps a line of titles, and rows of positions [mm], with or without Frame and Time before them.

Motion-BIDS (Jeung et al., "Motion-BIDS: an extension to the brain imaging data structure to
organize motion data for reproducible research", Scientific Data 11, 2024) keeps the columns of
sub-01_..._motion.tsv in a table of its own, sub-01_..._channels.tsv, and the rate in
sub-01_..._motion.json; what holds for many recordings may be in a folder above. Channels of type
JNTANG are read as joint angles, or else those of type POS as markers.

A marker is missing where its cells are empty, nan or n/a, for Qualisys also where they are zero.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.conventions.angle_convention import AngleConvention
from geodesic_ocp.recordings.conventions.osim_convention import OsimConvention
from geodesic_ocp.recordings.formats.marker_tables import check_whole
from geodesic_ocp.recordings.formats.opensim import motion_of_columns
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.records import read_structured
from geodesic_ocp.trajectory.files.delimited import (
    Rows,
    check_names,
    compare_count,
    read_rows,
    split_line,
)
from geodesic_ocp.trajectory.files.series import Series
from geodesic_ocp.trajectory.files.text_lines import (
    ANGLES,
    LENGTHS,
    named_failures,
    numbers,
    rate_of,
    read_lines,
    stated_rate,
    times_at,
)
from geodesic_ocp.trajectory.motion import Motion, Subject
from geodesic_ocp.trajectory.recording import ask_about_degrees, check_radians

_BLANK = ' ,;\t"'


# Separators alone are a row in which all is missing.
_rows = partial(read_rows, expected="{} are needed", blank=" ")


def _markers(rows: Rows, time: Array, labels: Sequence[str], positions: Array) -> Markers:
    """Return positions (k, m, 3) [m] of markers."""
    check_whole(rows, labels, positions)
    return Markers(time, tuple(labels), positions)


def read_vicon(file: Path) -> Markers:
    """Read the markers in the section Trajectories of a CSV of Vicon Nexus; others are left out.

    Unlabelled trajectories, such as "*12", are left out, too.

    Raises:
        RecordingError: there is no such section, its header is incomplete, its unit is unknown, or
            a row has another length or an entry that is not a number; the message names the line.
    """
    with named_failures(file):
        lines = read_lines(file)
        sections = _sections(lines)
        if "Trajectories" not in sections:
            raise RecordingError(
                "has no section Trajectories, which has the markers; there are "
                f"{', '.join(sections) or 'none'}"
            )
        start = sections["Trajectories"]
        head = lines[start + 1 : start + 5]
        separator = next((each for each in "\t;," if each in "".join(head[2:3])), ",")
        labels, axes, units = (split_line(line, separator) for line in [*head, "", "", ""][1:4])
        (rate,) = numbers(start + 2, "the rate", [head[0].strip(_BLANK)], 1)
        if [each.lower() for each in axes[:2]] != ["frame", "sub frame"]:
            raise RecordingError(
                f"line {start + 4} must begin with Frame, Sub Frame, is {','.join(axes)[:60]!r}"
            )
        columns = _vicon_columns(start + 3, labels, axes)
        indices = list(chain(*columns.values()))
        given = {units[k] if k < len(units) else "" for k in indices}
        unit = given.pop() if len(given) == 1 else ", ".join(sorted(given))
        if unit not in LENGTHS:
            raise RecordingError(f"line {start + 5} must give the unit m, cm or mm, not {unit!r}")
        table = range(start + 5, len(lines))
        end = next((k for k in table if not lines[k].strip(_BLANK)), len(lines))
        if separator == ";":  # where decimals have commas
            lines = [line.replace(",", ".") for line in lines]
        rows = _rows(lines[:end], start + 5, axes, separator)
        frames = rows.at([0])[:, 0]
        cells = rows.at(indices, missing=True)
        positions = LENGTHS[unit] * cells.reshape(len(cells), -1, 3)
        return _markers(rows, _time(frames, rate), list(columns), positions)


def _sections(lines: Sequence[str]) -> dict[str, int]:
    """Return the index of the first line of every section: its name, which a rate follows."""
    plain = [line.strip(_BLANK) for line in lines]
    return {
        name: index
        for index, (name, rate) in enumerate(pairwise(plain))
        if re.fullmatch(r"[A-Za-z][A-Za-z ]*", name) and re.fullmatch(r"\d+(\.\d+)?", rate)
    }


def is_vicon(lines: list[str]) -> bool:
    """Return whether the file begins with a section, as a CSV of Vicon Nexus does."""
    return 0 in _sections(lines[:2]).values()


def _vicon_columns(line: int, labels: Sequence[str], axes: Sequence[str]) -> dict[str, list[int]]:
    """Return the columns X, Y and Z of every labelled marker; others are of its velocity."""
    starts = [index for index, label in enumerate(labels) if index >= 2 and label]
    columns: dict[str, list[int]] = {}
    for start, end in zip(starts, [*starts[1:], len(axes)], strict=False):
        label = labels[start]
        places = {axes[k]: k for k in range(start, min(end, len(axes)))}
        if label.rpartition(":")[2].startswith("*"):
            continue
        if label in columns or not {"X", "Y", "Z"} <= set(places):
            what = "is named twice" if label in columns else "has no columns X, Y and Z"
            raise RecordingError(f"line {line}: {label} {what}")
        columns[label] = [places[axis] for axis in "XYZ"]
    if not columns:
        raise RecordingError(f"line {line} names no markers")
    return columns


_KEY = re.compile(r"(?!NAN)[A-Z][A-Z_]+(\t|$)")


def is_qualisys(lines: list[str]) -> bool:
    """Return whether the file begins as a TSV of Qualisys Track Manager."""
    return lines[0].split("\t")[0] in ("NO_OF_FRAMES", "FILE_VERSION")


def read_qualisys(file: Path) -> Markers:
    """Read the markers of a TSV of Qualisys Track Manager.

    A header whose NO_OF_FRAMES or NO_OF_MARKERS is not what follows gives a RuntimeWarning.

    Raises:
        RecordingError: the header lacks FREQUENCY or MARKER_NAMES, as that of rigid bodies does,
            a row has another length or an entry that is not a number; the message names the
            line.
    """
    with named_failures(file):
        lines = read_lines(file)
        first = next((k for k, line in enumerate(lines) if not _KEY.match(line)), len(lines))
        header = {
            key: values for key, *values in (split_line(line, "\t") for line in lines[:first])
        }
        names = [name for name in header.get("MARKER_NAMES", []) if name]
        if not names:
            held = " ".join(header.get("DATA_INCLUDED", ["other"]))
            raise RecordingError(f"its header has no line MARKER_NAMES; it is of {held} data")
        check_names("MARKER_NAMES", names)
        line = next((k for k, each in enumerate(lines[:first]) if each.startswith("FREQ")), first)
        (rate,) = numbers(line + 1, "FREQUENCY", header.get("FREQUENCY", [])[:1], 1)
        columns = [f"{name} {axis}" for name in names for axis in "XYZ"]
        row = split_line(lines[first], "\t") if first < len(lines) else []
        titled = row[:1] in (["Frame"], columns[:1])
        if row[:1] == ["Frame"] or (not titled and len(row) >= len(columns) + 2):
            columns = ["Frame", "Time", *columns]
        rows = _rows(lines, first + titled, columns, "\t")
        counts = {key: values[0] for key, values in header.items() if values}
        compare_count(file, counts, "NO_OF_FRAMES", "frames", len(rows.cells))
        compare_count(file, counts, "NO_OF_MARKERS", "markers", len(names))
        time = _time(np.arange(len(rows.cells), dtype=float), rate)
        if columns[0] == "Frame":
            time = rows.at([1])[:, 0]
        cells = rows.at(range(len(columns) - 3 * len(names), len(columns)), missing=True)
        positions = 1e-3 * cells.reshape(len(cells), -1, 3)
        positions[np.all(positions == 0.0, axis=2)] = np.nan
        return _markers(rows, time, names, positions)


def _time(frames: Array, rate: float) -> Array:
    """Return times [s] from the first frame on."""
    with np.errstate(over="ignore", invalid="ignore"):  # of damaged files
        time: Array = (frames - frames[:1]) / as_positive("the rate of frames", rate, "Hz")
    return time


def _beside(file: Path, suffix: str) -> Iterator[Path]:
    """Yield files of this suffix that hold for the recording, the nearest first.

    They are in its folder or up to three above (those of the session, the subject and the data
    set), and all parts of their names are parts of the recording's.
    """
    parts = set(file.name.split("_"))
    for folder in islice(file.absolute().parents, 4):
        found = [
            each
            for each in folder.glob(f"*{suffix}")
            if set(each.name.removesuffix(suffix).split("_")) <= parts
        ]
        yield from sorted(found, key=lambda each: len(each.name), reverse=True)


_RATE = "SamplingFrequency"
_NEEDED = ("name", "component", "type", "tracked_point", "units")


def _channels(file: Path) -> list[dict[str, str]]:
    """Return what is said of each column of a recording in Motion-BIDS, by `_NEEDED`."""
    beside = next(_beside(file, "_channels.tsv"), None)
    if beside is None:
        wanted = file.name.replace("_motion.tsv", "_channels.tsv")
        raise RecordingError(f"{file}: {wanted}, which names its columns, is not beside it")
    with named_failures(beside):
        lines = read_lines(beside)
        names = split_line(lines[0], "\t")
        if missing := [name for name in _NEEDED if name not in names]:
            raise RecordingError(f"line 1 names no column {', '.join(missing)}")
        rows = _rows(lines, 1, names, "\t")
    return [dict(zip(names, cells, strict=True)) for cells in rows.cells]


def motion_bids_kind(file: Path) -> str:
    """Return the format of a recording in Motion-BIDS, a key of `FORMATS`, from its channels.

    Raises:
        RecordingError: there is no table of the channels, or none of positions or joint angles.
    """
    types = sorted({each["type"].upper() for each in _channels(file)})
    if not {"JNTANG", "POS"} & set(types):
        raise RecordingError(
            f"{file}: its channels are of type {', '.join(types)}; those of JNTANG (joint angles) "
            "or POS (positions) are read"
        )
    return "bids angles" if "JNTANG" in types else "bids markers"


def _bids(
    file: Path, kind: str, rate: float | None = None
) -> tuple[list[dict[str, str]], Rows, list[int], Array]:
    """Return all channels, the rows, the indices of the channels of a kind, and the time."""
    channels = _channels(file)
    rows = _rows(read_lines(file), 0, [each["name"] for each in channels], "\t")
    types = [each["type"].upper() for each in channels]
    if "LATENCY" in types:
        time = rows.at([types.index("LATENCY")])[:, 0]
        stated_rate(file, rate_of(time), rate)
    else:
        beside = (read_structured(each, "description") for each in _beside(file, "_motion.json"))
        rates = [each[_RATE] for each in beside if isinstance(each, dict) and _RATE in each]
        own = as_positive("the rate of frames", rates[0], "Hz") if rates else None
        used = stated_rate(file, own, rate)
        if used is None:
            wanted = file.name.replace(".tsv", ".json")
            raise RecordingError(
                f"no {wanted} beside it or above gives {_RATE}, nor does rate (--sample-rate)"
            )
        time = times_at(len(rows.cells), used)
    return channels, rows, [k for k, each in enumerate(types) if each == kind], time


def _scale(channel: dict[str, str], units: Mapping[str, float]) -> float:
    if channel["units"].lower() not in units:
        known = "rad or deg" if units is ANGLES else "m, cm or mm"
        raise RecordingError(
            f"the channel {channel['name']} has the unit {channel['units']!r}, not {known}"
        )
    return units[channel["units"].lower()]


def _person(file: Path) -> Subject:
    return Subject(name=file.name.split("_")[0].removeprefix("sub-"))


def read_motion_bids_markers(file: Path) -> Markers:
    """Read the points that are tracked by channels x, y and z of type POS in Motion-BIDS.

    Raises:
        RecordingError: a file beside the recording is missing or malformed, a point lacks a
            coordinate, or a row has another length or an entry that is not a number.
    """
    with named_failures(file):
        channels, rows, kept, time = _bids(file, "POS")
        points: dict[str, dict[str, int]] = {}
        for index in kept:
            channel = channels[index]
            found = points.setdefault(channel["tracked_point"], {})
            if found.setdefault(channel["component"].lower(), index) != index:
                raise RecordingError(
                    f"two channels are {channel['component']} of {channel['tracked_point']}"
                )
        for name, found in points.items():
            if set(found) != set("xyz"):
                raise RecordingError(f"{name} has channels {', '.join(found)}, not x, y, z")
        indices = [found[axis] for found in points.values() for axis in "xyz"]
        scales = np.array([_scale(channels[index], LENGTHS) for index in indices])
        positions = (scales * rows.at(indices, missing=True)).reshape(len(time), -1, 3)
        return replace(_markers(rows, time, list(points), positions), subject=_person(file))


def read_motion_bids_angles(
    file: Path,
    joints: Sequence[str] | None = None,
    convention: AngleConvention | OsimConvention | str | Path | None = None,
    columns: Any = None,
    fill: float | None = None,
    part: int | None = None,
    rate: float | None = None,
) -> Motion:
    """Read the channels of type JNTANG in Motion-BIDS by their names.

    Args:
        file: sub-..._motion.tsv.
        joints, convention, columns: see `read_opensim`.
        fill, part: what becomes of gaps, see `Series.motion`.
        rate: rate [Hz], if no file beside the recording says it.

    Raises:
        Gaps: samples are missing, beyond those that are bridged.
        RecordingError: a file beside the recording is missing or malformed, a row has another
            length or an entry that is not a number, or the channels do not give the joints.
    """
    with named_failures(file):
        channels, rows, kept, time = _bids(file, "JNTANG", rate)
        names = [channels[index]["name"] for index in kept]
        check_names("the table of channels", names)
        scales = np.array([_scale(channels[index], ANGLES) for index in kept])
        table = Series(time, scales * rows.at(kept, missing=True), tuple(names))
        ask_about_degrees(str(file), (table.q / scales)[:, scales != 1.0])
        check_radians(names, np.where(scales == 1.0, table.known, 0.0))
        motion = motion_of_columns(
            file, lambda _: table, joints, convention, columns, fill=fill, part=part
        )
        return replace(motion, subject=_person(file))
