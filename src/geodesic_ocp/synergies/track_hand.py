"""The inverse-kinematics baseline: a controller that tracks the observed hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.model.model import Model
from geodesic_ocp.rotations import rotation_vector
from geodesic_ocp.trajectory.motion import Motion

# Largest displacement of a joint in one step of the controller [rad or m].
_MAX_STEP = 0.05
Poses = Callable[[Array], tuple[Array, Array]]


def track_hand(
    model: Model, motion: Motion, *, gain: float = 20.0, damping: float = 0.02
) -> Motion:
    """Track the observed hand (end-effector) with a damped velocity controller.

    It starts from the first observed configuration; the hand moves along the spline through the
    samples, see `track_poses`. The observed configuration of the redundant arm plays no further
    role.

    Args:
        model: whose hand tracks; its joints must be the motion's.
        motion: observed.
        gain: of the pose error [1/s].
        damping: of the Jacobian's small singular values [m or rad per joint unit].

    Returns:
        The controller's motion at the recording's sample times, with its velocities.

    Raises:
        ValueError: the joints are not the model's, or a number is not positive.
    """
    observed = motion.select(model.joint_names)

    def poses(times: Array) -> tuple[Array, Array]:
        rotations, positions = model.hand_pose(observed(times))
        return rotations, positions

    tracked = track_poses(
        model,
        observed.q[0],
        observed.time,
        poses,
        gain=gain,
        damping=damping,
        counts=steps_between(observed),
    )
    return replace(tracked, subject=observed.subject)


def steps_between(observed: Motion) -> Array:
    """Number of controller steps between samples (k - 1,), so that each is a small motion.

    Recordings at low sampling rates need many.
    """
    largest = np.abs(np.diff(observed.q, axis=0)).max(axis=1)
    return np.asarray(np.maximum(1.0, np.ceil(largest / _MAX_STEP)))


def track_poses(
    model: Model,
    start: Array,
    time: Array,
    poses: Poses,
    *,
    gain: float = 20.0,
    damping: float = 0.02,
    counts: Array | None = None,
    turning: bool = True,
    placing: bool = True,
) -> Motion:
    """Track poses of a hand with a damped velocity controller, from a configuration.

    q' = J' (J J' + damping^2)^-1 (hand velocity + gain * pose error). Damped least squares:
    Wampler, IEEE Trans. Systems, Man, and Cybernetics 16 (1986); the controller ignores joint
    limits.

    Args:
        model: whose hand tracks.
        start: configuration (n,).
        time: increasing times (k,) [s].
        poses: rotations (m, 3, 3) and positions (m, 3) [m] of the hand at m times.
        gain: of the pose error [1/s].
        damping: of the Jacobian's small singular values [m or rad per joint unit].
        counts: (k - 1,) steps of the controller between the times; one by default.
        turning, placing: whether it tracks rotations, and positions.

    Raises:
        ValueError: a number is not positive.
    """
    gain, damping = as_positive("gain", gain, "1/s"), as_positive("damping", damping)
    rows = slice(0 if placing else 3, 6 if turning else 3)
    q = np.empty((time.size, model.dof))
    velocity = np.zeros_like(q)
    q[0] = start
    for k in range(time.size - 1):
        count = 1 if counts is None else int(counts[k])
        times = np.linspace(time[k], time[k + 1], count + 1)
        rotations, positions = poses(times)
        configuration, step = q[k], float(times[1] - times[0])
        for index in range(count):
            rotation, position = model.hand_pose(configuration)
            error = _twist(rotation, position, rotations[index], positions[index])
            forward = _twist(
                rotations[index], positions[index], rotations[index + 1], positions[index + 1]
            )
            # A gain above 1/step would overshoot, above 2/step diverge.
            twist = (forward / step + min(gain, 1.0 / step) * error)[rows]
            jacobian = model.hand_jacobian(configuration)[rows]
            damped = jacobian @ jacobian.T + damping**2 * np.eye(len(jacobian))
            configuration = configuration + step * jacobian.T @ np.linalg.solve(damped, twist)
        q[k + 1] = configuration
        velocity[k] = (configuration - q[k]) / (time[k + 1] - time[k])
    velocity[-1] = velocity[-2]
    return Motion(time, q, model.joint_names, velocity)


def _twist(rotation: Array, position: Array, rotation_to: Array, position_to: Array) -> Array:
    """Translation and rotation vector (6,) from one pose to the other, in the base frame."""
    return np.concatenate([position_to - position, rotation_vector(rotation_to @ rotation.T)])
