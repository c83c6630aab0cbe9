"""Poses that a hand is to pass, and the velocity at which it follows them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.ik.pose_error import rotation_log
from geodesic_ocp.rotations import rotation_vector
from geodesic_ocp.synergies.baselines.track_hand import Poses


@dataclass(frozen=True, eq=False)
class HandTargets:
    """Poses of the hand at the ends of steps.

    Attributes:
        rotations: (k, 3, 3).
        positions: (k, 3) [m].
        velocities: translation [m/s] and rotation [rad/s] from each pose to the next (k - 1, 6).
    """

    rotations: Array
    positions: Array
    velocities: Array

    @classmethod
    def at(cls, poses: Poses, time: Array, step: float) -> HandTargets:
        """At times (k,) [s]."""
        rotations, positions = poses(time)
        turns = rotation_vector(rotations[1:] @ rotations[:-1].transpose(0, 2, 1))
        return cls(rotations, positions, np.hstack([np.diff(positions, axis=0), turns]) / step)


def through_samples(time: Array, rotations: Array, positions: Array) -> Poses:
    """Poses as a function of time, by cubic splines through samples (k, 3, 3) and (k, 3) [m]."""
    turning = RotationSpline(time, Rotation.from_matrix(rotations))
    moving = CubicSpline(time, positions)

    def poses(instants: Array) -> tuple[Array, Array]:
        return turning(instants).as_matrix(), np.asarray(moving(instants))

    return poses


@lru_cache(maxsize=32)
def _tracking(model: Model, rows: tuple[int, ...]) -> ca.Function:
    """q, rotation and position of the target -> Jacobian, error."""
    q, rotation, position = ca.SX.sym("q", model.dof), ca.SX.sym("R", 3, 3), ca.SX.sym("p", 3)
    here, at = model.hand_pose(q)
    error = ca.vertcat(position - at, rotation_log(rotation @ here.T))
    jacobian = ca.densify(model.hand_jacobian(q)[list(rows), :])
    outputs = ca.cse([jacobian, ca.densify(error[list(rows)])])
    return ca.Function("tracking", [q, rotation, position], outputs)


def jacobian_and_error(
    model: Model, rows: tuple[int, ...], q: Array, rotation: Array, position: Array
) -> tuple[Array, Array]:
    """Rows of the hand's Jacobian (r, n), and of the way [m, rad] to a pose (r,)."""
    jacobian, error = evaluate(_tracking(model, rows), q, rotation, position)
    return jacobian, error[:, 0]
