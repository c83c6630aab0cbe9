"""Newton's method for a geodesic between two configurations, in levels of refinement.

The NLP of `PointToPoint` without Ipopt: positions at Gauss-Lobatto nodes, the energy by a finer
Gauss quadrature. Coarse grids cost little and lead to the neighbourhood of a minimum, the finer
ones to a path whose initial velocity, from the momentum at its fixed first node, v0 = -G(q0)^-1
dE/dq0 (the discrete Legendre transform of Marsden and West, Acta Numerica 2001), ends near the
goal; a few integrations correct it, with the derivative dv0/dq1 from the Hessian. The compiled core
does all of it in one call; without a compiler, Ipopt finds geodesics (`by_ipopt`).
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import IntegrationFailed, NotConverged
from geodesic_ocp.logarithm.by_ipopt import check_straight_line, find_by_ipopt, likely_cause
from geodesic_ocp.logarithm.correction import (
    ROUNDING,
    STEP,
    TOLERANCE,
    ConnectingGeodesic,
    find_by_shooting,
    wanted_error,
)
from geodesic_ocp.manifold.exp import sample_geodesic
from geodesic_ocp.manifold.kernels import Level, Tolerances
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

# Relative decrease of the energy by a Newton step at which a coarse level, a fine level is left.
_COARSE, _FINE = 1e-2, 1e-10
_COARSE_STEPS, _FINE_STEPS = 8, 40


@dataclass(frozen=True, eq=False)
class Levels:
    """Grids of increasing size; on those from index `first` on, solutions are corrected."""

    grids: tuple[Grid, ...]
    first: int

    @property
    def largest(self) -> int:
        """Largest number of nodes."""
        return max(grid.size for grid in self.grids)

    def decrease(self, level: int) -> float:
        """Relative decrease of the energy by a Newton step at which the level is left."""
        return _COARSE if level < self.first else _FINE

    def max_steps(self, level: int) -> int:
        """Largest number of Newton steps on the level."""
        return _COARSE_STEPS if level < self.first else _FINE_STEPS

    @cached_property
    def refinements(self) -> tuple[Array, ...]:
        """Interpolation from each level to the next, (nodes of the next, nodes)."""
        return tuple(_refine(*each) for each in pairwise(self.grids))

    @cached_property
    def _arrays(self) -> list[dict[str, Array]]:
        refinements = (np.zeros((0, 0)), *self.refinements)
        return [_tables(*each) for each in zip(self.grids, refinements, strict=True)]

    @cached_property
    def structures(self) -> ctypes.Array[Level]:
        """The tables as the compiled core takes them."""
        result = (Level * len(self.grids))()
        for number, (level, grid) in enumerate(zip(result, self.grids, strict=True)):
            level.segments, level.degree = grid.segments, grid.degree
            level.points = grid.quadrature.weights.shape[1]
            for name, table in self._arrays[number].items():
                setattr(level, name, table.ctypes.data)
            level.decrease, level.max_steps = self.decrease(number), self.max_steps(number)
        return result


def _refine(before: Grid, grid: Grid) -> Array:
    return before.interpolate(before.in_segments(np.eye(before.size)), grid.nodes)


def _tables(grid: Grid, refine: Array) -> dict[str, Array]:
    quadrature = grid.quadrature
    tables = {
        "weights": quadrature.weights[0],
        "values": quadrature.values,
        "slopes": quadrature.slopes[0],
        "products": _products_of_pairs(grid).transpose(0, 2, 1),
        "refine": refine,
    }
    return {name: np.ascontiguousarray(table) for name, table in tables.items()}


def _pairs_of_nodes(grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """The pairs a <= b of nodes of one segment, b first from the smallest."""
    pairs = [(a, b) for b in range(grid.degree + 1) for a in range(b + 1)]
    first, second = np.array(pairs).T
    return first, second


def _products_of_pairs(grid: Grid) -> Array:
    """W B_a B_b, w B_a D_b, w D_a B_b, w D_a D_b at the points of a segment, (4, points, pairs)."""
    quadrature = grid.quadrature
    weights, values, slopes = quadrature.weights[0], quadrature.values, quadrature.slopes[0]
    a, b = _pairs_of_nodes(grid)
    factors = ((values, values), (values, slopes), (slopes, values), (slopes, slopes))
    products = [weights[:, None] * one[:, a] * other[:, b] for one, other in factors]
    return np.array(products)


@lru_cache(maxsize=8)
def levels_of(grids: Sequence[tuple[int, int]], first: int) -> Levels:
    """Levels of grids given by (segments, degree)."""
    return Levels(tuple(Grid(*each) for each in grids), first)


_LEVELS = levels_of(((1, 5), (1, 10), (1, 18), (1, 28), (2, 20), (4, 20)), 2)
# Where these fail, other coarse grids often lead to another minimum, and so does continuation.
_OTHER_LEVELS = (
    levels_of(((1, 6), (1, 12), (1, 20), (1, 30), (2, 20), (4, 20)), 2),
    levels_of(((1, 8), (1, 16), (1, 24), (2, 20), (4, 20), (8, 20)), 2),
)
_CONTINUED = levels_of(((1, 12), (1, 20), (1, 30), (2, 20), (4, 20), (8, 20)), 1)
# On the geodesic of a relaxed metric; sharp turns need fine grids.
_RELAXED = levels_of(((2, 20), (4, 20), (8, 20), (16, 20)), 0)
# Multiples of the diagonal of G(q0) that are added to G, from large to small.
_ADDED = (10.0, 3.0, 1.0, 0.3, 0.1, 0.03, 0.01, 0.003, 0.001)
# Paths through random points: number, and offset from the straight line relative to its length.
_WAYPOINTS, _OFFSET = 4, (0.2, 1.0)
_STATUS = {
    11: "the energy has no minimum nearby, or Newton's method needs more steps",
    12: "the Hessian of the energy is not finite",
    13: "no step decreases the energy",
    14: "the metric is not finite along the path",
    20: "its integration fails",
    21: "integrated forward, it does not end at the goal",
    22: ROUNDING,
}


class Attempt(NamedTuple):
    """Result of one pass through the levels: a velocity, or None and why; the last path."""

    velocity: Array | None
    grid: Grid
    nodes: Array
    reason: str


def find_by_newton(
    metric: Metric, q0: Array, q1: Array, guess: Path | None, *, thorough: bool = True
) -> ConnectingGeodesic:
    """The geodesic of locally minimal energy near a path, or near the straight line.

    Args:
        metric: of the manifold; its tensor is not constant, and its functions are compiled.
        q0, q1: the ends (n,), not the same.
        guess: a path between them; None is the straight line.
        thorough: where the first pass fails, try other coarse grids, the geodesic of the relaxed
            metric, a continuation in a diagonal added to G, the way back, paths through random
            points, and Ipopt: always as many attempts, so that what is found does not depend on the
            machine.

    Raises:
        NotConverged: none was found; `solution` is the path on which the first attempt ended.
        ValueError: the metric is not defined along the straight line.
    """
    reasons: list[str] = []
    last: Attempt | None = None
    for attempt in _attempts(metric, q0, q1, guess, thorough):
        if attempt.velocity is not None:
            return ConnectingGeodesic(q0, q1, attempt.velocity)
        if not reasons:
            check_straight_line(metric, q0, q1, guess)
        last = last or attempt
        reasons.append(attempt.reason)
    assert last is not None
    if thorough:
        with suppress(NotConverged):
            return find_by_ipopt(metric, q0, q1, guess)
    if ROUNDING in reasons:
        cause = "geodesics diverge so fast that rounding errors exceed 1e-9 at the goal"
    else:
        cause = likely_cause(metric, last.nodes)
    raise NotConverged(
        f"no geodesic was found from {q0} to {q1}: {cause} ({reasons[0]}; number of attempts: "
        f"{len(reasons)})",
        _as_path(metric, last),
    )


def _as_path(metric: Metric, attempt: Attempt) -> Path | None:
    """The last path of an attempt, if it is finite."""
    if not np.all(np.isfinite(attempt.nodes)):
        return None
    return Path(metric, attempt.grid, attempt.nodes)


def _attempts(
    metric: Metric, q0: Array, q1: Array, guess: Path | None, thorough: bool, relax: bool = True
) -> Iterator[Attempt]:
    none = np.zeros((0, metric.dim))
    yield _pass(metric, q0, q1, _LEVELS, _start(_LEVELS, q0, q1, guess), none)
    if not thorough:
        return
    for levels in _OTHER_LEVELS:
        yield _pass(metric, q0, q1, levels, _start(levels, q0, q1, guess), none)
    if relax and metric.relaxed is not None:
        attempts = _attempts(metric.relaxed, q0, q1, guess, thorough, relax=False)
        if easier := next((each for each in attempts if each.velocity is not None), None):
            path = Path(metric, easier.grid, easier.nodes)
            yield _pass(metric, q0, q1, _RELAXED, _start(_RELAXED, q0, q1, path), none)
    added = np.outer(_ADDED, np.diag(metric.matrix(q0)))
    yield _pass(metric, q0, q1, _CONTINUED, _start(_CONTINUED, q0, q1, guess), added)
    yield _back(metric, q0, q1, guess)
    rng = np.random.default_rng(0)
    for _ in range(_WAYPOINTS):
        direction = rng.normal(size=metric.dim)
        size = np.exp(rng.uniform(*np.log(_OFFSET))) * np.linalg.norm(q1 - q0)
        s = _LEVELS.grids[0].nodes[:, None]
        bulge = 4.0 * s * (1.0 - s) * size * direction / np.linalg.norm(direction)
        yield _pass(metric, q0, q1, _LEVELS, q0 + s * (q1 - q0) + bulge, none)


def _back(metric: Metric, q0: Array, q1: Array, guess: Path | None) -> Attempt:
    """The geodesic from q1 to q0, traversed backwards."""
    x = _start(_LEVELS, q0, q1, guess)[::-1]
    back = _pass(metric, q1, q0, _LEVELS, np.ascontiguousarray(x), np.zeros((0, metric.dim)))
    failed = back._replace(nodes=back.nodes[::-1], velocity=None)
    if back.velocity is None:
        return failed
    try:
        _, velocities = sample_geodesic(metric, q1, back.velocity, np.array([0.0, 1.0]))
        found = find_by_shooting(metric, q0, q1, -velocities[-1])
    except (IntegrationFailed, NotConverged) as failure:
        return failed._replace(reason=str(failure))
    return failed._replace(velocity=found.velocity)


def _start(levels: Levels, q0: Array, q1: Array, guess: Path | None) -> Array:
    """Nodes on the first level of the guess, or of the straight line."""
    s = levels.grids[0].nodes
    if guess is None:
        return np.asarray(q0 + s[:, None] * (q1 - q0))
    nodes = guess(s)
    nodes[0], nodes[-1] = q0, q1
    return nodes


def _pass(metric: Metric, q0: Array, q1: Array, levels: Levels, x: Array, added: Array) -> Attempt:
    """All levels from coarse to fine."""
    velocity, nodes, status, statistics = metric.kernels.log_map(
        q0,
        q1,
        x,
        levels.structures,
        levels.first,
        levels.largest,
        np.ascontiguousarray(added),
        Tolerances(STEP, wanted_error(q0, q1), TOLERANCE),
    )
    grid = levels.grids[statistics.level]
    return Attempt(velocity if status == 0 else None, grid, nodes, _STATUS.get(status, ""))
