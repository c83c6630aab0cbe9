"""What became of one arm: the robot's synergies, its motion, and the baseline's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.kinetic_energy import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.alignment import Alignment
from geodesic_ocp.retargeting.merge_synergies import SynergyGroup
from geodesic_ocp.retargeting.transfer import Transfer, velocity_limits
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.synergies.evaluate import MotionErrors, pose_errors, work
from geodesic_ocp.synergies.reconstruct import Synergy
from geodesic_ocp.trajectory.joint_trajectory import Trajectory
from geodesic_ocp.trajectory.motion import Motion


@dataclass(frozen=True)
class Figures:
    """Figures of one motion of a robot.

    Attributes:
        energy: int 1/2 |q'|_G^2 dt of the whole motion [J s].
        peak_speed: largest joint speed as a share of that joint's limit; 0 where it has none.
        position, orientation: mean distance [m] and angle [rad] of the hand from the person's,
            carried over, sample by sample.
        outside: by how much joints exceed their limits at most [rad or m].
    """

    energy: float
    peak_speed: float
    position: float
    orientation: float
    outside: float


@dataclass(frozen=True, eq=False)
class RetargetedArm:
    """One arm's part of a retargeting.

    Attributes:
        analysis: of the person's motion.
        robot: the arm; joints have its URDF's names.
        alignment: of shoulder and hand.
        scale: of positions.
        mirror: whether left and right were exchanged.
        groups: how the person's synergies were dropped and merged.
        transfers: for each group the path, and how well the hand's pose is met at its end.
        synergies: for each group the path and its time law, in the robot's time.
        trajectory: at the recording's samples, in the robot's time.
        wanted: rotations (k, 3, 3) and positions (k, 3) [m] of the hand, carried over from the
            person, in the robot's base frame, at all samples.
        baseline: what a velocity controller does that follows the whole way of the hand.
        out_of_reach: by number (0 is the first, k + 1 the end of synergy k) of a pose that no
            configuration has, distance [m] and angle [rad] of the nearest.
    """

    analysis: Analysis
    robot: Model
    alignment: Alignment
    scale: float
    mirror: bool
    groups: tuple[SynergyGroup, ...]
    transfers: tuple[Transfer, ...]
    synergies: tuple[Synergy, ...]
    trajectory: Trajectory
    wanted: tuple[Array, Array]
    baseline: Motion
    out_of_reach: Mapping[int, tuple[float, float]]

    @cached_property
    def motion(self) -> Motion:
        """The robot's motion, at the recording's samples, in the robot's time."""
        found = self.trajectory
        subject = self.analysis.motion.subject
        return Motion(found.time, found.positions, found.joint_names, found.velocities, subject)

    @cached_property
    def figures(self) -> Mapping[str, Figures]:
        """Of the "synergies" and of "ik", inverse kinematics on the same robot in the same time."""
        return {"synergies": self._figures(self.motion), "ik": self._figures(self.baseline)}

    def _figures(self, motion: Motion) -> Figures:
        robot = self.robot
        assert motion.velocity is not None
        errors: MotionErrors = pose_errors(robot.hand_pose(motion.q), self.wanted)
        outside = np.maximum(robot.lower - motion.q, motion.q - robot.upper)
        return Figures(
            energy=work(KineticEnergy(robot), motion),
            peak_speed=float((np.abs(motion.velocity) / velocity_limits(robot)).max()),
            position=errors.position,
            orientation=errors.orientation,
            outside=max(0.0, float(outside.max())),
        )

    @property
    def has_speed_limits(self) -> bool:
        """Whether any joint's speed is limited."""
        return bool(np.any(np.isfinite(velocity_limits(self.robot))))

    @property
    def title(self) -> str:
        """Of whom and on what."""
        mirrored = " (mirrored)" if self.mirror else ""
        return f"{self.analysis.model.name}{mirrored} on {self.robot.name}"
