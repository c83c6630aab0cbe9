"""Local refinement of cuts, from a grid of candidates to single samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

Pair = tuple[int, int]
# A smaller relative decrease is rounding.
_DECREASE = 1e-12


def refine_cuts(
    cuts: Sequence[int], costs_of: Callable[[list[Pair]], list[float]], step: int
) -> tuple[list[int], float]:
    """Coordinate descent on the cuts: each moves by `step` samples while that lowers the total.

    The step is halved down to one sample; the result cannot be improved by moving any single cut
    by one sample. The cuts at even and at odd positions are tried in turn, each group at once:
    their segments do not overlap. The total never increases.

    Args:
        cuts: sample indices, of which the first and the last stay.
        costs_of: costs of segments (start, stop), inf where there is none.
        step: the first one, in samples.

    Returns:
        The cuts, and their total cost.
    """
    cuts = list(cuts)
    step = 1 << max(step, 1).bit_length() - 1
    while step >= 1:
        # Cuts that may improve: those that moved, and their neighbours.
        open_cuts = set(range(1, len(cuts) - 1))
        while open_cuts:
            for parity in (0, 1):
                tried = sorted(index for index in open_cuts if index % 2 == parity)
                open_cuts -= set(tried)
                for index in _improve(cuts, tried, costs_of, step):
                    open_cuts |= {index - 1, index, index + 1} & set(range(1, len(cuts) - 1))
        step //= 2
    return cuts, sum(costs_of(list(pairwise(cuts))))


def _improve(
    cuts: list[int],
    tried: Sequence[int],
    costs_of: Callable[[list[Pair]], list[float]],
    step: int,
) -> list[int]:
    """Move each of these cuts, no two of them neighbours, to its best place; which have moved."""
    places = {
        index: [
            place
            for place in (cuts[index], cuts[index] - step, cuts[index] + step)
            if cuts[index - 1] < place < cuts[index + 1]
        ]
        for index in tried
    }
    pairs = [
        pair
        for index in tried
        for place in places[index]
        for pair in ((cuts[index - 1], place), (place, cuts[index + 1]))
    ]
    costs = iter(costs_of(pairs))
    moved = []
    for index in tried:
        totals = [next(costs) + next(costs) for _ in places[index]]
        best = min(range(len(totals)), key=totals.__getitem__)
        if totals[best] < totals[0] * (1.0 - _DECREASE):
            cuts[index] = places[index][best]
            moved.append(index)
    return moved
