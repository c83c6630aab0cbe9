"""The paths of arms that move side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.execution.limits import JointLimits
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.path import Path


@dataclass(frozen=True, eq=False, repr=False)
class ArmPaths(ShortRepr):
    """The paths of one arm, to be travelled one after the other.

    Attributes:
        robot: the arm; its mass matrix, payload included, is the one that torques are made of.
        limits: limits of its joints.
        edges: times (k + 1,) [s] in the recording at which its k paths begin and end.
        paths: k of them; of zero length where the arm rests. Each begins where the one before ends.
        gravity: acceleration of free fall in the axes of the robot's base (3,) [m/s^2].
    """

    robot: Model
    limits: JointLimits
    edges: Array
    paths: Sequence[Path]
    gravity: Array = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))

    _shown = ("robot", "edges")

    @cached_property
    def ends(self) -> Array:
        """Configurations at the ends of the k paths (k + 1, n)."""
        return np.array([*(path(0.0) for path in self.paths), self.paths[-1](1.0)])


def joint_names(arms: Sequence[ArmPaths]) -> tuple[str, ...]:
    """Return joint names of all arms, after the number of the arm if two arms share a name."""
    names = [name for arm in arms for name in arm.robot.joint_names]
    if len(set(names)) == len(names):
        return tuple(names)
    numbered = enumerate(arms)
    return tuple(f"{k}/{name}" for k, arm in numbered for name in arm.robot.joint_names)


def joint_forces(
    robots: Sequence[Model], gravities: Sequence[Array], q: Array, v: Array, a: Array
) -> Array:
    """Return inverse dynamics of robots side by side at a state (N,) or at states (k, N) [N m or
    N].
    """
    ends = np.cumsum([robot.dof for robot in robots])[:-1]
    states = (np.split(each, ends, axis=-1) for each in (q, v, a))
    forces = [
        robot.inverse_dynamics(own_q, own_v, own_a, gravity)
        for robot, gravity, own_q, own_v, own_a in zip(robots, gravities, *states, strict=True)
    ]
    return np.concatenate(forces, axis=-1)
