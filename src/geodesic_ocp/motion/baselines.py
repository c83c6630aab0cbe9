"""What the geodesic model is compared with, where it is not a metric: inverse kinematics."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.model.model import Model
from geodesic_ocp.motion.rotations import rotation_vector
from geodesic_ocp.sampled import Motion

# A joint moves no more than this in one step of the controller [rad or m].
_LARGEST_STEP = 0.05


def track_hand(
    model: Model, motion: Motion, *, gain: float = 20.0, damping: float = 0.02
) -> Motion:
    """Follow the observed hand with a damped Jacobian controller, from the first posture.

    q' = J' (J J' + damping^2)^-1 (observed hand velocity + gain * pose error), one step a sample or
    more where the samples are far apart; there the hand moves along the spline through them.
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
    q = np.empty_like(observed.q)
    velocity = np.zeros_like(observed.q)
    q[0] = observed.q[0]
    for k in range(len(observed) - 1):
        # Fine enough that the hand moves little in a step; slow recordings need many.
        moved = float(np.abs(observed.q[k + 1] - observed.q[k]).max())
        count = max(1, int(np.ceil(moved / _LARGEST_STEP)))
        instants = np.linspace(observed.time[k], observed.time[k + 1], count + 1)
        rotations, positions = model.hand_pose(observed(instants))
        posture, step = q[k], float(instants[1] - instants[0])
        for index in range(count):
            rotation, position = model.hand_pose(posture)
            error = _twist(rotation, position, rotations[index], positions[index])
            forward = _twist(
                rotations[index], positions[index], rotations[index + 1], positions[index + 1]
            )
            # A gain above 1/step would overshoot, above 2/step run away.
            wanted = forward / step + min(gain, 1.0 / step) * error
            jacobian = model.hand_jacobian(posture)
            damped = jacobian @ jacobian.T + damping**2 * np.eye(6)
            posture = posture + step * jacobian.T @ np.linalg.solve(damped, wanted)
        q[k + 1] = posture
        velocity[k] = (posture - q[k]) / (observed.time[k + 1] - observed.time[k])
    velocity[-1] = velocity[-2]
    return Motion(observed.time, q, observed.joint_names, velocity, observed.subject)


def _twist(rotation: Array, position: Array, rotation_to: Array, position_to: Array) -> Array:
    """Displacement (6,): translation and rotation vector from one pose to the other, base axes."""
    return np.concatenate([position_to - position, rotation_vector(rotation_to @ rotation.T)])
