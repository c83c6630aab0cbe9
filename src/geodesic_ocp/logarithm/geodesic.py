"""Geodesics as paths: between two configurations, or from an initial velocity."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_vector, settle
from geodesic_ocp.errors import IntegrationFailed, NotConverged
from geodesic_ocp.logarithm.by_newton import CHECK_TOLERANCE, TOLERANCE, ConnectingGeodesic
from geodesic_ocp.logarithm.log import find_geodesics, find_shortest
from geodesic_ocp.manifold.exp import exp, sample_geodesic
from geodesic_ocp.manifold.metric import Metric, as_metric
from geodesic_ocp.ocp.certificate import Certificate, certify
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

_RESOLVED = 1e-6  # accuracy of the velocity of a path, relative to the largest


@dataclass(frozen=True, eq=False, repr=False)
class Geodesic(Path):
    """A geodesic from q(0) to q(1) at constant speed: a path with its initial velocity.

    Attributes:
        velocity: q'(0), (n,), to the accuracy of `log`.
    """

    velocity: Array = field(repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        velocity = as_vector("velocity", self.velocity, self.metric.dim)
        velocity.flags.writeable = False
        settle(self, velocity=velocity)

    @cached_property
    def certificate(self) -> Certificate:
        """The accuracy of the path as a geodesic, and whether it is locally minimizing."""
        return certify(self, self.velocity)

    def __repr__(self) -> str:
        length = self.metric.norm(self.nodes[0], self.velocity)
        # A certificate can take seconds: it is shown once it has been computed.
        certificate = self.__dict__.get("certificate")
        start, end = (
            np.array2string(q, max_line_width=100, precision=3, threshold=8, edgeitems=3)
            for q in self.nodes[[0, -1]]
        )
        lines = [f"Geodesic(length {length:.6g}, from {start}", f"to {end}"]
        lines += [] if certificate is None else [str(certificate)]
        return ",\n  ".join(lines) + ")"


def geodesic(
    metric: Metric,
    q0: ArrayLike,
    q1: ArrayLike,
    *,
    num_starts: int = 1,
    seed: int = 0,
    solver: str | None = None,
    wrap: bool = True,
) -> Geodesic:
    """Return the geodesic of `log` as a path from q0 to q1 at constant speed.

    Continuous joints, and other coordinates with `Metric.periods`, turn the shorter way: the path
    may end whole periods away from q1. The next path begins at `path(1.0)`, then.

    Its nodes are sampled from the integrated geodesic, on a grid fine enough that the velocity of
    the path is accurate to 1e-6.

    >>> arm = go.human_arm()
    >>> q0, q1 = [0.0, 0.1, -0.5, 0.8, 0.0, 0.0, 0.0], [0.6, 0.2, -0.9, 1.4, 0.1, 0.0, 0.1]
    >>> path = go.geodesic(go.KineticEnergy(arm), q0, q1)
    >>> path(0.5).round(3)
    array([ 0.185,  0.102, -0.742,  1.445,  0.11 , -0.528,  0.187])
    >>> round(path.length, 4)
    0.531
    >>> path.certificate.locally_shortest
    True

    Args:
        metric: metric of the manifold.
        q0, q1: configurations (n,) [rad or m].
        num_starts, seed, solver, wrap: see `log`.

    Raises:
        ValueError, NotConverged: see `log`.
    """
    found = find_shortest(
        metric, q0, q1, num_starts=num_starts, seed=seed, solver=solver, wrap=wrap
    )
    return _sample_path(metric, found)


def geodesics(
    metric: Metric,
    q0: ArrayLike,
    q1: ArrayLike,
    *,
    num_starts: int = 20,
    seed: int = 0,
    solver: str | None = None,
    wrap: bool = True,
) -> tuple[Geodesic, ...]:
    """Return all distinct geodesics from q0 to q1 that are found from several starts, shortest
    first.

    The initial guesses are the straight line (where the metric has `periods`, such as a revolution
    of a continuous joint, those to the nearest image of q1 and to others), paths through random
    waypoints, and perturbed velocities of geodesics found before. There may be more geodesics, and
    a shorter one; the `certificate` of each tells whether it is locally minimizing. A geodesic that
    bends too sharply for the finest grid is left out with a RuntimeWarning.

    >>> class Cylinder(go.Metric):  # radius 1, in angle and height
    ...     dim, periods = 2, (6.283185307179586, float("inf"))
    ...     def matrix(self, q):
    ...         return type(q).eye(2)
    >>> found = go.geodesics(Cylinder(), [0.0, 0.0], [2.0, 1.0], num_starts=3)
    >>> [round(path.length, 3) for path in found]
    [2.236, 4.398, 8.343]

    Args:
        metric: metric of the manifold.
        q0, q1: the ends (n,); paths may end whole periods away from q1, where the metric must be
            the same.
        num_starts: number of initial guesses, at least one.
        seed: seed of the random numbers.
        solver, wrap: see `log`.

    Raises:
        ValueError, NotConverged: see `log`.
    """
    paths: list[Geodesic] = []
    failures: list[NotConverged] = []
    every = find_geodesics(
        metric, q0, q1, num_starts=num_starts, seed=seed, solver=solver, wrap=wrap
    )
    for found in every:
        try:
            paths.append(_sample_path(metric, found))
        except NotConverged as failure:
            failures.append(failure)
    if not paths:
        raise failures[0]
    for reason in failures:
        warnings.warn(f"left out a geodesic: {reason}", RuntimeWarning, stacklevel=2)
    return tuple(paths)


def geodesic_from_velocity(metric: Metric, q0: ArrayLike, v0: ArrayLike) -> Geodesic:
    """Return the geodesic that starts at q0 (n,) with velocity v0 (n,), as a path up to Exp_q0(v0).

    >>> path = go.logarithm.geodesic_from_velocity(go.Euclidean(2), [0.0, 0.0], [3.0, 4.0])
    >>> path(0.5).round(3), round(path.length, 6)
    (array([1.5, 2. ]), 5.0)

    Args:
        metric: metric of the manifold.
        q0: configuration (n,) [rad or m] at the start.
        v0: velocity (n,) there, whose length is that of the geodesic.

    Raises:
        ValueError: wrong shapes, numbers that are not finite, or v0 is zero.
        IntegrationFailed: see `exp`.
        NotConverged: it bends too sharply for the finest grid.
    """
    metric = as_metric(metric)
    start = metric.point("q0", q0)
    velocity = as_vector("v0", v0, metric.dim)
    if not np.any(velocity):
        raise ValueError("v0 must not be zero: a geodesic moves at constant speed")
    end = exp(metric, start, velocity)
    return _sample_path(metric, ConnectingGeodesic(start, end, velocity))


def _sample_path(metric: Metric, found: ConnectingGeodesic) -> Geodesic:
    """Return the geodesic as a path on the coarsest grid that resolves its velocity."""

    def integrate(times: Array) -> tuple[Array, Array]:
        """Compute the geodesic as accurately as possible, at least to 1e-9."""
        for tolerance in (CHECK_TOLERANCE, TOLERANCE):
            try:
                return sample_geodesic(metric, found.q0, found.velocity, times, tolerance=tolerance)
            except IntegrationFailed as error:
                failure = error
        raise NotConverged(f"the geodesic cannot be sampled along its length: {failure}")

    return Geodesic(metric, *sampled(found, integrate), found.velocity)


def sampled(
    found: ConnectingGeodesic, integrate: Callable[[Array], tuple[Array, Array]]
) -> tuple[Grid, Array]:
    """Return the coarsest grid that resolves the velocity of a geodesic, and the positions at its
    nodes.

    Args:
        found: the geodesic.
        integrate: gives its positions and velocities, (k, n) each, at times (k,) from 0 to 1.

    Raises:
        NotConverged: it bends too sharply for the finest grid.
    """
    for grid in found.grids:
        nodes, velocities = integrate(grid.nodes)
        nodes = np.vstack([nodes[:-1], found.q1])
        slopes = grid.differentiation @ grid.in_segments(nodes)
        error = np.abs(slopes - grid.in_segments(velocities)).max()
        rounding = np.finfo(float).eps * np.abs(grid.differentiation).max() * np.abs(nodes).max()
        if error <= _RESOLVED * np.abs(velocities).max() + 10.0 * rounding:
            return grid, nodes
    raise NotConverged(
        f"the geodesic from {found.q0} to {found.q1} bends too sharply for {grid.segments} "
        f"segments of degree {grid.degree}: the error of its velocity is {error:.1e}"
    )
