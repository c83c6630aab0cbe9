"""What the program knows about one arm: its waypoints, and the time between them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Terms
from geodesic_ocp.execution.limits import JointLimits
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.poses.targets import Pose
from geodesic_ocp.retargeting.program.waypoint_functions import waypoint_terms

_PEAK, _BRAKING = 1.5, 5.0


@dataclass(frozen=True, eq=False)
class ArmWaypoints:
    """Poses that the hand of one arm passes, one after the other.

    Attributes:
        arm: the robot; its limits bound the paths.
        limited: whether they do.
        alignment: with a person's arm.
        begins, ends: times [s] in the recording at which the m movements begin and end, (m,) each;
            between two movements the arm rests.
        poses: of the hand at the start and at the end of each movement, m + 1 of them.
        between: poses of the person's hand, mapped to the robot, halfway through each movement.
        start: configuration (n,) to begin in; None: any with the first pose.
        limits: of the joints.
        offsets: of the person's elbow at the waypoints (m + 1, 3), see `elbow_offset`; None: not
            known.
        near_misses: errors of poses [m], [rad] that are accepted to avoid a detour.
        weights: of position and orientation errors [1/m], [1/rad], for poses out of reach.
    """

    arm: Model
    limited: bool
    alignment: Alignment
    begins: Array
    ends: Array
    poses: tuple[Pose, ...]
    between: tuple[Pose, ...]
    start: Array | None
    limits: JointLimits
    offsets: Array | None
    near_misses: float = 0.0
    weights: tuple[float, float] = field(default=(1.0, 1.0))

    @property
    def durations(self) -> Array:
        """Of the movements (m,) [s]."""
        return np.asarray(self.ends - self.begins)

    @property
    def speed(self) -> Array:
        """Largest mean speed of the joints in each movement (m, n); infinite without limits.

        From rest to rest the peak of a speed is 1.5 times its mean, and an acceleration a, first
        forward and then backward, allows a mean speed of a T / 4 over a time T, and limited jerk
        less.
        """
        by_acceleration = self.limits.acceleration * self.durations[:, None] / _BRAKING
        return np.minimum(self.limits.velocity / _PEAK, by_acceleration)

    @property
    def count(self) -> int:
        """Number m of movements."""
        return len(self.begins)

    @property
    def rows(self) -> tuple[int, ...]:
        """Which of the six rows of the pose error count."""
        first = self.poses[0]
        place = () if first.position is None else (0, 1, 2)
        return (*place, *(() if first.rotation is None else (3, 4, 5)))

    @property
    def row_weights(self) -> Array:
        """Weights of those rows."""
        return np.repeat(self.weights, 3)[list(self.rows)]

    @property
    def terms(self) -> Terms:
        """Costs and pose errors of the configurations at the waypoints."""
        torque = tuple(self.limits.torque.tolist())
        return waypoint_terms(self.arm, self.alignment, self.rows, torque)
