"""Time of a logarithmic map against the number of joints."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import geodesic_ocp as go
from comparison import our_routes
from comparison.boundary_value import BoundaryValueSolver
from comparison.models import both_arms, planar_chain, random_pairs
from comparison.pinocchio_aba import ForwardDynamics

SIZES = (2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30)
FRACTION = 0.4  # of the range of +-2 rad
# A route is not tried on larger systems once its maps, or the first one, take this long [s].
TOO_LONG, FIRST_TOO_LONG = 0.5, 10.0
# The exponent is that of systems of at least this size, where it dominates.
FITTED_FROM = 6


@dataclass(frozen=True)
class Growth:
    """Median times [s] of one route against numbers of joints, and of the first map."""

    name: str
    joints: np.ndarray
    seconds: np.ndarray
    first: np.ndarray
    found: np.ndarray
    both_arms: float | None
    pairs: int

    @property
    def fitted_from(self) -> int:
        """The smallest system of the fit."""
        return FITTED_FROM if np.sum(self.joints >= FITTED_FROM) > 2 else int(self.joints.min())

    @property
    def fit(self) -> tuple[float, float]:
        """Exponent a and factor c of the fitted c n^a."""
        large = self.joints >= self.fitted_from
        slope, intercept = np.polyfit(np.log(self.joints[large]), np.log(self.seconds[large]), 1)
        return float(slope), float(np.exp(intercept))

    def record(self) -> dict[str, Any]:
        """All numbers, for JSON."""
        arrays = {
            key: getattr(self, key).tolist() for key in ("joints", "seconds", "first", "found")
        }
        exponent = {"exponent": self.fit[0], "both arms": self.both_arms, "pairs": self.pairs}
        return {"name": self.name, **arrays, **exponent}


def growth(sizes: Sequence[int], pairs: int, arms: bool) -> list[Growth]:
    """Ours with each compiler, and scipy's; `arms`: both human arms as well."""

    def scipys(model: go.Model) -> our_routes.Solver:
        return BoundaryValueSolver(ForwardDynamics(model))

    routes: dict[str, our_routes.Factory] = {
        f"go.log, {name}": partial(our_routes.log, variables=variables)
        for name, variables in our_routes.available().items()
        if name != our_routes.INTERPRETED
    }
    routes["scipy solve_bvp, Pinocchio's ABA"] = scipys
    return [_grow(name, route, sizes, pairs, arms) for name, route in routes.items()]


def _grow(
    name: str, route: our_routes.Factory, sizes: Sequence[int], pairs: int, arms: bool
) -> Growth:
    rows = []
    for joints in sizes:
        rows.append((joints, *_times(planar_chain(joints), route, pairs)))
        _, seconds, first, _ = rows[-1]
        if seconds > TOO_LONG or first > FIRST_TOO_LONG:
            break
    joints, seconds, first, found = np.array(rows, dtype=float).T
    of_arms = _times(both_arms(), route, pairs)[0] if arms else None
    return Growth(name, joints, seconds, first, found, of_arms, pairs)


def _times(model: go.Model, route: our_routes.Factory, pairs: int) -> tuple[float, float, int]:
    """Median time of a map, time of the first one, and how many are found."""
    solve, found, times = route(model), 0, []
    problems = random_pairs(model, FRACTION, pairs)
    start = time.perf_counter()
    solve(*problems[0])
    first = time.perf_counter() - start
    for problem in problems:
        start = time.process_time()
        found += solve(*problem) is not None
        times.append(time.process_time() - start)
    return float(np.median(times)), first, found
