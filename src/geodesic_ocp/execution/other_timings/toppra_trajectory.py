"""toppra_trajectory: the time-optimal trajectory along the paths, by TOPP-RA."""

from __future__ import annotations

import importlib
import logging
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Literal, get_args

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.other_timings.stacked_path import StackedPath, stack_paths
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

ToppraJunctions = Literal["blend", "stop"]
_GRID = 10  # grid points in each interval of the spline
_UNLIMITED = 1e4  # [N m or N], where a torque has no limit but others have


def toppra_trajectory(
    arms: ArmPaths | Sequence[ArmPaths],
    *,
    rate: float = 100.0,
    junctions: ToppraJunctions = "blend",
    points: int = 20,
    torque: bool = True,
) -> JointTrajectory:
    """The fastest trajectory along the paths within limits on velocity, acceleration and torque.

    By TOPP-RA (Pham and Pham, "A new approach to time-optimal path parameterization based on
    reachability analysis", 2018) from rest to rest; it has no limit on jerk, so accelerations jump.
    It needs a smooth path, and directions jump where paths meet: "blend" puts one cubic spline
    through all points, which rounds the kinks and leaves the paths by a part of the distance of the
    points; "stop" has a spline for each path and rests in between. Instants at which all arms rest
    are left out: it knows nothing of the person's timing.

    Args:
        arms: paths, limits and gravity of each arm; the arms keep step with each other.
        rate: samples per second [Hz].
        junctions: "blend" or "stop".
        points: steps between successive junctions.
        torque: whether torques, gravity included, are limited as well.

    Raises:
        ImportError: toppra is not installed.
        ValueError: another value of `junctions`, or limits on speed or acceleration are missing.
        NotConverged: no speed is low enough for the limits, as where gravity exceeds the torques.
    """
    if junctions not in get_args(ToppraJunctions):
        raise ValueError(f"junctions must be 'blend' or 'stop', got {junctions!r}")
    try:
        toppra = importlib.import_module("toppra")
    except ImportError:
        raise ImportError("toppra is missing: pip install 'geodesic_ocp[timing]'") from None
    logging.getLogger("toppra").setLevel(logging.ERROR)
    path = stack_paths(arms, points)
    cuts = path.junctions if junctions == "stop" else (0, len(path.positions) - 1)
    pieces = [_timed(toppra, path, start, stop, torque) for start, stop in pairwise(cuts)]
    ends = np.append(0.0, np.cumsum([piece.duration for piece in pieces]))

    def states(times: Array) -> list[Array]:
        found = np.empty((3, times.size, path.positions.shape[1]))
        at = np.clip(np.searchsorted(ends, times, side="right") - 1, 0, len(pieces) - 1)
        for k, piece in enumerate(pieces):
            within = np.clip(times[at == k] - ends[k], 0.0, piece.duration)
            if within.size:
                found[:, at == k] = [piece(within, order) for order in range(3)]
        return list(found)

    return path.sampled(states, float(ends[-1]), rate)


def _timed(toppra: Any, path: StackedPath, start: int, stop: int, torque: bool) -> Any:
    """The path from one position to another, timed from rest to rest."""
    lengths = path.lengths[start : stop + 1] - path.lengths[start]
    spline = toppra.SplineInterpolator(lengths, path.positions[start : stop + 1])
    limits, scheme = path.limits, toppra.constraint.DiscretizationType.Interpolation
    bounds = [np.stack([-each, each], axis=1) for each in (limits.velocity, limits.acceleration)]
    conditions = [
        toppra.constraint.JointVelocityConstraint(bounds[0]),
        toppra.constraint.JointAccelerationConstraint(bounds[1], scheme),
    ]
    if torque and np.any(np.isfinite(limits.torque)):
        largest = np.minimum(limits.torque, _UNLIMITED)
        conditions.append(
            toppra.constraint.JointTorqueConstraint(
                path.torque,
                np.stack([-largest, largest], axis=1),
                np.zeros(largest.size),
                scheme,
            )
        )
    count = _GRID * (lengths.size - 1)
    grid = np.interp(np.arange(count + 1) / _GRID, np.arange(lengths.size), lengths)
    program = toppra.algorithm.TOPPRA(
        conditions, spline, gridpoints=grid, parametrizer="ParametrizeConstAccel"
    )
    timed = program.compute_trajectory(0.0, 0.0)
    if timed is None:
        code = program.problem_data.return_code
        raise NotConverged(f"TOPP-RA found no trajectory along the path: {code}")
    return timed
