"""Functions of two points or vectors, for many of them at once."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np

from geodesic_ocp.errors import IntegrationFailed, NotConverged

Function = TypeVar("Function", bound=Callable[..., Any])


def over_rows(function: Function) -> Function:
    """Let a function of (metric, a, b), each (n,), also take (k, n): one of them or both.

    The results are stacked along a first axis of length k. Whatever a row raises says which.
    """
    signature = inspect.signature(function)
    names = list(signature.parameters)[1:3]

    @functools.wraps(function)
    def wrapped(*positional: Any, **named: Any) -> Any:
        arguments = signature.bind(*positional, **named).arguments
        pair = {name: arguments[name] for name in names}
        try:
            many = [name for name in names if np.ndim(pair[name]) == 2]
        except ValueError:  # rows of different lengths: the function names the argument
            many = []
        if not many:
            return function(**arguments)
        counts = [len(pair[name]) for name in many]
        if len(set(counts)) > 1:
            raise ValueError(f"{' and '.join(many)} have {counts[0]} and {counts[1]} rows")
        if counts[0] == 0:
            raise ValueError(f"{many[0]} has no rows")
        results = []
        for row in range(counts[0]):
            of_row = {name: pair[name][row] for name in many}
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
