"""A problem's conditions in a common form: named expressions with bounds."""

from __future__ import annotations

import copy
import inspect
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array

if TYPE_CHECKING:
    from geodesic_ocp.ocp.problem.problem import Problem


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
        q0, q1, v0, v1, q, v: the symbols (n, 1) in which they are written.
        p: the symbols (k, 1) of the problem's parameters.
        values: of the parameters, (k,).
        cost: what is added to the energy's integrand, in q, v and p.
        fixed: bare coordinates at the ends, which become values of nodes (symbols q0, q1).
        ends: other equalities at the ends (symbols q0, q1, v0, v1).
        bounds: bare coordinates along the path, which become bounds of nodes (symbols q, v).
        still: other constraints along the path in q alone.
        moving: constraints along the path in q and v.
        via: equalities (symbols q) at each via point.
        smooth: for each via point, that the velocity before it (symbols v0) is that after it (v1);
            empty where it may jump.
    """

    q0: ca.SX
    q1: ca.SX
    v0: ca.SX
    v1: ca.SX
    q: ca.SX
    v: ca.SX
    p: ca.SX
    values: Array
    cost: ca.SX
    fixed: tuple[Term, ...]
    ends: tuple[Term, ...]
    bounds: tuple[Term, ...]
    still: tuple[Term, ...]
    moving: tuple[Term, ...]
    via: tuple[tuple[Term, ...], ...]
    smooth: tuple[Term, ...]

    @property
    def on_velocities(self) -> str:
        """Names of the conditions on velocities at the ends."""
        velocities = ca.vertcat(self.v0, self.v1)
        return ", ".join(t.name for t in self.ends if ca.depends_on(t.expression, velocities))


def conditions(problem: Problem) -> Conditions:
    """The problem's boundary conditions, constraints and cost.

    Raises:
        ValueError: an entry is malformed, two have the same name, or a parameter is not numbers.
    """
    n = problem.metric.dim
    q0, q1, v0, v1, q, v = (ca.SX.sym(name, n) for name in ("q0", "q1", "v0", "v1", "q", "v"))
    symbolic, p, values = _with_symbols(problem)
    boundary, along = [], []
    # Expressions are those of the problem with symbols, bounds those of the one with numbers.
    at_ends = (q0, q1, v0, v1) if _takes_velocities(problem) else (q0, q1)
    written = symbolic.boundary(*at_ends)
    given = written if symbolic is problem else problem.boundary(*at_ends)
    entries = _pairs("boundary", written, given)
    boundary += [_equality(*entry, ca.vertcat(q0, q1)) for entry in entries]
    held = symbolic.constraints(q, v)
    entries = _pairs(
        "constraints", held, held if symbolic is problem else problem.constraints(q, v)
    )
    for place, one, other in entries:
        _, expression, _, name = _entry(one, place, "lower, expression, upper")
        low, _, high, _ = _entry(other, place, "lower, expression, upper")
        along.append(_term(name, low, expression, high, ca.vertcat(q, v)))
    via = _via(problem, symbolic, q)
    smooth = []
    if problem.continuous_velocity_at_via:
        for number in range(len(via)):
            smooth.append(_term(f"velocity at via[{number}]", 0.0, v1 - v0, 0.0, ca.SX(0, 1)))
    names = [term.name for term in (*boundary, *along, *smooth, *(t for each in via for t in each))]
    if len(set(names)) < len(names):
        raise ValueError(f"conditions must have different names, got {', '.join(names)}")

    cost = _expression("cost", symbolic.cost(q, v))
    if cost.shape != (1, 1):
        raise ValueError(f"cost(q, v) must be one number, is of shape {cost.shape}")
    bounds = [t for t in along if t.coordinates is not None and max(t.coordinates, default=0) < n]
    functions = [term for term in along if term not in bounds]
    moving = [term for term in functions if ca.depends_on(term.expression, v)]
    return Conditions(
        *(q0, q1, v0, v1, q, v, p, values, cost),
        fixed=tuple(term for term in boundary if term.coordinates is not None),
        ends=tuple(term for term in boundary if term.coordinates is None),
        bounds=tuple(bounds),
        still=tuple(term for term in functions if term not in moving),
        moving=tuple(moving),
        via=via,
        smooth=tuple(smooth),
    )


def _via(problem: Problem, symbolic: Problem, q: ca.SX) -> tuple[tuple[Term, ...], ...]:
    written = symbolic.via(q)
    given = written if symbolic is problem else problem.via(q)
    points = []
    for place, station, same in _pairs("via", written, given):
        if not isinstance(station, Sequence) or not len(station):
            raise ValueError(f"{place} must be a list of equalities, got {station!r}")
        points.append(
            tuple(_equality(*entry, ca.SX(0, 1)) for entry in _pairs(place, station, same))
        )
    return tuple(points)


def _equality(place: str, one: Any, other: Any, symbols: ca.SX) -> Term:
    """A term of the entries (expression, value[, name]) with symbols and with numbers."""
    expression, _, name = _entry(one, place, "expression, value")
    value = _entry(other, place, "expression, value")[1]
    return _term(name, value, expression, value, symbols)


def _takes_velocities(problem: Problem) -> bool:
    return len(inspect.signature(problem.boundary).parameters) == 4


def _with_symbols(problem: Problem) -> tuple[Problem, ca.SX, Array]:
    """The problem with symbols for its parameters, these symbols, and their values."""
    if not problem.parameters:
        return problem, ca.SX(0, 1), np.zeros(0)
    symbolic, symbols, numbers = copy.copy(problem), [], []
    for name in problem.parameters:
        try:
            value = np.array(getattr(problem, name), dtype=float)
        except (AttributeError, TypeError, ValueError):
            value = np.array(np.nan)
        if value.ndim > 2 or not np.all(np.isfinite(value)):
            raise ValueError(f"parameter {name!r} must be a field with finite numbers")
        shape = value.shape if value.ndim == 2 else (value.size, 1)
        symbol = ca.SX.sym(name, *shape)
        object.__setattr__(symbolic, name, symbol)
        symbols.append(ca.vec(symbol))
        numbers.append(value.ravel(order="F"))
    return symbolic, ca.vertcat(*symbols), np.concatenate(numbers)


def _pairs(what: str, written: Sequence[Any], given: Sequence[Any]) -> list[tuple[str, Any, Any]]:
    for sequence in (written, given):
        if not isinstance(sequence, (list, tuple)):
            raise ValueError(f"{what} must give a list of conditions, got {sequence!r}")
    if len(written) != len(given):
        raise ValueError(f"{what}: how many conditions there are must not depend on parameters")
    pairs = enumerate(zip(written, given, strict=True))
    return [(f"{what}[{index}]", *pair) for index, pair in pairs]


def _entry(entry: Sequence[Any], place: str, form: str) -> list[Any]:
    """The entry's parts, with its place for a name where it has none."""
    count = form.count(",") + 1
    if not isinstance(entry, (tuple, list)) or len(entry) not in (count, count + 1):
        raise ValueError(f"{place} must be ({form}[, name]), got {entry!r}")
    return [*entry[:count], str(entry[count]) if len(entry) > count else place]


def _expression(name: str, expression: Any) -> ca.SX:
    try:
        return ca.SX(expression)
    except (NotImplementedError, TypeError, RuntimeError):
        raise ValueError(f"{name}: {expression!r} is not an expression in SX symbols") from None


def _term(name: str, lower: Any, expression: Any, upper: Any, symbols: ca.SX) -> Term:
    column = ca.SX(ca.densify(ca.vec(_expression(name, expression))))
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
