"""How well a predicted motion explains the observed one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.arrays import evaluate as evaluated
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.rotations import rotation_vector
from geodesic_ocp.trajectory.motion import Motion


@dataclass(frozen=True)
class MotionErrors:
    """Means over a motion's samples.

    Attributes:
        joint: absolute error of a joint coordinate, over samples and joints [rad].
        position: distance of the hands [m].
        orientation: angle of the rotation between the hands [rad].
    """

    joint: float
    position: float
    orientation: float


def evaluate(model: Model, observed: Motion, predicted: Motion) -> MotionErrors:
    """Mean errors of a predicted motion against the observed one, sample by sample.

    Raises:
        ValueError: a joint of the model is missing, or the two differ in their instants.
    """
    observed, predicted = (motion.select(model.joint_names) for motion in (observed, predicted))
    if not np.array_equal(observed.time, predicted.time):
        raise ValueError("the observed and the predicted motion must have the same instants")
    hands = pose_errors(model.hand_pose(predicted.q), model.hand_pose(observed.q))
    return replace(hands, joint=float(np.mean(np.abs(predicted.q - observed.q))))


def pose_errors(poses: tuple[Array, Array], wanted: tuple[Array, Array]) -> MotionErrors:
    """Mean errors of hands' poses, (k, 3, 3) and (k, 3) each; of no joints."""
    between = poses[0] @ wanted[0].transpose(0, 2, 1)
    return MotionErrors(
        joint=0.0,
        position=float(np.mean(np.linalg.norm(poses[1] - wanted[1], axis=1))),
        orientation=float(np.mean(np.linalg.norm(rotation_vector(between), axis=1))),
    )


def work(metric: Metric, motion: Motion) -> float:
    """Int 1/2 |q'|_G^2 dt of a motion, along the chords between its samples.

    With the kinetic energy's metric that is the mean kinetic energy times the duration [J s].

    Raises:
        ValueError: the motion is not of the metric's dimension.
    """
    steps = np.diff(motion.time)
    middle, chord = (motion.q[1:] + motion.q[:-1]) / 2.0, np.diff(motion.q, axis=0)
    lengths = evaluated(metric.speed.map(steps.size), middle.T, chord.T)[0]
    return float(np.sum(lengths**2 / steps) / 2.0)
