"""Measures of motions, against motions of which they are known."""

from __future__ import annotations

import numpy as np
import pytest
from known_models import planar_arm
from numpy.testing import assert_allclose
from table_rows import rows_of_table

import geodesic_ocp as go
from geodesic_ocp.execution.limits import joint_limits
from geodesic_ocp.execution.motion_measures import (
    compare_with_tracking,
    measures_table,
    motion_measures,
    spectral_arc_length,
)
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

RATE, DURATION, WAY = 200.0, 2.0, 0.8
TIME = np.arange(int(RATE * DURATION) + 1) / RATE


def cosine(time: np.ndarray = TIME) -> list[np.ndarray]:
    """Way, speed and acceleration of half a cosine from rest to rest, (k, 1) each."""
    w = np.pi / DURATION
    states = [
        WAY * (1.0 - np.cos(w * time)) / 2.0,
        WAY * w * np.sin(w * time) / 2.0,
        WAY * w**2 * np.cos(w * time) / 2.0,
    ]
    return [state[:, None] for state in states]


def test_pendulum_has_the_measures_of_a_cosine() -> None:
    """Moment of inertia I about the joint: action, torque and jerk are integrals by hand."""
    arm = planar_arm((1.0,), (2.0,), (0.5,), (0.1,))
    inertia = 0.1 + 2.0 * 0.5**2
    limits = joint_limits(arm, velocity=1.0, acceleration=4.0, jerk=10.0, torque=5.0)
    trajectory = JointTrajectory(TIME, *cosine(), arm.joint_names)
    rotations, positions = arm.hand_pose(trajectory.positions)
    offset = np.array([0.0, 0.03, 0.04])
    found = motion_measures(
        *(arm, trajectory, (rotations, positions + offset), limits),
        gravity=np.zeros(3),
        elbow_offsets=(np.zeros((TIME.size, 3)), np.full((TIME.size, 3), 0.1)),
    )
    w = np.pi / DURATION
    speed, push = WAY * w / 2.0, WAY * w**2 / 2.0  # amplitudes
    assert found.duration == pytest.approx(DURATION)
    assert found.action == pytest.approx(inertia * speed**2 * DURATION / 4.0, rel=1e-4)
    assert found.torque == pytest.approx(inertia * push / np.sqrt(2.0), rel=5e-3)
    assert found.jerk == pytest.approx(push * w / np.sqrt(2.0), rel=5e-3)
    assert found.position == pytest.approx(0.05)
    assert found.largest_position == pytest.approx(0.05)
    assert found.rotation == pytest.approx(0.0, abs=1e-7)
    assert found.elbow == pytest.approx(0.1 * np.sqrt(3.0))
    assert found.outside == 0.0
    assert found.usage["velocity"] == pytest.approx(speed, rel=1e-3)
    assert found.usage["acceleration"] == pytest.approx(push / 4.0, rel=1e-3)
    assert found.usage["torque"] == pytest.approx(inertia * push / 5.0, rel=1e-3)
    # Gravity across the axis counts as torque.
    heavy = motion_measures(
        *(arm, trajectory, (rotations, positions), limits), gravity=np.array([0.0, -9.81, 0.0])
    )
    assert heavy.torque > found.torque + 5.0
    assert np.isnan(heavy.elbow)


def test_smoothness_depends_on_the_shape_of_the_speed_alone() -> None:
    t = np.linspace(0.0, 1.0, 201)
    bell = 30.0 * t**2 * (1.0 - t) ** 2  # least jerk from rest to rest
    smooth = spectral_arc_length(bell, 200.0)
    assert spectral_arc_length(5.0 * bell, 200.0) == pytest.approx(smooth)
    assert spectral_arc_length(bell, 100.0) == pytest.approx(smooth, rel=0.02)  # twice as long
    assert spectral_arc_length(bell[::2], 100.0) == pytest.approx(smooth, rel=0.02)
    two = np.concatenate([bell, bell[1:]])
    assert spectral_arc_length(two, 200.0) < smooth - 0.1
    assert spectral_arc_length(bell * (1.0 + 0.3 * np.sin(40.0 * t)), 200.0) < smooth
    assert np.isnan(spectral_arc_length(np.zeros(50), 100.0))


@pytest.mark.slow
def test_comparison_is_under_equal_limits(arm: go.Model) -> None:
    """Of a motion that is slower than the person's, to which the hand can be tracked."""
    low = (arm.lower + arm.upper) / 2.0
    way = 0.5 * np.cos(np.arange(7.0))
    states = [state * way for state in cosine()]
    states[0] = states[0] + low
    # At rest to the last digit, as the mean accelerations show no jump.
    limits = joint_limits(arm, velocity=1.5, acceleration=4.0)
    trajectory = JointTrajectory(TIME, *states, arm.joint_names)
    recorded = 10.0 + TIME / 2.0

    def poses(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return arm.hand_pose(low + cosine(2.0 * (time - 10.0))[0] * way)

    def no_offset(at: np.ndarray) -> np.ndarray:
        return np.zeros((len(at), 3))

    found = compare_with_tracking(
        arm, trajectory, recorded, poses, limits, elbow_offsets=(no_offset, no_offset)
    )
    ours, theirs, faster = found.values()
    assert ours.largest_position == pytest.approx(0.0, abs=1e-12)
    assert theirs.largest_position < 0.02
    assert theirs.duration == pytest.approx(ours.duration)
    assert faster.duration == pytest.approx(ours.duration / 2.0)
    assert theirs.elbow == 0.0
    for each in (theirs, faster):
        assert each.outside == 0.0
        assert max(each.usage["velocity"], each.usage["acceleration"]) <= 1.0 + 1e-9
    table = measures_table(found)
    assert [row[0] for row in rows_of_table(table)] == [
        "geodesic synergies",
        "inverse kinematics (QP)",
        "inverse kinematics (QP), the person's time",
    ]
    assert_allclose(float(rows_of_table(table)[0][2]), ours.action)


def test_shapes_are_checked(arm: go.Model) -> None:
    limits = joint_limits(arm)
    still = np.zeros((4, 7))
    poses = arm.hand_pose(still)
    even = JointTrajectory(np.arange(4.0), still, still, still, arm.joint_names)
    uneven = JointTrajectory(np.arange(4.0) ** 2, still, still, still, arm.joint_names)
    with pytest.raises(ValueError, match="sampled evenly"):
        motion_measures(arm, uneven, poses, limits)
    with pytest.raises(ValueError, match="targets must be rotations"):
        motion_measures(arm, even, (poses[0][1:], poses[1]), limits)
    with pytest.raises(ValueError, match="recorded have shape"):
        compare_with_tracking(arm, even, [0.0, 1.0], lambda at: poses, limits)
