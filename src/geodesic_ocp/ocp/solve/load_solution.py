"""Solutions from the files that `archive` writes."""

from __future__ import annotations

import sys
from dataclasses import fields
from os import PathLike
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.ocp.nlp.conditions import Conditions, conditions
from geodesic_ocp.ocp.nlp.structure import transcription_of
from geodesic_ocp.ocp.nlp.transcription import Units
from geodesic_ocp.ocp.nlp.violations import violations
from geodesic_ocp.ocp.problem.problem import Problem
from geodesic_ocp.ocp.solve.certificate import Attempt
from geodesic_ocp.ocp.solve.save_solution import FORMAT, VERSION, decoded
from geodesic_ocp.ocp.solve.solution import MeshIteration, Solution, Stats
from geodesic_ocp.records import read_record
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

_SAME = 1e-9  # of the energy, relative
_MISSED = 1e-8  # of conditions, which rounding may change


def load_solution(file: str | PathLike[str], problem: Problem | None = None) -> Solution:
    """Read a solution that `save_solution` wrote.

    Args:
        file: the JSON file.
        problem: that was solved. None: an instance of the class of that name, in the module that
            had it when it was saved and is imported already, with the fields in the file; fields
            that are models or metrics, which the file does not hold, must have defaults.

    Raises:
        RecordingError: the file is missing, is not such a file, or not of such a problem; or the
            path has another energy than when it was saved, as in the metric of another model.
    """
    path = FilePath(file)
    record = read_record(path, FORMAT, VERSION, "a solution")
    solved = record.get("problem")
    if problem is None:
        problem = _problem(record, path)
    if solved != type(problem).__name__:
        raise RecordingError(f"{path} has a solution of {solved}, not of {type(problem).__name__}")
    names = problem.metric.joint_names
    if record.get("joint_names") != (None if names is None else list(names)):
        raise RecordingError(
            f"{path}: its joints {record.get('joint_names')} are not the problem's"
        )
    try:
        solution = _solution(record, problem)
    except (
        ArithmeticError,
        AttributeError,
        LookupError,
        RuntimeError,
        TypeError,
        ValueError,
    ) as error:
        what = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise RecordingError(f"{path}: {what}") from None
    energy, saved = solution.path.energy_at_nodes, solution.stats.energy
    if np.isfinite(saved) and not abs(energy - saved) <= _SAME * abs(saved):
        raise RecordingError(
            f"{path}: its path has the energy {energy:.9g} in this problem's metric and was saved "
            f"with {saved:.9g}; give the problem that was solved"
        )
    missed = solution.violations[0].amount if solution.violations else 0.0
    if not abs(missed - solution.stats.max_path_violation) <= _MISSED:
        raise RecordingError(
            f"{path}: its path misses this problem's conditions by {missed:.3g} and was saved with "
            f"{solution.stats.max_path_violation:.3g}; give the problem that was solved"
        )
    return solution


def _problem(record: dict[str, Any], path: FilePath) -> Problem:
    """The problem that the record describes, of a class that is imported already."""
    name, module = str(record.get("problem")), str(record.get("module"))
    given, saved = f"load_solution({str(path)!r}, problem)", record.get("fields")
    kind = _class(module, name)
    if not (isinstance(kind, type) and issubclass(kind, Problem)) or not isinstance(saved, dict):
        raise RecordingError(
            f"{path} has a solution of {name} of the module {module}, which is not imported here; "
            f"import it, or use {given}"
        )
    if left_out := record.get("left_out"):
        raise RecordingError(f"{path} does not hold the fields {', '.join(left_out)}; use {given}")
    try:
        return kind(**{key: decoded(value) for key, value in saved.items()})
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        raise RecordingError(
            f"{path}: {name} cannot be made of the fields in the file ({error}); use {given}"
        ) from None


def _class(module: str, name: str) -> Any:
    """The class of that name in the module, or in another of that file's name."""
    last = module.rpartition(".")[2]
    near = [each for each in list(sys.modules) if each.rpartition(".")[2] == last]
    for each in (module, *near):
        kind = getattr(sys.modules.get(each), name, None)
        if isinstance(kind, type) and issubclass(kind, Problem):
            return kind
    return None


def _solution(record: dict[str, Any], problem: Problem) -> Solution:
    saved = record["grid"]
    ends = None if saved["ends"] is None else tuple(saved["ends"])
    grid = Grid(saved["segments"], saved["degree"], ends, tuple(saved.get("via_segments", ())))
    path = Path(problem.metric, grid, _array(record["nodes"]))
    figures = {field.name: _number(record["stats"][field.name]) for field in fields(Stats)}
    rounds = [
        {key: _number(value) for key, value in each.items()} for each in figures.pop("mesh_history")
    ]
    stats = Stats(**figures, mesh_history=tuple(MeshIteration(**each) for each in rounds))
    nlp, terms = record["nlp"], conditions(problem)
    if len(grid.via_segments) != len(terms.via):
        raise ValueError(f"the path has {len(grid.via_segments)} via points, not {len(terms.via)}")
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
    _check(attempt, stats, terms)
    multipliers = {name: _array(values) for name, values in record["multipliers"].items()}
    missed = violations(terms, path, problem.metric.joint_names)
    return Solution(problem, path, stats, multipliers, missed, attempt)


def _check(attempt: Attempt, stats: Stats, terms: Conditions) -> None:
    """ValueError where the arrays are not those of an NLP of these conditions on the grid."""
    n, grid = attempt.path.metric.dim, attempt.path.grid
    size_g = attempt.transcription.constraints.size1_out(0)
    sizes = {"x": n * grid.size, "lam_x": n * grid.size, "held_x": n * grid.size}
    sizes |= {"lam_g": size_g, "held_g": size_g, "values": terms.values.size}
    for name, size in sizes.items():
        if getattr(attempt, name).shape != (size,):
            raise ValueError(f"nlp.{name} must be {size} numbers")
    units = attempt.units
    if units.origin.shape != (n,) or not (units.length > 0.0 and units.scale > 0.0):
        raise ValueError(f"nlp.origin must be {n} numbers, nlp.length and nlp.scale positive")
    if not isinstance(stats.success, bool):
        raise ValueError("stats.success must be true or false")
    for name in ("energy", "max_path_violation"):
        if not isinstance(getattr(stats, name), float):
            raise ValueError(f"stats.{name} must be a number")


def _number(value: Any) -> Any:
    return float(value) if isinstance(value, str) and value in ("inf", "-inf", "nan") else value


def _array(values: Any) -> Array:
    return np.array(values, dtype=float)  # which reads "inf" and "nan", too
