"""Solutions from the files that `Solution.save` and `MotionSolution.save` write."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path as FilePath
from typing import Any, TypeAlias, overload

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.ocp.motion_definition import MotionDefinition, Piece
from geodesic_ocp.ocp.motion_problem import MotionPhases, MotionProblem
from geodesic_ocp.ocp.motion_solution import MotionNumbers, MotionSolution
from geodesic_ocp.ocp.problem import Problem
from geodesic_ocp.ocp.solution import (
    FORMAT,
    VERSION,
    Attempt,
    Solution,
    SolutionNumbers,
    Stats,
    decoded,
    described_model,
    restored,
)
from geodesic_ocp.ocp.transcription import Units
from geodesic_ocp.records import SENSELESS, convert, decoding, read_record
from geodesic_ocp.trajectory.grid import Grid

AnyProblem: TypeAlias = Problem | MotionProblem | MotionPhases
_SAME_ENERGY = 1e-9  # relative
_SAME_VIOLATION = 1e-8  # rounding may change it


@dataclass(eq=False)
class _IterateRecord:
    origin: Array
    length: float
    scale: float
    x: Array
    lam_x: Array
    lam_g: Array
    conditions: dict[str, list[bool]]  # those in q along the path, with their cells of s


@dataclass(eq=False)
class _SolutionRecord:
    grid: Grid
    nodes: Array
    stats: Stats
    nlp: _IterateRecord
    size: float  # of the problem, and scales of the rows of its conditions
    scales: dict[str, Array]
    models: dict[str, dict[str, Any]] = field(default_factory=dict)


@dataclass(eq=False)
class _MotionRecord:
    pieces: tuple[Piece, ...]
    stats: Stats
    numbers: MotionNumbers
    attempts: tuple[Attempt, ...] = ()
    models: dict[str, dict[str, Any]] = field(default_factory=dict)


@dataclass
class _ClassRecord:
    problem: str
    module: str
    fields: dict[str, Any]
    left_out: tuple[str, ...] = ()


@overload
def load_solution(
    file: str | PathLike[str], problem: MotionProblem | MotionPhases
) -> MotionSolution: ...
@overload
def load_solution(file: str | PathLike[str], problem: Problem | None = None) -> Solution: ...
def load_solution(
    file: str | PathLike[str], problem: AnyProblem | None = None
) -> Solution | MotionSolution:
    """Read a solution of a path or of a motion that its `save` wrote.

    >>> import tempfile
    >>> from pathlib import Path
    >>> import geodesic_ocp as go
    >>> problem = go.PointToPoint(go.Euclidean(2), [0.0, 0.0], [3.0, 4.0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = go.solve(problem).save(Path(folder) / "solution.json")
    ...     round(go.ocp.load_solution(file, problem).path.length, 6)
    5.0

    Args:
        file: the JSON file.
        problem: the problem that was solved. None: an instance of the class of that name with the
            fields in the file. The class must be imported already; fields that are models or
            metrics, which the file does not hold, take their defaults.

    Raises:
        RecordingError: the file is missing or malformed; it holds a solution of another problem;
            or the path has another energy or violates other conditions than when it was saved, as
            with another model.
    """
    path = FilePath(file)
    record = read_record(path, FORMAT, VERSION, "a solution")
    saved = record.get("problem")
    if problem is None:
        problem = _saved_problem(record, path)
    if saved != type(problem).__qualname__:
        raise RecordingError(
            f"{path} has a solution of {saved}, not of {type(problem).__qualname__}"
        )
    names = problem.metric.joint_names
    if record.get("joint_names") != (None if names is None else list(names)):
        raise RecordingError(
            f"{path}: its joints {record.get('joint_names')} are not the problem's"
        )
    if not isinstance(problem, Problem):
        motion_record = convert(record, _MotionRecord, path)
        with decoding(path):
            _check_models(motion_record.models, problem, path)
            motion = _decoded_motion(motion_record, problem)
        _check_energy(motion.energy, motion.stats.energy, path)
        return motion
    decoded_record = convert(record, _SolutionRecord, path)
    with decoding(path):
        _check_models(decoded_record.models, problem, path)
        solution = _decoded_solution(decoded_record, problem)
    _check_same_problem(solution, path)
    return solution


def _saved_problem(record: dict[str, Any], path: FilePath) -> AnyProblem:
    """Return an instance of the recorded class, which must be imported already, with the saved
    fields.
    """
    saved = convert(record, _ClassRecord, path)
    name = saved.problem
    given = f"load_solution({str(path)!r}, problem)"
    found = _imported_class(saved.module, name)
    if found is None:
        raise RecordingError(
            f"{path} has a solution of {name} of the module {saved.module}, which is not imported; "
            f"import it, or use {given}"
        )
    if "__dataclass_fields__" not in vars(found):
        raise RecordingError(f"{path} does not hold the fields of {name}; use {given}")
    if saved.left_out:
        missing = ", ".join(saved.left_out)
        raise RecordingError(f"{path} does not hold the fields {missing}; use {given}")
    try:
        return found(**{key: decoded(value) for key, value in saved.fields.items()})
    except (ValueError, *SENSELESS) as error:
        raise RecordingError(
            f"{path}: {name} cannot be created from the fields in the file ({error}); use {given}"
        ) from None


def _imported_class(module: str, name: str) -> type[AnyProblem] | None:
    """Return the imported problem class of that name: of that module, or of a file of that name.

    A file is `around_disc` or `problems.around_disc`, depending on how it was run.
    """
    own = getattr(sys.modules.get(module), name, None)
    bases = (Problem, MotionProblem, MotionPhases)
    if isinstance(own, type) and issubclass(own, bases):
        return own
    file = module.rpartition(".")[2]
    for each in (each for base in bases for each in _subclasses(base)):
        if each.__qualname__ == name and each.__module__.rpartition(".")[2] == file:
            return each
    return None


def _subclasses(base: Any) -> Iterator[type[AnyProblem]]:
    for each in base.__subclasses__():
        yield each
        yield from _subclasses(each)


def _check_models(models: dict[str, dict[str, Any]], problem: AnyProblem, path: FilePath) -> None:
    """Raise RecordingError if a model of the problem is not the one that was saved."""
    for name, saved in models.items():
        here = described_model(getattr(problem, name))
        for key, value in here.items():
            if saved.get(key) != value:
                raise RecordingError(
                    f"{path}: {key} of the problem's {name} {here['name']!r} is not that of the "
                    "model with which it was saved; use load_solution(file, problem)"
                )


def _check_same_problem(solution: Solution, path: FilePath) -> None:
    """Raise RecordingError if energy or violations are not those that were saved."""
    _check_energy(solution.path.discrete_energy, solution.stats.energy, path)
    largest = solution.violations[0].relative if solution.violations else 0.0
    saved = solution.stats.max_path_violation
    if not (
        abs(largest - saved) <= _SAME_VIOLATION * max(1.0, abs(saved))
        or (saved == np.inf and not np.isfinite(largest))
    ):
        raise RecordingError(
            f"{path}: its path violates this problem's conditions by {largest:.3g} and was saved "
            f"with {saved:.3g}; pass the problem that was solved"
        )


def _check_energy(energy: float, saved: float, path: FilePath) -> None:
    if np.isfinite(saved) and not abs(energy - saved) <= _SAME_ENERGY * abs(saved):
        raise RecordingError(
            f"{path}: its path has the energy {energy:.9g} in this problem's metric and was saved "
            f"with {saved:.9g}; pass the problem that was solved"
        )


def _decoded_motion(record: _MotionRecord, problem: MotionProblem | MotionPhases) -> MotionSolution:
    definition = MotionDefinition.of(problem)
    n = definition.phases[0].metric.dim
    if len(record.pieces) != len(definition.phases):
        raise ValueError(f"pieces must be {len(definition.phases)}, one for each phase")
    bubbles = record.numbers.degree - 3
    for number, piece in enumerate(record.pieces):
        count = len(piece.fractions)
        shapes = piece.knots.shape, piece.coefficients.shape
        if shapes != ((count, 2 * n), (count - 1, bubbles, n)):
            raise ValueError(f"pieces[{number}]: knots and coefficients do not match")
    missing = {each.name for each in definition.conditions} ^ set(record.numbers.scales)
    if missing:
        raise ValueError(f"numbers.scales must be of the problem's conditions, not {missing}")
    found = MotionSolution(
        problem, record.pieces, record.stats, record.numbers, attempts=record.attempts
    )
    if record.numbers.lam_g.size != found.nlp.program.size_g:
        raise ValueError(f"numbers.lam_g must be {found.nlp.program.size_g} numbers")
    return found


def _decoded_solution(record: _SolutionRecord, problem: Problem) -> Solution:
    saved = record.nlp
    n = problem.metric.dim
    if saved.origin.shape != (n,) or not (saved.length > 0.0 and saved.scale > 0.0):
        raise ValueError(f"nlp.origin must be {n} numbers, nlp.length and nlp.scale positive")
    numbers = SolutionNumbers(
        grid=record.grid,
        nodes=record.nodes,
        stats=record.stats,
        size=record.size,
        scales=record.scales,
        kept={name: np.array(cells, bool) for name, cells in saved.conditions.items()},
        units=Units(saved.origin, saved.length, saved.scale),
        x=saved.x,
        lam_bounds=saved.lam_x,
        lam_g=saved.lam_g,
    )
    return restored(problem, numbers)
