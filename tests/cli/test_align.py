"""geodesic-ocp align, and retarget on a robot that no package knows."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from commands import Output
from six_joints import six_joints
from small_retargeting import small_analysis

import geodesic_ocp as go
from geodesic_ocp.cli import main as cli
from geodesic_ocp.cli import retarget as retarget_command
from geodesic_ocp.cli.kinds import retargeting_page


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """A URDF without geometry."""
    file = tmp_path / "six.urdf"
    file.write_text(six_joints())
    return file


@pytest.mark.slow
def test_an_alignment_is_shown_written_and_shown_again_as_edited(
    robot: Path, tmp_path: Path, printed: Output, refused: Output
) -> None:
    out = tmp_path / "not there yet" / "six.json"
    command = ["align", str(robot), "--hand", "flange"]
    text = printed(*command, "--out", out)
    for part in ("at (0.000, 0.000, 0.350) m", "along +z of flange", "bend", "assuming that"):
        assert part in text
    assert f"wrote {out}" in text
    assert out.with_suffix(".png").stat().st_size > 10_000
    record = json.loads(out.read_text())
    assert any("where the axes of pan, lift meet" in note for note in record["notes"])
    record["side"], record["shoulder"] = "left", [0.0, 0.1, 0.3]
    out.write_text(json.dumps(record))
    text = printed(*command, "--alignment", out)
    assert f"read from {out}" in text
    assert "at (0.000, 0.100, 0.300) m" in text
    out.write_text(json.dumps(record | {"elbow": "absent"}))
    error = refused(*command, "--alignment", out)
    assert "elbow is 'absent', which is not a joint" in error
    assert f"(with --alignment {out})" in error


def test_side_and_base_are_options(robot: Path, printed: Output) -> None:
    command = ["align", str(robot), "--hand", "flange", "--side", "left", "--base", "floor"]
    text = printed(*command)
    assert "mounted like a left shoulder" in text
    assert "palm" in text
    assert "wrote" not in text


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "hand must name a frame"),
        (["--hand", "nothing"], "hand 'nothing' is not a frame"),
        (["--hand", "flange", "--base", "nothing"], "base 'nothing' is not a frame"),
        (["--hand", "flange", "--out", "six.txt"], "--out: the file must end in .json"),
        (["--hand", "flange", "--alignment", "none.json"], "none.json: there is no such file"),
        (["--hand", "flange", "--alignment", "a.json", "--side", "left"], "--side has no effect"),
    ],
)
def test_wrong_options_end_with_one_line(
    options: list[str], message: str, robot: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["align", str(robot), *options]) == 2
    captured = capsys.readouterr()
    assert message in captured.err.splitlines()[-1]
    assert captured.out == ""


def test_retarget_names_options_that_do_not_fit(
    robot: Path, bundled_file: Path, tmp_path: Path, refused: Output
) -> None:
    command = ["retarget", str(bundled_file), "--side", "left", "--robot", str(robot)]
    assert "--hand: one for each --robot, got flange, flange" in refused(
        *command, "--hand", "flange", "--hand", "flange"
    )
    assert "file must end in .csv, .json, .npz, .parquet, .mcap, .rrd" in refused(
        *command, "--hand", "flange", "--export", "reach.txt"
    )
    missing = tmp_path / "none.json"
    assert "none.json: there is no such file" in refused(
        *command, "--hand", "flange", "--alignment", missing
    )


@pytest.mark.slow
def test_the_exit_code_is_1_without_success(
    robot: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = robot.with_name("results")
    monkeypatch.setattr(retarget_command, "analyse_file", lambda *_: small_analysis())
    command = ["retarget", "reach.csv", "--robot", str(robot), "--hand", "flange"]
    command += ["--orientation-weight", "0", "--out", str(folder), "--mount", "fixed"]
    assert cli.main([*command, "--payload", "15", "--scale", "2.5"]) == 1
    printed = capsys.readouterr()
    for reason in (
        *("not for a robot", "is too weak to hold its arm", "its limit 80"),
        "its pose, which is out of reach",
    ):
        assert reason in printed.err
    file, page = folder / "trajectory.npz", folder / "report.html"  # written all the same
    assert go.read_trajectory(file).joint_names[0] == "pan"
    assert "to see person and robot move" in printed.out
    assert retargeting_page(folder) == page
