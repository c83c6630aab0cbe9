"""Problems in files of Python: found, changed by the names of their fields, solved and drawn."""

from __future__ import annotations

import ast
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, Field
from pathlib import Path
from typing import Any

from geodesic_ocp.ocp.problem.problem import Problem
from geodesic_ocp.ocp.solve.solution import Solution
from geodesic_ocp.table import Table


def problem_classes(file: str | Path) -> list[type[Problem]]:
    """The problem classes that a file of Python defines, in its order.

    Args:
        file: it is run, with its folder as one to import from.

    Raises:
        ValueError: the file is not there, cannot be run, or defines no problem.
    """
    path = Path(file)
    spec = importlib.util.spec_from_file_location(f"problems.{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise ValueError(f"{path} is not a file of Python")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
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
    classes = [
        value
        for value in vars(module).values()
        if inspect.isclass(value)
        and issubclass(value, Problem)
        and value.__module__ == module.__name__
        and not inspect.isabstract(value)
    ]
    if not classes:
        raise ValueError(f"{path} defines no problem: no class in it is made from go.Problem")
    return classes


@contextmanager
def _importing_from(folder: Path) -> Iterator[None]:
    place = str(folder.absolute())
    sys.path.insert(0, place)
    try:
        yield
    finally:
        sys.path.remove(place)


def with_fields(kind: type[Problem], settings: Mapping[str, str]) -> Problem:
    """An instance of a class with some fields set, each as Python writes its value.

    Raises:
        ValueError: there is no such field, it cannot be given as text, or a value does not fit;
            names the field.
    """
    own: Mapping[str, Field[Any]] = getattr(kind, "__dataclass_fields__", {})
    known = {name: each for name, each in own.items() if each.init}
    values: dict[str, Any] = {}
    for name, text in settings.items():
        if name not in known:
            listed = ", ".join(known) or "none"
            raise ValueError(
                f"{kind.__name__} has no field {name!r}; its fields are {listed} (--problem picks "
                "one of several classes)"
            )
        values[name] = _value(name, text)
        if known[name].default is not MISSING:
            _check_kind(f"{kind.__name__}.{name}", known[name].default, values[name])
        elif known[name].default_factory is not MISSING:
            raise ValueError(f"{kind.__name__}.{name} cannot be given as text")
    missing = [
        name
        for name, each in known.items()
        if name not in values and each.default is MISSING and each.default_factory is MISSING
    ]
    if missing:
        raise ValueError(f"{kind.__name__} has no default for {', '.join(missing)}")
    try:
        return kind(**values)
    except TypeError as error:
        raise ValueError(f"{kind.__name__} cannot be made without arguments: {error}") from error


def _value(name: str, text: str) -> Any:
    try:
        return _as_tuple(ast.literal_eval(text))
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        raise ValueError(
            f"{name}={text!r} is not a number, a text in quotes, True, False, None or a tuple of "
            "these"
        ) from None


def _as_tuple(value: Any) -> Any:
    return tuple(map(_as_tuple, value)) if isinstance(value, (list, tuple)) else value


def _check_kind(name: str, default: Any, value: Any) -> None:
    if default is None or value is None:
        return
    kinds: Any = (int, float) if isinstance(default, float) else type(default)
    if not isinstance(value, kinds) or isinstance(value, bool) != isinstance(default, bool):
        raise ValueError(f"{name} is {default!r} by default; {value!r} is of another kind")
    if isinstance(default, tuple) and len(default):
        if len(value) != len(default):
            raise ValueError(f"{name} has {len(default)} entries, got {len(value)}")
        for index, pair in enumerate(zip(default, value, strict=True)):
            _check_kind(f"{name}[{index}]", *pair)


def figures(solution: Solution) -> Table:
    """Figures of a solution, one a row."""
    stats, problem = solution.stats, solution.problem
    rows: list[tuple[str | int | float, ...]] = [
        ("variables", stats.variables),
        ("constraints", stats.constraints),
        ("grids", max(1, len(stats.mesh_history))),
        ("iterations", sum(each.iterations for each in stats.mesh_history) or stats.iterations),
        ("seconds in Ipopt", sum(each.seconds for each in stats.mesh_history) or stats.seconds),
        ("energy", f"{stats.energy:.8g}"),
        ("length", f"{solution.path.length:.8g}"),
        ("largest violation between nodes", stats.max_path_violation),
    ]
    if (exact := problem.exact_length) is not None:
        rows.append(("exact length", f"{exact:.8g}"))
    if solution.path.grid.via_segments:
        rows.append(("via points at s", ", ".join(f"{s:.4f}" for s in solution.path.grid.via_s)))
    return Table(("figure", "value"), tuple(rows))
