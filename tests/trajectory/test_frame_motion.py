"""The pose of a frame over time, and motions that carry one."""

from __future__ import annotations

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st

import geodesic_ocp as go
from geodesic_ocp.trajectory.motion import FrameMotion


def turning(time: np.ndarray, rate: float = 0.7) -> FrameMotion:
    """A frame that turns about z at a constant rate [rad/s] and moves along a parabola."""
    c, s, zero = np.cos(rate * time), np.sin(rate * time), 0.0 * time
    rows = [[c, -s, zero], [s, c, zero], [zero, zero, zero + 1.0]]
    return FrameMotion(np.array(rows).transpose(2, 0, 1), np.stack([time, time**2, zero], axis=1))


TIME = np.linspace(0.0, 2.0, 41)


def angle_between(first: np.ndarray, second: np.ndarray) -> float:
    between = first @ np.swapaxes(second, 1, 2)
    turn = scipy.spatial.transform.Rotation.from_matrix(between).magnitude()
    return float(np.max(turn))


@given(st.lists(st.floats(0.0, 2.0), min_size=1, max_size=5), st.floats(-10.0, 10.0))
def test_a_constant_rate_is_interpolated_exactly(at: list[float], rate: float) -> None:
    times = np.array(at)
    found, expected = turning(TIME, rate).interpolated(TIME, times), turning(times, rate)
    assert angle_between(found.rotations, expected.rotations) < 1e-7
    assert found.positions == pytest.approx(expected.positions, abs=1e-12)


def test_beyond_the_ends_it_stays_where_it_was() -> None:
    frame = turning(TIME)
    found = frame.interpolated(TIME, np.array([-1.0, 3.0]))
    assert found.rotations == pytest.approx(frame.rotations[[0, -1]], abs=1e-12)
    assert found.positions == pytest.approx(frame.positions[[0, -1]], abs=1e-12)


def test_values_cannot_be_changed() -> None:
    frame = turning(TIME)
    with pytest.raises(ValueError, match="read-only"):
        frame.positions[0] = 1.0
    assert len(frame) == 41


def test_the_first_bad_sample_is_named() -> None:
    frame = turning(TIME)
    with pytest.raises(ValueError, match=r"positions \(k, 3\) must match, got shapes"):
        FrameMotion(frame.rotations[:-1], frame.positions)
    missing = np.array(frame.positions)
    missing[7, 1] = np.nan
    with pytest.raises(ValueError, match="the pose is not finite at sample 7"):
        FrameMotion(frame.rotations, missing)
    for wrong in (2.0 * np.eye(3), np.diag([1.0, 1.0, -1.0])):
        rotations = np.array(frame.rotations)
        rotations[5] = wrong
        with pytest.raises(ValueError, match="the matrix at sample 5 is not a rotation"):
            FrameMotion(rotations, frame.positions)


@pytest.fixture
def motion() -> go.Motion:
    q = np.stack([np.sin(3.0 * TIME), np.cos(2.0 * TIME)], axis=1)
    return go.Motion(TIME, q, ("a", "b"), trunk=turning(TIME))


def test_a_motion_keeps_its_trunk_when_joints_are_selected_or_filtered(motion: go.Motion) -> None:
    assert motion.select(["b"]).trunk is motion.trunk
    assert motion.filtered(cutoff=4.0).trunk is motion.trunk
    with pytest.raises(ValueError, match="trunk must have 41 samples, got 40"):
        go.Motion(TIME, motion.q, ("a", "b"), trunk=turning(TIME[:-1]))


@pytest.mark.parametrize("rate", [50.0, 7.0])
def test_a_resampled_motion_has_its_trunk_at_the_new_times(motion: go.Motion, rate: float) -> None:
    found = motion.resampled(rate)
    expected = turning(found.time)
    assert found.trunk is not None
    assert len(found) != len(motion)
    assert angle_between(found.trunk.rotations, expected.rotations) < 1e-7
    assert found.trunk.positions == pytest.approx(expected.positions, abs=1e-12)
