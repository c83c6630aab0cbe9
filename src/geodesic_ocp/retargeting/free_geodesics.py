"""Free geodesics of a robot to the poses of a person's hand, each from the end of the one before.

As in Klein, Jaquier, Meixner, Asfour (2022).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.logarithm.geodesic_to_pose import ToPose, geodesic_to_pose, nearest_of
from geodesic_ocp.manifold.metrics import metric_of
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.problems import Reach
from geodesic_ocp.ocp.solve import solve
from geodesic_ocp.progress import Progress
from geodesic_ocp.retargeting.arm_result import PoseErrors, Transfer, at_rest, line
from geodesic_ocp.retargeting.paired_arm import (
    REACHED,
    PairedArm,
    Pose,
    middle_of_ranges,
    nearest_configurations,
)
from geodesic_ocp.retargeting.settings import RetargetingSettings
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

_COARSE = Grid(8, 2)
_THERE = 1e-3 * REACHED
# of inverse kinematics
_SOLUTIONS = 5
_FEWEST = 4
_ENDS = 10
_ANYWHERE = 0.2  # how near inverse kinematics comes to the configuration it starts from [rad or m]
_SAME = 0.1  # [rad or m]


def free_ends(pair: PairedArm) -> tuple[Array, list[Array | None], PoseErrors]:
    """Return configurations in which the free geodesics of a robot begin and are to end.

    Returns:
        The start, or a configuration with the first pose near the middle of the ranges; for each
        group a configuration with its pose, or with the nearest one, and None where it rests; the
        poses that these do not attain.
    """
    robot = pair.robot
    settings = pair.settings
    placed = settings.within_limits, settings.pose_weights
    if (near := pair.start) is None:
        first = pair.target(pair.groups[0].start)
        middle = middle_of_ranges(robot)[0]
        near = nearest_configurations(robot, middle, first, *placed, enough=_SOLUTIONS)[0]
    begin = near
    ends = list[Array | None]()
    far = {}
    for number, group in enumerate(pair.groups, 1):
        if group.kind == "rest":
            ends.append(None)
            continue
        pose = pair.target(group.stop)
        near = nearest_configurations(robot, near, pose, *placed, settled=_ANYWHERE)[0]
        ends.append(near)
        if max(error := pose.error(robot, near)) > REACHED:
            far[number] = error
    return begin, ends, far


def free_geodesics(
    pair: PairedArm, start: Array, ends: Sequence[Array | None], throw: bool, progress: Progress
) -> list[Transfer]:
    """Return a geodesic to each pose from where the previous one ended.

    Args:
        pair: person and robot.
        start, ends: configurations, see `free_ends`.
        throw: raise if one is not found; else the arm rests and continues with the next pose.
        progress: called with the current step, the amount done and the total.

    Raises:
        NotConverged: a geodesic was not found; the message gives its number.
    """
    q = start
    found = list[Transfer]()
    for number, (group, end) in enumerate(zip(pair.groups, ends, strict=True), 1):
        if end is None:
            found.append(at_rest(pair, group, q))
        else:
            found.append(to_pose(pair.robot, q, pair.target(group.stop), end, pair.settings))
        if throw and not found[-1].success:
            raise NotConverged(f"synergy {number}: {found[-1].status}")
        q = found[-1].path.nodes[-1]
        progress(f"planning {pair.robot.name}", number, len(ends))
    return found


def to_pose(
    robot: Model, q: Array, pose: Pose, end: Array, settings: RetargetingSettings
) -> Transfer:
    """Return the free geodesic from q (n,) that ends nearest to a pose, from several initial
    velocities.

    Args:
        robot: the arm.
        q: configuration (n,) to begin in.
        pose: pose of the hand.
        end: configuration (n,) with that pose, or with the nearest one.
        settings: settings of the retargeting.
    """
    metric = metric_of(robot)
    within_reach = max(pose.error(robot, end)) <= REACHED
    if max(error := pose.error(robot, q)) < _THERE:
        status = "the hand is already at the pose"
        return Transfer(line(metric, q, q), pose, True, *error, 0, True, status)
    found: list[ToPose] = []
    iterations = 0
    reached = 0
    status = ""
    placed = settings.within_limits, settings.pose_weights
    ends = [end]
    if within_reach:
        ends = _distinct(
            nearest_configurations(
                robot, q, pose, *placed, enough=_ENDS, settled=_ANYWHERE, least=_FEWEST
            )
        )
        ends = [each for each in ends if max(pose.error(robot, each)) <= REACHED] or [end]
        ends.sort(key=lambda each: _line_energy(robot, q, each))
    for towards in (*ends[:1], None, *ends[1:]):
        goal = pose if within_reach else pose.reached_by(robot, end if towards is None else towards)
        velocity = np.zeros(robot.dof)
        if towards is not None:  # that of the path on a coarse grid is close to a geodesic's
            coarse = solve(
                Reach(robot, q, goal.position, goal.rotation, limits=False),
                grid=_COARSE,
                guess=line(metric, q, towards),
                throw=False,
            )
            iterations += coarse.stats.iterations
            velocity = coarse.path(0.0, 1) if coarse.stats.success else towards - q
        outcome = geodesic_to_pose(
            robot,
            q,
            goal.position,
            goal.rotation,
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
    path: Path = line(metric, q, q)
    if found:
        best = nearest_of(found)
        path = best.path or path
        status = best.status
    error = pose.error(robot, path.nodes[-1])
    return Transfer(path, pose, within_reach, *error, iterations, bool(found), status)


def _distinct(configurations: Sequence[Array]) -> list[Array]:
    kept: list[Array] = []
    for q in configurations:
        if all(np.abs(q - other).max() > _SAME for other in kept):
            kept.append(q)
    return kept


def _line_energy(arm: Model, q0: Array, q1: Array) -> float:
    """Return energy of the straight line, with the mass matrix at three of its points."""
    matrices = [arm.mass_matrix(q0 + s * (q1 - q0)) for s in (0.0, 0.5, 1.0)]
    return float((q1 - q0) @ np.mean(matrices, axis=0) @ (q1 - q0))
