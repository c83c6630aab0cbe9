"""Tables of OpenSim, .mot and .sto.

They have a header of lines key=value that ends with endheader, then the names of the columns.
`inDegrees` is about rotations; translations are in metres. SIMM's header has no inDegrees. In the
state files of OpenSim 4, of the columns /jointset/shoulder/elv_angle/value and .../speed the first
is the coordinate elv_angle and the second is not read. Counts in the header, which programs that
edit such files often leave as they were, are compared with a warning. Time is in seconds.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.trajectory.files.delimited import (
    check_names,
    compare_count,
    read_rows,
    split_line,
)
from geodesic_ocp.trajectory.files.series import Series
from geodesic_ocp.trajectory.files.text_lines import (
    named_failures,
    rate_of,
    read_lines,
    stated,
    stated_rate,
    times_at,
)
from geodesic_ocp.trajectory.recording import ask_about_degrees, check_radians

_TRANSLATION = re.compile(r"(_t|_?trans_?)[xyz]$", re.IGNORECASE)
_STATE = re.compile(r"/jointset/[^/]+/(?P<coordinate>[^/]+)/(?P<kind>value|speed)$")


def is_translation(name: str) -> bool:
    """Return whether a coordinate of this name is a length, such as pelvis_tx or box_transX."""
    return _TRANSLATION.search(name) is not None


def read_coordinates(
    file: Path,
    translations: Iterable[str] = (),
    *,
    degrees_in: bool | None = None,
    rate: float | None = None,
) -> Series:
    """Read all coordinates of a .mot or .sto file, with NaN where it has nan or empty cells.

    A header whose nRows or nColumns is not what follows gives a RuntimeWarning.

    Args:
        translations: names of coordinates in metres, beside those that `is_translation` knows.
        degrees_in: whether angles are in degrees, if the header does not say it.
        rate: rate [Hz] of a table without a column of time.

    Raises:
        RecordingError: no header, no unit of the angles or no time, a broken row, or angles that
            should be in radians look like degrees; names the line.
    """
    with named_failures(file):
        lines = read_lines(file)
        header, first = _opensim_header(lines)
        factor = _radians(file, header, degrees_in)
        while first < len(lines) and not lines[first].strip(" ,\t"):
            first += 1
        if first == len(lines):
            raise RecordingError("no line with the names of columns follows endheader")
        separator = next((each for each in "\t," if each in lines[first]), None)
        labels = split_line(lines[first].rstrip(" ,\t"), separator)
        timed = labels[0].lower() == "time"
        if len(labels) < 1 + timed or not (timed or rate):
            raise RecordingError(
                f"line {first + 1} must name the columns, time first, is {lines[first][:60]!r}; "
                "the rate of a table without time is given by rate (--sample-rate)"
            )
        if not all(labels):
            raise RecordingError(f"line {first + 1}: column {labels.index('') + 1} has no name")
        states = [_STATE.search(label) for label in labels]
        is_coordinate = [state is None or state["kind"] == "value" for state in states]
        if any(states):  # a file of states also has muscles' states, which are no coordinates
            is_coordinate = [state is not None and state["kind"] == "value" for state in states]
        kept = [k for k, each in enumerate(is_coordinate) if k >= timed and each]
        names = [labels[k] if (state := states[k]) is None else state["coordinate"] for k in kept]
        check_names(f"line {first + 1}", names)
        rows = read_rows(lines, first + 1, labels, separator, "the names of columns {}")
        compare_count(file, header, "nrows", "rows", len(rows.cells))
        compare_count(file, header, "ncolumns", "columns", len(labels))
        q = rows.at(kept, missing=True)
        angles = [
            k for k, each in enumerate(names) if not (is_translation(each) or each in translations)
        ]
        numbers = q[:, angles]
        q[:, angles] *= factor
        time = rows.at([0])[:, 0] if timed else times_at(len(q), rate or np.nan)
        series = Series(time, q, tuple(names))
        stated_rate(file, rate_of(time) if timed else None, rate)
        if factor == 1.0:
            check_radians([names[k] for k in angles], series.known[:, angles])
        else:
            ask_about_degrees(str(file), numbers)
        return series


# Counts in headers of SIMM, "datarows 120", which has no inDegrees.
_SIMM = {"datarows": "nrows", "datacolumns": "ncolumns"}


def _opensim_header(lines: Sequence[str]) -> tuple[dict[str, str], int]:
    """Return keys (in lower case) and values before endheader, and the index after it."""
    header: dict[str, str] = {}
    for number, line in enumerate(lines):
        text = line.strip(" ,\t")
        if text.lower() == "endheader":
            return header, number + 1
        key, equals, value = text.partition("=")
        if not equals:  # SIMM's
            key, _, value = text.partition(" ")
        header[_SIMM.get(key.strip().lower(), key.strip().lower())] = value.strip()
    raise RecordingError("no line 'endheader' ends the header")


def _radians(file: Path, header: Mapping[str, str], degrees_in: bool | None) -> float:
    kind = header.get("datatype", "double").lower()
    if kind != "double":
        raise RecordingError(f"its DataType is {kind}; joint coordinates are of type double")
    text = header.get("indegrees", "").lower()
    if text not in ("yes", "no", ""):
        raise RecordingError(
            f"its header must have inDegrees=yes or inDegrees=no, not 'inDegrees={text}'"
        )
    own = text == "yes" if text else None
    degrees = stated(file, "inDegrees (degrees_in)", own=own, given=degrees_in)
    if degrees is None:
        raise RecordingError(
            "its header must have inDegrees=yes or inDegrees=no, or the unit of its angles is "
            "given: degrees_in=True (--degrees-in) or degrees_in=False (--no-degrees-in)"
        )
    return np.pi / 180.0 if degrees else 1.0
