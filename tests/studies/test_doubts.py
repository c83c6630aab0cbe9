"""Doubts about a motion stand beside every result that rests on it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.drawing.playback_of import playback_of
from geodesic_ocp.studies.analyse_recording import outcome_of
from geodesic_ocp.studies.result_files import notes_of
from geodesic_ocp.studies.sources import RecordingSource
from geodesic_ocp.studies.study_tables import recording_rows
from geodesic_ocp.synergies.synergy import read_saved_synergies
from geodesic_ocp.tables import text

DOUBT = "RFIN is 1387 mm from its place for 100% of the time"


def doubtful_reach() -> go.Motion:
    arm, time = go.human_arm(), np.linspace(0.0, 1.0, 61)
    reach = np.outer(3.0 * time**2 - 2.0 * time**3, np.full(7, 0.5))
    return go.Motion(time, reach, arm.joint_names, doubts=(DOUBT,)).filtered()


def test_doubts_about_a_motion_are_repeated_by_its_analysis(tmp_path: Path) -> None:
    arm, motion = go.human_arm(), doubtful_reach()
    assert motion.caveat == f"Doubtful: {DOUBT}."
    assert motion.select(arm.joint_names[:2]).part(0, 20).resampled(30.0).doubts == (DOUBT,)
    analysis = go.analyse(arm, motion, metric="euclidean")
    assert DOUBT in text(analysis.table())
    for shown in (analysis, motion):
        assert DOUBT in playback_of(shown).scenes[0].note
    sure = replace(analysis, motion=replace(motion, doubts=()))
    assert "Doubtful" not in text(sure.table())
    same = {"recording": "a", "subject": "A", "file": "a.c3d", "side": "right"}
    rows = [same | row for row in recording_rows(analysis, second_order=False)]
    (note,) = (each for each in notes_of(rows, 0) if DOUBT in each)
    assert note == f"Doubtful, but in the means: a ({DOUBT})."
    source = RecordingSource(tmp_path / "a.c3d", "a.c3d", "right")
    assert DOUBT in str(outcome_of(source, "", {"recordings": rows}))


@pytest.mark.slow
def test_doubts_about_a_motion_are_repeated_by_files_studies_and_fits(tmp_path: Path) -> None:
    arm, motion = go.human_arm(), doubtful_reach()
    analyses = [go.analyse(arm, each) for each in (motion, replace(motion, doubts=()))]
    assert f"Doubtful, but in the means: 1 ({DOUBT})." in go.study(analyses).notes
    analyses[0].save(tmp_path)
    assert read_saved_synergies(tmp_path / "synergies.json").motion.doubts == (DOUBT,)
    fit = go.fitting.fit_metric([go.trajectory.Recording(arm, motion, "a")])
    assert f"a: Doubtful: {DOUBT}." in text(fit.table())
