"""Solutions into files: JSON, readable without this package."""

from __future__ import annotations

import json
from dataclasses import asdict, fields, is_dataclass
from os import PathLike
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from geodesic_ocp.ocp.solution import Solution

FORMAT, VERSION = "geodesic_ocp solution", 1
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
        "fields": _plain_fields(solution.problem),
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


def _plain_fields(problem: object) -> dict[str, Any]:
    """The fields that JSON can hold; models and metrics are not among them."""
    found = {}
    for each in fields(problem) if is_dataclass(problem) else ():
        value = _plain(getattr(problem, each.name))
        if _is_plain(value) and each.init:
            found[each.name] = value
    return found


def _is_plain(value: Any) -> bool:
    if isinstance(value, list):
        return all(map(_is_plain, value))
    return value is None or isinstance(value, (bool, int, float, str))


def _plain(value: Any) -> Any:
    """Lists and numbers of JSON; what is not finite by its name."""
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value
