"""Trajectories read from files: round trips, other people's tables, and malformed files."""

from __future__ import annotations

import json
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose

from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory, last_digit
from geodesic_ocp.trajectory.read_trajectory import read_trajectory

NUMBERS = st.floats(-1e6, 1e6, allow_nan=False)
NAMES = st.lists(st.text("abxyzAZ09_/,é-", min_size=1, max_size=12), min_size=1, max_size=4)


@st.composite
def trajectories(draw: Any, units: Any) -> JointTrajectory:
    names = tuple(dict.fromkeys(draw(NAMES)))
    shape = (draw(st.integers(1, 6)), len(names))
    tables = [draw(arrays(float, shape, elements=NUMBERS)) for _ in range(4)]
    time = np.cumsum(draw(arrays(float, shape[0], elements=st.floats(1e-3, 10.0))))
    chosen = tuple(draw(st.sampled_from(units)) for _ in names)
    efforts = tables[3] if draw(st.booleans()) else None
    return JointTrajectory(time, *tables[:3], names, chosen, efforts)


def round_trip(trajectory: JointTrajectory, suffix: str) -> JointTrajectory:
    with tempfile.TemporaryDirectory() as folder:
        return read_trajectory(trajectory.save(Path(folder) / f"trajectory{suffix}", effort=True))


def assert_same(one: JointTrajectory, other: JointTrajectory, instants: float = 0.0) -> None:
    assert one.joint_names == other.joint_names
    assert one.units == other.units
    assert_allclose(one.time, other.time, rtol=0.0, atol=instants)
    for name in ("positions", "velocities", "accelerations"):
        assert np.array_equal(getattr(one, name), getattr(other, name))
    assert (one.efforts is None) == (other.efforts is None)
    if one.efforts is not None and other.efforts is not None:
        assert np.array_equal(one.efforts, other.efforts)


@given(trajectories(["rad", "m"]))
def test_csv_and_npz_keep_everything(trajectory: JointTrajectory) -> None:
    for suffix in (".csv", ".npz"):
        assert_same(round_trip(trajectory, suffix), trajectory)


@given(trajectories(["rad"]))
def test_json_keeps_everything_but_units_and_fractions_of_a_nanosecond(
    trajectory: JointTrajectory,
) -> None:
    assert_same(round_trip(trajectory, ".json"), trajectory, instants=0.6e-9)


def write(folder: Path, name: str, text: str) -> Path:
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file


def test_a_table_of_positions_alone_gets_derivatives_of_a_spline(tmp_path: Path) -> None:
    time = np.linspace(0.0, 1.0, 6)
    rows = [f"{t}, {t**3 - t}, {180.0 * t}" for t in time]
    header = "# a comment\ntime [s], shoulder, elbow_position [deg]"
    found = read_trajectory(write(tmp_path, "foreign.csv", "\n".join([header, *rows]) + "\r\n"))
    assert found.joint_names == ("shoulder", "elbow")
    # A cubic is its own spline.
    assert_allclose(found.velocities[:, 0], 3.0 * time**2 - 1.0, atol=1e-12)
    assert_allclose(found.accelerations[:, 0], 6.0 * time, atol=1e-11)
    assert_allclose(found.velocities[:, 1], np.pi)


def test_a_table_with_velocities_gets_accelerations_from_them(tmp_path: Path) -> None:
    rows = [f"{t},0,{t**2}" for t in range(5)]  # velocities that contradict the positions stay
    found = read_trajectory(write(tmp_path, "v.csv", "\n".join(["t,a,a velocity", *rows])))
    assert_allclose(found.velocities[:, 0], np.arange(5.0) ** 2)
    assert_allclose(found.accelerations[:, 0], 2.0 * np.arange(5.0), atol=1e-12)


def test_the_unit_of_a_recording_is_read(tmp_path: Path) -> None:
    table = "# unit: deg\ntime,a\n0,0\n1,90\n2,180\n3,270\n"
    found = read_trajectory(write(tmp_path, "recording.csv", table))
    assert_allclose(found.positions[-1], 1.5 * np.pi)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "has no header"),
        ("a,b\n0,1\n", "line 1 must be a header with time"),
        ("time,a\n0,1\n1\n", "line 3 has 1 entries, the header 2"),
        ("time,a\n0,1\n1,x\n", r"line 3 must be finite numbers, is \['1', 'x'\]"),
        ("time,a\n0,nan\n", "line 2 must be finite numbers"),
        ("time,a\n", "no rows"),
        ("time,a,a position\n0,1,1\n", "line 1: column 3, 'a position', is there twice"),
        ("time,a,b velocity\n0,1,1\n", "line 1: no position of b"),
        ("time,a velocity\n0,1\n", "line 1: no joint has a position"),
        ("time,a [N]\n0,1\n", r"line 1: the unit of 'a \[N\]' must be rad, deg or m"),
        ("# unit: turns\ntime,a\n0,1\n", "line 1: the unit must be rad, deg or m, is 'turns'"),
        ("time,a\n0,1\n1,1\n1,1\n2,1\n", "at least four samples only, got 3"),
    ],
)
def test_malformed_tables_are_named_by_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ValueError, match=rf"bad\.csv: .*{message}"):
        read_trajectory(write(tmp_path, "bad.csv", text))


POINT = {"positions": [1.0], "time_from_start": {"sec": 0, "nanosec": 1}}


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ("{", "is not a ROS 2 message in JSON"),
        ("[]", "Expected `object`, got `array`"),
        (
            {"joint_names": ["a"], "points": []},
            r"length >= 1 - at `\$\.points`",
        ),
        (
            {"joint_names": ["a"], "points": [3]},
            r"got `int` - at `\$\.points\[0\]`",
        ),
        ({"joint_names": ["a", "b"], "points": [POINT]}, r"points\[0\]\.positions must be 2"),
        (
            {"joint_names": ["a"], "points": [POINT, {**POINT, "velocities": [True]}]},
            r"Expected `float`, got `bool` - at `\$\.points\[1\]\.velocities\[0\]`",
        ),
    ],
)
def test_malformed_messages_are_named_by_field(tmp_path: Path, message: Any, expected: str) -> None:
    text = message if isinstance(message, str) else json.dumps(message)
    with pytest.raises(ValueError, match=rf"bad\.json: .*{expected}"):
        read_trajectory(write(tmp_path, "bad.json", text))


def test_malformed_archives_are_named_by_array(tmp_path: Path) -> None:
    file = tmp_path / "bad.npz"
    file.write_bytes(b"PK nothing")
    with pytest.raises(ValueError, match=r"bad\.npz: is no archive"):
        read_trajectory(file)
    np.savez(file, time=np.arange(3.0))
    with pytest.raises(ValueError, match=r"bad\.npz: has no array position, only time"):
        read_trajectory(file)
    names = np.array(["a"])
    np.savez(file, time=np.array(["x"]), position=np.zeros((1, 1)), joint_names=names)
    with pytest.raises(ValueError, match=r"bad\.npz: time must be numbers"):
        read_trajectory(file)
    np.savez(file, time=np.arange(3.0), position=np.zeros((2, 1)), joint_names=names)
    with pytest.raises(ValueError, match=r"bad\.npz: positions must have shape \(3, 1\)"):
        read_trajectory(file)
    np.savez(file, time=np.array([0.0, 1.0, np.inf]), position=np.zeros((3, 1)), joint_names=names)
    with pytest.raises(ValueError, match=r"bad\.npz: time must be finite, sample 2 is not"):
        read_trajectory(file)
    np.savez(file, time=np.zeros((3, 1)), position=np.zeros((3, 1)), joint_names=names)
    with pytest.raises(ValueError, match=r"bad\.npz: time must have shape \(3,\), got \(3, 1\)"):
        read_trajectory(file)


def test_missing_and_other_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"none\.csv: there is no such file"):
        read_trajectory(tmp_path / "none.csv")
    with pytest.raises(ValueError, match=r"a\.bag: must end in \.csv, \.json, \.npz"):
        read_trajectory(write(tmp_path, "a.bag", ""))


def test_members_that_are_no_arrays_and_huge_integers_are_refused(tmp_path: Path) -> None:
    archive = tmp_path / "trajectory.npz"
    with zipfile.ZipFile(archive, "w") as members:
        for name in ("time", "position", "joint_names"):
            members.writestr(f"{name}.npy", b"nothing")
    with pytest.raises(ValueError, match=r"trajectory.npz: "):
        read_trajectory(archive)
    message = tmp_path / "trajectory.json"
    point = {"time_from_start": {"sec": 10**400}, "positions": [1.0]}
    message.write_text(json.dumps({"joint_names": ["a"], "points": [point]}))
    with pytest.raises(ValueError, match=r"trajectory.json: .* is not finite"):
        read_trajectory(message)


def _points(*first: float) -> list[dict[str, Any]]:
    """Points 0.1 s apart, the first position given once or twice, both at 0 s."""
    positions = [*first, 0.1, 0.4, 0.9, 1.6]
    seconds = [0.0] * len(first) + [0.1, 0.2, 0.3, 0.4]
    return [
        {
            "positions": [q],
            "time_from_start": {"sec": 0, "nanosec": round(1e9 * t)},
        }
        for q, t in zip(positions, seconds, strict=True)
    ]


@pytest.mark.parametrize("suffix", [".json", ".yaml"])
def test_goals_of_follow_joint_trajectory_are_read(tmp_path: Path, suffix: str) -> None:
    goal = {
        "trajectory": {"joint_names": ["a"], "points": _points(0.0)},
        "goal_time_tolerance": {"sec": 1, "nanosec": 0},
    }
    text = json.dumps(goal)
    if suffix == ".yaml":
        text = pytest.importorskip("yaml").safe_dump(goal)
    found = read_trajectory(write(tmp_path, f"goal{suffix}", text))
    assert_allclose(found.positions[:, 0], [0.0, 0.1, 0.4, 0.9, 1.6])
    assert_allclose(found.time, [0.0, 0.1, 0.2, 0.3, 0.4])
    assert found.derived == ("velocity", "acceleration")


def test_a_point_that_is_there_twice_is_left_out(tmp_path: Path) -> None:
    goal = {"joint_names": ["a"], "points": _points(0.0, 0.0)}
    with pytest.warns(UserWarning, match=r"twice\.json: left out, .*: points 1, counted from 0"):
        found = read_trajectory(write(tmp_path, "twice.json", json.dumps(goal)))
    assert_allclose(found.positions[:, 0], [0.0, 0.1, 0.4, 0.9, 1.6])
    other = {"joint_names": ["a"], "points": _points(0.0, 0.5)}
    with pytest.raises(ValueError, match=r"points 0 and 1, .* both at 0 s, and their position"):
        read_trajectory(write(tmp_path, "other.json", json.dumps(other)))
    rows = "time,a\n0,0\n0,0\n0.1,0.1\n0.2,0.4\n0.3,0.9\n"
    with pytest.warns(UserWarning, match="points 1"):
        assert len(read_trajectory(write(tmp_path, "twice.csv", rows)).time) == 4


def at_times(folder: Path, times: Sequence[str]) -> JointTrajectory:
    rows = "\n".join(f"{time},{float(time) ** 2:.6f}" for time in times)
    return read_trajectory(write(folder, "a.csv", f"time,a\n{rows}\n"))


@pytest.mark.parametrize("decimals", [2, 3, 4])
def test_times_that_are_rounded_are_even(tmp_path: Path, decimals: int) -> None:
    """30 samples a second are 0.033, 0.067 and 0.1 s; without one of them they are uneven."""
    times = [f"{k / 30:.{decimals}f}" for k in range(61)]
    assert at_times(tmp_path, times).rate == pytest.approx(30.0)
    assert at_times(tmp_path, times[:20] + times[21:]).rate is None


def test_a_sample_that_is_left_out_is_no_rounding(tmp_path: Path) -> None:
    times = [f"{k / 100:.2f}" for k in range(150) if k != 70]
    assert at_times(tmp_path, times).rate is None
    assert at_times(tmp_path, ["0", "1", "2.5", "4", "5"]).time.tolist() == [0, 1, 2.5, 4, 5]


def test_times_that_do_not_increase_are_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"a\.csv: .* sample 3 at 0.1 s follows 0.2 s"):
        at_times(tmp_path, ["0", "0.15", "0.2", "0.1", "0.3"])


def test_the_last_digit_is_that_of_the_unit_in_the_file(tmp_path: Path) -> None:
    rows = "\n".join(f"{k / 100},{k * k / 7:.2f},{k / 13:.4f}" for k in range(20))
    found = read_trajectory(write(tmp_path, "a.csv", f"time,a [deg],b\n{rows}\n"))
    assert_allclose(found.last_digits("position"), [1e-4 * np.pi / 180.0, 1e-4])
    single = np.sin(np.arange(20.0)).astype(np.float32).astype(float)
    assert last_digit(single) == pytest.approx(np.spacing(np.float32(1.0)) / 2.0)
    assert last_digit(np.array([-2.0, 0.0, 2.0])) <= 1e-15
    assert last_digit(np.sin(np.arange(20.0))) <= 1e-14
