"""Distances between bodies, kept above their bounds at chosen instants of the motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.clearance import Clearance


@dataclass(frozen=True, eq=False)
class DistanceRows:
    """Some distances at some instants, in the order of the distances.

    Attributes:
        clearance: all distances.
        index: which of them (k,), in increasing order.
        lower: bounds of these (k,) [m].
        places: for each of the k, the matrix (N, size) from the program's variables to the joints
            of all arms at that instant.
    """

    clearance: Clearance
    index: Sequence[int]
    lower: Array
    places: Sequence[ca.DM]

    @cached_property
    def _place(self) -> ca.DM:
        """All places (k N, size), one after the other."""
        return ca.vertcat(*self.places)

    def _joints(self, x: Any) -> Any:
        """All joints at the k instants, (N, k)."""
        return ca.reshape(self._place @ x, self.clearance.dof, len(self.index))

    def _groups(self) -> Iterator[tuple[int, slice]]:
        """Each distance with its columns among the k."""
        numbers, starts = np.unique(self.index, return_index=True)
        ends = [*starts[1:].tolist(), len(self.index)]
        for number, start, end in zip(numbers.tolist(), starts.tolist(), ends, strict=True):
            yield number, slice(start, end)

    def missing(self, x: Array) -> Array:
        """What the distances at the variables x (size,) lack to their bounds (k,)."""
        q = self._joints(ca.DM(x))
        found = [
            self.clearance.row(number).map(here.stop - here.start)(q[:, here])
            for number, here in self._groups()
        ]
        distances = np.concatenate([each.full()[0] for each in found])
        return np.asarray(np.maximum(self.lower - distances, 0.0))

    def values(self, x: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Distances (k, 1) and their Jacobian (k, size) at the variables x."""
        q, values, slopes = self._joints(x), [], []
        for number, here in self._groups():
            value, slope = _first(self.clearance, number).map(here.stop - here.start)(q[:, here])
            values.append(value)
            slopes.append(slope)
        rows = ca.diagcat(*ca.horzsplit(ca.horzcat(*slopes), self.clearance.dof))
        distances: ca.MX = ca.horzcat(*values).T
        jacobian: Any = rows @ self._place
        return distances, jacobian

    def hessian(self, x: ca.MX, factors: ca.MX) -> ca.MX:
        """Hessian (size, size) of factors' distances."""
        q, blocks = self._joints(x), []
        for number, here in self._groups():
            count = here.stop - here.start
            found = _second(self.clearance, number).map(count)(q[:, here], factors[here].T)
            blocks.append(found)
        middle = ca.diagcat(*ca.horzsplit(ca.horzcat(*blocks), self.clearance.dof))
        return self._place.T @ middle @ self._place


@lru_cache(maxsize=256)
def _first(clearance: Clearance, number: int) -> ca.Function:
    q = ca.SX.sym("q", clearance.dof)
    distance = clearance.row(number)(q)
    slope = ca.densify(ca.jacobian(distance, q))
    return ca.Function("first", [q], ca.cse([distance, slope]))


@lru_cache(maxsize=256)
def _second(clearance: Clearance, number: int) -> ca.Function:
    q, factor = ca.SX.sym("q", clearance.dof), ca.SX.sym("factor")
    hessian, _ = ca.hessian(factor * clearance.row(number)(q), q)
    return ca.Function("second", [q, factor], [ca.cse(ca.densify(hessian))])
