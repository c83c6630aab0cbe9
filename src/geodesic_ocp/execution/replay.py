"""replay: a simulated robot follows a trajectory."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_positive, as_vector
from geodesic_ocp.execution.check_trajectory import of_joints
from geodesic_ocp.execution.limits import JointLimits, joint_limits
from geodesic_ocp.execution.simulation import (
    Contact,
    Controller,
    find_contacts,
    make_controller,
    simulate,
    simulated_robot,
)
from geodesic_ocp.model.model import Model
from geodesic_ocp.synergies.scores import pose_differences
from geodesic_ocp.tables import markdown, new_table
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion

if TYPE_CHECKING:
    from pandas import DataFrame

_SATURATED = 1.0 - 1e-9  # of the torque limit
_CONTACTS_EVERY = 0.01  # [s]


@dataclass(frozen=True, eq=False, repr=False)
class Replay:
    """A trajectory as a simulated robot follows it.

    Attributes:
        model: the robot as its controller knows it.
        reference: the trajectory (k samples, n joints), sampled at the rate of the controller.
        motion: the simulated motion at the same times, with velocities.
        torques: torques that the controller exerts, within the limits (k, n) [N m or N].
        torque_limits: largest magnitudes (n,) [N m or N]; infinite for none.
        contacts: pairs of links whose geometry overlaps, deepest first; None if they were not
            looked for or the robot has no geometry.
        controller: the name of the controller.
    """

    model: Model
    reference: JointTrajectory
    motion: Motion
    torques: Array
    torque_limits: Array
    contacts: tuple[Contact, ...] | None
    controller: str

    def __repr__(self) -> str:
        worst = int(np.argmax(self.largest_error))
        return (
            f"Replay({self.model.name!r}, {self.controller}: largest error "
            f"{self.largest_error[worst]:.3g} {self.model.units[worst]} "
            f"({self.model.joint_names[worst]}), hand {1e3 * self.position_error.max():.3g} mm, "
            f"torques up to {100 * self.torque_share.max():.3g} % of their limits)"
        )

    @cached_property
    def error(self) -> Array:
        """Simulated minus reference positions (k, n) [rad or m]."""
        return self.motion.q - self.reference.positions

    @property
    def largest_error(self) -> Array:
        """Largest tracking error of each joint (n,) [rad or m]."""
        return np.asarray(np.abs(self.error).max(axis=0))

    @property
    def rms_error(self) -> Array:
        """Root mean square of the tracking error of each joint (n,) [rad or m]."""
        return np.asarray(np.sqrt(np.mean(self.error**2, axis=0)))

    @cached_property
    def _hand_errors(self) -> tuple[Array, Array]:
        poses = (self.model.hand_pose(q) for q in (self.motion.q, self.reference.positions))
        return pose_differences(*poses)

    @property
    def position_error(self) -> Array:
        """Distance of the hand from where the reference has it (k,) [m]."""
        return self._hand_errors[0]

    @property
    def orientation_error(self) -> Array:
        """Angle of the hand from the reference's orientation (k,) [rad]."""
        return self._hand_errors[1]

    @property
    def torque_share(self) -> Array:
        """Largest torque of each joint over its limit (n,); zero without a limit."""
        return np.asarray((np.abs(self.torques) / self.torque_limits).max(axis=0))

    @property
    def saturated(self) -> Array:
        """Share of the time in which a joint's torque is at its limit (n,), from 0 to 1."""
        return np.asarray(np.mean(np.abs(self.torques) >= _SATURATED * self.torque_limits, axis=0))

    def table(self) -> DataFrame:
        """Return errors and torques of each joint; hand and contacts below."""
        columns = {
            "joint": self.model.joint_names,
            "largest error [mrad, mm]": (1e3 * self.largest_error).tolist(),
            "rms error [mrad, mm]": (1e3 * self.rms_error).tolist(),
            "largest torque [N m, N]": np.abs(self.torques).max(axis=0).tolist(),
            "of its limit [%]": (100.0 * self.torque_share).tolist(),
            "time at the limit [%]": (100.0 * self.saturated).tolist(),
        }
        return new_table(tuple(columns), tuple(zip(*columns.values(), strict=True)), self._note())

    def _note(self) -> str:
        sentences = [
            f"Hand: at most {1e3 * self.position_error.max():.3g} mm and "
            f"{1e3 * self.orientation_error.max():.3g} mrad from the reference."
        ]
        if free := [
            self.model.joint_names[k] for k in np.flatnonzero(np.isinf(self.torque_limits))
        ]:
            sentences.append(f"No torque limit is known of {', '.join(free)}.")
        if self.contacts is None:
            sentences.append("Contacts of links are not known.")
        elif not self.contacts:
            sentences.append("No links touch.")
        touching: dict[str, list[str]] = {}
        for each in self.contacts or ():
            what = "Capsules around links overlap" if each.capsules else "Links touch"
            when = " throughout" if each.share == 1.0 else ""
            touching.setdefault(what + when, []).append(str(each))
        sentences += [f"{what}: {', '.join(pairs)}." for what, pairs in sorted(touching.items())]
        return " ".join(sentences)

    def _repr_markdown_(self) -> str:
        return markdown(self.table())


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
    >>> swing = go.trajectory.JointTrajectory(time, q, v, a, arm.joint_names)
    >>> result = replay(swing, arm, contacts=False)
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
        limits: limits of the joints, of which the torques count; None: `joint_limits(model)`.
        gravity: acceleration of free fall in the axes of the model's base (3,) [m/s^2].
        rate: rate of the controller and the simulation [Hz].
        contacts: whether to look for links that touch, every 0.01 s, with the geometry of the
            MJCF, or with the capsules of `Model.bodies`, which are larger than the links.

    Raises:
        ValueError: wrong arguments, or a robot that does not fit the model.
        ImportError: MuJoCo is not installed (extra mujoco).
        IntegrationFailed: the simulation diverges.
    """
    fall = as_vector("gravity", gravity, 3)
    step = 1.0 / as_positive("rate", rate, "Hz")
    frequency = as_positive("frequency", frequency, "Hz")
    chosen = of_joints(trajectory, model.joint_names)
    reference = replace(chosen, joint_names=model.joint_names, units=model.units).at_rate(rate)
    largest = (joint_limits(model) if limits is None else limits).torque
    if largest.shape != (model.dof,):
        raise ValueError(f"limits must be those of {model.dof} joints, got {largest.size}")
    law = make_controller(controller, model, fall, frequency, reference.positions)
    robot = model if simulated is None else simulated
    if isinstance(robot, Model) and not contacts:
        robot = robot.with_bodies()
    actual = simulated_robot(robot, model, fall, step)
    q, v, torques = simulate(actual, reference, law, largest)
    touching = None
    if contacts and np.any(actual.model.geom_bodyid > 0):
        touching = find_contacts(actual, q[:: max(round(_CONTACTS_EVERY / step), 1)])
    simulation = Motion(reference.time, q, model.joint_names, v)
    return Replay(model, reference, simulation, torques, largest, touching, controller)
