"""Torques of sampled joints by inverse dynamics, their rates, and efforts that were stated."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.arm_paths import joint_forces
from geodesic_ocp.execution.sampled_magnitudes import ROUNDING, Magnitudes, SampledJoints
from geodesic_ocp.execution.trajectory_findings import SLACK, worst
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.joint_trajectory import KINDS, JointTrajectory


@dataclass(frozen=True, eq=False)
class SampledTorques:
    """Torques of all joints at the samples.

    Attributes:
        sampled: samples of the joints.
        torques: by inverse dynamics (k, n) [N m or N].
        doubts: by how much they may be wrong, as accelerations were derived (k, n).
        rounding: by how much the last digits of the samples change them, about (n,).
        weights: torques that hold both ends (2, n).
    """

    sampled: SampledJoints
    torques: Array
    doubts: Array
    rounding: Array
    weights: Array

    @classmethod
    def of(
        cls, sampled: SampledJoints, models: Sequence[Model], gravity: ArrayLike
    ) -> SampledTorques:
        """Return the torques of models whose joints follow each other.

        Raises:
            ValueError: gravity is not (3,) or (models, 3).
        """
        falls = np.array(gravity, dtype=float)
        if falls.shape not in ((3,), (len(models), 3)) or not np.all(np.isfinite(falls)):
            raise ValueError(f"gravity must be 3 numbers, or 3 for each robot, got {gravity!r}")
        falls = np.broadcast_to(falls, (len(models), 3))
        trajectory = sampled.trajectory
        q = trajectory.positions
        accelerations, doubts = sampled.accelerations
        torques = joint_forces(models, list(falls), q, trajectory.velocities, accelerations)
        still = np.zeros((2, q.shape[1]))
        weights = joint_forces(models, list(falls), q[[0, -1]], still, still)
        if 2 not in sampled.stated:
            doubts = _inertial(models, q, doubts)
        last = np.maximum(ROUNDING[2], trajectory.last_digits(KINDS[2]))
        turned = float(np.maximum(ROUNDING[0], trajectory.last_digits(KINDS[0])).max())
        rounding = _inertial(models, q, np.tile(last, (len(q), 1))).max(axis=0)
        # The direction of a weight changes by the angle.
        rounding = rounding + turned * np.abs(torques).max()
        return cls(sampled, torques, doubts, rounding, weights)

    @property
    def magnitudes(self) -> Magnitudes:
        """Magnitudes at the samples."""
        return Magnitudes.exact(self.sampled.trajectory.time, np.abs(self.torques))._replace(
            below=self.doubts, above=self.doubts
        )

    @property
    def rates(self) -> Magnitudes:
        """Mean rates over steps; at rest, an end is a jump from the weight."""
        time = self.sampled.trajectory.time
        forward = np.diff(time)[:, None]
        steps = np.where(forward > 0.0, forward, np.inf)  # elsewhere there is no mean
        at = (time[1:] + time[:-1]) / 2.0
        changes = np.abs(np.diff(self.torques, axis=0))
        doubts = self.doubts[1:] + self.doubts[:-1]
        if self.sampled.rest and len(steps):
            ends = [0, -1]
            at = np.append(at, time[ends])
            changes = np.vstack([changes, np.abs(self.torques[ends] - self.weights)])
            doubts = np.vstack([doubts, self.doubts[ends]])
            steps = np.vstack([steps, steps[ends]])
        return Magnitudes(
            at=at,
            sizes=changes / steps,
            below=(doubts + 2.0 * self.rounding) / steps,
            above=doubts / steps,
            means=np.full(at.shape, True),
        )

    def efforts(self, trajectory: JointTrajectory, limits: Array) -> Iterator[str]:
        """Yield stated efforts that contradict the dynamics, or exceed the limits (n,)."""
        efforts = trajectory.efforts
        if efforts is None:
            return
        time = trajectory.time
        size = np.abs(self.torques).max(axis=0, initial=0.0)
        digits = self.rounding + trajectory.last_digits("effort")
        allowed = self.doubts + digits + SLACK * size
        for joint, k in worst(np.abs(efforts - self.torques) - allowed):
            unit = "N" if trajectory.units[joint] == "m" else "N m"
            yield (
                f"efforts of {trajectory.joint_names[joint]} contradict the dynamics: "
                f"{efforts[k, joint]:.4g} {unit} is stated at {time[k]:.4g} s, inverse dynamics "
                f"of this robot, gravity and payload gives {self.torques[k, joint]:.4g}"
            )
        for joint, k in worst(np.abs(efforts) - (1.0 + SLACK) * limits - digits):
            unit = "N" if trajectory.units[joint] == "m" else "N m"
            yield (
                f"stated effort of {trajectory.joint_names[joint]} is {efforts[k, joint]:.4g} "
                f"{unit} at {time[k]:.4g} s, its limit {limits[joint]:.4g}"
            )


def _inertial(models: Sequence[Model], q: Array, accelerations: Array) -> Array:
    """Return bounds |G(q)| a of the torques that accelerations of any sign need (k, n)."""
    ends = np.cumsum([model.dof for model in models])[:-1]
    parts = zip(
        models, np.split(q, ends, axis=1), np.split(accelerations, ends, axis=1), strict=True
    )
    found = [
        np.einsum("kij,kj->ki", np.abs(model.mass_matrix(own)), change)
        for model, own, change in parts
    ]
    return np.hstack(found)
