"""Which limits a program has to mind, and where: those that were nearly reached without them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.clearance_constraint import Clearance
from geodesic_ocp.execution.program.blocks import Indices


@dataclass(frozen=True, eq=False)
class WatchedDistance:
    """A distance that is kept at some of the knots.

    Attributes:
        clearance: to which it belongs.
        index: of the distance.
        knots: numbers of the knots (k,).
        lower: its lower bounds there (k,) [m].
    """

    clearance: Clearance
    index: int
    knots: Indices
    lower: Array


@dataclass(frozen=True, eq=False)
class Watched:
    """Constraints of a program, beside those that it always has.

    Attributes:
        pieces: of every arm, by the kind of limit ("jerk", "velocity", "position"), numbers of
            pieces and joints (k, 2).
        torques: of every arm, numbers of the knots at which torques are limited.
        distances: kept at some of the knots.
    """

    pieces: tuple[Mapping[str, Indices], ...]
    torques: tuple[Indices, ...]
    distances: tuple[WatchedDistance, ...] = ()

    @classmethod
    def nothing(cls, arms: int) -> Watched:
        """No constraints beside those that a program always has."""
        return cls(tuple({} for _ in range(arms)), (np.zeros(0, dtype=np.int64),) * arms)
