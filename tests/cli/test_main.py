"""The command line: output, files and exit codes."""

from __future__ import annotations

import inspect
import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from commands import Output
from gadget import TWO_LINKS
from installed_robots import needs_robots

import geodesic_ocp as go
from geodesic_ocp.cli import analyse as analyse_command
from geodesic_ocp.cli import main as cli
from geodesic_ocp.model.formats import load_model
from geodesic_ocp.model.formats.robots import ROBOTS
from geodesic_ocp.studies import analyse_recording
from geodesic_ocp.studies.analysis_settings import AnalysisSettings
from geodesic_ocp.trajectory.bundled_recording import BUNDLED

TABLES = ["table.csv", "table.md", "table_unfiltered.csv", "table_unfiltered.md"]


@pytest.fixture
def short_file(tmp_path: Path, bundled_file: Path) -> Path:
    """The reach for the box in the bundled recording, without the person's height."""
    lines = [
        line for line in bundled_file.read_text().splitlines() if not line.startswith("# height")
    ]
    first = next(i for i, line in enumerate(lines) if line.startswith("time"))
    file = tmp_path / "short.csv"
    file.write_text("\n".join(lines[: first + 1] + lines[first + 301 : first + 429]) + "\n")
    return file


@pytest.mark.slow
def test_analyse_prints_a_table_and_writes_files(
    short_file: Path, tmp_path: Path, printed: Output
) -> None:
    out = tmp_path / "out"
    arguments = ["analyse", str(short_file), "--side", "left", "--out", str(out)]
    text = printed(*arguments)
    assert "human left arm, height 1.75 m, mass 70 kg: 128 samples" in text
    assert "assumed, not in the recording: height 1.75 m, mass 70.0 kg" in text
    assert "Cuts: developed.\n" in text
    assert "straight lines, same segments" in text
    assert f"wrote {out / 'figure.png'}" in text
    assert (out / "synergies.json").is_file()


@pytest.mark.slow
def test_height_mass_and_threshold_are_options(short_file: Path, printed: Output) -> None:
    arguments = ["analyse", str(short_file), "--side", "left", "--height", "1.5", "--mass", "50"]
    text = printed(*arguments, "--segments", "online", "--threshold", "1.0")
    assert "height 1.5 m, mass 50 kg" in text
    assert "Cuts: online, threshold 1.0.\n" in text
    assert "assumed" not in text
    assert "wrote" not in text


@pytest.mark.slow
def test_metric_and_joint_inertia_are_options(short_file: Path, printed: Output) -> None:
    command = ["analyse", str(short_file), "--side", "left"]
    default = f"{go.manifold.default_joint_inertia(go.human_arm('left'))[0]:.3g}"
    for options, metric in (
        ([], rf"kinetic energy with joint inertia {default} kg m\^2"),
        (["--armature", "0.05"], r"kinetic energy with joint inertia 0\.05 kg m\^2"),
        (["--metric", "joint-inertia"], rf"kinetic energy with joint inertia {default} kg m\^2"),
        (["--metric", "kinetic"], "kinetic energy"),
        (["--armature", "0"], "kinetic energy"),
        (["--metric", "euclidean"], "straight lines"),
    ):
        text = printed(*command, *options)
        assert re.search(rf"^Metric: {metric}\.$", text, re.MULTILINE)
        rows = [line for line in text.splitlines() if line.startswith(("geodesics", "straight"))]
        geodesics = {line.split("  ")[0] for line in rows}
        assert {
            "geodesics, kinetic energy",
            "geodesics, kinetic energy with joint inertia",
            "straight lines, same segments",
        } <= geodesics


@pytest.mark.slow
def test_a_fitted_metric_is_read_from_its_file(
    short_file: Path, tmp_path: Path, refused: Output, printed: Output
) -> None:
    file = tmp_path / "metric.json"
    entry = {"name": "armature", "field": "armature", "joints": [], "value": 0.06}
    record = {"format": "geodesic_ocp metric", "version": 1, "parameters": [entry]}
    file.write_text(json.dumps(record | {"metric": "AdjustableKineticEnergy"}))
    command = ["analyse", str(short_file), "--side", "left", "--metric"]
    text = printed(*command, file)
    assert "Metric: fitted kinetic energy with joint inertia 0.06 kg m^2." in text
    file.write_text("{}")
    assert str(file) in refused(*command, file)


@pytest.mark.slow
def test_filters_are_options(short_file: Path, printed: Output) -> None:
    command = ["analyse", str(short_file), "--side", "left"]
    assert "chosen from the noise floor" in printed(*command)
    cutoff = printed(*command, "--cutoff", "4")
    assert "cut-off frequency of 4 Hz; noise of the joints" in cutoff
    assert cutoff.count("mean errors against the") == 2
    window = printed(*command, "--savitzky-golay", "0.21")
    assert "Savitzky-Golay" in window
    assert "window of 0.2" in window
    as_it_is = printed(*command, "--no-filter")
    assert "without a filter" in as_it_is
    assert as_it_is.count("mean errors against the") == 1
    assert "mean errors against the observed recording" in as_it_is


@pytest.mark.slow
def test_settings_of_the_segmentation_are_options(short_file: Path, printed: Output) -> None:
    """What they do is that of the arguments in Python."""
    arm = go.human_arm("left")
    motion = go.read_motion(short_file, arm.joint_names).filtered(cutoff=5.0)
    text = printed(
        *["analyse", short_file, "--side", "left", "--cutoff", "5"],
        *["--segments", "online", "--threshold", "0.4", "--rest-speed", "0.3"],
        *["--rest-duration", "0.05", "--min-duration", "0.02"],
        *["--hysteresis", "0.01", "--metric", "kinetic"],
    )
    settings = {"rest": 0.3, "rest_duration": 0.05, "min_duration": 0.02, "hysteresis": 0.01}
    expected = go.segment(go.KineticEnergy(arm), motion, 0.4, **settings)
    assert len(expected) != len(go.segment(go.KineticEnergy(arm), motion, 0.4))
    assert f"{len(expected)} geodesic synergies explain" in text
    assert "Cuts: online, rest 0.3, threshold 0.4, " in text


def test_defaults_are_those_in_python() -> None:
    settings = AnalysisSettings()
    for function, names in (
        (go.segment, ("threshold", "rest_duration", "min_duration", "hysteresis")),
        (
            go.synergies.segment_developed,
            ("deviation", "rest_duration", "min_duration", "max_duration"),
        ),
        (
            go.synergies.segment_optimal,
            ("count", "penalty", "error", "measure", "spacing", "max_duration"),
        ),
    ):
        parameters = inspect.signature(function).parameters
        for name in names:
            assert getattr(settings, name) == parameters[name].default
    assert settings.rest_speed == inspect.signature(go.segment).parameters["rest"].default


def test_settings_come_from_a_file_and_options_go_first(tmp_path: Path, refused: Output) -> None:
    toml, as_json, wrong = (tmp_path / name for name in ("s.toml", "s.json", "wrong.toml"))
    toml.write_text('deviation = 0.05\nmargin = 0.02\nlimits = false\nunit = "cm"\n')
    as_json.write_text('{"deviation": 0.05, "margin": 0.02, "limits": false, "unit": "cm"}')
    for file in (toml, as_json):
        command = ["retarget", "a.csv", "--robot", "panda", "--settings", str(file)]
        _, bound, _ = cli.new_app().parse_args([*command, "--margin", "0.03"])
        settings = bound.arguments["retargeting"]
        assert (settings.margin, settings.limits) == (0.03, False)
        assert bound.arguments["analysis"] == AnalysisSettings(deviation=0.05, unit="cm")
    toml.write_text('rest = false\nhand-speed = "1"\npose-tolerance = ["20mm", "6 deg"]\n')
    _, bound, _ = cli.new_app().parse_args([*command[:-1], str(toml)])
    settings = bound.arguments["retargeting"]
    assert (settings.rest, bound.arguments["joint_limits"].hand_speed) == (False, "1")
    assert settings.pose_tolerance == pytest.approx((0.02, np.radians(6.0)))
    for text, message in (
        ("treshold = 0.4\n", "unknown settings: 'treshold'; did you mean 'threshold'?"),
        ("rest-speed = 0.4\nrest_speed = 0.4\n", "given twice: 'rest_speed'"),
        ("threshold = \n", "is not a table of settings in JSON, TOML or YAML"),
        ("threshold = -1.0\n", "threshold must be positive"),
        ('threshold = "much"\n', "much"),
    ):
        wrong.write_text(text)
        error = refused("analyse", "a.csv", "--settings", wrong)
        assert message in error
        assert "wrong.toml" in error
    wrong.write_text("rest-speed = -1.0\nmin_duration = 0.1\n")
    for given in (["--settings", wrong], [f"--settings={wrong}"]):  # found when the file is read
        error = refused("analyse", BUNDLED, "--side", "left", *given)
        assert f"got -1.0 (with the settings of {wrong}: rest-speed = -1.0)" in error
    wrong.write_text("no-rest = true\n")  # which would be read as rest = true
    assert "'no-rest'; did you mean 'rest'?" in refused(*command[:-1], wrong)
    assert "none.toml: cannot be read" in refused(
        "analyse", "a.csv", "--settings", tmp_path / "none.toml"
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--threshold=0.4"], "threshold: for segments='online' only"),
        (["--measure=position"], "measure: for segments='optimal' only"),
        (["--spacing=0.1", "--error=0.1"], "error and spacing: for segments='optimal' only"),
        (["--segments=optimal", "--count=3", "--rest-speed=0.1"], "rest_speed: for segments="),
    ],
)
def test_options_without_effect_are_refused(
    options: list[str], message: str, refused: Output
) -> None:
    for command in (["analyse", "file"], ["retarget", "file", "--robot", "panda"]):
        assert message in refused(*command, *options)


@pytest.mark.slow
def test_optimal_segments_are_an_option(
    short_file: Path, tmp_path: Path, refused: Output, printed: Output
) -> None:
    command = ["analyse", str(short_file), "--side", "left", "--segments", "optimal"]
    text = printed(*command, "--count", "3", "--metric", "euclidean")
    assert "3 geodesic synergies explain the joints" in text
    assert "Cuts: optimal, count 3.\n" in text
    for wrong, message in (
        ([], "segments='optimal' needs one of count, penalty and error"),
        (["--count", "1000"], "1000"),
    ):
        assert message in refused(*command, "--metric", "euclidean", *wrong)


@pytest.mark.slow
def test_height_comes_from_the_recording(shared: Path, printed: Output) -> None:
    file = shared / "data" / "kit" / "take_book_from_shelf_right_arm_02.xml"
    paper = ["--metric", "kinetic", "--savitzky-golay", "0.21", "--min-duration", "0"]
    paper += ["--hysteresis", "0", "--segments", "online"]
    text = printed("analyse", file, *paper)
    assert "of subject_id_1229, height 1.83 m, mass 100 kg: 338 samples" in text
    found = re.search(r"(\d+) geodesic synergies", text)
    assert found is not None
    assert int(found[1]) == pytest.approx(20, rel=0.2)


@pytest.mark.slow
def test_demo_writes_to_its_default_folder(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    printed: Output,
    bundled_analysis: go.synergies.Analysis,
) -> None:
    def analyse(
        model: go.Model, motion: go.Motion, *options: object, **more: object
    ) -> go.synergies.Analysis:
        """The analysis of this model and motion, which is at hand."""
        assert repr(model) == repr(bundled_analysis.model)
        assert model.mass == bundled_analysis.model.mass
        assert len(motion) == len(bundled_analysis.motion)
        assert not options
        return bundled_analysis

    def compare(
        *arguments: object, spacing: float, **options: object
    ) -> go.studies.MetricComparison:
        """Straight lines alone, with few candidates."""
        model, motion = bundled_analysis.model, bundled_analysis.motion
        assert arguments == (model, motion)
        assert spacing == pytest.approx(0.1, rel=0.01)
        lines = {"straight lines": go.Euclidean(model.dof)}
        return go.studies.compare_metrics(model, motion, lines, spacing=0.5, rules={})

    monkeypatch.setattr(analyse_recording, "analyse", analyse)
    monkeypatch.setattr(analyse_command, "compare_metrics", compare)
    monkeypatch.chdir(tmp_path)
    text = printed("demo")
    assert "height 1.78 m" in text
    assert "mean errors with the cuts of least joint error" in text
    names = sorted(file.name for file in (tmp_path / "geodesic_ocp_demo").iterdir())
    others = ["second_order.csv", "second_order.md", "synergies.json"]
    assert names == ["curve", "figure.pdf", "figure.png", *others, *TABLES]
    assert (tmp_path / "geodesic_ocp_demo" / "curve" / "table.csv").is_file()


def test_version(printed: Output) -> None:
    assert printed("--version") == f"geodesic-ocp {go.__version__}\n"


def test_other_arm_is_suggested(bundled_file: Path, refused: Output) -> None:
    assert refused("analyse", bundled_file, "--side", "right").endswith(
        "LWy_joint; try --side left\n"
    )
    assert "try --side" not in refused("analyse", bundled_file.with_name("LICENSE.Apache-2.0"))


def test_models_lists_names_without_loading_any(
    printed: Output, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(load_model, "load_model", None)
    monkeypatch.setattr(load_model, "human_arm", None)
    text = printed("models")
    assert f"{go.model.dynamics.choose_backend()}: in use" in text
    for robot in ROBOTS:
        assert f" {robot}" in text
    assert all(len(line) <= 100 for line in text.splitlines() if "cannot be used" not in line)


def test_models_describes_those_that_are_named(tmp_path: Path, printed: Output) -> None:
    (robot := tmp_path / "robot.urdf").write_text(TWO_LINKS)
    text = printed("models", "left", robot)
    assert text.startswith("left: 7 DoF, 3.43 kg, reach 0.65 m\n  LSx_joint")
    assert text.endswith("2 DoF, 4.00 kg, reach 1.00 m\n  shoulder, elbow\n  hand: b\n")


def test_models_names_missing_packages(printed: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(load_model, "folder", lambda package: None)
    monkeypatch.setattr(load_model, "described", dict)
    monkeypatch.setattr(load_model, "on_demand", tuple)
    text = printed("models")
    assert "not available without armar and example-robot-data:\n  pip install armar" in text
    for robot in ROBOTS:
        assert robot in text
    assert all(len(line) <= 100 for line in text.splitlines() if "cannot be used" not in line)


def altered(file: Path, **changes: object) -> Path:
    """A copy of a table with rows changed, each by a function of the list of rows."""
    lines = file.read_text().splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith("time")) + 1
    head, rows = lines[:first], [line.split(",") for line in lines[first:]]
    rows = changes["rows"](rows)
    copy = file.with_name("altered.csv")
    copy.write_text("\n".join(head + [",".join(row) for row in rows]) + "\n")
    return copy


def test_uneven_samples_are_resampled_on_request(
    short_file: Path, printed: Output, refused: Output
) -> None:
    def delayed(rows: list[list[str]]) -> list[list[str]]:
        return [[str(float(row[0]) + 0.006 * (i > 40)), *row[1:]] for i, row in enumerate(rows)]

    file = altered(short_file, rows=delayed)
    command = ["analyse", str(file), "--side", "left", "--metric", "euclidean"]
    assert "--resample on the command line" in refused(*command)
    assert " at 100 Hz" in printed(*command, "--resample", "100")
    assert "resample must be positive" in refused(*command, "--resample", "0")


def in_milliseconds(rows: list[list[str]]) -> list[list[str]]:
    return [[str(1000.0 * float(row[0])), *row[1:]] for row in rows]


def with_nan(rows: list[list[str]]) -> list[list[str]]:
    rows[7][3] = "nan"
    return rows


def with_repeated_time(rows: list[list[str]]) -> list[list[str]]:
    rows[9][0] = rows[8][0]
    return rows


def without_motion(rows: list[list[str]]) -> list[list[str]]:
    return [[row[0], *rows[0][1:]] for row in rows]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (with_nan, "LSy_joint is missing at"),
        (with_repeated_time, "time must increase: sample 9"),
        (without_motion, "the motion never moves"),
        (in_milliseconds, "is time in milliseconds?"),
        (lambda rows: rows[:1], "needs at least two samples, got 1"),
        (lambda rows: rows[:20], "too short to filter"),
    ],
)
def test_wrong_tables_end_with_one_line(
    change: object, message: str, short_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = altered(short_file, rows=change)
    out = short_file.parent / "out"
    assert cli.main(["analyse", str(file), "--side", "left", "--out", str(out)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    last = printed.err.splitlines()[-1]
    assert f"{file}: " in last
    assert last.startswith("geodesic-ocp: error: ")
    assert message in last
    assert not out.exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--threshold", "0"], "threshold must be positive [rad], got 0.0"),
        (["--threshold", "-1"], "threshold must be positive"),
        (["--threshold", "nan"], "threshold must be positive"),
        (["--height", "0"], "height must be positive [m], got 0.0"),
        (["--mass", "-70"], "mass must be positive [kg], got -70.0"),
        (["--height", "178"], "at most 3 m"),
        (["--threshold", "34"], "threshold must be below pi rad, got 34 (in degrees?)"),
        (["--side", "right"], "there is no joint RSx_joint"),
        (["--count", "5"], "count: for segments='optimal' only"),
        (["--armature", "-1"], "armature of joint 'LSx_joint' must be finite and not negative"),
        (["--armature", "1", "--metric", "kinetic"], "armature is the joint inertia of the metric"),
        (["--metric", "mass"], "kinetic, euclidean or a file, and there is no file 'mass'"),
        (["--cutoff", "0"], "cutoff"),
        (["--rest-speed", "1"], "rest must be in [0, 1), got 1.0"),
    ],
)
def test_wrong_options_end_with_one_line(
    options: list[str], message: str, short_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = short_file.parent / "out"
    side = [] if "--side" in options else ["--side", "left"]
    assert cli.main(["analyse", str(short_file), *side, "--out", str(out), *options]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert message in printed.err.splitlines()[-1]
    assert "Traceback" not in printed.err
    assert not out.exists()


def test_missing_and_broken_files_end_with_code_2(
    tmp_path: Path, short_file: Path, refused: Output
) -> None:
    assert "none.xml: there is no such file" in refused("analyse", tmp_path / "none.xml")
    (tmp_path / "cut.xml").write_text("<MMM><Motion name='x'><Joint")
    assert "cut.xml: broken XML at line 1" in refused("analyse", tmp_path / "cut.xml")
    # An output folder that is a file is reported before any work is done.
    arguments = ["analyse", str(short_file), "--side", "left", "--out", str(short_file)]
    assert "is a file, not a folder" in refused(*arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["fly"], 'Unknown command "fly"'),
        (["analyse"], "parameter FILE requires an argument"),
        (["analyse", "a", "--side", "up"], 'Invalid value "up" for --side'),
        (["analyse", "a", "--treshold", "1"], "Did you mean --threshold?"),
        (["analyse", "a", "--threshold", "much"], 'unable to convert "much" into float'),
    ],
)
def test_wrong_usage_ends_with_code_2(arguments: list[str], message: str, refused: Output) -> None:
    assert message in refused(*arguments)


def test_without_a_command_the_help_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 2
    text = capsys.readouterr().out
    assert "Cut recordings into geodesic synergies" in text
    assert "Exit codes" in text


@pytest.mark.slow
def test_ctrl_c_during_a_solve_raises_keyboard_interrupt() -> None:
    """A real signal, sent by another process while Ipopt runs."""
    script = (
        "import signal\n"
        "import geodesic_ocp as go\n"
        # A shell that starts the tests in the background lets them ignore the signal.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "arm = go.human_arm()\n"
        "problem = go.PointToPoint(go.KineticEnergy(arm), arm.lower * 0.9, arm.upper * 0.9)\n"
        "go.solve(problem, grid=go.Grid(8, 12), ipopt={'max_iter': 0}, throw=False)\n"
        "options = {'tol': 1e-300, 'acceptable_tol': 1e-300, 'max_iter': 100000}\n"
        "try:\n"
        "    print('solving', flush=True)\n"
        "    while True:\n"
        "        go.solve(problem, grid=go.Grid(8, 12), throw=False, ipopt=options)\n"
        "except KeyboardInterrupt:\n"
        "    raise SystemExit(130)\n"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"solving\n"
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        try:
            assert process.wait(timeout=60) == 130
        finally:
            process.kill()


def test_failed_solvers_and_interruptions_have_exit_codes(
    short_file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["analyse", str(short_file), "--side", "left"]
    for error, code in (
        (go.NotConverged(f"no geodesic from {np.zeros(20)}"), 3),
        (go.IntegrationFailed("stopped"), 3),
        (KeyboardInterrupt(), 130),
    ):

        def fail(*arguments: object, error: BaseException = error, **options: object) -> None:
            raise error

        monkeypatch.setattr(analyse_recording, "analyse", fail)
        assert cli.main(arguments) == code
        printed = capsys.readouterr().err
        assert printed.startswith("geodesic-ocp: error: ")
        assert printed.count("\n") == 1


def test_wrong_robots_are_named(short_file: Path, tmp_path: Path, refused: Output) -> None:
    command = ["retarget", str(short_file), "--side", "left", "--robot"]
    assert "'pandora'" in refused(*command, "pandora")
    assert "--robot: one robot, got one, two" in refused(*command, "one", "--robot", "two")
    assert "two robots, of the right and of the left arm" in refused(
        "retarget", short_file, "--side", "both", "--robot", "panda"
    )
    both = ["--side", "both", "--robot", "armar6-right", "--robot", "armar6-left"]
    assert "--mount auto: for one --robot" in refused(
        "retarget", short_file, *both, "--mount", "auto"
    )
    assert cli.main(["demo", "--robot", "pandora", "--out", str(tmp_path)]) == 2
    assert not any(tmp_path.glob("*/figure.png"))


@needs_robots
def test_robots_without_an_alignment_are_named(
    short_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["retarget", str(short_file), "--side", "left", "--robot", "double_pendulum"]
    assert cli.main(command) == 2
    captured = capsys.readouterr()
    assert "hand must name a frame" in captured.err
    assert "synergies" not in captured.out  # before the recording is analysed


@needs_robots
@pytest.mark.slow
def test_both_arms_of_a_recording(
    shared: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = go.read_motion(shared / "data" / "kit" / "take_book_from_shelf_right_arm_02.xml")
    file = go.trajectory.save_motion(tmp_path / "reach.csv", whole.part(60, 149))
    arguments = ["retarget", str(file), "--side", "both", "--deviation", "0.1", "--no-limits"]
    code = cli.main([*arguments, "--robot", "xarm7", "--robot", "panda"])
    printed = capsys.readouterr()
    titles = "not for a robot:", "poses missed by more than the tolerance:"
    assert code == any(title in printed.err for title in titles)
    assert re.search(r"human right arm.* on xarm7", printed.out)
    assert re.search(r"human left arm.* on panda", printed.out)
