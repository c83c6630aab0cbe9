"""Markers: positions of markers on a person over time."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.trajectory.motion import Subject


@dataclass(frozen=True, eq=False, repr=False)
class Markers:
    """Positions of markers, or of the joints of a person, over time.

    Attributes:
        time: increasing times (k,) [s] of at least two samples.
        names: of the m markers.
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
        time, positions = np.array(self.time, dtype=float), np.array(self.positions, dtype=float)
        names = tuple(self.names)
        if time.ndim != 1 or positions.shape != (time.size, len(names), 3):
            raise ValueError(
                f"positions must be (k, {len(names)}, 3) for {len(names)} names and time (k,), got "
                f"shapes {positions.shape} and {time.shape}"
            )
        if time.size < 2 or not np.all(np.isfinite(time)) or np.any(np.diff(time) <= 0.0):
            raise ValueError("time must be two or more finite numbers that increase")
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
        for array in (time, positions):
            array.flags.writeable = False
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "positions", positions)

    def __len__(self) -> int:
        return int(self.time.size)

    def __repr__(self) -> str:
        missing = float(np.mean(np.isnan(self.positions[:, :, 0]))) if self.names else 0.0
        return (
            f"Markers({len(self)} samples of {len(self.names)} markers, {missing:.1%} missing, "
            f"{self.time[-1] - self.time[0]:.3g} s)"
        )
