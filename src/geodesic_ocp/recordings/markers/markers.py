"""Positions of markers on a person over time, their axes and their unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, as_choice, settle
from geodesic_ocp.trajectory.files.text_lines import LENGTHS
from geodesic_ocp.trajectory.gaps import gap_samples
from geodesic_ocp.trajectory.motion import Subject, check_increasing


@dataclass(frozen=True, eq=False, repr=False)
class Markers:
    """Positions of markers, or of the joints of a person, over time.

    Attributes:
        time: increasing times (k,) [s] of at least two samples.
        names: names of the m markers.
        positions: (k, m, 3) [m]; NaN where a marker is missing.
        subject: the recorded person.

    Raises:
        ValueError: shapes that do not match, names that occur twice, infinite positions, positions
            of which only some coordinates are known, or time that does not increase.
    """

    time: Array
    names: tuple[str, ...]
    positions: Array
    subject: Subject = field(default_factory=Subject)

    def __post_init__(self) -> None:
        time = np.array(self.time, dtype=float)
        positions = np.array(self.positions, dtype=float)
        names = tuple(self.names)
        if time.ndim != 1 or positions.shape != (time.size, len(names), 3):
            raise ValueError(
                f"positions must be (k, {len(names)}, 3) for {len(names)} names and time (k,), got "
                f"shapes {positions.shape} and {time.shape}"
            )
        if time.size < 2 or not np.all(np.isfinite(time)):
            raise ValueError("time must be two or more finite numbers that increase")
        check_increasing(time)
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"names of markers must differ, got {', '.join(twice)} twice")
        missing = np.isnan(positions)
        bad = np.argwhere(
            np.isinf(positions).any(axis=2) | (missing.any(axis=2) & ~missing.all(axis=2))
        )
        if len(bad):
            row, column = bad[0]
            raise ValueError(
                f"marker {names[column]} is at {positions[row, column]} at sample {row}: it "
                "must be finite, or missing (NaN) in all coordinates"
            )
        time.flags.writeable = positions.flags.writeable = False
        for name, value in (("time", time), ("names", names), ("positions", positions)):
            settle(self, **{name: value})

    def __len__(self) -> int:
        return int(self.time.size)

    def __repr__(self) -> str:
        missing = float(np.mean(np.isnan(self.positions[:, :, 0]))) if self.names else 0.0
        return (
            f"Markers({len(self)} samples of {len(self.names)} markers, {missing:.1%} missing, "
            f"{self.time[-1] - self.time[0]:.3g} s)"
        )


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
    """Return an axis by its name; ValueError if it is none."""
    axis: Axis = as_choice("up", up, get_args(Axis))
    return axis


def with_z_up(markers: Markers, up: Axis) -> Markers:
    """Return the markers in a space that is turned so that its axis `up`, such as "y", becomes z.

    Raises:
        ValueError: `up` is not an axis.
    """
    turn = np.array(_TURNS[as_axis(up)])
    return replace(markers, positions=np.sign(turn) * markers.positions[:, :, np.abs(turn) - 1])


def evenly(count: int, most: int) -> NDArray[np.int64]:
    """Return indices of up to so many of `count` rows, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, most).round().astype(np.int64))


def without_gap_numbers(markers: Markers) -> tuple[Markers, str]:
    """Return the markers with NaN where numbers stand for a gap, and what was found, or "".

    Nothing is said of positions that are far away in any unit, as those that systems write for
    markers which they do not see, such as -3.7e28.
    """
    positions = np.array(markers.positions)
    with np.errstate(over="ignore"):
        sizes = np.abs(positions).max(axis=2, initial=0.0)
        # Even if the numbers were in the smallest unit of length that a file may have.
        positions[sizes > _FARTHEST / min(LENGTHS.values())] = np.nan
        gaps = gap_samples(positions, _FARTHEST)
    positions[gaps] = np.nan
    told = [
        f"{markers.names[k]} in {int(gaps[:, k].sum())} samples from "
        f"{markers.time[int(np.argmax(gaps[:, k]))]:.3f} s on"
        for k in np.flatnonzero(gaps.any(axis=0)).tolist()
    ]
    return replace(markers, positions=positions), ", ".join(told)


# Markers of people in one room are not farther apart, nor farther from its origin; those of the
# smallest movements that are recorded, of one hand, are farther apart [m].
_WIDEST = 10.0
_FARTHEST = 100.0
_NARROWEST = 0.05
_ASKED = ": are the numbers {} or cm? A file must state their unit, Markers must be in m"
IN_MM = _ASKED.format("mm")
IN_M = _ASKED.format("m")


def check_plausible_size(markers: Markers) -> None:
    """Check markers for another unit of length than m.

    The size is that of the markers of a sample, the median over the samples in which two or more
    are seen; a few markers that are far away do not count.

    Raises:
        ValueError: they are more than 10 m or, if three or more, less than 5 cm apart, or most are
            more than 100 m from the origin; asks for the unit.
    """
    positions = markers.positions
    seen = ~np.isnan(positions[:, :, 0])
    if not seen.any():
        return
    away = float(np.median(np.abs(positions[seen]).max(axis=1)))
    if away > _FARTHEST:
        raise ValueError(f"half of the markers are over {away:.4g} m from the origin{IN_MM}")
    rows = positions[seen.sum(axis=1) > 1]
    if not len(rows):
        return
    with np.errstate(over="ignore"):  # damaged files have numbers of any size
        middle = np.nanmedian(rows, axis=1, keepdims=True)
        # Half of the markers are within this size.
        around = np.nanmedian(np.linalg.norm(rows - middle, axis=2), axis=1)
        size = 2.0 * float(np.median(around))
        widest = float(np.max(np.nanmax(rows, axis=1) - np.nanmin(rows, axis=1)))
    if size > _WIDEST:
        raise ValueError(f"the markers of a sample are {size:.4g} m apart{IN_MM}")
    if len(markers.names) >= 3 and widest < _NARROWEST:
        raise ValueError(f"all markers of a sample are within {widest:.3g} m{IN_M}")


def frozen_samples(observed: Array, carriers: Sequence[int], outlier: float) -> NDArray[np.bool_]:
    """Return in which samples markers (k, m) repeat a position although what carries them moves.

    Some programs fill a gap with the last position. Positions of a body at rest repeat, too, but
    then the distances from its other markers do not change by as much as makes a marker an outlier.
    If a segment other than the root has no other marker, the nearest one stands for them.

    Args:
        observed: positions (k, m, 3) [m], NaN where missing.
        carriers: numbers of the joints that carry the markers (m,); those of the root are not
            positive.
        outlier: distance at which a marker keeps a quarter of its weight [m].
    """
    joints = np.maximum(carriers, 0)
    frozen = np.zeros(observed.shape[:2], dtype=bool)
    repeats = np.all(np.diff(observed, axis=0) == 0.0, axis=2)
    for marker, joint in enumerate(joints):
        edges = np.flatnonzero(np.diff(np.pad(repeats[:, marker].astype(int), 1)))
        for first, last in edges.reshape(-1, 2):
            span = observed[first : last + 1]
            away = np.linalg.norm(span - span[:, marker, None], axis=2)
            seen = ~np.isnan(away).any(axis=0)
            seen[marker] = False
            mates = seen & (joints == joint)
            if joint > 0 and seen.any() and not mates.any():
                mates[np.argmin(np.where(seen, away[0], np.inf))] = True
            changes = np.ptp(away[:, mates], axis=0)
            if changes.size and changes.min() > outlier:
                frozen[first : last + 1, marker] = True
    return frozen
