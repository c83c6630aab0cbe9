"""plan_trajectory: the motion of robots along paths, within all limits."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr, as_positive, as_vector
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.execution.arm_paths import (
    SAME,
    ArmPaths,
    JointSpline,
    joint_forces,
    joint_names,
)
from geodesic_ocp.execution.clearance import Clearance, joined_clearance
from geodesic_ocp.execution.limits import LimitShares
from geodesic_ocp.execution.room_between import slower_between
from geodesic_ocp.execution.trajectory_rounds import (
    MOST_ROUNDS,
    TOLERANCE,
    slowed,
    solve_in_rounds,
)
from geodesic_ocp.progress import Progress, no_progress
from geodesic_ocp.synergies.scores import nearest_on_path
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

_MEET = 1e-6  # [rad or m]; successive paths meet, and end within the limits, up to this


def check_arms(arms: Sequence[ArmPaths]) -> None:
    """Check that the paths meet within limits, at edges that all arms share at both ends.

    Raises:
        ValueError: they do not, or gravity alone makes a configuration too heavy to hold.
    """
    if not arms:
        raise ValueError("arms must be at least one, got none")
    for number, arm in enumerate(arms):
        name = f"arms[{number}]"
        edges = np.asarray(arm.edges, dtype=float)
        count = len(arm.paths)
        dof = arm.robot.dof
        if edges.shape != (count + 1,) or not count or not np.all(np.diff(edges) > 0):
            raise ValueError(
                f"{name}.edges must be {count + 1} increasing times for {count} paths, got {edges}"
            )
        first = arms[0].edges[0]
        last = arms[0].edges[-1]
        if abs(edges[0] - first) > SAME or abs(edges[-1] - last) > SAME:
            raise ValueError(
                f"all arms must begin and end at the same times: {name} from {edges[0]:.6g} to "
                f"{edges[-1]:.6g} s, arms[0] from {first:.6g} to {last:.6g} s"
            )
        as_vector(f"{name}.gravity", arm.gravity, 3)
        if arm.limits.velocity.size != dof:
            raise ValueError(
                f"{name}.limits.velocity must be {dof} numbers, got {arm.limits.velocity.size}"
            )
        for number, path in enumerate(arm.paths):
            if path.metric.dim != dof:
                raise ValueError(f"{name}.paths[{number}] is not a path of {dof} joints")
        _check_ends(name, arm)


def _check_ends(name: str, arm: ArmPaths) -> None:
    """Check that paths meet within the limits, where the arm can be held against gravity."""
    robot = arm.robot
    ends = arm.ends
    for number, (before, after) in enumerate(pairwise(arm.paths), 1):
        gap = float(np.abs(before(1.0) - after(0.0)).max())
        if gap > _MEET:
            raise ValueError(
                f"{name}.paths[{number}] must begin where the one before ends; the distance is "
                f"{gap:.3g} in the worst joint"
            )
    beyond = np.maximum(robot.lower - ends, ends - robot.upper)
    if beyond.max() > _MEET:
        edge, joint = np.unravel_index(beyond.argmax(), beyond.shape)
        raise ValueError(
            f"{name} is beyond its limits at the end of a path: {robot.joint_names[joint]} by "
            f"{beyond[edge, joint]:.3g} {robot.units[joint]} at {arm.edges[edge]:.4g} s"
        )
    still = np.zeros_like(ends)
    shares = np.abs(robot.inverse_dynamics(ends, still, still, arm.gravity)) / arm.limits.torque
    if shares.max() > 1.0:
        edge, joint = np.unravel_index(shares.argmax(), shares.shape)
        limit = float(arm.limits.torque[joint])
        unit = "N m" if robot.units[joint] == "rad" else "N"
        raise ValueError(
            f"{name} is too weak for its own weight at {arm.edges[edge]:.4g} s, however slowly it "
            f"moves: {robot.joint_names[joint]} has to bear {shares[edge, joint] * limit:.4g}, and "
            f"its limit is {limit:.4g} {unit}"
        )


def attainable(arms: Sequence[ArmPaths], clearance: Clearance) -> tuple[Clearance, str]:
    """Return the clearance without the distances that the ends of the paths violate, and a sentence
    on these.
    """
    lower = clearance.lower.copy()
    sentence = ""
    for instant in arms[0].edges:
        # Configurations of all arms are given together only where paths of all of them end.
        gaps = [np.abs(arm.edges - instant) for arm in arms]
        if max(gap.min() for gap in gaps) > SAME or not lower.size:
            continue
        q = np.concatenate([arm.ends[gap.argmin()] for arm, gap in zip(arms, gaps, strict=True)])
        distances = clearance.function(q).full()[:, 0]
        lack = clearance.lower - distances
        worst = int(lack.argmax())
        if lack[worst] > TOLERANCE and not sentence:
            sentence = (
                f"{clearance.names[worst]} is {distances[worst]:.3g} m at {instant:.4g} s, where "
                "the paths fix the configuration, and has to be "
                f"{clearance.lower[worst]:.3g} m"
            )
        lower[lack > TOLERANCE] = -np.inf
    return replace(clearance, lower=lower), sentence


_ROUNDING = 1e-6  # of a sample, as durations are found to some 1e-8 s


@dataclass(frozen=True)
class PathDeviation:
    """Largest distance of a trajectory from one of its paths.

    Attributes:
        joint: Euclidean distance of the configurations [rad or m].
        hand: distance of the hand from its own path [m]; the largest of a body's hands.
    """

    joint: float
    hand: float


@dataclass(frozen=True, eq=False, repr=False)
class PlannedTrajectory(ShortRepr):
    """The motion of all arms in time: a cubic spline, with continuous accelerations.

    Attributes:
        arms: arms with their paths and limits.
        edges: times (m + 1,) [s] in the recording at which any arm's path begins or ends.
        robot_edges: times (m + 1,) [s] of the same events in this trajectory.
        splines: splines of the joints of every arm.
        usage: usage of every arm, the largest fractions of its limits.
        path_deviation: path deviation of every arm, the distances from each of its paths.
        least_distances: smallest distances (m,) [m] of each clearance that was asked for.
        success: whether all limits are kept everywhere.
        status: in words.
        iterations: iterations of Ipopt, in all rounds.
        seconds: computing time.
        rest: whether it begins and ends at rest.
    """

    arms: tuple[ArmPaths, ...]
    edges: Array
    robot_edges: Array
    splines: tuple[JointSpline, ...]
    usage: tuple[LimitShares, ...]
    path_deviation: tuple[tuple[PathDeviation, ...], ...]
    least_distances: tuple[Array, ...]
    success: bool
    status: str
    iterations: int
    seconds: float
    rest: bool = True
    _shown = ("duration", "stretch", "success", "status")

    @property
    def duration(self) -> float:
        """Duration of the trajectory [s]."""
        return float(self.robot_edges[-1])

    @property
    def stretch(self) -> float:
        """Duration over the person's."""
        return self.duration / float(self.edges[-1] - self.edges[0])

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joint names of all arms, after the number of the arm if two arms share a name."""
        return joint_names(self.arms)

    def robot_time(self, recording_times: ArrayLike) -> Array:
        """Return times in the trajectory, from 0, for times of the recording [s]."""
        times = np.asarray(recording_times, dtype=float)
        return np.asarray(np.interp(times, self.edges, self.robot_edges))

    def states(self, times: ArrayLike, arm: int | None = None) -> tuple[Array, Array, Array, Array]:
        """Return positions, velocities, accelerations and jerks of one arm or all arms, (k, n)
        each.

        Jerks are those that follow a time. Outside the trajectory the robot is where it begins or
        ends, and still.

        Args:
            times: (k,) [s].
            arm: number of the arm; None: the joints of all arms, one arm after the other.

        Raises:
            ValueError: the times are not finite or not (k,), or there is no such arm.
        """
        instants = np.asarray(times, dtype=float)
        if instants.ndim != 1 or not np.all(np.isfinite(instants)):
            raise ValueError(f"times must be finite, of shape (k,), got {times!r}")
        if arm is not None and not 0 <= arm < len(self.arms):
            raise ValueError(f"arm must be from 0 to {len(self.arms) - 1}, got {arm!r}")
        chosen = self.splines if arm is None else self.splines[arm : arm + 1]
        slack = _ROUNDING * max(self.duration, 1.0)
        inside = (instants >= -slack) & (instants <= self.duration + slack)
        parts = [spline(np.clip(instants, 0.0, self.duration)) for spline in chosen]
        q, *rates = (np.hstack(columns) for columns in zip(*parts, strict=True))
        v, a, j = (np.where(inside[:, None], each, 0.0) for each in rates)
        return q, v, a, j

    def sampled(self, rate: float = 100.0, arm: int | None = None) -> JointTrajectory:
        """Return joints at a uniform rate [Hz], from 0 on, with the torques of inverse dynamics.

        The last sample is the first one at or after the end of a trajectory that ends at rest, and
        holds still; it is the last one before the end of any other.

        Args:
            rate: samples per second.
            arm: number of the arm; None: the joints of all arms, one arm after the other.

        Raises:
            ValueError: the rate is not positive, or there is no such arm.
        """
        rate = as_positive("rate", rate, "Hz")
        samples = self.duration * rate
        last = np.ceil(samples - _ROUNDING) if self.rest else np.floor(samples + _ROUNDING)
        times = np.arange(int(last) + 1) / rate
        q, v, a, _ = self.states(times, arm)
        if self.rest:
            v[-1] = a[-1] = 0.0
        arms = self.arms if arm is None else self.arms[arm : arm + 1]
        robots = [each.robot for each in arms]
        efforts = joint_forces(robots, [each.gravity for each in arms], q, v, a)
        units = tuple(unit for robot in robots for unit in robot.units)
        return JointTrajectory(times, q, v, a, joint_names(arms), units, efforts)


def path_deviations(arm: ArmPaths, spline: JointSpline, ends: Array) -> tuple[PathDeviation, ...]:
    """Return distances of a spline from the paths that it follows between times `ends` (k + 1,)
    [s].
    """
    found = []
    for path, (start, end) in zip(arm.paths, pairwise(ends), strict=True):
        count = int(np.clip(100.0 * (end - start), 20, 400))
        q = spline(np.linspace(start, end, count))[0]
        curve = path(np.linspace(0.0, 1.0, 201))
        hands = (
            [arm.robot.frame_pose(hand, each)[1] for each in (q, curve)] for hand in arm.robot.hands
        )
        joint, *others = (
            float(np.linalg.norm(points - nearest_on_path(points, way), axis=1).max())
            for points, way in ((q, curve), *hands)
        )
        found.append(PathDeviation(joint, max(others)))
    return tuple(found)


def plan_trajectory(
    arms: ArmPaths | Sequence[ArmPaths],
    *,
    rest: bool = True,
    clearances: Sequence[Clearance] = (),
    deviation_weight: float = 1.0,
    rate: float = 100.0,
    progress: Progress = no_progress,
    throw: bool = True,
) -> PlannedTrajectory:
    """Return the motion of all arms along their paths, as near to the person's timing as limits
    allow.

    A cubic spline in time, from a nonlinear program that is solved by Ipopt: positions, velocities
    and accelerations are continuous, and they, jerks and torques (inverse dynamics with gravity)
    are within the limits everywhere. Velocities, accelerations and jerks of the quintics by which
    controllers interpolate its samples are as well (`slower_between`). No interval between edges is
    shorter than the person's. The time beyond it is what is minimized, together with the distance
    from the paths; in corners between paths, which the arms pass without stopping, the trajectory
    leaves them.

    >>> import numpy as np
    >>> import geodesic_ocp as go
    >>> arm, q = go.human_arm(), [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1]
    >>> path = go.geodesic(go.KineticEnergy(arm), q, [1.2, -0.2, -0.9, 1.6, -0.3, 0.1, 0.4])
    >>> limits = go.execution.joint_limits(arm, velocity=4.0, acceleration=20.0, jerk=200.0)
    >>> paths = go.execution.ArmPaths(arm, limits, np.array([0.0, 1.0]), [path])
    >>> planned = go.execution.plan_trajectory(paths)
    >>> planned.success, round(planned.duration, 6)
    (True, 1.0)

    Args:
        arms: one or several, with their paths, limits and gravity; all begin and end at the same
            times.
        rest: whether the trajectory begins and ends at rest; otherwise its speed there is near the
            person's.
        clearances: distances to keep.
        deviation_weight: deviation weight of the squared distance from the paths against the time.
            At 1, a distance of 0.1 rad that is kept up all the time costs as much as doubling the
            time.
        rate: samples per second that a controller will receive [Hz], or more.
        progress: called in every round; there are at most fifteen, and three as a rule.
        throw: raise if no trajectory within the limits is found; otherwise return the last attempt,
            whose `success` is False.

    Raises:
        ValueError: paths that do not meet, edges that do not increase or differ between arms, a
            configuration beyond its limits, or one that gravity alone makes too heavy to hold.
        NotConverged: no trajectory within the limits was found; `solution` is the last attempt.
    """
    begin = time.perf_counter()
    arms = (arms,) if isinstance(arms, ArmPaths) else tuple(arms)
    weight = as_positive("deviation_weight", deviation_weight)
    rate = as_positive("rate", rate, "Hz")
    check_arms(arms)
    dof = sum(arm.robot.dof for arm in arms)
    for clearance in clearances:
        if clearance.dof != dof:
            raise ValueError(
                f"clearances must be functions of the {dof} joints of all arms, got {clearance!r}"
            )
    possible, hopeless = attainable(arms, joined_clearance(clearances, dof))
    if throw and hopeless:
        raise NotConverged(f"no trajectory keeps the distances: {hopeless}")
    found = solve_in_rounds(
        arms,
        possible,
        rest=bool(rest),
        deviation_weight=weight,
        progress=lambda number: progress("trajectory", number, MOST_ROUNDS),
    )
    if found.success:
        found = slowed(found, slower_between(found.checks, 1.0 / rate, bool(rest)))
    knots = found.program.knots
    times = knots.times(found.states.durations)
    sizes = [len(each.names) for each in clearances]
    least = np.split(found.distances.min(axis=(0, 1)), np.cumsum(sizes)[:-1])
    planned = PlannedTrajectory(
        arms=arms,
        edges=knots.edges,
        robot_edges=times[knots.at_edges],
        splines=tuple(check.spline for check in found.checks),
        usage=tuple(check.shares for check in found.checks),
        path_deviation=tuple(
            path_deviations(check.arm, check.spline, times[knots.of(check.arm.edges)])
            for check in found.checks
        ),
        least_distances=tuple(least[: len(sizes)]),
        success=found.success and not hopeless,
        status=hopeless or found.status,
        iterations=found.iterations,
        seconds=time.perf_counter() - begin,
        rest=bool(rest),
    )
    if throw and not planned.success:
        raise NotConverged(f"no trajectory within the limits was found: {found.status}", planned)
    return planned
