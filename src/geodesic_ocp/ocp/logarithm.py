"""Geodesics between two configurations: logarithmic map, distance, and the path itself.

The NLP of `PointToPoint` finds the path; its initial velocity comes from the momentum at the fixed
first node, v0 = -G(q0)^-1 dE/dq0, which is as accurate as the energy (the discrete Legendre
transform of Marsden and West, Acta Numerica 2001). The end point is then corrected by Newton's
method, whose Jacobian dv0/dq1 is read from the NLP's Hessian, and every answer is checked by
integrating it forward.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_vector, evaluate
from geodesic_ocp.errors import IntegrationFailed, NotConverged
from geodesic_ocp.manifold.exponential import exp, integrated, trajectory
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.rows import by_rows
from geodesic_ocp.ocp.grid import Grid
from geodesic_ocp.ocp.path import Path
from geodesic_ocp.ocp.problem import PointToPoint
from geodesic_ocp.ocp.solution import Solution
from geodesic_ocp.ocp.solve import solve, transcription_of
from geodesic_ocp.ocp.transcription import Units

# Every answer reaches its goal to this when integrated forward, in every coordinate [rad or m].
TOLERANCE = 1e-9
# Short geodesics, as of human synergies, need few nodes; each grid that fails gives way to a finer.
_GRIDS = (Grid(1, 14), *(Grid(segments, 20) for segments in (1, 2, 4, 8)))
# Paths that turn sharply need more segments to be drawn than to be found.
_FINE_GRIDS = (Grid(16, 20), Grid(32, 20))
_CHECK_TOLERANCE = 1e-10
_STEP_TOLERANCE = 2e-12
_UNIT = np.array([0.0, 1.0])
_CORRECTIONS = 10
_MAX_STEPS = 2000  # of one integration: hundreds do for the longest geodesics of an arm
# Newton's corrections gain many digits at a time from a path that is fine enough, or none.
_CONTRACTION = 0.1
# Between points this near the log is the difference to the last digit, and its square underflows.
_VANISHING = 1e-100


@dataclass(frozen=True, eq=False)
class _Found:
    """A geodesic: initial velocity, and the NLP's solution it was corrected from."""

    velocity: Array
    solution: Solution | None

    @property
    def grids(self) -> tuple[Grid, ...]:
        """The grid on which it was found, and the finer ones."""
        first = 0 if self.solution is None else _GRIDS.index(self.solution.path.grid)
        return (*_GRIDS[first:], *_FINE_GRIDS)


@by_rows
def log(metric: Metric, q0: ArrayLike, q1: ArrayLike) -> Array:
    """Log_q0(q1): the velocity v0 (n,) with Exp_q0(v0) = q1.

    Started from the straight line; where several geodesics join the two points, the one found
    from there. |Exp(q0, v0) - q1| <= 1e-9 in every coordinate. For k points (k, n) at either end
    or both: k velocities (k, n).

    Raises:
        ValueError: wrong shapes, numbers that are not finite, or a straight line on which the
            metric is not.
        NotConverged: no geodesic was found, or it does not end at q1 when integrated forward.
    """
    return _find(metric, q0, q1).velocity


@by_rows
def distance(metric: Metric, q0: ArrayLike, q1: ArrayLike) -> Any:
    """Length |Log_q0(q1)| of the geodesic of `log`, a float; for k pairs an array (k,)."""
    return float(metric.norm(q0, log(metric, q0, q1)))


def geodesic(metric: Metric, q0: ArrayLike, q1: ArrayLike) -> Path:
    """The geodesic of `log` as a path from q0 to q1 at constant speed.

    Its nodes are points of the geodesic's integration, on a grid fine enough that the path's
    velocity is right to 1e-6.

    Raises:
        ValueError: wrong shapes, or numbers that are not finite.
        NotConverged: see `log`.
    """
    found = _find(metric, q0, q1)
    goal = as_vector("q1", q1, metric.dim)
    for grid in found.grids:
        nodes, velocities = trajectory(
            metric, q0, found.velocity, grid.nodes, tolerance=_CHECK_TOLERANCE
        )
        path = Path(metric, grid, np.vstack([nodes[:-1], goal]))
        slopes = grid.differentiation @ grid.in_segments(path.nodes)
        error = np.abs(slopes - grid.in_segments(velocities)).max()
        rounding = np.finfo(float).eps * np.abs(grid.differentiation).max() * np.abs(nodes).max()
        if error <= 1e-6 * np.abs(velocities).max() + 10.0 * rounding:
            return path
    raise NotConverged(
        f"the geodesic from {nodes[0]} to {goal} turns too sharply for {grid.segments} segments of "
        f"degree {grid.degree}: its velocity is off by {error:.1e}",
        found.solution,
    )


def _find(metric: Metric, q0: ArrayLike, q1: ArrayLike) -> _Found:
    problem = PointToPoint(metric, q0, q1)  # type: ignore[arg-type]
    start, goal = np.array(problem.q0), np.array(problem.q1)
    if np.abs(goal - start).max() < _VANISHING:
        return _Found(goal - start, None)
    reasons = []
    solution: Solution | None = None
    for grid in _GRIDS:
        guess = solution.path if solution is not None and solution.stats.success else None
        solution = solve(problem, grid=grid, guess=guess, throw=False)
        label = f"{grid.segments} x degree {grid.degree}"
        if not solution.stats.success:
            reasons.append(f"{label}: {solution.stats.status}")
            continue
        try:
            velocity, residual = _corrected(metric, solution, goal)
        except (IntegrationFailed, np.linalg.LinAlgError) as failure:
            reasons.append(f"{label}: {failure}")
            continue
        if residual <= TOLERANCE:
            return _Found(velocity, solution)
        reasons.append(f"{label}: integrated forward it misses the goal by {residual:.1e}")
    raise NotConverged(
        f"no geodesic was found from {start} to {goal} ({'; '.join(reasons)}). The straight line "
        "may be a poor start, or the goal lies at a conjugate point or beyond a singularity.",
        solution,
    )


def _corrected(metric: Metric, solution: Solution, goal: Array) -> tuple[Array, float]:
    """Initial velocity whose integration ends at the goal, and the largest miss in a coordinate."""
    start = solution.path.nodes[0]
    # Short geodesics are corrected further, as far as rounding lets: their direction counts too.
    target = _CHECK_TOLERANCE * min(1.0, float(np.abs(goal - start).max()))
    velocity, jacobian = _initial_velocity(metric, solution)
    best, best_miss = velocity, np.inf
    for _ in range(_CORRECTIONS):
        positions, _ = integrated(
            metric, start, velocity, _UNIT, _STEP_TOLERANCE, max_steps=_MAX_STEPS
        )
        gap = positions[-1] - goal
        miss = float(np.abs(gap).max())
        if miss >= _CONTRACTION * best_miss:
            break
        best, best_miss = velocity, miss
        if miss <= target:
            break
        velocity = velocity - jacobian @ gap
    if best_miss <= TOLERANCE:
        # The corrections trusted one integration; the answer is judged by a checked one.
        arrival = exp(metric, start, best, tolerance=_CHECK_TOLERANCE)
        best_miss = float(np.abs(arrival - goal).max())
    return best, best_miss


def _initial_velocity(metric: Metric, solution: Solution) -> tuple[Array, Array]:
    """v0 = G(q0)^-1 p0 and its derivative by the goal, (n, n)."""
    nodes = solution.path.nodes
    extent = float(np.ptp(nodes, axis=0).max())
    units = Units(nodes[0], extent, extent**2)
    momentum, by_goal = evaluate(
        transcription_of(solution).momentum, units.scaled(nodes).ravel(), units.parameters
    )
    tensor = metric.matrix(nodes[0])
    return np.linalg.solve(tensor, momentum[:, 0]), np.linalg.solve(tensor, by_goal)
