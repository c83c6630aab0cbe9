"""Several tests at once, and the size of an effect."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from geodesic_ocp.arrays import Array


def holm(p_values: Sequence[float]) -> Array:
    """P-values corrected for their number m by Holm's step-down method.

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


def rank_biserial(differences: Sequence[float]) -> float:
    """Matched-pairs rank-biserial correlation, positive where differences are mostly negative.

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
