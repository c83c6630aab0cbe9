"""Analyses and fits of markers as scenes: what is drawn agrees with the numbers of the result."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from marked_motion import HEIGHT, MMM_MARKERS, angles, marked

import geodesic_ocp as go
from geodesic_ocp.drawing.playback_of import playback_of
from geodesic_ocp.drawing.recording_scenes import (
    CUTS,
    analysis_playback,
    fitted_positions,
    marker_fit_playback,
    markers_playback,
)
from geodesic_ocp.drawing.scene import Playback
from geodesic_ocp.recordings.markers.fit_markers import fit_markers
from geodesic_ocp.recordings.markers.marker_fit import MarkerFit
from geodesic_ocp.recordings.markers.markers import Markers


@pytest.fixture(scope="module")
def climb(bundled_analysis: go.synergies.Analysis) -> Playback:
    return analysis_playback(bundled_analysis)


@pytest.mark.slow
def test_observed_and_predicted_arm_meet_at_the_cuts(
    climb: Playback, bundled_analysis: go.synergies.Analysis
) -> None:
    (scene,) = climb.scenes
    observed, predicted = (
        next(actor for actor in scene.actors if actor.name == name)
        for name in ("observed", "predicted")
    )
    assert (observed.role, observed.translucent) == ("observed", False)
    assert (predicted.role, predicted.translucent) == ("predicted", True)
    cuts = [start for start, _ in bundled_analysis.segments]
    apart = np.linalg.norm(
        observed.positions["left hand"] - predicted.positions["left hand"], axis=1
    )
    assert apart[cuts].max() < 1e-6
    assert apart.max() > 1e-3


@pytest.mark.slow
def test_cuts_are_marked_on_the_path_of_the_hand(
    climb: Playback, bundled_analysis: go.synergies.Analysis
) -> None:
    (scene,) = climb.scenes
    (cloud,) = scene.clouds
    path = next(trail for trail in scene.trails if trail.name == "hand, observed").points
    samples = [0, *(stop for _, stop in bundled_analysis.segments)]
    np.testing.assert_allclose(cloud.positions[0], path[samples], atol=1e-12)
    assert cloud.layer == CUTS


def test_spans_are_the_synergies(climb: Playback, bundled_analysis: go.synergies.Analysis) -> None:
    spans = climb.spans["synergies"]
    assert len(spans) == len(bundled_analysis.synergies)
    for number, (span, synergy) in enumerate(
        zip(spans, bundled_analysis.synergies, strict=True), 1
    ):
        assert (span.name, span.start) == (str(number), synergy.start_time)
        assert span.stop - span.start == pytest.approx(synergy.duration)
        assert span.text == f"synergy {number} ({synergy.duration:.2f} s)"
        assert span.cut is None


@pytest.mark.slow
def test_spans_say_how_sure_their_cuts_are(bundled_analysis: go.synergies.Analysis) -> None:
    uncertainty = bundled_analysis.uncertainty(2)
    stable = uncertainty.stable
    _, *spans = playback_of(bundled_analysis, uncertainty).spans["synergies"]
    assert 0 < stable.sum() < len(stable)
    for span, sure in zip(spans, stable, strict=True):
        assert span.cut == ("stable" if sure else "doubtful")
        assert span.text.endswith(f", {span.cut} cut before it")
    # An analysis does not remember it.
    assert all(span.cut is None for span in playback_of(bundled_analysis).spans["synergies"])


def test_every_other_prediction_is_a_layer_that_is_off_at_first(
    climb: Playback, bundled_analysis: go.synergies.Analysis
) -> None:
    (scene,) = climb.scenes
    labels = bundled_analysis.labels()
    styles = set()
    for method, label in labels.items():
        if method == "riemannian":
            continue
        assert label in climb.hidden
        overlay = next(actor for actor in scene.actors if actor.layer == label)
        q = bundled_analysis.predictions[method].q
        expected = bundled_analysis.model.frame_pose("left hand", q)[1]
        np.testing.assert_allclose(overlay.positions["left hand"], expected, atol=1e-12)
        assert overlay.translucent
        assert {trail.role for trail in scene.trails if trail.layer == label} == {overlay.role}
        styles.add(overlay.role)
    assert len(styles) == len(labels) - 1
    assert not {"observed", "predicted"} & styles
    assert not {"predicted", "hand path", CUTS} & set(climb.hidden)


def test_curves_of_errors_have_the_means_of_the_table(
    climb: Playback, bundled_analysis: go.synergies.Analysis
) -> None:
    plots = {plot.label: plot for plot in climb.plots}
    methods, labels = bundled_analysis.on_same_segments(), bundled_analysis.labels()
    for label, scale, field in (
        ("mean joint error [rad]", 1.0, "joint"),
        ("hand error [mm]", 1000.0, "position"),
    ):
        curves = {curve.name: curve for curve in plots[label].curves}
        for method, name in methods.items():
            errors = bundled_analysis.errors[method]
            expected = scale * getattr(errors, field)
            assert np.mean(curves[name].values) == pytest.approx(expected, rel=1e-6)
    speeds = plots["hand speed [m/s]"].curves
    assert [curve.role for curve in speeds if not curve.layer] == ["observed", "predicted"]
    # The others are switched on with what they predict in three dimensions.
    assert {curve.layer for curve in speeds} - {""} == set(climb.hidden) & set(labels.values())


def test_methods_without_a_geodesic_are_left_out(bundled_analysis: go.synergies.Analysis) -> None:
    lacking = replace(
        bundled_analysis,
        not_found=("kinetic_energy",),
        predictions={
            method: motion
            for method, motion in bundled_analysis.predictions.items()
            if method != "kinetic_energy"
        },
    )
    playback = analysis_playback(lacking)
    assert "geodesics, kinetic energy" not in playback.scenes[0].layers
    assert all(sum(not curve.layer for curve in plot.curves) == 2 for plot in playback.plots)


@pytest.mark.slow
def test_both_hands_of_a_person_are_shown() -> None:
    person = go.human_upper_body()
    time = np.arange(31) / 100.0
    q = angles(person, time)
    motion = go.Motion(time, q, person.joint_names, np.gradient(q, time, axis=0))
    playback = analysis_playback(
        go.analyse(person, motion, metric="euclidean", segments=[(0, 15), (15, 30)])
    )
    (scene,) = playback.scenes
    names = {trail.name for trail in scene.trails if trail.layer == "hand path"}
    assert names == {
        f"{side} hand, {what}" for side in ("left", "right") for what in ("observed", "predicted")
    }
    labels = [(plot.label, plot.title) for plot in playback.plots]
    assert ("right hand error [mm]", "predictions on the same segments") in labels
    assert ("hand speed [m/s]", "left hand") in labels
    assert len(scene.clouds) == 2


@pytest.fixture(scope="module")
def walker() -> Markers:
    arm, time = go.human_arm("right", HEIGHT), np.arange(30) / 30.0
    markers = marked(arm, angles(arm, time), time, MMM_MARKERS)
    noise = 0.002 * np.random.default_rng(0).normal(size=markers.positions.shape)
    positions = markers.positions + noise
    positions[3:6, 2] = np.nan
    return replace(markers, positions=positions)


@pytest.fixture(scope="module")
def fit(walker: Markers) -> MarkerFit:
    return fit_markers(go.human_arm("right", HEIGHT), walker, estimate=())


@pytest.mark.slow
def test_markers_on_the_person_are_as_far_away_as_the_fit_says(
    fit: MarkerFit, walker: Markers
) -> None:
    columns = [walker.names.index(name) for name in fit.names]
    apart = np.linalg.norm(fitted_positions(fit) - walker.positions[:, columns], axis=2)
    np.testing.assert_allclose(apart, fit.errors, atol=1e-9)


@pytest.mark.slow
def test_the_person_is_among_the_markers(fit: MarkerFit, walker: Markers) -> None:
    playback = marker_fit_playback(fit, walker)
    (scene,) = playback.scenes
    assert [actor.translucent for actor in scene.actors] == [False, True]  # not fitted
    clouds = {cloud.name: cloud for cloud in scene.clouds}
    np.testing.assert_array_equal(clouds["recorded markers"].positions, walker.positions)
    np.testing.assert_allclose(clouds["markers on the person"].positions, fitted_positions(fit))
    assert fit.base is not None
    _, moved = fit.model.hand_pose(fit.motion.q)
    hand = np.einsum("kij,kj->ki", fit.base.rotations, moved) + fit.base.positions
    np.testing.assert_allclose(scene.trails[0].points, hand, atol=1e-9)
    mean, largest = playback.plots[0].curves
    np.testing.assert_allclose(mean.values, 1000.0 * np.nanmean(fit.errors, axis=1))
    np.testing.assert_allclose(largest.values, 1000.0 * np.nanmax(fit.errors, axis=1))


@pytest.mark.slow
def test_markers_of_another_time_are_refused(fit: MarkerFit, walker: Markers) -> None:
    later = Markers(walker.time + 0.5, walker.names, walker.positions)
    with pytest.raises(ValueError, match="were not recorded at the times of the fit"):
        marker_fit_playback(fit, later)


def test_markers_alone_are_points(walker: Markers) -> None:
    (scene,) = markers_playback(walker).scenes
    np.testing.assert_array_equal(scene.clouds[0].positions, walker.positions)
    assert scene.clouds[0].labels == walker.names
