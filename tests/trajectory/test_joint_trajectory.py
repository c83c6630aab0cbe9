"""Trajectories for controllers: CSV, and JSON with the fields of the ROS 2 message."""

from __future__ import annotations

import csv
import io
import json

import numpy as np
from numpy.testing import assert_allclose

from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

TIME = np.array([0.0, 0.25, 1.9999999999])


def some(names: tuple[str, ...] = ("a", "b")) -> JointTrajectory:
    values = np.arange(18.0).reshape(3, 3, 2) / 7.0
    return JointTrajectory(TIME, values[0], values[1], values[2], names)


def test_csv_has_all_digits() -> None:
    header, *rows = list(csv.reader(io.StringIO(some().csv())))
    assert header[:4] == ["time_from_start", "a position", "b position", "a velocity"]
    numbers = np.array(rows, dtype=float)
    assert np.array_equal(numbers[:, 0], TIME)
    assert np.array_equal(numbers[:, 1:3], some().positions)
    assert np.array_equal(numbers[:, 5:7], some().accelerations)


def test_json_has_the_fields_of_a_ros_message() -> None:
    message = json.loads(some().json())
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
        since = point["time_from_start"]
        assert 0 <= since["nanosec"] < 10**9
        assert since["sec"] + since["nanosec"] / 1e9 == np.round(TIME[k], 9)


def test_trajectories_side_by_side() -> None:
    both = JointTrajectory.side_by_side([some(), some()], ("a", "b", "c", "d"))
    assert both.positions.shape == (3, 4)
    assert_allclose(both.velocities[:, 2:], some().velocities)
    assert json.loads(both.json())["joint_names"] == ["a", "b", "c", "d"]
