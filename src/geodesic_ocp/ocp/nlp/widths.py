"""Widths of a grid's segments as parameters of the NLP, so that it serves all such grids."""

from __future__ import annotations

import casadi as ca
import numpy as np

from geodesic_ocp.trajectory.grid import Grid


class Widths:
    """Scales what the NLP on equal segments takes from slopes to segments of other widths.

    Args:
        grid: of equal segments.
        widths: of the segments (segments, 1); None: equal.
    """

    def __init__(self, grid: Grid, widths: ca.MX | None) -> None:
        self._segments = grid.segments
        self._steeper = None if widths is None else 1.0 / (grid.segments * widths.T)

    def _at(self, columns: int) -> ca.MX:
        """Ratios of the slopes to those on equal segments, (1, columns)."""
        steeper, count = self._steeper, columns // self._segments
        assert steeper is not None
        return ca.reshape(ca.repmat(steeper, count, 1), 1, columns)

    def scale_rows(self, slopes: ca.MX) -> ca.MX:
        """Slopes, or derivatives by them, (n, segments * m)."""
        if self._steeper is None:
            return slopes
        return slopes * ca.repmat(self._at(slopes.shape[1]), slopes.shape[0], 1)

    def scale_weights(self, weights: ca.DM) -> ca.MX | ca.DM:
        """Quadrature weights (1, segments * m)."""
        return weights if self._steeper is None else weights / self._at(weights.shape[1])

    def scale_hessians(self, blocks: ca.MX) -> ca.MX:
        """Vectorized Hessians by positions and slopes, (4 n^2, segments * m)."""
        if self._steeper is None:
            return blocks
        n = round((blocks.shape[0] / 4) ** 0.5)
        of_slopes = np.arange(2 * n) >= n
        power = np.add.outer(of_slopes.astype(int), of_slopes).ravel(order="F")
        steeper = self._at(blocks.shape[1])
        masks = [ca.DM((power == k).astype(float)) for k in range(3)]
        ones = ca.DM.ones(1, blocks.shape[1])
        return blocks * (masks[0] @ ones + masks[1] @ steeper + masks[2] @ steeper**2)

    def scale_at_ends(self, block: ca.MX) -> ca.MX:
        """Vectorized Hessian by both ends' positions and slopes, (16 n^2, 1)."""
        if self._steeper is None:
            return block
        n = round(block.shape[0] ** 0.5) // 4
        first, last = self._steeper[0], self._steeper[-1]
        factors = ca.vertcat(ca.DM.ones(2 * n), ca.repmat(first, n, 1), ca.repmat(last, n, 1))
        return block * ca.vec(factors @ factors.T)
