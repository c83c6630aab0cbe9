"""Directions in words, such as "+x"."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array

_AXES = {
    f"{sign}{name}": (1.0 if sign == "+" else -1.0) * axis
    for name, axis in zip("xyz", np.eye(3), strict=True)
    for sign in "+-"
}
_ALONG = np.cos(np.radians(5.0))
_EXACT = 1e-9


def axis_name(direction: ArrayLike, frame: str) -> str:
    """Such as "along +x of the base", or with components where it is along none of the axes."""
    vector: Array = np.asarray(direction, dtype=float)
    vector = vector / np.linalg.norm(vector)
    for name, axis in _AXES.items():
        if axis @ vector >= _ALONG:
            return f"along {name} of {frame}"
    entries = ", ".join(f"{entry:.2f}" for entry in vector + 0.0)
    return f"along ({entries}) of {frame}"


def direction_record(direction: Array) -> str | list[float]:
    """A unit vector (3,) for a file: "+x" if it is an axis, otherwise its components."""
    for name, axis in _AXES.items():
        if np.abs(axis - direction).max() <= _EXACT:
            return name
    return [float(entry) + 0.0 for entry in direction]


def read_direction(field: str, record: Any) -> Array:
    """A unit vector (3,) from `direction_record`, or from three numbers of any length.

    Raises:
        ValueError: it is neither; the message names the field.
    """
    if isinstance(record, str) and record in _AXES:
        return np.array(_AXES[record])
    try:
        vector = np.array(record, dtype=float)
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if isinstance(record, str) or vector.shape != (3,) or not 0.0 < np.linalg.norm(vector) < np.inf:
        raise ValueError(
            f"{field} must be one of {', '.join(_AXES)}, or three numbers that are not all zero, "
            f"got {record!r}"
        )
    return np.asarray(vector / np.linalg.norm(vector))
