"""Limits of a robot's joints on speed, acceleration, jerk and torque."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from geodesic_ocp.arrays import Array, short_repr


@dataclass(frozen=True, eq=False, repr=False)
class JointLimits:
    """Largest magnitudes, (n,) each; infinite where there is no limit.

    Attributes:
        velocity: [rad/s or m/s].
        acceleration: [rad/s^2 or m/s^2].
        jerk: [rad/s^3 or m/s^3].
        torque: [N m or N].
        sources: where the numbers come from, by the name of the field.
    """

    velocity: Array
    acceleration: Array
    jerk: Array
    torque: Array
    sources: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        return short_repr(self)
