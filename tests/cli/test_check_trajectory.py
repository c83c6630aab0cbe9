"""geodesic-ocp check-trajectory: what it prints, and its exit codes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from installed_robots import known_robot

import geodesic_ocp as go
from geodesic_ocp.cli import main as cli
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
