"""Trajectories for controllers: CSV, JSON with the fields of the ROS 2 message, NumPy archives."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

TIME = np.array([0.0, 0.25, 1.9999999999])


def some(names: tuple[str, ...] = ("a", "b"), **more: Any) -> JointTrajectory:
    values = np.arange(18.0).reshape(3, 3, 2) / 7.0
    return JointTrajectory(TIME, values[0], values[1], values[2], names, **more)


def swing(count: int) -> JointTrajectory:
    time = np.linspace(0.0, 3.0, count)
    waves = np.exp(1j * np.outer(time, [2.0, 1.0])) * [1.0, 1.0j]
    rates = np.array([2.0j, 1.0j])
    return JointTrajectory(
        time, waves.imag, (waves * rates).imag, (waves * rates**2).imag, ("a", "b")
    )


def test_csv_has_all_digits() -> None:
    header, *rows = list(csv.reader(io.StringIO(some().csv())))
    assert header[:4] == ["time_from_start", "a position", "b position", "a velocity"]
    numbers = np.array(rows, dtype=float)
    assert np.array_equal(numbers[:, 0], TIME)
    assert np.array_equal(numbers[:, 1:3], some().positions)
    assert np.array_equal(numbers[:, 5:7], some().accelerations)


def test_csv_names_the_units_of_prismatic_joints_and_has_efforts() -> None:
    trajectory = some(units=("m", "rad"), efforts=np.ones((3, 2)))
    header = trajectory.csv().splitlines()[0].split(",")[1:]
    assert header[:4] == ["a position [m]", "b position", "a velocity [m/s]", "b velocity"]
    assert header[4:] == ["a acceleration [m/s^2]", "b acceleration", "a effort [N]", "b effort"]


def test_json_has_the_fields_of_a_ros_message() -> None:
    trajectory = some(efforts=np.ones((3, 2)))
    message = json.loads(trajectory.json())
    assert message["joint_names"] == ["a", "b"]
    assert set(message) == {"header", "joint_names", "points"}
    for k, point in enumerate(message["points"]):
        assert set(point) == {
            "positions",
            "velocities",
            "accelerations",
            "effort",
            "time_from_start",
        }
        assert_allclose(point["velocities"], some().velocities[k])
        assert point["effort"] == []  # joint_trajectory_controller rejects any other
        since = point["time_from_start"]
        assert 0 <= since["nanosec"] < 10**9
        assert since["sec"] + since["nanosec"] / 1e9 == np.round(TIME[k], 9)
    assert json.loads(trajectory.json(effort=True))["points"][0]["effort"] == [1.0, 1.0]


def test_npz_has_plain_arrays(tmp_path: Path) -> None:
    with np.load(swing(31).save(tmp_path / "swing.npz")) as archive:
        assert archive["joint_names"].tolist() == ["a", "b"]
        assert archive["units"].tolist() == ["rad", "rad"]
        assert archive["rate"] == pytest.approx(10.0)
        assert np.array_equal(archive["velocity"], swing(31).velocities)
        assert "effort" not in archive
    with np.load(some(efforts=np.ones((3, 2))).save(tmp_path / "some.npz")) as archive:
        assert np.isnan(archive["rate"])
        assert archive["effort"].shape == (3, 2)


def test_parquet_is_an_episode_of_lerobot(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(swing(31).save(tmp_path / "swing.parquet"))
    states, actions = (
        np.array(table[each].to_pylist()) for each in ("observation.state", "action")
    )
    assert_allclose(states, swing(31).positions, atol=1e-6)
    assert np.array_equal(actions[:-1], states[1:])
    assert_allclose(table["timestamp"], swing(31).time, atol=1e-6)
    info = json.loads(table.schema.metadata[b"info"])
    assert info["fps"] == pytest.approx(10.0)
    assert info["features"]["action"]["names"] == ["a", "b"]
    with pytest.raises(ValueError, match="evenly spaced"):
        some().save(tmp_path / "some.parquet")


def test_mcap_has_joint_states(tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    with some().save(tmp_path / "some.mcap").open("rb") as file:
        found = list(reader.make_reader(file).iter_messages())
    assert [message.log_time for _, _, message in found] == [0, 250_000_000, 2_000_000_000]
    schema, channel, last = found[-1]
    assert (schema.name, channel.topic) == ("sensor_msgs/msg/JointState", "/joint_states")
    state = json.loads(last.data)
    assert state["header"]["stamp"] == {"sec": 2, "nanosec": 0}
    assert (state["name"], state["effort"]) == (["a", "b"], [])
    assert state["velocity"] == some().velocities[-1].tolist()


def test_rerun_has_a_series_for_each_joint(tmp_path: Path) -> None:
    chunks = pytest.importorskip("rerun.chunk")
    file = some().save(tmp_path / "some.rrd")
    found = {each.entity_path: each.to_record_batch() for each in chunks.RrdReader(file).stream()}
    batch = found["/velocity/b"].to_pydict()
    assert [each.total_seconds() for each in batch["time"]] == pytest.approx(TIME, abs=1e-6)
    assert np.ravel(batch["Scalars:scalars"]).tolist() == some().velocities[:, 1].tolist()


def test_a_file_of_another_kind_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"\.csv, \.json, \.npz"):
        some().save(tmp_path / "trajectory.txt")
    assert not list(tmp_path.iterdir())


def test_trajectories_side_by_side() -> None:
    both = JointTrajectory.side_by_side([some(units=("rad", "m")), some()], ("a", "b", "c", "d"))
    assert both.positions.shape == (3, 4)
    assert both.units == ("rad", "m", "rad", "rad")
    assert_allclose(both.velocities[:, 2:], some().velocities)
    assert json.loads(both.json())["joint_names"] == ["a", "b", "c", "d"]
    first = both.columns(slice(2), ("x", "y"))
    assert first.csv() == replace(some(units=("rad", "m")), joint_names=("x", "y")).csv()
    with pytest.raises(ValueError, match="same times"):
        JointTrajectory.side_by_side([swing(3), some()], ("a", "b", "c", "d"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"time": [0.0, 1.0]}, r"positions must have shape \(2, 2\), got \(3, 2\)"),
        ({"velocities": np.zeros((3, 3))}, r"velocities must have shape \(3, 2\)"),
        ({"accelerations": np.full((3, 2), np.nan)}, "accelerations must be finite, sample 0"),
        ({"joint_names": ("a", "a")}, "joints of different names"),
        ({"units": ("deg", "rad")}, "units must be 'rad' or 'm'"),
        ({"efforts": np.zeros(3)}, "efforts must have shape"),
    ],
)
def test_wrong_arrays_are_named(change: dict[str, Any], message: str) -> None:
    values = np.zeros((3, 2))
    right = {"time": TIME, "positions": values, "velocities": values, "accelerations": values}
    with pytest.raises(ValueError, match=message):
        JointTrajectory(**{**right, "joint_names": ("a", "b"), **change})


def test_rate_is_that_of_even_samples_only() -> None:
    assert swing(301).rate == pytest.approx(100.0)
    assert some().rate is None


def test_sampling_at_a_rate_has_the_order_of_quintic_interpolation() -> None:
    errors = []
    for count in (16, 31):
        dense = swing(count).at_rate(1000.0)
        exact = swing(3001)
        assert dense.rate == pytest.approx(1000.0)
        assert_allclose(dense.time, exact.time, atol=1e-12)
        errors.append(np.abs(dense.positions - exact.positions).max())
    assert errors[0] / errors[1] > 0.8 * 2**6  # of order six


@pytest.mark.parametrize("rate", [7.3, 100.0, 333.3])
def test_sampling_at_a_rate_stretches_time_to_whole_steps(rate: float) -> None:
    given = swing(301)
    sampled = given.at_rate(rate)
    assert sampled.rate == pytest.approx(rate, rel=1e-9)
    assert 0.0 <= sampled.duration - given.duration < 1.0 / rate
    assert_allclose(sampled.positions[[0, -1]], given.positions[[0, -1]], atol=1e-12)
    stretch = sampled.duration / given.duration
    assert_allclose(sampled.velocities[-1], given.velocities[-1] / stretch, atol=1e-9)
    # Velocities are the derivatives of positions, as differences of twice the order show.
    slopes = np.gradient(sampled.at_rate(2000.0).positions, axis=0, edge_order=2) * 2000.0
    assert_allclose(slopes, sampled.at_rate(2000.0).velocities, atol=2e-3)


def test_derivatives_from_positions_alone() -> None:
    exact = swing(301)
    found = JointTrajectory.from_positions(exact.time, exact.positions, ("a", "b"))
    assert_allclose(found.velocities, exact.velocities, atol=1e-4)
    assert_allclose(found.accelerations, exact.accelerations, atol=1e-2)
    with pytest.raises(ValueError, match="increasing times only: sample 2 at"):
        JointTrajectory.from_positions([0.0, 1.0, 1.0, 2.0], np.zeros((4, 1)), ("a",))
