"""A geodesic as the solution of its boundary value problem by Ipopt, and why there may be none.

The initial velocity follows from the momentum at the fixed first node, v0 = -G(q0)^-1 dE/dq0, which
is as accurate as the energy (the discrete Legendre transform of Marsden and West, Acta Numerica
2001). Newton's method then corrects the end point, with the Jacobian dv0/dq1 from the Hessian of
the NLP. It is the reference for `by_newton`.
"""

from __future__ import annotations

import threading

import numpy as np

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.logarithm.by_newton import (
    GRIDS,
    ConnectingGeodesic,
    correct_velocity,
    likely_cause,
)
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.ocp.problems import PointToPoint
from geodesic_ocp.ocp.solution import Solution
from geodesic_ocp.ocp.solve import solve
from geodesic_ocp.ocp.transcription import Units
from geodesic_ocp.trajectory.path import Path

# CasADi's expressions and its interface to Ipopt are not for several threads.
_one_at_a_time = threading.RLock()


def find_by_ipopt(
    metric: Metric, q0: Array, q1: Array, guess: Path | None, *, thorough: bool = True
) -> ConnectingGeodesic:
    """Return the geodesic of locally minimal energy near a path, or near the straight line.

    Args:
        metric: metric of the manifold; its tensor is not constant.
        q0, q1: the ends (n,), not the same.
        guess: a path between them; None is the straight line.
        thorough: try every grid; else give up at the first failure.

    Raises:
        NotConverged: none was found, or it does not end at q1 when integrated forward.
        ValueError: the metric is not finite along the path.
    """
    problem = PointToPoint(metric, q0, q1)  # type: ignore[arg-type]
    reasons: list[str] = []
    solution: Solution | None = None
    options = None if thorough else {"max_iter": 80}
    with _one_at_a_time:
        for grid in GRIDS if thorough else GRIDS[2:3]:
            start = solution.path if solution is not None and solution.stats.success else guess
            solution = solve(problem, grid=grid, guess=start, throw=False, ipopt=options)
            reason = solution.stats.status
            if solution.stats.success:
                try:
                    initial = _initial_velocity(metric, solution)
                except np.linalg.LinAlgError:
                    reason = "the Hessian of the energy is singular"
                else:
                    velocity, reason = correct_velocity(metric, q0, q1, *initial)
                    if velocity is not None:
                        return ConnectingGeodesic(q0, q1, velocity, grid.size)
            reasons.append(f"{grid.segments} x degree {grid.degree}: {reason}")
    assert solution is not None
    raise NotConverged(
        f"no geodesic was found from {q0} to {q1}: {likely_cause(metric, solution.path.nodes)} "
        f"({'; '.join(reasons)})",
        solution,
    )


def _initial_velocity(metric: Metric, solution: Solution) -> tuple[Array, Array]:
    """Return v0 = G(q0)^-1 p0 of a path between two points, and its derivative by the goal."""
    nodes = solution.path.nodes
    extent = float(np.ptp(nodes, axis=0).max())
    units = Units(nodes[0], extent, extent**2)
    transcription = solution.iterate.nlp.transcription
    momentum, by_goal = evaluate(
        transcription.momentum,
        units.scaled(nodes).ravel(),
        transcription.parameters(units, solution.path.grid),
    )
    tensor = metric.matrix(nodes[0])
    return np.linalg.solve(tensor, momentum[:, 0]), np.linalg.solve(tensor, by_goal)
