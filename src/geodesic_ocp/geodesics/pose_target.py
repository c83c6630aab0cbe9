"""A pose that a geodesic's end is to come near to, and what a search returns of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.kinetic_energy import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.ik.pose_error import rotation_log


class Found(NamedTuple):
    """An initial velocity (n,), iterations, whether it is a solution, and a sentence."""

    velocity: Array
    iterations: int
    success: bool
    status: str


@dataclass(frozen=True, eq=False)
class Target:
    """A pose to come near to from a configuration; weights that are zero leave it free.

    Attributes:
        model: whose hand it is.
        q0: configuration to start from (n,).
        position, rotation: of the hand (3,), (3, 3).
        weights: of both (2,).
    """

    model: Model
    q0: Array
    position: Array
    rotation: Array
    weights: Array

    @property
    def metric(self) -> KineticEnergy:
        """Of the model, the same object for the same model."""
        return metric_of(self.model)

    def miss(self, q: Array) -> Array:
        """Weighted position and rotation vector (6,) from the hand at q to the pose."""
        pose = self.model.hand_pose(q)
        missed = miss_function()(*pose, self.position, self.rotation, self.weights)
        return np.asarray(missed.full()[:, 0])


@lru_cache(maxsize=32)
def metric_of(model: Model) -> KineticEnergy:
    """The model's metric, whose functions are built once."""
    return KineticEnergy(model)


@lru_cache(maxsize=1)
def miss_function() -> ca.Function:
    """Pose, pose wanted and weights (2,) -> weighted difference (6,), in the base's axes."""
    rotation, wanted = ca.SX.sym("R", 3, 3), ca.SX.sym("R1", 3, 3)
    position, place, weights = ca.SX.sym("p", 3), ca.SX.sym("p1", 3), ca.SX.sym("w", 2)
    away = weights[0] * (place - position)
    turned = weights[1] * rotation_log(wanted @ rotation.T)
    inputs = [rotation, position, place, wanted, weights]
    return ca.Function("miss", inputs, [ca.vertcat(away, turned)])
