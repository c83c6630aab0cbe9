"""Which limits a program has to mind, and where: those that were nearly reached without them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Indices
from geodesic_ocp.execution.clearance import Clearance


@dataclass(frozen=True, eq=False)
class WatchedArm:
    """Limits of one arm.

    Attributes:
        pieces: by the kind of limit ("jerk", "velocity", "position"), numbers of pieces and joints
            (k, 2).
        torques: numbers of the knots at which torques are limited (k,).
        torque_shares: of the limits that torques may reach at the knots, (knots, n); less than all
            where a torque is larger between the knots.
    """

    pieces: Mapping[str, Indices]
    torques: Indices
    torque_shares: Array


@dataclass(frozen=True, eq=False)
class WatchedDistances:
    """Distances of one clearance.

    Attributes:
        clearance: the distances.
        knots: at which each is kept, by its index.
        lower: bounds at all knots (knots, m) [m]; more than the clearance's where a distance is
            smaller between the knots, -inf where the configuration is given.
    """

    clearance: Clearance
    knots: Mapping[int, Indices]
    lower: Array


@dataclass(frozen=True, eq=False)
class Watched:
    """Constraints of a program, beside those that it always has.

    Attributes:
        arms: limits of each arm.
        clearances: distances of each clearance.
    """

    arms: tuple[WatchedArm, ...]
    clearances: tuple[WatchedDistances, ...]
