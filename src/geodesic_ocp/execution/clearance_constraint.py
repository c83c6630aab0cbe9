"""Distances that a program keeps above lower bounds, as functions of the joint angles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import casadi as ca

from geodesic_ocp.arrays import Array


@dataclass(frozen=True, eq=False, repr=False)
class Clearance:
    """Distances that a program keeps above lower bounds.

    Attributes:
        function: distances (m,) [m] at the configuration (N,) of all arms, one after the other.
        lower: smallest distances allowed (m,) [m].
        names: of the distances, such as "panda_link2 to panda_link5".
        exact: distance [m] of the exact geometry, 0 where it overlaps, at a configuration (N,) for
            the distance of an index; None if it is not known.
    """

    function: ca.Function
    lower: Array
    names: tuple[str, ...]
    exact: Callable[[Array, int], float] | None = None
    _rows: dict[int, ca.Function] = field(default_factory=dict, init=False)

    def __repr__(self) -> str:
        return f"Clearance({len(self.names)} distances of {self.dof} joints)"

    @property
    def dof(self) -> int:
        """Number N of joints of all arms."""
        return int(self.function.size1_in(0))

    def row(self, index: int) -> ca.Function:
        """One distance alone, as a function of (N,) with none of the others' operations.

        Raises:
            ValueError: there is no such distance.
        """
        if not 0 <= index < len(self.names):
            raise ValueError(f"index must be from 0 to {len(self.names) - 1}, got {index!r}")
        if index not in self._rows:
            q = ca.SX.sym("q", self.dof)
            distance = self.function(q)[index]
            self._rows[index] = ca.Function(f"distance_{index}", [q], [distance], ["q"], ["d"])
        return self._rows[index]
