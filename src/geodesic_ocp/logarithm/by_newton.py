"""Newton's method for a geodesic between two configurations, and corrections by shooting.

The NLP of `PointToPoint` without Ipopt: positions at Gauss-Lobatto nodes, the energy by a finer
Gauss quadrature. Coarse grids cost little and lead to the neighbourhood of a minimum, the finer
ones to a path whose initial velocity, from the momentum at its fixed first node, v0 = -G(q0)^-1
dE/dq0 (the discrete Legendre transform of Marsden and West, Acta Numerica 2001), ends near the
goal; a few integrations correct it, with the derivative dv0/dq1 from the Hessian. The compiled core
does all of it in one call; without a compiler, Ipopt finds geodesics (`by_ipopt`), and the
corrections of core/logarithm.h are those in NumPy here.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import IntegrationFailed, NotConverged
from geodesic_ocp.manifold.exp import exp_with_derivative, integrate_geodesic, sample_geodesic
from geodesic_ocp.manifold.kernels import Level, LogMaps, Tolerances
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

# Every geodesic ends this close to its goal when integrated, in every coordinate [rad or m].
TOLERANCE = 1e-9
CHECK_TOLERANCE = 1e-10  # of that integration
# Short geodesics, as of human synergies, need few nodes; finer grids follow where one fails.
GRIDS = (Grid(1, 14), *(Grid(segments, 20) for segments in (1, 2, 4, 8)))
# A sharply bending path needs more segments to be represented than to be found.
_FINE_GRIDS = (Grid(16, 20), Grid(32, 20))
MAX_STEPS = 2000  # of one integration: hundreds suffice for the longest geodesics of an arm
_FAR = "integrated forward, it ends {:.1e} from the goal"
ROUNDING = "rounding errors exceed the tolerance of its end point"
# Tolerance of a step: of the last integrations, of the first relative to them, the smallest.
STEP = 1e-12
_COARSER = 30.0
_SMALLEST = 1e-15
_ROUNDS = 20
_CONTRACTION = 0.5
_NEAR = 1e-5
# Error of the end point below which the integration's own error may be what remains.
_STALLED = 1e-3
_ROUNDED = 1e-6  # with the smallest tolerance of a step, it is rounding
_UNIT_INTERVAL = np.array([0.0, 1.0])
# Number of Newton steps, smallest damping factor, required reduction of the endpoint error by a
# full step, error from which corrections take over, integration tolerance until then.
_MAX_SHOTS = 12
_MIN_DAMPING = 0.05
_REDUCTION = 0.1
_CLOSE = 1e-7
_COARSE_TOLERANCE = 1e-9
# Samples of the straight line, and the ratio of the largest to the smallest diagonal entry of the
# metric that is worth reporting.
_SAMPLES = 21
_LARGE_RATIO = 1e4
# Relative decrease of the energy by a Newton step at which a level is left, and most steps on it:
# of a coarse level, of a fine one.
_COARSE_LEVEL = (1e-2, 8)
_FINE_LEVEL = (1e-10, 40)


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


@dataclass(frozen=True, eq=False)
class Levels:
    """Grids of increasing size; on those from index `first` on, solutions are corrected."""

    first: int
    grids: tuple[Grid, ...]

    @cached_property
    def _arrays(self) -> list[dict[str, Array]]:
        pairs = zip(self.grids, (None, *self.grids[:-1]), strict=True)
        return [_tables(grid, coarser) for grid, coarser in pairs]

    @cached_property
    def structures(self) -> ctypes.Array[Level]:
        """The tables as the compiled core takes them."""
        result = (Level * len(self.grids))()
        for number, (level, grid) in enumerate(zip(result, self.grids, strict=True)):
            level.segments = grid.segments
            level.degree = grid.degree
            level.points = grid.quadrature.weights.shape[1]
            for name, table in self._arrays[number].items():
                setattr(level, name, table.ctypes.data)
            rule = _COARSE_LEVEL if number < self.first else _FINE_LEVEL
            level.decrease, level.max_steps = rule
        return result


def _tables(grid: Grid, coarser: Grid | None) -> dict[str, Array]:
    """Get the constants of core/energy.h: quadrature, products of pairs of nodes, interpolation."""
    quadrature = grid.quadrature
    weights = quadrature.weights[0]
    values = quadrature.values
    slopes = quadrature.slopes[0]
    b, a = np.tril_indices(grid.degree + 1)
    factors = ((values, values), (values, slopes), (slopes, values), (slopes, slopes))
    products = [(weights[:, None] * one[:, a] * other[:, b]).T for one, other in factors]
    refine = np.zeros((0, 0))
    if coarser is not None:
        refine = coarser.interpolate(coarser.in_segments(np.eye(coarser.size)), grid.nodes)
    tables = {"weights": weights, "values": values, "slopes": slopes, "refine": refine}
    tables["products"] = np.array(products)
    return {name: np.ascontiguousarray(table) for name, table in tables.items()}


def _levels(first: int, *grids: tuple[int, int]) -> Levels:
    """Return levels of grids given by (segments, degree)."""
    return Levels(first, tuple(Grid(*each) for each in grids))


_LEVELS = _levels(2, (1, 5), (1, 10), (1, 18), (1, 28), (2, 20), (4, 20))
# Where these fail, other coarse grids often lead to another minimum, and so does continuation.
_OTHER_LEVELS = (
    _levels(2, (1, 6), (1, 12), (1, 20), (1, 30), (2, 20), (4, 20)),
    _levels(2, (1, 8), (1, 16), (1, 24), (2, 20), (4, 20), (8, 20)),
)
_CONTINUED = _levels(1, (1, 12), (1, 20), (1, 30), (2, 20), (4, 20), (8, 20))
# On the geodesic of a relaxed metric; sharp turns need fine grids.
_RELAXED = _levels(0, (2, 20), (4, 20), (8, 20), (16, 20))
# Multiples of the diagonal of G(q0) that are added to G, from large to small.
_ADDED = (10.0, 3.0, 1.0, 0.3, 0.1, 0.03, 0.01, 0.003, 0.001)
# Paths through random points: number, and offset from the straight line relative to its length.
_WAYPOINTS = 4
_OFFSET = (0.2, 1.0)
_STATUS = {
    11: "the energy has no minimum nearby, or Newton's method needs more steps",
    12: "the Hessian of the energy is not finite",
    13: "no step decreases the energy",
    14: "the metric is not finite along the path",
    20: "its integration fails",
    21: "integrated forward, it does not end at the goal",
    22: ROUNDING,
}


class NewtonAttempt(NamedTuple):
    """Result of one pass through the levels: a velocity, or None and why; the last path."""

    velocity: Array | None
    grid: Grid
    nodes: Array
    reason: str


def find_by_newton(
    metric: Metric, q0: Array, q1: Array, guess: Path | None, *, thorough: bool = True
) -> ConnectingGeodesic:
    """Return the geodesic of locally minimal energy near a path, or near the straight line.

    Args:
        metric: metric of the manifold; its tensor is not constant, and its functions are compiled.
        q0, q1: the ends (n,), not the same.
        guess: a path between them; None is the straight line.
        thorough: where the first pass fails, try other coarse grids, the geodesic of the relaxed
            metric, a continuation in a diagonal added to G, the way back, and paths through random
            points: always as many attempts, so that what is found does not depend on the machine.

    Raises:
        NotConverged: none was found; `solution` is the path on which the first attempt ended.
        ValueError: the metric is not defined along the straight line.
    """
    reasons: list[str] = []
    last: NewtonAttempt | None = None
    for attempt in _attempts(metric, q0, q1, guess, thorough):
        if attempt.velocity is not None:
            return ConnectingGeodesic(q0, q1, attempt.velocity)
        if not reasons:
            check_straight_line(metric, q0, q1, guess)
        last = last or attempt
        reasons.append(attempt.reason)
    assert last is not None
    if ROUNDING in reasons:
        cause = "geodesics diverge so fast that rounding errors exceed 1e-9 at the goal"
    else:
        cause = likely_cause(metric, last.nodes)
    raise NotConverged(
        f"no geodesic was found from {q0} to {q1}: {cause} ({reasons[0]}; number of attempts: "
        f"{len(reasons)})",
        Path(metric, last.grid, last.nodes) if np.all(np.isfinite(last.nodes)) else None,
    )


def find_many_by_newton(
    metric: Metric, q0: Array, q1: Array, offsets: Array | None = None
) -> LogMaps | None:
    """Return initial velocities of geodesics between k pairs, (k, n) each, all at once.

    They are those of the first attempt of `find_by_newton`; NaN where it fails. None where the
    compiled library cannot do it.

    Args:
        metric: see `find_by_newton`.
        q0, q1: the ends.
        offsets: (k, n), of the middle of each first path from the straight line. All q0 are the
            same then, all q1 up to whole periods, and the shortest geodesic is sought: starts are
            given up where the path on a coarse grid is longer or the same as another.
    """
    x = q0[:, None] + _LEVELS.grids[0].nodes[:, None] * (q1 - q0)[:, None]
    if offsets is not None:
        x += bulge(_LEVELS.grids[0]) * offsets[:, None]
    return metric.kernels.log_maps(
        q0,
        q1,
        x,
        _LEVELS.structures,
        _LEVELS.first,
        Tolerances(STEP, 0.0, TOLERANCE),
        np.array([wanted_error(*pair) for pair in zip(q0, q1, strict=True)]),
        offsets is not None,
    )


def bulge(grid: Grid) -> Array:
    """Return 4 s (1 - s) at the nodes s of a grid, (k, 1)."""
    s = grid.nodes[:, None]
    return np.asarray(4.0 * s * (1.0 - s))


def _attempts(
    metric: Metric, q0: Array, q1: Array, guess: Path | None, thorough: bool, relax: bool = True
) -> Iterator[NewtonAttempt]:
    yield _pass(metric, q0, q1, _LEVELS, _start(_LEVELS, q0, q1, guess))
    if not thorough:
        return
    for levels in _OTHER_LEVELS:
        yield _pass(metric, q0, q1, levels, _start(levels, q0, q1, guess))
    if relax and metric.relaxed is not None:
        attempts = _attempts(metric.relaxed, q0, q1, guess, thorough, relax=False)
        if easier := next((each for each in attempts if each.velocity is not None), None):
            path = Path(metric, easier.grid, easier.nodes)
            yield _pass(metric, q0, q1, _RELAXED, _start(_RELAXED, q0, q1, path))
    added = np.outer(_ADDED, np.diag(metric.matrix(q0)))
    yield _pass(metric, q0, q1, _CONTINUED, _start(_CONTINUED, q0, q1, guess), added)
    yield _back(metric, q0, q1, guess)
    rng = np.random.default_rng(0)
    for _ in range(_WAYPOINTS):
        direction = rng.normal(size=metric.dim)
        size = np.exp(rng.uniform(*np.log(_OFFSET))) * np.linalg.norm(q1 - q0)
        offset = size * direction / np.linalg.norm(direction)
        grid = _LEVELS.grids[0]
        x = q0 + grid.nodes[:, None] * (q1 - q0) + bulge(grid) * offset
        yield _pass(metric, q0, q1, _LEVELS, x)


def _back(metric: Metric, q0: Array, q1: Array, guess: Path | None) -> NewtonAttempt:
    """Return the geodesic from q1 to q0, traversed backwards."""
    back = _pass(metric, q1, q0, _LEVELS, _start(_LEVELS, q0, q1, guess)[::-1])
    result = back._replace(nodes=back.nodes[::-1], velocity=None)
    if back.velocity is None:
        return result
    try:
        return result._replace(velocity=traversed_backwards(metric, q0, q1, back.velocity).velocity)
    except NotConverged as failure:
        return result._replace(reason=str(failure))


def traversed_backwards(
    metric: Metric, q0: Array, q1: Array, velocity: Array
) -> ConnectingGeodesic:
    """Return the geodesic from q0 to q1 along that from q1 to q0, with its initial velocity (n,).

    Raises:
        NotConverged: integrated from q0, it does not end at q1.
    """
    try:
        _, velocities = sample_geodesic(metric, q1, velocity, _UNIT_INTERVAL)
    except IntegrationFailed as failure:
        raise NotConverged(f"the geodesic from {q1} to {q0}: {failure}") from None
    return find_by_shooting(metric, q0, q1, -velocities[-1])


def _start(levels: Levels, q0: Array, q1: Array, guess: Path | None) -> Array:
    """Return nodes on the first level of the guess, or of the straight line."""
    s = levels.grids[0].nodes
    if guess is None:
        return np.asarray(q0 + s[:, None] * (q1 - q0))
    nodes = guess(s)
    nodes[0] = q0
    nodes[-1] = q1
    return nodes


def _pass(
    metric: Metric, q0: Array, q1: Array, levels: Levels, x: Array, added: Array | None = None
) -> NewtonAttempt:
    """Return all levels from coarse to fine, from nodes x on the first."""
    velocity, nodes, status, statistics = metric.kernels.log_map(
        q0,
        q1,
        x,
        levels.structures,
        levels.first,
        Tolerances(STEP, wanted_error(q0, q1), TOLERANCE),
        added,
    )
    grid = levels.grids[statistics.level]
    return NewtonAttempt(velocity if status == 0 else None, grid, nodes, _STATUS.get(status, ""))


def check_straight_line(metric: Metric, q0: Array, q1: Array, guess: Path | None) -> None:
    """Raise ValueError if the metric is not finite, or not positive, along the initial guess."""
    s = np.linspace(0.0, 1.0, _SAMPLES)
    samples = q0 + s[:, None] * (q1 - q0) if guess is None else guess(s)
    metric.check_domain_along("the guess", s, samples)
    for q in samples:
        tensor = metric.matrix(q)
        if not (np.all(np.isfinite(tensor)) and np.all(np.diag(tensor) > 0.0)):
            raise ValueError(f"the metric is not finite and positive along the guess: at {q}")


def likely_cause(metric: Metric, nodes: Array) -> str:
    """Return a singularity that the last path (k, n) passes, or what else the cause may be."""
    return singularity_along(metric, nodes) or (
        "no path from any of the attempts led to one; the goal may lie at a conjugate point"
    )


def singularity_along(metric: Metric, nodes: Array) -> str:
    """Return a singularity or a boundary that a path (k, n) passes; empty if there is none."""
    finite = nodes[np.all(np.isfinite(nodes), axis=1)]
    for sample in finite:
        if cause := metric.near_singularity(sample):
            return cause
    sizes = np.array([np.diag(metric.matrix(sample)) for sample in finite])
    ratios = sizes.max(axis=0) / sizes.min(axis=0)
    if ratios.max() > _LARGE_RATIO:
        worst = int(np.argmax(ratios))
        names = metric.coordinate_names
        low, high = (finite[pick(sizes[:, worst])] for pick in (np.argmin, np.argmax))
        return (
            f"between {low} and {high} the squared length along {names[worst]} grows by "
            f"{ratios[worst]:.0e}: one of them is near a singularity or a boundary"
        )
    return ""


def find_by_shooting(metric: Metric, q0: Array, q1: Array, velocity: Array) -> ConnectingGeodesic:
    """Return the geodesic that shooting finds from an initial velocity, of minimal energy or not.

    Raises:
        NotConverged: Newton's method found no geodesic that ends at q1.
    """
    try:
        return _shoot(metric, q0, q1, velocity)
    except (IntegrationFailed, np.linalg.LinAlgError) as failure:
        raise NotConverged(f"shooting from {velocity}: {failure}") from None


def _shoot(metric: Metric, q0: Array, q1: Array, velocity: Array) -> ConnectingGeodesic:
    """Return Newton's method with step halving."""
    for _ in range(_MAX_SHOTS):
        end, jacobian = exp_with_derivative(metric, q0, velocity, max_steps=MAX_STEPS)
        error = end - q1
        if np.abs(error).max() <= _CLOSE:
            inverse = np.asarray(np.linalg.inv(jacobian), dtype=float)
            corrected, _ = correct_velocity(metric, q0, q1, velocity, inverse)
            if corrected is not None:
                return ConnectingGeodesic(q0, q1, corrected)
            break
        step = np.linalg.solve(jacobian, error)
        damping = 1.0
        while damping > _MIN_DAMPING:
            try:
                changed = velocity - damping * step
                missed = _end_point(metric, q0, changed, _COARSE_TOLERANCE) - q1
            except IntegrationFailed:
                missed = np.full_like(error, np.inf)
            if np.linalg.norm(missed) <= (1.0 - _REDUCTION * damping) * np.linalg.norm(error):
                break
            damping /= 2.0
        else:
            break
        velocity = velocity - damping * step
    raise NotConverged(f"shooting from {q0} with {velocity} does not reach {q1}")


def correct_velocity(
    metric: Metric, q0: Array, q1: Array, velocity: Array, by_goal: Array
) -> tuple[Array | None, str]:
    """Correct the velocity (n,) until Exp_q0(velocity) is q1, with its derivative by q1 (n, n).

    Corrections end at an endpoint error of `wanted_error`, or where they gain nothing and the error
    is at most TOLERANCE. The result was integrated with two different tolerances of the steps.

    Returns the velocity, or None and why there is none.
    """
    wanted = wanted_error(q0, q1)
    last = np.inf
    step = STEP
    is_fine = False
    before = change = np.zeros_like(velocity)
    try:
        for number in range(_ROUNDS):
            after_coarse = not is_fine
            is_fine = last < _NEAR
            tolerance = step if is_fine else _COARSER * step
            difference = _end_point(metric, q0, velocity, tolerance) - q1
            error = float(np.abs(difference).max())
            if not (error < _CONTRACTION * last or error <= TOLERANCE):
                if not error < _STALLED or step <= _SMALLEST:
                    return None, ROUNDING if error < _ROUNDED else _FAR.format(error)
                step = max(_SMALLEST, step / _COARSER)
            elif number:
                by_goal = _update(by_goal, difference - before, change)
            before = difference
            change = -by_goal @ difference
            velocity = velocity + change
            if is_fine and error <= TOLERANCE and (error <= wanted or error >= _CONTRACTION * last):
                if step < STEP and not _survives_rounding(metric, q0, q1, velocity, step):
                    return None, ROUNDING
                end = q1 if after_coarse else _end_point(metric, q0, velocity, _COARSER * step)
                if np.abs(end - q1).max() / 2.0 <= TOLERANCE:
                    return velocity, ""
                if step <= _SMALLEST:
                    return None, ROUNDING
                step = max(_SMALLEST, step / _COARSER)
                error = _NEAR / 10.0
            last = error
    except IntegrationFailed as failure:
        place = "" if failure.time is None else f" at s = {failure.time:.3g}"
        return None, f"its integration fails{place}"
    return None, _FAR.format(last)


def _survives_rounding(metric: Metric, q0: Array, q1: Array, velocity: Array, step: float) -> bool:
    """Return whether the geodesic meets the goal also after rounding of its velocity."""
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


def _update(inverse: Array, difference: Array, change: Array) -> Array:
    """Return Broyden's second update of the inverse derivative."""
    along = inverse @ difference
    row = change @ inverse
    product = float(change @ along)
    if abs(product) <= 0.1 * float(change @ change):
        return inverse
    return inverse + np.outer(change - along, row) / product


def wanted_error(q0: Array, q1: Array) -> float:
    """Return endpoint error at which corrections of a geodesic from q0 to q1 end [rad or m].

    Short geodesics are corrected down to rounding: their direction counts, too.
    """
    return CHECK_TOLERANCE * min(1.0, float(np.abs(q1 - q0).max()))
