"""PlannedTrajectory, the result of `plan_trajectory`: the motion of all arms in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.limit_shares import LimitShares
from geodesic_ocp.execution.program.joint_spline import JointSpline
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

_ROUNDING = 1e-9


@dataclass(frozen=True)
class PathDeviation:
    """Largest distance of a trajectory from one of its paths.

    Attributes:
        joint: Euclidean distance of the configurations [rad or m].
        hand: distance of the hand from its own path [m].
    """

    joint: float
    hand: float


@dataclass(frozen=True, eq=False, repr=False)
class PlannedTrajectory:
    """The motion of all arms in time: a cubic spline, with continuous accelerations.

    Attributes:
        arms: with their paths and limits.
        edges: times (m + 1,) [s] in the recording at which any arm's path begins or ends.
        robot_edges: times (m + 1,) [s] of the same events in this trajectory.
        splines: of the joints of every arm.
        usage: of every arm, the largest fractions of its limits.
        path_deviation: of every arm, the distances from each of its paths.
        least_distances: smallest distances (m,) [m] of each clearance that was asked for.
        success: whether all limits are kept everywhere.
        status: in words.
        iterations: of Ipopt, in all rounds.
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

    def __repr__(self) -> str:
        largest = max((shares.largest for shares in self.usage), default=0.0)
        return (
            f"PlannedTrajectory({self.duration:.3g} s, {self.stretch:.3g} times the person's time, "
            f"{largest:.4g} of the limits at most, {self.status})"
        )

    @property
    def duration(self) -> float:
        """Of the trajectory [s]."""
        return float(self.robot_edges[-1])

    @property
    def stretch(self) -> float:
        """Duration over the person's."""
        return self.duration / float(self.edges[-1] - self.edges[0])

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Of all arms, with the number of the arm in front if two arms share a name."""
        names = [name for arm in self.arms for name in arm.robot.joint_names]
        if len(set(names)) == len(names):
            return tuple(names)
        return tuple(
            f"{number}/{name}"
            for number, arm in enumerate(self.arms)
            for name in arm.robot.joint_names
        )

    def robot_time(self, recording_times: ArrayLike) -> Array:
        """Times in the trajectory, from 0, for times of the recording [s]."""
        times = np.asarray(recording_times, dtype=float)
        return np.asarray(np.interp(times, self.edges, self.robot_edges))

    def states(self, times: ArrayLike, arm: int | None = None) -> tuple[Array, Array, Array, Array]:
        """Positions, velocities, accelerations and jerks of one arm or all arms, (k, n) each.

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
        q, v, a, j = (np.hstack(columns) for columns in zip(*parts, strict=True))
        still = ~inside[:, None]
        v, a, j = (np.where(still, 0.0, each) for each in (v, a, j))
        return q, v, a, j

    def sampled(self, rate: float = 100.0) -> JointTrajectory:
        """All joints at a uniform rate [Hz], from 0 on, with the torques of inverse dynamics.

        The last sample is the first one at or after the end of a trajectory that ends at rest, and
        holds still; it is the last one before the end of any other.

        Raises:
            ValueError: the rate is not positive.
        """
        rate = as_positive("rate", rate, "Hz")
        samples = self.duration * rate
        last = np.ceil(samples - _ROUNDING) if self.rest else np.floor(samples + _ROUNDING)
        times = np.arange(int(last) + 1) / rate
        q, v, a, _ = self.states(times)
        if self.rest:
            v[-1] = a[-1] = 0.0
        efforts, first = [], 0
        for arm in self.arms:
            own = slice(first, first + arm.robot.dof)
            force = arm.robot.inverse_dynamics(q[:, own], v[:, own], a[:, own], arm.gravity)
            efforts.append(force)
            first = own.stop
        units = tuple(unit for arm in self.arms for unit in arm.robot.units)
        return JointTrajectory(times, q, v, a, self.joint_names, units, np.hstack(efforts))


def path_deviations(arm: ArmPaths, spline: JointSpline, ends: Array) -> tuple[PathDeviation, ...]:
    """Distances of a spline from the paths that it follows between times `ends` (k + 1,) [s]."""
    found = []
    for path, start, end in zip(arm.paths, ends[:-1], ends[1:], strict=True):
        count = int(np.clip(100.0 * (end - start), 20, 400))
        q = spline(np.linspace(start, end, count))[0]
        curve = path(np.linspace(0.0, 1.0, 201))
        hands = [arm.robot.hand_pose(each)[1] for each in (q, curve)]
        found.append(PathDeviation(_farthest(q, curve), _farthest(*hands)))
    return tuple(found)


def _farthest(points: Array, curve: Sequence[Array] | Array) -> float:
    """Largest distance of points (k, d) from a polygon through (m, d)."""
    corners = np.asarray(curve)
    starts, sides = corners[:-1], np.diff(corners, axis=0)
    offsets = points[:, None, :] - starts
    squares = np.sum(sides**2, axis=1)
    products = np.sum(offsets * sides, axis=2)
    along = np.divide(products, squares, out=np.zeros_like(products), where=squares > 0.0)
    nearest = np.clip(along, 0.0, 1.0)[:, :, None] * sides
    distances = np.linalg.norm(offsets - nearest, axis=2)
    return float(distances.min(axis=1).max())
