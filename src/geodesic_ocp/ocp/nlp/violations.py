"""How far a path violates a problem's conditions, at the nodes of its grid and between them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.ocp.nlp.conditions import Condition, Conditions
from geodesic_ocp.ocp.nlp.path_samples import PathSamples, excess_over_bounds
from geodesic_ocp.trajectory.path import Path

# Without a tolerance, solutions violate no condition by more than this, in its unit.
BETWEEN_NODES = 1e-4
NEGLIGIBLE = 1e-6  # smaller violations are ignored before a solve, and in messages

# path -> parameters s (k,), and the largest violation of any path constraint at each (k,)
ViolationProfile: TypeAlias = Callable[[Path], tuple[Array, Array]]


@dataclass(frozen=True)
class Violation:
    """The largest violation of a condition.

    Attributes:
        name: of the condition, as given by the problem, or its position in the problem's list.
        component: the row of the condition, in words: a joint, a coordinate, or a number.
        value: of the expression there.
        limit: the violated bound or value.
        s: path parameter; None for a condition on both ends.
        unit: of the coordinate, for joint limits of a model; None for other conditions.
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


def find_violations(
    conditions: Conditions, path: Path, joint_names: Sequence[str] | None
) -> tuple[Violation, ...]:
    """The largest violation of every violated condition, the worst first.

    Path constraints are evaluated at the nodes and between them.
    """
    found = [
        *_at_ends(conditions, path, joint_names),
        *_at_via(conditions, path, joint_names),
        *_along(conditions, path, joint_names),
    ]
    return tuple(sorted(found, key=lambda one: -one.amount))


def violations_at(conditions: Conditions, q: Array, s: float) -> tuple[Violation, ...]:
    """Violations of the path constraints in q, except bounds, at one configuration (n,)."""
    found: list[Violation] = []
    for condition in conditions.along_q:
        function = ca.Function("condition", [conditions.q, conditions.p], [condition.expression])
        values = evaluate(function, q, conditions.p_values)
        found += _worst(condition, values, np.array([s]), q.size, None)
    return tuple(sorted(found, key=lambda one: -one.amount))


def violation_profile(conditions: Conditions) -> ViolationProfile:
    """A function that gives the largest violation of the path constraints along a path."""
    samples = PathSamples(conditions)

    def profile(path: Path) -> tuple[Array, Array]:
        s, found = samples(path)
        excess = [excess_over_bounds(c, values).max(axis=0, initial=0.0) for c, values in found]
        return s, np.maximum.reduce([np.zeros(s.size), *excess])

    return profile


def _at_ends(
    conditions: Conditions, path: Path, joint_names: Sequence[str] | None
) -> Iterator[Violation]:
    c, n, nodes = conditions, path.metric.dim, path.nodes
    for condition in c.fixed:
        assert condition.coordinates is not None
        ends = {coordinate // n for coordinate in condition.coordinates}
        s = np.array([float(max(ends))]) if len(ends) == 1 else None
        values = nodes[[0, -1]].ravel()[list(condition.coordinates)]
        yield from _worst(condition, values[:, None], s, n, joint_names)
    if c.ends:
        symbols = [c.q0, c.q1, c.v0, c.v1, c.p]
        states = [*nodes[[0, -1]], *path([0.0, 1.0], 1), c.p_values]
    for condition in c.ends:
        first, last = (
            ca.depends_on(condition.expression, ca.vertcat(*pair))
            for pair in ((c.q0, c.v0), (c.q1, c.v1))
        )
        values = evaluate(ca.Function("condition", symbols, [condition.expression]), *states)
        s = None if first == last else np.array([float(last)])
        yield from _worst(condition, values, s, n, joint_names)


def _at_via(
    conditions: Conditions, path: Path, joint_names: Sequence[str] | None
) -> Iterator[Violation]:
    grid = path.grid
    for s, node, at_one in zip(grid.via_s, grid.via_nodes, conditions.via, strict=True):
        for condition in at_one:
            symbols = [conditions.q, conditions.p]
            function = ca.Function("condition", symbols, [condition.expression])
            values = evaluate(function, path.nodes[node], conditions.p_values)
            yield from _worst(condition, values, np.array([s]), path.metric.dim, joint_names)


def _along(
    conditions: Conditions, path: Path, joint_names: Sequence[str] | None
) -> Iterator[Violation]:
    if conditions.along_q or conditions.along_qv or conditions.bounds:
        s, found = PathSamples(conditions)(path)
        n = path.metric.dim
        units = getattr(getattr(path.metric, "model", None), "units", ("",) * n)
        for condition, values in found:
            of_limits = units if condition in conditions.bounds else None
            yield from _worst(condition, values, s, n, joint_names, of_limits)


def _worst(
    condition: Condition,
    values: Array,
    s: Array | None,
    n: int,
    joint_names: Sequence[str] | None,
    units: Sequence[str] | None = None,
) -> Iterator[Violation]:
    """The largest violation of a condition's values (m, k), if any; NaN counts as infinite.

    Units (n,) are given for limits of coordinates.
    """
    unit = None
    excess = excess_over_bounds(condition, values)
    if not np.any(excess > 0.0):
        return
    row, column = np.unravel_index(int(np.argmax(excess)), excess.shape)
    value = float(values[row, column])
    limit = float(condition.upper[row] if value > condition.upper[row] else condition.lower[row])
    component = f"{condition.name}[{row}]" if condition.size > 1 else condition.name
    if condition.coordinates is not None:
        coordinate = condition.coordinates[int(row)] % n
        unit = None if units is None else units[coordinate]
        component = (
            f"q[{coordinate}]" if joint_names is None else f"joint {joint_names[coordinate]}"
        )
    where = None if s is None else float(s[min(int(column), s.size - 1)])
    yield Violation(condition.name, component, value, limit, where, unit)
