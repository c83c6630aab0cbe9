"""Conditions on a path in a common form: named expressions with bounds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi as ca

from geodesic_ocp.arrays import Array


@dataclass(frozen=True, eq=False, repr=False)
class Condition:
    """Lower and upper bounds (m,) on an expression (m, 1).

    Attributes:
        name: as given by the problem, or its position in the problem's list.
        expression: the bounded expression.
        lower, upper: the bounds; equal for an equality.
        coordinates: indices (m,) into the symbols if every row is a bare symbol, else None.
    """

    name: str
    expression: ca.SX
    lower: Array
    upper: Array
    coordinates: tuple[int, ...] | None

    def __repr__(self) -> str:
        return f"Condition({self.name!r}, {self.size} rows)"

    @property
    def size(self) -> int:
        """Number m of rows."""
        return int(self.expression.shape[0])


@dataclass(frozen=True, eq=False, repr=False)
class Conditions:
    """All conditions of a problem and its running cost, sorted by how they enter the NLP.

    Attributes:
        q0, q1, v0, v1, q, v: symbols (n, 1) in which the expressions are written: both ends of the
            path, the velocities there, and a point of the path with its velocity.
        p: symbols (k, 1) of the problem's parameters.
        p_values: values of the parameters (k,).
        cost: running cost, added to the integrand of the energy, in q, v and p.
        fixed: bare coordinates at the ends, which fix nodes (in q0 and q1).
        ends: all other equalities at the ends (in q0, q1, v0, v1).
        bounds: bare coordinates along the path, which bound nodes (in q).
        along_q: all other path constraints in q alone.
        along_qv: path constraints in q and v.
        via: equalities (in q) at each via point.
        via_continuity: for each via point, the velocity before it (v0) equals the velocity after it
            (v1); empty where the velocity may jump.
    """

    q0: ca.SX
    q1: ca.SX
    v0: ca.SX
    v1: ca.SX
    q: ca.SX
    v: ca.SX
    p: ca.SX
    p_values: Array
    cost: ca.SX
    fixed: tuple[Condition, ...]
    ends: tuple[Condition, ...]
    bounds: tuple[Condition, ...]
    along_q: tuple[Condition, ...]
    along_qv: tuple[Condition, ...]
    via: tuple[tuple[Condition, ...], ...]
    via_continuity: tuple[Condition, ...]

    def __repr__(self) -> str:
        n, k = self.q.shape[0], self.p_values.size
        return f"Conditions({len(list(self))} on {n} coordinates, {k} parameters)"

    def __iter__(self) -> Iterator[Condition]:
        yield from (*self.fixed, *self.ends, *self.bounds, *self.along_q, *self.along_qv)
        for at_one in self.via:
            yield from at_one
        yield from self.via_continuity

    @property
    def only_ends(self) -> bool:
        """Whether there are no conditions but those at the ends."""
        return not (self.bounds or self.along_q or self.along_qv or self.via)

    @property
    def on_end_velocities(self) -> str:
        """Names of the conditions on velocities at the ends, separated by commas."""
        velocities = ca.vertcat(self.v0, self.v1)
        return ", ".join(c.name for c in self.ends if ca.depends_on(c.expression, velocities))


def stacked(conditions: Sequence[Condition]) -> ca.SX:
    """All expressions in one column; (0, 1) if there are none."""
    return ca.vertcat(ca.SX(0, 1), *(condition.expression for condition in conditions))
