"""Times and errors of one route on many problems, and their statistics.

Routes that use one thread are timed by the processor time of this process, which on an idle machine
is the time that passes, and hardly changes on a busy one.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

# A logarithmic map counts as found if its geodesic ends this close to its goal [rad or m]; loose,
# so that solvers of low accuracy count as well: their errors stand beside their times.
FOUND = 1e-2


@dataclass(frozen=True)
class Measurement:
    """One row of the table.

    Attributes:
        name: of the route.
        values: of every run: computing times [s], or memory [MB].
        errors: of every run, NaN where nothing was found; None if the route has no error.
        error: what the errors are.
        unit: "s" or "MB".
        note: how it was measured.
    """

    name: str
    values: np.ndarray
    errors: np.ndarray | None = None
    error: str = ""
    unit: str = "s"
    note: str = ""
    baseline: Measurement | None = field(default=None, repr=False)

    @property
    def solved(self) -> np.ndarray:
        """Whether each run succeeded."""
        if self.errors is None:
            return np.ones(self.values.size, dtype=bool)
        return np.isfinite(self.errors)

    @property
    def ratio(self) -> float:
        """How many times as long as the baseline: medians over what both solved; NaN without."""
        if self.baseline is None:
            return np.nan
        count = min(self.values.size, self.baseline.values.size)
        both = self.solved[:count] & self.baseline.solved[:count]
        if not both.any():
            return np.nan
        medians = [np.median(each.values[:count][both]) for each in (self, self.baseline)]
        return float(medians[0] / medians[1])

    def record(self) -> dict[str, Any]:
        """All numbers, for JSON."""
        errors = None if self.errors is None else [float(each) for each in self.errors]
        return {
            "name": self.name,
            "unit": self.unit,
            "values": [float(value) for value in self.values],
            "errors": errors,
            "error": self.error,
            "ratio": self.ratio,
            "note": self.note,
        }


@dataclass
class Route:
    """A function to be timed on many problems, and how wrong its results are."""

    name: str
    solve: Callable[..., Any]
    error: Callable[..., float]
    note: str = ""
    limit: int | None = None  # of problems
    times: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)

    def run(self, *problem: Any) -> None:
        """Time one problem; a result of None is a failure."""
        start = time.process_time()
        result = self.solve(*problem)
        self.times.append(time.process_time() - start)
        self.errors.append(np.nan if result is None else self.error(result, *problem))


def compare(
    routes: Sequence[Route], problems: Sequence[Any], error: str, accuracy: float = FOUND
) -> list[Measurement]:
    """Time all routes on the same problems, in alternation; the first is the baseline.

    Every route solves the first problem once before, which builds its functions.
    """
    for route in routes:
        route.solve(*problems[0])
    for index, problem in enumerate(problems):
        for route in routes:
            if route.limit is None or index < route.limit:
                route.run(*problem)
    results: list[Measurement] = []
    for route in routes:
        errors = np.array(route.errors)
        errors[~(errors <= accuracy)] = np.nan
        baseline = results[0] if results else None
        result = Measurement(
            route.name, np.array(route.times), errors, error, note=route.note, baseline=baseline
        )
        results.append(result)
    return results


def repeat(
    function: Callable[[], Any], count: int, clock: Callable[[], float] = time.process_time
) -> np.ndarray:
    """Times of several calls [s], after one that is not counted."""
    function()
    times = []
    for _ in range(count):
        start = clock()
        function()
        times.append(clock() - start)
    return np.array(times)
