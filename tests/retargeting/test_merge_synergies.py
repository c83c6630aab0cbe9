"""Synergies are kept, merged or dropped according to their lengths."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import geodesic_ocp as go

DROP, MERGE = 0.05, 0.2
LENGTHS = st.lists(
    st.tuples(
        st.one_of(st.floats(0.0, 1.0), st.sampled_from([0.0, 0.01, 0.04, 0.05, 0.1, 0.2, 0.5])),
        st.integers(1, 40),
    ),
    min_size=1,
    max_size=25,
)


def synergies(pieces: list[tuple[float, int]]) -> list[go.synergies.Synergy]:
    """Synergies with these lengths and numbers of samples, at 100 Hz."""
    found, start = [], 0
    for length, samples in pieces:
        nodes = np.array([[0.0], [length / 2.0], [length]])
        path = go.Path(go.Euclidean(1), go.Grid(1, 2), nodes)
        law = go.trajectory.time_law(length, samples / 100.0, 0.0, 0.0)
        found.append(go.synergies.Synergy(start, start + samples, start / 100.0, path, law))
        start += samples
    return found


def grouped(*pieces: tuple[float, int]) -> list[tuple[str, tuple[int, ...], tuple[int, ...]]]:
    groups = go.retargeting.merge_synergies(synergies(list(pieces)), drop=DROP, merge=MERGE)
    return [(group.kind, group.members, group.dropped) for group in groups]


@given(pieces=LENGTHS)
def test_groups_have_no_gaps_and_keep_long_synergies(pieces: list[tuple[float, int]]) -> None:
    given_ones = synergies(pieces)
    groups = go.retargeting.merge_synergies(given_ones, drop=DROP, merge=MERGE)
    assert [number for group in groups for number in group.members] == list(range(len(pieces)))
    for group in groups:
        assert group.start == given_ones[group.members[0]].start
        assert group.stop == given_ones[group.members[-1]].stop
        lengths = {number: pieces[number][0] for number in group.members}
        assert set(group.dropped) <= set(group.members)
        # Two long synergies are never merged.
        assert sum(length >= MERGE for length in lengths.values()) <= 1
        if group.kind == "rest":
            assert sum(lengths.values()) < DROP or not any(lengths.values())
            assert group.dropped == group.members
        elif group.kind == "kept":
            assert len(group.members) - len(group.dropped) == 1
        else:
            assert len(group.members) - len(group.dropped) > 1
    assert all(one.stop == other.start for one, other in pairwise(groups))


@given(pieces=LENGTHS)
def test_no_short_group_is_next_to_a_moving_group(pieces: list[tuple[float, int]]) -> None:
    groups = go.retargeting.merge_synergies(synergies(pieces), drop=DROP, merge=MERGE)
    for one, other in pairwise(groups):
        if "rest" not in (one.kind, other.kind):
            for group in (one, other):
                counted = [n for n in group.members if n not in group.dropped]
                assert sum(pieces[n][0] for n in counted) >= MERGE - 1e-12


def test_short_synergies_are_dropped_and_pauses_become_rests() -> None:
    assert grouped((0.5, 10), (0.01, 3), (0.5, 10)) == [("kept", (0,), ()), ("kept", (1, 2), (1,))]
    assert grouped((0.5, 10), (0.01, 30), (0.5, 10)) == [
        ("kept", (0,), ()),
        ("rest", (1,), (1,)),
        ("kept", (2,), ()),
    ]
    # At the beginning and the end, short synergies become rests.
    assert grouped((0.01, 2), (0.5, 10), (0.01, 2)) == [
        ("rest", (0,), (0,)),
        ("kept", (1,), ()),
        ("rest", (2,), (2,)),
    ]


def test_many_short_synergies_are_merged_into_one() -> None:
    assert grouped((0.5, 9), *[(0.03, 3)] * 8, (0.5, 9)) == [
        ("kept", (0,), ()),
        ("merged", tuple(range(1, 9)), ()),
        ("kept", (9,), ()),
    ]


def test_small_synergies_are_merged_until_long_enough() -> None:
    assert grouped((0.5, 9), (0.1, 9), (0.11, 9), (0.1, 9), (0.12, 9), (0.5, 9)) == [
        ("kept", (0,), ()),
        ("merged", (1, 2), ()),
        ("merged", (3, 4), ()),
        ("kept", (5,), ()),
    ]


def test_remaining_small_synergy_joins_its_shorter_neighbour() -> None:
    assert grouped((0.5, 9), (0.1, 9), (0.3, 9)) == [("kept", (0,), ()), ("merged", (1, 2), ())]
    assert grouped((0.01, 50), (0.1, 9), (0.01, 50)) == [
        ("rest", (0,), (0,)),
        ("kept", (1,), ()),
        ("rest", (2,), (2,)),
    ]


def test_default_thresholds_are_fractions_of_the_longest() -> None:
    pieces = [(1.0, 9), (0.14, 9), (0.02, 2), (1.0, 9), (0.16, 9)]
    for scale in (1.0, 7.0):
        groups = go.retargeting.merge_synergies(
            synergies([(scale * length, n) for length, n in pieces])
        )
        assert [group.members for group in groups] == [(0, 1), (2, 3), (4,)]


def test_zero_thresholds_keep_everything() -> None:
    groups = go.retargeting.merge_synergies(
        synergies([(0.5, 9), (0.001, 9), (0.1, 9)]), drop=0.0, merge=0.0
    )
    assert [group.kind for group in groups] == ["kept", "kept", "kept"]


@pytest.mark.parametrize(("drop", "merge"), [(-1.0, 0.1), (0.2, 0.1), (float("nan"), 1.0)])
def test_wrong_thresholds_are_named(drop: float, merge: float) -> None:
    with pytest.raises(ValueError, match="drop"):
        go.retargeting.merge_synergies(synergies([(0.5, 9)]), drop=drop, merge=merge)
    with pytest.raises(ValueError, match="no synergies"):
        go.retargeting.merge_synergies([])
