"""Inverse kinematics within limits: a person's arm and robots follow a hand."""

from __future__ import annotations

import pathlib
from runpy import run_path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from installed_robots import needs_robots
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import geodesic_ocp as go
from geodesic_ocp.arrays import rotation_vector
from geodesic_ocp.execution.limits import JointLimits, joint_limits
from geodesic_ocp.execution.track_within_limits import track_within_limits
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

TIME = np.linspace(0.0, 2.0, 101)


def motion(arm: go.Model, time: np.ndarray, *, size: float = 0.3) -> np.ndarray:
    """Configurations of a smooth motion from rest to rest around mid-range."""
    phase = (1.0 - np.cos(np.pi * np.clip(time / TIME[-1], 0.0, 1.0))) / 2.0
    way = size * np.cos(np.arange(arm.dof))
    return (arm.lower + arm.upper) / 2.0 + phase[:, None] * way


@pytest.fixture(scope="module")
def limits(arm: go.Model) -> JointLimits:
    return joint_limits(arm, velocity=4.0, acceleration=20.0)


def assert_within(model: go.Model, limits: JointLimits, found: JointTrajectory) -> None:
    step = np.diff(found.time)[:, None]
    assert np.all(found.positions >= model.lower)
    assert np.all(found.positions <= model.upper)
    speeds = np.diff(found.positions, axis=0) / step
    assert np.all(np.abs(speeds) <= limits.velocity * (1.0 + 1e-9))
    assert np.all(np.abs(found.velocities) <= limits.velocity)
    assert np.all(np.abs(found.accelerations) <= limits.acceleration)
    # Between samples as well: the change of speed is the acceleration.
    assert_allclose(np.diff(speeds, axis=0) / step[1:], found.accelerations[1:-1], atol=1e-8)
    for states in (found.velocities, found.accelerations):
        assert_allclose(states[[0, -1]], 0.0, atol=1e-9)


def test_hand_follows_poses_within_reach(arm: go.Model, limits: JointLimits) -> None:
    start = motion(arm, TIME[:1])[0]

    def poses(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return arm.hand_pose(motion(arm, time))

    found = track_within_limits(arm, start, TIME, poses, limits)
    away = np.clip(start + 0.5, arm.lower, arm.upper)
    best = track_within_limits(arm, [away, start], TIME, poses, limits)
    assert_allclose(best.positions, found.positions, atol=0)
    assert_within(arm, limits, found)
    assert found.rate == pytest.approx(200.0)
    rotations, positions = arm.hand_pose(found.positions)
    wanted = poses(found.time)
    assert np.linalg.norm(positions - wanted[1], axis=1).max() < 5e-3
    turn = rotation_vector(wanted[0] @ rotations.transpose(0, 2, 1))
    assert np.linalg.norm(turn, axis=1).max() < 1e-2
    # The same poses as samples.
    sampled = track_within_limits(arm, start, TIME, poses(TIME), limits)
    assert_allclose(sampled.positions, found.positions, atol=1e-3)


@pytest.mark.slow
def test_both_solvers_find_the_same_motion(arm: go.Model) -> None:
    """pink knows nothing of this package's Jacobian and least squares."""
    pytest.importorskip("pink")
    file = pathlib.Path(__file__).parents[2] / "benchmarks" / "pink_tracking.py"
    pink = run_path(str(file))["pink_solver"](arm, 100.0)
    slow = joint_limits(arm, velocity=0.5, acceleration=2.0)
    poses = arm.hand_pose(motion(arm, TIME, size=0.8))
    start = motion(arm, TIME[:1])[0]
    one, other = (
        track_within_limits(arm, start, TIME, poses, slow, rate=100.0, solver=solver)
        for solver in (None, pink)
    )
    assert_within(arm, slow, one)
    assert np.abs(one.velocities).max() == pytest.approx(0.5, rel=1e-6)  # a limit is active
    assert_allclose(one.positions, other.positions, atol=0.02)


@pytest.mark.slow
@settings(max_examples=10)
@given(st.integers(0, 10_000), st.sampled_from([0.5, 5.0, np.inf]), st.floats(0.1, 50.0))
def test_no_limit_is_exceeded_whatever_the_targets(seed: int, fastest: float, most: float) -> None:
    arm, rng = go.human_arm("left"), np.random.default_rng(seed)
    limits = joint_limits(arm, velocity=fastest, acceleration=most)
    time = np.linspace(0.0, 0.6, 7)
    rotations = Rotation.random(7, random_state=seed).as_matrix()
    positions = rng.normal(size=(7, 3)) * rng.choice([0.3, 3.0])
    start = rng.uniform(arm.lower, arm.upper)
    found = track_within_limits(arm, start, time, (rotations, positions), limits, rate=100.0)
    assert_within(arm, limits, found)


@pytest.mark.slow
def test_far_target_stretches_the_arm_without_shaking(arm: go.Model, limits: JointLimits) -> None:
    """At the singularity of the stretched arm, out of reach, the arm comes to rest."""
    time = np.array([0.0, 4.0])
    far = np.array([[0.3, 2.0, 0.2]] * 2)
    poses = np.stack([np.eye(3)] * 2), far
    start = motion(arm, TIME[:1])[0]
    found = track_within_limits(arm, start, time, poses, limits, turning=False)
    assert_within(arm, limits, found)
    _, positions = arm.hand_pose(found.positions[-1:])
    best = np.linalg.norm(far[0]) - arm.reach
    assert np.linalg.norm(positions[0] - far[0]) < best + 0.05
    assert np.abs(found.velocities[-100:]).max() < 0.1


@pytest.mark.slow
def test_free_rotation_and_posture(arm: go.Model, limits: JointLimits) -> None:
    """With a free rotation, the hand stays in place while the arm goes to the posture."""
    start = motion(arm, TIME[:1])[0]
    rotation, position = arm.hand_pose(start)
    time = np.array([0.0, 6.0])
    poses = np.stack([rotation] * 2), np.stack([position] * 2)
    posture = start + np.array([0.0, 0.2, 0.2, 0.0, 0.0, 0.2, 0.2])

    def run(**changes: Any) -> JointTrajectory:
        free = {"turning": False, "rate": 100.0, "posture_weight": 0.1, **changes}
        return track_within_limits(arm, start, time, poses, limits, **free)

    moved, still = run(posture=posture), run()
    assert_allclose(still.positions, np.broadcast_to(start, still.positions.shape), atol=1e-9)
    assert np.linalg.norm(moved.positions[-1] - posture) < np.linalg.norm(start - posture)
    assert_allclose(arm.hand_pose(moved.positions)[1], poses[1][[0] * len(moved.time)], atol=0.02)


def test_wrong_arguments_are_named(arm: go.Model, limits: JointLimits) -> None:
    start = motion(arm, TIME[:1])[0]
    poses = arm.hand_pose(motion(arm, TIME))
    cases: list[tuple[dict[str, Any], str]] = [
        ({"start": arm.upper + 0.1}, "start: .* outside its limits"),
        ({"limits": None}, "limits must be JointLimits of 7"),
        ({"turning": False, "placing": False}, "nothing to track"),
        ({"rate": 0.0}, "rate must be positive"),
        ({"time": TIME[::-1]}, "time must be at least two increasing"),
        ({"time": TIME[:-1]}, "poses must be rotations"),
        ({"time": 1e-3 * TIME}, "at least 3 steps"),
        ({"smoothing": -1.0}, "smoothing must not be negative"),
    ]
    for changes, message in cases:
        given = {"start": start, "time": TIME, "poses": poses, "limits": limits, **changes}
        with pytest.raises(ValueError, match=message):
            track_within_limits(arm, **given)


@needs_robots
@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_robots_stay_within_their_limits(name: str) -> None:
    robot = go.load_model(name)
    limits = joint_limits(robot)
    rng = np.random.default_rng(2)
    poses = robot.hand_pose(rng.uniform(robot.lower, robot.upper, (5, robot.dof)))
    start = (robot.lower + robot.upper) / 2.0
    time = np.linspace(0.0, 1.5, 5)
    assert_within(robot, limits, track_within_limits(robot, start, time, poses, limits))
