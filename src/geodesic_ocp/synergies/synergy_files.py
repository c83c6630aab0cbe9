"""JSON files of synergies."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.human.stature import stature
from geodesic_ocp.model.model import Model
from geodesic_ocp.records import read_record
from geodesic_ocp.synergies.synergy import Synergy
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.time_law import TimeLaw

FORMAT, VERSION = "geodesic_ocp synergies", 1
_SAME_LENGTH = 1e-6  # quadrature of the same path in the same metric


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
    try:
        return tuple(_decode(entry, metric) for entry in record["synergies"])
    except (KeyError, TypeError, ValueError) as failure:
        reason = f"{failure} is missing" if isinstance(failure, KeyError) else str(failure)
        raise RecordingError(f"{path}: {reason}") from None


def _decode(entry: dict[str, Any], metric: Metric) -> Synergy:
    path, law = entry["path"], entry["law"]
    grid = Grid(path["segments"], path["degree"], path["ends"] and tuple(path["ends"]))
    synergy = Synergy(
        int(entry["start"]),
        int(entry["stop"]),
        float(entry["start_time"]),
        Path(metric, grid, np.array(path["nodes"])),
        TimeLaw(*(np.array(law[name], dtype=float) for name in ("knots", "positions", "speeds"))),
    )
    length = synergy.path.length
    if not np.isclose(length, synergy.length, rtol=_SAME_LENGTH, atol=_SAME_LENGTH):
        raise ValueError(
            f"the synergy of samples {synergy.start} to {synergy.stop} has the length "
            f"{length:.6g} in this metric, not {synergy.length:.6g}: it was saved in another"
        )
    return synergy
