"""geodesic-ocp show: whatever the package writes and reads is seen, or named with what to do."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawing.browser import chromium, playwright_or_skip
from small_retargeting import small_analysis, small_retargeting

import geodesic_ocp as go
from geodesic_ocp.cli import main as cli
from geodesic_ocp.cli import show as show_command
from geodesic_ocp.drawing.meshes import meshes
from geodesic_ocp.drawing.scene import Playback
from geodesic_ocp.model.formats.robots import folder
from geodesic_ocp.synergies.synergy import read_saved_synergies, save_synergies
from geodesic_ocp.tables import save_tables

ROOT = Path(__file__).resolve().parents[2]
needs_robots = pytest.mark.skipif(
    folder("example-robot-data") is None, reason="needs robots: make robots"
)
Show = Callable[..., Playback]
Refused = Callable[..., str]


@pytest.fixture
def show(monkeypatch: pytest.MonkeyPatch) -> Show:
    """The playback that the command shows."""
    shown: list[Playback] = []
    monkeypatch.setattr(show_command, "present", lambda playback, *_: shown.append(playback))

    def playback_of(*arguments: Any) -> Playback:
        assert cli.main(["show", *map(str, arguments)]) == 0
        return shown.pop()

    return playback_of


@pytest.fixture
def refused(show: Show, capsys: pytest.CaptureFixture[str]) -> Refused:
    """The message, one line, with which the command ends."""
    assert callable(show)  # nothing is written, should the command succeed

    def message_of(*arguments: Any) -> str:
        assert cli.main(["show", *map(str, arguments)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        return line.removeprefix("geodesic-ocp: error: ")

    return message_of


@pytest.fixture(scope="module")
def analysed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as analyse writes it, its pictures without content."""
    made, analysis = tmp_path_factory.mktemp("analysed"), small_analysis()
    save_tables(made, {"table": analysis.table()})
    names = analysis.motion.joint_names
    save_synergies(made / "synergies.json", analysis.synergies, names, analysis.model)
    (made / "figure.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    (made / "figure.pdf").write_bytes(b"%PDF-1.4\n")
    return made


@pytest.fixture(scope="module")
def retargeted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that retarget wrote, for a robot that no package knows."""
    made = tmp_path_factory.mktemp("retargeted")
    small_retargeting().save(made)
    return made


@pytest.fixture(scope="module")
def robot_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A pendulum."""
    file = tmp_path_factory.mktemp("robot") / "pendulum.xml"
    file.write_text(
        '<robot name="pendulum"><link name="base"/><link name="bob"><inertial>'
        '<origin xyz="0 0 -0.5"/><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" '
        'iyz="0" izz="0.1"/></inertial></link><joint name="hinge" type="revolute">'
        '<parent link="base"/><child link="bob"/><axis xyz="1 0 0"/>'
        '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint></robot>'
    )
    return file


def swing(file: Path) -> Path:
    """Write a trajectory of the pendulum, and return its file."""
    time = np.linspace(0.0, 1.0, 11)
    return go.trajectory.JointTrajectory.from_positions(
        time, np.sin(time)[:, None], ["hinge"]
    ).save(file)


def test_a_recording(show: Show, bundled_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The only arm that it has, without being told which."""
    playback = show(bundled_file)
    assert playback.title == "climb, left"
    assert playback.range == pytest.approx((0.0, 6.99), abs=0.01)
    assert "the left arm" in capsys.readouterr().out


@pytest.mark.slow
def test_a_recording_analysed(show: Show, bundled_file: Path) -> None:
    (spans,) = show(bundled_file, "--analyse", "--side", "left").spans.values()
    assert len(spans) > 10


@pytest.mark.slow
def test_both_arms_are_one_person(show: Show, shared: Path) -> None:
    playback = show(shared / "data" / "kit" / "Trial_75.xml", "--side", "both")
    (scene,) = playback.scenes
    assert {trail.name for trail in scene.trails} == {"right hand", "left hand"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "kit/take_book_from_shelf_right_arm_02.c3d",
        "kit/take_book_from_shelf_right_arm_02.mmm2.xml",
        "cmu/02_05.amc",
    ],
)
def test_recordings_of_many_formats(show: Show, shared: Path, name: str) -> None:
    if name.endswith(".c3d"):
        pytest.importorskip("ezc3d", reason="needs the extra c3d")
    (scene,) = show(shared / "data" / name).scenes
    assert scene.trails
    assert bool(scene.clouds) == name.endswith(".c3d")  # the markers


@pytest.mark.slow
def test_what_analyse_wrote(show: Show, analysed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The predicted motion, of a person of the height that the file tells."""
    for path in (analysed, analysed / "synergies.json"):
        playback = show(path)
        (spans,) = playback.spans.values()
        assert len(spans) == len(small_analysis().synergies)
        (trail,) = playback.scenes[0].trails
        assert trail.role == "predicted"
        predicted = small_analysis()
        ends = predicted.model.hand_pose(predicted.predicted.q[[0, -1]])[1]
        np.testing.assert_allclose(trail.points[[0, -1]], ends, atol=1e-6)
    assert "assumed" not in capsys.readouterr().out


@pytest.mark.slow
def test_cuts_have_the_marks_of_the_table_beside_them(
    show: Show, analysed: Path, tmp_path: Path
) -> None:
    (tmp_path / "synergies.json").write_bytes((analysed / "synergies.json").read_bytes())
    times = [each.start_time for each in small_analysis().synergies[1:]]
    rows = [
        f"{time},{mark}\n" for time, mark in zip(times, cycle(["doubtful", "stable"]), strict=False)
    ]
    (tmp_path / "cuts.csv").write_text("".join(["cut [s],cut is\n", *rows]))
    _, *spans = show(tmp_path).spans["synergies"]
    assert [f"{span.start},{span.cut}\n" for span in spans] == rows
    (tmp_path / "cuts.csv").write_text("cut [s],cut is\n0.123,stable\n")  # of another analysis
    assert {span.cut for span in show(tmp_path).spans["synergies"]} == {None}


@pytest.mark.slow
def test_synergies_with_their_recording_are_in_one_pane(
    show: Show, analysed: Path, bundled_file: Path
) -> None:
    for given in ((analysed, bundled_file), (bundled_file, analysed)):
        playback = show(*given)
        (scene,) = playback.scenes
        assert [trail.role for trail in scene.trails] == ["observed", "predicted"]
        assert "synergies" in playback.spans


@pytest.mark.slow
def test_synergies_of_an_unknown_person(
    show: Show, analysed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As files of earlier releases, which did not tell: a person of usual height."""
    record = json.loads((analysed / "synergies.json").read_text())
    del record["model"]
    file = tmp_path / "old.json"
    file.write_text(json.dumps(record))
    show(file)
    assert "assumed height 1.75 m; --height" in capsys.readouterr().out
    show(file, "--height", "1.9")
    assert "assumed" not in capsys.readouterr().out


@pytest.mark.slow
def test_saved_motions_need_no_metric(analysed: Path) -> None:
    """A geodesic has a constant speed in its metric, whatever that is."""
    saved = read_saved_synergies(analysed / "synergies.json")
    time = saved.motion.time
    for synergy in small_analysis().synergies:
        own = (time >= synergy.start_time) & (time < synergy.start_time + synergy.duration - 1e-9)
        np.testing.assert_allclose(saved.motion.q[own], synergy(time[own]), atol=1e-9)
    assert saved.height == pytest.approx(1.78)
    assert saved.model == "human left arm"


@pytest.mark.slow
def test_damaged_synergies_are_named(analysed: Path, tmp_path: Path) -> None:
    good = (analysed / "synergies.json").read_text()
    file = tmp_path / "bad.json"
    for change, message in (
        (good.replace('"law"', '"lore"'), "missing required field `law`"),
        (good.replace('"synergies": [', '"synergies": [], "others": ['), "bad.json: "),
        (good.replace('"height": 1.', '"height": "tall", "other": 1.'), r"at `\$.model.height`"),
    ):
        assert change != good
        file.write_text(change)
        with pytest.raises(go.RecordingError, match=message):
            read_saved_synergies(file)


@pytest.mark.slow
def test_what_retarget_wrote(show: Show, refused: Refused, retargeted: Path) -> None:
    """On an arm that no package knows, which must be given, but whose joints are a person's."""
    message = refused(retargeted)
    assert message.startswith(str(retargeted))
    assert "--robot" in message
    playback = show(retargeted / "synergies.json")
    assert len(playback.spans["synergies"]) == len(small_retargeting().synergies)


def test_a_trajectory(
    show: Show, robot_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for suffix in (".csv", ".json", ".npz"):
        playback = show(swing(tmp_path / f"swing{suffix}"), "--robot", robot_file)
        assert playback.range == pytest.approx((0.0, 1.0))
        assert "the hand is 'bob'" in capsys.readouterr().out


def test_a_trajectory_of_two_robots(show: Show, robot_file: Path, tmp_path: Path) -> None:
    one = go.read_trajectory(swing(tmp_path / "one.csv"))
    names = ("0/hinge", "1/hinge")
    both = go.trajectory.JointTrajectory.side_by_side(
        [one, replace(one, positions=-one.positions)], names
    )
    playback = show(both.save(tmp_path / "both.csv"), "--robot", robot_file, "--robot", robot_file)
    assert [scene.title for scene in playback.scenes] == ["pendulum (1)", "pendulum (2)"]
    assert playback.title == "pendulum, both.csv"


@needs_robots
@pytest.mark.slow
def test_a_trajectory_of_both_arms_of_a_robot(show: Show, tmp_path: Path) -> None:
    """Is shown with one body, of which each link is drawn once."""
    names = ("talos-right-arm", "talos-left-arm")
    robots = [go.load_model(name) for name in names]
    time, parts = np.linspace(0.0, 1.0, 5), []
    for robot in robots:
        q = np.clip(0.0, robot.lower, robot.upper) + 0.1 * np.outer(time, np.ones(robot.dof))
        parts.append(go.trajectory.JointTrajectory.from_positions(time, q, robot.joint_names))
    joints = [joint for robot in robots for joint in robot.joint_names]
    file = go.trajectory.JointTrajectory.side_by_side(parts, joints).save(tmp_path / "both.csv")
    playback = show(file, *["--robot", "talos"] * 2)  # names of the body
    (scene,) = playback.scenes
    assert playback.title == "talos-right-arm and talos-left-arm, both.csv"
    links = [{mesh.link for mesh in actor.meshes} for actor in scene.actors]
    assert not links[0] & links[1]
    assert links[0] | links[1] == {mesh.link for mesh in meshes(robots[0])}
    for trail, name, robot, part in zip(scene.trails, names, robots, parts, strict=True):
        assert trail.name == f"hand, {name}"
        np.testing.assert_allclose(
            trail.points[[0, -1]], robot.hand_pose(part.positions[[0, -1]])[1], atol=1e-9
        )


@needs_robots
@pytest.mark.slow
def test_robots_by_name(
    show: Show, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also where there is a folder of that name, such as that of the demo's results."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "panda").mkdir()
    assert [scene.title for scene in show("panda", "ur5").scenes] == ["panda", "ur5"]
    assert "the folder is ./panda" in capsys.readouterr().out


@needs_robots
@pytest.mark.slow
def test_the_robot_of_a_trajectory_is_named_beside_it(
    show: Show, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = go.load_model("panda")
    time = np.linspace(0.0, 1.0, 5)
    q = np.clip(0.0, robot.lower, robot.upper) + 0.1 * np.outer(time, np.ones(robot.dof))
    trajectory = go.trajectory.JointTrajectory.from_positions(time, q, robot.joint_names)
    trajectory.save(tmp_path / "trajectory.npz")
    metric = go.Euclidean(robot.dof)
    motion = go.Motion(time, q, robot.joint_names, np.full_like(q, 0.1))
    synergies, _ = go.synergies.reconstruct(metric, motion, [(0, len(time) - 1)])
    go.synergies.save_synergies(tmp_path / "synergies.json", synergies, robot.joint_names, robot)
    (scene,) = show(tmp_path).scenes
    assert scene.title.startswith("panda")
    printed = capsys.readouterr().out
    assert "of panda, which is named beside it" in printed
    assert "the robot without the person; both are in report.html" in printed
    assert show(tmp_path / "synergies.json").spans


def test_a_robot_from_a_file(show: Show, robot_file: Path) -> None:
    (scene,) = show(robot_file).scenes
    assert scene.title == "pendulum"


def test_an_alignment(show: Show, refused: Refused, tmp_path: Path, robot_file: Path) -> None:
    file = tmp_path / "aligned.json"
    go.retargeting.align(go.human_arm("right")).save(file)
    assert "--robot" in refused(file)
    assert "not a joint of 'pendulum'" in refused(file, "--robot", robot_file)


@pytest.mark.slow
def test_problems_and_solutions(show: Show, refused: Refused, tmp_path: Path) -> None:
    source = ROOT / "problems" / "around_disc.py"
    solved = show(source)
    assert solved.scenes[0].solids  # the disc
    assert cli.main(["solve", str(source), "--out", str(tmp_path)]) == 0
    for path in (tmp_path, tmp_path / "AroundDisc.json"):
        assert show(path, "--problem", source).title == solved.title


@pytest.mark.slow
def test_a_solution_of_an_unknown_problem_is_named(refused: Refused, tmp_path: Path) -> None:
    source = ROOT / "problems" / "half_plane.py"
    assert cli.main(["solve", str(source), "--out", str(tmp_path)]) == 0
    (file,) = tmp_path.glob("*.json")
    record = json.loads(file.read_text())
    file.write_text(json.dumps(record | {"problem": "Unknown", "module": "elsewhere"}))
    message = refused(file)
    assert str(file) in message
    assert "--problem FILE.py" in message


def test_several_files_are_side_by_side(show: Show, bundled_file: Path, robot_file: Path) -> None:
    playback = show(bundled_file, robot_file, "--title", "Two")
    assert len(playback.scenes) == 2
    assert playback.title == "Two"


@pytest.mark.slow
def test_what_cannot_be_seen_is_named(
    refused: Refused, analysed: Path, tmp_path: Path, shared: Path
) -> None:
    metric = tmp_path / "metric.json"
    metric.write_text('{"format": "geodesic_ocp metric", "version": 1}')
    other = tmp_path / "other.json"
    other.write_text('{"a": 1}')
    (tmp_path / "empty").mkdir()
    (tmp_path / "results").mkdir()
    for path, message in (
        (metric, "geodesic-ocp analyse RECORDING --metric"),
        (other, "its entries are 'a'"),
        (analysed / "table.csv", "have a column for time"),
        (analysed / "figure.png", "looks like a PNG image"),
        (analysed / "figure.pdf", "looks like a PDF document"),
        (tmp_path / "empty", "folder without results"),
        (tmp_path, "results of many recordings"),
        (tmp_path / "missing.csv", "there is no such file"),
        (shared / "data" / "cmu" / "02.asf", "read the motion (AMC)"),
    ):
        assert refused(path).startswith(str(path))
        assert message in refused(path)
    assert "did you mean" in refused("pandaa")


def test_where_to_write_is_checked_first(refused: Refused, tmp_path: Path) -> None:
    for arguments, message in (
        (["--out", tmp_path / "arm.txt"], "must end in .html, .mp4"),
        (["--out", tmp_path], "is a folder, not a file"),
        (["--speed", "2"], "--speed: of videos and pictures only"),
        (["--out", "arm.html", "--rate", "9", "--width", "9"], "--width and --rate: of videos"),
        (["--out", "arm.gif", "--at", "2"], "--at: of a picture only; give --out FILE.png"),
        (["--out", "arm.png", "--rate", "9"], "--rate: of videos only"),
    ):
        assert message in refused("missing", *arguments)  # before anything is read


@pytest.mark.slow
def test_layers_and_the_time_of_a_picture(
    robot_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Are those that the command is given."""
    with playwright_or_skip() as playwright, chromium(playwright):
        pass  # there is one that starts
    base = ["show", str(swing(tmp_path / "swing.csv")), "--robot", str(robot_file)]
    base += ["--width", "200", "--out"]
    file = tmp_path / "end.png"
    assert cli.main([*base, str(file), "--at", "1", "--layers", "frames"]) == 0
    assert f"wrote {file} (" in capsys.readouterr().out
    assert file.read_bytes().startswith(b"\x89PNG")
    for more, message in (
        (["--at", "9"], "at must be from 0 to 1, got 9"),
        (["--layers", "walls"], "layers: 'walls' must be one of frames"),
    ):
        assert cli.main([*base, str(tmp_path / "no.png"), *more]) == 2
        assert message in capsys.readouterr().err
    assert not (tmp_path / "no.png").exists()


def test_the_folder_of_a_retargeting_shows_its_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "trajectory.npz").touch()
    page, copy = tmp_path / "report.html", tmp_path / "copy.html"
    page.write_text("person and robot", encoding="utf-8")
    assert cli.main(["show", str(tmp_path), "--out", str(copy)]) == 0
    assert copy.read_text(encoding="utf-8") == "person and robot"
    opened: list[str] = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr("webbrowser.open", lambda address: not opened.append(address))
    assert cli.main(["show", str(tmp_path)]) == 0
    assert opened == [page.as_uri()]
    os.utime(page, (0, 0))  # of an earlier trajectory, which is not shown in place of this one
    assert cli.main(["show", str(tmp_path)]) == 2
    assert "trajectory.npz" in capsys.readouterr().err


def test_without_a_screen_a_page_is_written(
    robot_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert cli.main(["show", str(robot_file)]) == 0
    assert "wrote pendulum.html" in capsys.readouterr().out
    assert "pendulum" in (tmp_path / "pendulum.html").read_text(encoding="utf-8")
    (tmp_path / "pendulum.html").write_text("kept")
    assert cli.main(["show", str(robot_file)]) == 0  # what is there may be somebody's
    assert "wrote pendulum_2.html" in capsys.readouterr().out
    assert (tmp_path / "pendulum.html").read_text() == "kept"
    opened: list[str] = []
    monkeypatch.setenv("DISPLAY", ":0")

    def browser(address: str) -> bool:
        opened.append(address)
        return True

    monkeypatch.setattr("webbrowser.open", browser)
    assert cli.main(["show", str(robot_file)]) == 0
    assert opened[0].startswith("file:")
    assert cli.main(["show", str(robot_file), "--out", "new/arm.html"]) == 0
    assert (tmp_path / "new" / "arm.html").is_file()
