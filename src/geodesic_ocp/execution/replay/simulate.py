"""Simulation of a robot under a controller with limited torques."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.execution.replay.controllers import Torques
from geodesic_ocp.execution.replay.simulated_robot import SimulatedRobot, import_mujoco
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

_DIVERGED = 1e6  # [rad/s or m/s]


def simulate(
    robot: SimulatedRobot, reference: JointTrajectory, controller: Torques, largest: Array
) -> tuple[Array, Array, Array]:
    """Positions, velocities and torques (k, n) of a robot that follows the reference.

    The robot starts in the state of the first sample. Torques are constant for one step of the
    simulation, which is that of the reference.

    Args:
        robot: as it is simulated.
        reference: k samples, evenly spaced by the timestep of the simulation.
        controller: torques from state and reference.
        largest: magnitudes (n,) to which torques are cut [N m or N].

    Raises:
        IntegrationFailed: the motion diverges; says when.
    """
    mujoco = import_mujoco()
    native, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[robot.positions] = reference.positions[0]
    data.qvel[robot.velocities] = reference.velocities[0]
    q, v, torques = (np.empty_like(reference.positions) for _ in range(3))
    samples = zip(reference.positions, reference.velocities, reference.accelerations, strict=True)
    for k, sample in enumerate(samples):
        q[k], v[k] = data.qpos[robot.positions], data.qvel[robot.velocities]
        torques[k] = np.clip(controller(q[k], v[k], *sample), -largest, largest)
        data.qfrc_applied[robot.velocities] = torques[k]
        if k + 1 < len(q):
            mujoco.mj_step(native, data)
            if not np.abs(data.qvel).max() < _DIVERGED:
                time = float(reference.time[k + 1] - reference.time[0])
                raise IntegrationFailed(
                    f"the simulated robot diverges {time:.3g} s after the start: the controller is "
                    "unstable for it; lower its frequency or raise the rate",
                    time,
                    q[k],
                )
    return q, v, torques
