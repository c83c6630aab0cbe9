"""The shortest path through layers, against all paths."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from geodesic_ocp.arrays import Array
from geodesic_ocp.retargeting.candidates import shortest_path, with_further_edges


@given(st.integers(0, 10_000), st.lists(st.integers(1, 4), min_size=1, max_size=5))
def test_no_path_is_shorter(seed: int, sizes: list[int]) -> None:
    rng = np.random.default_rng(seed)
    nodes = [rng.uniform(size=size) for size in sizes]
    edges = [rng.uniform(size=shape) for shape in pairwise(sizes)]
    more = [rng.uniform(size=size) for size in sizes]
    detours = [rng.uniform(size=each.shape) for each in edges]

    def cost(chosen: tuple[int, ...]) -> float:
        of_nodes = sum(a[k] + b[k] for a, b, k in zip(nodes, more, chosen, strict=True))
        steps = zip(edges, detours, chosen[:-1], chosen[1:], strict=True)
        return float(of_nodes + sum(a[i, k] + b[i, k] for a, b, i, k in steps))

    def further(asked: Sequence[tuple[int, int]]) -> Array:
        return np.array([more[layer][index] for layer, index in asked])

    bounds = shortest_path(nodes, edges, further)
    every = with_further_edges(nodes, edges, lambda k, a, b: detours[k][a, b], *bounds)
    found, length = shortest_path(nodes, every, further)
    assert np.isclose(length, cost(tuple(found)))
    assert length <= min(cost(each) for each in product(*map(range, sizes))) + 1e-12
