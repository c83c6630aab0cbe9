"""One geodesic between two configurations, from an initial guess: a path, or a velocity.

From a path, the NLP of `PointToPoint` finds the path of minimal energy; its initial velocity
follows from the momentum at the fixed first node, v0 = -G(q0)^-1 dE/dq0, which is as accurate as
the energy (the discrete Legendre transform of Marsden and West, Acta Numerica 2001). Newton's
method then corrects the end point, with the Jacobian dv0/dq1 from the Hessian of the NLP. From a
velocity, Newton's method finds the geodesic by shooting. Every result is verified by integrating it
forward.
"""

from __future__ import annotations

from dataclasses import dataclass, field

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

# Every geodesic ends this close to its goal when integrated, in every coordinate [rad or m].
TOLERANCE = 1e-9
CHECK_TOLERANCE = 1e-10  # of that integration
# Short geodesics, as of human synergies, need few nodes; finer grids follow where one fails.
_GRIDS = (Grid(1, 14), *(Grid(segments, 20) for segments in (1, 2, 4, 8)))
# A sharply bending path needs more segments to be represented than to be found.
_FINE_GRIDS = (Grid(16, 20), Grid(32, 20))
_STEP_TOLERANCE = 2e-12
_UNIT_INTERVAL = np.array([0.0, 1.0])
_MAX_CORRECTIONS = 10
_MAX_STEPS = 2000  # of one integration: hundreds suffice for the longest geodesics of an arm
# A correction by Newton's method must shrink the endpoint error at least by this factor.
_CONTRACTION = 0.1
# Between points this close the log is their difference to the last digit; its square underflows.
_TINY_DISTANCE = 1e-100
# Looking for the cause of a failure: samples of the straight line, and the ratio of the largest to
# the smallest diagonal entry of the metric that is worth reporting.
_SAMPLES, _LARGE_RATIO = 21, 1e4
# A quick search limits Ipopt's iterations, and goes on to a finer grid only where the last one
# reduced the endpoint error at least by this factor.
_QUICK_OPTIONS, _WORTHWHILE = {"max_iter": 80}, 0.5
# Shooting: number of Newton steps, smallest damping factor, required reduction of the endpoint
# error by a full step, error from which corrections take over, integration tolerance until then.
_MAX_SHOTS, _MIN_DAMPING, _REDUCTION = 12, 0.05, 0.1
_NEAR, _COARSE_STEP_TOLERANCE = 1e-7, 1e-9


@dataclass(frozen=True, eq=False)
class ConnectingGeodesic:
    """A geodesic from q0 to q1: its initial velocity, and the NLP's solution it comes from."""

    q0: Array
    q1: Array
    velocity: Array
    solution: Solution | None = field(default=None, repr=False)

    @property
    def grids(self) -> tuple[Grid, ...]:
        """The grid on which it was found, and the finer ones."""
        first = 0 if self.solution is None else _GRIDS.index(self.solution.path.grid)
        return (*_GRIDS[first:], *_FINE_GRIDS)


def find_from_path(
    metric: Metric, q0: Array, q1: Array, guess: Path | None, *, thorough: bool = True
) -> ConnectingGeodesic:
    """The geodesic of locally minimal energy near a path, or near the straight line.

    Args:
        metric: of the manifold.
        q0, q1: the ends (n,).
        guess: a path between them; None is the straight line.
        thorough: try every grid; else give up where a finer grid hardly reduces the endpoint
            error, or Ipopt takes many iterations.

    Raises:
        NotConverged: none was found, or it does not end at q1 when integrated forward.
        ValueError: the metric is not finite along the path.
    """
    if metric.has_constant_tensor or np.abs(q1 - q0).max() < _TINY_DISTANCE:
        return ConnectingGeodesic(q0, q1, q1 - q0)
    problem = PointToPoint(metric, q0, q1)  # type: ignore[arg-type]
    reasons = []
    solution: Solution | None = None
    smallest_error = np.inf
    for grid in _GRIDS if thorough else _GRIDS[2:]:
        start = solution.path if solution is not None and solution.stats.success else guess
        options = None if thorough else _QUICK_OPTIONS
        solution = solve(problem, grid=grid, guess=start, throw=False, ipopt=options)
        label = f"{grid.segments} x degree {grid.degree}"
        if not solution.stats.success:
            reasons.append(f"{label}: {solution.stats.status}")
            if not thorough:
                break
            continue
        try:
            velocity, jacobian = _initial_velocity(metric, solution)
            velocity, error = _correct_velocity(metric, q0, q1, velocity, jacobian)
        except (IntegrationFailed, np.linalg.LinAlgError) as failure:
            time = getattr(failure, "time", None)
            where = f" at s = {time:.3g}" if time is not None else ""
            reasons.append(f"{label}: its integration fails{where}")
            if not thorough:
                break
            continue
        if error <= TOLERANCE:
            return ConnectingGeodesic(q0, q1, velocity, solution)
        reasons.append(f"{label}: integrated forward, it ends {error:.1e} from the goal")
        if not thorough and error > _WORTHWHILE * smallest_error:
            break
        smallest_error = min(smallest_error, error)
    assert solution is not None
    raise NotConverged(
        f"no geodesic was found from {q0} to {q1}: {_likely_cause(metric, solution)}"
        f" ({'; '.join(reasons)})",
        solution,
    )


def _likely_cause(metric: Metric, solution: Solution) -> str:
    """A singularity between the ends, if there is one, or what else the cause may be."""
    line = np.linspace(solution.path.nodes[0], solution.path.nodes[-1], _SAMPLES)
    samples = np.vstack([line[[0, -1]], line[1:-1], solution.path.nodes[1:-1]])
    for sample in samples:
        if cause := metric.near_singularity(sample):
            return cause
    sizes = np.array([np.diag(metric.matrix(sample)) for sample in samples])
    ratios = sizes.max(axis=0) / sizes.min(axis=0)
    if ratios.max() > _LARGE_RATIO:
        worst = int(np.argmax(ratios))
        names = metric.joint_names or [f"q[{index}]" for index in range(metric.dim)]
        low, high = (samples[pick(sizes[:, worst])] for pick in (np.argmin, np.argmax))
        return (
            f"between {low} and {high} the squared length along {names[worst]} grows by "
            f"{ratios[worst]:.0e}: one of them is near a singularity or a boundary"
        )
    return (
        "the initial guess may be poor (num_starts=10 tries more), or the goal lies at a conjugate "
        "point"
    )


def find_from_velocity(metric: Metric, q0: Array, q1: Array, velocity: Array) -> ConnectingGeodesic:
    """The geodesic that shooting finds from an initial velocity, of minimal energy or not.

    Raises:
        NotConverged: Newton's method found no geodesic that ends at q1.
    """
    try:
        return _shoot(metric, q0, q1, velocity)
    except (IntegrationFailed, np.linalg.LinAlgError) as failure:
        raise NotConverged(f"shooting from {velocity}: {failure}") from None


def _shoot(metric: Metric, q0: Array, q1: Array, velocity: Array) -> ConnectingGeodesic:
    """Newton's method with step halving."""
    for _ in range(_MAX_SHOTS):
        end, jacobian = exp_with_derivative(
            metric, q0, velocity, _COARSE_STEP_TOLERANCE, max_steps=_MAX_STEPS
        )
        error = end - q1
        if np.abs(error).max() <= _NEAR:
            inverse = np.asarray(np.linalg.inv(jacobian), dtype=float)
            velocity, remaining = _correct_velocity(metric, q0, q1, velocity, inverse)
            if remaining <= TOLERANCE:
                return ConnectingGeodesic(q0, q1, velocity)
            break
        step, damping = np.linalg.solve(jacobian, error), 1.0
        while damping > _MIN_DAMPING:
            try:
                trial = _end_point(metric, q0, velocity - damping * step) - q1
            except IntegrationFailed:
                trial = np.full_like(error, np.inf)
            if np.linalg.norm(trial) <= (1.0 - _REDUCTION * damping) * np.linalg.norm(error):
                break
            damping /= 2.0
        else:
            break
        velocity = velocity - damping * step
    raise NotConverged(f"shooting from {q0} with {velocity} does not reach {q1}")


def _end_point(metric: Metric, q0: Array, velocity: Array) -> Array:
    """Exp_q0(velocity) by one coarse integration."""
    positions, _ = integrate_geodesic(
        metric, q0, velocity, _UNIT_INTERVAL, _COARSE_STEP_TOLERANCE, max_steps=_MAX_STEPS
    )
    return np.asarray(positions[-1])


def _correct_velocity(
    metric: Metric, start: Array, goal: Array, velocity: Array, jacobian: Array
) -> tuple[Array, float]:
    """Initial velocity whose integration ends at the goal, and the largest endpoint error."""
    # Short geodesics are corrected down to rounding: their direction counts, too.
    target = CHECK_TOLERANCE * min(1.0, float(np.abs(goal - start).max()))
    best, smallest = velocity, np.inf
    for _ in range(_MAX_CORRECTIONS):
        positions, _ = integrate_geodesic(
            metric, start, velocity, _UNIT_INTERVAL, _STEP_TOLERANCE, max_steps=_MAX_STEPS
        )
        difference = positions[-1] - goal
        error = float(np.abs(difference).max())
        if error >= _CONTRACTION * smallest:
            break
        best, smallest = velocity, error
        if error <= target:
            break
        velocity = velocity - jacobian @ difference
    if smallest <= TOLERANCE:
        # The corrections relied on one integration; an error-controlled one verifies the result.
        end = exp(metric, start, best, tolerance=CHECK_TOLERANCE)
        smallest = float(np.abs(end - goal).max())
    return best, smallest


def _initial_velocity(metric: Metric, solution: Solution) -> tuple[Array, Array]:
    """v0 = G(q0)^-1 p0 of a path between two points, and its derivative by the goal, (n, n)."""
    nodes = solution.path.nodes
    extent = float(np.ptp(nodes, axis=0).max())
    units = Units(nodes[0], extent, extent**2)
    momentum, by_goal = evaluate(
        solution.iterate.transcription.momentum,
        units.scaled(nodes).ravel(),
        units.parameters,
    )
    tensor = metric.matrix(nodes[0])
    return np.linalg.solve(tensor, momentum[:, 0]), np.linalg.solve(tensor, by_goal)
