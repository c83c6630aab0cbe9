"""geodesic-ocp solve: the problems that a Python file defines, solved and plotted."""

from __future__ import annotations

import ast
import importlib.util
import inspect
import shlex
import sys
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from cyclopts import Parameter

from geodesic_ocp.cli.terminal import check_folder, print_written
from geodesic_ocp.drawing.plot import plot
from geodesic_ocp.ocp.motion_definition import MotionDefinition
from geodesic_ocp.ocp.motion_problem import MotionPhases, MotionProblem
from geodesic_ocp.ocp.motion_solution import MotionSolution
from geodesic_ocp.ocp.problem import Problem
from geodesic_ocp.ocp.solution import Solution
from geodesic_ocp.ocp.solve import solve as solve_problem
from geodesic_ocp.tables import new_table, text

if TYPE_CHECKING:
    from pandas import DataFrame


AnyProblem: TypeAlias = Problem | MotionProblem | MotionPhases


def solve(
    file: Path,
    /,
    *,
    set_: Annotated[list[str] | None, Parameter(name="--set")] = None,
    problem: str | None = None,
    tolerance: float | None = None,
    out: Path | None = None,
) -> None:
    """Solve and plot the problems that a Python file defines.

    Args:
        file: Python file, such as problems/great_circle.py, which is run.
        set_: FIELD=VALUE with a Python literal, as in `--set radius=0.4 --set "goal=(1, 2)"`.
        problem: name of one of several classes in the file.
        tolerance: refine the grid until the conditions hold to this everywhere, and the energy to
            this, relative.
        out: folder for figures and solutions (JSON).
    """
    check_folder(out)
    classes = {each.__name__: each for each in problem_classes(file)}
    if problem is not None:
        if problem not in classes:
            raise ValueError(f"{file} has no {problem}; it has {', '.join(classes)}")
        classes = {problem: classes[problem]}
    settings = {}
    for each in set_ or ():
        name, equals, value = each.partition("=")
        if not equals:
            raise ValueError(f"--set {each}: must be FIELD=VALUE")
        settings[name.strip()] = value.strip()
    written: list[str] = []
    for name, instance in [(name, with_fields(each, settings)) for name, each in classes.items()]:
        summary = (inspect.getdoc(instance) or "").partition("\n")[0]
        found = solve_problem(instance, tolerance=tolerance)
        table = motion_table(found) if isinstance(found, MotionSolution) else solution_table(found)
        print(f"{name}: {summary}\n\n{text(table)}\n\n{found.certificate}")
        if out is None:
            continue
        out.mkdir(parents=True, exist_ok=True)
        picture = out / f"{name}.png"
        plot(found).savefig(picture, dpi=110)
        found.save(data := out / f"{name}.json")
        files = [picture, data]
        if isinstance(found, MotionSolution):
            found.to_trajectory().save(samples := out / f"{name}.csv")
            files.append(samples)
        else:
            written.append(str(data))
        print()
        print_written(files)
    if written:
        shown = f"{shlex.join(written)} --problem {shlex.quote(str(file))}"
        print(f"\nto see it in motion: geodesic-ocp show {shown}")


def motion_table(motion: MotionSolution) -> DataFrame:
    """Return what the solver found, and its effort."""
    stats = motion.stats
    worst = stats.worst_constraint
    rows = (
        ("objective", stats.objective),
        ("duration [s]", motion.duration),
        ("segments", len(motion.times) - 1),
        ("largest violation", f"{stats.max_path_violation:.1e}" + f" ({worst})" * bool(worst)),
        ("iterations", stats.total_iterations),
        ("time [s]", stats.total_seconds),
    )
    return new_table(("", stats.status), rows)


def problem_classes(file: str | Path) -> list[type[AnyProblem]]:
    """Return the problem classes that a Python file defines, in order.

    Args:
        file: it is run, and may import from its folder.

    Raises:
        ValueError: the file does not exist, cannot be run, or defines no problem.
    """
    path = Path(file)
    spec = importlib.util.spec_from_file_location(f"problems.{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise ValueError(f"{path} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look up their module
    try:
        with _importing_from(path.parent):
            spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        own = [
            each for each in traceback.extract_tb(error.__traceback__) if each.filename == str(path)
        ]
        where = f", line {own[-1].lineno}" if own else ""
        reason = f"{type(error).__name__}: {error}"
        raise ValueError(f"{path}{where} cannot be run: {reason}") from error
    derived = [
        value
        for value in vars(module).values()
        if inspect.isclass(value)
        and issubclass(value, Problem | MotionProblem | MotionPhases)
        and value.__module__ == module.__name__
        and not value.__name__.startswith("_")
    ]
    if not derived:
        raise ValueError(f"{path} defines no problem: none of its classes derives from go.Problem")
    classes = [each for each in derived if not inspect.isabstract(each)]
    if not classes:
        lacking = ", ".join(sorted(derived[0].__abstractmethods__))
        raise ValueError(f"{path} defines no problem: {derived[0].__name__} must define {lacking}")
    return classes


@contextmanager
def _importing_from(folder: Path) -> Iterator[None]:
    location = str(folder.absolute())
    sys.path.insert(0, location)
    try:
        yield
    finally:
        sys.path.remove(location)


def with_fields(problem_class: type[AnyProblem], settings: Mapping[str, str]) -> AnyProblem:
    """Return an instance of a class with some fields set to Python literals.

    Raises:
        ValueError: there is no such field, a value is not a literal, or the problem does not accept
            it.
    """
    name = problem_class.__name__
    known = [k for k, f in getattr(problem_class, "__dataclass_fields__", {}).items() if f.init]
    for key in settings:
        if key not in known:
            raise ValueError(
                f"{name} has no field {key!r}; its fields are {', '.join(known) or 'none'} "
                "(--problem selects one of several classes)"
            )
    values = {key: _literal(key, text) for key, text in settings.items()}
    given = ", ".join(f"{key}={text}" for key, text in settings.items())
    try:
        problem = problem_class(**values)
        if settings:
            _parsed(problem)  # a value of the wrong type may surface only here
    except (TypeError, AttributeError, IndexError) as error:
        raise ValueError(f"{name}({given}) is not a valid problem: {error}") from error
    return problem


def _parsed(problem: AnyProblem) -> object:
    return problem.definition() if isinstance(problem, Problem) else MotionDefinition.of(problem)


def _literal(key: str, text: str) -> Any:
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        raise ValueError(
            f"{key}={text!r} is not a Python literal: a number, a quoted string, True, False, "
            "None, or a tuple of these"
        ) from None


def solution_table(solution: Solution) -> DataFrame:
    """Return statistics of a solution, one per row."""
    stats = solution.stats
    problem = solution.problem
    rows: list[tuple[str | int | float, ...]] = [
        ("variables", stats.variables),
        ("constraints", stats.constraints),
        ("grids", max(1, len(stats.mesh_history))),
        ("iterations", stats.total_iterations),
        ("seconds in Ipopt", stats.total_seconds),
        ("energy", f"{stats.energy:.8g}"),
        ("length", f"{solution.path.length:.8g}"),
        ("largest violation between nodes", stats.max_path_violation),
    ]
    if (exact := problem.exact_length) is not None:
        rows.append(("exact length", f"{exact:.8g}"))
    if solution.path.grid.via_segments:
        rows.append(("via points at s", ", ".join(f"{s:.4f}" for s in solution.path.grid.via_s)))
    return new_table(("quantity", "value"), rows)
