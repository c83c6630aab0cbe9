"""A problem's conditions in a common form: named expressions with bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.ocp.problem import Problem


@dataclass(frozen=True, eq=False)
class Term:
    """Lower and upper bounds (m,) on an expression (m, 1) in some symbols.

    Attributes:
        name: as the problem gave it, or its place in the problem.
        expression: what is bounded.
        lower, upper: equal for an equality.
        coordinates: indices (m,) into the symbols where every row is a bare symbol, else None.
    """

    name: str
    expression: ca.SX
    lower: Array
    upper: Array
    coordinates: tuple[int, ...] | None

    @property
    def size(self) -> int:
        """Number m of rows."""
        return int(self.expression.shape[0])


@dataclass(frozen=True, eq=False)
class Conditions:
    """All conditions of a problem, by how they enter the NLP.

    Attributes:
        q0, q1, q, v: the symbols (n, 1) in which they are written.
        fixed: bare coordinates at the ends, which become values of nodes (symbols q0, q1).
        ends: other equalities at the ends (symbols q0, q1).
        bounds: bare coordinates along the path, which become bounds of nodes (symbols q, v).
        still: other constraints along the path in q alone.
        moving: constraints along the path in q and v.
    """

    q0: ca.SX
    q1: ca.SX
    q: ca.SX
    v: ca.SX
    fixed: tuple[Term, ...]
    ends: tuple[Term, ...]
    bounds: tuple[Term, ...]
    still: tuple[Term, ...]
    moving: tuple[Term, ...]


def conditions(problem: Problem) -> Conditions:
    """The problem's boundary conditions and constraints.

    Raises:
        ValueError: an entry is malformed, or two have the same name.
    """
    n = problem.metric.dim
    q0, q1, q, v = (ca.SX.sym(name, n) for name in ("q0", "q1", "q", "v"))
    boundary, along = [], []
    for index, equality in enumerate(problem.boundary(q0, q1)):
        expression, value, name = _entry(equality, f"boundary[{index}]", "expression, value")
        boundary.append(_term(name, value, expression, value, ca.vertcat(q0, q1)))
    for index, inequality in enumerate(problem.constraints(q, v)):
        place = f"constraints[{index}]"
        low, expression, high, name = _entry(inequality, place, "lower, expression, upper")
        along.append(_term(name, low, expression, high, ca.vertcat(q, v)))
    names = [term.name for term in boundary + along]
    if len(set(names)) < len(names):
        raise ValueError(f"conditions must have different names, got {', '.join(names)}")

    bounds = [t for t in along if t.coordinates is not None and max(t.coordinates, default=0) < n]
    functions = [term for term in along if term not in bounds]
    moving = [term for term in functions if ca.depends_on(term.expression, v)]
    return Conditions(
        *(q0, q1, q, v),
        fixed=tuple(term for term in boundary if term.coordinates is not None),
        ends=tuple(term for term in boundary if term.coordinates is None),
        bounds=tuple(bounds),
        still=tuple(term for term in functions if term not in moving),
        moving=tuple(moving),
    )


def _entry(entry: Sequence[Any], place: str, form: str) -> list[Any]:
    """The entry's parts, with its place for a name where it has none."""
    count = form.count(",") + 1
    if not isinstance(entry, (tuple, list)) or len(entry) not in (count, count + 1):
        raise ValueError(f"{place} must be ({form}[, name]), got {entry!r}")
    return [*entry[:count], str(entry[count]) if len(entry) > count else place]


def _term(name: str, lower: Any, expression: Any, upper: Any, symbols: ca.SX) -> Term:
    try:
        column = ca.SX(ca.densify(ca.vec(ca.SX(expression))))
    except (NotImplementedError, TypeError, RuntimeError):
        raise ValueError(f"{name}: {expression!r} is not an expression in SX symbols") from None
    size = column.shape[0]
    limits = []
    for limit in (lower, upper):
        # CasADi fills matrices by columns, as ca.vec does above.
        values = np.asarray(limit, dtype=float).ravel(order="F")
        if values.size not in (1, size) or np.any(np.isnan(values)):
            raise ValueError(f"{name}: a bound must be one number or {size}, got {limit!r}")
        limits.append(np.broadcast_to(values, (size,)).copy())
    if np.any(limits[0] > limits[1]):
        raise ValueError(f"{name}: a lower bound lies above its upper bound")
    return Term(name, column, limits[0], limits[1], _bare_symbols(column, symbols))


def _bare_symbols(column: ca.SX, symbols: ca.SX) -> tuple[int, ...] | None:
    index = []
    known = {symbol.element_hash(): place for place, symbol in enumerate(ca.vertsplit(symbols))}
    for entry in ca.vertsplit(column):
        if not entry.is_symbolic() or entry.element_hash() not in known:
            return None
        index.append(known[entry.element_hash()])
    return tuple(index)


def stacked(terms: Sequence[Term]) -> ca.SX:
    """All expressions in one column; (0, 1) where there is none."""
    return ca.vertcat(ca.SX(0, 1), *(term.expression for term in terms))
