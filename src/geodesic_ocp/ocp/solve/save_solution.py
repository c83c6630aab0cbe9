"""Solutions into files: JSON, readable without this package."""

from __future__ import annotations

import json
from dataclasses import asdict, fields, is_dataclass
from os import PathLike
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model

if TYPE_CHECKING:
    from geodesic_ocp.ocp.solve.solution import Solution

FORMAT, VERSION = "geodesic_ocp solution", 2
ARRAYS = ("x", "lam_x", "lam_g", "held_x", "held_g")


def save_solution(file: str | PathLike[str], solution: Solution) -> FilePath:
    """Write a solution as JSON: nodes of the path [rad or m], figures of the solve, multipliers.

    Of the problem the file holds the class's name, and the fields that are numbers, texts or lists
    of them.

    Returns:
        The file's path.

    Raises:
        OSError: it cannot be written.
    """
    grid, attempt = solution.path.grid, solution.attempt
    record = {
        "format": FORMAT,
        "version": VERSION,
        "problem": type(solution.problem).__name__,
        "module": type(solution.problem).__module__,
        **_fields(solution.problem),
        "joint_names": solution.path.metric.joint_names,
        "grid": asdict(grid),
        "s": grid.nodes,
        "nodes": solution.path.nodes,
        "stats": asdict(solution.stats),
        "multipliers": dict(solution.multipliers),
        "nlp": {
            "origin": attempt.units.origin,
            "length": attempt.units.length,
            "scale": attempt.units.scale,
            "values": attempt.values,
            **{name: getattr(attempt, name) for name in ARRAYS},
            "of_energy": attempt.of_energy,
        },
    }
    path = FilePath(file)
    path.write_text(json.dumps(_plain(record), indent=1, allow_nan=False), encoding="utf-8")
    return path


def _fields(problem: object) -> dict[str, Any]:
    """The fields as JSON can hold them, and the names of those that it cannot."""
    kept: dict[str, Any] = {}
    left_out = []
    for each in fields(problem) if is_dataclass(problem) else ():
        value = getattr(problem, each.name)
        try:
            kept[each.name] = _encoded(value)
        except TypeError:
            if not isinstance(value, (Model, Metric)):  # which the path's energy tells apart
                left_out.append(each.name)
    return {"fields": kept, "left_out": left_out}


def _encoded(value: Any) -> Any:
    """A value that `decoded` brings back; TypeError of what JSON cannot hold."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "biuf":
            raise TypeError
        return {"array": [_encoded(each) for each in value.ravel().tolist()], "shape": value.shape}
    if isinstance(value, (list, tuple)):
        return {type(value).__name__: [_encoded(each) for each in value]}
    if isinstance(value, float) and not np.isfinite(value):
        return {"number": str(value)}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise TypeError


def decoded(value: Any) -> Any:
    """What `_encoded` was given."""
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return np.array([decoded(each) for each in value["array"]]).reshape(value["shape"])
    if "number" in value:
        return float(value["number"])
    kind, entries = next(iter(value.items()))
    return {"tuple": tuple, "list": list}[kind](map(decoded, entries))


def _plain(value: Any) -> Any:
    """Lists and numbers of JSON; what is not finite by its name."""
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value
