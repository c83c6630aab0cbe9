"""A recording of markers is analysed in one command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from commands import Output
from here import Here
from marked_motion import HEIGHT, MMM_MARKERS, angles, marked

import geodesic_ocp as go
from geodesic_ocp.studies.analyse_recordings import analyse_recordings
from geodesic_ocp.studies.analysis_settings import AnalysisSettings


@pytest.mark.slow
def test_the_fit_is_shown_and_saved(tmp_path: Path, printed: Output) -> None:
    arm, time = go.human_arm("right", HEIGHT), np.arange(60) / 50.0
    q = angles(arm, time)
    markers = marked(arm, q, time, MMM_MARKERS)
    header = ",".join(f"{name}_{axis}" for name in markers.names for axis in "xyz")
    rows = np.column_stack([time, 1e3 * markers.positions.reshape(len(time), -1)])
    file = tmp_path / "markers.csv"
    lines = [",".join(map(repr, map(float, row))) for row in rows]
    file.write_text("\n".join(["# unit: mm", f"time,{header}", *lines]))
    out = tmp_path / "out"
    printed = printed("analyse", file, "--height", HEIGHT, "--out", out)
    assert "Joint angles fitted to the markers (Master Motor Map)" in printed
    assert "Body height 1.800 m, " in printed
    assert "geodesic synergies" in printed
    assert "No further filter: the fit to the markers has smoothed the motion." in printed
    assert "mean errors against the fitted recording" in printed
    assert "unfiltered" not in printed
    assert "noise" not in printed
    fitted = go.read_motion(out / "motion.csv", arm.joint_names)
    assert np.sqrt(np.mean((fitted.q - q) ** 2)) < 0.02
    assert "RAEL" in (out / "markers.md").read_text()
    assert (out / "markers.csv").exists()
    result = analyse_recordings(
        file, tmp_path / "many", settings=AnalysisSettings(metric="euclidean"), executor=Here()
    )
    row = result.recordings().iloc[0]
    assert (row["height_from"], row["mass_from"]) == ("markers", "assumed")
    assert 0.0 <= row["marker_error_m"] < 0.005
    assert np.isnan(row["cutoff_hz"])


@pytest.mark.slow
def test_a_marker_set_from_a_file(tmp_path: Path, printed: Output, refused: Output) -> None:
    arm, time = go.human_arm("right", HEIGHT), np.arange(40) / 50.0
    markers = marked(arm, angles(arm, time), time, MMM_MARKERS)
    names = [f"point {column}" for column in range(len(markers.names))]
    places = {
        name: MMM_MARKERS.places[known] for name, known in zip(names, markers.names, strict=True)
    }
    marker_set = tmp_path / "set.json"
    marker_set.write_text(json.dumps({"name": "points", "places": places}))
    header = ",".join(f"{name}_{axis}" for name in names for axis in "xyz")
    rows = np.column_stack([time, markers.positions.reshape(len(time), -1)])
    file = tmp_path / "markers.csv"
    lines = [",".join(map(repr, map(float, row))) for row in rows]
    file.write_text("\n".join(["# unit: m", f"time,{header}", *lines]))
    given = ["analyse", str(file), "--height", str(HEIGHT), "--metric", "euclidean"]
    assert "say where they are" in refused(*given)
    assert "Joint angles fitted to the markers (points)" in printed(
        *given, "--marker-set", marker_set
    )
