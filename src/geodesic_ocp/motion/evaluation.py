"""How well a predicted motion explains the observed one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geodesic_ocp.model.model import Model
from geodesic_ocp.motion.rotations import rotation_vector
from geodesic_ocp.sampled import Motion


@dataclass(frozen=True)
class Errors:
    """Means over a motion's samples.

    Attributes:
        joint: absolute error of a joint coordinate, over samples and joints [rad].
        position: distance of the hands [m].
        orientation: angle of the rotation between the hands [rad].
    """

    joint: float
    position: float
    orientation: float


def evaluate(model: Model, observed: Motion, predicted: Motion) -> Errors:
    """Mean errors of a predicted motion against the observed one, sample by sample.

    Raises:
        ValueError: a joint of the model is missing, or the two differ in their instants.
    """
    observed, predicted = (motion.select(model.joint_names) for motion in (observed, predicted))
    if not np.array_equal(observed.time, predicted.time):
        raise ValueError("the observed and the predicted motion must have the same instants")
    rotations, positions = model.hand_pose(observed.q)
    rotations_predicted, positions_predicted = model.hand_pose(predicted.q)
    between = rotations_predicted @ rotations.transpose(0, 2, 1)
    return Errors(
        joint=float(np.mean(np.abs(predicted.q - observed.q))),
        position=float(np.mean(np.linalg.norm(positions_predicted - positions, axis=1))),
        orientation=float(np.mean(np.linalg.norm(rotation_vector(between), axis=1))),
    )
