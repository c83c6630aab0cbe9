"""Solutions in files: JSON, readable without this package."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from os import PathLike
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.ocp.certificate import Attempt
from geodesic_ocp.ocp.grid import Grid
from geodesic_ocp.ocp.path import Path
from geodesic_ocp.ocp.prepared import transcription_of
from geodesic_ocp.ocp.problem import Problem
from geodesic_ocp.ocp.solution import Round, Solution, Stats
from geodesic_ocp.ocp.terms import conditions
from geodesic_ocp.ocp.transcription import Units
from geodesic_ocp.ocp.violations import violations
from geodesic_ocp.records import read_record

_FORMAT, _VERSION = "geodesic_ocp solution", 1


def save_solution(file: str | PathLike[str], solution: Solution) -> FilePath:
    """Write a solution as JSON: nodes of the path [rad or m], figures of the solve, multipliers.

    The file holds the path and not the problem, of which it has the class's name.

    Returns:
        The file's path.

    Raises:
        OSError: it cannot be written.
    """
    grid, attempt = solution.path.grid, solution.attempt
    record = {
        "format": _FORMAT,
        "version": _VERSION,
        "problem": type(solution.problem).__name__,
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
            **{name: getattr(attempt, name) for name in _ARRAYS},
            "of_energy": attempt.of_energy,
        },
    }
    path = FilePath(file)
    path.write_text(json.dumps(_plain(record), indent=1, allow_nan=False), encoding="utf-8")
    return path


_ARRAYS = ("x", "lam_x", "lam_g", "held_x", "held_g")


def load_solution(file: str | PathLike[str], problem: Problem) -> Solution:
    """Read a solution that `save_solution` wrote.

    Args:
        file: the JSON file.
        problem: that was solved.

    Raises:
        RecordingError: the file is missing, is not such a file, or not of such a problem.
    """
    path = FilePath(file)
    record = read_record(path, _FORMAT, _VERSION, "a solution")
    solved = record.get("problem")
    if solved != type(problem).__name__:
        raise RecordingError(f"{path} has a solution of {solved}, not of {type(problem).__name__}")
    names = problem.metric.joint_names
    if record.get("joint_names") != (None if names is None else list(names)):
        raise RecordingError(
            f"{path}: its joints {record.get('joint_names')} are not the problem's"
        )
    try:
        return _solution(record, problem)
    except (KeyError, TypeError, ValueError) as error:
        what = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise RecordingError(f"{path}: {what}") from None


def _solution(record: dict[str, Any], problem: Problem) -> Solution:
    ends = record["grid"]["ends"]
    grid = Grid(
        record["grid"]["segments"], record["grid"]["degree"], None if ends is None else tuple(ends)
    )
    path = Path(problem.metric, grid, _array(record["nodes"]))
    figures = {field.name: _number(record["stats"][field.name]) for field in fields(Stats)}
    rounds = [
        {key: _number(value) for key, value in each.items()} for each in figures.pop("rounds")
    ]
    stats = Stats(**figures, rounds=tuple(Round(**each) for each in rounds))
    nlp, terms = record["nlp"], conditions(problem)
    attempt = Attempt(
        path,
        transcription_of(problem, grid),
        Units(_array(nlp["origin"]), float(nlp["length"]), float(nlp["scale"])),
        _array(nlp["values"]),
        x=_array(nlp["x"]),
        lam_x=_array(nlp["lam_x"]),
        lam_g=_array(nlp["lam_g"]),
        held_x=np.array(nlp["held_x"], dtype=bool),
        held_g=np.array(nlp["held_g"], dtype=bool),
        success=stats.success,
        of_energy=bool(nlp["of_energy"]),
    )
    multipliers = {name: _array(values) for name, values in record["multipliers"].items()}
    missed = violations(terms, path, problem.metric.joint_names)
    return Solution(problem, path, stats, multipliers, missed, attempt)


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


def _number(value: Any) -> Any:
    return float(value) if value in ("inf", "-inf", "nan") else value


def _array(values: Any) -> Array:
    return np.array(values, dtype=float)  # which reads "inf" and "nan", too
