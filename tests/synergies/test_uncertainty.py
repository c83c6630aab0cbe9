"""The spread of number, cuts and errors of synergies under the noise of a recording."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from known_models import planar_arm
from table_rows import rows_of_table

import geodesic_ocp as go
from geodesic_ocp.synergies.uncertainty import bootstrap, matched

ARM = planar_arm((0.3, 0.3), (2.0, 1.5), (0.15, 0.15), (0.02, 0.02))
METRIC = go.Euclidean(2)
TIME = np.arange(300) / 100.0
NOISE = 4e-3  # [rad]


def recorded(seed: int, noise: float = NOISE) -> go.Motion:
    """A right-angled corner at 1 s, and a bend at 2 s that only some noise lifts over 0.7 rad."""
    first = np.minimum(TIME, 1.0)
    second = np.clip(TIME - 1.0, 0.0, 1.0) + np.cos(0.55) * np.maximum(TIME - 2.0, 0.0)
    first = first + np.sin(0.55) * np.maximum(TIME - 2.0, 0.0)
    q = np.column_stack([first, second])
    q += noise * np.random.default_rng(seed).normal(size=q.shape)
    return go.Motion(TIME, q, ARM.joint_names).filtered(cutoff=6.0)


def cuts_of(motion: go.Motion) -> np.ndarray:
    return motion.time[[start for start, _ in go.segment(METRIC, motion)[1:]]]


@pytest.mark.slow
def test_the_spread_is_that_of_fresh_noise() -> None:
    motion = recorded(0)
    spread = bootstrap(ARM, METRIC, motion, go.segment(METRIC, motion), go.segment, replicates=60)
    fresh = [cuts_of(recorded(seed)) for seed in range(1, 61)]
    corners = np.array([cuts[np.argmin(np.abs(cuts - 1.0))] for cuts in fresh])
    corner = int(np.argmin(np.abs(spread.times - 1.0)))
    assert spread.stable[corner]
    assert spread.shares[corner] == 1.0
    # The noise that the filter left adds to that of the replicates.
    assert 0.7 * corners.std() - 1e-3 < spread.spreads[corner] < 2.0 * corners.std() + 2e-3
    low, high = spread.count_range
    assert np.mean([low <= len(cuts) + 1 <= high for cuts in fresh]) >= 0.9
    assert high > low  # the bend is a cut in some, in others not
    assert not spread.stable.all()


@pytest.mark.slow
def test_an_analysis_has_a_spread_that_depends_on_its_seed_alone() -> None:
    pytest.importorskip("geodesic_ocp.drawing")
    motion = recorded(3, 1e-3)
    for segments in (go.segment, partial(go.synergies.segment_developed, deviation=0.1)):
        analysis = go.analyse(ARM, motion, metric=METRIC, segments=segments)
        spread = analysis.uncertainty(10)
        again = go.analyse(ARM, motion, metric=METRIC, segments=segments).uncertainty(10)
        assert np.array_equal(again.errors, spread.errors)
        assert np.array_equal(again.counts, spread.counts)
        assert len(spread.times) == spread.count - 1 == len(analysis.segments) - 1
        errors = analysis.errors["riemannian"]
        for number, measure in enumerate(("joint", "position", "orientation")):
            low, high = spread.error_range(measure)
            assert low <= getattr(errors, measure) <= high
            assert spread.own_errors[number] == pytest.approx(getattr(errors, measure), abs=1e-6)
    rows = rows_of_table(spread.table())
    assert [row[-1] for row in rows] == ["stable" if s else "doubtful" for s in spread.stable]
    labels = [
        text.get_text() for text in go.plot(analysis, uncertainty=spread).legends[0].get_texts()
    ]
    assert labels[-2:] == ["stable cut", "doubtful cut"]


@pytest.mark.slow
def test_what_is_not_known_is_said() -> None:
    motion = recorded(0)
    given = go.analyse(ARM, motion, metric=METRIC, segments=[(0, 100), (100, 299)])
    with pytest.raises(ValueError, match="how the segments were found is not known"):
        given.uncertainty()
    bare = go.Motion(motion.time, motion.q, motion.joint_names, motion.velocity)
    with pytest.raises(ValueError, match="taken without a filter"):
        go.analyse(ARM, bare, metric=METRIC).uncertainty()


def test_a_cut_is_the_same_if_each_is_the_nearest_to_the_other() -> None:
    cuts, others = np.array([1.0, 1.06, 2.0, 3.0]), np.array([1.05, 2.09, 3.2])
    expected = [np.nan, 1.05, 2.09, np.nan]
    assert np.array_equal(matched(cuts, others), expected, equal_nan=True)
    assert np.isnan(matched(cuts, np.empty(0))).all()
