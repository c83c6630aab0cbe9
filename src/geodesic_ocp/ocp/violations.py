"""By how much a path misses a problem's conditions, between the nodes of its grid, too."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.ocp.path import Path
from geodesic_ocp.ocp.terms import Conditions, Term

NEGLIGIBLE = 1e-6  # violations that are passed over before a solve, and in messages
_PER_NODE = 4  # places looked at between two nodes

# Of a path: places s (k,), and the largest violation there (k,) of any condition along it.
Misses: TypeAlias = Callable[[Path], tuple[Array, Array]]


@dataclass(frozen=True)
class Violation:
    """The worst miss of one component of a condition.

    Attributes:
        name: of the condition, as the problem gave it, or its place in the problem.
        component: which of its rows, in words: a joint, a coordinate, or a number.
        value: what was found.
        limit: the bound or value that it misses.
        s: where on the path; None of a condition on both ends.
    """

    name: str
    component: str
    value: float
    limit: float
    s: float | None

    @property
    def amount(self) -> float:
        """Distance of the value from the limit."""
        return abs(self.value - self.limit)

    def __str__(self) -> str:
        side = "exceeds" if self.value > self.limit else "falls below"
        where = "at both ends" if self.s is None else f"at s = {self.s:.2f}"
        return (
            f"{self.component} {side} {self.limit:.4g} by {self.amount:.2g} {where}"
            f" (condition {self.name!r})"
        )


def violations(
    terms: Conditions, path: Path, joint_names: Sequence[str] | None
) -> tuple[Violation, ...]:
    """Every condition that the path misses, at the component and place that is worst; worst first.

    Places are the nodes, and others between them.
    """
    found = [
        *_at_ends(terms, path, joint_names),
        *_at_via(terms, path, joint_names),
        *_along(terms, path, joint_names),
    ]
    return tuple(sorted(found, key=lambda one: -one.amount))


def violations_at(terms: Conditions, q: Array, s: float) -> tuple[Violation, ...]:
    """Every condition along the path, other than bounds, that a configuration (n,) at s misses."""
    found: list[Violation] = []
    for term in terms.still:
        function = ca.Function("term", [terms.q, terms.p], [term.expression])
        values = evaluate(function, q, terms.values)
        found += _worst(term, values, np.array([s]), q.size, None)
    return tuple(sorted(found, key=lambda one: -one.amount))


def misses(terms: Conditions) -> Misses:
    """By how much paths violate the conditions along them, and where."""
    functions = (*terms.still, *terms.moving)
    rows = [ca.SX(0, 1), *(term.expression for term in functions)]
    function = ca.Function("along", [terms.q, terms.v, terms.p], [ca.vertcat(*rows)])

    def along(path: Path) -> tuple[Array, Array]:
        s = places_between(path)
        positions, excess = path(s), np.zeros(s.size)
        for term in terms.bounds:
            excess = np.maximum(excess, _excess(term, positions[:, list(term.coordinates or ())].T))
        if functions:
            own = np.tile(terms.values[:, None], s.size)
            values = evaluate(function.map(s.size), positions.T, path(s, 1).T, own)
            ends = np.cumsum([term.size for term in functions])[:-1]
            for term, part in zip(functions, np.split(values, ends), strict=True):
                excess = np.maximum(excess, _excess(term, part))
        return s, excess

    return along


def _excess(term: Term, values: Array) -> Array:
    """Largest violation (k,) of a term's values (m, k); NaN is an infinite one."""
    excess = np.maximum(term.lower[:, None] - values, values - term.upper[:, None])
    return np.asarray(np.where(np.isnan(excess), np.inf, excess).max(axis=0, initial=0.0))


def _at_ends(
    terms: Conditions, path: Path, joint_names: Sequence[str] | None
) -> Iterator[Violation]:
    n, nodes = path.metric.dim, path.nodes
    for term in terms.fixed:
        assert term.coordinates is not None
        ends = {coordinate // n for coordinate in term.coordinates}
        place = np.array([float(max(ends))]) if len(ends) == 1 else None
        values = nodes[[0, -1]].ravel()[list(term.coordinates)]
        yield from _worst(term, values[:, None], place, n, joint_names)
    if terms.ends:
        symbols = [terms.q0, terms.q1, terms.v0, terms.v1, terms.p]
        states = [*nodes[[0, -1]], *path([0.0, 1.0], 1), terms.values]
    for term in terms.ends:
        first, last = (
            ca.depends_on(term.expression, ca.vertcat(*pair))
            for pair in ((terms.q0, terms.v0), (terms.q1, terms.v1))
        )
        values = evaluate(ca.Function("term", symbols, [term.expression]), *states)
        place = None if first == last else np.array([float(last)])
        yield from _worst(term, values, place, n, joint_names)


def _at_via(
    terms: Conditions, path: Path, joint_names: Sequence[str] | None
) -> Iterator[Violation]:
    grid = path.grid
    for share, node, station in zip(grid.shares, grid.station_nodes, terms.via, strict=True):
        for term in station:
            function = ca.Function("term", [terms.q, terms.p], [term.expression])
            values = evaluate(function, path.nodes[node], terms.values)
            yield from _worst(term, values, np.array([share]), path.metric.dim, joint_names)


def _along(terms: Conditions, path: Path, joint_names: Sequence[str] | None) -> Iterator[Violation]:
    functions = (*terms.still, *terms.moving)
    if not functions and not terms.bounds:
        return
    s, n = places_between(path), path.metric.dim
    positions = path(s)
    for term in terms.bounds:
        assert term.coordinates is not None
        yield from _worst(term, positions[:, list(term.coordinates)].T, s, n, joint_names)
    states = [positions.T, path(s, 1).T, np.tile(terms.values[:, None], s.size)]
    for term in functions:
        function = ca.Function("term", [terms.q, terms.v, terms.p], [term.expression])
        yield from _worst(term, evaluate(function.map(s.size), *states), s, n, joint_names)


def places_between(path: Path) -> Array:
    """Values of s (k,): the nodes, and places between them; one-sided at ends of segments."""
    nodes = path.grid.nodes
    steps = np.arange(_PER_NODE) / _PER_NODE
    between = (nodes[:-1, None] + np.diff(nodes)[:, None] * steps).ravel()
    inner = path.breakpoints[1:-1]
    return np.sort(np.concatenate([between, [1.0], inner - 1e-12]))


def _worst(
    term: Term, values: Array, s: Array | None, n: int, joint_names: Sequence[str] | None
) -> Iterator[Violation]:
    """The worst miss of a term's values (m, k), if there is any; NaN is an infinite one."""
    lower, upper = term.lower[:, None], term.upper[:, None]
    excess = np.maximum(lower - values, values - upper)
    excess = np.where(np.isnan(excess), np.inf, excess)
    if not np.any(excess > 0.0):
        return
    row, place = np.unravel_index(int(np.argmax(excess)), excess.shape)
    value = float(values[row, place])
    limit = float(term.upper[row] if value > term.upper[row] else term.lower[row])
    component = f"{term.name}[{row}]" if term.size > 1 else term.name
    if term.coordinates is not None:
        coordinate = term.coordinates[int(row)] % n
        component = (
            f"q[{coordinate}]" if joint_names is None else f"joint {joint_names[coordinate]}"
        )
    where = None if s is None else float(s[min(int(place), s.size - 1)])
    yield Violation(term.name, component, value, limit, where)
