"""What the geodesic model is compared with, where it is not a metric: inverse kinematics."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.model.model import Model
from geodesic_ocp.motion.motion import Motion
from geodesic_ocp.motion.rotations import rotation_vector


def track_hand(
    model: Model, motion: Motion, *, gain: float = 20.0, damping: float = 0.02
) -> Motion:
    """Follow the observed hand with a damped Jacobian controller, from the first posture.

    q' = J' (J J' + damping^2)^-1 (observed hand velocity + gain * pose error), one step a sample.
    The redundant arm keeps no memory of the observed posture. Damped least squares: Wampler, IEEE
    Trans. Systems, Man, and Cybernetics 16 (1986); the controller ignores joint limits.

    Args:
        model: whose hand follows; its joints must be the motion's.
        motion: observed.
        gain: of the pose error [1/s].
        damping: of the Jacobian's small singular values [m or rad per joint unit].

    Returns:
        The controller's motion at the recording's instants, with its velocities.

    Raises:
        ValueError: the joints are not the model's, or a number is not positive.
    """
    observed = motion.select(model.joint_names)
    gain, damping = as_positive("gain", gain, "1/s"), as_positive("damping", damping)
    rotations, positions = model.hand_pose(observed.q)
    steps = np.diff(observed.time)
    q = np.empty_like(observed.q)
    velocity = np.zeros_like(observed.q)
    q[0] = observed.q[0]
    for k, step in enumerate(steps):
        rotation, position = model.hand_pose(q[k])
        error = _twist(rotation, position, rotations[k], positions[k])
        forward = _twist(rotations[k], positions[k], rotations[k + 1], positions[k + 1])
        wanted = forward / step + gain * error
        jacobian = model.hand_jacobian(q[k])
        damped = jacobian @ jacobian.T + damping**2 * np.eye(6)
        velocity[k] = jacobian.T @ np.linalg.solve(damped, wanted)
        q[k + 1] = q[k] + step * velocity[k]
    velocity[-1] = velocity[-2]
    return Motion(observed.time, q, observed.joint_names, velocity, observed.subject)


def _twist(rotation: Array, position: Array, rotation_to: Array, position_to: Array) -> Array:
    """Displacement (6,): translation and rotation vector from one pose to the other, base axes."""
    return np.concatenate([position_to - position, rotation_vector(rotation_to @ rotation.T)])
