"""The paths of all arms as one sequence of configurations of all joints."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array, as_integer, as_positive
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.joint_limits import JointLimits
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

_STILL = 1e-9  # [rad or m]: configurations nearer to each other are one


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

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of all joints, with the number of the arm in front if two arms share a name."""
        names = [name for arm in self.arms for name in arm.robot.joint_names]
        if len(set(names)) == len(names):
            return tuple(names)
        numbered = enumerate(self.arms)
        return tuple(f"{k}/{name}" for k, arm in numbered for name in arm.robot.joint_names)

    def torque(self, q: Array, v: Array, a: Array) -> Array:
        """Inverse dynamics of all arms (N,) [N m or N]."""
        ends = np.cumsum([arm.robot.dof for arm in self.arms])[:-1]
        forces = []
        for k, arm in enumerate(self.arms):
            own_q, own_v, own_a = (np.split(np.asarray(each), ends)[k] for each in (q, v, a))
            forces.append(arm.robot.inverse_dynamics(own_q, own_v, own_a, arm.gravity))
        return np.concatenate(forces)

    def sampled(
        self, states: Callable[[Array], Sequence[Array]], duration: float, rate: float
    ) -> JointTrajectory:
        """Positions, velocities and accelerations, (k, N) each at times (k,), sampled evenly.

        Time is stretched to a whole number of steps, by less than one step altogether.
        """
        steps = max(int(np.ceil(duration * as_positive("rate", rate, "Hz") * (1.0 - 1e-9))), 1)
        stretch = steps / rate / duration
        q, v, a = states(np.linspace(0.0, duration, steps + 1))
        return JointTrajectory(
            np.arange(steps + 1) / rate,
            q,
            v / stretch,
            a / stretch**2,
            self.joint_names,
            tuple(unit for arm in self.arms for unit in arm.robot.units),
        )


def stack_paths(arms: ArmPaths | Sequence[ArmPaths], points: int) -> StackedPath:
    """The paths with `points` even steps between successive junctions of any arm.

    The arms keep step with each other as in the recording.

    Raises:
        ValueError: points is not a positive integer, no arm moves, or a joint has no limit on its
            speed or its acceleration.
    """
    parts = (arms,) if isinstance(arms, ArmPaths) else tuple(arms)
    steps = as_integer("points", points, 1)
    limits = JointLimits(
        np.concatenate([arm.limits.velocity for arm in parts]),
        np.concatenate([arm.limits.acceleration for arm in parts]),
        np.concatenate([arm.limits.jerk for arm in parts]),
        np.concatenate([arm.limits.torque for arm in parts]),
    )
    if not np.all(np.isfinite(limits.velocity) & np.isfinite(limits.acceleration)):
        raise ValueError("arms must have finite limits on speeds and accelerations to be timed")
    instants = junction_times(parts, steps)
    positions = np.hstack([configurations(arm, instants) for arm in parts])
    moves = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    kept = np.append(True, moves > _STILL)
    if not np.any(kept[1:]):
        raise ValueError("arms: no path has a length, so there is nothing to be timed")
    number = np.cumsum(kept) - 1
    junctions = tuple(dict.fromkeys(number[::steps].tolist()))
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
