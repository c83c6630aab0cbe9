"""By how much a path misses a problem's conditions, between the nodes of its grid, too."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.ocp.nlp.conditions import Conditions, Term
from geodesic_ocp.trajectory.path import Path

NEGLIGIBLE = 1e-6  # violations that are passed over before a solve, and in messages
_PER_NODE = 4  # places looked at between two nodes
_CLOSE = 1e-2  # of the range of a condition's values
_POLISHED = 3  # times that a parabola's top is added to them

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
        unit: of a coordinate's limit, where the model tells it; None of other conditions.
    """

    name: str
    component: str
    value: float
    limit: float
    s: float | None
    unit: str | None = None

    @property
    def amount(self) -> float:
        """Distance of the value from the limit."""
        return abs(self.value - self.limit)

    def __str__(self) -> str:
        side = "exceeds" if self.value > self.limit else "falls below"
        where = "at both ends" if self.s is None else f"at s = {self.s:.2f}"
        bound = f"{self.limit:.4g}"
        if self.unit is not None:
            which = "upper" if self.value > self.limit else "lower"
            bound = f"its {which} limit {bound} {self.unit}".rstrip()
        return (
            f"{self.component} {side} {bound} by {self.amount:.2g} {where}"
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
    look = _Look(terms)

    def along(path: Path) -> tuple[Array, Array]:
        s, found = look(path)
        excess = [_signed(term, values).max(axis=0, initial=0.0) for term, values in found]
        return s, np.maximum.reduce([np.zeros(s.size), *excess])

    return along


def _signed(term: Term, values: Array) -> Array:
    """By how much values (m, k) are outside the bounds, negative inside; NaN is infinitely far."""
    excess = np.maximum(term.lower[:, None] - values, values - term.upper[:, None])
    return np.asarray(np.where(np.isnan(excess), np.inf, excess))


class _Look:
    """Values of the conditions along paths, also where between other places they are worst."""

    def __init__(self, terms: Conditions) -> None:
        self._terms, self._functions = terms, (*terms.still, *terms.moving)
        rows = [ca.SX(0, 1), *(term.expression for term in self._functions)]
        self._function = ca.Function("along", [terms.q, terms.v, terms.p], [ca.vertcat(*rows)])

    def __call__(self, path: Path) -> tuple[Array, list[tuple[Term, Array]]]:
        """Places s (k,), and of each condition along the path the values (m, k) there."""
        s = places_between(path)
        found = self._values(path, s)
        for _ in range(_POLISHED):
            peaks = [_peaks(s, _signed(term, values)) for term, values in found]
            new = np.setdiff1d(np.concatenate([np.zeros(0), *peaks]), s)
            if not new.size:
                break
            s = np.sort(np.concatenate([s, new]))
            found = self._values(path, s)
        return s, found

    def _values(self, path: Path, s: Array) -> list[tuple[Term, Array]]:
        positions = path(s)
        found = [
            (term, positions[:, list(term.coordinates or ())].T) for term in self._terms.bounds
        ]
        if self._functions:
            own = np.tile(self._terms.values[:, None], s.size)
            values = evaluate(self._function.map(s.size), positions.T, path(s, 1).T, own)
            ends = np.cumsum([term.size for term in self._functions])[:-1]
            found += zip(self._functions, np.split(values, ends), strict=True)
        return found


def _peaks(s: Array, excess: Array) -> Array:
    """Where parabolas through three neighbours of excess (m, k) have tops outside, or nearly."""
    if s.size < 3:
        return np.zeros(0)
    left, middle, right = excess[:, :-2], excess[:, 1:-1], excess[:, 2:]
    a, b = np.diff(s)[:-1], np.diff(s)[1:]
    with np.errstate(all="ignore"):  # there may be infinities
        before, after = (middle - left) / a, (right - middle) / b
        bend = (after - before) / (a + b)
        slope = before + bend * a
        top = middle - slope**2 / (4.0 * bend)
        place = s[1:-1] - slope / (2.0 * bend)
        inside = (place > s[:-2]) & (place < s[2:])
        finite = np.where(np.isfinite(excess), excess, 0.0)
        near = -_CLOSE * np.ptp(finite, axis=1, keepdims=True)  # a parabola may miss a top
        there = (bend < 0.0) & (top > near) & inside
    return np.asarray(place[there])


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
    for share, node, station in zip(grid.via_s, grid.via_nodes, terms.via, strict=True):
        for term in station:
            function = ca.Function("term", [terms.q, terms.p], [term.expression])
            values = evaluate(function, path.nodes[node], terms.values)
            yield from _worst(term, values, np.array([share]), path.metric.dim, joint_names)


def _along(terms: Conditions, path: Path, joint_names: Sequence[str] | None) -> Iterator[Violation]:
    if terms.still or terms.moving or terms.bounds:
        s, found = _Look(terms)(path)
        n = path.metric.dim
        units = getattr(getattr(path.metric, "model", None), "units", ("",) * n)
        for term, values in found:
            of_bounds = units if term in terms.bounds else None
            yield from _worst(term, values, s, n, joint_names, of_bounds)


def places_between(path: Path) -> Array:
    """Values of s (k,): the nodes, and places between them; one-sided at ends of segments."""
    nodes = path.grid.nodes
    steps = np.arange(_PER_NODE) / _PER_NODE
    between = (nodes[:-1, None] + np.diff(nodes)[:, None] * steps).ravel()
    inner = path.breakpoints[1:-1]
    return np.sort(np.concatenate([between, [1.0], inner - 1e-12]))


def _worst(
    term: Term,
    values: Array,
    s: Array | None,
    n: int,
    joint_names: Sequence[str] | None,
    units: Sequence[str] | None = None,
) -> Iterator[Violation]:
    """The worst miss of a term's values (m, k), if there is any; NaN is an infinite one.

    Units (n,) are given for limits of coordinates.
    """
    unit = None
    excess = _signed(term, values)
    if not np.any(excess > 0.0):
        return
    row, place = np.unravel_index(int(np.argmax(excess)), excess.shape)
    value = float(values[row, place])
    limit = float(term.upper[row] if value > term.upper[row] else term.lower[row])
    component = f"{term.name}[{row}]" if term.size > 1 else term.name
    if term.coordinates is not None:
        coordinate = term.coordinates[int(row)] % n
        unit = None if units is None else units[coordinate]
        component = (
            f"q[{coordinate}]" if joint_names is None else f"joint {joint_names[coordinate]}"
        )
    where = None if s is None else float(s[min(int(place), s.size - 1)])
    yield Violation(term.name, component, value, limit, where, unit)
