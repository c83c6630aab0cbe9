"""Grids from coarse to fine, and their tables for the minimization of the discrete energy."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.kernels import Level
from geodesic_ocp.trajectory.grid import Grid

# Relative decrease of the energy by a Newton step at which a coarse level, a fine level is left.
_COARSE, _FINE = 1e-2, 1e-10
_COARSE_STEPS, _FINE_STEPS = 8, 40


@dataclass(frozen=True, eq=False)
class Levels:
    """Grids of increasing size; on those from index `first` on, solutions are corrected."""

    grids: tuple[Grid, ...]
    first: int

    @property
    def largest(self) -> int:
        """Largest number of nodes."""
        return max(grid.size for grid in self.grids)

    def decrease(self, level: int) -> float:
        """Relative decrease of the energy by a Newton step at which the level is left."""
        return _COARSE if level < self.first else _FINE

    def max_steps(self, level: int) -> int:
        """Largest number of Newton steps on the level."""
        return _COARSE_STEPS if level < self.first else _FINE_STEPS

    @cached_property
    def refinements(self) -> tuple[Array, ...]:
        """Interpolation from each level to the next, (nodes of the next, nodes)."""
        return tuple(_refine(*each) for each in pairwise(self.grids))

    @cached_property
    def _arrays(self) -> list[dict[str, Array]]:
        refinements = (np.zeros((0, 0)), *self.refinements)
        return [_tables(*each) for each in zip(self.grids, refinements, strict=True)]

    @cached_property
    def structures(self) -> ctypes.Array[Level]:
        """The tables as the compiled core takes them."""
        result = (Level * len(self.grids))()
        for number, (level, grid) in enumerate(zip(result, self.grids, strict=True)):
            level.segments, level.degree = grid.segments, grid.degree
            level.points = grid.quadrature.weights.shape[1]
            for name, table in self._arrays[number].items():
                setattr(level, name, table.ctypes.data)
            level.decrease, level.max_steps = self.decrease(number), self.max_steps(number)
        return result


def _refine(before: Grid, grid: Grid) -> Array:
    return before.interpolate(before.in_segments(np.eye(before.size)), grid.nodes)


def _tables(grid: Grid, refine: Array) -> dict[str, Array]:
    quadrature = grid.quadrature
    tables = {
        "weights": quadrature.weights[0],
        "values": quadrature.values,
        "slopes": quadrature.slopes[0],
        "products": _products_of_pairs(grid).transpose(0, 2, 1),
        "refine": refine,
    }
    return {name: np.ascontiguousarray(table) for name, table in tables.items()}


def _pairs_of_nodes(grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """The pairs a <= b of nodes of one segment, b first from the smallest."""
    pairs = [(a, b) for b in range(grid.degree + 1) for a in range(b + 1)]
    first, second = np.array(pairs).T
    return first, second


def _products_of_pairs(grid: Grid) -> Array:
    """W B_a B_b, w B_a D_b, w D_a B_b, w D_a D_b at the points of a segment, (4, points, pairs)."""
    quadrature = grid.quadrature
    weights, values, slopes = quadrature.weights[0], quadrature.values, quadrature.slopes[0]
    a, b = _pairs_of_nodes(grid)
    factors = ((values, values), (values, slopes), (slopes, values), (slopes, slopes))
    products = [weights[:, None] * one[:, a] * other[:, b] for one, other in factors]
    return np.array(products)


@lru_cache(maxsize=8)
def levels_of(grids: Sequence[tuple[int, int]], first: int) -> Levels:
    """Levels of grids given by (segments, degree)."""
    return Levels(tuple(Grid(*each) for each in grids), first)
