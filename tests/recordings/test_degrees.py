"""Angles in degrees where radians are expected are asked about."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_recordings import small_recordings

import geodesic_ocp as go
from geodesic_ocp.trajectory.recording import check_plausible, check_radians

TIME = np.arange(50) / 100.0


def motion(*columns: np.ndarray) -> go.Motion:
    names = go.human_arm("right").joint_names[: len(columns)]
    return go.Motion(TIME, np.column_stack(columns), names)


def write_table(file: Path, recording: go.Motion, unit: str) -> Path:
    lines = [f"# unit: {unit}", ",".join(["time", *recording.joint_names])]
    table = np.column_stack([recording.time, recording.q])
    lines += [",".join(f"{value:.9f}" for value in row) for row in table]
    file.write_text("\n".join(lines))
    return file


@pytest.mark.slow
def test_every_recording_is_accepted_and_refused_in_degrees(shared: Path, tmp_path: Path) -> None:
    files = [*(shared / "data" / "kit").glob("*.xml"), shared / "data" / "cmu" / "02_05.amc"]
    assert len(files) == 7
    for file in files:
        for side in ("right", "left"):
            arm = go.human_arm(side)
            recording = go.read_motion(file, arm.joint_names)
            check_radians(recording.joint_names, recording.q)
            if file.suffix == ".xml":
                check_plausible(arm, recording)
            wrong = replace(recording, q=np.rad2deg(recording.q))
            with pytest.raises(go.RecordingError, match=r"rad: are these degrees\?.*# unit: deg"):
                go.read_motion(write_table(tmp_path / "table.csv", wrong, "rad"))
            with pytest.raises(ValueError, match="are these degrees"):
                check_plausible(arm, wrong)
    right = go.read_motion(write_table(tmp_path / "table.csv", wrong, "degrees"))
    assert right.q == pytest.approx(recording.q, abs=1e-8)


def test_opensim_files_in_degrees_that_say_otherwise(tmp_path: Path) -> None:
    """Their translations may be of any size."""
    content = small_recordings()["motion.mot"].decode()
    content = content.replace("arm_add_r", "pelvis_tx").replace("-5", "25")
    (tmp_path / "right.mot").write_text(content)
    assert go.read_motion(tmp_path / "right.mot").q.max() > 25.0
    (tmp_path / "wrong.mot").write_text(content.replace("inDegrees=yes", "inDegrees=no"))
    with pytest.raises(go.RecordingError, match=r"elbow_flex_r reaches 42 rad: .* inDegrees=yes"):
        go.read_motion(tmp_path / "wrong.mot")


def test_degrees_of_small_motions_are_found_by_the_limits() -> None:
    """Below two revolutions nothing tells a file in degrees, but the limits of the arm do."""
    arm = go.human_arm("right")
    small = motion(
        *(column + 0.3 * np.sin(TIME) for column in [5.0, 4.0, -9.0, 8.0, 3.0, 1.0, 1.0])
    )
    check_radians(small.joint_names, small.q)
    with pytest.raises(ValueError, match=r"RSy_joint reaches -9 rad: are these degrees\?"):
        check_plausible(arm, small)


def test_a_spike_is_no_unit() -> None:
    angles = [0.1 * np.sin(TIME) for _ in range(7)]
    angles[0][20] = 10.0
    with pytest.raises(ValueError, match=r"RSx_joint is 10 at sample 20, .* or a spike\?"):
        check_plausible(go.human_arm("right"), motion(*angles))


def test_angles_of_almost_two_revolutions_are_radians() -> None:
    check_radians(["a"], np.linspace([0.0], [4.0 * np.pi], 50))
    with pytest.raises(ValueError, match=r"b reaches -12\.6 rad"):
        check_radians(["a", "b"], np.linspace([0.0, 0.0], [12.5, -12.6], 50))


@pytest.mark.parametrize("function", [go.log, go.distance, go.geodesic])
def test_geodesics_between_points_in_degrees_are_refused_at_once(
    function: object, arm_metric: go.KineticEnergy
) -> None:
    start = np.zeros(7)
    goal = np.array([30.0, 10.0, -5.0, 92.4, 0.0, 0.0, 0.0])
    message = r"q[01]: R\w+_joint is at [\d.]+ rad, more than a revolution .* are these degrees\?"
    with pytest.raises(ValueError, match=message):
        function(arm_metric, start, goal)  # type: ignore[operator]
    with pytest.raises(ValueError, match=message):
        function(arm_metric, goal, start)  # type: ignore[operator]


def test_motions_in_degrees_are_not_segmented(arm_metric: go.KineticEnergy) -> None:
    small = motion(*(0.5 * np.sin(TIME + phase) for phase in range(7)))
    assert go.segment(arm_metric, small.filtered())
    wrong = replace(small, q=np.rad2deg(small.q)).filtered()
    with pytest.raises(ValueError, match=r"motion: R\w+_joint is at .* are these degrees\?"):
        go.segment(arm_metric, wrong)


def test_exp_from_a_point_in_degrees_is_refused(arm_metric: go.KineticEnergy) -> None:
    with pytest.raises(ValueError, match=r"q: REx_joint is at 92\.4 rad, .* are these degrees\?"):
        go.exp(arm_metric, [0.0, 0.0, 0.0, 92.4, 0.0, 0.0, 0.0], np.ones(7))


def test_joints_may_be_a_revolution_beyond_their_limits(arm_metric: go.KineticEnergy) -> None:
    arm = arm_metric.model
    for q in (arm.lower - 6.28, arm.upper + 6.28):
        assert np.array_equal(arm_metric.point("q", q), q)
    beyond = arm.upper.copy()
    beyond[2] += 6.29
    with pytest.raises(ValueError, match="RSy_joint is at 6"):
        arm_metric.point("q", beyond)


def test_continuous_joints_and_other_metrics_may_be_anywhere(arm: go.Model) -> None:
    q = np.array([0.0, 0.0, 0.0, 0.5, 100.0, 0.0, 0.0])
    continuous = replace(arm, continuous=("REz_joint",))
    assert np.array_equal(go.KineticEnergy(continuous).point("q", q), q)
    assert go.distance(go.Euclidean(2), [0.0, 0.0], [300.0, 400.0]) == pytest.approx(500.0)


def test_radians_that_are_declared_as_degrees_are_asked_about(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    angles = np.linspace(-0.5, 1.5, 20)
    rows = "\n".join(f"{0.01 * k},{q}" for k, q in enumerate(angles))
    file.write_text(f"# unit: deg\ntime,elbow\n{rows}\n")
    with pytest.warns(RuntimeWarning, match=r"a\.csv: no joint moves by more than 2 deg"):
        go.read_motion(file)
    table = tmp_path / "a.mot"
    tabs = rows.replace(",", "\t")
    table.write_text(f"inDegrees=yes\nendheader\ntime\telbow\n{tabs}\n")
    with pytest.warns(RuntimeWarning, match="in radians, although the file says degrees"):
        go.read_motion(table)
