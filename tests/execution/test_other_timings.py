"""The same paths timed by TOPP-RA and by Ruckig, on movements with known fastest times."""

from __future__ import annotations

import pathlib
from itertools import pairwise
from runpy import run_path
from typing import Any

import numpy as np
import pytest
from gadget import TWO_LINKS
from numpy.testing import assert_allclose
from table_rows import rows_of_table

import geodesic_ocp as go
from geodesic_ocp.execution.arm_paths import ArmPaths
from geodesic_ocp.execution.check_trajectory import TrajectoryCheck, check_trajectory
from geodesic_ocp.execution.limits import joint_limits
from geodesic_ocp.execution.plan_trajectory import plan_trajectory
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.path import Path

pytest.importorskip("toppra")
pytest.importorskip("ruckig")
timings = run_path(str(pathlib.Path(__file__).parents[2] / "benchmarks" / "other_timings.py"))
compare_timings, largest_deviation = timings["compare_timings"], timings["largest_deviation"]
toppra_trajectory, ruckig_trajectory = timings["toppra_trajectory"], timings["ruckig_trajectory"]
stack_paths = timings["stack_paths"]

MODEL = go.load_model(TWO_LINKS, hand="b")


def along(*corners: Any, **limits: Any) -> ArmPaths:
    """Straight paths from corner to corner, one second each."""
    points = np.array(corners, dtype=float)
    grid = Grid(1, 3)
    paths = [
        Path(go.Euclidean(2), grid, a + np.outer(grid.nodes, b - a)) for a, b in pairwise(points)
    ]
    given = {"velocity": 3.0, "acceleration": 4.0, "jerk": 40.0, "torque": np.inf}
    bounds = joint_limits(MODEL, **{**given, **limits})
    return ArmPaths(MODEL, bounds, np.arange(float(len(points))), paths)


CORNER = along([0, 0], [1, 0.2], [1.2, 1])


def test_toppra_finds_the_fastest_straight_movement() -> None:
    # Full acceleration, then full deceleration: T = 2 sqrt(L / a), without and with top speed.
    for limits, duration in (({"velocity": 9.0}, 2 * 0.5), ({"velocity": 1.0}, 1.25)):
        found = toppra_trajectory(along([0, 0], [1, 0.5], **limits), rate=1000.0)
        assert found.duration == pytest.approx(duration, rel=2e-2)
        assert_allclose(found.positions[[0, -1]], [[0, 0], [1, 0.5]], atol=1e-9)
        assert_allclose(found.velocities[[0, -1]], 0.0, atol=1e-6)


def test_ruckig_finds_the_fastest_movement_within_a_jerk() -> None:
    # Four equal phases of full jerk: T = (32 L / j)^(1/3).
    arms = along([0, 0], [1, 0.5], velocity=9.0, acceleration=99.0, jerk=32.0)
    found = ruckig_trajectory(arms, rate=1000.0)
    assert found.duration == pytest.approx(1.0, abs=1e-9)
    kept_at_samples(check_trajectory(found, MODEL, arms.limits))


def kept_at_samples(check: TrajectoryCheck) -> None:
    """Only a controller's quintics between samples overshoot the steps of Ruckig's jerk."""
    for sentence in check.violations:
        assert sentence.startswith("jerk of"), sentence
        assert "between samples" in sentence


def test_toppra_keeps_torques_when_it_is_asked_to() -> None:
    arms = along([0, 0], [1, 1], torque=[45.0, 20.0])  # stretched out, gravity takes 39 N m
    for torque in (True, False):
        found = toppra_trajectory(arms, torque=torque, rate=1000.0)
        usage = check_trajectory(found, MODEL, arms.limits).usage["torque"].max()
        assert (usage <= 1.02) == torque


def test_no_torque_is_enough_against_gravity() -> None:
    with pytest.raises(go.NotConverged, match="TOPP-RA found no trajectory along the path"):
        toppra_trajectory(along([0, 0], [1, 1], torque=[5.0, 20.0]))


@pytest.mark.slow
@pytest.mark.parametrize("timing", [toppra_trajectory, ruckig_trajectory])
def test_stops_follow_the_paths_and_rest_where_they_meet(timing: Any) -> None:
    found = timing(CORNER, junctions="stop", rate=1000.0)
    assert largest_deviation([CORNER], found) < 1e-6
    at_corner = np.argmin(np.linalg.norm(found.positions - [1, 0.2], axis=1))
    assert np.abs(found.velocities[at_corner]).max() < 0.01
    assert timing(CORNER, rate=1000.0).duration < found.duration


@pytest.mark.slow
def test_more_points_come_nearer_to_the_kinks() -> None:
    for timing in (toppra_trajectory, ruckig_trajectory):
        deviations = [
            largest_deviation([CORNER], timing(CORNER, points=points, rate=1000.0))
            for points in (4, 16)
        ]
        assert deviations[1] < 0.6 * deviations[0]


def test_ruckig_passes_through_all_corners_within_its_limits() -> None:
    arms = along([0, 0], [1, 0.2], [1.5, 0.6], [0.5, 1.0])
    found = ruckig_trajectory(arms, rate=1000.0)
    for corner in ([1, 0.2], [1.5, 0.6], [0.5, 1.0]):
        assert np.linalg.norm(found.positions - corner, axis=1).min() < 3e-3
    kept_at_samples(check_trajectory(found, MODEL, arms.limits))


def test_rests_are_left_out() -> None:
    moving = along([0, 0], [1, 0.2], [1.2, 1])
    resting = along([0, 0], [1, 0.2], [1, 0.2], [1.2, 1])
    assert len(stack_paths(resting, 1).positions) == 3
    for timing in (toppra_trajectory, ruckig_trajectory):
        assert timing(resting).duration == pytest.approx(timing(moving).duration, abs=0.011)


def test_arms_keep_step_with_each_other() -> None:
    both = [along([0, 0], [1, 0.2], [1.2, 1]), along([0.5, 0.5], [0, 0])]  # the latter for 1 s
    found = toppra_trajectory(both, rate=1000.0)
    assert found.joint_names == ("0/shoulder", "0/elbow", "1/shoulder", "1/elbow")
    at_corner = np.argmin(np.linalg.norm(found.positions[:, :2] - [1, 0.2], axis=1))
    assert_allclose(found.positions[at_corner, 2:], 0.0, atol=0.02)
    assert_allclose(found.positions[-1], [1.2, 1, 0, 0], atol=1e-9)


def test_deviation_is_the_distance_from_the_nearest_point() -> None:
    time = np.array([0.0, 1.0])
    positions = np.array([[0.5, 0.1], [-0.3, 0.4]])  # beside the first path, and before it
    moved = JointTrajectory(time, positions, 0 * positions, 0 * positions, MODEL.joint_names)
    assert largest_deviation([along([0, 0], [1, 0])], moved) == pytest.approx(0.5)
    near = JointTrajectory(time, positions[[0, 0]], *[0 * positions] * 2, MODEL.joint_names)
    assert largest_deviation([along([0, 0], [1, 0])], near) == pytest.approx(0.1)


def test_the_comparison_has_a_row_for_each_method() -> None:
    other = toppra_trajectory(CORNER)
    table = compare_timings(CORNER, others={"mine": other}, rate=200.0)
    rows = {row[0]: row[1:] for row in rows_of_table(table)}
    assert rows["mine"][0] == other.duration
    assert rows["TOPP-RA, kinks rounded"][0] < rows["TOPP-RA, stops"][0]
    assert rows["Ruckig, passing"][0] < rows["Ruckig, stops"][0]
    assert rows["Ruckig, passing, near"][5] < rows["Ruckig, passing"][5]
    assert rows["Ruckig, stops"][3] <= 1.0


@pytest.mark.slow
def test_a_planned_trajectory_stands_first_and_within_its_limits() -> None:
    planned = plan_trajectory([CORNER])
    table = compare_timings(planned, rate=500.0)
    name, duration, *shares, deviation, _ = rows_of_table(table)[0]
    assert (name, len(rows_of_table(table))) == ("planned", 7)
    assert duration == pytest.approx(planned.duration, abs=0.002)
    assert max(shares) <= 1.001
    rows = {row[0]: row[1:] for row in rows_of_table(table)}
    assert rows["TOPP-RA, as near as planned"][5] <= deviation


def test_paths_that_cannot_be_timed_are_named() -> None:
    unlimited = along([0, 0], [1, 1], acceleration=np.inf)
    with pytest.raises(ValueError, match="finite limits on speeds and accelerations"):
        toppra_trajectory(unlimited)
    with pytest.raises(ValueError, match="no path has a length"):
        ruckig_trajectory(along([0, 0], [0, 0]))
