"""Errors by which methods are compared."""

from __future__ import annotations

import numpy as np
import pytest
from smooth_motions import swinging

import geodesic_ocp as go
from geodesic_ocp.synergies.scores import action

TIME = swinging().time


@pytest.fixture(scope="module")
def motion() -> go.Motion:
    return swinging()


def test_errors_of_equal_motions_are_zero(arm: go.Model, motion: go.Motion) -> None:
    errors = go.synergies.motion_errors(arm, motion, motion)
    assert errors.joint == 0.0
    assert errors.position == 0.0
    assert errors.orientation == pytest.approx(0.0, abs=1e-14)


def test_errors_of_known_displacements(arm: go.Model, motion: go.Motion) -> None:
    """The last joint rotated by 0.2 rad: 0.2/7 on average, and the hand rotates by 0.2 rad."""
    shifted = motion.q.copy()
    shifted[:, 6] += 0.2
    other = go.Motion(TIME, shifted, motion.joint_names)
    errors = go.synergies.motion_errors(arm, motion, other)
    assert errors.joint == pytest.approx(0.2 / 7, rel=1e-12)
    assert errors.orientation == pytest.approx(0.2, rel=1e-9)
    lever = 1.75 * np.hypot(0.015, 0.037)  # from the wrist to the tool centre
    assert errors.position == pytest.approx(2 * np.sin(0.1) * lever, rel=1e-9)


def test_motions_must_have_the_same_sample_times(arm: go.Model, motion: go.Motion) -> None:
    late = go.Motion(TIME + 0.001, motion.q, motion.joint_names)
    with pytest.raises(ValueError, match="must have the same sample times"):
        go.synergies.motion_errors(arm, motion, late)


def test_joints_are_selected_by_name(arm: go.Model, motion: go.Motion) -> None:
    shuffled = motion.select(motion.joint_names[::-1])
    assert go.synergies.motion_errors(arm, motion, shuffled).joint == 0.0


def test_action_of_a_straight_motion(motion: go.Motion) -> None:
    """At constant speed it is half the squared length over the duration."""
    q = np.outer(TIME, np.arange(7.0))
    straight = go.Motion(TIME, q, motion.joint_names)
    length = np.linalg.norm(q[-1] - q[0])
    expected = length**2 / (TIME[-1] - TIME[0]) / 2.0
    assert action(go.Euclidean(7), straight) == pytest.approx(expected, rel=1e-12)
