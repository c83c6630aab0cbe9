"""compare_timings: trajectories of the same paths by several methods, side by side."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.check_trajectory import check_trajectory
from geodesic_ocp.execution.other_timings.ruckig_trajectory import ruckig_trajectory
from geodesic_ocp.execution.other_timings.stacked_path import configurations, junction_times
from geodesic_ocp.execution.other_timings.toppra_trajectory import toppra_trajectory
from geodesic_ocp.execution.planned_trajectory import PlannedTrajectory
from geodesic_ocp.table import Table
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

_DENSE = 200  # points between junctions from which distances are measured
_NEAR = 8  # pieces of each path with which Ruckig stays near it
_POINTS = (2, 40)  # on each path, with which TOPP-RA rounds the kinks
_TINY = float(np.finfo(float).tiny)
_NOTE = (
    "Fractions of the limits are the largest of all joints; the deviation from the paths is the "
    "largest distance of any sample of an arm, in joint space. TOPP-RA limits no jerk, Ruckig no "
    "torque, and neither keeps the person's timing. Ruckig goes from end to end of the paths on "
    f"its own way, or near them through {_NEAR} points of each."
)


def compare_timings(
    source: PlannedTrajectory | ArmPaths | Sequence[ArmPaths],
    *,
    others: Mapping[str, JointTrajectory] | None = None,
    rate: float = 1000.0,
) -> Table:
    """A planned trajectory beside the same paths timed by TOPP-RA and by Ruckig.

    Whoever cuts corners more is faster: beside a planned trajectory, TOPP-RA also has a row where
    it rounds the kinks about as far.

    Args:
        source: a planned trajectory, or the paths, limits and gravity of each arm.
        others: further trajectories of the same joints, by the names that the table gives them.
        rate: at which they are sampled, which the largest jerk depends on [Hz].

    Raises:
        ImportError: toppra or ruckig is not installed.
        ValueError: limits on speed or acceleration are missing, or `others` have other joints.
        NotConverged: one of the others found no trajectory.
    """
    rows: list[tuple[str | float, ...]] = []
    if isinstance(source, PlannedTrajectory):
        arms = source.arms
        rows.append(("planned", *_figures(arms, source.sampled(rate)), source.seconds))
    else:
        arms = (source,) if isinstance(source, ArmPaths) else tuple(source)
    for name, trajectory in (others or {}).items():
        rows.append((name, *_figures(arms, trajectory), float("nan")))
    methods: list[tuple[str, Callable[[], JointTrajectory]]] = [
        ("TOPP-RA, kinks rounded", partial(toppra_trajectory, arms, rate=rate)),
        ("TOPP-RA, stops", partial(toppra_trajectory, arms, rate=rate, junctions="stop")),
        ("Ruckig, passing", partial(ruckig_trajectory, arms, rate=rate)),
        ("Ruckig, passing, near", partial(ruckig_trajectory, arms, rate=rate, points=_NEAR)),
        ("Ruckig, stops", partial(ruckig_trajectory, arms, rate=rate, junctions="stop")),
    ]
    if isinstance(source, PlannedTrajectory):
        target = largest_deviation(arms, source.sampled(rate))
        methods.insert(1, ("TOPP-RA, as near as planned", partial(_as_near, arms, target, rate)))
    for name, method in methods:
        start = time.perf_counter()
        found = method()
        seconds = time.perf_counter() - start
        rows.append((name, *_figures(arms, found), seconds))
    header = (
        "method",
        "duration [s]",
        "velocity [limit]",
        "acceleration [limit]",
        "jerk [limit]",
        "torque [limit]",
        "deviation [rad]",
        "computed in [s]",
    )
    return Table(header, tuple(rows), _NOTE)


def _as_near(arms: Sequence[ArmPaths], deviation: float, rate: float) -> JointTrajectory:
    """By TOPP-RA, with the fewest points that leave the paths no farther, by bisection."""
    few, many = _POINTS
    while few < many:
        middle = (few + many) // 2
        if largest_deviation(arms, toppra_trajectory(arms, points=middle)) <= deviation:
            many = middle
        else:
            few = middle + 1
    return toppra_trajectory(arms, rate=rate, points=many)


def _figures(arms: Sequence[ArmPaths], trajectory: JointTrajectory) -> tuple[float, ...]:
    """Duration [s], fractions of the limits, and deviation from the paths [rad]."""
    check = check_trajectory(
        trajectory,
        [arm.robot for arm in arms],
        [arm.limits for arm in arms],
        gravity=np.array([arm.gravity for arm in arms]),
    )
    quantities = ("velocity", "acceleration", "jerk", "torque")
    shares = (float(check.usage[name].max()) for name in quantities)
    return trajectory.duration, *shares, largest_deviation(arms, trajectory)


def largest_deviation(arms: Sequence[ArmPaths], trajectory: JointTrajectory) -> float:
    """Largest distance [rad] of an arm's samples from its paths, in joint space."""
    ends = np.cumsum([arm.robot.dof for arm in arms])[:-1]
    return max(
        float(_distances(_dense(arm), positions).max())
        for arm, positions in zip(arms, np.split(trajectory.positions, ends, axis=1), strict=True)
    )


def _dense(arm: ArmPaths) -> Array:
    return configurations(arm, junction_times([arm], _DENSE))


def _distances(line: Array, points: Array) -> Array:
    """Distances of points (k, n) from a dense polyline (m, n), from the parts next to its nodes."""
    _, nearest = cKDTree(line).query(points)
    distances = []
    for offset in (-1, 0):
        start = np.clip(nearest + offset, 0, len(line) - 2)
        along = line[start + 1] - line[start]
        away = points - line[start]
        s = np.sum(away * along, axis=1) / np.maximum(np.sum(along**2, axis=1), _TINY)
        s = np.clip(s, 0.0, 1.0)
        distances.append(np.linalg.norm(away - s[:, None] * along, axis=1))
    return np.asarray(np.minimum(*distances))
