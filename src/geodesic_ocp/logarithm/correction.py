"""Geodesics between two configurations by shooting, and corrections of an initial velocity.

The corrections are those of core/logarithm.h, in NumPy.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import IntegrationFailed, NotConverged
from geodesic_ocp.manifold.exp import exp_with_derivative, integrate_geodesic
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.trajectory.grid import Grid

# Every geodesic ends this close to its goal when integrated, in every coordinate [rad or m].
TOLERANCE = 1e-9
CHECK_TOLERANCE = 1e-10  # of that integration
# Short geodesics, as of human synergies, need few nodes; finer grids follow where one fails.
GRIDS = (Grid(1, 14), *(Grid(segments, 20) for segments in (1, 2, 4, 8)))
# A sharply bending path needs more segments to be represented than to be found.
_FINE_GRIDS = (Grid(16, 20), Grid(32, 20))
MAX_STEPS = 2000  # of one integration: hundreds suffice for the longest geodesics of an arm
ROUNDING = "rounding errors exceed the tolerance of its end point"
# Tolerance of a step: of the last integrations, of the first relative to them, the smallest.
STEP, _COARSER, _SMALLEST = 1e-12, 30.0, 1e-15
_ROUNDS, _CONTRACTION, _NEAR = 20, 0.5, 1e-5
# Error of the end point below which the integration's own error may be what remains.
_STALLED = 1e-3
_ROUNDED = 1e-6  # with the smallest tolerance of a step, it is rounding
_UNIT_INTERVAL = np.array([0.0, 1.0])
# Number of Newton steps, smallest damping factor, required reduction of the endpoint error by a
# full step, error from which corrections take over, integration tolerance until then.
_MAX_SHOTS, _MIN_DAMPING, _REDUCTION = 12, 0.05, 0.1
_CLOSE, _COARSE_STEP_TOLERANCE = 1e-7, 1e-9


@dataclass(frozen=True, eq=False)
class ConnectingGeodesic:
    """A geodesic from q0 to q1.

    Attributes:
        q0, q1: its ends (n,).
        velocity: the initial one (n,).
        nodes: number of nodes of the path from which it was found, 0 if from a velocity.
    """

    q0: Array
    q1: Array
    velocity: Array
    nodes: int = field(default=0, repr=False)

    @property
    def grids(self) -> tuple[Grid, ...]:
        """Grids on which it may be represented, from the coarsest."""
        grids = (*GRIDS, *_FINE_GRIDS)
        return tuple(grid for grid in grids if grid.size >= min(self.nodes, GRIDS[-1].size))


def find_by_shooting(metric: Metric, q0: Array, q1: Array, velocity: Array) -> ConnectingGeodesic:
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
            metric, q0, velocity, _COARSE_STEP_TOLERANCE, max_steps=MAX_STEPS
        )
        error = end - q1
        if np.abs(error).max() <= _CLOSE:
            inverse = np.asarray(np.linalg.inv(jacobian), dtype=float)
            corrected, _ = correct_velocity(metric, q0, q1, velocity, inverse)
            if corrected is not None:
                return ConnectingGeodesic(q0, q1, corrected)
            break
        step, damping = np.linalg.solve(jacobian, error), 1.0
        while damping > _MIN_DAMPING:
            try:
                trial = (
                    _end_point(metric, q0, velocity - damping * step, _COARSE_STEP_TOLERANCE) - q1
                )
            except IntegrationFailed:
                trial = np.full_like(error, np.inf)
            if np.linalg.norm(trial) <= (1.0 - _REDUCTION * damping) * np.linalg.norm(error):
                break
            damping /= 2.0
        else:
            break
        velocity = velocity - damping * step
    raise NotConverged(f"shooting from {q0} with {velocity} does not reach {q1}")


def correct_velocity(
    metric: Metric,
    q0: Array,
    q1: Array,
    velocity: Array,
    by_goal: Array,
) -> tuple[Array | None, str]:
    """Correct the velocity (n,) until Exp_q0(velocity) is q1, with its derivative by q1 (n, n).

    Corrections end at an endpoint error of `wanted_error`, or where they gain nothing and the error
    is at most TOLERANCE. The result was integrated with two different tolerances of the steps.

    Returns the velocity, or None and why there is none.
    """
    wanted, last, step, is_fine = wanted_error(q0, q1), np.inf, STEP, False
    before = change = np.zeros_like(velocity)
    for number in range(_ROUNDS):
        after_coarse, is_fine = not is_fine, last < _NEAR
        tolerance = step if is_fine else _COARSER * step
        try:
            difference = _end_point(metric, q0, velocity, tolerance) - q1
        except IntegrationFailed as failure:
            return None, _where(failure)
        error = float(np.abs(difference).max())
        if not (error < _CONTRACTION * last or error <= TOLERANCE):
            if not error < _STALLED or step <= _SMALLEST:
                if error < _ROUNDED:
                    return None, ROUNDING
                return None, f"integrated forward, it ends {error:.1e} from the goal"
            step = max(_SMALLEST, step / _COARSER)
        elif number:
            by_goal = _update(by_goal, difference - before, change)
        before, change = difference, -by_goal @ difference
        velocity = velocity + change
        if is_fine and error <= TOLERANCE and (error <= wanted or error >= _CONTRACTION * last):
            if step < STEP and not _survives_rounding(metric, q0, q1, velocity, step):
                return None, ROUNDING
            if after_coarse:
                return velocity, ""
            try:
                end = _end_point(metric, q0, velocity, _COARSER * step)
            except IntegrationFailed as failure:
                return None, _where(failure)
            verified = float(np.abs(end - q1).max()) / 2.0
            if verified <= TOLERANCE:
                return velocity, ""
            if step <= _SMALLEST:
                return None, ROUNDING
            step, error = max(_SMALLEST, step / _COARSER), _NEAR / 10.0
        last = error
    return None, f"integrated forward, it ends {last:.1e} from the goal"


def _survives_rounding(metric: Metric, q0: Array, q1: Array, velocity: Array, step: float) -> bool:
    """Whether the geodesic meets the goal also from a velocity changed by a few roundings."""
    change = 4.0 * np.spacing(np.abs(velocity))
    try:
        ends = [_end_point(metric, q0, velocity + s * change, step) for s in (-1.0, 1.0)]
    except IntegrationFailed:
        return False
    return bool(np.abs(np.array(ends) - q1).max() <= TOLERANCE)


def _end_point(metric: Metric, q0: Array, velocity: Array, tolerance: float) -> Array:
    positions, _ = integrate_geodesic(
        metric, q0, velocity, _UNIT_INTERVAL, tolerance, max_steps=MAX_STEPS
    )
    return np.asarray(positions[-1])


def _where(failure: IntegrationFailed) -> str:
    place = "" if failure.time is None else f" at s = {failure.time:.3g}"
    return f"its integration fails{place}"


def _update(inverse: Array, difference: Array, change: Array) -> Array:
    """Broyden's second update of the inverse derivative."""
    along, row = inverse @ difference, change @ inverse
    product = float(change @ along)
    if abs(product) <= 0.1 * float(change @ change):
        return inverse
    return inverse + np.outer(change - along, row) / product


def wanted_error(q0: Array, q1: Array) -> float:
    """Endpoint error at which corrections of a geodesic from q0 to q1 end [rad or m].

    Short geodesics are corrected down to rounding: their direction counts, too.
    """
    return CHECK_TOLERANCE * min(1.0, float(np.abs(q1 - q0).max()))
