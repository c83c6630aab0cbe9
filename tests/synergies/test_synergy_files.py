"""JSON files of synergies."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import geodesic_ocp as go


def test_synergies_are_saved_and_loaded(
    bundled_analysis: go.synergies.Analysis, tmp_path: Path
) -> None:
    joint_names, synergies = bundled_analysis.motion.joint_names, bundled_analysis.synergies[:3]
    file = tmp_path / "synergies.json"
    go.synergies.save_synergies(file, synergies, joint_names)
    record = json.loads(file.read_text())
    assert record["segments"] == [list(segment) for segment in bundled_analysis.segments[:3]]
    assert record["joint_names"] == list(joint_names)
    loaded = go.synergies.load_synergies(file, bundled_analysis.metric)
    for before, after in zip(synergies, loaded, strict=True):
        t = np.linspace(before.start_time, before.start_time + before.duration, 9)
        assert np.array_equal(before(t), after(t))
        assert np.array_equal(before(t, 1), after(t, 1))
        assert (before.start, before.stop, before.length) == (after.start, after.stop, after.length)


def test_synergies_are_a_motion_again(bundled_analysis: go.synergies.Analysis) -> None:
    predicted = bundled_analysis.predicted
    motion = go.synergies.motion_of_synergies(bundled_analysis.synergies, predicted.rate)
    assert motion.joint_names == predicted.joint_names
    np.testing.assert_allclose(motion.time, predicted.time, atol=1e-6)  # in microseconds
    np.testing.assert_allclose(motion.q, predicted.q, atol=1e-5)
    first, *_, last = bundled_analysis.synergies
    with pytest.raises(ValueError, match=r"synergy 1 begins at .*, not where the one before it"):
        go.synergies.motion_of_synergies([first, last])


def test_tables_in_degrees(bundled_analysis: go.synergies.Analysis) -> None:
    pytest.importorskip("geodesic_ocp.drawing")
    radians = bundled_analysis.table()
    degrees = go.drawing.in_degrees(radians)
    assert list(degrees.columns) == [name.replace("[rad]", "[deg]") for name in radians.columns]
    np.testing.assert_allclose(degrees["joints [deg]"], np.degrees(radians["joints [rad]"]))
    assert degrees["hand [m]"].equals(radians["hand [m]"])


def peaks_of(figure: Figure) -> list[float]:
    return [float(each.get_text()[6:]) for each in figure.axes[1].texts]


@pytest.mark.slow
def test_figures_in_degrees(bundled_analysis: go.synergies.Analysis) -> None:
    """Labels and ticks, and what is written beside a line that leaves the panel."""
    pytest.importorskip("geodesic_ocp.drawing")
    figure = go.plot(bundled_analysis)
    label, peaks = figure.axes[1].get_ylabel(), peaks_of(figure)
    degrees = go.drawing.in_degrees(figure).axes[1]
    assert degrees.get_ylabel() == label.replace("[rad]", "[deg]")
    text = degrees.yaxis.get_major_formatter()
    assert [text(each) for each in np.radians([0.0, 2.0])] == ["0", "2"]
    assert np.degrees(degrees.get_yticks()) == pytest.approx(
        np.degrees(degrees.get_yticks()).round()
    )
    assert peaks
    assert peaks_of(figure) == pytest.approx(np.degrees(peaks), rel=0.01)


def test_another_metric_is_noticed(bundled_analysis: go.synergies.Analysis, tmp_path: Path) -> None:
    """Such as the kinetic energy without the joint inertia in which the synergies were found."""
    file = tmp_path / "synergies.json"
    go.synergies.save_synergies(
        file, bundled_analysis.synergies, bundled_analysis.motion.joint_names
    )
    with pytest.raises(go.RecordingError, match=r"in this metric, not .*: it was saved in another"):
        go.synergies.load_synergies(file, go.KineticEnergy(bundled_analysis.model))


def test_bad_files_are_named(bundled_analysis: go.synergies.Analysis, tmp_path: Path) -> None:
    metric, motion = go.KineticEnergy(bundled_analysis.model), bundled_analysis.motion
    file = tmp_path / "synergies.json"
    with pytest.raises(go.RecordingError, match=r"synergies\.json: there is no such file"):
        go.synergies.load_synergies(file, metric)
    synergies, _ = go.synergies.reconstruct(go.Euclidean(7), motion, [(0, len(motion) - 1)])
    go.synergies.save_synergies(file, synergies, motion.joint_names)
    good = file.read_text()
    with pytest.raises(go.RecordingError, match=r"nodes must have shape \(15, 2\)"):
        go.synergies.load_synergies(file, go.Euclidean(2))
    go.synergies.save_synergies(file, synergies, motion.joint_names[::-1])
    with pytest.raises(go.RecordingError, match=r"its joints .* are not the metric's"):
        go.synergies.load_synergies(file, metric)
    for text, message in (
        (good.replace('"knots": [\n     0.0,', '"knots": [\n     0.5,'), "knots must increase"),
        (good[:100], "is not JSON"),
        ("[1, 2]", "is not a file of synergies"),
        (good.replace('"version": 1', '"version": 7'), "has version 7, expected 1"),
        (good.replace('"degree"', '"grade"'), "missing required field `degree`"),
    ):
        file.write_text(text)
        with pytest.raises(go.RecordingError, match=message):
            go.synergies.load_synergies(file, metric)
