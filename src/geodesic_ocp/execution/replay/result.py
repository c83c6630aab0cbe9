"""What came of a replay: the simulated motion, its errors, torques and contacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.replay.contacts import Contact
from geodesic_ocp.figures.replay_figure import draw_replay
from geodesic_ocp.model.model import Model
from geodesic_ocp.rotations import rotation_vector
from geodesic_ocp.table import Table
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SATURATED = 1.0 - 1e-9  # of the torque limit


@dataclass(frozen=True, eq=False, repr=False)
class Replay:
    """A trajectory as a simulated robot follows it.

    Attributes:
        model: the robot as its controller knows it.
        reference: the trajectory (k samples, n joints), sampled at the rate of the controller.
        motion: the simulated motion at the same times, with velocities.
        torques: that the controller exerts, within the limits (k, n) [N m or N].
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
        rotation, position = self.model.hand_pose(self.motion.q)
        wanted_rotation, wanted_position = self.model.hand_pose(self.reference.positions)
        turned = rotation_vector(np.swapaxes(wanted_rotation, 1, 2) @ rotation)
        distance = np.linalg.norm(position - wanted_position, axis=1)
        return np.asarray(distance), np.asarray(np.linalg.norm(turned, axis=1))

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

    def table(self) -> Table:
        """Errors and torques of each joint; hand and contacts below."""
        columns = zip(
            self.model.joint_names,
            (1e3 * self.largest_error).tolist(),
            (1e3 * self.rms_error).tolist(),
            np.abs(self.torques).max(axis=0).tolist(),
            (100.0 * self.torque_share).tolist(),
            (100.0 * self.saturated).tolist(),
            strict=True,
        )
        header = (
            "joint",
            "largest error [mrad, mm]",
            "rms error [mrad, mm]",
            "largest torque [N m, N]",
            "of its limit [%]",
            "time at the limit [%]",
        )
        return Table(header, tuple(columns), self._note())

    def _note(self) -> str:
        sentences = [
            f"Hand: at most {1e3 * self.position_error.max():.3g} mm and "
            f"{1e3 * self.orientation_error.max():.3g} mrad from the reference."
        ]
        if np.isinf(self.torque_limits).any():
            names = zip(self.model.joint_names, self.torque_limits, strict=True)
            free = [name for name, limit in names if np.isinf(limit)]
            sentences.append(f"No torque limit is known of {', '.join(free)}.")
        if self.contacts is None:
            sentences.append("Contacts of links are not known.")
        elif not self.contacts:
            sentences.append("No links touch.")
        else:
            sentences += _touching(self.contacts)
        return " ".join(sentences)

    def _repr_markdown_(self) -> str:
        return self.table().markdown()

    def plot(self) -> Figure:
        """Tracking errors of the joints, errors of the hand and shares of torques over time."""
        shares = self.torques / self.torque_limits
        return draw_replay(
            self.motion.time,
            self.model.joint_names,
            self.model.units,
            self.error,
            (self.position_error, self.orientation_error),
            shares,
        )


def _touching(contacts: Sequence[Contact]) -> list[str]:
    """Sentences on links whose geometry overlaps, at some samples and at all of them."""
    found = []
    for capsules, what in ((False, "Links touch"), (True, "Capsules around links overlap")):
        for throughout, when in ((False, ""), (True, " throughout")):
            pairs = [
                str(each)
                for each in contacts
                if each.capsules is capsules and (each.share == 1.0) is throughout
            ]
            if pairs:
                found.append(f"{what}{when}: {', '.join(pairs)}.")
    return found
