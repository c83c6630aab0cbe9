"""Tests of paired numbers against values that are known exactly."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.stats
from hypothesis import given
from hypothesis import strategies as st

import geodesic_ocp as go


@pytest.mark.parametrize(("pairs", "p"), [(1, 1.0), (5, 0.0625), (6, 0.03125), (11, 2.0**-10)])
def test_a_win_in_every_pair(pairs: int, p: float) -> None:
    """Both p-values are 2^(1 - n), the smallest that n pairs allow."""
    b = np.linspace(1.0, 2.0, pairs)
    test = go.studies.paired_test(b - 0.1 * b**2, b)
    assert (test.pairs, test.wins, test.losses, test.ties) == (pairs, pairs, 0, 0)
    assert test.sign_p == pytest.approx(p)
    assert test.wilcoxon_p == pytest.approx(p)
    assert test.smallest_p == pytest.approx(p)
    assert (f"smallest possible p is {p:.3g}" in test.note) == (pairs < 6)


def test_sign_and_wilcoxon_tests_by_hand() -> None:
    """Differences 1, 2, 3, -4: one loss of four; the rank sum of the negative one is 4."""
    test = go.studies.paired_test([1.0, 2.0, 3.0, -4.0], np.zeros(4), larger_is_better=True)
    assert (test.wins, test.losses) == (3, 1)
    assert test.sign_p == pytest.approx(2 * (1 + 4) / 16)
    # Subsets of {1, 2, 3, 4} with a sum of at most 4: 0, 1, 2, 3, 4, 1 + 2, 1 + 3.
    assert test.wilcoxon_p == pytest.approx(2 * 7 / 16)
    assert test.mean_difference == 0.5


def test_smaller_is_better_unless_told_otherwise() -> None:
    a, b = [1.0, 2.0, 3.0], [2.0, 1.0, 5.0]
    errors, correlations = (
        go.studies.paired_test(a, b),
        go.studies.paired_test(a, b, larger_is_better=True),
    )
    assert (errors.wins, errors.losses) == (2, 1)
    assert (correlations.wins, correlations.losses) == (1, 2)
    assert errors.mean_difference == correlations.mean_difference == pytest.approx(-2 / 3)


def test_ties_and_missing_pairs_are_left_out_and_counted() -> None:
    a = [1.0, 2.0, np.nan, 4.0, 5.0, 7.0]
    b = [2.0, 3.0, 1.0, np.nan, 5.0, 6.5]
    test = go.studies.paired_test(a, b)
    assert (test.pairs, test.left_out, test.wins, test.losses, test.ties) == (4, 2, 2, 1, 1)
    assert test.sign_p == 1.0
    assert test.note.startswith("2 pairs left out (NaN); 3 pairs that differ cannot reach p < 0.05")


def test_recordings_of_a_subject_are_averaged_first() -> None:
    """Ten recordings of one subject are one pair."""
    a, b = np.arange(12.0), np.arange(12.0) + np.repeat([1.0, -2.0, -4.0], [10, 1, 1])
    test = go.studies.paired_test(a, b, by=[*10 * ["first"], "second", "second"])
    assert (test.pairs, test.wins, test.losses) == (2, 1, 1)
    assert test.mean_difference == pytest.approx((-1.0 + 3.0) / 2)


def test_equal_numbers() -> None:
    test = go.studies.paired_test(np.ones(4), np.ones(4))
    assert (test.ties, test.sign_p, test.wilcoxon_p) == (4, 1.0, 1.0)
    assert test.interval == (0.0, 0.0)
    assert go.studies.paired_test(np.ones(4), np.zeros(4)).interval == (1.0, 1.0)


def test_the_interval_of_a_single_pair_is_unknown() -> None:
    assert np.isnan(go.studies.paired_test([1.0], [2.0]).interval).all()


@pytest.mark.slow
def test_intervals_contain_the_true_mean_as_often_as_they_say() -> None:
    """Of 40 pairs each; a binomial test of the coverage."""
    rng = np.random.default_rng(3)
    inside = 0
    for seed in range(100):
        differences = rng.normal(1.0, 2.0, size=40)
        low, high = go.studies.paired_test(
            differences, np.zeros(40), confidence=0.8, seed=seed
        ).interval
        inside += low <= 1.0 <= high
    assert scipy.stats.binomtest(inside, 100, 0.8).pvalue > 0.01


@pytest.mark.slow
@given(st.integers(0, 10**6), st.integers(3, 12))
def test_scale_and_order_change_nothing(seed: int, pairs: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(2, pairs))
    test, swapped = go.studies.paired_test(a, b), go.studies.paired_test(b, a)
    assert (test.wins, test.losses) == (swapped.losses, swapped.wins)
    assert test.sign_p == pytest.approx(swapped.sign_p)
    assert test.wilcoxon_p == pytest.approx(swapped.wilcoxon_p)
    doubled = go.studies.paired_test(2.0 * a, 2.0 * b)
    assert doubled.interval == pytest.approx(2.0 * np.array(test.interval))
    assert test.interval[0] <= test.mean_difference <= test.interval[1]
    assert test == go.studies.paired_test(a, b)  # seeded
    assert min(test.sign_p, test.wilcoxon_p) >= test.smallest_p * (1.0 - 1e-12)


def test_bad_arguments_are_named() -> None:
    with pytest.raises(ValueError, match="a and b must be pairs, got 2 and 3 numbers"):
        go.studies.paired_test([1.0, 2.0], [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match=r"b must be numbers \(k,\), finite or NaN"):
        go.studies.paired_test([1.0], [np.inf])
    with pytest.raises(ValueError, match=r"a must be numbers \(k,\)"):
        go.studies.paired_test([[1.0]], [1.0])
    with pytest.raises(ValueError, match="a and b have no pair without NaN"):
        go.studies.paired_test([np.nan, 1.0], [1.0, np.nan])
    with pytest.raises(ValueError, match="by must have 2 labels, one for each pair, got 1"):
        go.studies.paired_test([1.0, 2.0], [2.0, 1.0], by=["first"])
    with pytest.raises(ValueError, match=r"confidence must be in \(0, 1\)"):
        go.studies.paired_test([1.0], [2.0], confidence=95.0)
    with pytest.raises(ValueError, match="seed must be a non-negative integer"):
        go.studies.paired_test([1.0], [2.0], seed=-1)
