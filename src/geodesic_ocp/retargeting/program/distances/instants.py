"""Positions of all arms at instants of the recording, as linear functions of the variables."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.retargeting.program.arm_part import ArmPart
from geodesic_ocp.retargeting.program.sparse import constant


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


def place_at(parts: Sequence[ArmPart], size: int, time: float) -> ca.DM:
    """The matrix (N, size) from the program's variables to all joints at one time [s]."""
    rows, columns, entries = [], [], []
    first, column = 0, 0
    for part in parts:
        grid, n = part.grid, part.dof
        (s,) = own_time(part, np.array([time]))
        segment = min(
            max(int(np.searchsorted(grid.breakpoints, s, "right")) - 1, 0), grid.segments - 1
        )
        basis = np.zeros((grid.segments, grid.degree + 1, grid.degree + 1))
        basis[segment] = np.eye(grid.degree + 1)
        (weights,) = grid.interpolate(basis, [s])
        for joint in range(n):
            rows.append(np.full(weights.size, first + joint))
            columns.append(column + (grid.degree * segment + np.arange(weights.size)) * n + joint)
            entries.append(weights)
        first, column = first + n, column + part.size
    shape = first, size
    return constant(shape, np.concatenate(rows), np.concatenate(columns), np.concatenate(entries))
