"""A robot's path to each key pose, from where the previous path ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.logarithm.to_pose.geodesic_to_pose import ToPose, geodesic_to_pose, nearest_of
from geodesic_ocp.logarithm.to_pose.pose_target import metric_of
from geodesic_ocp.manifold.metrics.kinetic_energy import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.problem.point_to_point import PointToPoint
from geodesic_ocp.ocp.problem.reach import Reach
from geodesic_ocp.ocp.solve.solution import Solution
from geodesic_ocp.ocp.solve.solve import solve
from geodesic_ocp.retargeting.least_energy import FoundPath, least_energy_path, line
from geodesic_ocp.retargeting.promising_ends import promising_ends
from geodesic_ocp.retargeting.targets import REACHED, KeyPose, Pose, PoseFinder
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

# The peak speed of a motion from rest to rest is 1.5 times its mean.
_PEAK = 1.5
# (speed limit by which another path is sought, excess from which it is tried), both as factors.
_SPEED_FACTORS = ((1.0, 1.0), (2.0, 4.0))
_UNBOUNDED = 1e6  # [rad or m]
_COARSE = Grid(8, 2)
_THERE = 1e-3 * REACHED


@dataclass(frozen=True, eq=False, repr=False)
class Transfer:
    """A path of a robot to a target pose of its hand.

    Attributes:
        path: of least energy under the constraints; of zero length if the arm rests.
        pose: the target.
        within_reach: whether inverse kinematics found a configuration with that pose.
        position_error, rotation_error: of the hand at the path's end [m], [rad].
        iterations: of Ipopt, on all grids.
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

    def __repr__(self) -> str:
        return (
            f"Transfer({self.status}; hand pose error {self.position_error:.1e} m, "
            f"{self.rotation_error:.1e} rad)"
        )


def plan_transfers(
    finder: PoseFinder,
    start: Array,
    targets: Sequence[KeyPose | None],
    durations: Sequence[float],
    *,
    throw: bool = True,
    progress: Callable[[int], object] | None = None,
) -> list[Transfer]:
    """A path to each target in turn, from where the previous one ended.

    Args:
        finder: inverse kinematics of the robot under the settings.
        start: configuration (n,) to begin in.
        targets: poses of the hand; None: the arm rests.
        durations: of each path [s], for the speed limits.
        throw: raise if a path is not found; else the arm rests and continues with the next target.
        progress: called with the number of paths planned so far.

    Raises:
        NotConverged: a path was not found; the message gives its number.
    """
    metric, q = metric_of(finder.arm), start
    transfers: list[Transfer] = []
    for number, (target, duration) in enumerate(zip(targets, durations, strict=True)):
        if target is None:
            here = Pose(*finder.arm.hand_pose(q))
            planned = Transfer(_rest(metric, q), here, True, 0.0, 0.0, 0, True, "the arm rests")
        else:
            with _numbered(number):
                planned = _planned(finder, metric, q, target, duration, throw)
        transfers.append(planned)
        q = planned.path.nodes[-1]
        if progress is not None:
            progress(number + 1)
    return transfers


@contextmanager
def _numbered(number: int) -> Iterator[None]:
    try:
        yield
    except NotConverged as error:
        raise NotConverged(f"synergy {number}: {error}", error.solution) from None


def _planned(
    finder: PoseFinder,
    metric: KineticEnergy,
    q: Array,
    target: KeyPose,
    duration: float,
    throw: bool,
) -> Transfer:
    arm, pose = metric.model, target.pose
    error = pose.error(arm, q)
    if max(error) < _THERE:
        status = "the hand is already at the pose"
        return Transfer(_rest(metric, q), pose, True, *error, 0, True, status)
    if finder.settings.constrained:
        path, iterations, success, status = _constrained(finder, metric, q, target, duration)
    else:
        path, iterations, success, status = _free_geodesic(finder, metric, q, target)
    if not success and throw:
        raise NotConverged(status)
    path = path if success else _rest(metric, q)
    error = pose.error(arm, path.nodes[-1])
    return Transfer(path, pose, target.within_reach, *error, iterations, success, status)


def _rest(metric: KineticEnergy, q: Array) -> Path:
    return line(metric, q, q)


def _constrained(
    finder: PoseFinder, metric: KineticEnergy, q: Array, target: KeyPose, duration: float
) -> tuple[Path, int, bool, str]:
    """Least energy to the exact pose, or to the configuration with the nearest one."""
    arm, settings = metric.model, finder.settings
    iterations = 0
    found: list[FoundPath] = []
    failures: list[FoundPath] = []
    tried: list[Array] = []
    has_fixed_end = False
    fastest = velocity_limits(finder.robot) if settings.within_speed_limits else np.inf
    for end, rough in promising_ends(finder, q, target, fastest * duration):
        tried.append(end)
        # Out of reach, the nearest pose takes its place, which other configurations may have.
        pose = target.pose if target.within_reach else target.pose.reached_by(arm, end)
        outcome = _to_pose(finder, q, pose, end, rough, duration)
        iterations += outcome.iterations
        (found if outcome.success else failures).append(outcome)
        if len(found) >= settings.num_starts:
            break
    for end in tried if not found else ():
        has_fixed_end = True
        fixed = PointToPoint(
            metric, tuple(q.tolist()), tuple(end.tolist()), **_path_constraints(finder)
        )
        outcome = _solve(finder, fixed, line(metric, q, end), duration)
        iterations += outcome.iterations
        (found if outcome.success else failures).append(outcome)
        if found:
            break
    if not found:
        return failures[0].path, iterations, False, failures[0].status
    best = min(found, key=lambda each: each.energy)
    status = best.status
    if not target.within_reach:
        status = "the pose is out of reach; the path ends at the nearest one"
    elif has_fixed_end:
        status = "the end configuration is that of inverse kinematics, not the one of least energy"
    return best.path, iterations, True, status


def _path_constraints(finder: PoseFinder) -> dict[str, Any]:
    settings = finder.settings
    obstacles, links, pairs, margin = settings.collisions
    return {
        "limits": settings.within_limits,
        "obstacles": obstacles,
        "links": links,
        "pairs": pairs,
        "margin": margin,
    }


def _to_pose(
    finder: PoseFinder, q: Array, pose: Pose, end: Array, rough: FoundPath | None, duration: float
) -> FoundPath:
    """The path to a pose, within the speed limits if there is such a path."""
    arm, settings = finder.arm, finder.settings
    if not settings.collisions.is_empty:
        problem = Reach(arm, q, pose.position, pose.rotation, **_path_constraints(finder))
        return _solve(finder, problem, line(problem.metric, q, end), duration)
    numbers: dict[str, Any] = {"limits": settings.within_limits, "tolerance": finder.tolerance}
    rough = rough or least_energy_path(arm, q, pose, end, is_rough=True, **numbers)
    if not rough.success:
        return rough
    if settings.within_speed_limits:
        for speed in _slower(finder, rough.path, duration):
            # The straight line to such a configuration meets all limits; else no path does.
            near = finder.configuration_within(q - speed, q + speed, rough.path.nodes[-1], pose)
            if near is not None:
                found = least_energy_path(arm, q, pose, near, speed=speed, **numbers)
                if found.success:
                    return replace(found, iterations=rough.iterations + found.iterations)
    return least_energy_path(arm, q, pose, end, after=rough, **numbers)


def _solve(
    finder: PoseFinder, problem: Reach | PointToPoint, guess: Path, duration: float
) -> FoundPath:
    """The solution, within the speed limits if there is such a path."""
    solution = solve(problem, guess=guess, tolerance=finder.tolerance, throw=False)
    if solution.stats.success and finder.settings.within_speed_limits:
        for speed in _slower(finder, solution.path, duration):
            slower = replace(problem, speed=tuple(speed.tolist()))
            again = solve(slower, guess=solution, tolerance=finder.tolerance, throw=False)
            if again.stats.success:
                solution = again
                break
    stats = solution.stats
    iterations, status = stats.total_iterations, stats.status
    return FoundPath(solution.path, stats.objective, iterations, stats.success, status)


def _slower(finder: PoseFinder, path: Path, duration: float) -> Iterator[Array]:
    """Speed limits by which another path is sought, (n,) each; none if the path is slow enough.

    Another path may meet the limits, or nearly; scaling time does the rest.
    """
    fastest = velocity_limits(finder.robot) * duration / _PEAK
    reached = np.abs(path(np.linspace(0.0, 1.0, 101), 1)).max(axis=0)
    excess = float((reached / fastest).max())
    for factor, least_excess in _SPEED_FACTORS:
        if excess > least_excess:
            yield np.where(np.isfinite(fastest), factor * fastest, _UNBOUNDED)


def velocity_limits(robot: Model) -> Array:
    """Largest speeds of the joints (n,) [rad/s or m/s]; infinite if the model has none."""
    given = np.array(robot.pin.velocityLimit, dtype=float)
    return np.where((given > 0.0) & (given < np.finfo(float).max), given, np.inf)


def _free_geodesic(
    finder: PoseFinder, metric: KineticEnergy, q: Array, target: KeyPose
) -> tuple[Path, int, bool, str]:
    """The geodesic that ends nearest to the pose, from several initial velocities."""
    arm, settings = metric.model, finder.settings
    found: list[ToPose] = []
    iterations, reached, status = 0, 0, ""
    ends = finder.end_configurations(q, target)
    for towards in (*ends[:1], None, *ends[1:]):
        pose = target.pose
        if not target.within_reach:
            end = target.configuration if towards is None else towards
            pose = pose.reached_by(arm, end)
        velocity = np.zeros(arm.dof)
        if towards is not None:
            coarse = _coarse_reach(metric, q, pose, towards)
            iterations += coarse.stats.iterations
            velocity = coarse.path(0.0, 1) if coarse.stats.success else towards - q
        outcome = geodesic_to_pose(
            *(arm, q, pose.position, pose.rotation),
            velocity=velocity,
            weights=settings.pose_weights,
            energy_weight=settings.energy_weight,
            throw=False,
        )
        iterations += outcome.iterations
        status = status or outcome.status
        if outcome.success and outcome.path is not None:
            found.append(outcome)
            reached += max(outcome.position_error, outcome.rotation_error) <= REACHED
            if reached > settings.num_starts:
                break
    if not found:
        return _rest(metric, q), iterations, False, status
    best = nearest_of(found)
    assert best.path is not None
    return best.path, iterations, True, best.status


def _coarse_reach(metric: KineticEnergy, q: Array, pose: Pose, towards: Array) -> Solution:
    """The path of least energy on a coarse grid; its velocity is close to that of a geodesic."""
    problem = Reach(metric.model, q, pose.position, pose.rotation, limits=False)
    return solve(problem, grid=_COARSE, guess=line(metric, q, towards), throw=False)
