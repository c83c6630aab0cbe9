"""Several geodesics between two configurations, from several starts.

The first start is the straight line. Where coordinates have a period, straight lines to goals a
period away follow, the nearest first. The rest takes turns: a path through a random waypoint, which
leads to a geodesic of locally least energy, and shooting with the disturbed velocity of a geodesic
that was found, which leads to any, also to those that are no minimum.
"""

from __future__ import annotations

import operator
from itertools import product

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.ocp.grid import Grid
from geodesic_ocp.ocp.path import Path
from geodesic_ocp.ocp.search import Found, from_path, from_velocity

# Two geodesics are one if their initial velocities differ by less than this share.
_SAME = 1e-6
_GRID = Grid(1, 20)  # of guesses
_WAYPOINT = (0.3, 2.0)  # its distance from the straight line, in units of the ends' distance
_DISTURBANCE = (0.03, 0.3)  # of a velocity, in units of its norm
_MOST_GOALS = 1000


def search(metric: Metric, q0: Array, q1: Array, starts: int, seed: int) -> list[Found]:
    """The distinct geodesics that were found from so many starts, shortest first.

    Raises:
        ValueError: starts is not a positive integer.
        NotConverged: none was found.
    """
    try:
        count = operator.index(starts)
    except TypeError:
        count = 0
    if count < 1:
        raise ValueError(f"starts must be a positive integer, got {starts!r}")
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
                one = from_velocity(metric, q0, near.q1, _disturbed(metric, near, rng))
        except (NotConverged, ValueError) as failure:
            failures.append(failure)
            continue
        if not any(_same(metric, one, other) for other in found):
            found.append(one)
    if not found:
        raise NotConverged(
            f"no geodesic was found from any of {starts} starts; from the straight line: "
            f"{failures[0]}",
            getattr(failures[0], "solution", None),
        )
    return sorted(found, key=lambda one: float(metric.norm(q0, one.velocity)))


def _goals(metric: Metric, q0: Array, q1: Array) -> list[Array]:
    """The goal, and the same a period away, nearest to q0 first as straight lines at q0 go."""
    periods = np.full(metric.dim, np.inf) if metric.periods is None else np.array(metric.periods)
    turning = np.flatnonzero(np.isfinite(periods))
    goals = []
    for turns in product((0, -1, 1), repeat=min(turning.size, 6)):
        goal = q1.copy()
        goal[turning[: len(turns)]] += np.array(turns, dtype=float) * periods[turning[: len(turns)]]
        goals.append(goal)
    others = sorted(goals[1:], key=lambda goal: float(metric.norm(q0, goal - q0)))
    return [goals[0], *others[:_MOST_GOALS]]


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
