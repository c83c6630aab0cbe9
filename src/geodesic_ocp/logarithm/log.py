"""The logarithmic map, and geodesics from many starts.

Without constraints, Newton's method on the discrete energy finds one in milliseconds (`by_newton`);
Ipopt solves the same NLP, as reference and where there is no compiler (`by_ipopt`). The argument
`solver`, or the environment variable GEODESIC_OCP_SOLVER, chooses.

The first guess is the straight line. Where coordinates are periodic, it leads to the nearest image
of the goal, and straight lines to other images follow (`images`). The remaining guesses alternate
between a path through a random waypoint, which leads to a geodesic of locally minimal energy, and
shooting with the perturbed or reversed velocity of a geodesic found before, which can lead to any
geodesic, including those that are not minimal.
"""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_choice, as_integer
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.logarithm.by_ipopt import find_by_ipopt
from geodesic_ocp.logarithm.by_newton import (
    ConnectingGeodesic,
    bulge,
    find_by_newton,
    find_by_shooting,
    find_many_by_newton,
    traversed_backwards,
)
from geodesic_ocp.logarithm.images import all_images, near_images
from geodesic_ocp.manifold.kernels import LogMaps
from geodesic_ocp.manifold.metric import Metric, as_metric, in_threads, over_rows
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

SOLVERS = ("newton", "ipopt")
ENVIRONMENT_VARIABLE = "GEODESIC_OCP_SOLVER"
# Between points this close, relative to their coordinates, node positions have too few digits for
# Newton's method; the logarithm is their difference and a small correction.
_NEARBY = 1e-5
# Agreement of the correction by one step and by two, relative to the distance: rounding.
_AGREEMENT = 1e-14
_CORRECTIONS = 4
# Two geodesics are the same if their initial velocities differ by less than this, relatively.
_SAME = 1e-6
_GRID = Grid(1, 20)  # of initial guesses
_WAYPOINT = (0.3, 2.0)  # range of its offset from the straight line, relative to |q1 - q0|
_PERTURBATION = (0.03, 0.3)  # range of a velocity's perturbation, relative to its norm
_REVERSED = (0.5, 8.0)  # range of a reversed velocity's norm, relative to that of the original
_BLOCK = 64  # pairs whose geodesics are found at once


def _logs(
    count: int,
    metric: Metric,
    q0: ArrayLike,
    q1: ArrayLike,
    num_starts: int = 1,
    seed: int = 0,
    solver: str | None = None,
    wrap: bool = True,
    throw: bool = True,
) -> dict[int, Array]:
    """Return velocities of `log` of those rows for which all at once find them."""
    del throw
    if num_starts != 1 or seed != 0 or as_solver(solver) == "ipopt":
        return {}
    ends = [np.asarray(each) for each in (q0, q1)]

    def of_block(block: int) -> dict[int, Array]:
        rows: list[int] = []
        starts: list[Array] = []
        goals: list[Array] = []
        for row in range(block * _BLOCK, min(count, (block + 1) * _BLOCK)):
            with suppress(ValueError):  # which the row itself raises, with its number
                start, goal = (
                    metric.point(name, each[row] if each.ndim == 2 else each)
                    for name, each in zip(("q0", "q1"), ends, strict=True)
                )
                near = near_images(metric, start, goal) if wrap else [goal]
                if not are_nearby(start, near[0]):
                    rows += [row] * len(near)
                    starts += [start] * len(near)
                    goals += near
        if not rows:
            return {}
        every = find_many_by_newton(metric, np.array(starts), np.array(goals))
        if every is None:
            return {}
        found: dict[int, list[ConnectingGeodesic]] = {}
        failed: set[int] = set()
        for row, start, goal, velocity in zip(rows, starts, goals, every.velocities, strict=True):
            if np.all(np.isfinite(velocity)):
                found.setdefault(row, []).append(ConnectingGeodesic(start, goal, velocity))
            elif row not in found:  # its first image, to which the row itself searches thoroughly
                failed.add(row)
        return {
            row: _shortest(metric, each).velocity
            for row, each in found.items()
            if row not in failed
        }

    blocks = in_threads(of_block, -(-count // _BLOCK))
    return {row: velocity for block in blocks for row, velocity in block.items()}


@partial(over_rows, many=_logs)
def log(
    metric: Metric,
    q0: ArrayLike,
    q1: ArrayLike,
    *,
    num_starts: int = 1,
    seed: int = 0,
    solver: str | None = None,
    wrap: bool = True,
    throw: bool = True,
) -> Array:
    """Return Log_q0(q1): the velocity v0 (n,) with Exp_q0(v0) = q1.

    Where several geodesics connect the two points, the shortest of those found from `num_starts`
    initial paths, of which the first is the straight line, and others pass through random
    waypoints. With the default of one, the geodesic is locally minimizing, but on 8 % of wide
    random pairs of a human arm or a Panda not the shortest known (docs/explanation/mathematics.md).
    With 20, all but 1 of 400 were the shortest known; they take as long as 4 to 13 single ones.

    The end point Exp_q0(v0) equals q1 to 1e-9 in every coordinate, up to whole periods of the
    metric's coordinates (`Metric.periods`): continuous joints turn the shorter way, from 3.0 to
    -3.0 rad by 0.28 rad. Of the images of q1 those with nearly the shortest straight line are
    compared. For k points (k, n) at either end or both: k velocities (k, n), found all at once
    where the system's compiler is GCC, in half the time; they are those of single calls to 1e-10.

    >>> metric = go.KineticEnergy(go.human_arm())
    >>> q0 = [0.0, 0.1, -0.5, 0.8, 0.0, 0.0, 0.0]
    >>> q1 = [0.6, 0.2, -0.9, 1.4, 0.1, 0.2, 0.1]
    >>> v0 = go.log(metric, q0, q1)
    >>> v0.round(3)
    array([ 0.035, -0.141, -0.488,  2.169,  0.438, -2.102,  0.88 ])
    >>> go.exp(metric, q0, v0).round(6)
    array([ 0.6,  0.2, -0.9,  1.4,  0.1,  0.2,  0.1])

    Args:
        metric: metric of the manifold.
        q0, q1: configurations (n,) [rad or m], or k of them (k, n) for one or both.
        num_starts: number of initial paths; the first is the straight line.
        seed: seed of the random waypoints of the others.
        solver: "newton", which takes milliseconds, or "ipopt", the reference; None takes the
            environment variable GEODESIC_OCP_SOLVER, or "newton". Both minimize the same discrete
            energy.
        wrap: whether continuous joints, and other periodic coordinates, may end whole periods away
            from q1; with False they turn from q0 to q1 as given, also the longer way around.
        throw: raise NotConverged; else velocities that are not found are NaN, and a warning names
            their rows.

    Raises:
        ValueError: wrong shapes, numbers that are not finite, wrong `periods` of the metric, or,
            with one start, a straight line along which the metric is not defined.
        NotConverged: no geodesic was found, or it does not end at q1 when integrated forward.
    """
    del throw  # of `over_rows`
    return find_shortest(
        metric, q0, q1, num_starts=num_starts, seed=seed, solver=solver, wrap=wrap
    ).velocity


def find_shortest(
    metric: Metric,
    q0: ArrayLike,
    q1: ArrayLike,
    *,
    num_starts: int,
    seed: int,
    solver: str | None = None,
    wrap: bool = True,
) -> ConnectingGeodesic:
    """Return the shortest of the geodesics to which `num_starts` initial paths lead.

    Straight lines to the images of the goal that are probably nearest count as one start together.
    Of the others, up to half are straight lines to further images; then follow paths through random
    waypoints, each followed by the one on the other side.

    Raises:
        ValueError, NotConverged: see `find_geodesics`.
    """
    metric = as_metric(metric)
    solver = as_solver(solver)
    start = metric.point("q0", q0)
    goal = metric.point("q1", q1)
    count = as_integer("num_starts", num_starts, 1)
    rng = np.random.default_rng(as_integer("seed", seed, 0))
    near = near_images(metric, start, goal) if wrap else [goal]
    if count == 1:
        return _straight_line(metric, start, near, solver)
    every = partial(
        find_geodesics, metric, start, goal, num_starts=count, seed=seed, solver=solver, wrap=wrap
    )
    if metric.has_constant_tensor or are_nearby(start, near[0]):
        return every()[0]
    images = all_images(metric, start, goal) if wrap else near
    goals = images[: max(len(near), count // 2)]
    offsets = [np.zeros(metric.dim)] * len(goals)
    for number in range(count - 1 - (len(goals) - len(near))):
        if number % 2 == 0:
            goals.append(goals[int(rng.integers(len(goals)))])
            size = np.linalg.norm(goals[-1] - start)
            offsets.append(size * _random_direction(metric, rng, _WAYPOINT))
        else:
            goals.append(goals[-1])
            offsets.append(-offsets[-1])
    found = _from_offsets(metric, start, np.array(goals), np.array(offsets), solver)
    # Starts are given up on coarse grids: several are never worse than one, if that is among them.
    with suppress(NotConverged, ValueError):
        found.append(_straight_line(metric, start, near, solver))
    return _shortest(metric, found) if found else every()[0]


def _straight_line(
    metric: Metric, start: Array, goals: list[Array], solver: str
) -> ConnectingGeodesic:
    """Return the shortest of the geodesics to images of a goal, each near the straight line.

    Raises:
        NotConverged, ValueError: none was found; that to the first image is sought thoroughly.
    """
    found: list[ConnectingGeodesic] = []
    failures: list[NotConverged | ValueError] = []
    for number, goal in enumerate(goals):
        try:
            found.append(find_from_path(metric, start, goal, None, solver, thorough=number == 0))
        except (NotConverged, ValueError) as failure:
            failures.append(failure)
    if not found:
        raise failures[0]
    return _shortest(metric, found)


def _shortest(metric: Metric, found: list[ConnectingGeodesic]) -> ConnectingGeodesic:
    """Return the shortest one; the first of those that are equally long."""
    return min(found, key=lambda each: float(metric.norm(each.q0, each.velocity)))


def _from_offsets(
    metric: Metric, start: Array, goals: Array, offsets: Array, solver: str
) -> list[ConnectingGeodesic]:
    """Return geodesics to which paths to goals (k, n) lead, whose middles have offsets (k, n).

    Where geodesics diverge towards one end, only the integration from the other end may succeed:
    paths that led to none are tried from there, so that both directions find the same geodesics.
    """
    forwards = _along_paths(metric, start, goals, offsets, solver)
    known = np.isfinite(forwards.velocities).all(axis=1)
    found = [
        ConnectingGeodesic(start, goal, velocity)
        for goal, velocity in zip(goals[known], forwards.velocities[known], strict=True)
    ]
    failed = ~known & ~forwards.given_up
    if np.any(failed):
        # All from the same image of the goal, to images of the start.
        images = start + goals[0] - goals[failed]
        backwards = _along_paths(metric, goals[0], images, offsets[failed], solver)
        for goal, velocity in zip(goals[failed], backwards.velocities, strict=True):
            if np.all(np.isfinite(velocity)):
                with suppress(NotConverged):
                    found.append(traversed_backwards(metric, start, goal, velocity))
    return found


def _along_paths(
    metric: Metric, start: Array, goals: Array, offsets: Array, solver: str
) -> LogMaps:
    """Return velocities of the geodesics near paths to goals (k, n), see `_from_offsets`."""
    if solver == "newton" and metric.kernels.available():
        found = find_many_by_newton(metric, np.tile(start, (len(goals), 1)), goals, offsets)
        if found is not None:
            return found
    velocities = np.full(goals.shape, np.nan)
    for number, (goal, offset) in enumerate(zip(goals, offsets, strict=True)):
        with suppress(NotConverged, ValueError):
            line = start + _GRID.nodes[:, None] * (goal - start)
            guess = Path(metric, _GRID, line + bulge(_GRID) * offset)
            one = find_from_path(metric, start, goal, guess, solver, thorough=False)
            velocities[number] = one.velocity
    return LogMaps(velocities, np.zeros(len(goals), dtype=bool))


def find_geodesics(
    metric: Metric,
    q0: ArrayLike,
    q1: ArrayLike,
    *,
    num_starts: int,
    seed: int,
    solver: str | None = None,
    wrap: bool = True,
) -> list[ConnectingGeodesic]:
    """Return the distinct geodesics found from `num_starts` initial guesses, shortest first.

    Raises:
        ValueError: wrong points, num_starts is not a positive integer, seed is not a non-negative
            integer, the metric's periods are wrong, or there is no such solver.
        NotConverged: none was found.
    """
    metric = as_metric(metric)
    solver = as_solver(solver)
    start = metric.point("q0", q0)
    goal = metric.point("q1", q1)
    count = as_integer("num_starts", num_starts, 1)
    rng = np.random.default_rng(as_integer("seed", seed, 0))
    if count == 1:
        return [
            find_shortest(metric, start, goal, num_starts=1, seed=seed, solver=solver, wrap=wrap)
        ]
    goals = all_images(metric, start, goal)[:count] if wrap else [goal]
    found: list[ConnectingGeodesic] = []
    failures: list[NotConverged | ValueError] = []
    # All geodesics are straight lines where the metric tensor is constant.
    for number in range(len(goals) if metric.has_constant_tensor else count):
        try:
            if number < len(goals):
                first = number == 0
                new = _from_either_end(metric, start, goals[number], None, solver, thorough=first)
            elif (number - len(goals)) % 3 < 2 or not found:
                if (number - len(goals)) % 3 == 0:
                    goal = goals[int(rng.integers(len(goals)))]
                    offset = _random_direction(metric, rng, _WAYPOINT)
                else:
                    offset = -offset  # to the other side
                line = start + _GRID.nodes[:, None] * (goal - start)
                middle = np.linalg.norm(goal - start) * offset
                guess = Path(metric, _GRID, line + bulge(_GRID) * middle)
                new = _from_either_end(metric, start, goal, guess, solver, thorough=False)
            else:
                near = found[int(rng.integers(len(found)))]
                goal = near.q1
                change = _random_direction(metric, rng, _PERTURBATION, near)
                velocity = near.velocity + change
                if len(goals) > 1 and (number - len(goals)) % 2:
                    # Where a coordinate is periodic, the opposite direction leads to the goal, too.
                    goal = goals[int(rng.integers(len(goals)))]
                    velocity = -np.exp(rng.uniform(*np.log(_REVERSED))) * near.velocity
                if are_nearby(start, goal):  # there is no other geodesic as short
                    continue
                new = find_by_shooting(metric, start, goal, velocity)
        except (NotConverged, ValueError) as failure:
            failures.append(failure)
            continue
        size = metric.norm(start, new.velocity)
        differences = (metric.norm(start, new.velocity - other.velocity) for other in found)
        if all(difference > _SAME * size for difference in differences):
            found.append(new)
    if not found:
        raise NotConverged(
            f"no geodesic was found from any of {count} starts. From the straight line: "
            f"{failures[0]}. From the last: {failures[-1]}",
            getattr(failures[0], "solution", None),
        )
    return sorted(found, key=lambda each: float(metric.norm(start, each.velocity)))


def _from_either_end(
    metric: Metric, q0: Array, q1: Array, guess: Path | None, solver: str, *, thorough: bool
) -> ConnectingGeodesic:
    """Return the geodesic near a path that `find_from_path` finds from q0, or else from q1.

    Raises:
        NotConverged, ValueError: that of `find_from_path` from q0.
    """
    try:
        return find_from_path(metric, q0, q1, guess, solver, thorough=thorough)
    except NotConverged as failure:
        back = None if guess is None else replace(guess, nodes=guess.nodes[::-1])
        with suppress(NotConverged):
            other = find_from_path(metric, q1, q0, back, solver, thorough=thorough)
            return traversed_backwards(metric, q0, q1, other.velocity)
        raise failure


def find_from_path(
    metric: Metric, q0: Array, q1: Array, guess: Path | None, solver: str, *, thorough: bool = True
) -> ConnectingGeodesic:
    """Return the geodesic of locally minimal energy near a path, or near the straight line.

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
    if solver == "ipopt" or not metric.kernels.available():
        return find_by_ipopt(metric, q0, q1, guess, thorough=thorough)
    try:
        return find_by_newton(metric, q0, q1, guess, thorough=thorough)
    except NotConverged:
        if thorough:
            with suppress(NotConverged):
                return find_by_ipopt(metric, q0, q1, guess)
        raise


def as_solver(solver: str | None) -> str:
    """Return the argument, the environment variable, or "newton"; ValueError if it is no solver."""
    name = solver or os.environ.get(ENVIRONMENT_VARIABLE) or SOLVERS[0]
    chosen: str = as_choice("solver" if solver else ENVIRONMENT_VARIABLE, name, SOLVERS)
    return chosen


def are_nearby(q0: Array, q1: Array) -> bool:
    """Return whether the geodesic between two points is found as nearly a straight line."""
    return bool(np.abs(q1 - q0).max() <= _NEARBY * max(1.0, np.abs(q0).max()))


def _velocity_to_nearby(metric: Metric, q0: Array, q1: Array) -> Array | None:
    """Return Log_q0(q1) (n,) by integrating the displacement, which keeps its digits; None if too
    far.

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
    """Return Exp_q0(v0) - q0 (n,), by steps of the classical Runge-Kutta method."""
    x = np.zeros_like(v0)
    v = v0
    h = 1.0 / steps
    for _ in range(steps):
        a1 = metric.acceleration(q0 + x, v)
        a2 = metric.acceleration(q0 + x + h / 2 * v, v + h / 2 * a1)
        a3 = metric.acceleration(q0 + x + h / 2 * (v + h / 2 * a1), v + h / 2 * a2)
        a4 = metric.acceleration(q0 + x + h * (v + h / 2 * a2), v + h * a3)
        x = x + h * v + h * h / 6 * (a1 + a2 + a3)
        v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return np.asarray(x)


def _random_direction(
    metric: Metric,
    rng: np.random.Generator,
    size: tuple[float, float],
    near: ConnectingGeodesic | None = None,
) -> Array:
    """Return random vector (n,) whose length is in this range, relative to that of a geodesic if
    given.
    """
    direction = rng.normal(size=metric.dim)
    length = np.exp(rng.uniform(*np.log(size)))
    if near is None:
        return np.asarray(length / np.linalg.norm(direction) * direction)
    unit = metric.norm(near.q0, near.velocity) / metric.norm(near.q0, direction)
    return np.asarray(length * unit * direction)
