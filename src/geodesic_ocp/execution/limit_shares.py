"""How much of its limits a trajectory uses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array, short_repr


@dataclass(frozen=True, eq=False, repr=False)
class LimitShares:
    """Largest magnitudes over the whole trajectory as fractions of the limits, (n,) each.

    Attributes:
        velocity, acceleration, jerk, torque: zero where there is no limit.
    """

    velocity: Array
    acceleration: Array
    jerk: Array
    torque: Array

    def __repr__(self) -> str:
        return short_repr(self)

    @property
    def largest(self) -> float:
        """The largest of all."""
        return float(np.max([self.velocity, self.acceleration, self.jerk, self.torque]))
