"""Conditions on a path in a common form, and their bounds on a grid."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.blocks import Instance, Terms
from geodesic_ocp.cells import Indices
from geodesic_ocp.trajectory.grid import Grid

_FEW = 20  # conditions in q, more than which are many
CELLS = 32


class Bounded(Protocol):
    """What has bounds (m,)."""

    @property
    def lower(self) -> Array:
        """Lower bounds."""

    @property
    def upper(self) -> Array:
        """Upper bounds."""

    @property
    def scales(self) -> Array:
        """Units in which violations are compared."""


def excess_over_bounds(bounds: Bounded, values: Array) -> Array:
    """Get distance of values (m, k) from the bounds in units of their scales, positive outside; NaN
    counts as infinite.
    """
    excess = np.maximum(bounds.lower[:, None] - values, values - bounds.upper[:, None])
    return np.asarray(np.where(np.isnan(excess), np.inf, excess / bounds.scales[:, None]))


def cells_at(s: Array) -> Indices:
    """Return the index of the cell of each s."""
    return np.minimum((s * CELLS).astype(np.int64), CELLS - 1)


@dataclass(frozen=True, eq=False, repr=False)
class Condition(ShortRepr):
    """Lower and upper bounds (m,) on an expression (m, 1).

    Attributes:
        name: as given by the problem, or its position in the problem's list.
        expression: the bounded expression.
        lower, upper: the bounds; equal for an equality.
        coordinates: indices (m,) into the symbols if every row is a bare symbol, else None.
        instance: the expression as one in q whose terms others share, else None.
        cells: of `CELLS` equal intervals of s, those in which an instance is part of a program.
        scale: unit of the values, for all rows or (m,), in which violations are compared.
    """

    name: str
    expression: ca.SX
    lower: Array
    upper: Array
    coordinates: tuple[int, ...] | None
    instance: Instance | None = None
    cells: NDArray[np.bool_] = field(default_factory=lambda: np.ones(CELLS, dtype=bool))
    scale: Array | float = 1.0
    _shown = ("name", "size")

    @property
    def size(self) -> int:
        """Number m of rows."""
        return int(self.expression.shape[0])

    @property
    def scales(self) -> Array:
        """Unit of every row (m,)."""
        return np.broadcast_to(self.scale, self.size)


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

    def with_scales(self, scales: Mapping[str, Array | float], usual: float) -> Conditions:
        """Return these with scales by name; the usual one where none is given."""

        def scaled(group: Sequence[Condition]) -> tuple[Condition, ...]:
            return tuple(replace(each, scale=scales.get(each.name, usual)) for each in group)

        return replace(
            self,
            fixed=scaled(self.fixed),
            ends=scaled(self.ends),
            bounds=scaled(self.bounds),
            along_q=scaled(self.along_q),
            along_qv=scaled(self.along_qv),
            via=tuple(map(scaled, self.via)),
            via_continuity=scaled(self.via_continuity),
        )

    @cached_property
    def groups(self) -> list[Group]:
        """Conditions in q alone by the terms that they share, and those without."""
        found: dict[tuple[Terms, Terms] | None, list[Condition]] = {}
        for condition in self.along_q:
            own = condition.instance
            key = None if own is None else (own.terms, own.inner)
            found.setdefault(key, []).append(condition)
        return [
            Group(tuple(each), *shared)
            if shared
            else Group(tuple(each), Terms(self.q, self.p, 0.0, stacked(each)))
            for shared, each in found.items()
        ]

    @property
    def kept(self) -> dict[str, NDArray[np.bool_]]:
        """Cells of s in which each condition in q is part of a program, by name."""
        return {each.name: each.cells for each in self.along_q}

    @property
    def are_many(self) -> bool:
        """True if only those in q near their bounds are part of a program at first."""
        return len(self.along_q) > _FEW and not self.via

    @property
    def only_ends(self) -> bool:
        """True if there are no conditions but those at the ends."""
        return not (self.bounds or self.along_q or self.along_qv or self.via)

    @cached_property
    def on_end_velocities(self) -> str:
        """Names of the conditions on velocities at the ends, separated by commas."""
        velocities = ca.vertcat(self.v0, self.v1)
        return ", ".join(c.name for c in self.ends if ca.depends_on(c.expression, velocities))


@dataclass(frozen=True, eq=False, repr=False)
class Group(ShortRepr):
    """Conditions in q alone that are evaluated together.

    Attributes:
        conditions: the conditions.
        terms: their functions of q, together; or the function of one of them, with its numbers, of
            some of the constraint functions of `inner`.
        inner: terms in q.
    """

    conditions: tuple[Condition, ...]
    terms: Terms
    inner: Terms | None = None
    _shown = ("conditions",)

    def only(self, kept: NDArray[np.bool_]) -> Group:
        """Return the group with some of its conditions (m,), if they are evaluated one by one."""
        if self.inner is None:
            return self
        return replace(self, conditions=tuple(np.array(self.conditions, object)[kept]))

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of all values, in units of their scales, (rows,)."""
        lower, upper = zip(*((each.lower, each.upper) for each in self.conditions), strict=True)
        return np.concatenate(lower) / self.scales, np.concatenate(upper) / self.scales

    @cached_property
    def scales(self) -> Array:
        """Units of all values, (rows,)."""
        return np.concatenate([each.scales for each in self.conditions])

    def at_nodes(self, s: Array) -> tuple[Indices, Indices]:
        """Return each node of a grid, and of each the conditions that are part of a program."""
        kept = np.stack([each.cells for each in self.conditions], axis=1)
        nodes, own = np.nonzero(kept[cells_at(s)])
        return nodes, own

    @cached_property
    def numbers(self) -> Array:
        """Numbers of each condition (m, k)."""
        return np.stack([each.numbers for each in self._instances])

    @cached_property
    def indices(self) -> Indices:
        """Indices of the variables of each condition in those of the inner terms, (m, size)."""
        return np.stack([each.indices for each in self._instances])

    @property
    def _instances(self) -> list[Instance]:
        return [each.instance for each in self.conditions if each.instance is not None]

    def values(self, q: Array, p: Array, known: dict[Terms, Array]) -> Array:
        """Return the conditions' expressions (k, rows) at q (k, n), for parameters p.

        Args:
            known: constraint functions of inner terms at q, for other groups, too.
        """
        if self.inner is None:
            return self.terms.at("value", q, p)[1]
        if self.inner not in known:
            known[self.inner] = self.inner.at("value", q, np.zeros(0))[1]
        z = known[self.inner][:, self.indices].reshape(-1, self.terms.size)
        return self.terms.at("value", z, np.tile(self.numbers, (len(q), 1)))[1].reshape(len(q), -1)

    def slopes(self, q: Array, p: Array, rows: Indices, at: Indices | None = None) -> Array:
        """Return the gradients (k, n) of these rows, (k,), at each q, or at those of these indices,
        (k,).
        """
        at = np.arange(len(q)) if at is None else at
        if self.inner is None:
            return self.terms.jacobians(q, p)[1][at, rows]
        own = self.indices[rows]
        z, by_q = (each[at[:, None], own] for each in self.inner.jacobians(q, np.zeros(0)))
        found: Array = (self.terms.jacobians(z, self.numbers[rows])[1] @ by_q)[:, 0]
        return found


def stacked(conditions: Sequence[Condition]) -> ca.SX:
    """Return all expressions in one column; (0, 1) if there are none."""
    return ca.vertcat(ca.SX(0, 1), *(condition.expression for condition in conditions))


_ROUNDING = 1e-9  # of a fixed end, beside its bounds


@dataclass(frozen=True, eq=False)
class _Rows:
    """Indices (count, m) of a condition's values in the raveled nodes, or in g."""

    condition: Condition
    index: Indices
    nodes: Indices | None = None  # (count,) if these are some of the nodes of a grid

    @property
    def kind(self) -> tuple[str, int, bool]:
        """Name, number of values, and whether it holds along the path."""
        count, size = self.index.shape
        return self.condition.name, size, count > 1 or self.nodes is not None

    def at_nodes(self, source: NDArray[Any], grid: Grid) -> NDArray[Any]:
        """Return values (nodes, m), zero where the condition is no part of the program."""
        if self.nodes is None:
            return source[self.index]
        found = np.zeros((grid.size, self.index.shape[1]), source.dtype)
        found[self.nodes] = source[self.index]
        return found


@dataclass(frozen=True, eq=False, repr=False)
class NodeBounds(ShortRepr):
    """Bounds of one problem on one grid.

    Attributes:
        lower, upper: lower and upper of the positions at the nodes, (size, n).
        ends: values to which the first and the last node are fixed, (2, n), NaN if free.
        lower_g, upper_g: lower and upper g of the constraint functions, in the order of the
            transcription, in units of their scales.
        scales_g: these scales.
        grid: the grid.
    """

    lower: Array
    upper: Array
    ends: Array
    lower_g: Array
    upper_g: Array
    scales_g: Array
    grid: Grid
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
        n = int(conditions.q.shape[0])
        lower = np.full((grid.size, n), -np.inf)
        upper = np.full((grid.size, n), np.inf)
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
                low = lower[-end, column]
                high = upper[-end, column]
                rounding = _ROUNDING * max(np.max(condition.scale), abs(value))
                if not low - rounding <= value <= high + rounding:
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
        groups: tuple[tuple[Group | Sequence[Condition], int], ...] = (
            *((conditions.ends, 1), (at_via, 1), (conditions.via_continuity, 1)),
            *((group, grid.size) for group in conditions.groups),
            (conditions.along_qv, grid.collocations),
        )
        in_g = list[_Rows]()
        start = 0
        for group, count in groups:
            if isinstance(group, Group) and group.inner is not None:
                nodes, own = group.at_nodes(grid.nodes)
                for number, condition in enumerate(group.conditions):
                    (here,) = np.nonzero(own == number)
                    in_g.append(_Rows(condition, start + here[:, None], nodes[here]))
                start += nodes.size
                continue
            members = group.conditions if isinstance(group, Group) else group
            in_g += list(_interleaved(members, count, start))
            start += count * sum(condition.size for condition in members)
        lower_g, upper_g, scales_g = np.empty((3, start))
        for rows in in_g:
            scales = rows.condition.scales
            scales_g[rows.index] = scales
            lower_g[rows.index] = rows.condition.lower / scales
            upper_g[rows.index] = rows.condition.upper / scales
        return cls(lower, upper, ends, lower_g, upper_g, scales_g, grid, tuple(in_x), tuple(in_g))

    def with_rows(self, upper: Array) -> NodeBounds:
        """Return these and upper bounds of further constraint functions, the last ones."""
        lower = np.full(upper.size, -np.inf)
        first = self.lower_g.size
        rows = Condition("linearized conditions", ca.SX(upper.size, 1), lower, upper, None)
        return replace(
            self,
            lower_g=np.append(self.lower_g, lower),
            upper_g=np.append(self.upper_g, upper),
            scales_g=np.append(self.scales_g, np.ones(upper.size)),
            _in_g=(*self._in_g, _Rows(rows, first + np.arange(upper.size)[None])),
        )

    def worst(self, x: Array, g: Array) -> tuple[float, str]:
        """Return the largest violation at the nodes, in the scale of its condition, and the name of
        that condition; NaN counts as infinite.
        """
        violations = [(0.0, "")]
        for rows, source in self._all_rows(x, self.scales_g * g):
            condition = rows.condition
            excess = excess_over_bounds(condition, source[rows.index].T)
            violations.append((float(np.max(excess, initial=0.0)), condition.name))
        return max(violations, key=lambda pair: pair[0])

    def multipliers(self, lam_x: Array, lam_g: Array) -> dict[str, Array]:
        """Return multipliers by the condition's name, (m,) at the ends and (nodes, m) along the
        path.
        """
        result = {}
        for rows, source in self._all_rows(lam_x, lam_g):
            found = rows.at_nodes(source, self.grid)
            result[rows.condition.name] = found[0] if len(found) == 1 else found
        return result

    def carried(self, lam_x: Array, lam_g: Array, before: NodeBounds) -> tuple[Array, Array] | None:
        """Return multipliers here for those on another grid; None for other conditions.

        Along the path, multipliers per unit of s are interpolated. They are zero for distances that
        were no part of the program.
        """
        x = np.zeros(self.lower.size)
        g = np.zeros(self.lower_g.size)
        known = {rows.kind: (rows, source) for rows, source in before._all_rows(lam_x, lam_g)}
        every = list(self._all_rows(x, g))
        left_out = known.keys() ^ {rows.kind for rows, _ in every}
        here = {rows.kind: rows for rows, _ in every} | {k: r for k, (r, _) in known.items()}
        if any(here[kind].nodes is None for kind in left_out):
            return None
        of_old = _nodes(before.grid)
        of_new = _nodes(self.grid)
        for rows, target in every:
            if rows.kind not in known:
                continue
            old_rows, source = known[rows.kind]
            values = old_rows.at_nodes(source, before.grid)
            if (s := of_old.get(len(values))) is not None:
                fine = of_new[len(rows.index) if rows.nodes is None else self.grid.size]
                density = values / _spacing(s)[:, None]
                values = np.stack([np.interp(fine, s, each) for each in density.T], axis=1)
                values *= _spacing(fine)[:, None]
            target[rows.index] = values if rows.nodes is None else values[rows.nodes]
        return x, g

    def switching_points(
        self, grid: Grid, active_x: NDArray[np.bool_], active_g: NDArray[np.bool_]
    ) -> tuple[float, ...]:
        """Get s between the nodes where a condition along the path becomes active or inactive."""
        nodes = _nodes(grid)
        found: set[float] = set()
        for rows, source in self._all_rows(active_x, active_g):
            active = rows.at_nodes(source, grid)
            if (s := nodes.get(len(active))) is not None:
                changed = np.any(np.diff(active, axis=0), axis=1)
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
    width = sum(condition.size for condition in group)
    offset = start
    for condition in group:
        rows = offset + width * np.arange(count)[:, None]
        yield _Rows(condition, rows + np.arange(condition.size))
        offset += condition.size
