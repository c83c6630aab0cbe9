"""Synergy: a segment of a motion, planned as a geodesic with a time law."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.time_law import TimeLaw
from geodesic_ocp.trajectory.timed_path import states_at


@dataclass(frozen=True, eq=False, repr=False)
class Synergy:
    """A geodesic synergy: a segment of a motion, as a path with a time law.

    In the sense of Klein, Jaquier, Meixner, Asfour (IROS 2022): a segment of a recorded motion that
    follows a geodesic; not a muscle synergy of motor control. At time t it has covered the distance
    law(t - start_time) along its path.

    Attributes:
        start, stop: indices of its first and last sample in the recording.
        start_time: of its first sample [s].
        path: the geodesic between the observed configurations at its ends; of a robot, the path
            that brings the hand (end-effector) to its pose.
        law: distance along the path over time from the start.
    """

    start: int
    stop: int
    start_time: float
    path: Path
    law: TimeLaw

    def __repr__(self) -> str:
        stop_time = self.start_time + self.duration
        return (
            f"Synergy(samples {self.start} to {self.stop}, {self.start_time:.3f} to "
            f"{stop_time:.3f} s, length {self.length:.4g})"
        )

    @property
    def duration(self) -> float:
        """[s]"""
        return self.law.duration

    @property
    def length(self) -> float:
        """Length of the path in its metric."""
        return self.law.length

    def __call__(self, t: ArrayLike, order: int = 0) -> Array:
        """Configuration (k, n), or velocity for order 1, acceleration for 2, at times t (k,) [s].

        Raises:
            ValueError: t lies outside the synergy, or the order is above 2.
        """
        if order not in (0, 1, 2):
            raise ValueError(f"order must be 0, 1 or 2, got {order}")
        result = self.states(np.atleast_1d(np.asarray(t, dtype=float)), order)[order]
        return result[0] if np.ndim(t) == 0 else result

    def states(self, t: Array, order: int = 2) -> tuple[Array, ...]:
        """Configurations, velocities and accelerations, (k, n) each, at times t (k,) [s].

        Derivatives above the given order are left out.
        """
        return states_at(self.path, self.law, t - self.start_time, order)
