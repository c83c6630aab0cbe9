"""Inverse kinematics of the hand, and the errors by which methods are compared."""

from __future__ import annotations

import numpy as np
import pytest

import geodesic_ocp as go
from geodesic_ocp.rotations import rotation_vector

TIME = np.arange(0.0, 2.0, 0.01)


@pytest.fixture(scope="module")
def motion() -> go.Motion:
    arm = go.human_arm("right")
    swing = np.sin(np.outer(TIME, [1.0, 1.7, 0.8, 2.0, 1.3, 2.2, 0.9]))
    middle = np.array([0.6, 0.1, -0.8, 1.3, 0.1, -0.1, -0.1])
    return go.Motion(TIME, middle + 0.3 * swing, arm.joint_names)


def test_hand_is_followed_and_the_posture_forgotten(arm: go.Model, motion: go.Motion) -> None:
    followed = go.track_hand(arm, motion)
    assert np.array_equal(followed.q[0], motion.q[0])
    errors = go.evaluate(arm, motion, followed)
    assert errors.position < 2e-3
    assert errors.orientation < 5e-3
    assert errors.joint > 5e-3  # seven joints follow six numbers: something is free
    steps = np.diff(followed.q, axis=0) / 0.01
    assert followed.velocity[:-1] == pytest.approx(steps, abs=1e-9)


def test_controller_converges_from_a_jump(arm: go.Model, motion: go.Motion) -> None:
    """The hand is moved at once, then holds still: the gain closes the gap."""
    q = np.tile(motion.q[0], (200, 1))
    q[1:] += 0.2
    held = go.Motion(TIME, q, motion.joint_names)
    followed = go.track_hand(arm, held)
    gaps = np.linalg.norm(arm.hand_pose(followed.q)[1] - arm.hand_pose(held.q)[1], axis=1)
    assert gaps[-1] < 1e-4


@pytest.mark.parametrize("every", [1, 10, 25])
def test_slow_recordings_are_followed_too(arm: go.Model, motion: go.Motion, every: int) -> None:
    """Ten or four samples a second: the gain must not overshoot."""
    slow = go.Motion(motion.time[::every], motion.q[::every], motion.joint_names)
    errors = go.evaluate(arm, slow, go.track_hand(arm, slow))
    assert errors.position < 5e-3
    assert errors.joint < 0.5


def test_no_error_is_zero(arm: go.Model, motion: go.Motion) -> None:
    errors = go.evaluate(arm, motion, motion)
    assert errors.joint == 0.0
    assert errors.position == 0.0
    assert errors.orientation == pytest.approx(0.0, abs=1e-14)


def test_errors_of_known_displacements(arm: go.Model, motion: go.Motion) -> None:
    """The last joint turned by 0.2 rad: 0.2/7 on average, and the hand turns by 0.2 rad."""
    shifted = motion.q.copy()
    shifted[:, 6] += 0.2
    other = go.Motion(TIME, shifted, motion.joint_names)
    errors = go.evaluate(arm, motion, other)
    assert errors.joint == pytest.approx(0.2 / 7, rel=1e-12)
    assert errors.orientation == pytest.approx(0.2, rel=1e-9)
    lever = 1.75 * np.hypot(0.015, 0.037)  # of the tool centre about the wrist
    assert errors.position == pytest.approx(2 * np.sin(0.1) * lever, rel=1e-9)


def test_joints_are_picked_by_name(arm: go.Model, motion: go.Motion) -> None:
    shuffled = motion.select(motion.joint_names[::-1])
    assert go.evaluate(arm, motion, shuffled).joint == 0.0
    assert np.array_equal(go.track_hand(arm, shuffled).q, go.track_hand(arm, motion).q)


@pytest.mark.parametrize("angle", [1e-9, 0.3, np.pi - 1e-9, np.pi])
def test_rotation_vectors_up_to_half_a_turn(angle: float, rng: np.random.Generator) -> None:
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    cross = np.cross(np.eye(3), axis)
    rotation = np.eye(3) - np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    found = rotation_vector(rotation)
    assert np.linalg.norm(found) == pytest.approx(angle, rel=1e-6)
    assert abs(found @ axis) == pytest.approx(angle, rel=1e-6)


def test_bad_arguments_are_named(arm: go.Model, motion: go.Motion) -> None:
    left = go.human_arm("left")
    with pytest.raises(ValueError, match="there is no joint LSx_joint"):
        go.track_hand(left, motion)
    with pytest.raises(ValueError, match=r"gain must be positive \[1/s\]"):
        go.track_hand(arm, motion, gain=0.0)
    with pytest.raises(ValueError, match="damping must be positive"):
        go.track_hand(arm, motion, damping=-1.0)
    late = go.Motion(TIME + 0.001, motion.q, motion.joint_names)
    with pytest.raises(ValueError, match="must have the same sample times"):
        go.evaluate(arm, motion, late)
