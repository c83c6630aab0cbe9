"""The discrete energy of a path in NumPy, with its gradient and Hessian.

    E = sum_k w_k l(q_k, v_k),  l = v' G(q) v / 2,  q_k = B_k x,  v_k = D_k x,

at quadrature points k finer than the nodes x. It is what the compiled core computes, where there is
no compiler.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.trajectory.grid import Grid


class _Indices(NamedTuple):
    """Where the blocks of the pairs of a segment's nodes lie in the Hessian of all nodes."""

    rows: np.ndarray
    columns: np.ndarray


class DiscreteEnergy:
    """The energy of paths through the nodes of a grid, with G + diag(added) as metric.

    Args:
        functions: of the metric, see `compiled_functions`.
        grid: with segments of equal width.
        added: (n,), constant.
    """

    def __init__(self, functions: dict[str, ca.Function], grid: Grid, added: Array) -> None:
        self._grid, self._added, self._dim = grid, added, added.size
        self._points = grid.quadrature.weights.size
        self._gradient = _mapped(functions["energy_gradient"], self._points)
        self._hessian = _mapped(functions["energy_hessian"], self._points)
        self._products, self._where = _tables(grid, self._dim)

    def _states(self, x: Array) -> Array:
        """(2 n, points)."""
        grid, quadrature = self._grid, self._grid.quadrature
        segments = grid.in_segments(x)
        first = segments[:, :1]
        differences = segments - first  # short paths keep their digits
        q = first + quadrature.values @ differences
        v = quadrature.slopes @ differences
        return np.concatenate([q, v], axis=2).reshape(self._points, 2 * self._dim).T

    def energy(self, x: Array) -> float:
        """Energy of the path through x (nodes, n)."""
        states = self._states(x)
        density = self._gradient(states)[0].full()[0]
        return self._total(density, states)

    def _total(self, density: Array, states: Array) -> float:
        extra = self._added @ states[self._dim :] ** 2 / 2
        return float(self._grid.quadrature.weights.ravel() @ (density + extra))

    def derivatives(self, x: Array) -> tuple[float, Array]:
        """Energy, and (2 n + 3 n^2, points): l_q, l_v, vec l_qq, vec l_qv, vec l_vv."""
        n, states = self._dim, self._states(x)
        density, out = (result.full() for result in self._hessian(states))
        out[n : 2 * n] += self._added[:, None] * states[n:]
        diagonal = 2 * n + 2 * n * n + np.arange(n) * (n + 1)
        out[diagonal] += self._added[:, None]
        return self._total(density[0], states), out

    def slopes(self, x: Array) -> Array:
        """Gradient (nodes, n) at x, without Hessians."""
        states = self._states(x)
        slope = self._gradient(states)[1].full()
        slope[self._dim :] += self._added[:, None] * states[self._dim :]
        return self.gradient(slope)

    def gradient(self, out: Array) -> Array:
        """Gradient (nodes, n) from the derivatives at the points."""
        grid, n = self._grid, self._dim
        quadrature = grid.quadrature
        weighted = out[: 2 * n] * quadrature.weights.ravel()
        at_points = weighted.T.reshape(grid.segments, -1, 2 * n)
        blocks = quadrature.values.T @ at_points[..., :n]
        blocks = blocks + quadrature.slopes.transpose(0, 2, 1) @ at_points[..., n:]
        result = np.zeros((grid.size, n))
        for segment, block in enumerate(blocks):
            start = segment * grid.degree
            result[start : start + grid.degree + 1] += block
        return result

    def hessian(self, out: Array, share: float) -> Array:
        """Hessian (nodes * n, nodes * n), its upper triangle; `share` of the terms beside G."""
        grid, n = self._grid, self._dim
        size, points = grid.size * n, grid.quadrature.weights.shape[1]
        result = np.zeros((size, size))
        by_block = out[2 * n :].reshape(3, n * n, grid.segments, points)
        for segment in range(grid.segments):
            qq, qv, vv = by_block[:, :, segment]
            total = vv @ self._products[3]
            if share > 0.0:
                total += share * (qq @ self._products[0] + qv @ self._products[1])
                mixed = share * (qv @ self._products[2])
                total += mixed.reshape(n, n, -1).swapaxes(0, 1).reshape(n * n, -1)
            shift = segment * grid.degree * n
            result[self._where.rows + shift, self._where.columns + shift] += total
        return result


@lru_cache(maxsize=64)
def _mapped(function: ca.Function, count: int) -> ca.Function:
    return function.map(count)


def pairs_of_nodes(grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """The pairs a <= b of nodes of one segment, b first from the smallest."""
    pairs = [(a, b) for b in range(grid.degree + 1) for a in range(b + 1)]
    first, second = np.array(pairs).T
    return first, second


def products_of_pairs(grid: Grid) -> Array:
    """W B_a B_b, w B_a D_b, w D_a B_b, w D_a D_b at the points of a segment, (4, points, pairs)."""
    quadrature = grid.quadrature
    weights, values, slopes = quadrature.weights[0], quadrature.values, quadrature.slopes[0]
    a, b = pairs_of_nodes(grid)
    factors = ((values, values), (values, slopes), (slopes, values), (slopes, slopes))
    products = [weights[:, None] * one[:, a] * other[:, b] for one, other in factors]
    return np.array(products)


@lru_cache(maxsize=32)
def _tables(grid: Grid, dim: int) -> tuple[Array, _Indices]:
    """The products, and where the blocks of the pairs lie."""
    a, b = pairs_of_nodes(grid)
    entry = np.arange(dim * dim)[:, None]
    indices = _Indices(dim * a + entry % dim, dim * b + entry // dim)
    return products_of_pairs(grid), indices
