"""Many recordings on the command line."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import pytest
from commands import Output
from here import Here
from minimum_jerk_files import write_stroke

from geodesic_ocp.cli import analyse as analyse_command
from geodesic_ocp.cli import main as cli
from geodesic_ocp.progress import ProgressBar
from geodesic_ocp.studies import study_tables
from geodesic_ocp.studies.analyse_recordings import BatchResult, analyse_recordings

QUICK = ["--metric", "euclidean", "--jobs", "1"]


@pytest.fixture
def data(tmp_path: Path) -> Path:
    for seed in range(3):
        write_stroke(tmp_path / "data" / f"S{seed}_reach.csv", seed)
    return tmp_path / "data"


@pytest.fixture
def _here(monkeypatch: pytest.MonkeyPatch) -> None:
    """In this process, as others take seconds to start."""

    def here(*given: Any, **more: Any) -> BatchResult:
        return analyse_recordings(*given, **(more | {"executor": Here()}))

    monkeypatch.setattr(analyse_command, "analyse_recordings", here)


@pytest.mark.slow
def test_a_folder_is_analysed_and_again_nothing(
    data: Path, tmp_path: Path, printed: Output, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    command = ["analyse", str(data), "--out", str(out), *QUICK, "--subject-from", "{subject}_*"]
    text = printed(*command)
    assert "S1_reach.csv, right: " in text
    assert "3 analysed, 0 left out" in text
    assert "straight lines, same segments" in text
    for name in ("recordings.csv", "synergies.csv", "failures.csv", "summary.md"):
        assert f"wrote {out / name}" in text
    assert "S1_reach.csv,S1,path,S1_reach,right" in (out / "recordings.csv").read_text()
    (data / "broken.csv").write_text("time\n")
    assert cli.main(command) == 1
    text = capsys.readouterr().out
    assert "left out: broken.csv, right: " in text
    assert "0 analysed, 3 analysed before, 1 left out" in text


@pytest.mark.slow
@pytest.mark.usefixtures("_here")
def test_patterns_and_several_files(data: Path, tmp_path: Path, printed: Output) -> None:
    """The files of a pattern and one more, each once."""
    more = write_stroke(tmp_path / "more.csv", 7)
    files = [str(data / "*_reach.csv"), str(more), str(data / "S0_reach.csv")]
    assert "4 analysed, 0 left out" in printed("analyse", *files, "--out", tmp_path / "out", *QUICK)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([], "several recordings need --out"),
        (["--curve", "--out", "out"], "--curve is of one recording"),
        (["--effort", "--out", "out"], "effort: motions of least effort are part of a study"),
        (["--out", "out", "--scheduler", "tcp://a:1", "--jobs", "2"], "either --jobs"),
        (["--out", "out", "--scheduler", "tcp://a:1", "--time-limit", "2"], "not for --scheduler"),
        (["--out", "out", "--jobs", "0"], "jobs must be a positive integer"),
        (["--out", "out", "--threshold", "-1"], "threshold must be positive"),
        (["--out", "out", "--subject-from", "x"], "must hold {subject} once"),
        (["--out", "out", "--subjects", "none.csv"], "none.csv: cannot be read"),
    ],
)
def test_wrong_options_end_with_one_line(
    options: list[str],
    words: str,
    data: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(data)
    assert cli.main(["analyse", str(data), *options]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert words in printed.err
    assert printed.err.count("\n") == 1
    assert not (data / "out" / "results").exists() or "threshold" not in words


@pytest.mark.slow
@pytest.mark.usefixtures("_here")
def test_one_file_with_options_of_many_is_one_of_many(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = str(data / "S0_reach.csv"), tmp_path / "out"
    assert cli.main(["analyse", file, "--out", str(out), *QUICK]) == 0
    assert (out / "recordings.csv").is_file()
    alone = tmp_path / "alone"
    assert cli.main(["analyse", file, "--metric", "euclidean", "--out", str(alone)]) == 0
    assert (alone / "figure.png").is_file()
    assert not (alone / "recordings.csv").exists()
    capsys.readouterr()


@pytest.mark.slow
def test_both_arms_of_one_recording_have_a_figure_each(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [write_stroke(tmp_path / f"{side}.csv", 4, side=side) for side in ("right", "left")]
    halves = [file.read_text().splitlines() for file in files]
    rows = [f"{a},{b.partition(',')[2]}" for a, b in zip(halves[0][1:], halves[1][1:], strict=True)]
    both, out = tmp_path / "both.csv", tmp_path / "out"
    both.write_text("\n".join(["# unit: rad", *rows]))
    command = ["analyse", str(both), "--side", "both", "--metric", "euclidean"]
    assert cli.main([*command, "--out", str(out)]) == 0
    for side in ("right", "left"):
        assert (out / side / "figure.png").is_file()
    assert not (out / "recordings.csv").exists()
    assert "human left arm" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.usefixtures("_here")
def test_every_file_that_is_left_out_is_on_the_screen(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also one whose motion turns out to be that of another, with another height."""
    text = (data / "S0_reach.csv").read_text()
    (data / "S3_reach.csv").write_text(text.replace("# unit: rad", "# unit: rad\n# height: 1.6"))
    command = ["analyse", str(data), "--out", str(tmp_path / "out"), "--metric", "euclidean"]
    assert cli.main(command) == 1
    text = capsys.readouterr().out
    assert "left out: S3_reach.csv, right: holds the same motion as S0_reach.csv, right" in text
    assert "note: Subjects of 3 of 3 recordings are named after their files" in text
    assert "note: Assumed, not in the recording: a body height of 1.75 m" in text


def test_what_formats_leave_open_can_be_stated(tmp_path: Path) -> None:
    """The options of a recording's format are those of every command that reads recordings."""
    files = {"skeleton": str(tmp_path / "a.asf"), "marker_set": str(tmp_path / "set.json")}
    files["columns"] = str(tmp_path / "columns.csv")
    for file in files.values():
        Path(file).touch()
    given = ["--convention", "isb", "--unit", "cm", "--sample-rate", "60", "--up=-y"]
    given += ["--fill", "0.2", "--part", "3", "--person", "Ann", "--degrees-in"]
    given += [f"--{name.replace('_', '-')}={file}" for name, file in files.items()]
    for command, name in (
        (["analyse", "a"], "analysis"),
        (["fit", "a"], "analysis"),
        (["show", "a"], "shown"),
        (["retarget", "a", "--robot", "panda"], "analysis"),
    ):
        _, bound, _ = cli.new_app().parse_args([*command, *given])
        settings = bound.arguments[name]
        found = getattr(settings, "recording", settings).reading()
        stated = {"convention": "isb", "unit": "cm", "rate": 60.0, "up": "-y", "fill": 0.2}
        assert found == {**stated, "part": 3, "person": "Ann", "degrees_in": True, **files}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--convention", "nope"], "'nope' is neither a file nor one of the built-in"),
        (["--skeleton", "none.asf"], "there is no file 'none.asf'"),
        (["--up", "upwards"], 'Invalid value "upwards" for --up. Choose from: "x", "y", "z"'),
    ],
)
def test_what_is_stated_is_checked_first(
    options: list[str], words: str, data: Path, refused: Output
) -> None:
    assert words in refused("analyse", data / "S0_reach.csv", *options)


def test_a_package_that_is_missing_is_named_in_one_line(
    tmp_path: Path, refused: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "recordings.parquet").write_bytes(b"PAR1")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setattr(study_tables, "has_parquet", lambda: False)
    printed = refused("study", tmp_path)
    assert "Parquet needs pyarrow: pip install 'geodesic_ocp[people]'" in printed
    assert printed.count("\n") == 1


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_the_bar_tells_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", Terminal())
    bar = ProgressBar()
    bar("analysing recordings", 0, 4)
    bar("analysing recordings", 4, 4)
    shown = sys.stderr.getvalue()
    assert "analysing recordings:   0%" in shown
    assert "100% |####" in shown
    assert "left" in shown
    bar("counting", 3, 0)
    bar.close()
    assert "counting: 3" in sys.stderr.getvalue()
    assert sys.stderr.getvalue().endswith("\r")


def test_without_a_terminal_there_is_no_bar(
    capsys: pytest.CaptureFixture[str],
) -> None:
    bar = ProgressBar()
    bar("analysing recordings", 1, 4)
    bar.line("one")
    bar.close()
    assert capsys.readouterr() == ("one\n", "")


@pytest.mark.slow
def test_a_scheduler_that_does_not_answer(
    data: Path, tmp_path: Path, refused: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = ["analyse", str(data), "--out", str(tmp_path / "out"), "--scheduler"]
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "--scheduler needs Dask: pip install 'geodesic_ocp[cluster]'" in refused(
        *command, "tcp://127.0.0.1:1"
    )
    monkeypatch.undo()
    pytest.importorskip("distributed")
    assert "--scheduler nowhere: no scheduler answers" in refused(*command, "nowhere")
