"""replay: a simulated robot follows a trajectory."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_positive, as_vector
from geodesic_ocp.execution.joint_limits import JointLimits, joint_limits
from geodesic_ocp.execution.replay.contacts import Contact, find_contacts
from geodesic_ocp.execution.replay.controllers import Controller, make_controller
from geodesic_ocp.execution.replay.result import Replay
from geodesic_ocp.execution.replay.simulate import simulate
from geodesic_ocp.execution.replay.simulated_robot import (
    SimulatedRobot,
    import_mujoco,
    simulated_robot,
)
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion

_CONTACTS_EVERY = 0.01  # [s]


def replay(
    trajectory: JointTrajectory,
    model: Model,
    *,
    simulated: Model | str | PathLike[str] | None = None,
    controller: Controller = "computed torque",
    frequency: float = 5.0,
    limits: JointLimits | None = None,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
    rate: float = 1000.0,
    contacts: bool = True,
) -> Replay:
    """Let a simulated robot follow a trajectory, and see how far from it the robot comes.

    MuJoCo simulates the robot from the first sample on, under a controller whose torques are cut to
    their limits. Between samples, the reference is the quintic polynomial that has their positions,
    velocities and accelerations. The robot that is simulated may differ from the one that the
    controller knows, by a payload for instance, as a test of robustness. Links that touch are
    reported; they do not push each other. Joints stop at their limits.

    >>> import geodesic_ocp as go
    >>> import numpy as np
    >>> arm = go.human_arm("right", armature=0.05)
    >>> time, s = np.linspace(0.0, 1.0, 101), np.linspace(0.0, 1.0, 101)[:, None]
    >>> bend = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])  # of the elbow, by 1 rad
    >>> q = bend * (10 * s**3 - 15 * s**4 + 6 * s**5)
    >>> v, a = bend * 30 * s**2 * (1 - s) ** 2, bend * 60 * s * (1 - s) * (1 - 2 * s)
    >>> result = replay(go.JointTrajectory(time, q, v, a, arm.joint_names), arm, contacts=False)
    >>> bool(result.largest_error.max() < 1e-4)  # [rad]
    True

    Args:
        trajectory: its joints are those of the model in any order, or more than those; or in the
            same order with other prefixes that end in a slash, as of two arms of one kind.
        model: the robot as its controller knows it.
        simulated: the robot in the simulation: another Model with these joints, or an MJCF file,
            its text or "menagerie/NAME", of which other joints are locked where the file has them,
            and whose damping and friction count; None: the model.
        controller: "computed torque" (inverse dynamics of the reference's acceleration and of the
            errors) or "pd" (errors and gravity alone).
        frequency: natural frequency of the controller, critically damped [Hz].
        limits: of the joints, of which the torques count; None: `joint_limits(model)`.
        gravity: acceleration of free fall in the axes of the model's base (3,) [m/s^2].
        rate: of the controller and the simulation [Hz].
        contacts: whether to look for links that touch, every 0.01 s, with the geometry of the
            MJCF, or with the capsules of `Model.bodies`, which are larger than the links.

    Raises:
        ValueError: wrong arguments, or a robot that does not fit the model.
        ImportError: MuJoCo is not installed (extra mujoco).
        IntegrationFailed: the simulation diverges.
    """
    mujoco = import_mujoco()
    fall = as_vector("gravity", gravity, 3)
    step = 1.0 / as_positive("rate", rate, "Hz")
    reference = _of_joints(trajectory, model).at_rate(rate)
    largest = (joint_limits(model) if limits is None else limits).torque
    if largest.shape != (model.dof,):
        raise ValueError(f"limits must be those of {model.dof} joints, got {largest.size}")
    known = simulated_robot(model.with_bodies(), model, fall, step)
    known.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    robot = model if simulated is None else simulated
    if isinstance(robot, Model) and not contacts:
        robot = robot.with_bodies()
    actual = simulated_robot(robot, model, fall, step)
    law = make_controller(
        controller, known, as_positive("frequency", frequency, "Hz"), reference.positions
    )
    q, v, torques = simulate(actual, reference, law, largest)
    return Replay(
        model,
        reference,
        Motion(reference.time, q, model.joint_names, v),
        torques,
        largest,
        _contacts(actual, q, step) if contacts else None,
        controller,
    )


def _of_joints(trajectory: JointTrajectory, model: Model) -> JointTrajectory:
    """The trajectory of the model's joints, in its order."""
    given, wanted = trajectory.joint_names, model.joint_names
    short = [name.rpartition("/")[2] for name in given]
    columns = []
    if not set(wanted) <= set(given) and short == [name.rpartition("/")[2] for name in wanted]:
        columns = list(range(len(given)))  # two arms of one kind, with other prefixes
    for joint in wanted if not columns else ():
        same = [k for k, name in enumerate(given) if name == joint]
        found = same or [k for k, name in enumerate(short) if name == joint.rpartition("/")[2]]
        if len(found) != 1:
            raise ValueError(
                f"trajectory has {len(found) or 'no'} joints {joint}; it has {', '.join(given)}"
            )
        columns += found
    return replace(
        trajectory,
        positions=trajectory.positions[:, columns],
        velocities=trajectory.velocities[:, columns],
        accelerations=trajectory.accelerations[:, columns],
        joint_names=model.joint_names,
        units=model.units,
        efforts=None,
    )


def _contacts(robot: SimulatedRobot, q: Array, step: float) -> tuple[Contact, ...] | None:
    if not np.any(robot.model.geom_bodyid > 0):
        return None
    return find_contacts(robot, q[:: max(round(_CONTACTS_EVERY / step), 1)])
