"""Settings of a trajectory's program."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TrajectorySettings:
    """What a trajectory has to meet, and how closely it stays near the paths.

    Attributes:
        rest: whether it begins and ends at rest.
        tolerance: of the hand's pose at the ends of paths [m], [rad]; None: the configuration is
            met exactly.
        deviation_weight: of the squared distance from the paths, relative to the default.
    """

    rest: bool = True
    tolerance: tuple[float, float] | None = None
    deviation_weight: float = 1.0
