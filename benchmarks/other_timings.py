"""Planned trajectories beside the same paths timed by TOPP-RA and by Ruckig.

Usage: python benchmarks/other_timings.py FILE [FILE ...] [--side right] [--robots NAME ...]

Needs the extras comparison and robots. Prints a table in Markdown for each recording and robot.
"""

from __future__ import annotations

import argparse
import logging
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
import ruckig
import toppra
from pandas import DataFrame

import geodesic_ocp as go
from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.execution.arm_paths import ArmPaths, joint_forces, joint_names
from geodesic_ocp.execution.check_trajectory import check_trajectory
from geodesic_ocp.execution.limits import QUANTITIES, JointLimits, joined_limits
from geodesic_ocp.execution.plan_trajectory import PlannedTrajectory
from geodesic_ocp.synergies.scores import nearest_on_path
from geodesic_ocp.tables import markdown, new_table
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

_STILL = 1e-9  # [rad or m]: configurations nearer to each other are one
_GRID = 10  # grid points in each interval of the spline
_UNLIMITED = 1e4  # [N m or N], where a torque has no limit but others have
_ROUNDS = 8  # of durations and passing velocities found from each other
_DENSE = 200  # points between junctions from which distances are measured
_NEAR = 8  # pieces of each path with which Ruckig stays near it
_POINTS = (2, 40)  # on each path, with which TOPP-RA rounds the kinks
_NOTE = (
    "Fractions of the limits are the largest of all joints; the deviation from the paths is the "
    "largest distance of any sample of an arm, in joint space. TOPP-RA limits no jerk, Ruckig no "
    "torque, and neither keeps the person's timing. Ruckig goes from end to end of the paths on "
    f"its own way, or near them through {_NEAR} points of each."
)


@dataclass(frozen=True, eq=False)
class StackedPath:
    """Configurations of all arms' joints, N altogether, along their paths.

    Attributes:
        arms: whose paths they are.
        positions: (m, N) [rad or m]; instants at which all arms rest are left out.
        lengths: Euclidean distance along them from the start (m,).
        junctions: indices of the positions at which a path of any arm begins or ends.
        limits: of all joints.
    """

    arms: tuple[ArmPaths, ...]
    positions: Array
    lengths: Array
    junctions: tuple[int, ...]
    limits: JointLimits

    def torque(self, q: Array, v: Array, a: Array) -> Array:
        """Inverse dynamics of all arms (N,) [N m or N]."""
        robots, gravities = zip(*((arm.robot, arm.gravity) for arm in self.arms), strict=True)
        return joint_forces(robots, gravities, q, v, a)

    def sampled(
        self, states: Callable[[Array], Sequence[Array]], duration: float, rate: float
    ) -> JointTrajectory:
        """Positions, velocities and accelerations, (k, N) each at times (k,), sampled evenly.

        Time is stretched to a whole number of steps, by less than one step altogether.
        """
        steps = max(int(np.ceil(duration * rate * (1.0 - 1e-9))), 1)
        stretch = steps / rate / duration
        q, v, a = states(np.linspace(0.0, duration, steps + 1))
        return JointTrajectory(
            np.arange(steps + 1) / rate,
            q,
            v / stretch,
            a / stretch**2,
            joint_names(self.arms),
            tuple(unit for arm in self.arms for unit in arm.robot.units),
        )


def stack_paths(arms: ArmPaths | Sequence[ArmPaths], points: int) -> StackedPath:
    """The paths with `points` even steps between successive junctions of any arm.

    The arms keep step with each other as in the recording.

    Raises:
        ValueError: no arm moves, or a joint has no limit on its speed or its acceleration.
    """
    parts = (arms,) if isinstance(arms, ArmPaths) else tuple(arms)
    limits = joined_limits([arm.limits for arm in parts])
    if not np.all(np.isfinite(limits.velocity) & np.isfinite(limits.acceleration)):
        raise ValueError("arms must have finite limits on speeds and accelerations to be timed")
    instants = junction_times(parts, points)
    positions = np.hstack([configurations(arm, instants) for arm in parts])
    moves = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    kept = np.append(True, moves > _STILL)
    if not np.any(kept[1:]):
        raise ValueError("arms: no path has a length, so there is nothing to be timed")
    number = np.cumsum(kept) - 1
    junctions = tuple(dict.fromkeys(number[::points].tolist()))
    lengths = np.append(0.0, np.cumsum(moves))[kept]
    return StackedPath(parts, positions[kept], lengths, junctions, limits)


def junction_times(arms: Sequence[ArmPaths], points: int) -> Array:
    """Times of the recording [s], `points` even steps between successive junctions of any arm."""
    edges = np.unique(np.concatenate([arm.edges for arm in arms]))
    count = points * (edges.size - 1) + 1
    return np.asarray(np.interp(np.arange(count) / points, np.arange(edges.size), edges))


def configurations(arm: ArmPaths, instants: Array) -> Array:
    """Where the arm is at instants of the recording (m, n), at even speed along each path."""
    edges = np.asarray(arm.edges, dtype=float)
    at = np.clip(np.searchsorted(edges, instants, side="right") - 1, 0, len(arm.paths) - 1)
    s = np.clip((instants - edges[at]) / np.diff(edges)[at], 0.0, 1.0)
    found = np.empty((instants.size, arm.robot.dof))
    for k, path in enumerate(arm.paths):
        found[at == k] = path(s[at == k])
    return found


def toppra_trajectory(
    arms: ArmPaths | Sequence[ArmPaths],
    *,
    rate: float = 100.0,
    junctions: Literal["blend", "stop"] = "blend",
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
        ValueError: limits on speed or acceleration are missing.
        NotConverged: no speed is low enough for the limits, as where gravity exceeds the torques.
    """
    logging.getLogger("toppra").setLevel(logging.ERROR)
    path = stack_paths(arms, points)
    cuts = path.junctions if junctions == "stop" else (0, len(path.positions) - 1)
    pieces = [_timed(path, start, stop, torque) for start, stop in pairwise(cuts)]
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


def _timed(path: StackedPath, start: int, stop: int, torque: bool) -> Any:
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


def ruckig_trajectory(
    arms: ArmPaths | Sequence[ArmPaths],
    *,
    rate: float = 100.0,
    junctions: Literal["pass", "stop"] = "pass",
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
        ValueError: limits on speed or acceleration are missing.
        NotConverged: Ruckig found no trajectory.
    """
    path = stack_paths(arms, points)
    still = np.zeros_like(path.positions)
    best = _pieces(path, still)
    if best is None:
        raise NotConverged("Ruckig found no trajectory between the junctions, at rest in each")
    found: list[Any] | None = best
    for _ in range(_ROUNDS if junctions == "pass" else 0):
        if found is None:
            break
        steps = np.array([piece.duration for piece in found])
        found = _pieces(path, _passing(path, steps))
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


def _pieces(path: StackedPath, velocities: Array) -> list[Any] | None:
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


def compare_timings(
    source: PlannedTrajectory | ArmPaths | Sequence[ArmPaths],
    *,
    others: Mapping[str, JointTrajectory] | None = None,
    rate: float = 1000.0,
) -> DataFrame:
    """A planned trajectory beside the same paths timed by TOPP-RA and by Ruckig.

    Whoever cuts corners more is faster: beside a planned trajectory, TOPP-RA also has a row where
    it rounds the kinks about as far.

    Args:
        source: a planned trajectory, or the paths, limits and gravity of each arm.
        others: further trajectories of the same joints, by the names that the table gives them.
        rate: at which they are sampled, which the largest jerk depends on [Hz].

    Raises:
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
    return new_table(header, tuple(rows), _NOTE)


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
    shares = (float(check.usage[name].max()) for name in QUANTITIES[:4])
    return trajectory.duration, *shares, largest_deviation(arms, trajectory)


def largest_deviation(arms: Sequence[ArmPaths], trajectory: JointTrajectory) -> float:
    """Largest distance [rad] of an arm's samples from its paths, in joint space."""
    ends = np.cumsum([arm.robot.dof for arm in arms])[:-1]
    farthest = []
    for arm, q in zip(arms, np.split(trajectory.positions, ends, axis=1), strict=True):
        path = configurations(arm, junction_times([arm], _DENSE))
        farthest.append(np.linalg.norm(q - nearest_on_path(q, path), axis=1).max())
    return float(max(farthest))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--side", choices=("right", "left"), default="right")
    parser.add_argument("--robots", nargs="+", default=["panda", "xarm7", "armar6-right"])
    options = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    arm = go.human_arm(options.side)
    for file in options.files:
        motion = go.read_motion(file, arm.joint_names)
        subject = motion.subject
        person = go.human_arm(options.side, subject.height or 1.75, subject.mass or 70.0)
        analysis = go.analyse(person, motion)
        for name in options.robots:
            planned = go.retarget(analysis, go.load_model(name)).planned
            ratio = f"{planned.stretch:.2f} times the person's {motion.duration:.2f} s"
            print(f"{file.stem} on {name}, planned in {ratio}:\n")
            print(markdown(compare_timings(planned)), flush=True)


if __name__ == "__main__":
    main()
