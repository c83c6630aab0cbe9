"""Bounds on a joint's next speed, so that it keeps all limits and can always stop in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.joint_limits import JointLimits
from geodesic_ocp.model.model import Model

_ROUNDING = 1e-9  # share of limits, and [rad or m], left to the rounding of sums


@dataclass(frozen=True, eq=False)
class SpeedBounds:
    """Bounds of the constant speed over a step, q_next = q + step v.

    Between its bounds there is always a speed, at which there is one again, and so on: the joint
    can brake before the end of its range, and come to rest in the steps that are left. (Viability:
    Del Prete, "Joint position and velocity bounds in discrete-time acceleration/torque control of
    robot manipulators", IEEE Robotics and Automation Letters 3, 2018; here for steps of constant
    speed.)

    Attributes:
        lower, upper: range of the joints (n,) [rad or m].
        speed: limit (n,) [rad/s or m/s].
        change: largest change of the speed from step to step (n,).
        step: [s].
    """

    lower: Array
    upper: Array
    speed: Array
    change: Array
    step: float

    @classmethod
    def of(cls, model: Model, limits: JointLimits, step: float) -> SpeedBounds:
        """Of a model's joints."""
        kept = 1.0 - _ROUNDING
        return cls(
            model.lower + _ROUNDING,
            model.upper - _ROUNDING,
            kept * limits.velocity,
            kept * limits.acceleration * step,
            step,
        )

    def __call__(self, q: Array, previous: Array, left: int) -> tuple[Array, Array]:
        """Least and largest speeds (n,).

        Args:
            q: configuration at the beginning of the step (n,).
            previous: speed in the step before (n,).
            left: number of steps after this one, in the last of which the arm is at rest.
        """
        to_rest = np.zeros_like(self.change) if left == 0 else left * self.change
        largest = np.minimum(self.speed, to_rest)
        up = np.minimum(largest, self._braking(self.upper - q))
        down = -np.minimum(largest, self._braking(q - self.lower))
        up = np.maximum(np.minimum(up, previous + self.change), previous - self.change)
        down = np.minimum(np.maximum(down, previous - self.change), previous + self.change)
        return np.minimum(down, up), up

    def _braking(self, room: Array) -> Array:
        """Largest speed v (n,) towards a limit at the distance `room` (n,).

        The distance step (v + (v - c) + (v - 2 c) + ...) until the joint stands, with the change c
        of speed per step, is the largest of step ((k + 1) v - c k (k + 1) / 2) over k = 0, 1, ...
        """
        room = np.maximum(room, 0.0) / self.step
        limited = np.isfinite(self.change)  # else it may stop at once
        ratio = np.divide(room, self.change, out=np.zeros_like(room), where=limited)
        ratio = np.minimum(ratio, 1e12)
        k = np.floor(np.maximum(np.sqrt(2.0 * ratio) - 1.0, 0.0))
        found = room.copy()
        for count in (k, k + 1.0):
            with np.errstate(invalid="ignore"):  # infinite times zero
                speed = room / (count + 1.0) + np.where(count > 0.0, self.change * count / 2.0, 0.0)
            found = np.where(np.isnan(speed), found, np.minimum(found, speed))
        return found
