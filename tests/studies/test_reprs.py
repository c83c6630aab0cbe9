"""Values of studies show themselves in a few lines, however many recordings they hold."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from short_reprs import OF_STUDIES, check_reprs

import geodesic_ocp as go
from geodesic_ocp.studies.result_files import RecordingOutcome
from geodesic_ocp.studies.sources import RecordingSource


@pytest.mark.slow
def test_reprs_are_short(bundled_analysis: go.synergies.Analysis) -> None:
    study = go.study([bundled_analysis] * 3, names=["a", "b", "c"], subjects=["Ann", "Bob", "Cleo"])
    source = RecordingSource(Path("folder/climb.csv"), "folder/climb.csv", "left")
    failed = RecordingOutcome(source, "file", "folder/climb.csv: is empty")
    values = [
        study,
        go.studies.AnalysisSettings(),
        failed,
        go.studies.BatchResult(Path("results"), 1000, 0, (failed,) * 500, (), 3.0, ()),
    ]
    covered = check_reprs(values)
    assert covered >= OF_STUDIES
    assert "500 left out" in repr(replace(values[-1], analysed=1))
