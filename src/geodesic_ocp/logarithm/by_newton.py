"""Geodesics by Newton's method on the discrete energy, from coarse to fine grids.

The NLP of `PointToPoint` without Ipopt: positions at Gauss-Lobatto nodes, the energy by a finer
Gauss quadrature. Coarse grids cost little and lead to the neighbourhood of a minimum, the finer
ones to a path whose initial velocity, from the momentum at its fixed first node, v0 = -G(q0)^-1
dE/dq0 (the discrete Legendre transform of Marsden and West, Acta Numerica 2001), ends near the
goal; a few integrations correct it, with the derivative dv0/dq1 from the Hessian. The compiled core
does all of it in one call; without a compiler, Ipopt finds geodesics (`by_ipopt`).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import IntegrationFailed, NotConverged
from geodesic_ocp.logarithm.by_ipopt import find_by_ipopt
from geodesic_ocp.logarithm.by_shooting import find_by_shooting
from geodesic_ocp.logarithm.connecting_geodesic import (
    TOLERANCE,
    ConnectingGeodesic,
    wanted_error,
)
from geodesic_ocp.logarithm.correction import ROUNDING, STEP
from geodesic_ocp.logarithm.levels import Levels, levels_of
from geodesic_ocp.logarithm.likely_cause import check_straight_line, likely_cause
from geodesic_ocp.manifold.exp import sample_geodesic
from geodesic_ocp.manifold.kernels import Tolerances
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

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
