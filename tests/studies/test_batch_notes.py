"""What the tables of many recordings rest on is said in words and stored in columns."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from here import Here
from minimum_jerk_files import write_stroke

import geodesic_ocp as go
from geodesic_ocp.studies.analyse_recordings import BatchResult, analyse_recordings
from geodesic_ocp.studies.analysis_settings import AnalysisSettings
from geodesic_ocp.studies.result_files import notes_of

METRIC = AnalysisSettings(metric="euclidean")  # which is quick


def run(data: Path, out: Path, settings: AnalysisSettings = METRIC, **more: Any) -> BatchResult:
    return analyse_recordings(data, out, settings=settings, executor=Here(), **more)


def analysed(tmp_path: Path) -> BatchResult:
    """Two files in one folder: one names the subject and the height, the other does not."""
    write_stroke(tmp_path / "data" / "first.csv", 1, ["# subject: Ann", "# height: 1.6"])
    write_stroke(tmp_path / "data" / "second.csv", 2)
    return run(tmp_path / "data", tmp_path / "out")


@pytest.mark.slow
def test_assumed_numbers_and_names_of_files_are_marked(tmp_path: Path) -> None:
    result = analysed(tmp_path)
    columns = ("subject", "subject_from", "height_m", "height_from", "mass_kg", "mass_from")
    found = {*result.recordings()[[*columns]].itertuples(index=False, name=None)}
    assert found == {
        ("Ann", "file", 1.6, "file", 70.0, "assumed"),
        ("second", "file name", 1.75, "assumed", 70.0, "assumed"),
    }
    assert result.recordings()["marker_error_m"].isna().all()
    summary = (tmp_path / "out" / "summary.md").read_text()
    for words in (
        "Subjects of 1 of 2 recordings are named after their files",
        "Assumed, not in the recording: a body height of 1.75 m in 1 of 2 recordings.",
        "Assumed, not in the recording: a body mass of 70.0 kg in 2 of 2 recordings.",
    ):
        assert words in summary
        assert any(words in note for note in result.notes)


@pytest.mark.slow
def test_given_numbers_and_subjects_leave_nothing_to_say(tmp_path: Path) -> None:
    write_stroke(tmp_path / "data" / "S1_reach.csv", 1)
    table = tmp_path / "subjects.csv"
    table.write_text("file,subject,height\nS1_reach,Ann,1.6\n")
    settings = AnalysisSettings(metric="euclidean", mass=60.0)
    result = run(tmp_path / "data", tmp_path / "out", settings, subjects=table)
    row = result.recordings().iloc[0]
    assert (row["subject_from"], row["height_from"], row["mass_from"]) == (
        "table",
        "table",
        "given",
    )
    assert result.notes == ()


@pytest.mark.slow
def test_a_study_says_that_files_stand_for_persons(tmp_path: Path) -> None:
    analysed(tmp_path)
    study = go.study(tmp_path / "out")
    words = "Subjects of 1 of 2 recordings are named after files"
    assert any(note.startswith(words) for note in study.notes)
    for table in (
        study.means(),
        study.tests(),
        study.synergy_statistics(),
        study.by_subject(),
    ):
        assert words in table.attrs["note"]


@pytest.mark.slow
def test_results_of_other_recordings_are_counted(tmp_path: Path) -> None:
    analysed(tmp_path)
    text = (tmp_path / "data" / "second.csv").read_text()
    (tmp_path / "data" / "third.csv").write_text("# mass: 60\n" + text)  # the same motion
    assert run(tmp_path / "data", tmp_path / "out").others == 0
    (tmp_path / "data" / "third.csv").unlink()
    again = run(tmp_path / "data", tmp_path / "out")
    assert again.others == 1
    again = run(tmp_path / "data" / "first.csv", tmp_path / "out")
    assert (again.found, again.others) == (1, 2)
    words = (
        "2 other results in the folder are of other recordings, settings or versions, and in none "
        "of the tables."
    )
    assert words in again.notes
    assert words in (tmp_path / "out" / "summary.md").read_text()


@pytest.mark.slow
def test_what_nobody_has_analysed_is_not_left_out(tmp_path: Path) -> None:
    write_stroke(tmp_path / "data" / "first.csv", 1)
    result = run(tmp_path / "data", tmp_path / "out", tables_only=True)
    assert result.counts == "0 analysed, 1 not analysed yet"
    (tmp_path / "data" / "broken.csv").write_text("time\n")
    run(tmp_path / "data", tmp_path / "out")
    write_stroke(tmp_path / "data" / "third.csv", 3)
    result = run(tmp_path / "data", tmp_path / "out", tables_only=True)
    assert result.counts == "0 analysed, 1 analysed before, 2 not analysed yet"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["reach", "S1/reach.csv"])
def test_a_table_of_conditions_may_give_more_of_the_path(name: str, tmp_path: Path) -> None:
    write_stroke(tmp_path / "S1" / "reach.csv", 1)
    run(tmp_path / "S1", tmp_path / "out")
    table = tmp_path / "files.csv"
    table.write_text(f"file,condition\n{name},slow\n")
    assert go.study(tmp_path / "out", metadata=table, by="condition").conditions == ("slow",)


def test_one_person_under_several_names_is_noticed() -> None:
    names = ["S01", "sub-1", "s 1", "S10", "An", "AN", "Bo"]
    rows = [
        {"recording": f"{k}", "file": f"{k}.csv", "side": "right", "subject": name}
        | {"subject_from": "file", "height_from": "file", "mass_from": "file"}
        for k, name in enumerate(names)
    ]
    assert [*notes_of(rows, 0)] == [
        f"Subjects {each} may be the same person: if so, state one name with --subjects."
        for each in ("AN and An", "S01 and s 1 and sub-1")
    ]
