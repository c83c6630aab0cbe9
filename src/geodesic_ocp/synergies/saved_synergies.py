"""The motion of saved synergies, for which neither their metric nor their model is needed."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metrics import Euclidean
from geodesic_ocp.records import convert, decoding, read_record
from geodesic_ocp.synergies.synergy_files import FORMAT, VERSION, SynergyRecord
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.time_law import TimeLaw

_RATE = 100.0  # [Hz]
_LONGEST = 86400.0  # [s], of a motion; a damaged file may ask for any amount of memory


@dataclass
class _ModelRecord:
    name: str = ""
    height: float | None = None


@dataclass(eq=False)
class _SavedRecord:
    joint_names: tuple[str, ...]
    synergies: tuple[SynergyRecord, ...]
    model: _ModelRecord | None = None


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
    record = convert(read_record(file, FORMAT, VERSION, "synergies"), _SavedRecord, file)
    with decoding(file):
        return _saved(record)


def _saved(record: _SavedRecord) -> SavedSynergies:
    names, synergies, model = record.joint_names, record.synergies, record.model or _ModelRecord()
    if not synergies:
        raise ValueError("synergies must not be empty")
    starts = [each.start_time for each in synergies]
    spans = tuple((each.start_time, each.start_time + each.law.duration) for each in synergies)
    duration = spans[-1][1] - spans[0][0]
    if not (np.all(np.diff(starts) >= 0.0) and 0.0 < duration <= _LONGEST):
        raise ValueError("synergies: each start_time must follow the one before, within a day")
    time = np.linspace(spans[0][0], spans[-1][1], max(2, 1 + round(duration * _RATE)))
    owner = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(starts) - 1)
    q = np.empty((len(time), len(names)))
    for number, each in enumerate(synergies):
        own = owner == number
        path = each.path.path(Euclidean(len(names)))
        q[own] = _positions(path, each.law, time[own] - starts[number])
    return SavedSynergies(Motion(time, q, names), spans, model.name, model.height)


def _positions(path: Path, law: TimeLaw, t: Array) -> Array:
    """Configurations (k, n) on a path at times t (k,) from its start [s]."""
    length = law.length
    if not length > 0.0:
        return np.tile(path.nodes[0], (t.size, 1))
    return path(np.clip(law(np.clip(t, 0.0, law.duration)) / length, 0.0, 1.0))
