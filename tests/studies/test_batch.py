"""Many recordings: tables, files that are left out, and runs that go on where they were."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from here import Here
from minimum_jerk_files import write_stroke
from pandas.testing import assert_frame_equal

import geodesic_ocp as go
from geodesic_ocp.recordings.read_recording import read_recording
from geodesic_ocp.studies.analyse_recordings import BatchResult, analyse_recordings
from geodesic_ocp.studies.analysis_settings import AnalysisSettings
from geodesic_ocp.studies.result_files import locked, result_key
from geodesic_ocp.studies.sources import recording_sources
from geodesic_ocp.studies.study_tables import key_of, read_table, recording_rows

METRIC = AnalysisSettings(metric="euclidean")  # which is quick


@pytest.fixture
def data(tmp_path: Path) -> Path:
    write_stroke(tmp_path / "data" / "An" / "reach_1.csv", 1)
    write_stroke(tmp_path / "data" / "An" / "reach_2.csv", 2)
    write_stroke(tmp_path / "data" / "Bo" / "reach_1.csv", 3, ["# subject: Bob", "# height: 1.9"])
    return tmp_path / "data"


def run(data: Path, out: Path, settings: AnalysisSettings = METRIC, **more: Any) -> BatchResult:
    more.setdefault("executor", Here())
    return analyse_recordings(data, out, settings=settings, recursive=True, **more)


def by_file(rows: pd.DataFrame, file: str) -> list[dict[str, Any]]:
    return rows[rows["file"] == file].to_dict("records")


def files_of(out: Path) -> dict[str, tuple[int, int]]:
    """What changes when a result is written again: inode and time."""
    return {
        file.name: (file.stat().st_ino, file.stat().st_mtime_ns)
        for file in (out / "results").iterdir()
    }


@pytest.mark.slow
def test_figures_are_drawn_on_request(data: Path, tmp_path: Path) -> None:
    """Also of recordings that were analysed without."""
    counts = [
        (each.analysed, each.found)
        for each in (run(data / "Bo", tmp_path, draw=each) for each in (None, go.plot, go.plot))
    ]
    assert counts == [(1, 0), (1, 0), (0, 1)]
    results = [each.stem for each in (tmp_path / "results").glob("*[0-9a-f].json")]
    assert sorted(results) == sorted(each.stem for each in (tmp_path / "results").glob("*.png"))


@pytest.mark.slow
def test_parts_between_long_gaps_are_recordings(data: Path, tmp_path: Path) -> None:
    """With `fill`; also when the run goes on from its results."""
    file = write_stroke(data / "An" / "reach_2.csv", 2, duration=2.0)
    lines = file.read_text().splitlines()
    middle = len(lines) // 2
    for row in range(middle, middle + 25):
        lines[row] = lines[row].rpartition(",")[0] + ","
    file.write_text("\n".join(lines))
    settings = AnalysisSettings(metric="euclidean", fill=0.1)
    found = [run(data, tmp_path / "out", settings) for _ in range(2)]
    assert [(each.analysed, each.found) for each in found] == [(4, 0), (0, 4)]
    names = {f"An/reach_2.csv, part {part}, right" for part in (1, 2)}
    assert names <= {*found[1].recordings()["recording"]}
    assert not any("twice" in note for note in found[1].notes)


@pytest.mark.slow
def test_tables_hold_what_each_analysis_says(data: Path, tmp_path: Path) -> None:
    """In processes, as in this one."""
    settings = AnalysisSettings(deviation=0.03)
    seen: list[str] = []
    result = run(
        data,
        tmp_path / "out",
        settings,
        executor=None,
        jobs=1,
        finished=lambda outcome: seen.append(outcome.source.file),
    )
    assert (result.analysed, result.found, result.failures) == (3, 0, ())
    assert sorted(seen) == ["An/reach_1.csv", "An/reach_2.csv", "Bo/reach_1.csv"]
    file = data / "Bo" / "reach_1.csv"
    recording = read_recording(file)
    rule = partial(go.synergies.segment_developed, deviation=0.03)
    analysis = go.analyse(recording.model, recording.motion, segments=rule)
    rows = by_file(result.recordings(), "Bo/reach_1.csv")
    second, noisy = (analysis.second_order_errors(unfiltered=of) for of in (False, True))
    errors_of = analysis.errors | {key_of(name): found for name, found in second.items()}
    before_of = analysis.errors_unfiltered | {key_of(name): noisy[name] for name in noisy}
    assert [row["method"] for row in rows] == [*analysis.errors]
    every = recording_rows(analysis)
    assert [row["method"] for row in every] == [*errors_of]
    rows += [row | every[k] for k, row in enumerate(rows[-1:] * 4, len(rows))]
    for row in rows:
        method = str(row["method"])
        errors, before = errors_of[method], before_of[method]
        assert row["joint_error_rad"] == pytest.approx(errors.joint)
        assert row["position_error_m"] == pytest.approx(errors.position)
        assert row["orientation_error_rad"] == pytest.approx(errors.orientation)
        assert row["orientation_error_unfiltered_rad"] == pytest.approx(before.orientation)
        expected = analysis.segment_counts.get(method)
        assert expected is None or row["segments"] == expected
        assert (row["subject"], row["trial"], row["side"]) == ("Bob", "reach_1", "right")
        assert (row["height_m"], row["mass_kg"], row["samples"]) == (1.9, 70.0, 50)
        assert row["cuts"] == "developed, deviation 0.03"
        assert row["metric"] == analysis.metric_name
    synergies = by_file(result.synergies(), "Bo/reach_1.csv")
    assert [row["synergy"] for row in synergies] == list(range(1, len(analysis.synergies) + 1))
    for row, synergy in zip(synergies, analysis.synergies, strict=True):
        assert (row["start_sample"], row["stop_sample"]) == (synergy.start, synergy.stop)
        assert row["length"] == pytest.approx(synergy.length)
        assert row["mean_speed"] == pytest.approx(synergy.length / synergy.duration)


@pytest.mark.slow
def test_errors_of_a_recording_are_means_of_those_of_its_synergies(
    data: Path, tmp_path: Path
) -> None:
    """Over samples: neighbours share one, at which a geodesic has no error of the joints."""
    result = run(data, tmp_path / "out", AnalysisSettings(metric="euclidean", deviation=0.01))
    rows = result.recordings().query("method == 'riemannian' and file == 'An/reach_1.csv'")
    row, synergies = rows.iloc[0], result.synergies()
    own = synergies[synergies["recording"] == row["recording"]]
    total = sum(own["joint_error_rad"] * (own["stop_sample"] - own["start_sample"] + 1))
    assert total / row["samples"] == pytest.approx(row["joint_error_rad"])


@pytest.mark.slow
def test_files_that_cannot_be_used_are_left_out_with_their_reasons(
    data: Path, tmp_path: Path
) -> None:
    (data / "broken.xml").write_text("<MMM>")
    write_stroke(data / "left.csv", 4, side="left")
    (data / "same.csv").write_bytes((data / "An" / "reach_1.csv").read_bytes())
    text = (data / "An" / "reach_2.csv").read_text()
    (data / "again.csv").write_text(text.replace("# unit: rad", "# unit: rad\n# mass: 71"))
    (data / "late.csv").write_text(text.replace("0.010000000,", "0.000000000,"))
    result = run(data, tmp_path / "out")
    assert result.analysed == 3
    reasons = {each.source.file: (each.kind, each.text) for each in result.failures}
    expected = {
        "broken.xml": ("file", "broken XML"),
        "left.csv": ("file", "there is no"),
        "same.csv": ("same", "is the same file as An/reach_1.csv, right"),
        "again.csv": ("same", "holds the same motion as An/reach_2.csv, right"),
        "late.csv": ("file", "time must increase"),
    }
    assert set(reasons) == set(expected)
    for name, (kind, words) in expected.items():
        assert reasons[name][0] == kind
        assert words in reasons[name][1]
    rows = read_table(tmp_path / "out" / "failures.csv", "failures")
    assert dict(zip(rows["file"], rows["reason"], strict=True)) == {
        name: text for name, (_, text) in reasons.items()
    }
    assert set(result.recordings()["file"]) == {
        "An/reach_1.csv",
        "An/reach_2.csv",
        "Bo/reach_1.csv",
    }
    summary = (tmp_path / "out" / "summary.md").read_text()
    for name, (_, words) in expected.items():
        assert name in summary
        assert words in summary


@pytest.mark.slow
def test_failures_of_solvers_and_warnings_are_told(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from geodesic_ocp.studies import analyse_recording

    analyse = analyse_recording.analyse

    def altered(
        model: go.Model, motion: go.Motion, *options: Any, **more: Any
    ) -> go.synergies.Analysis:
        if motion.subject.name == "Bob":
            raise go.NotConverged("no geodesic was found")
        import warnings

        warnings.warn("the arm is straight", RuntimeWarning, stacklevel=1)
        return analyse(model, motion, *options, **more)

    monkeypatch.setattr(analyse_recording, "analyse", altered)
    result = run(data, tmp_path / "out")
    (failure,) = result.failures
    assert (failure.kind, failure.text) == ("solver", "no geodesic was found")
    assert [each.warnings for each in result.warned] == 2 * [("the arm is straight",)]
    assert "the arm is straight" in (tmp_path / "out" / "summary.md").read_text()
    again = run(data, tmp_path / "out")
    assert (again.found, len(again.failures), len(again.warned)) == (2, 1, 2)


@pytest.mark.slow
def test_a_finished_recording_is_not_analysed_again(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    first = run(data, out)
    tables = {file.name: file.read_bytes() for file in out.glob("*.csv")}
    before = files_of(out)
    assert repr(METRIC) == "AnalysisSettings(metric='euclidean')"
    assert repr(first).endswith("out: 3 analysed, 0 left out)")
    assert np.isfinite(first.seconds)
    pytest.importorskip("pyarrow")
    for name in ("recordings", "synergies", "failures"):
        text, parquet = (read_table(out / f"{name}.{kind}", name) for kind in ("csv", "parquet"))
        assert_frame_equal(text, parquet)
    again = run(data, out)
    assert (again.analysed, again.found) == (0, first.analysed)
    assert files_of(out) == before
    assert {file.name: file.read_bytes() for file in out.glob("*.csv")} == tables


@pytest.mark.slow
def test_results_among_the_recordings_are_no_recordings(data: Path) -> None:
    folder = data / "An"
    assert run(folder, folder).analysed == 2
    again = run(folder, folder)
    assert (again.analysed, again.found, again.failures) == (0, 2, ())


@pytest.mark.slow
def test_tables_of_what_there_is_so_far(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    analyse_recordings(data / "An", out, settings=METRIC, executor=Here())
    with locked(out):  # by a run at work
        result = run(data, out, tables_only=True)
    assert (result.analysed, result.found) == (0, 2)
    (missing,) = result.failures
    assert (missing.source.file, missing.kind) == ("Bo/reach_1.csv", "missing")
    assert set(result.synergies()["file"]) == {"An/reach_1.csv", "An/reach_2.csv"}


@pytest.mark.slow
def test_what_has_changed_is_analysed_again(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(data, out)
    write_stroke(data / "An" / "reach_2.csv", 12)
    changed = run(data, out)
    assert (changed.analysed, changed.found) == (1, 2)
    other = AnalysisSettings(metric="euclidean", segments="online")
    assert run(data, out, other).analysed == 3
    # What was there before is kept.
    assert run(data, out).analysed == 0
    assert run(data, out, other).analysed == 0
    damaged = next(
        file for file in (out / "results").glob("reach_1-*") if "synergies" not in file.name
    )
    damaged.write_text(damaged.read_text()[:100])
    counts = [run(data, out, each).analysed for each in (METRIC, other)]
    assert sum(counts) == 1


def test_a_fitted_metric_counts_by_its_content(tmp_path: Path) -> None:
    file = tmp_path / "metric.json"
    digests = []
    for value in (0.06, 0.07):
        file.write_text(json.dumps({"value": value}))
        digests.append(AnalysisSettings(metric=str(file)).digest())
    assert digests[0] != digests[1]
    other = tmp_path / "other.json"
    other.write_bytes(file.read_bytes())
    assert AnalysisSettings(metric=str(other)).digest() == digests[1]


@pytest.mark.slow
def test_subjects_that_are_known_later_need_no_new_analysis(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    first = run(data, out)
    assert set(first.recordings()["subject"]) == {"An", "Bob"}
    named = run(data, out, subject_pattern="{subject}/reach_{trial}")
    assert named.analysed == 0
    columns = ["file", "subject", "trial"]
    found = {*named.synergies()[columns].itertuples(index=False, name=None)}
    assert found == {
        ("An/reach_1.csv", "An", "1"),
        ("An/reach_2.csv", "An", "2"),
        ("Bo/reach_1.csv", "Bo", "1"),
    }


@pytest.mark.slow
def test_heights_from_a_table_of_subjects(data: Path, tmp_path: Path) -> None:
    table = tmp_path / "subjects.csv"
    table.write_text("file,subject,trial,height,mass\nAn/reach_1.csv,A,x,1.6,60\nreach_2,A,y,,\n")
    result = run(data, tmp_path / "out", subjects=table)
    (failure,) = result.failures
    assert failure.text == f"{table} has no row whose file is the end of .../Bo/reach_1.csv"
    columns = ["trial", "height_m", "mass_kg"]
    rows = {*result.recordings()[columns].itertuples(index=False, name=None)}
    assert rows == {("x", 1.6, 60.0), ("y", 1.75, 70.0)}


@pytest.mark.slow
def test_both_sides_of_a_file(data: Path, tmp_path: Path) -> None:
    result = analyse_recordings(
        data / "An" / "reach_1.csv", tmp_path / "out", "both", METRIC, executor=Here()
    )
    assert result.analysed == 1
    (failure,) = result.failures
    assert failure.source.side == "left"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"jobs": 0}, "jobs must be a positive integer or None, got 0"),
        ({"time_limit": 0.0}, "time_limit must be positive"),
        ({"time_limit": 9.0, "executor": Here()}, "either a time_limit or an executor"),
        ({"side": "up"}, "side must be 'right', 'left' or 'both', got 'up'"),
        ({"subject_pattern": "{name}"}, r"must hold \{subject\} once"),
    ],
)
def test_wrong_arguments_are_named(
    data: Path, tmp_path: Path, arguments: dict[str, Any], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        analyse_recordings(data / "An", tmp_path / "out", settings=METRIC, **arguments)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"segments": "optimal"}, "needs one of count, penalty and error"),
        ({"count": 3}, "count: for segments='optimal' only"),
        ({"cutoff": 5.0, "filter": False}, "only one of cutoff, savitzky-golay and no-filter"),
        ({"metric": "mass"}, "there is no file 'mass'"),
        ({"metric": "kinetic", "armature": 0.1}, "armature is the joint inertia"),
        ({"height": -1.0}, r"height must be positive \[m\]"),
    ],
)
def test_settings_that_exclude_each_other(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        AnalysisSettings(**arguments)


def test_a_skeleton_belongs_to_the_content_of_its_motion(tmp_path: Path) -> None:
    motion, skeleton = tmp_path / "a.amc", tmp_path / "a.asf"
    motion.write_text("1\n")
    skeleton.write_text(":version 1\n")
    (source,) = recording_sources(motion, ["right"])
    keys = [result_key(source, METRIC)]
    skeleton.write_text(":version 2\n")
    keys.append(result_key(source, METRIC))
    assert keys[0] != keys[1]
    assert result_key(source, METRIC) == keys[1]
