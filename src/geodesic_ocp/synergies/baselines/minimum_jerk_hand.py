"""Kinematic baseline of the hand: minimum jerk, and the joints that follow it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from scipy.spatial.transform import Rotation

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.model import Model
from geodesic_ocp.rotations import rotation_vector
from geodesic_ocp.synergies.as_segments import as_segments
from geodesic_ocp.synergies.baselines.joint_polynomials import rates
from geodesic_ocp.synergies.baselines.track_hand import steps_between, track_poses
from geodesic_ocp.synergies.observed_velocity import observed_velocity
from geodesic_ocp.synergies.scores.hand_speed import hand_twists
from geodesic_ocp.trajectory.motion import Motion


def minimum_jerk_hand(
    model: Model,
    motion: Motion,
    segments: Sequence[tuple[int, int]],
    *,
    gain: float = 20.0,
    damping: float = 0.02,
) -> Motion:
    """Minimum jerk of the hand on every segment, between the observed ends, and joints that track.

    The position of the hand is a quintic with the observed positions, velocities and accelerations
    at both ends (Flash and Hogan, J. Neuroscience 5, 1985). Its orientation turns about the axis of
    the rotation between the observed ones; the angle is a quintic, too, with the components of the
    observed angular velocities and accelerations along the axis. Joints follow by the damped
    velocity controller of `track_hand`, from the observed configuration at the segment's start.

    >>> import geodesic_ocp as go
    >>> import numpy as np
    >>> arm, time = go.human_arm(), np.linspace(0.0, 0.5, 51)
    >>> q = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1]) + 0.2 * np.sin(2.0 * time)[:, None]
    >>> motion = go.Motion(time, q, arm.joint_names, 0.4 * np.cos(2.0 * time)[:, None] + 0.0 * q)
    >>> predicted = go.minimum_jerk_hand(arm, motion, [(0, 50)])
    >>> bool(go.evaluate(arm, motion, predicted).position < 1e-3)  # mean error of the hand [m]
    True

    Args:
        model: the arm; its joints are selected from the motion by name.
        motion: observed, with velocities, of at least three samples.
        segments: (start, stop) sample indices, each starting where the one before stopped, from
            the first sample to the last.
        gain, damping: of the controller, see `track_hand`.

    Returns:
        The predicted motion at the recording's own times, with velocities.

    Raises:
        ValueError: a joint of the model is missing, the segments do not cover the motion, there are
            no velocities or fewer than three samples, or a number is not positive.
    """
    observed = motion.select(model.joint_names)
    pieces = as_segments(observed, segments)
    velocity = observed_velocity(observed)
    hands = {hand: _observed_hand(model, hand, observed) for hand in model.hands}
    counts = steps_between(observed)

    q, velocity = np.empty_like(observed.q), np.empty_like(velocity)
    for start, stop in pieces:
        ends, samples = [start, stop], slice(start, stop + 1)
        tracked = track_poses(
            model,
            observed.q[start],
            observed.time[samples],
            {
                hand: _HandMotion(observed.time[ends], *(values[ends] for values in each))
                for hand, each in hands.items()
            },
            gain=gain,
            damping=damping,
            counts=counts[start:stop],
        )
        q[samples], velocity[samples] = tracked.q, tracked.velocity
    return Motion(observed.time, q, observed.joint_names, velocity, observed.subject)


def _observed_hand(model: Model, hand: str, observed: Motion) -> tuple[Array, Array, Array]:
    """Rotations (k, 3, 3) of a hand, and derivatives of position and orientation at the samples.

    (k, 3 derivatives, 3) of the position, (k, 2, 3) of the orientation.
    """
    model = model if hand == model.hand else model.with_hand(hand)
    rotations, positions = model.hand_pose(observed.q)
    twists = hand_twists(model, observed)
    places = np.stack([positions, twists[:, :3], rates(observed, twists[:, :3])], axis=1)
    turns = np.stack([twists[:, 3:], rates(observed, twists[:, 3:])], axis=1)
    return rotations, places, turns


class _HandMotion:
    """Poses of the hand over the time of a segment."""

    def __init__(self, time: Array, rotations: Array, places: Array, turns: Array) -> None:
        """From values at both ends: times (2,), rotations, and derivatives of the pose."""
        turn = rotation_vector(rotations[1] @ rotations[0].T)  # in base axes
        angle = float(np.linalg.norm(turn))
        self._axis = turn / angle if angle > 0.0 else np.zeros(3)
        angles = np.column_stack([[0.0, angle], turns @ self._axis])
        self._start = rotations[0]
        self._angle = scipy.interpolate.BPoly.from_derivatives(time, angles)
        self._position = scipy.interpolate.BPoly.from_derivatives(time, places)

    def __call__(self, times: Array) -> tuple[Array, Array]:
        """Rotations (m, 3, 3) and positions (m, 3) at the times (m,)."""
        turned = Rotation.from_rotvec(self._angle(times)[:, None] * self._axis).as_matrix()
        return turned @ self._start, self._position(times)
