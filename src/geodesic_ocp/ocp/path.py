"""Path: a curve q(s), s in [0, 1], on a manifold."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.ocp.grid import Grid


@dataclass(frozen=True, eq=False)
class Path:
    """A piecewise polynomial curve through the nodes of a grid.

    Attributes:
        metric: of the manifold on which the path lies.
        grid: of its nodes.
        nodes: positions at the grid's nodes, (grid.size, n).

    Raises:
        ValueError: the nodes' shape is not the grid's and the metric's, or not all are finite.
    """

    metric: Metric
    grid: Grid
    nodes: Array = field(repr=False)

    def __post_init__(self) -> None:
        nodes = np.array(self.nodes, dtype=float)
        if nodes.shape != (self.grid.size, self.metric.dim):
            raise ValueError(
                f"nodes must have shape {(self.grid.size, self.metric.dim)}, got {nodes.shape}"
            )
        if not np.all(np.isfinite(nodes)):
            raise ValueError("nodes must be finite")
        nodes.flags.writeable = False
        object.__setattr__(self, "nodes", nodes)

    def __call__(self, s: ArrayLike, order: int = 0) -> Array:
        """q(s) or its derivative of the given order by s: (n,) for a number, (k, n) for k of them.

        Raises:
            ValueError: s lies outside [0, 1] or is not finite, or the order is negative.
        """
        times = np.asarray(s, dtype=float)
        if times.ndim > 1:
            raise ValueError(f"s must be a number or have shape (k,), got {times.shape}")
        if order < 0:
            raise ValueError(f"order must not be negative, got {order}")
        if not np.all((times >= -1e-9) & (times <= 1.0 + 1e-9)):
            raise ValueError(f"s must lie in [0, 1], got {s!r}")
        values = self.grid.in_segments(self.nodes)
        for _ in range(order):
            # A constant's derivative is zero to the last digit, and a short path keeps its digits.
            values = values - values[:, :1]
            values = self.grid.differentiation @ values
        result = self.grid.interpolate(values, np.clip(np.atleast_1d(times), 0.0, 1.0))
        return result[0] if times.ndim == 0 else result

    @property
    def breakpoints(self) -> Array:
        """Ends of the grid's segments: between them the path is smooth."""
        return self.grid.breakpoints

    @cached_property
    def speeds_at_nodes(self) -> Array:
        """Speeds |q'|_G (grid.collocations,) at the nodes of every segment."""
        grid, n = self.grid, self.metric.dim
        positions = grid.in_segments(self.nodes)
        slopes = grid.differentiation @ (positions - positions[:, :1])
        function = self.metric.speed.map(grid.collocations)
        speeds = evaluate(function, positions.reshape(-1, n).T, slopes.reshape(-1, n).T)
        return np.asarray(speeds.ravel())

    @cached_property
    def _speeds(self) -> tuple[Array, Array]:
        """Quadrature weights and speeds |q'|_G, twice as fine as the path's own polynomials."""
        fine = replace(self.grid, degree=min(2 * self.grid.degree, 100))
        by_segment = fine.in_segments(fine.nodes)
        # One-sided at the segments' ends, where the derivative may jump.
        middle = by_segment.mean(axis=1, keepdims=True)
        s = (middle + (1.0 - 1e-12) * (by_segment - middle)).ravel()
        function = self.metric.speed
        speeds = evaluate(function.map(s.size), self(s).T, self(s, 1).T).ravel()
        return fine.weights.ravel(), speeds

    @property
    def length(self) -> float:
        """Length: the integral of |q'(s)|_G over s."""
        weights, speeds = self._speeds
        return float(weights @ speeds)

    @property
    def energy(self) -> float:
        """Energy: half the integral of |q'(s)|_G^2 over s; at least length^2 / 2."""
        weights, speeds = self._speeds
        return float(0.5 * weights @ speeds**2)
