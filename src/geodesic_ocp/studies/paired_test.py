"""Tests of paired numbers: sign test, Wilcoxon's signed-rank test, bootstrap interval."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_integer, as_number
from geodesic_ocp.fitting.resampling import FEWEST

_RESAMPLES = 9999
_FEW = 10  # fewer pairs give a bootstrap interval that is narrower than its name


@dataclass(frozen=True, repr=False)
class PairedTest:
    """Outcome of tests whether paired numbers of two methods differ.

    Attributes:
        pairs: number of pairs that are tested.
        left_out: number of pairs that are not, as a number in them is NaN.
        wins, losses, ties: pairs in which the first number is better, worse, and equal.
        mean_difference: mean of first minus second.
        interval: bootstrap confidence interval of it, (low, high); NaN with one or two pairs.
        interval_method: "BCa" or "percentile".
        confidence: confidence of the interval, and 1 minus the level that `note` refers to.
        sign_p: two-sided p-value of the sign test; pairs that are equal count for nothing.
        wilcoxon_p: two-sided p-value of Wilcoxon's signed-rank test, likewise.
        smallest_p: the smallest p-value that either test can give with as many pairs that differ.
    """

    pairs: int
    left_out: int
    wins: int
    losses: int
    ties: int
    mean_difference: float
    interval: tuple[float, float]
    interval_method: str
    confidence: float
    sign_p: float
    wilcoxon_p: float
    smallest_p: float

    def __repr__(self) -> str:
        low, high = self.interval
        return (
            f"PairedTest(wins {self.wins} of {self.pairs} pairs, mean difference "
            f"{self.mean_difference:.4g},\n  {self.confidence:.0%} interval {low:.4g} to {high:.4g}"
            f", sign test p = {self.sign_p:.3g}, Wilcoxon p = {self.wilcoxon_p:.3g})"
        )

    @property
    def note(self) -> str:
        """The limits of the tests: too few pairs, or pairs left out; empty if there are none."""
        notes = []
        if self.left_out:
            notes.append(f"{self.left_out} pair{'s' * (self.left_out > 1)} left out (NaN)")
        level = 1.0 - self.confidence
        if self.smallest_p > level * (1.0 + 1e-9):
            notes.append(
                f"{_pairs(self.wins + self.losses)} cannot reach p < {level:.3g}: the "
                f"smallest possible p is {self.smallest_p:.3g}"
            )
        if self.pairs < _FEW:
            notes.append(f"a bootstrap of {self.pairs} pairs underestimates the interval")
        return "; ".join(notes)


def paired_test(
    a: ArrayLike,
    b: ArrayLike,
    *,
    by: Sequence[object] | None = None,
    confidence: float = 0.95,
    larger_is_better: bool = False,
    seed: int = 0,
) -> PairedTest:
    """Test whether paired numbers differ: sign test, Wilcoxon's test, and a bootstrap interval.

    Pairs must be independent: recordings or, better, subjects, never the segments of a recording.
    Both tests are exact (Wilcoxon's up to 50 pairs without ties of size, else approximate or by
    permutations, see `scipy.stats.wilcoxon`). With n pairs that differ neither gives a p-value
    below 2^(1 - n): at least six are needed for p < 0.05. The interval of the mean difference is
    the bias-corrected and accelerated bootstrap interval (Efron, J. Am. Stat. Assoc. 82, 1987), or
    the percentile interval where that does not exist, as when all differences are equal.

    >>> test = go.studies.paired_test([1.0, 2.1, 3.0, 4.2, 5.0], [1.5, 2.4, 3.7, 4.6, 5.6])
    >>> test.wins, test.sign_p
    (5, 0.0625)
    >>> test.note.split(";")[0]
    '5 pairs that differ cannot reach p < 0.05: the smallest possible p is 0.0625'

    Args:
        a, b: k numbers each; pairs with a NaN are left out and counted.
        by: k labels; pairs of equal labels are averaged first, such as the recordings of a subject.
        confidence: confidence of the interval, in (0, 1).
        larger_is_better: whether a pair is won by the larger number, not, as errors are, by the
            smaller one.
        seed: seed of the bootstrap.

    Raises:
        ValueError: a and b are not k numbers each, by has not k labels, no pair is left, or
            confidence or seed is out of range.
    """
    first, second = (_numbers(name, value) for name, value in (("a", a), ("b", b)))
    if first.shape != second.shape:
        raise ValueError(f"a and b must be pairs, got {first.size} and {second.size} numbers")
    confidence = as_confidence(confidence)
    as_integer("seed", seed, 0)
    if by is not None and len(by) != first.size:
        raise ValueError(f"by must have {first.size} labels, one for each pair, got {len(by)}")
    labels: list[object] = [*range(first.size)] if by is None else [*by]
    differences = first - second
    known = np.isfinite(differences)
    if not known.any():
        raise ValueError("a and b have no pair without NaN")
    kept = [label for label, is_known in zip(labels, known, strict=True) if is_known]
    values = differences[known]
    groups = [
        [i for i, other in enumerate(kept) if other == label] for label in dict.fromkeys(kept)
    ]
    means = np.array([values[group].mean() for group in groups])

    better = means if larger_is_better else -means
    wins = int(np.sum(better > 0.0))
    losses = int(np.sum(better < 0.0))
    unequal = means[means != 0.0]
    interval, method = _bootstrap(means, confidence, seed)
    return PairedTest(
        pairs=means.size,
        left_out=int(np.sum(~known)),
        wins=wins,
        losses=losses,
        ties=means.size - wins - losses,
        mean_difference=float(means.mean()),
        interval=interval,
        interval_method=method,
        confidence=confidence,
        sign_p=float(scipy.stats.binomtest(wins, wins + losses).pvalue) if unequal.size else 1.0,
        wilcoxon_p=float(scipy.stats.wilcoxon(unequal).pvalue) if unequal.size else 1.0,
        smallest_p=min(1.0, 2.0 ** (1 - unequal.size)),
    )


def as_confidence(value: float) -> float:
    """Return the confidence of an interval.

    Raises:
        ValueError: it is not a number between 0 and 1.
    """
    number = as_number("confidence", value)
    if not 0.0 < number < 1.0:
        raise ValueError(f"confidence must be in (0, 1), got {number:g}")
    return number


def student_half(deviation: Any, count: Any, confidence: float) -> Any:
    """Return half of the interval of a mean by Student's t: t SD / sqrt(k); NaN below three."""
    known = np.where(np.asarray(count) >= FEWEST, count, np.nan)
    quantile = scipy.stats.t.ppf((1.0 + confidence) / 2.0, known - 1)
    return quantile * deviation / np.sqrt(known)


def _pairs(count: int) -> str:
    return "1 pair that differs" if count == 1 else f"{count} pairs that differ"


def _numbers(name: str, value: ArrayLike) -> Array:
    """Return a copy as floats (k,), k > 0; ValueError names the argument otherwise."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.ndim != 1 or array.size == 0 or np.any(np.isinf(array)):
        raise ValueError(f"{name} must be numbers (k,), finite or NaN, got {value!r}")
    return array


def _bootstrap(values: Array, confidence: float, seed: int) -> tuple[tuple[float, float], str]:
    """Return confidence interval of the mean, and by which method."""
    if values.size < FEWEST:
        return (float("nan"), float("nan")), "none"
    for method in ("BCa", "percentile"):
        with warnings.catch_warnings():
            # Of equal differences; the interval is then the next method's, or a single number.
            warnings.simplefilter("ignore")
            found = scipy.stats.bootstrap(
                (values,),
                np.mean,
                n_resamples=_RESAMPLES,
                confidence_level=confidence,
                method=method,
                random_state=np.random.default_rng(seed),
            ).confidence_interval
        if np.all(np.isfinite(found)):
            break
    return (float(found.low), float(found.high)), method


def holm(p_values: Sequence[float]) -> Array:
    """Return p-values corrected for their number m by Holm's step-down method.

    p*_(i) = max_(j <= i) min(1, (m - j + 1) p_(j)) for p_(1) <= ... <= p_(m)

    Rejecting where p* < alpha keeps the probability of any false rejection below alpha, whatever
    the dependence of the tests (Holm, "A simple sequentially rejective multiple test procedure",
    Scandinavian Journal of Statistics 6, 1979).
    """
    p = np.asarray(p_values, dtype=float)
    order = np.argsort(p, kind="stable")
    stepped = np.minimum(1.0, p[order] * (p.size - np.arange(p.size)))
    corrected = np.empty_like(p)
    corrected[order] = np.maximum.accumulate(stepped)
    return corrected


def rank_biserial(differences: ArrayLike) -> float:
    """Return the matched-pairs rank-biserial correlation, positive for negative differences.

    r = (W- - W+) / (W- + W+)

    with the sums W of the ranks of |d| over negative and positive differences d; those that are
    zero are left out. 1: every first number is the smaller one; -1: every one is larger; 0 if none
    differs (Kerby, "The simple difference formula", Comprehensive Psychology 3, 2014).
    """
    d = np.asarray(differences, dtype=float)
    d = d[d != 0.0]
    if d.size == 0:
        return 0.0
    ranks = scipy.stats.rankdata(np.abs(d))
    return float(np.sum(np.where(d < 0.0, ranks, -ranks)) / np.sum(ranks))
