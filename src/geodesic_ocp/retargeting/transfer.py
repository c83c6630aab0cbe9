"""From synergy to synergy on a robot: each begins where the last ended, and brings the hand on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.geodesics.geodesic_to_pose import ToPose, geodesic_to_pose, nearest_of
from geodesic_ocp.geodesics.pose_target import metric_of
from geodesic_ocp.manifold.kinetic_energy import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.problem.point_to_point import PointToPoint
from geodesic_ocp.ocp.problem.reach import Reach
from geodesic_ocp.ocp.solve.solution import Solution
from geodesic_ocp.ocp.solve.solve import solve
from geodesic_ocp.retargeting.targets import (
    REACHED,
    TOLERANCE,
    Conditions,
    Goal,
    Pose,
    ends,
    narrowed,
)
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

# A law from rest to rest is half as fast again in the middle as on average.
_PEAK = 1.5
# How many times too fast another path may be, where the first one is more than so many times.
_ALLOWED = ((1.0, 1.0), (2.0, 4.0))
_UNBOUNDED = 1e6  # [rad or m]
_COARSE = Grid(8, 2)


@dataclass(frozen=True, eq=False)
class Transfer:
    """A path of a robot to a pose of its hand.

    Attributes:
        path: least energy under what was asked for; of no length where the arm rests.
        pose: that was asked for.
        within_reach: whether inverse kinematics found a configuration with that pose, under the limits.
        position_error, rotation_error: of the hand at the path's end [m], [rad].
        iterations: of Ipopt, over all grids.
        success: whether the solver found the path.
        status: how it stopped, a sentence.
    """

    path: Path
    pose: Pose
    within_reach: bool
    position_error: float
    rotation_error: float
    iterations: int
    success: bool
    status: str


def transferred(
    robot: Model,
    start: Array,
    wanted: Sequence[Goal | None],
    durations: Sequence[float],
    conditions: Conditions,
    *,
    throw: bool = True,
    progress: Callable[[int], object] | None = None,
) -> list[Transfer]:
    """A path to each pose in turn, from where the one before ended.

    Args:
        robot: the arm.
        start: configuration (n,) to begin in.
        wanted: poses of the hand; None: the arm stays where it is.
        durations: of each path [s], for the limits of speed.
        conditions: of all paths.
        throw: raise where a path is not found; else the arm stays where it is, and goes on with the
            next pose.
        progress: called with the number of paths done so far.

    Raises:
        NotConverged: a path was not found; names it by its number.
    """
    arm = narrowed(robot) if conditions.limits else robot
    metric, q = metric_of(arm), start
    result: list[Transfer] = []
    for number, (goal, duration) in enumerate(zip(wanted, durations, strict=True)):
        if goal is None:
            here = Pose(*arm.hand_pose(q))
            done = Transfer(_still(metric, q), here, True, 0.0, 0.0, 0, True, "the arm rests")
        else:
            with _named(number):
                done = _one(metric, q, goal, duration, conditions, throw)
        result.append(done)
        q = done.path.nodes[-1]
        if progress is not None:
            progress(number + 1)
    return result


@contextmanager
def _named(number: int) -> Iterator[None]:
    try:
        yield
    except NotConverged as error:
        raise NotConverged(f"synergy {number}: {error}", error.solution) from None


def _one(
    metric: KineticEnergy,
    q: Array,
    goal: Goal,
    duration: float,
    conditions: Conditions,
    throw: bool,
) -> Transfer:
    arm, pose = metric.model, goal.pose
    away = pose.miss(arm, q)
    if max(away) < REACHED / 1e3:
        return Transfer(_still(metric, q), pose, True, *away, 0, True, "the hand is there already")
    if conditions.formulation == "geodesic":
        path, iterations, success, status = _shot(metric, q, goal, conditions)
    else:
        path, iterations, success, status = _constrained(metric, q, goal, duration, conditions)
    if not success and throw:
        raise NotConverged(status)
    path = path if success else _still(metric, q)
    away = pose.miss(arm, path.nodes[-1])
    return Transfer(path, pose, goal.within_reach, *away, iterations, success, status)


def _line(metric: KineticEnergy, q0: Array, q1: Array) -> Path:
    return Path(metric, Grid(1, 2), np.array([q0, (q0 + q1) / 2.0, q1]))


def _still(metric: KineticEnergy, q: Array) -> Path:
    return _line(metric, q, q)


def _constrained(
    metric: KineticEnergy, q: Array, goal: Goal, duration: float, conditions: Conditions
) -> tuple[Path, int, bool, str]:
    """Least energy under the conditions: with the pose exactly, or to the nearest configuration."""
    arm, pose, keep = metric.model, goal.pose, _keywords(conditions)
    iterations = 0
    found: list[Solution] = []
    failures: list[Solution] = []
    start = tuple(q.tolist())
    tried: list[Array] = []
    for end in ends(arm, q, goal, conditions):
        tried.append(end)
        # Out of reach the nearest pose takes its place, which other configurations may have, too.
        wanted = pose if goal.within_reach else pose.of(arm, end)
        problem = Reach(arm, q, wanted.position, wanted.rotation, **keep)
        solution = _solved(problem, _line(metric, q, end), duration, conditions)
        iterations += _iterations(solution)
        (found if solution.stats.success else failures).append(solution)
        if len(found) >= conditions.num_starts:
            break
    for end in tried if not found else ():
        fixed = PointToPoint(metric, start, tuple(end.tolist()), **keep)
        solution = _solved(fixed, _line(metric, q, end), duration, conditions)
        iterations += _iterations(solution)
        (found if solution.stats.success else failures).append(solution)
        if found:
            break
    if not found:
        status = failures[0].stats.status
        return failures[0].path, iterations, False, status
    best = min(found, key=lambda solution: solution.stats.objective)
    status = best.stats.status
    if not goal.within_reach:
        status = "the pose is out of reach; the path goes to the nearest"
    elif isinstance(best.problem, PointToPoint):
        status = (
            "the end configuration is that of inverse kinematics, and not the one of least energy"
        )
    return best.path, iterations, True, status


def _keywords(conditions: Conditions) -> dict[str, Any]:
    obstacles, links, pairs, margin = conditions.clear
    return {
        "limits": conditions.limits,
        "obstacles": obstacles,
        "links": links,
        "pairs": pairs,
        "margin": margin,
    }


def _solved(
    problem: Reach | PointToPoint, guess: Path, duration: float, conditions: Conditions
) -> Solution:
    """The solution, within the limits of speed where there is one that is not slower."""
    solution = solve(problem, guess=guess, tolerance=TOLERANCE, throw=False)
    if not solution.stats.success or not conditions.speed_limits:
        return solution
    fastest = velocity_limits(guess.metric.model) * duration / _PEAK  # type: ignore[attr-defined]
    reached = np.abs(solution.path(np.linspace(0.0, 1.0, 101), 1)).max(axis=0)
    if np.all(reached <= fastest):
        return solution
    excess = float((reached / fastest).max())
    for allowed, above in _ALLOWED:
        if excess > above:
            # Another path may be fast enough, or nearly; the rest is left to a longer time.
            speed = np.where(np.isfinite(fastest), allowed * fastest, _UNBOUNDED)
            slower = replace(problem, speed=tuple(speed.tolist()))
            again = solve(slower, guess=solution, tolerance=TOLERANCE, throw=False)
            if again.stats.success:
                return again
    return solution


def velocity_limits(robot: Model) -> Array:
    """Largest speeds of the joints (n,) [rad/s or m/s]; infinite where the model has none."""
    given = np.array(robot.pin.velocityLimit, dtype=float)
    return np.where((given > 0.0) & (given < np.finfo(float).max), given, np.inf)


def _iterations(solution: Solution) -> int:
    history = solution.stats.mesh_history
    return sum(each.iterations for each in history) if history else solution.stats.iterations


def _shot(
    metric: KineticEnergy, q: Array, goal: Goal, conditions: Conditions
) -> tuple[Path, int, bool, str]:
    """The geodesic that comes nearest, from inverse kinematics and from standing still."""
    arm = metric.model
    found: list[ToPose] = []
    iterations, reached, status = 0, 0, ""
    ends_found = ends(arm, q, goal, conditions)
    for towards in (*ends_found[:1], None, *ends_found[1:]):
        # Out of reach the nearest pose takes its place.
        wanted = goal.pose
        if not goal.within_reach:
            wanted = wanted.of(arm, goal.configuration if towards is None else towards)
        velocity = np.zeros(arm.dof)
        if towards is not None:
            rough = _rough(metric, q, wanted, towards)
            iterations += rough.stats.iterations
            velocity = rough.path(0.0, 1) if rough.stats.success else towards - q
        outcome = geodesic_to_pose(
            arm,
            q,
            wanted.position,
            wanted.rotation,
            velocity=velocity,
            weights=conditions.weights,
            energy_weight=conditions.energy_weight,
            throw=False,
        )
        iterations += outcome.iterations
        status = status or outcome.status
        if outcome.success and outcome.path is not None:
            found.append(outcome)
            reached += max(outcome.position_error, outcome.rotation_error) <= REACHED
            if reached > conditions.num_starts:
                break
    if not found:
        return _still(metric, q), iterations, False, status
    best = nearest_of(found)
    assert best.path is not None
    return best.path, iterations, True, best.status


def _rough(metric: KineticEnergy, q: Array, pose: Pose, towards: Array) -> Solution:
    """The path of least energy on a coarse grid, whose velocity is near that of a geodesic."""
    problem = Reach(metric.model, q, pose.position, pose.rotation, limits=False)
    return solve(problem, grid=_COARSE, guess=_line(metric, q, towards), throw=False)
