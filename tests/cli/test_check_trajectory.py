"""geodesic-ocp check-trajectory: what it prints, and its exit codes."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from installed_robots import known_robot

import geodesic_ocp as go
from geodesic_ocp.cli import main as cli
from geodesic_ocp.cli.options import as_obstacle
from geodesic_ocp.model.primitives import Obstacle
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

ROBOT = """<robot name="one"><link name="base"/><link name="a"><inertial><mass value="1"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" velocity="2" effort="9"/></joint></robot>"""


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    """A robot, and its movement from rest to rest."""
    robot = tmp_path / "robot.urdf"
    robot.write_text(ROBOT)
    time = np.linspace(0.0, 2.0, 201)
    law = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    states = [(law.deriv(k) if k else law)(time / 2.0)[:, None] / 2.0**k for k in range(3)]
    trajectory = JointTrajectory(time, *states, ("turn",))
    return str(trajectory.save(tmp_path / "turn.csv")), str(robot)


def run(*arguments: str) -> int:
    return cli.main(["check-trajectory", *arguments])


def test_a_good_trajectory_has_exit_code_zero(
    files: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    file, robot = files
    assert run(file, "--robot", robot, "--hand", "a") == 0
    out = capsys.readouterr().out
    assert "turn.csv: 201 samples, 2 s, 100 Hz" in out
    assert "all conditions hold" in out
    assert "jerk: default: full acceleration within 0.05 s" in out
    assert run(file, "--robot", robot, "--hand", "a", "--hand", "arm") == 2  # of a body
    assert "hand 'arm' is not a frame of 'one'" in capsys.readouterr().err
    assert run(file, *["--robot", robot] * 3, *["--hand", "a"] * 2) == 2
    assert "--hand: one for all or for each --robot, got a, a" in capsys.readouterr().err


@pytest.mark.parametrize("limit", ["0.9", "turn=0.9"])
def test_limits_on_the_command_line_are_checked(
    files: tuple[str, str], capsys: pytest.CaptureFixture[str], limit: str
) -> None:
    file, robot = files
    assert run(file, "--robot", robot, "--hand", "a", "--velocity", limit) == 1
    assert "velocity of turn is 0.9375 rad/s at 1 s, its limit 0.9" in capsys.readouterr().out


def test_rest_and_even_samples_can_be_waived(
    files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, robot = files
    cut = tmp_path / "cut.csv"
    lines = Path(file).read_text().splitlines()
    cut.write_text("\n".join([*lines[:100], *lines[101:160]]))
    assert run(str(cut), "--robot", robot, "--hand", "a") == 1
    out = capsys.readouterr().out
    assert "not evenly spaced" in out
    assert "not at rest" in out
    assert run(str(cut), "--robot", robot, "--hand", "a", "--moving", "--uneven") == 0


def test_clearance_is_checked_where_geometry_is_known(
    files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, robot = files
    run(file, "--robot", robot, "--hand", "a")
    assert "note: clearance is not checked: the robot has no" in capsys.readouterr().out
    names = known_robot("panda").joint_names
    q = np.tile([0.0, -1.7, 0.0, -3.0, 0.0, 0.0, 0.0], (3, 1))  # the hand is in the shoulder
    folded = JointTrajectory(np.arange(3) / 100, q, 0 * q, 0 * q, names)
    assert run(str(folded.save(tmp_path / "folded.npz")), "--robot", "panda") == 1
    out = capsys.readouterr().out
    assert "m apart at 0 s" in out
    assert "least distance of links: 0 m" in out
    run(str(tmp_path / "folded.npz"), "--robot", "panda", "--no-clearance")
    assert "least distance" not in capsys.readouterr().out


def test_wrong_limits_are_named(files: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    file, robot = files
    for values, message in (
        (["fast"], "--jerk fast: must be LIMIT or JOINT=LIMIT"),
        (["1", "2"], "--jerk: several limits must be JOINT=LIMIT each, got 1"),
        (["elbow=1"], "'elbow' is not one of the joints turn"),
    ):
        arguments = [part for value in values for part in ("--jerk", value)]
        assert run(file, "--robot", robot, "--hand", "a", *arguments) == 2
        assert message in capsys.readouterr().err


def test_gravity_is_given_or_that_of_the_alignment(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    panda = known_robot("panda")
    q = np.tile([0.0, 1.2, 0.0, -0.1, 0.0, 1.0, 0.0], (3, 1))  # stretched forward
    here = JointTrajectory(np.arange(3) / 100, q, 0 * q, 0 * q, panda.joint_names)
    file = str(here.save(tmp_path / "still.json"))
    down = -9.81 * go.retargeting.align(panda).base[:, 2]
    tables = []
    for arguments in ([], ["--gravity", *map(str, down)], ["--aligned"]):
        run(file, "--robot", "panda", "--no-clearance", *arguments)
        tables.append(capsys.readouterr().out)
    assert tables[1] == tables[2] != tables[0]
    assert run(file, "--robot", "panda", "--aligned", "--gravity", "0", "0", "-9.81") == 2
    assert "exclude each other" in capsys.readouterr().err


ONE_JOINT = "joint_limits: {turn: {has_velocity_limits: true, max_velocity: 1.0}}"


@pytest.mark.slow
def test_shares_and_files_of_moveit_limit_joints_and_hand(
    files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("yaml")
    file, robot = files
    (tmp_path / "joint_limits.yaml").write_text(ONE_JOINT)
    moveit = ["--joint-limits", str(tmp_path / "joint_limits.yaml")]
    for arguments, code, message in (
        (moveit, 0, "all conditions hold"),
        ([*moveit, "--velocity", "90%"], 1, "0.9375 rad/s at 1 s, its limit 0.9"),
        (["--position", "90%"], 1, "turn is at 1 rad at 2 s, outside its range of -0.9 to 0.9"),
        (["--torque-rate", "1.0"], 1, "torque rate of turn is"),
        (["--hand-speed", "1"], 0, "fastest hand: 0 m/s"),
    ):
        assert run(file, "--robot", robot, "--hand", "a", *arguments) == code
        assert message in capsys.readouterr().out
    for arguments, message in (
        (["--hand-speed", "50%"], "hand_speed must be above 0% and at most 100% of a limit"),
        (["--position", "0.9"], "position must be a share of the range such as 90%, got 0.9"),
        (["--payload", "1,2"], "must be MASS[,x,y,z[,ixx,iyy,izz[,ixy,ixz,iyz]]]"),
        (["--obstacle", "ball:0,0,0,0.1"], "--obstacle: distances are not known"),
    ):
        assert run(file, "--robot", robot, "--hand", "a", *arguments) == 2
        assert message in capsys.readouterr().err


def test_obstacles_and_loads_from_a_file_are_checked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("yaml")
    panda = known_robot("panda")
    q = np.tile([0.0, 0.3, 0.0, -1.8, 0.0, 2.1, 0.0], (3, 1))
    still = JointTrajectory(np.arange(3) / 100, q, 0 * q, 0 * q, panda.joint_names)
    x, y, z = panda.hand_pose(q[0])[1]
    room = tmp_path / "room.yaml"
    room.write_text(f"obstacle: ['ball:{x},{y},{z},0.05']\npayload: 1,0,0,0.1\n")
    arguments = [str(still.save(tmp_path / "still.csv")), "--robot", "panda"]
    assert run(*arguments, "--settings", str(room)) == 1
    out = capsys.readouterr().out
    assert f"panda_hand to ball:{x},{y},{z},0.05: " in out
    loaded = panda.with_payload(1.0, [0.0, 0.0, 0.1]).inverse_dynamics(q[0], 0 * q[0], 0 * q[0])
    assert f"{abs(loaded[1]):.1f}" in out
    assert run(*arguments, "--obstacle", "half-space:0,0,-1,0,0,1") == 0


def test_a_body_stands_for_the_arm_that_moves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As in `retarget`, which writes its trajectory and the alignments of both hands."""
    files = {}
    for name in ("g1", "g1-left-arm"):
        robot = known_robot(name)
        q = np.tile((robot.lower + robot.upper) / 2.0, (3, 1))
        still = JointTrajectory(np.arange(3) / 100, q, 0 * q, 0 * q, robot.joint_names)
        files[name] = str(still.save(tmp_path / f"{name}.csv"))
    tables = []
    for name in ("g1", "g1-left-arm"):
        run(files["g1-left-arm"], "--robot", name, "--aligned", "--no-clearance")
        tables.append(capsys.readouterr().out)
    assert tables[0] == tables[1]
    assert "limits of g1-left-arm:" in tables[0]
    body = known_robot("g1")
    aligned = [go.retargeting.align(body.with_hand(hand)) for hand in body.hands]
    right, left = (str(each.save(tmp_path / f"{each.side}.json")) for each in aligned)
    command = [files["g1"], "--robot", "g1", "--no-clearance", "--alignment", right, "--alignment"]
    assert run(*command, left) == 0
    tilted = replace(aligned[1], base=[[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    assert run(*command, str(tilted.save(tmp_path / "tilted.json"))) == 2
    assert "--alignment: those of the hands of a body differ" in capsys.readouterr().err
    assert cli.main(["align", "g1", "--alignment", left]) == 0
    assert "along +x of left_rubber_hand" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("box:1,2,3,0.1,0.2,0.3", go.Box((1, 2, 3), (0.1, 0.2, 0.3))),
        (
            "box:1,2,3,0.1,0.2,0.3,0,0,1.5707963267948966",
            go.Box((1, 2, 3), (0.1, 0.2, 0.3), ((0, -1, 0), (1, 0, 0), (0, 0, 1))),
        ),
        ("ball:1,2,3,0.5", go.Ball((1, 2, 3), 0.5)),
        ("capsule:0,0,0,0,0,1,0.5", go.Capsule((0, 0, 0), (0, 0, 1), 0.5)),
        ("half-space:0,0,1,0,0,2", go.HalfSpace((0, 0, 1), (0, 0, 1))),
    ],
)
def test_obstacles_are_written_in_one_line(text: str, expected: Obstacle) -> None:
    found = as_obstacle(text)
    assert found.name == text
    for field in fields(expected):
        if field.name not in ("name", "link"):
            one, other = (getattr(each, field.name) for each in (found, expected))
            assert np.allclose(one, other, atol=1e-12)
    for wrong in (text + ",1", text.replace(":", ",")):
        with pytest.raises(ValueError, match=r"^--obstacle"):
            as_obstacle(wrong)
