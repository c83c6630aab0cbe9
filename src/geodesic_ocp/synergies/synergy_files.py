"""JSON files of synergies."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.human import stature
from geodesic_ocp.model.model import Model
from geodesic_ocp.records import convert, decoding, read_record
from geodesic_ocp.synergies.synergy import Synergy
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.time_law import TimeLaw

FORMAT, VERSION = "geodesic_ocp synergies", 1
_SAME_LENGTH = 1e-6  # quadrature of the same path in the same metric


@dataclass(eq=False)
class PathRecord:
    """The path of a synergy in a file."""

    segments: int
    degree: int
    nodes: Array
    ends: tuple[float, ...] | None = None

    def path(self, metric: Metric) -> Path:
        """The path itself, whose metric the file does not contain."""
        return Path(metric, Grid(self.segments, self.degree, self.ends), self.nodes)


@dataclass(eq=False)
class SynergyRecord:
    """A synergy in a file."""

    start: int
    stop: int
    start_time: float
    path: PathRecord
    law: TimeLaw


@dataclass(eq=False)
class _SynergiesRecord:
    synergies: tuple[SynergyRecord, ...]


def save_synergies(
    file: str | FilePath,
    synergies: Sequence[Synergy],
    joint_names: Sequence[str],
    model: Model | None = None,
) -> None:
    """Write segments, paths and time laws of synergies in SI units, at full precision.

    Args:
        file: to write.
        synergies: of one motion.
        joint_names: of the coordinates.
        model: whose name, and height if it is a person's, are written, by which `geodesic-ocp show`
            knows what to draw.
    """
    record = {
        "format": FORMAT,
        "version": VERSION,
        "units": {"q": "rad or m", "time": "s", "length": "of the metric: sqrt(kg) m"},
        "joint_names": list(joint_names),
        **({} if model is None else {"model": {"name": model.name, "height": stature(model)}}),
        "segments": [[synergy.start, synergy.stop] for synergy in synergies],
        "synergies": [_encode(synergy) for synergy in synergies],
    }
    FilePath(file).write_text(json.dumps(record, indent=1), encoding="utf-8")


def _encode(synergy: Synergy) -> dict[str, Any]:
    grid, law = synergy.path.grid, synergy.law
    return {
        "start": synergy.start,
        "stop": synergy.stop,
        "start_time": synergy.start_time,
        "duration": synergy.duration,
        "length": synergy.length,
        "path": {
            "segments": grid.segments,
            "degree": grid.degree,
            "ends": grid.ends,
            "nodes": synergy.path.nodes.tolist(),
        },
        "law": {
            "knots": law.knots.tolist(),
            "positions": law.positions.tolist(),
            "speeds": law.speeds.tolist(),
        },
    }


def load_synergies(file: str | FilePath, metric: Metric) -> tuple[Synergy, ...]:
    """Read synergies that `save_synergies` wrote.

    Args:
        file: the JSON file.
        metric: of the paths, such as `Analysis.metric`; the file does not contain it.

    Raises:
        RecordingError: the file is missing, is not such a file, or does not fit the metric, in
            which its paths must have the lengths that were saved.
    """
    path = FilePath(file)
    record = read_record(path, FORMAT, VERSION, "synergies")
    names = metric.joint_names
    if names is not None and record.get("joint_names") != list(names):
        raise RecordingError(
            f"{path}: its joints {record.get('joint_names')} are not the metric's, {list(names)}"
        )
    saved = convert(record, _SynergiesRecord, path)
    with decoding(path):
        return tuple(_decoded(each, metric) for each in saved.synergies)


def _decoded(saved: SynergyRecord, metric: Metric) -> Synergy:
    path = saved.path.path(metric)
    synergy = Synergy(saved.start, saved.stop, saved.start_time, path, saved.law)
    length = synergy.path.length
    if not np.isclose(length, synergy.length, rtol=_SAME_LENGTH, atol=_SAME_LENGTH):
        raise ValueError(
            f"the synergy of samples {synergy.start} to {synergy.stop} has the length "
            f"{length:.6g} in this metric, not {synergy.length:.6g}: it was saved in another"
        )
    return synergy
