"""Functions of two points or vectors, vectorised over the rows of arrays."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np

from geodesic_ocp.errors import IntegrationFailed, NotConverged

Function = TypeVar("Function", bound=Callable[..., Any])


def over_rows(function: Function) -> Function:
    """Let a function of (metric, a, b), each (n,), also take (k, n) for one or both of them.

    The results are stacked along a first axis of length k. An exception names the row.
    """
    signature = inspect.signature(function)
    names = list(signature.parameters)[1:3]

    @functools.wraps(function)
    def wrapped(*positional: Any, **named: Any) -> Any:
        arguments = signature.bind(*positional, **named).arguments
        pair = {name: arguments[name] for name in names}
        try:
            stacked = [name for name in names if np.ndim(pair[name]) == 2]
        except ValueError:  # ragged rows: the function itself names the argument
            stacked = []
        if not stacked:
            return function(**arguments)
        counts = [len(pair[name]) for name in stacked]
        if len(set(counts)) > 1:
            raise ValueError(f"{' and '.join(stacked)} have {counts[0]} and {counts[1]} rows")
        if counts[0] == 0:
            raise ValueError(f"{stacked[0]} has no rows")
        results = []
        for row in range(counts[0]):
            of_row = {name: pair[name][row] for name in stacked}
            try:
                results.append(function(**(arguments | of_row)))
            except NotConverged as error:
                raise NotConverged(f"row {row}: {error}", error.solution) from error
            except IntegrationFailed as error:
                raise IntegrationFailed(f"row {row}: {error}", error.time, error.state) from error
            except ValueError as error:
                raise ValueError(f"row {row}: {error}") from error
        return np.array(results)

    return cast(Function, wrapped)
