"""From synergy to synergy on a robot: each begins where the last ended, and brings the hand on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_vector
from geodesic_ocp.errors import GeodesicOcpError, NotConverged
from geodesic_ocp.manifold.kinetic_energy import KineticEnergy
from geodesic_ocp.model.distance import clearances
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.grid import Grid
from geodesic_ocp.ocp.nearest import nearest_posture
from geodesic_ocp.ocp.path import Path
from geodesic_ocp.ocp.point_to_point import PointToPoint
from geodesic_ocp.ocp.pose_error import pose_miss
from geodesic_ocp.ocp.posture import Clear, find_postures
from geodesic_ocp.ocp.problem import Problem
from geodesic_ocp.ocp.reach import Reach
from geodesic_ocp.ocp.solution import Solution
from geodesic_ocp.ocp.solve import solve
from geodesic_ocp.ocp.to_pose import ToPose, geodesic_to_pose, nearest_of

Formulation = Literal["constrained", "geodesic"]
# Conditions hold to this between the nodes, and limits are narrowed by twice as much.
_TOLERANCE = 1e-6
_REACHED = 1e-6  # [m] and [rad]
# A law from rest to rest is half as fast again in the middle as on average.
_PEAK = 1.5


@dataclass(frozen=True, eq=False)
class Pose:
    """Where the hand is to be.

    Attributes:
        rotation: (3, 3), or None where it is left free.
        position: (3,) [m], or None.
    """

    rotation: Array | None
    position: Array | None

    def miss(self, model: Model, q: Array) -> tuple[float, float]:
        """Distance [m] and angle [rad] from the hand at q; zero for what is left free."""
        rotation, position = model.hand_pose(q)
        away, angle = pose_miss(
            rotation,
            position,
            rotation if self.rotation is None else self.rotation,
            position if self.position is None else self.position,
        )
        return away, angle


@dataclass(frozen=True)
class Conditions:
    """What holds for all synergies of a robot; see `retarget`."""

    formulation: Formulation
    limits: bool
    speed_limits: bool
    clear: Clear
    weights: tuple[float, float]
    energy_weight: float
    starts: int


@dataclass(frozen=True, eq=False)
class Transfer:
    """A path of a robot to a pose of its hand.

    Attributes:
        path: least energy under what was asked for; of no length where the arm rests.
        pose: that was asked for.
        within_reach: whether inverse kinematics found a posture with that pose, under the limits.
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


@lru_cache(maxsize=16)
def narrowed(robot: Model) -> Model:
    """The robot with limits a little within its own: what is missed by the tolerance is not."""
    gap = np.minimum(2.0 * _TOLERANCE, (robot.upper - robot.lower) / 4.0)
    return robot.with_limits(robot.lower + gap, robot.upper - gap)


def first_posture(
    robot: Model, pose: Pose, conditions: Conditions, given: ArrayLike | None
) -> Array:
    """Posture (n,) to begin in: one that is given, or that has the pose and is near mid-range.

    Raises:
        ValueError: the one that is given is outside the limits, or too near to a body.
        NotConverged: no posture is clear of the bodies.
    """
    arm, clear = narrowed(robot) if conditions.limits else robot, conditions.clear
    if given is None:
        middle = np.where(np.isfinite(arm.upper - arm.lower), (arm.upper + arm.lower) / 2.0, 0.0)
        return _posture(arm, middle, pose, conditions)
    start = as_vector("start", given, robot.dof)
    if conditions.limits:
        for joint, value, low, high in zip(
            robot.joint_names, start, robot.lower, robot.upper, strict=True
        ):
            if not low <= value <= high:
                raise ValueError(
                    f"start: {joint} is at {value:.4g}, outside its limits {low:.4g} to {high:.4g}"
                )
        start = np.clip(start, arm.lower, arm.upper)
    for name, distance in _clearances(robot, start, clear).items():
        if distance < clear.margin:
            raise ValueError(
                f"start: {name} is {distance:.3g} m, and must be {clear.margin:.3g} m at least"
            )
    return start


def _clearances(robot: Model, q: Array, clear: Clear) -> dict[str, float]:
    return clearances(robot, q, clear.obstacles, links=clear.links, pairs=clear.pairs)


def _posture(arm: Model, near: Array, pose: Pose, conditions: Conditions) -> Array:
    """The posture with the pose, or the nearest to it."""
    try:
        return _postures(arm, near, pose, conditions)[0]
    except NotConverged:
        given = (pose.position, pose.rotation, conditions.weights, conditions.limits)
        return nearest_posture(arm, near, *given, conditions.clear)


def _postures(arm: Model, near: Array, pose: Pose, conditions: Conditions) -> list[Array]:
    given = (pose.position, pose.rotation, conditions.limits, None, conditions.clear)
    return find_postures(arm, near, *given)


def out_of_reach(
    robot: Model, start: Array, poses: Sequence[Pose], conditions: Conditions
) -> dict[int, tuple[float, float]]:
    """Numbers of the poses that no posture has, and by how much the nearest one misses each."""
    arm = narrowed(robot) if conditions.limits else robot
    found, near = {}, start
    for number, pose in enumerate(poses):
        near = _posture(arm, near, pose, conditions)
        missed = pose.miss(robot, near)
        if max(missed) > _REACHED:
            found[number] = missed
    return found


def transferred(
    robot: Model,
    start: Array,
    poses: Sequence[Pose | None],
    durations: Sequence[float],
    unreachable: Sequence[bool],
    conditions: Conditions,
    *,
    throw: bool = True,
    progress: Callable[[int], object] | None = None,
) -> list[Transfer]:
    """A path to each pose in turn, from where the one before ended.

    Args:
        robot: the arm.
        start: posture (n,) to begin in.
        poses: of the hand; None: the arm stays where it is.
        durations: of each path [s], for the limits of speed.
        unreachable: of which poses it is known that no posture has them.
        conditions: of all paths.
        throw: raise where a path is not found; else the arm stays where it is, and goes on with the
            next pose.
        progress: called with the number of paths done so far.

    Raises:
        NotConverged: a path was not found; names it by its number.
    """
    arm = narrowed(robot) if conditions.limits else robot
    metric, q = _metric(arm), start
    result: list[Transfer] = []
    for number, (pose, duration, far) in enumerate(zip(poses, durations, unreachable, strict=True)):
        if pose is None:
            here = Pose(*arm.hand_pose(q))
            done = Transfer(_still(metric, q), here, True, 0.0, 0.0, 0, True, "the arm rests")
        else:
            with _named(number):
                done = _one(metric, q, pose, duration, far, conditions, throw)
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
    pose: Pose,
    duration: float,
    far: bool,
    conditions: Conditions,
    throw: bool,
) -> Transfer:
    arm = metric.model
    if max(pose.miss(arm, q)) < _REACHED / 1e3:
        away = pose.miss(arm, q)
        return Transfer(_still(metric, q), pose, True, *away, 0, True, "the hand is there already")
    if conditions.formulation == "geodesic":
        path, iterations, success, status = _shot(metric, q, pose, far, conditions)
    else:
        path, iterations, success, status = _constrained(metric, q, pose, duration, far, conditions)
    if not success and throw:
        raise NotConverged(status)
    path = path if success else _still(metric, q)
    return Transfer(
        path, pose, not far, *pose.miss(arm, path.nodes[-1]), iterations, success, status
    )


@lru_cache(maxsize=16)
def _metric(arm: Model) -> KineticEnergy:
    return KineticEnergy(arm)


def _line(metric: KineticEnergy, q0: Array, q1: Array) -> Path:
    return Path(metric, Grid(1, 2), np.array([q0, (q0 + q1) / 2.0, q1]))


def _still(metric: KineticEnergy, q: Array) -> Path:
    return _line(metric, q, q)


def _constrained(
    metric: KineticEnergy, q: Array, pose: Pose, duration: float, far: bool, conditions: Conditions
) -> tuple[Path, int, bool, str]:
    """Least energy under the conditions: with the pose exactly, or to the nearest posture."""
    arm, keep = metric.model, _keywords(conditions)
    if far:
        ends = [_posture(arm, q, pose, conditions)]
        problems: list[Problem] = []
    else:
        ends = _postures(arm, q, pose, conditions)
        problems = [Reach(arm, q, pose.position, pose.rotation, **keep)] * len(ends)
    iterations = 0
    found: list[Solution] = []
    failures: list[Solution] = []
    start = tuple(q.tolist())
    fixed: list[Problem] = [
        PointToPoint(metric, start, tuple(end.tolist()), **keep) for end in ends
    ]
    for kind in (problems, fixed):
        for problem, end in zip(kind, ends, strict=False):
            solution = _solved(problem, _line(metric, q, end), duration, conditions)
            iterations += _iterations(solution)
            (found if solution.stats.success else failures).append(solution)
            if len(found) >= conditions.starts:
                break
        if found:
            break
    if not found:
        status = failures[0].stats.status
        return failures[0].path, iterations, False, status
    best = min(found, key=lambda solution: solution.stats.objective)
    status = best.stats.status
    if far:
        status = "the pose is out of reach; the end posture is the nearest to it"
    elif isinstance(best.problem, PointToPoint):
        status = "the end posture is that of inverse kinematics, and not the one of least energy"
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


def _solved(problem: Problem, guess: Path, duration: float, conditions: Conditions) -> Solution:
    """The solution, within the limits of speed where there is one that is not slower."""
    solution = solve(problem, guess=guess, tolerance=_TOLERANCE, throw=False)
    if not solution.stats.success or not conditions.speed_limits:
        return solution
    fastest = velocity_limits(problem.metric.model) * duration / _PEAK  # type: ignore[attr-defined]
    reached = np.abs(solution.path(np.linspace(0.0, 1.0, 101), 1)).max(axis=0)
    if np.all(reached <= fastest):
        return solution
    speed = tuple(np.where(np.isfinite(fastest), fastest, 1e6).tolist())
    slower = replace(problem, speed=speed)  # type: ignore[type-var]
    again = solve(slower, guess=solution, tolerance=_TOLERANCE, throw=False)
    return again if again.stats.success else solution


def velocity_limits(robot: Model) -> Array:
    """Largest speeds of the joints (n,) [rad/s or m/s]; infinite where the model has none."""
    given = np.array(robot.pin.velocityLimit, dtype=float)
    return np.where((given > 0.0) & (given < np.finfo(float).max), given, np.inf)


def _iterations(solution: Solution) -> int:
    rounds = solution.stats.rounds
    return sum(each.iterations for each in rounds) if rounds else solution.stats.iterations


def _shot(
    metric: KineticEnergy, q: Array, pose: Pose, far: bool, conditions: Conditions
) -> tuple[Path, int, bool, str]:
    """The geodesic that comes nearest, from inverse kinematics and from standing still."""
    arm = metric.model
    ends = [_posture(arm, q, pose, conditions)] if far else _postures(arm, q, pose, conditions)
    found: list[ToPose] = []
    iterations, status = 0, ""
    for towards in (*ends, None):
        try:
            outcome = geodesic_to_pose(
                arm,
                q,
                pose.position,
                pose.rotation,
                towards=towards,
                weights=conditions.weights,
                energy_weight=conditions.energy_weight,
                throw=False,
            )
        except GeodesicOcpError as error:
            status = status or str(error)
            continue
        iterations += outcome.iterations
        status = status or outcome.status
        if outcome.success and outcome.path is not None:
            found.append(outcome)
            near = max(outcome.position_error, outcome.rotation_error) <= _REACHED
            if (near or far) and len(found) >= conditions.starts:
                break
    if not found:
        return _still(metric, q), iterations, False, status
    best = nearest_of(found)
    assert best.path is not None
    return best.path, iterations, True, best.status
