"""Means and tests over subjects, against values computed independently."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st
from pandas.testing import assert_frame_equal
from studies.study_rows import LABELS, drawn, rows_of, study_of_rows

from geodesic_ocp.studies.paired_test import holm, rank_biserial
from geodesic_ocp.studies.study import study
from geodesic_ocp.studies.study_result import StudyResult
from geodesic_ocp.studies.study_tables import write_table

OWN, KINETIC, LINES = LABELS.values()
JOINTS = "joints [rad]"


def study_of(*recordings: tuple[str, str, dict[str, float | None]]) -> StudyResult:
    return study_of_rows(row for each in recordings for row in rows_of(*each))


def test_a_mean_is_that_of_the_subjects_means_however_many_recordings_each_has() -> None:
    """Ann: (1 + 3) / 2 = 2; Bob: 6. Mean 4, SD sqrt(8), where recordings alone give 10 / 3."""
    study = study_of(
        ("a", "Ann", {"riemannian": 1.0}),
        ("b", "Ann", {"riemannian": 3.0}),
        ("c", "Bob", {"riemannian": 6.0}),
    )
    found = study.means("joint").loc[JOINTS, OWN]
    assert found[["mean", "subjects", "recordings", "missing"]].tolist() == [4.0, 2, 3, 0]
    assert found["SD"] == pytest.approx(np.sqrt(8.0))
    assert study.by_subject()[OWN].to_dict() == {"Ann": 2.0, "Bob": 6.0}


def test_intervals_are_those_of_the_t_test() -> None:
    study = study_of_rows(drawn(1, 9, 2)[0])
    found = study.means("joint", confidence=0.9).loc[JOINTS, OWN]
    values = study.by_subject()[OWN]
    expected = scipy.stats.ttest_1samp(values, 0.0).confidence_interval(0.9)
    assert found[["90% low", "90% high"]].tolist() == pytest.approx([*expected])
    assert found["mean"] == pytest.approx(np.mean(values))


def test_an_interval_of_errors_needs_three_people_and_stays_above_zero() -> None:
    values = {"a": 0.01, "b": 0.01, "c": 0.1}
    people = [(name, name, {"riemannian": value}) for name, value in values.items()]
    found = study_of(*people).means("joint").loc[JOINTS, OWN]
    half = scipy.stats.t.ppf(0.975, 2) * np.std([*values.values()], ddof=1) / np.sqrt(3.0)
    assert found["mean"] < half
    assert (found["95% low"], found["95% high"]) == pytest.approx((0.0, 0.04 + half))
    two = study_of(*people[:2]).means("joint")
    assert two.loc[:, "95% low":"95% high"].isna().all(axis=None)


def test_one_subject_has_no_spread_and_says_so() -> None:
    study = study_of(("a", "Ann", {"riemannian": 1.0, "euclidean_same_segments": 2.0}))
    mean = study.means("joint").iloc[0]
    assert mean[["SD", "95% low", "95% high"]].isna().all()
    for said in (study.notes, study.means().attrs["note"], study.tests().attrs["note"]):
        assert "One subject only" in str(said)
    assert study.tests().iloc[0]["subjects"] == 1


def test_tests_are_those_of_scipy_over_the_subjects_means() -> None:
    recordings, _ = drawn(2, 8, 3)
    study = study_of_rows(recordings)
    by = {
        label: np.array(
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
        for method, label in LABELS.items()
    }
    tests = study.tests()
    assert [*tests.index] == [OWN, KINETIC]
    p = []
    for label, test in tests.iterrows():
        difference = by[label] - by[LINES]
        assert test["mean difference [rad]"] == pytest.approx(difference.mean())
        p.append(scipy.stats.wilcoxon(difference).pvalue)
        assert test["Wilcoxon p"] == pytest.approx(p[-1])
        assert test["effect"] == rank_biserial(difference)
    assert tests["p, Holm"].tolist() == pytest.approx(holm(p))


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
    tests = study.tests()
    assert tests["mean difference [rad]"].tolist() == [(-1.0 - 0.5) / 2.0]
    assert tests[["subjects", "left out"]].to_numpy().tolist() == [[2, 2]]
    assert "Left out, without a pair: Bob, Cid." in tests.attrs["note"]
    means = study.means("joint")
    lines = means.loc[JOINTS, LINES]
    assert lines[["subjects", "recordings", "missing"]].tolist() == [2, 2, 3]
    assert "straight lines, same segments: no result in 3 of 5 recordings." in study.notes
    assert "not all averaged over the same recordings" in means.attrs["note"]
    complete = study.means("joint", complete=True)
    assert complete["subjects"].tolist() == [2, 2]
    assert complete.loc[(JOINTS, OWN), "mean"] == 1.25


def test_numbers_that_differ_by_rounding_alone_are_equal() -> None:
    """0.1 + 0.2 is 0.30000000000000004: eight such pairs would give p = 2^-7."""
    errors = {"riemannian": 0.1 + 0.2, "euclidean_same_segments": 0.3}
    columns = ["smaller in", "larger in", "effect"]
    test = study_of(*((name, name, errors) for name in "abcdefgh")).tests().iloc[0]
    assert test[[*columns, "Wilcoxon p"]].tolist() == [0, 0, 0.0, 1.0]
    errors["riemannian"] = 0.3 + 1e-9
    test = study_of(*((name, name, errors) for name in "abcdefgh")).tests().iloc[0]
    assert test[[*columns, "Wilcoxon p"]].tolist() == [0, 8, -1.0, pytest.approx(2.0**-7)]


def test_no_pair_at_all_is_said_in_the_table() -> None:
    study = study_of(
        ("a", "Ann", {"riemannian": 1.0}), ("b", "Bob", {"euclidean_same_segments": 1.0})
    )
    tests = study.tests()
    assert tests.empty
    assert {"against", "subjects", "mean difference [rad]", "p, Holm"} <= set(tests.columns)
    assert {"against", "sign test p", "Wilcoxon p", "p, Holm"} <= {*tests.columns}
    assert "No subject can be compared" in tests.attrs["note"]
    with pytest.raises(ValueError, match="no recording has 'joint' of all methods"):
        study.means(complete=True)


def test_conditions_are_apart_and_can_be_compared() -> None:
    """Each subject is 0.5 slower in one condition; the methods' order is the same in both."""
    rows = []
    for k, subject in enumerate(("Ann", "Bob", "Cid")):
        for condition, more in (("slow", 0.0), ("fast", 0.5)):
            errors = {"riemannian": 1.0 + k + more, "euclidean_same_segments": 2.0 + k + more}
            rows += rows_of(f"{subject} {condition}", subject, errors, condition=condition)
    study = study_of_rows(rows, by="condition")
    assert study.conditions == ("fast", "slow")
    means = study.means("joint")["mean"]
    assert means.index.names == ["measure", "condition", "method"]
    assert means[JOINTS, "slow", OWN] == 2.0
    assert means[JOINTS, "fast", LINES] == 3.5
    within = study.tests()["mean difference [rad]"]
    assert within.to_dict() == {("fast", OWN): -1.0, ("slow", OWN): -1.0}
    between = study.tests(against="slow")
    assert [*between.index] == [("fast", OWN), ("fast", LINES)]
    assert (between["mean difference [rad]"] == 0.5).all()
    assert (between["effect"] == -1.0).all()


def test_synergies_are_counted_by_recording_and_second() -> None:
    recordings, synergies = drawn(3, 2, 3)
    table = study_of_rows(recordings, synergies).synergy_statistics()
    assert [*table.index] == ["S1", "S2", "mean over subjects"]
    first = table.loc["S1"]
    assert first[["recordings", "synergies", "per recording"]].tolist() == [3, 6, 2.0]
    assert first["per second [1/s]"] == pytest.approx(6 / (3 * 2.0))
    durations = [row["duration_s"] for row in synergies if row["subject"] == "S1"]
    found = first[[f"duration, {level}% [s]" for level in (25, 50, 75)]]
    assert found.tolist() == pytest.approx(np.percentile(durations, [25, 50, 75]))
    assert first["length, 50% [sqrt(kg) m]"] == pytest.approx(found.iloc[1] / 2.0)


def test_subjects_without_a_value_keep_their_row() -> None:
    study = study_of(("a", "Ann", {"riemannian": 1.0}), ("b", "Bob", {"riemannian": None}))
    rows = study.by_subject()
    assert rows["recordings"].to_dict() == {"Ann": 1, "Bob": 1}
    assert rows[OWN].isna().to_dict() == {"Ann": False, "Bob": True}


def test_segments_per_second_and_other_measures() -> None:
    study = study_of(("a", "Ann", {"riemannian": 0.1}), ("b", "Bob", {"riemannian": 0.3}))
    means = study.means("segments_per_second", "position", "orientation")["mean"]
    assert means.droplevel("method").to_dict() == pytest.approx(
        {"segments per second [1/s]": 1.0, "hand [m]": 0.1, "hand [rad]": 0.6}
    )
    with pytest.raises(ValueError, match="measure must be one of joint, position"):
        study.means("speed")
    with pytest.raises(ValueError, match="the table has no joint_error_unfiltered_rad"):
        study.means("joint_unfiltered")
    with pytest.raises(ValueError, match="against must be one of 'riemannian', got 'Ann'"):
        study.tests(against="Ann")
    with pytest.raises(ValueError, match="confidence must be in"):
        study.means(confidence=95)


@pytest.mark.slow
def test_a_rate_of_segments_needs_a_duration(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    errors = {"riemannian": 0.1, "euclidean_same_segments": 0.2}
    study = study_of_rows(rows_of("a", "Ann", errors, duration_s=0.0))
    with pytest.raises(ValueError, match="'segments_per_second': the table has no segments"):
        study.means("segments_per_second")
    names = {file.name for file in study.save(tmp_path / "paper")}
    assert "by_subject_segments.csv" in names
    assert "by_subject_segments_per_second.csv" not in names


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
    assert rank_biserial([-1.0, -2.0, 0.0]) == 1.0


@pytest.mark.slow
@given(st.integers(0, 50), st.randoms(use_true_random=False))
@settings(max_examples=1)
def test_the_order_of_rows_changes_nothing(seed: int, random: object) -> None:
    recordings, synergies = drawn(seed, 4, 2)
    shuffled = [*recordings]
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    one, other = (study_of_rows(rows, synergies) for rows in (recordings, shuffled))
    assert one.methods == other.methods
    assert_frame_equal(one.means(), other.means())
    assert_frame_equal(one.tests(), other.tests())
    assert_frame_equal(one.synergy_statistics(), other.synergy_statistics())


@pytest.mark.slow
def test_recordings_that_are_repeated_give_no_more_pairs() -> None:
    """Copies of all recordings of one subject change neither means nor p-values."""
    recordings, _ = drawn(7, 5, 2)
    copies = [
        {**row, "recording": f"{row['recording']} copy {k}"}
        for k in range(3)
        for row in recordings
        if row["subject"] == "S1"
    ]
    one, more = study_of_rows(recordings), study_of_rows([*recordings, *copies])
    columns = ["subjects", "mean difference [rad]", "Wilcoxon p"]
    assert_frame_equal(one.tests()[columns], more.tests()[columns])
    assert_frame_equal(one.means()[["mean"]], more.means()[["mean"]])


def test_errors_over_a_part_of_the_segments_are_no_part_of_means_and_tests() -> None:
    """They would be compared with errors of other methods over all segments."""
    both = {"riemannian": 1.0, "kinetic_energy": 2.0}
    few = {"riemannian": 1.0, "kinetic_energy": 0.1}
    rows = [*rows_of("a", "Ann", both), *rows_of("b", "Bob", few)]
    rows[-1] |= {"segments": 8, "segments_found": 7}
    study = study_of_rows(rows)
    kinetic = study.means("joint").loc[JOINTS, "geodesics, kinetic energy"]
    assert kinetic[["mean", "recordings", "missing"]].tolist() == [2.0, 1, 1]
    (note,) = (each for each in study.notes if "kinetic energy: no result in 1 of 2" in each)
    (part,) = (each for each in study.notes if "7 of 8 segments" in each)
    assert study.notes.index(part) == study.notes.index(note) + 1
    counts = study.means("segments").loc["segments", "geodesics, kinetic energy"]
    assert counts["mean"] == 5.0


def test_nameless_subjects_different_settings_and_failures_are_noted() -> None:
    rows = [
        *rows_of("a", "", {"riemannian": 1.0}, settings="1"),
        *rows_of("b", "", {"riemannian": 2.0}, settings="2"),
    ]
    failures = ({"recording": "c", "kind": "file", "reason": "is empty"},)
    study = study_of_rows(rows, None, failures)
    assert study.subjects == ("a.csv", "b.csv")
    assert "2 recordings without the name of a subject" in study.notes[1]
    assert study.notes[0] == ("1 recording left out of the analysis (file that cannot be used: 1).")
    assert "2 different settings" in study.notes[2]


def test_names_that_may_be_of_one_person_are_noted() -> None:
    study = study_of(*((name, name, {"riemannian": 1.0}) for name in ("12", "id_12", "112", "A12")))
    assert [note for note in study.notes if "same person" in note] == [
        "Subjects 12 and id_12 may be the same person."
    ]


def test_the_spread_under_noise_is_stated_where_it_is_known() -> None:
    spread = {"segments_low": 1, "segments_high": 4, "stable_cuts": 1}
    spread |= {"joint_error_low_rad": 0.02, "joint_error_high_rad": 0.05}
    rows = rows_of("a", "A", {"riemannian": 0.03}, **spread)
    notes = study_of_rows([*rows, *rows_of("b", "B", {"riemannian": 1.0})]).notes
    (note,) = (each for each in notes if "own noise" in each)
    assert "1 recording, 90 %" in note
    assert "1.0 to 4.0 synergies, where the analyses have 2.0" in note
    assert "0.02 to 0.05 rad, where they have 0.03; 1 of 1 cuts are stable" in note


def test_methods_of_second_order_are_tested_against_what_receives_the_same() -> None:
    names = "riemannian", "euclidean_same_segments", "riemannian_cubics", "minimum_acceleration"
    errors = dict(zip(names, (1.0, 2.0, 0.5, 0.7), strict=True))
    study = study_of(("a", "Ann", errors), ("b", "Bob", errors))
    tests = study.tests()
    assert dict(tests["against"]) == {OWN: LINES, "riemannian_cubics": "minimum_acceleration"}
    assert tests["mean difference [rad]"].tolist() == pytest.approx([-1.0, -0.2])
    everything = study.tests(against="minimum_acceleration")
    assert set(everything["against"]) == {"minimum_acceleration"}
    assert len(everything) == 3


@pytest.mark.slow
def test_a_passive_arm_is_left_out_and_said_to_be(tmp_path: Path) -> None:
    """Unless all are passive, as then nothing would remain."""

    def found(*ranges: float) -> StudyResult:
        rows = [
            row
            for name, moved in zip("abc", ranges, strict=True)
            for row in rows_of(name, name.upper(), {"riemannian": 1.0}, range_rad=moved)
        ]
        return study(write_table(tmp_path, "recordings", rows)[0])

    some = found(1.9, 0.3, 1.2)
    assert list(some.recordings["recording"]) == ["a", "c"]
    assert list(some.failures["kind"]) == ["passive"]
    assert any("passive arm" in note for note in some.notes)
    assert len(found(0.3, 0.3, 0.3).recordings) == 3
