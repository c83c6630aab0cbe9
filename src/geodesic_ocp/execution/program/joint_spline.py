"""A cubic spline in time: positions, velocities and accelerations without jumps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from geodesic_ocp.arrays import Array


@dataclass(frozen=True, eq=False, repr=False)
class JointSpline:
    """Joints over time, with constant jerk between knots.

    Attributes:
        time: of the knots (k + 1,) [s].
        positions, velocities, accelerations: at the knots, (k + 1, n) each.
    """

    time: Array
    positions: Array
    velocities: Array
    accelerations: Array

    def __repr__(self) -> str:
        return f"JointSpline({self.positions.shape[1]} joints, {self.duration:.3g} s)"

    @classmethod
    def through(cls, time: Array, positions: Array, ends: Array) -> JointSpline:
        """The cubic spline through positions (k + 1, n), with velocities (2, n) at its ends."""
        sides = ((1, ends[0]), (1, ends[1]))
        spline = CubicSpline(time, positions, bc_type=sides)
        return cls(time, positions, spline(time, 1), spline(time, 2))

    @property
    def duration(self) -> float:
        """Time of the last knot [s]."""
        return float(self.time[-1])

    @cached_property
    def steps(self) -> Array:
        """Durations of the pieces (k,) [s]."""
        return np.asarray(np.diff(self.time))

    @cached_property
    def jerks(self) -> Array:
        """Jerks of the pieces (k, n)."""
        return np.asarray(np.diff(self.accelerations, axis=0) / self.steps[:, None])

    def __call__(self, time: Array) -> tuple[Array, Array, Array, Array]:
        """Positions, velocities, accelerations and jerks at times within the spline (m,)."""
        piece = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, len(self.jerks) - 1)
        h = (time - self.time[piece])[:, None]
        q, v, a = (each[piece] for each in (self.positions, self.velocities, self.accelerations))
        j = self.jerks[piece]
        return (
            q + h * (v + h * (a / 2.0 + h * j / 6.0)),
            v + h * (a + h * j / 2.0),
            a + h * j,
            j,
        )

    def within_pieces(self, count: int) -> Array:
        """Evenly spaced times in every piece, both ends included, (k, count)."""
        return np.asarray(self.time[:-1, None] + self.steps[:, None] * np.linspace(0.0, 1.0, count))

    @cached_property
    def extreme_velocities(self) -> Array:
        """Largest magnitudes of the velocities in every piece, (k, n)."""
        h, v, a, j = self.steps[:, None], self.velocities[:-1], self.accelerations[:-1], self.jerks
        turn = np.clip(np.divide(-a, j, out=np.zeros_like(a), where=j != 0.0), 0.0, h)
        inside = np.abs(v + turn * (a + turn * j / 2.0))
        return np.asarray(np.maximum(inside, np.maximum(np.abs(v), np.abs(self.velocities[1:]))))

    @cached_property
    def extreme_positions(self) -> tuple[Array, Array]:
        """Smallest and largest positions in every piece, (k, n) each."""
        h, q = self.steps[:, None], self.positions[:-1]
        v, a, j = self.velocities[:-1], self.accelerations[:-1], self.jerks
        # Roots of v + a t + j t^2 / 2, in the form that does not cancel.
        root = np.sqrt(np.maximum(a**2 - 2.0 * j * v, 0.0))
        sum_ = -(a + np.copysign(root, a))
        turns = [
            np.divide(sum_, j, out=np.zeros_like(a), where=j != 0.0),
            np.divide(2.0 * v, sum_, out=np.zeros_like(a), where=sum_ != 0.0),
        ]
        values = [q, self.positions[1:]]
        for turn in turns:
            t = np.clip(turn, 0.0, h)
            values.append(q + t * (v + t * (a / 2.0 + t * j / 6.0)))
        return np.min(values, axis=0), np.max(values, axis=0)
