"""The target pose of a geodesic's end, and the result of a search for such a geodesic."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metrics import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.ik.pose_error import rotation_log


class ShootingResult(NamedTuple):
    """Initial velocity (n,), iterations, whether it is a solution, and the status as a sentence."""

    velocity: Array
    iterations: int
    success: bool
    status: str


@dataclass(frozen=True, eq=False)
class PoseTarget:
    """A pose that the hand should reach from a configuration; zero weights leave it free.

    Attributes:
        model: whose hand it is.
        q0: initial configuration (n,).
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

    def pose_error(self, q: Array) -> Array:
        """Weighted position and rotation vector (6,) from the hand at q to the target."""
        pose = self.model.hand_pose(q)
        error = pose_error_function()(*pose, self.position, self.rotation, self.weights)
        return np.asarray(error.full()[:, 0])


@lru_cache(maxsize=32)
def metric_of(model: Model) -> KineticEnergy:
    """The kinetic-energy metric of a model, whose functions are built once."""
    return KineticEnergy(model)


@lru_cache(maxsize=1)
def pose_error_function() -> ca.Function:
    """Pose, target pose and weights (2,) -> weighted difference (6,), in the base frame."""
    rotation, target_rotation = ca.SX.sym("R", 3, 3), ca.SX.sym("R1", 3, 3)
    position, target_position = ca.SX.sym("p", 3), ca.SX.sym("p1", 3)
    weights = ca.SX.sym("w", 2)
    translation = weights[0] * (target_position - position)
    rotation_vector = weights[1] * rotation_log(target_rotation @ rotation.T)
    inputs = [rotation, position, target_position, target_rotation, weights]
    return ca.Function("pose_error", inputs, [ca.vertcat(translation, rotation_vector)])
