"""ruckig_trajectory: from junction to junction of the paths within limits on jerk, by Ruckig."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.other_timings.stacked_path import StackedPath, stack_paths
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

RuckigJunctions = Literal["pass", "stop"]
_ROUNDS = 8  # of durations and passing velocities found from each other


def ruckig_trajectory(
    arms: ArmPaths | Sequence[ArmPaths],
    *,
    rate: float = 100.0,
    junctions: RuckigJunctions = "pass",
    points: int = 1,
) -> JointTrajectory:
    """The fastest trajectory through the junctions within limits on velocity, acceleration, jerk.

    By Ruckig (Berscheid and Kröger, "Jerk-limited real-time trajectory generation with arbitrary
    target states", 2021), without the intermediate waypoints of its paid version: each piece ends
    at a given velocity and zero acceleration. "stop" rests there. "pass" has velocities that are
    zero for a joint which turns round and otherwise the harmonic mean of its mean velocities before
    and after, found together with the durations; of eight rounds, the fastest one is taken, rests
    included. Between junctions it does not follow the paths, and it knows no torques; more points
    bring it nearer to the paths and make it slower.

    Args:
        arms: paths and limits of each arm; the arms keep step with each other.
        rate: samples per second [Hz].
        junctions: "pass" or "stop".
        points: pieces between successive junctions of the paths.

    Raises:
        ImportError: ruckig is not installed.
        ValueError: another value of `junctions`, or limits on speed or acceleration are missing.
        NotConverged: Ruckig found no trajectory.
    """
    if junctions not in get_args(RuckigJunctions):
        raise ValueError(f"junctions must be 'pass' or 'stop', got {junctions!r}")
    try:
        ruckig = importlib.import_module("ruckig")
    except ImportError:
        raise ImportError("ruckig is missing: pip install 'geodesic_ocp[timing]'") from None
    path = stack_paths(arms, points)
    still = np.zeros_like(path.positions)
    best = _pieces(ruckig, path, still)
    if best is None:
        raise NotConverged("Ruckig found no trajectory between the junctions, at rest in each")
    found: list[Any] | None = best
    for _ in range(_ROUNDS if junctions == "pass" else 0):
        if found is None:
            break
        steps = np.array([piece.duration for piece in found])
        found = _pieces(ruckig, path, _passing(path, steps))
        if found is not None and _total(found) < _total(best):
            best = found
    ends = np.append(0.0, np.cumsum([piece.duration for piece in best]))

    def states(times: Array) -> list[Array]:
        at = np.clip(np.searchsorted(ends, times, side="right") - 1, 0, len(best) - 1)
        rows = [best[k].at_time(t - ends[k]) for k, t in zip(at, times, strict=True)]
        return [np.array([row[order] for row in rows]) for order in range(3)]

    return path.sampled(states, float(ends[-1]), rate)


def _total(pieces: Sequence[Any]) -> float:
    return float(sum(piece.duration for piece in pieces))


def _passing(path: StackedPath, steps: Array) -> Array:
    """Velocities (m, N) at the positions; at rest at both ends, monotone in between."""
    means = np.diff(path.positions, axis=0) / steps[:, None]
    before, after = means[:-1], means[1:]
    onward = before * after > 0.0
    sums = np.where(onward, before + after, 1.0)
    inner = np.where(onward, 2.0 * before * after / sums, 0.0)
    return np.pad(np.clip(inner, -path.limits.velocity, path.limits.velocity), ((1, 1), (0, 0)))


def _pieces(ruckig: Any, path: StackedPath, velocities: Array) -> list[Any] | None:
    """The fastest trajectories from one position to the next; None if one does not exist."""
    joints = path.positions.shape[1]
    generator = ruckig.Ruckig(joints)
    wanted = ruckig.InputParameter(joints)
    wanted.max_velocity = path.limits.velocity.tolist()
    wanted.max_acceleration = path.limits.acceleration.tolist()
    wanted.max_jerk = path.limits.jerk.tolist()
    wanted.synchronization = ruckig.Synchronization.Phase  # straight where possible
    pieces = []
    for k in range(len(path.positions) - 1):
        wanted.current_position = path.positions[k].tolist()
        wanted.current_velocity = velocities[k].tolist()
        wanted.target_position = path.positions[k + 1].tolist()
        wanted.target_velocity = velocities[k + 1].tolist()
        piece = ruckig.Trajectory(joints)
        try:
            if generator.calculate(wanted, piece) not in (
                ruckig.Result.Working,
                ruckig.Result.Finished,
            ):
                return None
        except ruckig.RuckigError:
            return None
        pieces.append(piece)
    return pieces
