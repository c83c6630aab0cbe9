"""A geodesic between two configurations as it is found: its initial velocity and a grid for it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.trajectory.grid import Grid

# Every geodesic ends this close to its goal when integrated, in every coordinate [rad or m].
TOLERANCE = 1e-9
CHECK_TOLERANCE = 1e-10  # of that integration
# Short geodesics, as of human synergies, need few nodes; finer grids follow where one fails.
GRIDS = (Grid(1, 14), *(Grid(segments, 20) for segments in (1, 2, 4, 8)))
# A sharply bending path needs more segments to be represented than to be found.
_FINE_GRIDS = (Grid(16, 20), Grid(32, 20))


def wanted_error(q0: Array, q1: Array) -> float:
    """Endpoint error at which corrections of a geodesic from q0 to q1 end [rad or m].

    Short geodesics are corrected down to rounding: their direction counts, too.
    """
    return CHECK_TOLERANCE * min(1.0, float(np.abs(q1 - q0).max()))


@dataclass(frozen=True, eq=False)
class ConnectingGeodesic:
    """A geodesic from q0 to q1.

    Attributes:
        q0, q1: its ends (n,).
        velocity: the initial one (n,).
        nodes: number of nodes of the path from which it was found, 0 if from a velocity.
    """

    q0: Array
    q1: Array
    velocity: Array
    nodes: int = field(default=0, repr=False)

    @property
    def grids(self) -> tuple[Grid, ...]:
        """Grids on which it may be represented, from the coarsest."""
        grids = (*GRIDS, *_FINE_GRIDS)
        return tuple(grid for grid in grids if grid.size >= min(self.nodes, GRIDS[-1].size))
