"""Distances between bodies, kept above their bounds at chosen instants of the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.clearance_constraint import Clearance


@dataclass(frozen=True, eq=False)
class DistanceRows:
    """Some distances at some instants.

    Attributes:
        clearance: all distances.
        index: which of them, (k,).
        places: for each of the k, the matrix (N, size) from the program's variables to the joints
            of all arms at that instant.
    """

    clearance: Clearance
    index: Sequence[int]
    places: Sequence[ca.DM]

    @property
    def lower(self) -> Array:
        """Least distances (k,)."""
        return np.asarray(self.clearance.lower)[list(self.index)]

    def values(self, x: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Distances (k, 1) and their Jacobian (k, size) at the variables x."""
        values, rows = [], []
        for number, place in zip(self.index, self.places, strict=True):
            value, slope = _first(self.clearance, number)(place @ x)
            values.append(value)
            rows.append(slope @ place)
        return ca.vertcat(*values), ca.vertcat(*rows)

    def hessian(self, x: ca.MX, factors: ca.MX) -> ca.MX:
        """Hessian (size, size) of factors' distances."""
        total = ca.MX(x.shape[0], x.shape[0])
        for k, (number, place) in enumerate(zip(self.index, self.places, strict=True)):
            total += place.T @ (_second(self.clearance, number)(place @ x) * factors[k]) @ place
        return total


@lru_cache(maxsize=256)
def _first(clearance: Clearance, number: int) -> ca.Function:
    q = ca.SX.sym("q", clearance.dof)
    distance = clearance.row(number)(q)
    return ca.Function("first", [q], ca.cse([distance, ca.jacobian(distance, q)]))


@lru_cache(maxsize=256)
def _second(clearance: Clearance, number: int) -> ca.Function:
    q = ca.SX.sym("q", clearance.dof)
    hessian, _ = ca.hessian(clearance.row(number)(q), q)
    return ca.Function("second", [q], [ca.cse(hessian)])
