"""Tables, figures and files of a study, in Python and on the command line."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from studies.study_rows import drawn, rows_of, study_of_rows, written

import geodesic_ocp as go
from geodesic_ocp.cli.main import main
from geodesic_ocp.drawing.study_figures import (
    StudyGroup,
    draw_distributions,
    draw_groups,
    draw_trend,
    fit_scale,
    study_figures,
)
from geodesic_ocp.drawing.styles import new_figure
from geodesic_ocp.studies.study import study
from geodesic_ocp.studies.study_result import StudyResult

TABLES = ("means", "tests", "synergy_statistics")
FIGURES = ("errors", "differences", "synergies", "durations")

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def eight() -> StudyResult:
    return study_of_rows(*drawn(4, 8, 3))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the command writes for the study, of its position errors."""
    tables = written(tmp_path_factory.mktemp("study"), *drawn(4, 8, 3))
    out, printed = tables / "paper", io.StringIO()
    with contextlib.redirect_stdout(printed):
        assert main(["study", str(tables), "--out", str(out), "--measure", "position"]) == 0
    text = printed.getvalue()
    assert "StudyResult(24 recordings of 8 subjects, 3 methods, 48 synergies)" in text
    assert "p, Holm" in text
    assert f"wrote {out / 'errors.pdf'}" in text
    return out


def test_all_files_are_written_and_latex_is_balanced(folder: Path) -> None:
    names = {file.name for file in folder.iterdir()}
    assert {f"{name}.{suffix}" for name in TABLES for suffix in ("csv", "md", "tex")} <= names
    assert {f"{name}.{suffix}" for name in FIGURES for suffix in ("pdf", "png")} <= names
    assert {"study.md", "by_subject_joint.csv"} <= names
    # Tables of the analysis in the same folder are not replaced.
    assert not names & {"recordings.csv", "synergies.csv", "failures.csv", "summary.md"}
    for name in TABLES:
        text = (folder / f"{name}.tex").read_text()
        assert text.count(r"\begin{") == text.count(r"\end{") == 2
        assert not re.search(r"(?<!\\)[%_]", text.replace(f"tab:{name}", ""))
        columns = re.search(r"\\begin\{tabular\}\{([lr]+)\}", text)
        assert columns is not None
        rows = [line for line in text.splitlines() if line.endswith(r"\\")]
        assert {len(re.findall(r"(?<!\\)&", row)) + 1 for row in rows} == {len(columns[1])}


def test_csv_has_all_digits(eight: StudyResult, folder: Path) -> None:
    means = pd.read_csv(folder / "means.csv", index_col=["measure", "method"])
    pd.testing.assert_series_equal(means["mean"].head(9), eight.means()["mean"], rtol=1e-15)
    tests = pd.read_csv(folder / "tests.csv", index_col="method")
    expected = eight.tests("position")
    assert tests["95% low"].tolist() == pytest.approx(expected["95% low"].tolist(), rel=1e-15)


def test_figures_of_one_subject_and_without_a_table_of_synergies() -> None:
    rows = rows_of("a", "Ann", {"riemannian": 0.1, "euclidean_same_segments": 0.2})
    figures = study_figures(study_of_rows(rows))
    assert set(figures) == {"errors", "differences"}
    labels = [text.get_text() for text in figures["errors"].legends[0].get_texts()]
    assert labels == ["subject", "mean"]  # without an interval


def test_axes_have_units_and_every_subject_is_drawn(eight: StudyResult) -> None:
    figures = study_figures(eight, "position")
    panels = figures["errors"].axes
    assert [axes.get_xlabel() for axes in panels] == [
        "joint error [rad]",
        "hand position error [mm]",
        "hand orientation error [rad]",
    ]
    points = [line for line in panels[1].lines if line.get_fillstyle() == "none"]
    drawn_points = np.sort(np.concatenate([np.asarray(line.get_xdata()) for line in points]))
    values = 1e3 * eight.by_subject("position").drop(columns="recordings").to_numpy()
    assert drawn_points == pytest.approx(np.sort(values.ravel()))
    assert figures["differences"].axes[0].get_xlabel().endswith("same segments [mm]")
    labels = [axes.get_xlabel() for axes in figures["synergies"].axes]
    assert labels == ["duration of a synergy [s]", "length of a synergy [√kg m]"]


def test_figures_of_conditions() -> None:
    recordings, synergies = drawn(4, 5, 2)
    study = study_of_rows(recordings, synergies, by="trial")
    figures = study_figures(study, against="0")
    assert set(figures) == set(FIGURES)
    labels = [text.get_text() for text in figures["errors"].legends[0].get_texts()]
    assert labels == ["subject", "0: mean, 95% interval", "1: mean, 95% interval"]


def test_the_scale_is_logarithmic_where_means_differ_widely() -> None:
    for large, scale in ((2.0, "linear"), (50.0, "log")):
        groups = [StudyGroup("a", "", (1.0,), 1.0), StudyGroup("b", "", (large,), large)]
        axes = new_figure(3.0, 2.0).subplots()
        draw_groups(axes, groups, "error [rad]")
        fit_scale(axes, groups)
        assert axes.get_xscale() == scale


def test_a_distribution_counts_every_subject_the_same() -> None:
    """Of one value in 1 and nine in 2 the mean distribution is at one half in 1, not at 0.1."""
    axes = new_figure(3.0, 2.0).subplots()
    draw_distributions(axes, {"": [np.array([1.0]), np.full(9, 2.0)]}, "duration [s]")
    mean = max(axes.lines, key=lambda line: line.get_linewidth())
    x, y = np.asarray(mean.get_xdata()), np.asarray(mean.get_ydata())
    assert np.all(y[(x > 1.0) & (x < 1.99)] == 0.5)
    assert y[-1] == 1.0
    empty = new_figure(3.0, 2.0).subplots()
    draw_distributions(empty, {"": [np.array([np.nan])]}, "duration [s]")
    assert not empty.lines


def test_a_trend_is_the_median_of_equal_groups_and_needs_enough_points() -> None:
    x = np.linspace(0.0, 1.0, 120)
    axes = new_figure(3.0, 2.0).subplots()
    draw_trend(axes, x, 2.0 * x, ("x [s]", "y [rad]"))
    line = axes.lines[-1]
    assert len(line.get_xdata()) == 10
    assert np.asarray(line.get_ydata()) == pytest.approx(2.0 * np.asarray(line.get_xdata()))
    few = new_figure(3.0, 2.0).subplots()
    draw_trend(few, x[:20], np.append(x[:19], np.nan), ("x [s]", "y [rad]"))
    assert len(few.lines) == 1


def test_analyses_in_memory_give_the_rows_of_a_folder() -> None:
    arm = go.human_arm()
    time = np.linspace(0.0, 1.0, 60)
    phase = 10 * time**3 - 15 * time**4 + 6 * time**5
    analyses = []
    for turn in (0.6, 0.8):
        q, v = (np.outer(each, np.full(7, turn)) for each in (phase, np.gradient(phase, time)))
        motion = go.Motion(time, q, arm.joint_names, velocity=v)
        analyses.append(go.analyse(arm, motion, metric="euclidean", segments=[(0, 59)]))
    found = study(analyses, names=["a", "b"], subjects=["Ann", "Bob"])
    assert found.subjects == ("Ann", "Bob")
    own = found.by_subject()[found.methods["riemannian"]]
    assert own.tolist() == [each.errors["riemannian"].joint for each in analyses]
    length = found.synergy_statistics().loc["Bob", "length, 50% [rad]"]
    assert length == analyses[1].synergies[0].length
    under = study(analyses, subjects=["Ann", "Ann"], conditions=["one", "two"])
    assert under.conditions == ("one", "two")
    with pytest.raises(ValueError, match="subjects must be 2, one for each analysis"):
        study(analyses, subjects=["Ann"])
    with pytest.raises(ValueError, match="names must differ"):
        study(analyses, names=["a", "a"])


def test_the_command_compares_conditions(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = [str(folder.parent / "recordings.csv"), "--by", "trial", "--against", "0"]
    assert main(["study", *table]) == 0
    assert "joints [rad], against 0" in capsys.readouterr().out


def test_the_command_says_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, reason in (
        ([str(tmp_path)], "has no recordings.csv"),
        ([str(tmp_path), "--measure", "speed"], "measure must be one of joint"),
    ):
        assert main(["study", *arguments]) == 2
        assert reason in capsys.readouterr().err
