"""Markers in c3d files.

Points without a label, or with one that begins with an asterisk, belong to no marker that could be
named and are left out; so are the angles, forces, moments and powers of a model, which some
programs store as points. A marker is missing where its residual is negative, and where it is
exactly at the origin with a residual of zero. Time starts at zero.

The library ezc3d is not used: version 1.7.2 ends the process with a segmentation fault on files
whose parameters are incomplete. The tests compare with it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.formats.markers.c3d_header import C3dHeader, floats, read_c3d_header
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.recordings.units import LENGTHS
from geodesic_ocp.trajectory.motion import Subject

_NO_POSITIONS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS")
_SAME_RATE = 0.01


def read_c3d(file: Path) -> Markers:
    """Read all markers that have a label.

    Raises:
        RecordingError: the file is broken or cut off, has no markers, or gives no known unit.
    """
    content = file.read_bytes()
    header = read_c3d_header(file, content)
    if header.points == 0:
        analog = ", only analog data" if header.analog else ""
        raise RecordingError(f"{file}: has no markers{analog}")
    _check_counts(file, header, len(content))
    units = header.strings("POINT", "UNITS")
    unit = units[0] if units else ""
    if unit.lower() not in LENGTHS:
        raise RecordingError(f"{file}: POINT:UNITS must be m, cm or mm, is {unit!r}")
    labels = _labels(header)[: header.points]
    others = {name for kind in _NO_POSITIONS for name in header.strings("POINT", kind)}
    kept = [
        index
        for index, label in enumerate(labels)
        if label and not label.startswith("*") and label not in others
    ]
    if not kept:
        raise RecordingError(f"{file}: none of its {header.points} points has a marker's label")
    names, subject = _without_prefix([labels[index] for index in kept])
    subjects = header.strings("SUBJECTS", "NAMES")
    points = _points(header, content)[:, kept]
    positions, residuals = points[:, :, :3], points[:, :, 3]
    missing = (residuals < 0.0) | ((residuals == 0.0) & np.all(positions == 0.0, axis=2))
    positions = np.where(missing[:, :, None], np.nan, LENGTHS[unit.lower()] * positions)
    time = np.arange(header.frames) / header.rate
    try:
        person = Subject(name=subjects[0] if len(subjects) == 1 else subject)
        return Markers(time, tuple(names), positions, person)
    except ValueError as failure:
        raise RecordingError(f"{file}: {failure}") from None


def _check_counts(file: Path, header: C3dHeader, size: int) -> None:
    """RecordingError if header and parameters differ, or count more frames than there are."""
    used, rate = header.numbers("POINT", "USED"), header.numbers("POINT", "RATE")
    if used is not None and used[0] != header.points:
        raise RecordingError(
            f"{file}: is broken: the header counts {header.points} points, POINT:USED {used[0]:g}"
        )
    if rate is not None and not abs(rate[0] - header.rate) <= _SAME_RATE * header.rate:
        raise RecordingError(
            f"{file}: is broken: the rate is {header.rate:g} Hz in the header, {rate[0]:g} Hz in "
            "POINT:RATE"
        )
    counted = header.numbers("POINT", "FRAMES")
    if counted is not None and header.frames < 65535 and counted[0] != header.frames:
        raise RecordingError(
            f"{file}: is broken: the header counts {header.frames} frames, POINT:FRAMES "
            f"{counted[0]:g}"
        )
    held = max(size - header.data, 0) // _frame_size(header)
    if header.frames < 1:
        raise RecordingError(
            f"{file}: the header is broken: it counts frames {header.first} to {header.last}"
        )
    if header.frames > held:
        raise RecordingError(
            f"{file}: is cut off: the header counts {header.frames} frames, there are {held}"
        )


def _frame_size(header: C3dHeader) -> int:
    """Bytes of a frame."""
    return (4 * header.points + header.analog) * (4 if header.scale < 0.0 else 2)


def _points(header: C3dHeader, content: bytes) -> Array:
    """Coordinates in the unit of the file, and residual, of every point (frames, points, 4).

    The residual, with the mask of cameras in its other byte, is only compared with zero.
    """
    raw = content[header.data : header.data + header.frames * _frame_size(header)]
    words = (
        floats(raw, header.order, header.is_dec)
        if header.scale < 0.0
        else np.frombuffer(raw, f"{header.order}i2").astype(float)
    )
    frames = words.reshape(header.frames, -1)[:, : 4 * header.points]
    points = frames.reshape(header.frames, header.points, 4).copy()
    if header.scale > 0.0:
        points[:, :, :3] *= header.scale
    return points


def _labels(header: C3dHeader) -> list[str]:
    """Labels of the points; beyond 255 they continue in LABELS2, LABELS3, ..."""
    numbers = [
        int(name[6:])
        for group, name in header.parameters
        if group == "POINT" and name.startswith("LABELS") and name[6:].isdecimal()
    ]
    names = ["LABELS", *(f"LABELS{number}" for number in sorted(numbers))]
    return [label for name in names for label in header.strings("POINT", name)]


def _without_prefix(labels: list[str]) -> tuple[list[str], str]:
    """Labels without the subject before a colon, if they then still differ; and the subject."""
    split = [label.rpartition(":") for label in labels]
    names = [name.strip() for _, _, name in split]
    if "" in names or len(set(names)) < len(names):
        return labels, ""
    prefixes = {prefix for prefix, _, _ in split if prefix}
    return names, prefixes.pop() if len(prefixes) == 1 else ""
