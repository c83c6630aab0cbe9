"""A problem's boundary conditions, constraints and cost in the common form of the NLP."""

from __future__ import annotations

import copy
import inspect
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, is_symbolic, real_array
from geodesic_ocp.ocp.nlp.conditions import Condition, Conditions


def parse_conditions(problem: Any) -> Conditions:
    """The conditions of a `Problem`; each of its methods is called once.

    The parameter has no type, as `Problem` is built on this function.

    Raises:
        ValueError: an entry is malformed, two have the same name, or a parameter is not numeric.
    """
    n = problem.metric.dim
    q0, q1, v0, v1, q, v = (ca.SX.sym(name, n) for name in ("q0", "q1", "v0", "v1", "q", "v"))
    symbolic, parameters = _with_symbols(problem)
    at_ends = (q0, q1, v0, v1) if _takes_velocities(problem) else (q0, q1)
    equality, inequality = parameters.equality, parameters.inequality

    entries = _listed("boundary", symbolic.boundary(*at_ends))
    boundary = [equality(*entry, ca.vertcat(q0, q1)) for entry in entries]
    entries = _listed("constraints", symbolic.constraints(q, v))
    along = [inequality(*entry, ca.vertcat(q, v)) for entry in entries]
    via = []
    for label, at_one in _listed("via", symbolic.via(q)):
        if not isinstance(at_one, Sequence) or not len(at_one):
            raise ValueError(f"{label} must be a list of equalities, got {at_one!r}")
        via.append(tuple(equality(*entry, ca.SX(0, 1)) for entry in _listed(label, at_one)))
    continuity = []
    if problem.continuous_velocity_at_via:
        for number in range(len(via)):
            entry = (v1 - v0, 0.0, f"velocity at via[{number}]")
            continuity.append(equality("", entry, ca.SX(0, 1)))
    names = [c.name for c in (*boundary, *along, *continuity, *(c for each in via for c in each))]
    if len(set(names)) < len(names):
        raise ValueError(f"conditions must have different names, got {', '.join(names)}")

    cost = _expression("cost", symbolic.cost(q, v))
    if cost.shape != (1, 1):
        raise ValueError(f"cost(q, v) must be a scalar, got shape {cost.shape}")
    bounds = [c for c in along if c.coordinates is not None and max(c.coordinates, default=0) < n]
    functions = [c for c in along if c not in bounds]
    along_qv = [c for c in functions if ca.depends_on(c.expression, v)]
    return Conditions(
        *(q0, q1, v0, v1, q, v, parameters.symbols, parameters.values, cost),
        fixed=tuple(c for c in boundary if c.coordinates is not None),
        ends=tuple(c for c in boundary if c.coordinates is None),
        bounds=tuple(bounds),
        along_q=tuple(c for c in functions if c not in along_qv),
        along_qv=tuple(along_qv),
        via=tuple(via),
        via_continuity=tuple(continuity),
    )


def _takes_velocities(problem: Any) -> bool:
    return len(inspect.signature(problem.boundary).parameters) == 4


@dataclass(frozen=True, eq=False)
class _Parameters:
    """Symbols (k, 1) of a problem's parameters and their values (k,)."""

    symbols: ca.SX
    values: Array

    def equality(self, label: str, entry: Sequence[Any], symbols: ca.SX) -> Condition:
        """The condition of an entry (expression, value[, name])."""
        expression, value, name = _parts(entry, label, "expression, value")
        return self._condition(name, value, expression, value, symbols)

    def inequality(self, label: str, entry: Sequence[Any], symbols: ca.SX) -> Condition:
        """The condition of an entry (lower, expression, upper[, name])."""
        lower, expression, upper, name = _parts(entry, label, "lower, expression, upper")
        return self._condition(name, lower, expression, upper, symbols)

    def _condition(
        self, name: str, lower: Any, expression: Any, upper: Any, symbols: ca.SX
    ) -> Condition:
        column = ca.SX(ca.densify(ca.vec(_expression(name, expression))))
        size = column.shape[0]
        limits = []
        for limit in (lower, upper):
            # CasADi fills matrices by columns, as ca.vec does above.
            values = self._numbers(name, limit).ravel(order="F")
            if values.size not in (1, size) or np.any(np.isnan(values)):
                raise ValueError(f"{name}: a bound must be one number or {size}, got {limit!r}")
            limits.append(np.broadcast_to(values, (size,)).copy())
        if np.any(limits[0] > limits[1]):
            raise ValueError(f"{name}: a lower bound lies above its upper bound")
        return Condition(name, column, limits[0], limits[1], _bare_symbols(column, symbols))

    def _numbers(self, name: str, limit: Any) -> Array:
        """A bound as numbers, with the parameters at their values."""
        if not _has_symbols(limit):
            try:
                return real_array(limit)
            except (TypeError, ValueError):
                raise ValueError(f"{name}: a bound must be numbers, got {limit!r}") from None
        try:
            is_list = isinstance(limit, (list, tuple, np.ndarray))
            expression = ca.densify(ca.SX(ca.vertcat(*limit) if is_list else limit))
            function = ca.Function("bound", [self.symbols], [expression])
        except (NotImplementedError, TypeError, RuntimeError):
            raise ValueError(
                f"{name}: a bound must be numbers or an expression in the parameters alone, got "
                f"{limit!r}"
            ) from None
        return np.asarray(function(self.values).full())


def _has_symbols(limit: Any) -> bool:
    if isinstance(limit, (list, tuple)):
        return any(map(_has_symbols, limit))
    if isinstance(limit, np.ndarray):
        return bool(limit.dtype == object)
    return is_symbolic(limit)


def _with_symbols(problem: Any) -> tuple[Any, _Parameters]:
    """The problem with symbols in place of its parameters, and these symbols."""
    if not problem.parameters:
        return problem, _Parameters(ca.SX(0, 1), np.zeros(0))
    symbolic, symbols, numbers = copy.copy(problem), [], []
    for name in problem.parameters:
        try:
            value = real_array(getattr(problem, name))
        except (AttributeError, TypeError, ValueError):
            value = np.array(np.nan)
        if value.ndim > 2 or not np.all(np.isfinite(value)):
            raise ValueError(f"parameter {name!r} must be a field with finite numbers")
        shape = value.shape if value.ndim == 2 else (value.size, 1)
        symbol = ca.SX.sym(name, *shape)
        object.__setattr__(symbolic, name, symbol)
        symbols.append(ca.vec(symbol))
        numbers.append(value.ravel(order="F"))
    return symbolic, _Parameters(ca.vertcat(*symbols), np.concatenate(numbers))


def _listed(what: str, entries: Any) -> list[tuple[str, Any]]:
    """Entries with labels such as "boundary[0]"."""
    if not isinstance(entries, (list, tuple)):
        raise ValueError(f"{what} must give a list of conditions, got {entries!r}")
    return [(f"{what}[{index}]", entry) for index, entry in enumerate(entries)]


def _parts(entry: Sequence[Any], label: str, form: str) -> list[Any]:
    """The entry's parts; its label stands in for a name that is not given."""
    count = form.count(",") + 1
    if not isinstance(entry, (tuple, list)) or len(entry) not in (count, count + 1):
        raise ValueError(f"{label} must be ({form}[, name]), got {entry!r}")
    return [*entry[:count], str(entry[count]) if len(entry) > count else label]


def _expression(name: str, expression: Any) -> ca.SX:
    try:
        return ca.SX(expression)
    except (NotImplementedError, TypeError, RuntimeError):
        raise ValueError(f"{name}: {expression!r} is not an expression in SX symbols") from None


def _bare_symbols(column: ca.SX, symbols: ca.SX) -> tuple[int, ...] | None:
    """Indices (m,) of the symbols that the rows are, or None if a row is anything else."""
    index = []
    known = {symbol.element_hash(): number for number, symbol in enumerate(ca.vertsplit(symbols))}
    for entry in ca.vertsplit(column):
        if not entry.is_symbolic() or entry.element_hash() not in known:
            return None
        index.append(known[entry.element_hash()])
    return tuple(index)
