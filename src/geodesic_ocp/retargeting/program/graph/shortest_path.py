"""The shortest path through layers of nodes, by dynamic programming (Bellman 1957)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from geodesic_ocp.arrays import Array


def shortest_path(
    node_costs: Sequence[Array], edge_costs: Callable[[int], Array]
) -> tuple[list[int], float]:
    """One node of each layer, with the least sum of costs.

    Args:
        node_costs: of each layer, (k_i,).
        edge_costs: number i of a layer -> costs (k_i, k_i+1) of the edges to the next one.

    Returns:
        Indices of the nodes, and their cost.
    """
    total = np.asarray(node_costs[0], dtype=float)
    before: list[np.ndarray] = []
    for layer, costs in enumerate(node_costs[1:]):
        sums = total[:, None] + edge_costs(layer)
        best = np.argmin(sums, axis=0)
        before.append(best)
        total = sums[best, np.arange(best.size)] + costs
    chosen = [int(np.argmin(total))]
    for best in reversed(before):
        chosen.append(int(best[chosen[-1]]))
    return chosen[::-1], float(total.min())
