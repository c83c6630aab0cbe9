"""Paths of a robot to poses of its hand; free geodesics, each from where the previous one ended."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.logarithm.geodesic_to_pose import ToPose, geodesic_to_pose, nearest_of
from geodesic_ocp.logarithm.pose_shooting import metric_of
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import KineticEnergy
from geodesic_ocp.ocp.reach import Reach
from geodesic_ocp.ocp.solution import Solution
from geodesic_ocp.ocp.solve import solve
from geodesic_ocp.retargeting.key_poses import REACHED, KeyPose, Pose, PoseFinder
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

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
    *,
    throw: bool = True,
    progress: Callable[[int], object] | None = None,
) -> list[Transfer]:
    """A free geodesic to each target in turn, from where the previous one ended.

    Args:
        finder: inverse kinematics of the robot under the settings.
        start: configuration (n,) to begin in.
        targets: poses of the hand; None: the arm rests.
        throw: raise if a path is not found; else the arm rests and continues with the next target.
        progress: called with the number of paths planned so far.

    Raises:
        NotConverged: a path was not found; the message gives its number.
    """
    metric, q = metric_of(finder.arm), start
    transfers: list[Transfer] = []
    for number, target in enumerate(targets, 1):
        if target is None:
            planned = rest_at(metric, q)
        else:
            with _numbered(number):
                planned = _planned(finder, metric, q, target, throw)
        transfers.append(planned)
        q = planned.path.nodes[-1]
        if progress is not None:
            progress(number)
    return transfers


def rest_at(metric: KineticEnergy, q: Array) -> Transfer:
    """The arm stays at a configuration (n,)."""
    here = Pose(*metric.model.hand_pose(q))
    return Transfer(_rest(metric, q), here, True, 0.0, 0.0, 0, True, "the arm rests")


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
    throw: bool,
) -> Transfer:
    arm, pose = metric.model, target.pose
    error = pose.error(arm, q)
    if max(error) < _THERE:
        status = "the hand is already at the pose"
        return Transfer(_rest(metric, q), pose, True, *error, 0, True, status)
    path, iterations, success, status = _free_geodesic(finder, metric, q, target)
    if not success and throw:
        raise NotConverged(status)
    path = path if success else _rest(metric, q)
    error = pose.error(arm, path.nodes[-1])
    return Transfer(path, pose, target.within_reach, *error, iterations, success, status)


def _rest(metric: KineticEnergy, q: Array) -> Path:
    return line(metric, q, q)


def line(metric: Metric, q0: Array, q1: Array) -> Path:
    """The straight line between two configurations."""
    return Path(metric, Grid(1, 2), np.array([q0, (q0 + q1) / 2.0, q1]))


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
