"""Several geodesics between two configurations, from several starts.

The first start is the straight line. Where coordinates have a period, straight lines to goals a
period away follow, the nearest first. The rest takes turns: a path through a random waypoint, which
leads to a geodesic of locally least energy, and shooting with the disturbed or reversed velocity of
a geodesic that was found, which leads to any, also to those that are no minimum.
"""

from __future__ import annotations

import operator
from itertools import product

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.geodesics.single_start import Found, from_path, from_velocity
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

# Two geodesics are one if their initial velocities differ by less than this share.
_SAME = 1e-6
_GRID = Grid(1, 20)  # of guesses
_WAYPOINT = (0.3, 2.0)  # its distance from the straight line, in units of the ends' distance
_DISTURBANCE = (0.03, 0.3)  # of a velocity, in units of its norm
_WAY_BACK = (0.5, 8.0)  # its length, in units of the way forth
_MOST = 6  # coordinates that are taken one more period either way
_EQUAL = 1e-6


def search(metric: Metric, q0: Array, q1: Array, num_starts: int, seed: int) -> list[Found]:
    """The distinct geodesics that were found from so many starts, shortest first.

    Raises:
        ValueError: num_starts is not a positive integer, seed not a natural number, or the metric's
            periods are wrong.
        NotConverged: none was found.
    """
    count = _natural("num_starts", num_starts, 1)
    seed = _natural("seed", seed, 0)
    if count == 1:
        return [from_path(metric, q0, q1, None)]
    rng = np.random.default_rng(seed)
    goals = _goals(metric, q0, q1)[:count]
    found: list[Found] = []
    failures: list[NotConverged | ValueError] = []
    for number in range(count):
        try:
            if number < len(goals):
                one = from_path(metric, q0, goals[number], None, patient=number == 0)
            elif (number - len(goals)) % 3 < 2 or not found:
                if (number - len(goals)) % 3 == 0:
                    goal, aside = goals[int(rng.integers(len(goals)))], _waypoint(metric, rng)
                else:
                    aside = -aside  # the other way round
                one = from_path(metric, q0, goal, _detour(metric, q0, goal, aside), patient=False)
            else:
                near = found[int(rng.integers(len(found)))]
                goal, velocity = near.q1, _disturbed(metric, near, rng)
                if len(goals) > 1 and (number - len(goals)) % 2:
                    # Where space comes round, the way back leads there, too.
                    goal = goals[int(rng.integers(len(goals)))]
                    velocity = -np.exp(rng.uniform(*np.log(_WAY_BACK))) * near.velocity
                one = from_velocity(metric, q0, goal, velocity)
        except (NotConverged, ValueError) as failure:
            failures.append(failure)
            continue
        if not any(_same(metric, one, other) for other in found):
            found.append(one)
    if not found:
        raise NotConverged(
            f"no geodesic was found from any of {count} starts. From the straight line: "
            f"{failures[0]}. From the last: {failures[-1]}",
            getattr(failures[0], "solution", None),
        )
    return sorted(found, key=lambda one: float(metric.norm(q0, one.velocity)))


def _natural(name: str, value: object, least: int) -> int:
    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        number = least - 1
    if number < least:
        kind = "a positive integer" if least else "an integer, not negative"
        raise ValueError(f"{name} must be {kind}, got {value!r}")
    return number


def _periods(metric: Metric) -> Array:
    """The metric's periods (n,), checked."""
    if metric.periods is None:
        return np.full(metric.dim, np.inf)
    try:
        periods = np.array(metric.periods, dtype=float)
    except (TypeError, ValueError):
        periods = np.zeros(0)
    if periods.shape != (metric.dim,) or not np.all(periods > 0.0):
        raise ValueError(
            f"{type(metric).__name__}.periods must be {metric.dim} positive numbers (inf where a "
            f"coordinate does not come round), got {metric.periods!r}"
        )
    return periods


def _goals(metric: Metric, q0: Array, q1: Array) -> list[Array]:
    """The goal, then the same whole periods away, as straight lines at q0 are long."""
    periods = _periods(metric)
    turning = np.flatnonzero(np.isfinite(periods))
    nearest = q1.copy()
    nearest[turning] -= periods[turning] * np.round((q1 - q0)[turning] / periods[turning])
    # Of very many, those that are the nearest to half a period away matter most.
    doubtful = turning[np.argsort(-np.abs((nearest - q0)[turning] / periods[turning]))][:_MOST]
    goals = [q1]
    for turns in product((0, -1, 1), repeat=doubtful.size):
        goal = nearest.copy()
        goal[doubtful] += np.array(turns, dtype=float) * periods[doubtful]
        if not np.array_equal(goal, q1):
            goals.append(goal)
    _check_periods(metric, q1, periods)
    return [q1, *sorted(goals[1:], key=lambda goal: float(metric.norm(q0, goal - q0)))]


def _check_periods(metric: Metric, q1: Array, periods: Array) -> None:
    here = metric.matrix(q1)
    size = np.abs(here).max()
    for coordinate in np.flatnonzero(np.isfinite(periods)):
        there = q1.copy()
        there[coordinate] += periods[coordinate]
        if not np.abs(metric.matrix(there) - here).max() <= _EQUAL * size:
            raise ValueError(
                f"{type(metric).__name__}.periods: the metric is not the same at {q1} and "
                f"{periods[coordinate]:g} further in q[{coordinate}]"
            )


def _waypoint(metric: Metric, rng: np.random.Generator) -> Array:
    """A random place beside the middle of the straight line, in units of the ends' distance."""
    direction = rng.normal(size=metric.dim)
    size = np.exp(rng.uniform(*np.log(_WAYPOINT)))
    return np.asarray(size / np.linalg.norm(direction) * direction)


def _detour(metric: Metric, q0: Array, q1: Array, aside: Array) -> Path:
    """A parabola from end to end whose middle is the waypoint."""
    s = _GRID.nodes[:, None]
    bulge = 4.0 * s * (1.0 - s) * np.linalg.norm(q1 - q0) * aside
    return Path(metric, _GRID, q0 + s * (q1 - q0) + bulge)


def _disturbed(metric: Metric, near: Found, rng: np.random.Generator) -> Array:
    """The velocity plus a random one of some share of its norm."""
    direction = rng.normal(size=metric.dim)
    share = np.exp(rng.uniform(*np.log(_DISTURBANCE)))
    size = metric.norm(near.q0, near.velocity) / metric.norm(near.q0, direction)
    return np.asarray(near.velocity + share * size * direction)


def _same(metric: Metric, one: Found, other: Found) -> bool:
    difference = metric.norm(one.q0, one.velocity - other.velocity)
    return bool(difference <= _SAME * metric.norm(one.q0, one.velocity))
