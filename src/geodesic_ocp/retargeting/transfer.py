"""Paths of a robot to poses of its hand, one for each synergy.

Those of the program over all synergies (`SynergyPaths`), or free geodesics, each from where the
previous one ended, as in Klein, Jaquier, Meixner, Asfour (2022).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.logarithm.geodesic_to_pose import ToPose, geodesic_to_pose, nearest_of
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import metric_of
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.problems import Reach
from geodesic_ocp.ocp.solve import solve
from geodesic_ocp.progress import Progress
from geodesic_ocp.retargeting.candidates import Candidates
from geodesic_ocp.retargeting.key_poses import (
    REACHED,
    PairedArm,
    Pose,
    checked_start,
    middle_of_ranges,
    nearest_configurations,
)
from geodesic_ocp.retargeting.settings import RetargetingSettings
from geodesic_ocp.retargeting.synergy_paths import PlannedPaths
from geodesic_ocp.retargeting.waypoints import ArmWaypoints
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

_COARSE = Grid(8, 2)
_THERE = 1e-3 * REACHED
_SOLUTIONS, _FEWEST, _ENDS = 5, 4, 10  # of inverse kinematics
_ANYWHERE = 0.2  # how near inverse kinematics comes to the configuration it starts from [rad or m]
_SAME = 0.1  # [rad or m]
OUT_OF_REACH = "the pose is out of reach; the path ends at the nearest one"
TOO_NEAR = "links would come too near at the pose; the path ends at the nearest one that is clear"
NEAR_MISS = "the path ends near the pose, which it would attain by a detour only"

# Distance [m] and angle [rad] of the nearest pose, for poses out of reach, by number of the pose: 0
# is the first pose, k the end of synergy k, counted from 1.
OutOfReach = Mapping[int, tuple[float, float]]


@dataclass(frozen=True, eq=False, repr=False)
class Transfer(ShortRepr):
    """A path of a robot to a target pose of its hand.

    Attributes:
        path: path of least energy under the constraints; of zero length if the arm rests.
        pose: the target.
        within_reach: whether inverse kinematics found a configuration with that pose.
        position_error, rotation_error: position error and rotation error of the hand at the path's
            end [m], [rad].
        iterations: iterations of Ipopt, on all grids.
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
    _shown = ("position_error", "rotation_error", "status")


def unattained(
    pair: PairedArm, waypoints: ArmWaypoints, layers: Sequence[Candidates]
) -> OutOfReach:
    """Return poses that none of the candidates at the waypoints attains."""
    numbers = [k for k, group in enumerate(pair.groups, 1) if group.kind != "rest"]
    found = {}
    for number, pose, layer in zip((0, *numbers), waypoints.poses, layers, strict=False):
        error = pose.error(pair.robot, layer.q[0])
        # A given start need not have the first pose.
        if not layer.within_reach and max(error) > REACHED:
            found[number] = error
    return found


def transfers_on(
    pair: PairedArm, paths: PlannedPaths, arm: int, out_of_reach: OutOfReach
) -> list[Transfer]:
    """Return the transfers of the arm with this number, from the program over all synergies."""
    each, q = iter(paths.paths[arm]), paths.starts[arm]
    within, missed = iter(paths.within_reach[arm][1:]), iter(paths.near_misses[arm][1:])
    found: list[Transfer] = []
    for number, group in enumerate(pair.groups, 1):
        if group.kind == "rest":
            found.append(_at_rest(pair.robot, q))
            continue
        path, is_attained, was_missed, status = next(each), next(within), next(missed), paths.status
        q, pose = path.nodes[-1], pair.target(group.stop)
        if number in out_of_reach:
            status = OUT_OF_REACH
        elif not is_attained:
            status = NEAR_MISS if was_missed else TOO_NEAR
        errors = pose.error(pair.robot, q)
        found.append(
            Transfer(path, pose, is_attained, *errors, paths.iterations, paths.success, status)
        )
    return found


@dataclass(frozen=True, eq=False, repr=False)
class FreeGeodesics(ShortRepr):
    """Free geodesics of a robot to the poses of a person's hand, in turn.

    Attributes:
        pair: person and robot.
        start: configuration (n,) to begin in.
        ends: for each group a configuration with its pose, or with the nearest one; None: it rests.

    Raises:
        ValueError: a given start is out of range.
    """

    pair: PairedArm
    start: Array
    ends: tuple[Array | None, ...]

    @classmethod
    def of(cls, pair: PairedArm, start: ArrayLike | None) -> FreeGeodesics:
        """Begin at a start, or at a configuration with the first pose near the middle."""
        robot, settings = pair.robot, pair.settings
        placed = settings.within_limits, settings.pose_weights
        if start is None:
            first, middle = pair.target(pair.groups[0].start), middle_of_ranges(robot)[0]
            near = nearest_configurations(robot, middle, first, *placed, enough=_SOLUTIONS)[0]
        else:
            near = checked_start(robot, start, settings)
        begin, ends = near, list[Array | None]()
        for group in pair.groups:
            if group.kind == "rest":
                ends.append(None)
                continue
            pose = pair.target(group.stop)
            near = nearest_configurations(robot, near, pose, *placed, settled=_ANYWHERE)[0]
            ends.append(near)
        return cls(pair, begin, tuple(ends))

    @property
    def out_of_reach(self) -> OutOfReach:
        """Poses that the ends do not attain."""
        pair = self.pair
        errors = {
            number: pair.target(group.stop).error(pair.robot, end)
            for number, (group, end) in enumerate(zip(pair.groups, self.ends, strict=True), 1)
            if end is not None
        }
        return {number: error for number, error in errors.items() if max(error) > REACHED}

    def transfers(self, throw: bool, progress: Progress) -> list[Transfer]:
        """Return a geodesic to each pose from where the previous one ended.

        Args:
            throw: raise if one is not found; else the arm rests and continues with the next pose.
            progress: called with the current step, the amount done and the total.

        Raises:
            NotConverged: a geodesic was not found; the message gives its number.
        """
        robot, q, found = self.pair.robot, self.start, list[Transfer]()
        for number, (group, end) in enumerate(zip(self.pair.groups, self.ends, strict=True), 1):
            if end is None:
                found.append(_at_rest(robot, q))
            else:
                pose = self.pair.target(group.stop)
                found.append(to_pose(robot, q, pose, end, self.pair.settings))
            if throw and not found[-1].success:
                raise NotConverged(f"synergy {number}: {found[-1].status}")
            q = found[-1].path.nodes[-1]
            progress(f"planning {robot.name}", number, len(self.ends))
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
    iterations, reached, status = 0, 0, ""
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
            *(robot, q, goal.position, goal.rotation),
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
        path, status = best.path or path, best.status
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


def _at_rest(robot: Model, q: Array) -> Transfer:
    """Return the arm stays at a configuration (n,)."""
    metric, here = metric_of(robot), Pose(*robot.hand_pose(q))
    return Transfer(line(metric, q, q), here, True, 0.0, 0.0, 0, True, "the arm rests")


def line(metric: Metric, q0: Array, q1: Array) -> Path:
    """Return the straight line between two configurations."""
    return Path(metric, Grid(1, 2), np.array([q0, (q0 + q1) / 2.0, q1]))
