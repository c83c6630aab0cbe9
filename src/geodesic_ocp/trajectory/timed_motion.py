"""Motions that can be evaluated at any time."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_positive, real_array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion


class TimedMotion(ABC):
    """A motion q(t) between the first and the last of its times.

    Called as `motion(t, order)` it gives positions (order 0), velocities (1) or accelerations (2).

    Attributes:
        metric: metric of the manifold, which names the joints.
        times: increasing (k,) [s].
    """

    metric: Metric
    times: Array

    @abstractmethod
    def states(self, t: Array, order: int) -> Array:
        """Return derivatives of this order at times (k,) within the motion, (k, n)."""

    @abstractmethod
    def torques(self, t: ArrayLike) -> Array:
        """Return the generalised forces at times (k,), (k, n) [N m or N]."""

    @property
    def duration(self) -> float:
        """Time from the first to the last knot [s]."""
        return float(self.times[-1] - self.times[0])

    def __call__(self, t: ArrayLike, order: int = 0) -> Array:
        """Return positions, velocities or accelerations at t: (n,) for a number, or (k, n).

        Raises:
            ValueError: another order, or a time before the first or after the last knot.
        """
        if order not in (0, 1, 2):
            raise ValueError(f"order must be 0, 1 or 2, got {order!r}")
        values = self.states(self.checked(t), int(order))
        return values[0] if np.ndim(t) == 0 else values

    def checked(self, t: ArrayLike) -> Array:
        """Return times (k,) within the motion; ValueError if one lies outside."""
        instants = real_array(t, "t").reshape(-1)
        first, last = self.times[[0, -1]]
        slack = 1e-9 * self.duration
        if not np.all((instants >= first - slack) & (instants <= last + slack)):
            raise ValueError(f"t must be from {first:.6g} to {last:.6g}")
        return np.clip(instants, first, last)

    def to_motion(self, rate: float = 100.0) -> Motion:
        """Return the motion with velocities, at a rate [Hz] such that both ends are samples."""
        time = self._sampled(rate)
        return Motion(time, self(time), self._names, self(time, 1))

    def to_trajectory(self, rate: float = 100.0) -> JointTrajectory:
        """Return positions, velocities and accelerations sampled at a rate [Hz], for a robot."""
        time = self._sampled(rate)
        positions, velocities, accelerations = (self(time, order) for order in range(3))
        since = time - time[0]
        return JointTrajectory(since, positions, velocities, accelerations, self._names)

    def _sampled(self, rate: float) -> Array:
        steps = max(1, round(self.duration * as_positive("rate", rate, "Hz")))
        return np.linspace(self.times[0], self.times[-1], steps + 1)

    @property
    def _names(self) -> tuple[str, ...]:
        names = self.metric.joint_names
        return tuple(names) if names else tuple(f"q{i}" for i in range(self.metric.dim))
