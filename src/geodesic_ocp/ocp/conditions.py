"""Conditions on a path in a common form, and their bounds on a grid."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.blocks import Instance, Terms
from geodesic_ocp.trajectory.grid import Grid


@dataclass(frozen=True, eq=False, repr=False)
class Condition(ShortRepr):
    """Lower and upper bounds (m,) on an expression (m, 1).

    Attributes:
        name: as given by the problem, or its position in the problem's list.
        expression: the bounded expression.
        lower, upper: the bounds; equal for an equality.
        coordinates: indices (m,) into the symbols if every row is a bare symbol, else None.
        instance: the expression as one in q whose terms others share, else None.
    """

    name: str
    expression: ca.SX
    lower: Array
    upper: Array
    coordinates: tuple[int, ...] | None
    instance: Instance | None = None
    _shown = ("name", "size")

    @property
    def size(self) -> int:
        """Number m of rows."""
        return int(self.expression.shape[0])


@dataclass(frozen=True, eq=False, repr=False)
class Conditions(ShortRepr):
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
    _shown = ("fixed", "ends", "bounds", "along_q", "along_qv", "via")

    def __iter__(self) -> Iterator[Condition]:
        yield from (*self.fixed, *self.ends, *self.bounds, *self.along_q, *self.along_qv)
        for at_one in self.via:
            yield from at_one
        yield from self.via_continuity

    @property
    def in_groups(self) -> list[tuple[Condition, ...]]:
        """Conditions in q alone by the terms that they share, and those without."""
        groups: dict[Terms | None, list[Condition]] = {}
        for condition in self.along_q:
            terms = None if condition.instance is None else condition.instance.terms
            groups.setdefault(terms, []).append(condition)
        return [tuple(group) for group in groups.values()]

    @property
    def only_ends(self) -> bool:
        """True if there are no conditions but those at the ends."""
        return not (self.bounds or self.along_q or self.along_qv or self.via)

    @property
    def on_end_velocities(self) -> str:
        """Names of the conditions on velocities at the ends, separated by commas."""
        velocities = ca.vertcat(self.v0, self.v1)
        return ", ".join(c.name for c in self.ends if ca.depends_on(c.expression, velocities))


def stacked(conditions: Sequence[Condition]) -> ca.SX:
    """Return all expressions in one column; (0, 1) if there are none."""
    return ca.vertcat(ca.SX(0, 1), *(condition.expression for condition in conditions))


_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class _Rows:
    """Indices (count, m) of a condition's values in the raveled nodes, or in g."""

    condition: Condition
    index: NDArray[np.int64]

    @property
    def kind(self) -> tuple[str, int, bool]:
        """Name, number of values, and whether it holds along the path."""
        count, size = self.index.shape
        return self.condition.name, size, count > 1


@dataclass(frozen=True, eq=False, repr=False)
class NodeBounds(ShortRepr):
    """Bounds of one problem on one grid.

    Attributes:
        lower, upper: lower and upper of the positions at the nodes, (size, n).
        ends: values to which the first and the last node are fixed, (2, n), NaN if free.
        lower_g, upper_g: lower and upper g of the constraint functions, in the order of the
            transcription.
    """

    lower: Array
    upper: Array
    ends: Array
    lower_g: Array
    upper_g: Array
    _in_x: tuple[_Rows, ...]
    _in_g: tuple[_Rows, ...]
    _shown = ("ends",)

    @classmethod
    def on_grid(
        cls, conditions: Conditions, grid: Grid, joint_names: Sequence[str] | None = None
    ) -> NodeBounds:
        """Return the bounds of these conditions on the grid.

        Raises:
            ValueError: a fixed end lies outside the problem's own bounds.
        """
        n = conditions.q.shape[0]
        lower, upper = np.full((grid.size, n), -np.inf), np.full((grid.size, n), np.inf)
        in_x = []
        for condition in conditions.bounds:
            columns = np.array(condition.coordinates)
            np.maximum.at(lower.T, columns, condition.lower[:, None])
            np.minimum.at(upper.T, columns, condition.upper[:, None])
            in_x.append(_Rows(condition, n * np.arange(grid.size)[:, None] + columns))

        ends = np.full((2, n), np.nan)
        for condition in conditions.fixed:
            at_end, columns = np.divmod(np.array(condition.coordinates), n)
            for end, column, value in zip(at_end, columns, condition.lower, strict=True):
                low, high = lower[-end, column], upper[-end, column]
                if not low - _TOLERANCE <= value <= high + _TOLERANCE:
                    which = (
                        f"joint {joint_names[column]}" if joint_names else f"coordinate {column}"
                    )
                    raise ValueError(
                        f"{condition.name}: {which} is fixed at {value:.6g} at the path's "
                        f"{('start', 'end')[end]}, outside its bounds {low:.6g} to {high:.6g}"
                    )
                lower[-end, column] = upper[-end, column] = ends[end, column] = value
            in_x.append(_Rows(condition, (columns + at_end * n * (grid.size - 1))[None, :]))

        at_via = tuple(condition for at_one in conditions.via for condition in at_one)
        groups = (
            *((conditions.ends, 1), (at_via, 1), (conditions.via_continuity, 1)),
            *((group, grid.size) for group in conditions.in_groups),
            (conditions.along_qv, grid.collocations),
        )
        in_g, start = [], 0
        for group, count in groups:
            in_g += list(_interleaved(group, count, start))
            start += count * sum(condition.size for condition in group)
        lower_g, upper_g = np.empty(start), np.empty(start)
        for rows in in_g:
            lower_g[rows.index], upper_g[rows.index] = rows.condition.lower, rows.condition.upper
        return cls(lower, upper, ends, lower_g, upper_g, tuple(in_x), tuple(in_g))

    def worst(self, x: Array, g: Array) -> tuple[float, str]:
        """Return largest violation at the nodes and the name of its condition; NaN counts as
        infinite.
        """
        violations = [(0.0, "")]
        for rows, source in self._all_rows(x, g):
            found, condition = source[rows.index], rows.condition
            excess = np.maximum(condition.lower - found, found - condition.upper)
            excess = np.where(np.isnan(excess), np.inf, excess)
            violations.append((float(np.max(excess, initial=0.0)), condition.name))
        return max(violations, key=lambda pair: pair[0])

    def multipliers(self, lam_x: Array, lam_g: Array) -> Mapping[str, Array]:
        """Return multipliers by the condition's name, (m,) at the ends and (nodes, m) along the
        path.
        """
        result = {}
        for rows, source in self._all_rows(lam_x, lam_g):
            found = source[rows.index]
            result[rows.condition.name] = found[0] if len(found) == 1 else found
        return result

    def carried(
        self, grid: Grid, lam_x: Array, lam_g: Array, before: NodeBounds, old: Grid
    ) -> tuple[Array, Array] | None:
        """Return multipliers here for those on another grid; None for other conditions.

        Along the path, multipliers per unit of s are interpolated.
        """
        x, g = np.zeros(self.lower.size), np.zeros(self.lower_g.size)
        here, there = list(self._all_rows(x, g)), list(before._all_rows(lam_x, lam_g))
        if [rows.kind for rows, _ in here] != [rows.kind for rows, _ in there]:
            return None
        for (rows, target), (old_rows, source) in zip(here, there, strict=True):
            values = source[old_rows.index]
            if (s := _nodes(old).get(len(values))) is not None:
                fine = _nodes(grid)[len(rows.index)]
                density = values / _spacing(s)[:, None]
                values = np.stack([np.interp(fine, s, each) for each in density.T], axis=1)
                values *= _spacing(fine)[:, None]
            target[rows.index] = values
        return x, g

    def switching_points(
        self, grid: Grid, active_x: NDArray[np.bool_], active_g: NDArray[np.bool_]
    ) -> tuple[float, ...]:
        """Get s between the nodes where a condition along the path becomes active or inactive."""
        nodes = _nodes(grid)
        found: set[float] = set()
        for rows, active in self._all_rows(active_x, active_g):
            if (s := nodes.get(len(rows.index))) is not None:
                changed = np.any(np.diff(active[rows.index], axis=0), axis=1)
                found.update(((s[1:] + s[:-1]) / 2.0)[changed].tolist())
        return tuple(sorted(found))

    def _all_rows(self, x: NDArray[Any], g: NDArray[Any]) -> Iterator[tuple[_Rows, NDArray[Any]]]:
        yield from ((rows, x.ravel()) for rows in self._in_x)
        yield from ((rows, g) for rows in self._in_g)


def _nodes(grid: Grid) -> dict[int, Array]:
    """Return s of the nodes at which conditions hold along a path, by their number."""
    return {grid.collocations: grid.in_segments(grid.nodes).ravel(), grid.size: grid.nodes}


def _spacing(s: Array) -> Array:
    """Return the length of s that belongs to each node."""
    middle = np.concatenate([s[:1], (s[1:] + s[:-1]) / 2.0, s[-1:]])
    return np.diff(middle)


def _interleaved(group: Sequence[Condition], count: int, start: int) -> Iterator[_Rows]:
    """Yield rows in g of a group of conditions: all conditions of a node, then of the next."""
    width, offset = sum(condition.size for condition in group), start
    for condition in group:
        rows = offset + width * np.arange(count)[:, None]
        yield _Rows(condition, rows + np.arange(condition.size))
        offset += condition.size
