"""The motion of saved synergies, for which neither their metric nor their model is needed."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.manifold.metrics.euclidean import Euclidean
from geodesic_ocp.records import read_record
from geodesic_ocp.synergies.synergy_files import FORMAT, VERSION
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.time_law import TimeLaw

_RATE = 100.0  # [Hz]


@dataclass(frozen=True, eq=False, repr=False)
class SavedSynergies:
    """What a file of `save_synergies` says without the metric.

    Attributes:
        motion: that the synergies predict, at 100 Hz, without velocities.
        spans: start and end of each synergy [s].
        model: name of the model; "" if the file does not say.
        height: of the person [m]; None if the file does not say.
    """

    motion: Motion
    spans: tuple[tuple[float, float], ...]
    model: str = ""
    height: float | None = None

    def __repr__(self) -> str:
        which = f" of {self.model}" if self.model else ""
        return f"SavedSynergies({len(self.spans)}{which}, {self.motion!r})"


def read_saved_synergies(file: str | PathLike[str]) -> SavedSynergies:
    """The motion that the synergies in a file predict.

    A geodesic has a constant speed in its metric, so the fraction of its length that a synergy has
    covered is the parameter of its path, and the metric is not needed. Paths of a robot under
    constraints have so nearly (to some mrad), as their grids are coarse.

    Args:
        file: that `save_synergies` wrote.

    Raises:
        RecordingError: the file is missing, or is not such a file.
    """
    record = read_record(file, FORMAT, VERSION, "synergies")
    try:
        names = tuple(str(name) for name in record["joint_names"])
        described = record.get("model") or {}
        height = described.get("height")
        laws = [_law(entry) for entry in record["synergies"]]
        starts = [float(entry["start_time"]) for entry in record["synergies"]]
        spans = tuple((t, t + law.duration) for t, law in zip(starts, laws, strict=True))
        count = max(2, 1 + round((spans[-1][1] - spans[0][0]) * _RATE))
        time = np.linspace(spans[0][0], spans[-1][1], count)
        owner = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(starts) - 1)
        q = np.empty((count, len(names)))
        for number, entry in enumerate(record["synergies"]):
            own = owner == number
            q[own] = _positions(entry["path"], laws[number], time[own] - starts[number], len(names))
        return SavedSynergies(
            Motion(time, q, names),
            spans,
            str(described.get("name") or ""),
            None if height is None else float(height),
        )
    except (AttributeError, LookupError, TypeError, ValueError) as failure:
        reason = f"{failure} is missing" if isinstance(failure, KeyError) else str(failure)
        raise RecordingError(f"{file}: {reason}") from None


def _law(entry: dict[str, Any]) -> TimeLaw:
    return TimeLaw(*(np.array(entry["law"][key]) for key in ("knots", "positions", "speeds")))


def _positions(path: dict[str, Any], law: TimeLaw, t: Array, dim: int) -> Array:
    """Configurations (k, n) on a path at times t (k,) from its start [s]."""
    grid = Grid(path["segments"], path["degree"], path["ends"] and tuple(path["ends"]))
    curve = Path(Euclidean(dim), grid, np.array(path["nodes"]))
    length = law.length
    if not length > 0.0:
        return np.tile(curve.nodes[0], (t.size, 1))
    return curve(np.clip(law(np.clip(t, 0.0, law.duration)) / length, 0.0, 1.0))
