"""Controllers that follow a reference: torques from the state of the robot."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, TypeAlias, get_args

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.replay.simulated_robot import SimulatedRobot, import_mujoco

Controller: TypeAlias = Literal["computed torque", "pd"]
# (q, v, reference q, v and a) -> torques, (n,) each
Torques: TypeAlias = Callable[[Array, Array, Array, Array, Array], Array]
InverseDynamics: TypeAlias = Callable[[Array, Array, Array], Array]  # of q, v and a
_POSTURES = 50  # of a reference, in which masses are compared


def make_controller(
    kind: Controller, robot: SimulatedRobot, frequency: float, postures: Array
) -> Torques:
    """The controller as a function of the state and the reference.

    With the error e of positions and w = 2 pi frequency:
    - computed torque: M(q) (a + 2 w e' + w^2 e) + C(q, v) v + g(q), so that e'' + 2 w e' + w^2 e is
      zero if the model is exact (Siciliano et al., "Robotics", 2009, section 8.5.2);
    - pd: D (2 w e' + w^2 e) + g(q), with the largest diagonal D of the mass matrix in the postures.

    Args:
        kind: which one.
        robot: the model that the controller has of the robot.
        frequency: natural frequency of the error, critically damped [Hz].
        postures: configurations (k, n) of the reference.

    Raises:
        ValueError: there is no such controller.
    """
    if kind not in get_args(Controller):
        known = " or ".join(repr(name) for name in get_args(Controller))
        raise ValueError(f"controller must be {known}, got {kind!r}")
    omega = 2.0 * np.pi * frequency
    inverse_dynamics = _inverse_dynamics(robot)
    still = np.zeros(postures.shape[1])
    if kind == "computed torque":

        def computed_torque(q: Array, v: Array, qr: Array, vr: Array, ar: Array) -> Array:
            return inverse_dynamics(q, v, ar + 2.0 * omega * (vr - v) + omega**2 * (qr - q))

        return computed_torque
    weights = _largest_diagonal(inverse_dynamics, postures)

    def pd(q: Array, v: Array, qr: Array, vr: Array, ar: Array) -> Array:
        feedback = weights * (2.0 * omega * (vr - v) + omega**2 * (qr - q))
        return feedback + inverse_dynamics(q, still, still)

    return pd


def _inverse_dynamics(robot: SimulatedRobot) -> InverseDynamics:
    mujoco = import_mujoco()
    native, data = robot.model, mujoco.MjData(robot.model)

    def torques(q: Array, v: Array, a: Array) -> Array:
        data.qpos[robot.positions] = q
        data.qvel[robot.velocities] = v
        data.qacc[robot.velocities] = a
        mujoco.mj_inverse(native, data)
        result: Array = data.qfrc_inverse[robot.velocities]
        return result

    return torques


def _largest_diagonal(inverse_dynamics: InverseDynamics, postures: Array) -> Array:
    """Of the mass matrix, (n,): the torque that accelerates one joint alone from rest."""
    rows = np.unique(np.linspace(0, len(postures) - 1, _POSTURES).astype(int))
    still, units = np.zeros(postures.shape[1]), np.eye(postures.shape[1])
    largest = still
    for q in postures[rows]:
        weight = inverse_dynamics(q, still, still)
        diagonal = [inverse_dynamics(q, still, unit) @ unit for unit in units] - weight
        largest = np.maximum(largest, diagonal)
    return largest
