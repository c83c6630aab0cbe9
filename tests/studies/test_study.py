"""Means and tests over subjects, against values computed independently."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st
from short_reprs import check_reprs
from studies.study_rows import LABELS, drawn, rows_of

from geodesic_ocp.studies.statistics import (
    StudyMean,
    StudyTest,
    SynergyStatistics,
    holm,
    rank_biserial,
)
from geodesic_ocp.studies.study import StudyResult

METHODS = tuple(LABELS)


def study_of(*recordings: tuple[str, str, dict[str, float | None]]) -> StudyResult:
    return StudyResult(tuple(row for each in recordings for row in rows_of(*each)))


def test_a_mean_is_that_of_the_subjects_means_however_many_recordings_each_has() -> None:
    """Ann: (1 + 3) / 2 = 2; Bob: 6. Mean 4, SD sqrt(8), where recordings alone give 10 / 3."""
    found = study_of(
        ("a", "Ann", {"riemannian": 1.0}),
        ("b", "Ann", {"riemannian": 3.0}),
        ("c", "Bob", {"riemannian": 6.0}),
    ).means("joint")[0]
    assert (found.mean, found.subjects, found.recordings, found.missing) == (4.0, 2, 3, 0)
    assert found.values == {"Ann": 2.0, "Bob": 6.0}
    assert found.spread == pytest.approx(np.sqrt(8.0))


def test_intervals_are_those_of_the_t_test() -> None:
    recordings, _ = drawn(1, 9, 2)
    found = StudyResult(tuple(recordings)).means("joint", confidence=0.9)[0]
    values = list(found.values.values())
    expected = scipy.stats.ttest_1samp(values, 0.0).confidence_interval(0.9)
    assert found.interval == pytest.approx(tuple(expected))
    assert found.mean == pytest.approx(np.mean(values))


def test_one_subject_has_no_spread_and_says_so() -> None:
    study = study_of(("a", "Ann", {"riemannian": 1.0, "euclidean_same_segments": 2.0}))
    mean = study.means("joint")[0]
    assert mean.spread is None
    assert mean.interval is None
    assert any("One subject only" in note for note in study.notes)
    for table in (study.means_table(), study.test_table()):
        assert "One subject only" in table.note
        assert "nan" not in str(table)
    assert "-" in study.test_table().rows[0]


def test_tests_are_those_of_scipy_over_the_subjects_means() -> None:
    recordings, _ = drawn(2, 8, 3)
    study = StudyResult(tuple(recordings))
    by = {
        method: np.array(
            [
                np.mean(
                    [
                        row["joint_error_rad"]
                        for row in recordings
                        if row["subject"] == subject and row["method"] == method
                    ]
                )
                for subject in study.subjects
            ]
        )
        for method in METHODS
    }
    tests = {each.method: each for each in study.tests()}
    assert set(tests) == {"riemannian", "kinetic_energy"}
    p = []
    for method, test in tests.items():
        difference = by[method] - by["euclidean_same_segments"]
        assert list(test.differences.values()) == pytest.approx(difference)
        p.append(scipy.stats.wilcoxon(difference).pvalue)
        assert test.test.wilcoxon_p == pytest.approx(p[-1])
        assert test.together == 2
    corrected = [each.corrected_p for each in tests.values()]
    assert corrected == pytest.approx([min(1.0, 2.0 * min(p))] * 2 if p[0] == p[1] else holm(p))


def test_subjects_without_a_method_are_left_out_of_the_pairs_and_named() -> None:
    both = {"riemannian": 1.0, "euclidean_same_segments": 2.0}
    study = study_of(
        ("a", "Ann", both),
        ("b", "Bob", {"riemannian": 1.0, "euclidean_same_segments": None}),
        ("c", "Cid", {"riemannian": 1.0}),
        ("d", "Dan", {"riemannian": 1.5, "euclidean_same_segments": 2.0}),
        # Of two recordings of a subject the pair has the one with both numbers.
        ("e", "Dan", {"riemannian": 100.0}),
    )
    (test,) = study.tests()
    assert test.differences == {"Ann": -1.0, "Dan": -0.5}
    assert test.left_out == ("Bob", "Cid")
    assert "Bob, Cid" in study.test_table().note
    lines = study.means("joint")[1]
    assert (lines.subjects, lines.recordings, lines.missing) == (2, 2, 3)
    assert "straight lines, same segments: no result in 3 of 5 recordings." in study.notes
    assert "not all averaged over the same recordings" in study.means_table().note
    complete = study.means("joint", complete=True)
    assert [each.values.keys() for each in complete] == [{"Ann", "Dan"}] * 2
    assert complete[0].mean == 1.25


def test_numbers_that_differ_by_rounding_alone_are_equal() -> None:
    """0.1 + 0.2 is 0.30000000000000004: eight such pairs would give p = 2^-7."""
    errors = {"riemannian": 0.1 + 0.2, "euclidean_same_segments": 0.3}
    (test,) = study_of(*((name, name, errors) for name in "abcdefgh")).tests()
    assert (test.test.ties, test.test.wilcoxon_p, test.effect) == (8, 1.0, 0.0)
    errors["riemannian"] = 0.3 + 1e-9
    (test,) = study_of(*((name, name, errors) for name in "abcdefgh")).tests()
    assert (test.test.losses, test.test.wilcoxon_p) == (8, pytest.approx(2.0**-7))


def test_no_pair_at_all_is_said_in_the_table() -> None:
    study = study_of(
        ("a", "Ann", {"riemannian": 1.0}), ("b", "Bob", {"euclidean_same_segments": 1.0})
    )
    assert study.tests() == ()
    table = study.test_table()
    assert table.rows == ()
    assert "No subject can be compared" in table.note
    with pytest.raises(ValueError, match="no recording has 'joint' of all methods"):
        study.means(complete=True)


def test_conditions_are_apart_and_can_be_compared() -> None:
    """Each subject is 0.5 slower in one condition; the methods' order is the same in both."""
    rows = []
    for k, subject in enumerate(("Ann", "Bob", "Cid")):
        for condition, more in (("slow", 0.0), ("fast", 0.5)):
            errors = {"riemannian": 1.0 + k + more, "euclidean_same_segments": 2.0 + k + more}
            rows += rows_of(f"{subject} {condition}", subject, errors, condition=condition)
    study = StudyResult(tuple(rows), by="condition")
    assert study.conditions == ("fast", "slow")
    means = {(each.condition, each.method): each.mean for each in study.means()}
    assert means["slow", "riemannian"] == 2.0
    assert means["fast", "euclidean_same_segments"] == 3.5
    within = study.tests()
    assert [(each.condition, each.test.mean_difference) for each in within] == [
        ("fast", -1.0),
        ("slow", -1.0),
    ]
    between = study.tests(against="slow")
    assert [(each.method, each.condition) for each in between] == [
        ("riemannian", "fast"),
        ("euclidean_same_segments", "fast"),
    ]
    assert all(each.test.mean_difference == 0.5 and each.effect == -1.0 for each in between)
    assert study.test_table(against="slow").rows[0][0] == "fast"


def test_synergies_are_counted_by_recording_and_second() -> None:
    recordings, synergies = drawn(3, 2, 3)
    study = StudyResult(tuple(recordings), tuple(synergies))
    first = study.synergy_statistics()[0]
    assert (first.recordings, first.synergies) == (3, 6)
    assert first.per_recording == 2.0
    assert first.per_second == pytest.approx(6 / (3 * 2.0))
    durations = [row["duration_s"] for row in synergies if row["subject"] == "S1"]
    assert first.durations == pytest.approx(np.percentile(durations, [5, 25, 50, 75, 95]))
    assert first.lengths == pytest.approx(np.array(first.durations) / 2.0)
    assert study.synergy_table().header[-1] == "length, median (quartiles) [sqrt(kg) m]"


def test_segments_per_second_and_other_measures() -> None:
    study = study_of(("a", "Ann", {"riemannian": 0.1}), ("b", "Bob", {"riemannian": 0.3}))
    assert study.means("segments_per_second")[0].mean == 1.0
    assert study.means("position")[0].mean == pytest.approx(0.1)
    assert study.means("orientation")[0].mean == pytest.approx(0.6)
    with pytest.raises(ValueError, match="measure must be one of joint, position"):
        study.means("speed")
    with pytest.raises(ValueError, match="the table has no joint_error_unfiltered_rad"):
        study.means("joint_unfiltered")
    with pytest.raises(ValueError, match="against must be one of 'riemannian', got 'Ann'"):
        study.tests(against="Ann")
    with pytest.raises(ValueError, match="confidence must be in"):
        study.means(confidence=95)


def test_holm_by_hand() -> None:
    """3 * 0.01, then 2 * 0.02, and 0.03, which must not be below those before it."""
    assert holm([0.03, 0.01, 0.02]) == pytest.approx([0.04, 0.03, 0.04])
    assert holm([0.5, 0.4]) == pytest.approx([0.8, 0.8])


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12))
def test_holm_lies_between_the_p_values_and_bonferroni(p: list[float]) -> None:
    corrected = holm(p)
    assert np.all(corrected >= p)
    assert np.all(corrected <= np.minimum(1.0, len(p) * np.array(p)))
    order = np.argsort(p, kind="stable")
    assert np.all(np.diff(corrected[order]) >= 0.0)


def test_rank_biserial_by_hand() -> None:
    """Ranks 1, 2, 3 of which 3 is positive: (3 - 3) / 6."""
    assert rank_biserial([-1.0, -2.0, 3.0]) == 0.0
    assert rank_biserial([-1.0, -2.0, 0.0]) == 1.0
    assert rank_biserial([1.0, 2.0]) == -1.0
    assert rank_biserial([0.0]) == 0.0


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=6))
def test_rank_biserial_and_the_statistic_of_wilcoxon(differences: list[float]) -> None:
    """W = min(W+, W-) = (1 - |r|) n (n + 1) / 4 of n differences that are not zero."""
    r = rank_biserial(differences)
    assert -1.0 <= r <= 1.0
    assert rank_biserial([-d for d in differences]) == pytest.approx(-r, abs=1e-12)
    unequal = [d for d in differences if d != 0.0]
    if unequal:
        n, statistic = len(unequal), scipy.stats.wilcoxon(unequal).statistic
        assert statistic == pytest.approx((1.0 - abs(r)) * n * (n + 1) / 4.0, abs=1e-9)


@given(st.integers(0, 50), st.randoms(use_true_random=False))
@settings(max_examples=5)
def test_the_order_of_rows_changes_nothing(seed: int, random: object) -> None:
    recordings, synergies = drawn(seed, 4, 2)
    shuffled = [*recordings]
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    one, other = (StudyResult(tuple(rows), tuple(synergies)) for rows in (recordings, shuffled))
    assert one.methods == other.methods
    assert one.means() == other.means()
    assert one.tests() == other.tests()
    assert one.means_table() == other.means_table()
    assert one.synergy_statistics() == other.synergy_statistics()


@given(st.integers(0, 50), st.integers(1, 4))
@settings(max_examples=5)
def test_recordings_that_are_repeated_give_no_more_pairs(seed: int, times: int) -> None:
    """Copies of all recordings of one subject change neither means nor p-values."""
    recordings, _ = drawn(seed, 5, 2)
    copies = [
        {**row, "recording": f"{row['recording']} copy {k}"}
        for k in range(times)
        for row in recordings
        if row["subject"] == "S1"
    ]
    one, more = StudyResult(tuple(recordings)), StudyResult((*recordings, *copies))
    for first, second in zip(one.tests(), more.tests(), strict=True):
        assert first.test.pairs == second.test.pairs == 5
        assert second.test.wilcoxon_p == first.test.wilcoxon_p
        assert second.test.mean_difference == pytest.approx(first.test.mean_difference)
    assert [each.mean for each in more.means()] == pytest.approx([e.mean for e in one.means()])


def test_nameless_subjects_different_settings_and_failures_are_noted() -> None:
    rows = [
        *rows_of("a", "", {"riemannian": 1.0}, settings="1"),
        *rows_of("b", "", {"riemannian": 2.0}, settings="2"),
    ]
    failures = ({"recording": "c", "kind": "file", "reason": "is empty"},)
    study = StudyResult(tuple(rows), None, failures)
    assert study.subjects == ("a.csv", "b.csv")
    assert "2 recordings without the name of a subject" in study.notes[1]
    assert study.notes[0] == ("1 recording left out of the analysis (file that cannot be used: 1).")
    assert "2 different settings" in study.notes[2]


def test_names_that_may_be_of_one_person_are_noted() -> None:
    study = study_of(*((name, name, {"riemannian": 1.0}) for name in ("12", "id_12", "112", "A12")))
    assert [note for note in study.notes if "same person" in note] == [
        "Subjects 12 and id_12 may be the same person."
    ]


def test_reprs_are_short() -> None:
    recordings, synergies = drawn(0, 3, 2)
    study = StudyResult(tuple(recordings), tuple(synergies))
    values = (study, study.means()[0], study.tests()[0], study.synergy_statistics()[0])
    assert {StudyResult, StudyMean, StudyTest, SynergyStatistics} <= check_reprs(values)
