"""A problem's numbers on a grid: bounds of the nodes' coordinates and of the NLP's functions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.ocp.nlp.conditions import Conditions, Term
from geodesic_ocp.trajectory.grid import Grid

_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class _Values:
    """Where a term's values (count, m) stand in the raveled nodes, or in g."""

    term: Term
    index: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class NodeBounds:
    """Bounds of one problem on one grid.

    Attributes:
        lower, upper: of the positions at the nodes, (size, n).
        ends: values at which the first and the last node are fixed, (n,) each, NaN where free.
        lower_g, upper_g: of the constraint functions, in the transcription's order.
    """

    lower: Array
    upper: Array
    ends: tuple[Array, Array]
    lower_g: Array
    upper_g: Array
    _in_x: tuple[_Values, ...]
    _in_g: tuple[_Values, ...]

    @classmethod
    def of(
        cls, terms: Conditions, grid: Grid, joint_names: Sequence[str] | None = None
    ) -> NodeBounds:
        """The bounds that the conditions set on the grid.

        Raises:
            ValueError: an end that the boundary fixes lies outside the problem's own bounds.
        """
        n = terms.q.shape[0]
        lower, upper = np.full((grid.size, n), -np.inf), np.full((grid.size, n), np.inf)
        in_x = []
        for term in terms.bounds:
            columns = np.array(term.coordinates)
            for column, low, high in zip(columns, term.lower, term.upper, strict=True):
                lower[:, column] = np.maximum(lower[:, column], low)
                upper[:, column] = np.minimum(upper[:, column], high)
            in_x.append(_Values(term, n * np.arange(grid.size)[:, None] + columns))

        ends = np.full(n, np.nan), np.full(n, np.nan)
        for term in terms.fixed:
            assert term.coordinates is not None
            for coordinate, value in zip(term.coordinates, term.lower, strict=True):
                _fix(term.name, coordinate, value, lower, upper, ends, joint_names)
            at_end, columns = np.divmod(np.array(term.coordinates), n)
            in_x.append(_Values(term, (columns + at_end * n * (grid.size - 1))[None, :]))

        at_via = tuple(term for station in terms.via for term in station)
        groups = (
            *((terms.ends, 1), (at_via, 1), (terms.smooth, 1)),
            *((terms.still, grid.size), (terms.moving, grid.collocations)),
        )
        in_g, start = [], 0
        for group, count in groups:
            in_g += list(_interleaved(group, count, start))
            start += count * sum(term.size for term in group)
        lower_g, upper_g = np.empty(start), np.empty(start)
        for values in in_g:
            lower_g[values.index], upper_g[values.index] = values.term.lower, values.term.upper
        return cls(lower, upper, ends, lower_g, upper_g, tuple(in_x), tuple(in_g))

    def worst(self, x: Array, g: Array) -> tuple[float, str]:
        """Largest violation at the nodes and the name of its condition; NaN counts as infinite."""
        violations = [(0.0, "")]
        for values, source in self._everything(x, g):
            found, term = source[values.index], values.term
            excess = np.maximum(term.lower - found, found - term.upper)
            excess = np.where(np.isnan(excess), np.inf, excess)
            violations.append((float(np.max(excess, initial=0.0)), term.name))
        return max(violations, key=lambda pair: pair[0])

    def multipliers(self, lam_x: Array, lam_g: Array) -> Mapping[str, Array]:
        """Multipliers by the condition's name, (m,) at the ends and (nodes, m) along the path."""
        result = {}
        for values, source in self._everything(lam_x, lam_g):
            found = source[values.index]
            result[values.term.name] = found[0] if len(found) == 1 else found
        return result

    def _everything(self, x: Array, g: Array) -> Iterator[tuple[_Values, Array]]:
        yield from ((values, x.ravel()) for values in self._in_x)
        yield from ((values, g) for values in self._in_g)


def _fix(
    name: str,
    coordinate: int,
    value: float,
    lower: Array,
    upper: Array,
    ends: tuple[Array, Array],
    joint_names: Sequence[str] | None,
) -> None:
    """Fix a coordinate of the first node (0 to n - 1) or the last (n to 2 n - 1) in the arrays."""
    end, column = divmod(coordinate, lower.shape[1])
    node, word = ((0, "start"), (-1, "end"))[end]
    low, high = lower[node, column], upper[node, column]
    if not low - _TOLERANCE <= value <= high + _TOLERANCE:
        which = f"coordinate {column}" if joint_names is None else f"joint {joint_names[column]}"
        raise ValueError(
            f"{name}: {which} is fixed at {value:.6g} at the path's {word}, outside "
            f"its bounds {low:.6g} to {high:.6g}"
        )
    lower[node, column] = upper[node, column] = ends[end][column] = value


def _interleaved(group: Sequence[Term], count: int, start: int) -> Iterator[_Values]:
    """Places in g of a group's terms: all terms of one node, then those of the next."""
    width, offset = sum(term.size for term in group), start
    for term in group:
        rows = offset + width * np.arange(count)[:, None]
        yield _Values(term, rows + np.arange(term.size))
        offset += term.size
