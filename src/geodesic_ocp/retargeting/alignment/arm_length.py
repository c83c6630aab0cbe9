"""Length of a robot's arm: the largest distance of the hand from a joint."""

from __future__ import annotations

from geodesic_ocp.model.joints import frame_index, max_reach
from geodesic_ocp.model.model import Model


def arm_length(model: Model, joint: str) -> float:
    """Largest distance [m] of the hand from a joint, within the limits.

    Raises:
        ValueError: there is no such joint.
    """
    origin = model.joint_of(joint)
    hand = frame_index(model.pin, model.hand)
    return max_reach(model.pin, hand, model.lower, model.upper, origin)
