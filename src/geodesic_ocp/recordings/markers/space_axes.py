"""The axes of the space in which markers were recorded."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, cast, get_args

import numpy as np

from geodesic_ocp.recordings.markers.markers import Markers

Axis = Literal["x", "y", "z", "-x", "-y", "-z"]

# The coordinates, counted from 1 and signed, that become x, y and z; every choice is a rotation.
_TURNS: dict[Axis, tuple[int, int, int]] = {
    "x": (2, 3, 1),
    "y": (1, -3, 2),
    "z": (1, 2, 3),
    "-x": (2, -3, -1),
    "-y": (1, 3, -2),
    "-z": (1, -2, -3),
}


def as_axis(up: str) -> Axis:
    """An axis by its name; ValueError if it is none."""
    for axis in get_args(Axis):
        if up == axis:
            return cast(Axis, axis)
    raise ValueError(f"up must be one of {', '.join(get_args(Axis))}, got {up!r}")


def with_z_up(markers: Markers, up: Axis) -> Markers:
    """The markers in a space that is turned so that its axis `up`, such as "y", becomes z.

    Raises:
        ValueError: `up` is not an axis.
    """
    turn = np.array(_TURNS[as_axis(up)])
    return replace(markers, positions=np.sign(turn) * markers.positions[:, :, np.abs(turn) - 1])
