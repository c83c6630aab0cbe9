"""Joint trajectories for robot controllers, as CSV and as a ROS 2 message in JSON."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array

_NANO = 1_000_000_000


@dataclass(frozen=True, eq=False, repr=False)
class JointTrajectory:
    """Joint positions, velocities and accelerations over time.

    Attributes:
        time: from the start (k,) [s].
        positions, velocities, accelerations: (k, n) [rad or m], per second, per second squared.
        joint_names: of the n columns.
    """

    time: Array
    positions: Array
    velocities: Array
    accelerations: Array
    joint_names: tuple[str, ...]

    def __repr__(self) -> str:
        return (
            f"JointTrajectory({len(self.time)} points in {self.time[-1]:.3g} s, "
            f"joints {', '.join(self.joint_names)})"
        )

    @classmethod
    def side_by_side(
        cls, parts: Sequence[JointTrajectory], joint_names: Sequence[str]
    ) -> JointTrajectory:
        """Trajectories of several arms at the same times as one trajectory, under these names."""
        return cls(
            parts[0].time,
            np.hstack([part.positions for part in parts]),
            np.hstack([part.velocities for part in parts]),
            np.hstack([part.accelerations for part in parts]),
            tuple(joint_names),
        )

    def csv(self) -> str:
        """CSV with time_from_start and the position, velocity and acceleration of each joint."""
        header = ["time_from_start"]
        for kind in ("position", "velocity", "acceleration"):
            header += [f"{name} {kind}" for name in self.joint_names]
        columns = (self.time[:, None], self.positions, self.velocities, self.accelerations)
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(np.hstack(columns).tolist())
        return text.getvalue()

    def json(self) -> str:
        """JSON with the fields of the ROS 2 message trajectory_msgs/msg/JointTrajectory."""
        points = []
        for k, instant in enumerate(self.time):
            nanoseconds = round(float(instant) * _NANO)
            points.append(
                {
                    "positions": self.positions[k].tolist(),
                    "velocities": self.velocities[k].tolist(),
                    "accelerations": self.accelerations[k].tolist(),
                    "effort": [],
                    "time_from_start": {
                        "sec": nanoseconds // _NANO,
                        "nanosec": nanoseconds % _NANO,
                    },
                }
            )
        header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
        message = {"header": header, "joint_names": list(self.joint_names), "points": points}
        return json.dumps(message, indent=1)
