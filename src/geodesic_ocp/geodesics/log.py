"""Geodesics between two configurations: logarithmic map, distance, and the paths themselves."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_vector
from geodesic_ocp.errors import IntegrationFailed, NotConverged
from geodesic_ocp.geodesics.multi_start import search
from geodesic_ocp.geodesics.single_start import CHECK_TOLERANCE, TOLERANCE, Found
from geodesic_ocp.manifold.exp import exp, sample_geodesic
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.ocp.solve.certificate import Certificate, certify
from geodesic_ocp.over_rows import over_rows
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path


@dataclass(frozen=True, eq=False)
class Geodesic(Path):
    """A geodesic from q(0) to q(1) at constant speed, a path with its initial velocity.

    Attributes:
        velocity: q'(0), (n,), right to the accuracy of `log`.
    """

    velocity: Array = field(repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        velocity = as_vector("velocity", self.velocity, self.metric.dim)
        velocity.flags.writeable = False
        object.__setattr__(self, "velocity", velocity)

    @cached_property
    def certificate(self) -> Certificate:
        """What is known of it: its error, and whether it is locally shortest."""
        return certify(self, self.velocity)


@over_rows
def log(
    metric: Metric, q0: ArrayLike, q1: ArrayLike, *, num_starts: int = 1, seed: int = 0
) -> Array:
    """Log_q0(q1): the velocity v0 (n,) with Exp_q0(v0) = q1.

    Where several geodesics join the two points: the shortest of those found from `num_starts` starts,
    of which the first is the straight line; see `geodesics`. |Exp(q0, v0) - q1| <= 1e-9 in every
    coordinate, from more than one start up to whole periods of the metric's coordinates. For k
    points (k, n) at either end or both: k velocities (k, n).

    Raises:
        ValueError: wrong shapes, numbers that are not finite, or, with one start, a straight line
            on which the metric is not.
        NotConverged: no geodesic was found, or it does not end at q1 when integrated forward.
    """
    return _search(metric, q0, q1, num_starts, seed)[0].velocity


@over_rows
def distance(
    metric: Metric, q0: ArrayLike, q1: ArrayLike, *, num_starts: int = 1, seed: int = 0
) -> Any:
    """Length |Log_q0(q1)| of the geodesic of `log`, a float; for k pairs an array (k,)."""
    return float(metric.norm(q0, log(metric, q0, q1, num_starts=num_starts, seed=seed)))


def geodesic(
    metric: Metric, q0: ArrayLike, q1: ArrayLike, *, num_starts: int = 1, seed: int = 0
) -> Geodesic:
    """The geodesic of `log` as a path from q0 to q1 at constant speed.

    Its nodes are points of the geodesic's integration, on a grid fine enough that the path's
    velocity is right to 1e-6.

    Raises:
        ValueError: wrong shapes, or numbers that are not finite.
        NotConverged: see `log`.
    """
    return _drawn(metric, _search(metric, q0, q1, num_starts, seed)[0])


def geodesics(
    metric: Metric, q0: ArrayLike, q1: ArrayLike, *, num_starts: int = 20, seed: int = 0
) -> tuple[Geodesic, ...]:
    """All distinct geodesics from q0 to q1 that are found from several starts, shortest first.

    Starts are the straight line, straight lines to goals a period away where the metric has
    `periods` (a turn of a continuous joint), random waypoints, and disturbed velocities of what was
    found. There may be more geodesics than were found, and the shortest may not be among them;
    each one's `certificate` tells whether it is locally shortest.

    Args:
        metric: of the manifold.
        q0, q1: the ends (n,); paths may end whole periods away from q1, which is where the metric
            must be the same.
        num_starts: how many starts, at least one.
        seed: of the random numbers.

    A geodesic that turns too sharply to be drawn is left out with a RuntimeWarning.

    Raises:
        ValueError, NotConverged: see `log`.
    """
    drawn: list[Geodesic] = []
    failures: list[NotConverged] = []
    for found in _search(metric, q0, q1, num_starts, seed):
        try:
            drawn.append(_drawn(metric, found))
        except NotConverged as failure:
            failures.append(failure)
    if not drawn:
        raise failures[0]
    for sharp in failures:
        warnings.warn(f"left out: {sharp}", RuntimeWarning, stacklevel=2)
    return tuple(drawn)


def geodesic_from_velocity(metric: Metric, q0: ArrayLike, v0: ArrayLike) -> Geodesic:
    """The geodesic that starts at q0 (n,) with velocity v0 (n,), as a path up to Exp_q0(v0).

    Raises:
        ValueError: wrong shapes, numbers that are not finite, or v0 is zero.
        IntegrationFailed: see `exp`.
        NotConverged: it turns too sharply to be drawn.
    """
    metric = as_metric(metric)
    start, velocity = metric.point("q0", q0), as_vector("v0", v0, metric.dim)
    if not np.any(velocity):
        raise ValueError("v0 must not be zero: there is no geodesic that stands still")
    return _drawn(metric, Found(start, exp(metric, start, velocity), velocity, None))


def _search(
    metric: Metric, q0: ArrayLike, q1: ArrayLike, num_starts: int, seed: int
) -> list[Found]:
    metric = as_metric(metric)
    return search(metric, metric.point("q0", q0), metric.point("q1", q1), num_starts, seed)


def _integrated(metric: Metric, found: Found, grid: Grid) -> tuple[Array, Array]:
    """Points and velocities at the grid's nodes, as exact as can be, to `TOLERANCE` at least."""
    for tolerance in (CHECK_TOLERANCE, TOLERANCE):
        try:
            return sample_geodesic(
                metric, found.q0, found.velocity, grid.nodes, tolerance=tolerance
            )
        except IntegrationFailed as error:
            failure = error
    raise NotConverged(f"the geodesic cannot be drawn: {failure}")


def _drawn(metric: Metric, found: Found) -> Geodesic:
    for grid in found.grids:
        nodes, velocities = _integrated(metric, found, grid)
        path = Geodesic(metric, grid, np.vstack([nodes[:-1], found.q1]), found.velocity)
        slopes = grid.differentiation @ grid.in_segments(path.nodes)
        error = np.abs(slopes - grid.in_segments(velocities)).max()
        rounding = np.finfo(float).eps * np.abs(grid.differentiation).max() * np.abs(nodes).max()
        if error <= 1e-6 * np.abs(velocities).max() + 10.0 * rounding:
            return path
    raise NotConverged(
        f"the geodesic from {found.q0} to {found.q1} turns too sharply for {grid.segments} "
        f"segments of degree {grid.degree}: its velocity is off by {error:.1e}",
        found.solution,
    )
