"""Methods on the same segments of recordings."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from known_models import planar_arm
from table_rows import header_of, rows_of_table

import geodesic_ocp as go
from geodesic_ocp.manifold.exp import sample_geodesic
from geodesic_ocp.studies.compare_methods import MethodComparison
from geodesic_ocp.synergies.scores import SCORES

TIME = np.linspace(0.0, 1.0, 61)
LINES = "straight lines"


def metrics() -> dict[str, Callable[[go.Model], go.Metric]]:
    return {"kinetic energy": go.KineticEnergy, LINES: lambda model: go.Euclidean(model.dof)}


@pytest.fixture(scope="module")
def rods() -> go.Model:
    return planar_arm((1.0, 1.0), (1.0, 1.0), (0.5, 0.5), (0.1, 0.1))


@pytest.fixture(scope="module")
def recordings(rods: go.Model) -> list[go.trajectory.Recording]:
    """Two persons move along geodesics of the kinetic energy, with a cubic time law."""
    metric = go.KineticEnergy(rods)
    starts = [((0.2, 0.9), (1.0, 0.9)), ((0.4, 1.4), (-0.9, -0.8)), ((-0.3, 0.8), (1.2, -0.4))]
    found = []
    for index, (q, v) in enumerate(starts):
        fraction = TIME + 0.3 * TIME**2 - 0.2 * TIME**3
        rate = 1.0 + 0.6 * TIME - 0.6 * TIME**2
        path, slopes = sample_geodesic(metric, np.array(q), np.array(v), fraction, tolerance=1e-12)
        motion = go.Motion(TIME, path, rods.joint_names, slopes * rate[:, None])
        found.append(go.trajectory.Recording(rods, motion, f"reach {index}", "ab"[index // 2]))
    return found


@pytest.fixture(scope="module")
def comparison(recordings: list[go.trajectory.Recording]) -> MethodComparison:
    return go.studies.compare_methods(recordings, metrics())


@pytest.mark.slow
def test_geodesics_win_where_people_move_along_them(
    comparison: MethodComparison,
) -> None:
    assert comparison.segments == 3 * (((0, 60),),)
    errors = comparison.values("joint_mean")
    assert errors[:, 0] == pytest.approx(0.0, abs=1e-7)
    # So do Riemannian cubics: on a geodesic, a cubic law of time satisfies their equation.
    exact = [name.startswith("Riemannian") for name in comparison.methods]
    assert errors[:, exact] == pytest.approx(0.0, abs=1e-7)
    # The others receive as much of the recording, or more, and still miss it.
    assert np.delete(errors, exact, axis=1)[:, 1:].min() > 1e-3
    test = comparison.tests(by="recording")["kinetic energy"]
    assert (test.wins, test.pairs) == (3, 3)
    assert "3 pairs that differ cannot reach p < 0.05" in test.note
    reverse = comparison.tests(against="kinetic energy", by="recording")[LINES]
    assert reverse.mean_difference == pytest.approx(-test.mean_difference)


@pytest.mark.slow
def test_recordings_of_a_subject_are_one_pair(comparison: MethodComparison) -> None:
    tests = comparison.tests("position_mean")
    assert list(tests) == [name for name in comparison.methods if name != LINES]
    assert {test.pairs for test in tests.values()} == {2}


def test_a_higher_correlation_wins(comparison: MethodComparison) -> None:
    values = comparison.values("speed_correlation")
    test = comparison.tests("speed_correlation", by="recording")["kinetic energy"]
    assert test.wins == np.sum(values[:, 0] > values[:, 1]) > 0


def test_scores_are_those_of_the_methods(
    comparison: MethodComparison,
    recordings: list[go.trajectory.Recording],
    rods: go.Model,
) -> None:
    motion = recordings[1].motion
    cubic = go.baselines.minimum_acceleration(motion, [(0, 60)])
    expected = go.synergies.score(rods, motion, cubic, [(0, 60)])
    assert comparison.scores["minimum acceleration"][1] == expected
    straight = go.synergies.reconstruct(go.Euclidean(2), motion, [(0, 60)]).predicted
    assert comparison.values("area")[1, 1] == go.synergies.score(rods, motion, straight).area


@pytest.mark.slow
def test_the_first_metric_cuts_unless_segments_are_given(
    recordings: list[go.trajectory.Recording],
) -> None:
    lines = {LINES: lambda model: go.Euclidean(model.dof)}
    cut = go.studies.compare_methods(
        recordings[:1], lines, segments=partial(go.segment, threshold=0.1)
    )
    assert list(cut.segments[0]) == go.segment(go.Euclidean(2), recordings[0].motion, 0.1)
    assert len(cut.segments[0]) > 1
    given = go.studies.compare_methods(
        recordings[:2], lines, segments=[[(0, 20), (20, 60)], [(0, 60)]]
    )
    assert given.segments == (((0, 20), (20, 60)), ((0, 60),))
    whole = go.studies.compare_methods(recordings[:1], lines, segments=[[(0, 60)]])
    assert given.values()[0, 0] < whole.values()[0, 0]


def test_tables(comparison: MethodComparison) -> None:
    table = comparison.table()
    assert [row[0] for row in rows_of_table(table)] == list(comparison.methods)
    assert {row[2:4] for row in rows_of_table(table)} == {("3 of 3", 3)}
    assert rows_of_table(table)[0][1] == "2 configurations, 2 speeds"
    assert rows_of_table(table)[3][1] == "2 configurations, 2 velocities"
    assert rows_of_table(table)[1][4] == pytest.approx(comparison.values()[:, 1].mean())
    everything = comparison.table(*SCORES)
    assert header_of(everything)[4:] == tuple(SCORES.values())
    each = comparison.by_recording("area")
    assert header_of(each)[:3] == ("area [m^2]", "subject", "segments")
    assert rows_of_table(each)[2][:3] == ("reach 2", "b", 1)
    tests = comparison.test_table("area", by="recording")
    assert header_of(tests)[2] == "mean difference [m^2]"
    assert rows_of_table(tests)[0][1] == "3 of 3"
    assert "note" not in header_of(tests)
    assert tests.attrs["note"].count("3 pairs that differ cannot reach") == 1


def test_a_method_that_fails_is_left_out(
    recordings: list[go.trajectory.Recording], rods: go.Model
) -> None:
    """Of the means on all methods, and of its tests, which say so."""
    other = planar_arm((1.0, 1.0), (1.0, 2.0), (0.5, 0.5), (0.1, 0.1))
    renamed = go.trajectory.Recording(other, recordings[2].motion, "reach 2", "b")

    def fails(model: go.Model) -> go.Metric:
        if model is other:
            raise go.NotConverged("no geodesic was found")
        return go.Euclidean(model.dof)

    mixed = [*recordings[:2], renamed]
    lines = {LINES: lambda model: go.Euclidean(model.dof), "fails": fails}
    with pytest.warns(UserWarning, match="reach 2: fails failed: no geodesic was found"):
        found = go.studies.compare_methods(mixed, lines)
    assert found.failures == (("reach 2", "fails", "no geodesic was found"),)
    assert np.isnan(found.values("area")[2, 1])
    assert not np.isnan(np.delete(found.values("area").ravel(), 2 * len(found.methods) + 1)).any()
    segments = len(found.segments[0]) + len(found.segments[1])
    assert {row[2:4] for row in rows_of_table(found.table())} == {("2 of 3", segments)}
    assert rows_of_table(found.table())[0][4] == pytest.approx(found.values()[:2, 0].mean())
    test = found.tests(by="recording")["fails"]
    assert (test.pairs, test.left_out) == (2, 1)
    assert "1 pair left out (NaN)" in test.note
    with pytest.warns(UserWarning, match="fails failed"):
        nothing = go.studies.compare_methods([renamed], lines)
    assert "fails" not in nothing.tests()
    assert all(np.isnan(row[4]) for row in rows_of_table(nothing.table()))


@pytest.mark.slow
def test_one_recording_needs_no_list(recordings: list[go.trajectory.Recording]) -> None:
    alone, listed = (
        go.studies.compare_methods(given, metrics()) for given in (recordings[0], recordings[:1])
    )
    assert np.array_equal(alone.values(), listed.values())
    assert alone.recordings == listed.recordings


@pytest.mark.slow
def test_default_metrics(recordings: list[go.trajectory.Recording], arm: go.Model) -> None:
    """The control of the distal joints is known of human arms alone."""
    of_rods = go.studies.compare_methods(recordings[:1])
    assert of_rods.methods[:3] == ("kinetic energy with joint inertia", "kinetic energy", LINES)
    q = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1]) + 0.2 * np.sin(TIME)[:, None]
    motion = go.Motion(TIME, q, arm.joint_names).filtered()
    seen: list[tuple[int, int]] = []
    of_arm = go.studies.compare_methods(
        [go.trajectory.Recording(arm, motion)],
        progress=lambda label, done, total: seen.append((done, total)),
    )
    assert len(of_arm.methods) == 10
    assert of_arm.methods[2] == "joint inertia of distal joints alone"
    assert seen == [(done, 11) for done in range(12)]
    assert np.isfinite(of_arm.values()).all()


def test_bad_arguments_are_named(
    recordings: list[go.trajectory.Recording], comparison: MethodComparison
) -> None:
    motion: Any = recordings[0].motion
    for wrong in ([], [motion], motion):
        with pytest.raises(ValueError, match=r"must be one or more of go\.trajectory\.Recording"):
            go.studies.compare_methods(wrong)
    with pytest.raises(ValueError, match=r"segments must be pairs \(start, stop\), got \(0, 60\)"):
        go.studies.compare_methods(recordings[0], metrics(), segments=[(0, 60)])  # type: ignore[list-item]
    with pytest.raises(ValueError, match="metrics must be at least one"):
        go.studies.compare_methods(recordings, {})
    with pytest.raises(ValueError, match="metrics must have names"):
        go.studies.compare_methods(recordings, [go.Euclidean(2)])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="'lines' must be a metric, or a function"):
        go.studies.compare_methods(recordings, {"lines": 2})  # type: ignore[dict-item]
    with pytest.raises(ValueError, match="minimum jerk is the name of a baseline"):
        go.studies.compare_methods(recordings, {"minimum jerk": go.Euclidean(2)})
    with pytest.raises(ValueError, match="metric must be an instance of a Metric class"):
        go.studies.compare_methods(recordings, {"model": lambda model: model})
    with pytest.raises(ValueError, match="segments must be given for each of 3 recordings, got 1"):
        go.studies.compare_methods(recordings, metrics(), segments=[[(0, 60)]])
    still = go.Motion(TIME, np.ones((61, 2)), ("joint1", "joint2"), np.zeros((61, 2)))
    resting = go.trajectory.Recording(recordings[0].model, still, "a rest")
    with pytest.raises(ValueError, match="a rest: the motion never moves"):
        go.studies.compare_methods([*recordings, resting], metrics())
    with pytest.raises(ValueError, match=r"score must be one of joint_mean, .*, got 'speed'"):
        comparison.table("speed")
    with pytest.raises(ValueError, match="against must be one of kinetic energy, straight lines"):
        comparison.tests(against="lines")
    with pytest.raises(ValueError, match="by must be 'subject' or 'recording', got 'segment'"):
        comparison.tests(by="segment")


EFFORTS = ("least torque", "least torque change", "least work", "least work and acceleration")


@pytest.mark.slow
def test_motions_of_least_effort_are_computed_on_request(
    comparison: MethodComparison, recordings: list[go.trajectory.Recording]
) -> None:
    """In a flat metric, least torque is minimum acceleration."""
    assert not set(EFFORTS) & set(comparison.methods)
    flat = {"flat": lambda model: go.Euclidean(model.dof)}
    chosen = ["minimum acceleration", *EFFORTS]
    found = go.studies.compare_methods(
        recordings[0], flat, methods=chosen, segments=[[(0, 20), (20, 60)]]
    )
    assert found.methods == ("flat", *chosen)
    errors = dict(zip(found.methods, found.values()[0], strict=True))
    assert errors["least torque"] == pytest.approx(errors["minimum acceleration"], rel=1e-6)
    assert len({round(errors[name], 6) for name in EFFORTS}) == len(EFFORTS)
    received = {found.observed[name].partition(";")[0] for name in EFFORTS}
    assert received == {"2 configurations, 2 velocities"}
    for wrong in ("least torque", ["minimum snap"]):
        with pytest.raises(ValueError, match="methods must be some of Riemannian cubics, "):
            go.studies.compare_methods(recordings, metrics(), methods=wrong)


@pytest.mark.slow
def test_geodesics_need_the_fewest_numbers_where_people_move_along_them(
    recordings: list[go.trajectory.Recording],
) -> None:
    found = go.studies.compare_at_equal_numbers(
        recordings[:2], go.KineticEnergy, numbers=(7.0, 12.0), spacing=0.25
    )
    # n + 1 = 3 numbers at both ends of a recording of 1 s, 2 n = 4 for cubics and splines.
    assert np.isfinite(found.errors[:2, :, 0]).all()
    assert np.isnan(found.errors[2:, :, 0]).all()
    assert found.errors[0] == pytest.approx(0.0, abs=1e-7)
    assert found.errors[1].min() > 1e-4
    assert header_of(found.table()) == (
        "method",
        "7 per s [rad]",
        "7 per s, best of 0",
        "12 per s [rad]",
        "12 per s, best of 2",
    )
    # A geodesic with a cubic time law is a Riemannian cubic: both are exact up to rounding.
    assert found.wins[[0, 2, 4], 1].sum() == 2
    with pytest.raises(ValueError, match="numbers must be positive"):
        go.studies.compare_at_equal_numbers(recordings, numbers=(0.0,))
    with pytest.raises(ValueError, match="recordings must be one or more"):
        go.studies.compare_at_equal_numbers([])
