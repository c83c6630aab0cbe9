"""One geodesic between two configurations, from a path or the straight line.

Without constraints, Newton's method on the discrete energy finds it in milliseconds (`by_newton`);
Ipopt solves the same NLP, as reference and where there is no compiler (`by_ipopt`). The argument
`solver`, or the environment variable GEODESIC_OCP_SOLVER, chooses.
"""

from __future__ import annotations

import os

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.logarithm.by_ipopt import find_by_ipopt
from geodesic_ocp.logarithm.by_newton import find_by_newton
from geodesic_ocp.logarithm.connecting_geodesic import ConnectingGeodesic
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.trajectory.path import Path

SOLVERS = ("newton", "ipopt")
ENVIRONMENT_VARIABLE = "GEODESIC_OCP_SOLVER"
# Between points this close, relative to their coordinates, node positions have too few digits for
# Newton's method; the logarithm is their difference and a small correction.
_NEARBY = 1e-5
# Agreement of the correction by one step and by two, relative to the distance: rounding.
_AGREEMENT = 1e-14
_CORRECTIONS = 4


def as_solver(solver: str | None) -> str:
    """The argument, the environment variable, or "newton"; ValueError if it is no solver."""
    name = solver or os.environ.get(ENVIRONMENT_VARIABLE) or SOLVERS[0]
    if name not in SOLVERS:
        where = "solver" if solver else ENVIRONMENT_VARIABLE
        raise ValueError(f"{where} must be one of {', '.join(SOLVERS)}, got {name!r}")
    return name


def are_nearby(q0: Array, q1: Array) -> bool:
    """Whether the geodesic between two points is nearly a straight line, and found as such."""
    return bool(np.abs(q1 - q0).max() <= _NEARBY * max(1.0, np.abs(q0).max()))


def find_from_path(
    metric: Metric,
    q0: Array,
    q1: Array,
    guess: Path | None,
    solver: str,
    *,
    thorough: bool = True,
) -> ConnectingGeodesic:
    """The geodesic of locally minimal energy near a path, or near the straight line.

    Raises:
        NotConverged: none was found, or it does not end at q1 when integrated forward.
        ValueError: the metric is not finite along the path.
    """
    if metric.has_constant_tensor or np.array_equal(q0, q1):
        return ConnectingGeodesic(q0, q1, q1 - q0)
    if are_nearby(q0, q1):
        velocity = _velocity_to_nearby(metric, q0, q1)
        if velocity is not None:
            return ConnectingGeodesic(q0, q1, velocity)
    is_compiled = solver == "newton" and metric.kernels.available()
    find = find_by_newton if is_compiled else find_by_ipopt
    return find(metric, q0, q1, guess, thorough=thorough)


def _velocity_to_nearby(metric: Metric, q0: Array, q1: Array) -> Array | None:
    """Log_q0(q1) (n,) by integrating the displacement, which keeps its digits; None if too far.

    A fixed-point iteration: over short distances, the displacement is nearly the initial velocity.
    """
    wanted = q1 - q0
    size = np.abs(wanted).max()
    velocity = wanted
    for _ in range(_CORRECTIONS):
        one, two = (_displacement(metric, q0, velocity, steps) for steps in (1, 2))
        if not np.abs(one - two).max() <= _AGREEMENT * size:
            return None
        velocity = velocity + wanted - two
        if np.abs(wanted - two).max() <= _AGREEMENT * size:
            return np.asarray(velocity)
    return None


def _displacement(metric: Metric, q0: Array, v0: Array, steps: int) -> Array:
    """Exp_q0(v0) - q0 (n,), by steps of the classical Runge-Kutta method."""
    x, v, h = np.zeros_like(v0), v0, 1.0 / steps
    for _ in range(steps):
        a1 = metric.acceleration(q0 + x, v)
        a2 = metric.acceleration(q0 + x + h / 2 * v, v + h / 2 * a1)
        a3 = metric.acceleration(q0 + x + h / 2 * (v + h / 2 * a1), v + h / 2 * a2)
        a4 = metric.acceleration(q0 + x + h * (v + h / 2 * a2), v + h * a3)
        x, v = x + h * v + h * h / 6 * (a1 + a2 + a3), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return np.asarray(x)
