"""Functions of two points or vectors, for many of them at once."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np

from geodesic_ocp.errors import IntegrationFailed, NotConverged

Function = TypeVar("Function", bound=Callable[..., Any])


def by_rows(function: Function) -> Function:
    """Let a function of (metric, a, b), each (n,), also take (k, n): one of them or both.

    The results are stacked along a first axis of length k. Whatever a row raises says which.
    """

    @functools.wraps(function)
    def wrapped(metric: Any, a: Any, b: Any, **options: Any) -> Any:
        try:
            many = [np.ndim(argument) == 2 for argument in (a, b)]
        except ValueError:  # rows of different lengths: the function names the argument
            many = [False, False]
        if not any(many):
            return function(metric, a, b, **options)
        counts = {len(argument) for argument, rows in zip((a, b), many, strict=True) if rows}
        if len(counts) > 1:
            raise ValueError(f"there are {len(a)} rows of the one and {len(b)} of the other")
        if 0 in counts:
            raise ValueError("there are no rows")
        results = []
        for row in range(counts.pop()):
            pair = [
                argument[row] if rows else argument
                for argument, rows in zip((a, b), many, strict=True)
            ]
            try:
                results.append(function(metric, *pair, **options))
            except NotConverged as error:
                raise NotConverged(f"row {row}: {error}", error.solution) from error
            except IntegrationFailed as error:
                raise IntegrationFailed(f"row {row}: {error}") from error
            except ValueError as error:
                raise ValueError(f"row {row}: {error}") from error
        return np.array(results)

    return cast(Function, wrapped)
