"""One geodesic between two configurations from one start: a path, or a velocity.

From a path, the NLP of `PointToPoint` finds the path of least energy; its initial velocity comes
from the momentum at the fixed first node, v0 = -G(q0)^-1 dE/dq0, which is as accurate as the energy
(the discrete Legendre transform of Marsden and West, Acta Numerica 2001). The end point is then
corrected by Newton's method, whose Jacobian dv0/dq1 is read from the NLP's Hessian. From a
velocity, Newton's method finds the geodesic by shooting. Every answer is checked by integrating it
forward.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.errors import IntegrationFailed, NotConverged
from geodesic_ocp.manifold.exp import exp, integrate_geodesic
from geodesic_ocp.manifold.exp_derivative import exp_with_derivative
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.ocp.nlp.transcription import Units
from geodesic_ocp.ocp.problem.point_to_point import PointToPoint
from geodesic_ocp.ocp.solve.solution import Solution
from geodesic_ocp.ocp.solve.solve import solve
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

# Every answer reaches its goal to this when integrated forward, in every coordinate [rad or m].
TOLERANCE = 1e-9
# Short geodesics, as of human synergies, need few nodes; each grid that fails gives way to a finer.
GRIDS = (Grid(1, 14), *(Grid(segments, 20) for segments in (1, 2, 4, 8)))
# Paths that turn sharply need more segments to be drawn than to be found.
_FINE_GRIDS = (Grid(16, 20), Grid(32, 20))
CHECK_TOLERANCE = 1e-10
_STEP_TOLERANCE = 2e-12
_UNIT = np.array([0.0, 1.0])
_CORRECTIONS = 10
_LOOKED_AT = 21  # points of the straight line
_VARIED = 1e4  # change of an entry of the metric's diagonal
_MAX_STEPS = 2000  # of one integration: hundreds do for the longest geodesics of an arm
# Newton's corrections gain many digits at a time from a path that is fine enough, or none.
_CONTRACTION = 0.1
# Between points this near the log is the difference to the last digit, and its square underflows.
_VANISHING = 1e-100
# What is tried in passing: Ipopt's iterations, and the share of the miss on the last grid that is
# worth another one.
_IMPATIENT, _LITTLE = {"max_iter": 80}, 0.5
# Newton's method from afar: steps, shortest share of a step, what a full step must gain, and the
# miss from which the corrections take over, whose error of a step need not be reached before.
_SHOTS, _SHORTEST_SHOT, _GAIN = 12, 0.05, 0.1
_NEAR, _COARSE_STEP_TOLERANCE = 1e-7, 1e-9


@dataclass(frozen=True, eq=False)
class Found:
    """A geodesic from q0 to q1: its initial velocity, and the NLP's solution it came from."""

    q0: Array
    q1: Array
    velocity: Array
    solution: Solution | None

    @property
    def grids(self) -> tuple[Grid, ...]:
        """The grid on which it was found, and the finer ones."""
        first = 0 if self.solution is None else GRIDS.index(self.solution.path.grid)
        return (*GRIDS[first:], *_FINE_GRIDS)


def from_path(
    metric: Metric, q0: Array, q1: Array, guess: Path | None, *, patient: bool = True
) -> Found:
    """The geodesic of least energy near a path, or near the straight line.

    Args:
        metric: of the manifold.
        q0, q1: the ends (n,).
        guess: a path between them; None is the straight line.
        patient: try every grid; else give up where a finer one brings the path little nearer to a
            geodesic, or Ipopt takes many iterations.

    Raises:
        NotConverged: none was found, or it does not end at q1 when integrated forward.
        ValueError: the metric is not finite along the path.
    """
    problem = PointToPoint(metric, q0, q1)  # type: ignore[arg-type]
    if np.abs(q1 - q0).max() < _VANISHING:
        return Found(q0, q1, q1 - q0, None)
    reasons = []
    solution: Solution | None = None
    nearest = np.inf
    for grid in GRIDS if patient else GRIDS[2:]:
        better = solution.path if solution is not None and solution.stats.success else guess
        options = None if patient else _IMPATIENT
        solution = solve(problem, grid=grid, guess=better, throw=False, ipopt=options)
        label = f"{grid.segments} x degree {grid.degree}"
        if not solution.stats.success:
            reasons.append(f"{label}: {solution.stats.status}")
            if not patient:
                break
            continue
        try:
            velocity, jacobian = initial_velocity(metric, solution)
            velocity, miss = _corrected(metric, q0, q1, velocity, jacobian)
        except (IntegrationFailed, np.linalg.LinAlgError) as failure:
            when = getattr(failure, "time", None)
            where = f" at {when:.3g} of the way" if when is not None else ""
            reasons.append(f"{label}: its integration fails{where}")
            if not patient:
                break
            continue
        if miss <= TOLERANCE:
            return Found(q0, q1, velocity, solution)
        reasons.append(f"{label}: integrated forward it misses the goal by {miss:.1e}")
        if not patient and miss > _LITTLE * nearest:
            break
        nearest = min(nearest, miss)
    assert solution is not None
    raise NotConverged(
        f"no geodesic was found from {q0} to {q1}: {_cause(metric, solution)}"
        f" ({'; '.join(reasons)})",
        solution,
    )


def _cause(metric: Metric, solution: Solution) -> str:
    """A singularity on the way, if there is one, or what else it may be."""
    line = np.linspace(solution.path.nodes[0], solution.path.nodes[-1], _LOOKED_AT)
    places = np.vstack([line[[0, -1]], line[1:-1], solution.path.nodes[1:-1]])
    for place in places:
        if why := metric.near_singularity(place):
            return why
    sizes = np.array([np.diag(metric.matrix(place)) for place in places])
    ratios = sizes.max(axis=0) / sizes.min(axis=0)
    if ratios.max() > _VARIED:
        worst = int(np.argmax(ratios))
        names = metric.joint_names or [f"q[{index}]" for index in range(metric.dim)]
        low, high = (places[pick(sizes[:, worst])] for pick in (np.argmin, np.argmax))
        return (
            f"between {low} and {high} the square of a length along {names[worst]} grows by "
            f"{ratios[worst]:.0e}: one of them is near a singularity or a boundary"
        )
    return "the start may be a poor one (num_starts=10 tries more), or the goal lies at a conjugate point"


def from_velocity(metric: Metric, q0: Array, q1: Array, velocity: Array) -> Found:
    """The geodesic that shooting finds from an initial velocity, be it of least energy or not.

    Raises:
        NotConverged: Newton's method came to no geodesic that ends at q1.
    """
    try:
        return _shot(metric, q0, q1, velocity)
    except (IntegrationFailed, np.linalg.LinAlgError) as failure:
        raise NotConverged(f"shooting from {velocity}: {failure}") from None


def _shot(metric: Metric, q0: Array, q1: Array, velocity: Array) -> Found:
    for _ in range(_SHOTS):
        arrival, jacobian = exp_with_derivative(
            metric, q0, velocity, _COARSE_STEP_TOLERANCE, max_steps=_MAX_STEPS
        )
        gap = arrival - q1
        if np.abs(gap).max() <= _NEAR:
            inverse = np.asarray(np.linalg.inv(jacobian), dtype=float)
            velocity, miss = _corrected(metric, q0, q1, velocity, inverse)
            if miss <= TOLERANCE:
                return Found(q0, q1, velocity, None)
            break
        step, share = np.linalg.solve(jacobian, gap), 1.0
        while share > _SHORTEST_SHOT:
            try:
                trial = _arrival(metric, q0, velocity - share * step) - q1
            except IntegrationFailed:
                trial = np.full_like(gap, np.inf)
            if np.linalg.norm(trial) <= (1.0 - _GAIN * share) * np.linalg.norm(gap):
                break
            share /= 2.0
        else:
            break
        velocity = velocity - share * step
    raise NotConverged(f"shooting from {q0} with {velocity} does not come to {q1}")


def _arrival(metric: Metric, q0: Array, velocity: Array) -> Array:
    steps = _COARSE_STEP_TOLERANCE
    positions, _ = integrate_geodesic(metric, q0, velocity, _UNIT, steps, max_steps=_MAX_STEPS)
    return np.asarray(positions[-1])


def _corrected(
    metric: Metric, start: Array, goal: Array, velocity: Array, jacobian: Array
) -> tuple[Array, float]:
    """Initial velocity whose integration ends at the goal, and the largest miss in a coordinate."""
    # Short geodesics are corrected further, as far as rounding lets: their direction counts too.
    target = CHECK_TOLERANCE * min(1.0, float(np.abs(goal - start).max()))
    best, best_miss = velocity, np.inf
    for _ in range(_CORRECTIONS):
        positions, _ = integrate_geodesic(
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
        arrival = exp(metric, start, best, tolerance=CHECK_TOLERANCE)
        best_miss = float(np.abs(arrival - goal).max())
    return best, best_miss


def initial_velocity(metric: Metric, solution: Solution) -> tuple[Array, Array]:
    """v0 = G(q0)^-1 p0 of a path between two points, and its derivative by the goal, (n, n)."""
    nodes = solution.path.nodes
    extent = float(np.ptp(nodes, axis=0).max())
    units = Units(nodes[0], extent, extent**2)
    momentum, by_goal = evaluate(
        solution.attempt.transcription.momentum,
        units.scaled(nodes).ravel(),
        units.parameters,
    )
    tensor = metric.matrix(nodes[0])
    return np.linalg.solve(tensor, momentum[:, 0]), np.linalg.solve(tensor, by_goal)
