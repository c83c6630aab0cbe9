"""Reaching: from a posture to a pose of the hand, in whatever posture costs least."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_rotation, as_vector
from geodesic_ocp.manifold.kinetic_energy import KineticEnergy
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.posture import find_posture, rotation_error
from geodesic_ocp.ocp.problem import Equality, Inequality, Problem, along, as_speed


@dataclass(frozen=True, eq=False)
class Reach(Problem):
    """The geodesic from a posture to where the hand has a place, an orientation or both.

    What the hand leaves open of the final posture is free: the path arrives at a right angle to
    all postures with that pose (transversality). The straight line to a posture by inverse
    kinematics is where the search starts. Start and pose can change without a new NLP.

    Attributes:
        model: whose hand reaches; the metric is its kinetic energy.
        start: posture (n,) [rad or m].
        position: of the hand at the end, in the base's frame, (3,) [m]; None leaves it free.
        rotation: of the hand at the end, (3, 3); None leaves it free.
        limits: whether the joints stay within their limits.
        speed: largest |dq_j / ds|, for all joints or (n,); None: any.

    Raises:
        ValueError: wrong shapes or values, or neither position nor rotation.
    """

    model: Model
    start: ArrayLike
    position: ArrayLike | None = None
    rotation: ArrayLike | None = None
    limits: bool = True
    speed: float | tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", as_vector("start", self.start, self.model.dof))
        if self.position is None and self.rotation is None:
            raise ValueError("Reach needs a position, a rotation or both")
        if self.position is not None:
            object.__setattr__(self, "position", as_vector("position", self.position, 3))
        if self.rotation is not None:
            object.__setattr__(self, "rotation", as_rotation("rotation", self.rotation))
        object.__setattr__(self, "speed", as_speed(self.speed, self.model.dof))

    @property
    def metric(self) -> Metric:  # type: ignore[override]
        """Kinetic energy of the model."""
        return KineticEnergy(self.model)

    @property
    def parameters(self) -> Sequence[str]:  # type: ignore[override]
        """What is given of the hand's pose."""
        return [name for name in ("position", "rotation") if getattr(self, name) is not None]

    @property
    def structure(self) -> Hashable:
        """Model and kinds of conditions."""
        return (self.model, *self.parameters, self.limits, self.speed is None)

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Equality]:
        """The start, and the hand's pose at the end."""
        rotation, position = self.model.hand_pose(q1)
        wanted: dict[str, Any] = {name: getattr(self, name) for name in self.parameters}
        conditions: list[Equality] = [(q0, self.start, "start")]
        if "position" in wanted:
            conditions.append((position - ca.SX(wanted["position"]), 0.0, "position"))
        if "rotation" in wanted:
            error = rotation_error(rotation, ca.SX(wanted["rotation"]))
            conditions.append((error, 0.0, "rotation"))
        return conditions

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Inequality]:
        """Joint limits and speed, where they are asked for."""
        return along(self.model if self.limits else None, self.speed, q, v)

    def guess(self, s: Array) -> Array:
        """The straight line to the nearest posture with the pose.

        Raises:
            NotConverged: there is none.
        """
        start = np.asarray(self.start)
        goal = find_posture(self.model, start, self.position, self.rotation, limits=self.limits)
        return np.asarray(start + np.asarray(s)[:, None] * (goal - start))
