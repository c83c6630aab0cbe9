"""One geodesic between two configurations, from a path or the straight line.

Without constraints, Newton's method on the discrete energy finds it in milliseconds (`by_newton`);
Ipopt solves the same NLP and serves as reference (`by_ipopt`). The argument `solver`, or the
environment variable GEODESIC_OCP_SOLVER, chooses.
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
# Between points this close the log is their difference to the last digit; its square underflows.
_TINY_DISTANCE = 1e-100


def as_solver(solver: str | None) -> str:
    """The argument, the environment variable, or "newton"; ValueError if it is no solver."""
    name = solver or os.environ.get(ENVIRONMENT_VARIABLE) or SOLVERS[0]
    if name not in SOLVERS:
        where = "solver" if solver else ENVIRONMENT_VARIABLE
        raise ValueError(f"{where} must be one of {', '.join(SOLVERS)}, got {name!r}")
    return name


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
    if metric.has_constant_tensor or np.abs(q1 - q0).max() < _TINY_DISTANCE:
        return ConnectingGeodesic(q0, q1, q1 - q0)
    find = find_by_newton if solver == "newton" else find_by_ipopt
    return find(metric, q0, q1, guess, thorough=thorough)
