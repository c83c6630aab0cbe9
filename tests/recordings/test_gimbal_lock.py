"""Shoulders whose joint angles turn fast near gimbal lock are told of."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import scipy

import geodesic_ocp as go
from geodesic_ocp.trajectory.recording import warn_of_gimbal_lock

TIME = np.arange(51) / 50.0


def swing(nearest: float) -> go.Motion:
    """The upper arm is swung past the axis of x at this angle [rad], in one second, smoothly."""
    turn = np.radians(100.0) * (TIME - 0.5)
    # A great circle that passes the direction of x at the angle `nearest`.
    tilt = scipy.spatial.transform.Rotation.from_euler("z", np.pi / 2.0 - nearest)
    path = scipy.spatial.transform.Rotation.from_euler("x", turn[:, None])
    wobble = scipy.spatial.transform.Rotation.from_euler("z", turn[:, None])
    upper_arm = (wobble * tilt * path).as_matrix()
    upright = np.tile(np.eye(3), (TIME.size, 1, 1))
    segments = {"thorax": upright, "right upper arm": upper_arm, "right forearm": upper_arm}
    names = ["RSx_joint", "RSz_joint", "RSy_joint"]
    return go.recordings.joint_angles(go.recordings.SegmentOrientations(TIME, segments), names)


def test_a_swing_past_gimbal_lock_is_told_of() -> None:
    motion = swing(0.02)
    steps = np.abs(np.diff(motion.q, axis=0))
    with pytest.warns(
        RuntimeWarning, match=r"file: RSx_joint and RSy_joint turn by \d+ deg .* lock"
    ):
        warn_of_gimbal_lock(motion, "file")
    assert steps[:, [0, 2]].max() > 0.5
    # The arm itself turns by few degrees from sample to sample.
    turned = scipy.spatial.transform.Rotation.from_euler("XZY", motion.q)
    assert (turned[:-1].inv() * turned[1:]).magnitude().max() < 0.1


def test_other_motions_are_not(bundled_file: object) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_gimbal_lock(swing(1.0), "file")
        warn_of_gimbal_lock(go.read_motion(str(bundled_file)), "file")
        warn_of_gimbal_lock(go.Motion([0.0, 1.0], np.eye(2), ("a", "b")), "file")
