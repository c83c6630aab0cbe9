"""Segmentation at zero crossings of joint velocities."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

import geodesic_ocp as go

STEP = 0.01


def sines(phases: Sequence[float]) -> go.Motion:
    """Joints that oscillate with a period of one second."""
    time = np.arange(0.0, 2.0, STEP)
    angle = 2 * np.pi * (time[:, None] - np.array(phases))
    names = tuple(f"joint{i}" for i in range(len(phases)))
    return go.Motion(time, np.cos(angle), names, -2 * np.pi * np.sin(angle))


def test_zero_velocity_cuts() -> None:
    """Four of five joints reverse together at 0.505 s and every 0.5 s; one is out of phase."""
    motion = sines([0.005, 0.005, 0.015, -0.005, 0.25])
    assert go.synergies.segment_zero_velocity(motion) == [
        (0, 50),
        (50, 100),
        (100, 150),
        (150, 199),
    ]
    # The crossings of the first four span 20 ms: more than 10 ms, less than 50 ms.
    assert go.synergies.segment_zero_velocity(motion, window=0.01) == [(0, 199)]
    spread = sines([0.0, 0.016, 0.032, 0.048, 0.25])
    assert len(go.synergies.segment_zero_velocity(spread)) > 1
    assert go.synergies.segment_zero_velocity(spread, window=0.047) == [(0, 199)]
    # Only four reverse at once, never more.
    assert go.synergies.segment_zero_velocity(motion, joints=4) == [(0, 199)]
    # Reversals further apart than the window do not count together.
    assert go.synergies.segment_zero_velocity(sines([0.0, 0.03, 0.06, 0.09, 0.12])) == [(0, 199)]


def test_touching_zero_is_not_a_crossing() -> None:
    time = np.arange(0.0, 1.0, STEP)
    speed = np.abs(time - 0.5)[:, None] * np.ones(4)
    speed[45:56] = 0.0
    q = np.cumsum(speed, axis=0) * STEP
    motion = go.Motion(time, q, tuple("abcd"), speed)
    assert go.synergies.segment_zero_velocity(motion) == [(0, 99)]
    back = np.where(time[:, None] < 0.5, speed, -speed)
    motion = go.Motion(time, np.cumsum(back, axis=0) * STEP, tuple("abcd"), back)
    assert go.synergies.segment_zero_velocity(motion) == [(0, 50), (50, 99)]


def test_bad_arguments_are_named() -> None:
    motion = sines([0.0, 0.1, 0.2, 0.3, 0.4])
    still = go.Motion(
        STEP * np.arange(50), np.full((50, 7), 0.3), tuple("abcdefg"), np.zeros((50, 7))
    )
    with pytest.raises(ValueError, match="never moves"):
        go.synergies.segment_zero_velocity(still)
    with pytest.raises(ValueError, match="joints must be 0 to 4"):
        go.synergies.segment_zero_velocity(motion, joints=5)
    with pytest.raises(ValueError, match="window must be positive"):
        go.synergies.segment_zero_velocity(motion, window=0.0)
    with pytest.raises(ValueError, match="has no velocities"):
        go.synergies.segment_zero_velocity(go.Motion(motion.time, motion.q, motion.joint_names))
