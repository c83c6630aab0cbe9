"""Functions of two points or vectors, vectorized over the rows of arrays."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar, cast

import numpy as np

from geodesic_ocp.errors import IntegrationFailed, NotConverged

Function = TypeVar("Function", bound=Callable[..., Any])


# Fewer rows than this are not worth starting threads.
_FEW = 8


def over_rows(parallel: Callable[[Any], bool]) -> Callable[[Function], Function]:
    """Let a function of (metric, a, b), each (n,), also take (k, n) for one or both of them.

    The results are stacked along a first axis of length k. An exception names the first row that
    fails.

    Args:
        parallel: whether the function spends its time in code that releases Python's lock with this
            metric, so that rows are computed by as many threads as there are processors.
    """

    def decorate(function: Function) -> Function:
        signature = inspect.signature(function)
        names = list(signature.parameters)[:3]

        @functools.wraps(function)
        def wrapped(*positional: Any, **named: Any) -> Any:
            if len(positional) > 2 and all(getattr(a, "ndim", 0) == 1 for a in positional[1:3]):
                return function(*positional, **named)  # the usual case, without detours
            arguments = signature.bind(*positional, **named).arguments
            pair = {name: arguments[name] for name in names[1:]}
            try:
                stacked = [name for name, value in pair.items() if np.ndim(value) == 2]
            except ValueError:  # ragged rows: the function itself names the argument
                stacked = []
            if not stacked:
                return function(**arguments)
            counts = [len(pair[name]) for name in stacked]
            if len(set(counts)) > 1:
                raise ValueError(f"{' and '.join(stacked)} have {counts[0]} and {counts[1]} rows")
            if counts[0] == 0:
                raise ValueError(f"{stacked[0]} has no rows")

            def of_row(row: int) -> Any:
                values = {name: pair[name][row] for name in stacked}
                return _of_row(function, arguments | values, row)

            threaded = counts[0] >= _FEW and parallel(arguments[names[0]])
            results = in_threads(of_row, counts[0]) if threaded else map(of_row, range(counts[0]))
            return np.array(list(results))

        return cast(Function, wrapped)

    return decorate


def _of_row(function: Callable[..., Any], arguments: dict[str, Any], row: int) -> Any:
    try:
        return function(**arguments)
    except NotConverged as error:
        raise NotConverged(f"row {row}: {error}", error.solution) from error
    except IntegrationFailed as error:
        raise IntegrationFailed(f"row {row}: {error}", error.time, error.state) from error
    except ValueError as error:
        raise ValueError(f"row {row}: {error}") from error


def in_threads(of_row: Callable[[int], Any], count: int) -> Iterator[Any]:
    """Results of calls with 0 to count - 1, in order; where one raises, the rest is left out."""
    with ThreadPoolExecutor(_processors()) as threads:
        futures = [threads.submit(of_row, row) for row in range(count)]
        try:
            for future in futures:
                yield future.result()
        finally:
            threads.shutdown(wait=False, cancel_futures=True)


def _processors() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
