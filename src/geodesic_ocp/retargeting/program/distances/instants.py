"""Positions of all arms at instants of the recording, as linear functions of the variables."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse

from geodesic_ocp.arrays import Array
from geodesic_ocp.retargeting.program.arm_part import ArmPart


def own_time(part: ArmPart, times: Array) -> Array:
    """Parameter s of an arm's whole path at times [s] in the recording; rests are left out."""
    given = part.waypoints
    instants = np.column_stack([given.begins, given.ends]).ravel()
    after = np.cumsum(given.durations)
    moved = np.column_stack([after - given.durations, after]).ravel()
    kept = np.append(True, np.diff(instants) > 0.0)
    return np.asarray(np.interp(times, instants[kept], moved[kept]) / part.moving_time)


def positions_at(parts: Sequence[ArmPart], nodes: Sequence[Array], times: Array) -> Array:
    """Joints of all arms (k, N) at times (k,) [s] in the recording."""
    found = [
        part.path(each)(own_time(part, times)) for part, each in zip(parts, nodes, strict=True)
    ]
    return np.hstack(found)


def place_at(parts: Sequence[ArmPart], size: int, time: float) -> scipy.sparse.coo_array:
    """The matrix (N, size) from the program's variables to all joints at one time [s]."""
    blocks = []
    for part in parts:
        grid = part.grid
        (s,) = own_time(part, np.array([time]))
        segment = int(np.searchsorted(grid.breakpoints[1:-1], s, "right"))
        basis = np.zeros((grid.segments, grid.degree + 1, grid.degree + 1))
        basis[segment] = np.eye(grid.degree + 1)
        row = np.zeros(grid.size)
        row[grid.degree * segment + np.arange(grid.degree + 1)] = grid.interpolate(basis, [s])[0]
        blocks.append(scipy.sparse.kron(row[None], np.eye(part.dof)))
    places = scipy.sparse.block_diag(blocks, format="coo")
    return scipy.sparse.coo_array((places.data, (places.row, places.col)), (places.shape[0], size))
