"""read_alignment: an alignment from the file that `Alignment.save` writes."""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.records import read_record
from geodesic_ocp.retargeting.alignment.arm_alignment import BASE, FORMAT, HAND, VERSION, Alignment
from geodesic_ocp.retargeting.alignment.axis_names import read_direction

_FIELDS = ("shoulder", "base", "hand", "length")
_OPTIONAL = ("side", "elbow", "wrist")
_OTHER = ("format", "version", "help", "notes")
_ACROSS = 0.02  # largest cosine of the angle between two axes; smaller ones are rounding


def read_alignment(file: str | PathLike[str]) -> Alignment:
    """The alignment in a JSON file that `Alignment.save` or `geodesic-ocp align` wrote.

    Raises:
        RecordingError: the file is missing, or of another format; a field is missing, unknown or
            malformed. Names the file and the field.
    """
    record = read_record(file, FORMAT, VERSION, "an alignment")
    try:
        for name in record:
            if name not in (*_FIELDS, *_OPTIONAL, *_OTHER):
                known = ", ".join((*_FIELDS, *_OPTIONAL))
                raise ValueError(f"{name!r} is not one of the fields {known}")
        for name in _FIELDS:
            if name not in record:
                raise ValueError(f"{name} is missing")
        right, forward = _axes("base", record["base"], BASE)
        across, fingers = _axes("hand", record["hand"], tuple(HAND))
        return Alignment(
            record["shoulder"],
            np.column_stack([right, forward, np.cross(right, forward)]),
            np.vstack([across, np.cross(fingers, across), fingers]),
            record["length"],
            **{name: record.get(name) for name in _OPTIONAL},
        )
    except ValueError as failure:
        raise RecordingError(f"{file}: {failure}") from None


def _axes(field: str, record: Any, names: tuple[str, ...]) -> list[Array]:
    """Two unit vectors (3,) at right angles."""
    if not isinstance(record, dict) or set(record) != set(names):
        raise ValueError(f"{field} must have the entries {' and '.join(names)}, got {record!r}")
    first, second = (read_direction(f"{field}: {name}", record[name]) for name in names)
    if not abs(first @ second) <= _ACROSS:
        angle = np.degrees(np.arccos(np.clip(first @ second, -1.0, 1.0)))
        raise ValueError(
            f"{field}: {names[0]} and {names[1]} must be at right angles, got {angle:.3g} degrees"
        )
    second = second - first * (first @ second)
    return [first, second / np.linalg.norm(second)]
