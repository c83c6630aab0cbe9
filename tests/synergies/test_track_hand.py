"""The inverse-kinematics baseline."""

from __future__ import annotations

import numpy as np
import pytest
from smooth_motions import swinging

import geodesic_ocp as go

TIME = swinging().time


@pytest.fixture(scope="module")
def motion() -> go.Motion:
    return swinging()


def test_the_hand_is_tracked_but_not_the_configuration(arm: go.Model, motion: go.Motion) -> None:
    tracked = go.baselines.track_hand(arm, motion)
    assert np.array_equal(tracked.q[0], motion.q[0])
    errors = go.synergies.motion_errors(arm, motion, tracked)
    assert errors.position < 2e-3
    assert errors.orientation < 5e-3
    assert errors.joint > 5e-3  # the arm has one redundant degree of freedom
    steps = np.diff(tracked.q, axis=0) / 0.01
    assert tracked.velocity[:-1] == pytest.approx(steps, abs=1e-9)


def test_controller_converges_from_a_jump(arm: go.Model, motion: go.Motion) -> None:
    """The target jumps, then stays: the gain reduces the error."""
    q = np.tile(motion.q[0], (200, 1))
    q[1:] += 0.2
    held = go.Motion(TIME, q, motion.joint_names)
    tracked = go.baselines.track_hand(arm, held)
    gaps = np.linalg.norm(arm.hand_pose(tracked.q)[1] - arm.hand_pose(held.q)[1], axis=1)
    assert gaps[-1] < 1e-4


@pytest.mark.parametrize("every", [1, 10, 25])
def test_low_sampling_rates(arm: go.Model, motion: go.Motion, every: int) -> None:
    """Down to four samples a second: the gain must not overshoot."""
    slow = go.Motion(motion.time[::every], motion.q[::every], motion.joint_names)
    errors = go.synergies.motion_errors(arm, slow, go.baselines.track_hand(arm, slow))
    assert errors.position < 5e-3
    assert errors.joint < 0.5


def test_joints_are_selected_by_name(arm: go.Model, motion: go.Motion) -> None:
    shuffled = motion.select(motion.joint_names[::-1])
    assert np.array_equal(
        go.baselines.track_hand(arm, shuffled).q, go.baselines.track_hand(arm, motion).q
    )


def test_bad_arguments_are_named(arm: go.Model, motion: go.Motion) -> None:
    left = go.human_arm("left")
    with pytest.raises(ValueError, match="there is no joint LSx_joint"):
        go.baselines.track_hand(left, motion)
