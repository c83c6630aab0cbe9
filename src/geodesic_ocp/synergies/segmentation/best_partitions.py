"""Dynamic programming over the partitions of a sequence into segments.

Bellman, "On the approximation of curves by line segments using dynamic programming",
Communications of the ACM 4, 1961; Jackson et al., "An algorithm for optimal partitioning of data on
an interval", IEEE Signal Processing Letters 12, 2005.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from geodesic_ocp.arrays import Array


@dataclass(frozen=True, eq=False, repr=False)
class BestPartitions:
    """The best partition of the steps between m candidates for every number of segments.

    Attributes:
        totals: least sum of the costs (m,), by the number of segments; inf where there is none.
        before: (m, m), for a number of segments and the candidate where the last of them stops, the
            number of steps in that segment.
    """

    totals: Array
    before: np.ndarray

    def __repr__(self) -> str:
        return f"BestPartitions({len(self.totals)} candidates)"

    def cuts(self, count: int) -> list[int]:
        """Indices of the count + 1 candidates of the best partition into `count` segments."""
        stops = [len(self.totals) - 1]
        for number in range(count, 0, -1):
            stops.append(stops[-1] - int(self.before[number, stops[-1]]))
        return stops[::-1]


def best_partitions(costs: Array) -> BestPartitions:
    """Minimize the sum of the segments' costs, for every number of segments at once.

    D_k(j) = min over d of D_(k-1)(j - d) + costs[j, d - 1], in O(m^2 w) operations.

    Args:
        costs: (m, w); [j, d - 1] of the segment of d steps that stops at candidate j, inf where
            there is none.
    """
    count, widest = costs.shape
    best = np.full((count, count), np.inf)
    before = np.zeros((count, count), dtype=np.int32)
    best[0, 0] = 0.0
    for number in range(1, count):
        padded = np.concatenate([np.full(widest, np.inf), best[number - 1]])
        # Row j holds the totals at the candidates j - 1, j - 2, ..., j - w.
        earlier = sliding_window_view(padded, widest)[:count, ::-1]
        totals = earlier + costs
        steps = np.argmin(totals, axis=1)
        best[number] = np.take_along_axis(totals, steps[:, None], axis=1)[:, 0]
        before[number] = steps + 1
    return BestPartitions(best[:, -1].copy(), before)
