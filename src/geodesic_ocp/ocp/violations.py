"""Violations of a problem's conditions by a path, at the nodes and between them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.blocks import Terms
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.ocp.conditions import (
    CELLS,
    Condition,
    Conditions,
    cells_at,
    excess_over_bounds,
    stacked,
)
from geodesic_ocp.trajectory.path import Path

_PER_NODE = 4  # samples between two nodes
_NEAR_BOUND = 1e-2  # of the range of a condition's values
MAY_CHANGE = 0.1  # of that range: bounds that are farther away are left out at first
_ONE_SIDED = 1e-12  # in s, before interior breakpoints
_SHARP = 1e-4  # of the range of a condition's values
_REFINEMENTS = 2  # times that the vertices of parabolas are added to the samples


class PathSamples:
    """Evaluates the path constraints of a problem along paths.

    Samples lie at the nodes, between them, and at the local maxima of the excess over the bounds,
    which parabolas through neighbouring samples locate, or, as those of the distance from a thin
    body are sharp, lines through two on either side; where bounds are nearer than values change.
    """

    def __init__(self, conditions: Conditions) -> None:
        c = self._conditions = conditions
        in_groups = (each for group in c.groups for each in group.conditions)
        self._all = (*c.bounds, *in_groups, *c.along_qv)
        self._ends = np.cumsum([condition.size for condition in self._all])[:-1]
        self.lower, self.upper, self.scales = (
            np.concatenate([np.zeros(0), *(getattr(each, name) for each in self._all)])
            for name in ("lower", "upper", "scales")
        )
        self._are_coordinates = np.arange(self.lower.size) < sum(each.size for each in c.bounds)
        self._of_last = lru_cache(maxsize=1)(self._sampled)

    def __call__(self, path: Path) -> tuple[Array, list[tuple[Condition, Array]]]:
        """Return parameters s (k,), and for each path constraint its values (m, k) there."""
        s, values = self._of_last(path)
        parts = np.split(values, self._ends)[: len(self._all)]
        return s, list(zip(self._all, parts, strict=True))

    def excess(self, path: Path, roughly: bool = False) -> tuple[Array, Array]:
        """Return parameters s (k,), and the largest violation of any path constraint at each (k,);
        roughly: without the maxima between the samples.
        """
        if roughly:
            s = sample_parameters(path)
            values = self._values(path, s)
        else:
            s, values = self._of_last(path)
        return s, excess_over_bounds(self, values).max(axis=0, initial=0.0)

    def linearized(self, path: Path, share: float) -> tuple[Array, Array, Array]:
        """Return s (m,), excess (m,) and its gradient by q (m, n) of conditions in q and bounds of
        coordinates, at samples where it is nearer to zero than a share of its range along the path.
        """
        s, values = self._of_last(path)
        excess = excess_over_bounds(self, values)
        near = excess > -share * np.ptp(values, axis=1, keepdims=True) / self.scales[:, None]
        c = self._conditions
        q = path(s)
        coordinates = [each for condition in c.bounds for each in condition.coordinates or ()]
        rows, at = np.nonzero(near[: len(coordinates)])
        parts = [(rows, at, np.eye(q.shape[1])[np.array(coordinates, dtype=int)[rows]])]
        first = len(coordinates)
        for group in c.groups:
            rows, at = np.nonzero(near[first : first + group.bounds[0].size])
            parts.append((first + rows, at, group.slopes(q, c.p_values, rows, at)))
            first += group.bounds[0].size
        rows, at, slopes = (np.concatenate(each) for each in zip(*parts, strict=True))
        found = values[rows, at]
        is_above = found - self.upper[rows] >= self.lower[rows] - found
        signs = np.where(is_above, 1.0, -1.0) / self.scales[rows]
        return s[at], excess[rows, at], signs[:, None] * slopes

    @cached_property
    def _in_qv(self) -> Terms:
        c = self._conditions
        return Terms(ca.vertcat(c.q, c.v), c.p, 0.0, stacked(c.along_qv))

    def _sampled(self, path: Path) -> tuple[Array, Array]:
        s = sample_parameters(path)
        values = self._values(path, s)
        excess = excess_over_bounds(self, values)
        with np.errstate(invalid="ignore"):  # there may be infinities
            near = ~(excess.max(axis=1, initial=-np.inf) <= -np.ptp(excess, axis=1))
        sharp = near & ~self._are_coordinates
        for number in range(_REFINEMENTS):
            corners = _corners(s, excess[sharp]) if np.any(sharp) and not number else np.zeros(0)
            new = np.setdiff1d(np.append(_peaks(s, excess[near]), corners), s)
            if not new.size:
                break
            places = np.searchsorted(s, new)
            values = np.insert(values, places, self._values(path, new), axis=1)
            s = np.insert(s, places, new)
            excess = excess_over_bounds(self, values)
        return s, values

    def _values(self, path: Path, s: Array) -> Array:
        c = self._conditions
        q = path(s)
        bounded = [q[:, list(each.coordinates or ())] for each in c.bounds]
        known: dict[Terms, Array] = {}
        found = [*bounded, *(group.values(q, c.p_values, known) for group in c.groups)]
        if c.along_qv:
            found.append(self._in_qv.at("value", np.hstack([q, path(s, 1)]), c.p_values)[1])
        return np.hstack([np.zeros((s.size, 0)), *found]).T


path_samples = lru_cache(maxsize=4)(PathSamples)


def sample_parameters(path: Path) -> Array:
    """Return parameters s (k,) at the nodes and between them; one-sided at interior breakpoints."""
    nodes = path.grid.nodes
    steps = np.arange(_PER_NODE) / _PER_NODE
    between = (nodes[:-1, None] + np.diff(nodes)[:, None] * steps).ravel()
    inner = path.breakpoints[1:-1]
    return np.sort(np.concatenate([between, [1.0], inner - _ONE_SIDED]))


def _peaks(s: Array, excess: Array) -> Array:
    """Return vertices of parabolas through three neighbours of excess (m, k) that are near or above
    0.
    """
    if s.size < 3:
        return np.zeros(0)
    left = excess[:, :-2]
    middle = excess[:, 1:-1]
    right = excess[:, 2:]
    a = np.diff(s)[:-1]
    b = np.diff(s)[1:]
    with np.errstate(all="ignore"):  # there may be infinities
        before = (middle - left) / a
        after = (right - middle) / b
        curvature = (after - before) / (a + b)
        slope = before + curvature * a
        maximum = middle - slope**2 / (4.0 * curvature)
        vertex = s[1:-1] - slope / (2.0 * curvature)
        inside = (vertex > s[:-2]) & (vertex < s[2:])
        finite = np.where(np.isfinite(excess), excess, 0.0)
        near = -_NEAR_BOUND * np.ptp(finite, axis=1, keepdims=True)  # parabolas are approximate
        relevant = (curvature < 0.0) & (maximum > near) & inside
    return np.asarray(vertex[relevant])


def _corners(s: Array, excess: Array) -> Array:
    """Return where lines through two neighbours of excess (m, k) on either side meet above 0, and
    far enough above both that a parabola may miss it.
    """
    apart = np.append(True, np.diff(s) > 2.0 * _ONE_SIDED)
    s = s[apart]
    excess = excess[:, apart]
    with np.errstate(all="ignore"):  # there may be infinities
        slopes = np.diff(excess, axis=1) / np.diff(s)
        before = slopes[:, :-2]
        after = slopes[:, 2:]
        left = s[1:-2]
        right = s[2:-1]
        rise = excess[:, 2:-1] - excess[:, 1:-2] - after * (right - left)
        at = left + rise / (before - after)
        highest = excess[:, 1:-2] + before * (at - left)
        over = np.maximum(excess[:, 1:-2], excess[:, 2:-1])
        over = np.maximum(over + _SHARP * np.ptp(excess, axis=1, keepdims=True), 0.0)
        relevant = (before > 0.0) & (after < 0.0) & (at > left) & (at < right) & (highest > over)
    return np.asarray(at[relevant])


# Without a tolerance, solutions violate no condition by more than this, in its scale.
BETWEEN_NODES = 1e-4
NEGLIGIBLE = 1e-6  # smaller violations are ignored before a solve, and in messages


@dataclass(frozen=True)
class Violation:
    """The largest violation of a condition.

    Attributes:
        name: name of the condition, as given by the problem, or its position in the problem's list.
        component: the row of the condition, in words: a joint, a coordinate, or a number.
        value: value of the expression there.
        limit: the violated bound or value.
        s: path parameter; None for a condition on both ends.
        unit: unit of the coordinate, for joint limits of a model; None for other conditions.
        relative: distance from the limit in the scale of the condition, in which the violations of
            several conditions are compared.
    """

    name: str
    component: str
    value: float
    limit: float
    s: float | None
    unit: str | None = None
    relative: float = 0.0

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


def find_violations(conditions: Conditions, path: Path) -> tuple[Violation, ...]:
    """Return the largest violation of every violated condition, the worst first.

    Path constraints are evaluated at the nodes and between them.
    """
    samples = [*_at_ends(conditions, path), *_at_via(conditions, path), *_along(conditions, path)]
    found = [_worst(path.metric, *each, each[0] in conditions.bounds) for each in samples]
    return tuple(sorted(filter(None, found), key=lambda one: -one.relative))


def violations_at(conditions: Conditions, metric: Metric, q: Array, s: float) -> list[Violation]:
    """Return violations of the path constraints in q, except bounds, at one configuration (n,)."""
    found = []
    for group in conditions.groups:
        ends = np.cumsum([each.size for each in group.conditions])[:-1]
        values = np.split(group.values(q[None], conditions.p_values, {}).T, ends)
        for condition, of_one in zip(group.conditions, values, strict=True):
            found.append(_worst(metric, condition, of_one, np.array([s])))
    return sorted(filter(None, found), key=lambda one: -one.relative)


Kept: TypeAlias = Mapping[str, NDArray[np.bool_]]  # cells of s, by names of conditions


def may_become_active(conditions: Conditions, path: Path, share: float = MAY_CHANGE) -> Kept:
    """Return conditions in q, and cells, in which a path violates a bound or comes near, compared
    with how much values change along it; with the cells beside these.
    """
    s, found = path_samples(conditions)(path)
    names = {condition.name for condition in conditions.along_q}
    kept = {}
    for condition, values in found:
        excess = excess_over_bounds(condition, values)
        ranges = np.ptp(values, axis=1, keepdims=True) / condition.scales[:, None]
        near = np.any(excess > -share * ranges, axis=0)
        if condition.name in names and np.any(near):
            kept[condition.name] = _cells_about(s[near])
    return kept


def _cells_about(s: Array) -> NDArray[np.bool_]:
    """Return which cells contain some of these s, or are beside those."""
    found = np.zeros(CELLS + 2, dtype=bool)
    for beside in range(3):
        found[cells_at(s) + beside] = True
    return found[1:-1]


def left_out(conditions: Conditions, kept: Kept, path: Path) -> Kept:
    """Return conditions in q, and cells, in which a path violates a bound, but those kept; with the
    cells beside these, as one alone may be without a node.
    """
    s, found = path_samples(conditions)(path)
    names = {condition.name for condition in conditions.along_q}
    missing = {}
    for condition, values in found:
        violated = np.any(excess_over_bounds(condition, values) > 0.0, axis=0)
        violated &= ~kept.get(condition.name, np.zeros(CELLS, dtype=bool))[cells_at(s)]
        if condition.name in names and np.any(violated):
            missing[condition.name] = _cells_about(s[violated])
    return missing


def joined(*parts: Kept) -> Kept:
    """Return the cells of all of these."""
    found: dict[str, NDArray[np.bool_]] = {}
    for part in parts:
        for name, cells in part.items():
            found[name] = found.get(name, False) | cells
    return found


# A condition, its values (m, k), and s (k,); None for a condition on both ends.
_Values: TypeAlias = tuple[Condition, Array, Array | None]


def _at_ends(conditions: Conditions, path: Path) -> Iterator[_Values]:
    c = conditions
    n = path.metric.dim
    nodes = path.nodes
    for condition in c.fixed:
        assert condition.coordinates is not None
        ends = {coordinate // n for coordinate in condition.coordinates}
        s = np.array([float(max(ends))]) if len(ends) == 1 else None
        yield condition, nodes[[0, -1]].ravel()[list(condition.coordinates)][:, None], s
    if not c.ends:
        return
    function, places = _end_function(c)
    values = evaluate(function, *nodes[[0, -1]], *path([0.0, 1.0], 1), c.p_values)
    parts = np.split(values, np.cumsum([each.size for each in c.ends])[:-1])
    yield from zip(c.ends, parts, places, strict=True)


@lru_cache(maxsize=4)
def _end_function(c: Conditions) -> tuple[ca.Function, list[Array | None]]:
    """Return all conditions at the ends as a function of both, and s of those on one end only."""
    places = []
    for condition in c.ends:
        first, last = (
            ca.depends_on(condition.expression, ca.vertcat(*pair))
            for pair in ((c.q0, c.v0), (c.q1, c.v1))
        )
        places.append(None if first == last else np.array([float(last)]))
    return ca.Function("ends", [c.q0, c.q1, c.v0, c.v1, c.p], [stacked(c.ends)]), places


def _at_via(conditions: Conditions, path: Path) -> Iterator[_Values]:
    grid = path.grid
    for s, node, at_one in zip(grid.via_s, grid.via_nodes, conditions.via, strict=True):
        for condition in at_one:
            yield _at_point(conditions, condition, path.nodes[node], s)


def _at_point(conditions: Conditions, condition: Condition, q: Array, s: float) -> _Values:
    symbols = [conditions.q, conditions.p]
    function = ca.Function("condition", symbols, [condition.expression])
    return condition, evaluate(function, q, conditions.p_values), np.array([s])


def _along(conditions: Conditions, path: Path) -> Iterator[_Values]:
    if conditions.along_q or conditions.along_qv or conditions.bounds:
        s, found = path_samples(conditions)(path)
        yield from ((condition, values, s) for condition, values in found)


def _worst(
    metric: Metric, condition: Condition, values: Array, s: Array | None, is_limit: bool = False
) -> Violation | None:
    """Return the largest violation of a condition's values (m, k), if any; NaN counts as
    infinite.
    """
    excess = excess_over_bounds(condition, values)
    if not np.any(excess > 0.0):
        return None
    row, column = np.unravel_index(int(np.argmax(excess)), excess.shape)
    value = float(values[row, column])
    limit = float(condition.upper[row] if value > condition.upper[row] else condition.lower[row])
    component = f"{condition.name}[{row}]" if condition.size > 1 else condition.name
    unit = None
    if condition.coordinates is not None:
        n = metric.dim
        names = metric.joint_names
        coordinate = condition.coordinates[int(row)] % n
        component = f"q[{coordinate}]" if names is None else f"joint {names[coordinate]}"
        if is_limit:
            unit = getattr(getattr(metric, "model", None), "units", ("",) * n)[coordinate]
    where = None if s is None else float(s[min(int(column), s.size - 1)])
    return Violation(
        name=condition.name,
        component=component,
        value=value,
        limit=limit,
        s=where,
        unit=unit,
        relative=abs(value - limit) / float(condition.scales[row]),
    )
