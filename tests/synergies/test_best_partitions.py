"""Dynamic programming against all partitions."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geodesic_ocp.synergies.segment_costs import best_partitions, refine_cuts


@given(
    candidates=st.integers(2, 8),
    widest=st.integers(1, 7),
    seed=st.integers(0, 10_000),
    missing=st.floats(0.0, 0.5),
)
def test_best_partitions_are_the_best_of_all(
    candidates: int, widest: int, seed: int, missing: float
) -> None:
    """Also where segments are not available: their costs are infinite."""
    rng = np.random.default_rng(seed)
    widest = min(widest, candidates - 1)
    costs = rng.uniform(0.0, 1.0, (candidates, widest))
    costs[rng.uniform(size=costs.shape) < missing] = np.inf
    found = best_partitions(costs)

    def total(cuts: tuple[int, ...]) -> float:
        widths = [stop - start for start, stop in pairwise(cuts)]
        if max(widths) > widest:
            return np.inf
        return sum(costs[stop, width - 1] for stop, width in zip(cuts[1:], widths, strict=True))

    for count in range(1, candidates):
        inner = combinations(range(1, candidates - 1), count - 1)
        least = min(total((0, *cuts, candidates - 1)) for cuts in inner)
        assert found.totals[count] == pytest.approx(least)
        if np.isfinite(least):
            cuts = found.cuts(count)
            assert len(cuts) == count + 1
            assert total(tuple(cuts)) == pytest.approx(least)


@given(
    corners=st.lists(st.integers(1, 99), min_size=1, max_size=5, unique=True),
    moves=st.lists(st.integers(-4, 4), min_size=5, max_size=5),
)
def test_refinement_ends_where_no_single_cut_can_improve(
    corners: list[int], moves: list[int]
) -> None:
    ends = [0, *sorted(corners), 100]

    def costs_of(pairs: list[tuple[int, int]]) -> list[float]:
        """Zero only between neighbouring corners; segments of one sample are not available."""
        return [
            np.inf
            if stop - start == 1
            else sum((stop - c) * (c - start) for c in ends if start < c < stop) / 100.0
            for start, stop in pairs
        ]

    shifted = {min(max(c + move, 1), 99) for c, move in zip(sorted(corners), moves, strict=False)}
    before = [0, *sorted(shifted), 100]
    cuts, total = refine_cuts(before, costs_of, 5)
    assert total == sum(costs_of(list(pairwise(cuts))))
    assert total <= sum(costs_of(list(pairwise(before))))
    assert [cuts[0], cuts[-1], len(cuts)] == [0, 100, len(before)]
    for index in range(1, len(cuts) - 1):
        for place in (cuts[index] - 1, cuts[index] + 1):
            if cuts[index - 1] < place < cuts[index + 1]:
                moved = [*cuts[:index], place, *cuts[index + 1 :]]
                assert sum(costs_of(list(pairwise(moved)))) >= total * (1.0 - 1e-9)
