"""How well a predicted motion explains the observed one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model, hand_labels
from geodesic_ocp.rotations import rotation_vector
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import speeds_at


@dataclass(frozen=True, repr=False)
class HandErrors:
    """Mean errors of one of several hands over the samples of a motion.

    Attributes:
        name: what the hand is called in tables, such as "right hand".
        position: distance between the observed and the predicted hand [m].
        orientation: angle of the rotation between them [rad].
    """

    name: str
    position: float
    orientation: float

    def __repr__(self) -> str:
        return (
            f"HandErrors({self.name}, position {self.position:.4g} m, "
            f"orientation {self.orientation:.4g} rad)"
        )


@dataclass(frozen=True, repr=False)
class MotionErrors:
    """Mean errors over the samples of a motion.

    Attributes:
        joint: absolute error of a joint coordinate, over samples and joints [rad].
        position: distance between the hands [m]; the mean over the hands, if there are several.
        orientation: angle of the rotation between the hands [rad], likewise.
        hands: of each hand, in the order of `Model.hands`; empty for a model with a single one.

    The base of a model that includes the trunk is the pelvis; of a hand relative to the pelvis, and
    in the room, the errors are the same.
    """

    joint: float
    position: float
    orientation: float
    hands: tuple[HandErrors, ...] = ()

    def __repr__(self) -> str:
        return (
            f"MotionErrors(joint {self.joint:.4g} rad, position {self.position:.4g} m, "
            f"orientation {self.orientation:.4g} rad)"
        )


def evaluate(model: Model, observed: Motion, predicted: Motion) -> MotionErrors:
    """Mean errors of a predicted motion against the observed one, sample by sample.

    >>> import geodesic_ocp as go
    >>> import numpy as np
    >>> arm, time = go.human_arm(), np.linspace(0.0, 1.0, 11)
    >>> observed = go.Motion(time, np.outer(time, np.full(7, 0.5)), arm.joint_names)
    >>> predicted = go.Motion(time, observed.q + 0.01, arm.joint_names)
    >>> go.evaluate(arm, observed, predicted)
    MotionErrors(joint 0.01 rad, position 0.009228 m, orientation 0.03953 rad)

    Raises:
        ValueError: a joint of the model is missing, or the two differ in their sample times.
    """
    observed, predicted = (motion.select(model.joint_names) for motion in (observed, predicted))
    if not np.array_equal(observed.time, predicted.time):
        raise ValueError("the observed and the predicted motion must have the same sample times")
    every = [
        pose_errors(model.frame_pose(hand, predicted.q), model.frame_pose(hand, observed.q))
        for hand in model.hands
    ]
    labels = hand_labels(model.hands)
    hands = tuple(
        HandErrors(label, each.position, each.orientation)
        for label, each in zip(labels, every, strict=True)
    )
    return MotionErrors(
        joint=float(np.mean(np.abs(predicted.q - observed.q))),
        position=float(np.mean([each.position for each in every])),
        orientation=float(np.mean([each.orientation for each in every])),
        hands=hands if len(hands) > 1 else (),
    )


def pose_errors(poses: tuple[Array, Array], targets: tuple[Array, Array]) -> MotionErrors:
    """Mean errors of k hand poses, (k, 3, 3) and (k, 3) each; the joint error is zero."""
    between = poses[0] @ targets[0].transpose(0, 2, 1)
    return MotionErrors(
        joint=0.0,
        position=float(np.mean(np.linalg.norm(poses[1] - targets[1], axis=1))),
        orientation=float(np.mean(np.linalg.norm(rotation_vector(between), axis=1))),
    )


def action(metric: Metric, motion: Motion) -> float:
    """The action int 1/2 |q'|_G^2 dt of a motion, along the chords between its samples.

    With the kinetic-energy metric it is the mean kinetic energy times the duration [J s].

    Raises:
        ValueError: the motion is not of the metric's dimension.
    """
    steps = np.diff(motion.time)
    midpoints, chords = (motion.q[1:] + motion.q[:-1]) / 2.0, np.diff(motion.q, axis=0)
    if motion.q.shape[1] != metric.dim:
        raise ValueError(
            f"the metric has dimension {metric.dim}, the motion {motion.q.shape[1]} joints"
        )
    return float(np.sum(speeds_at(metric, midpoints, chords) ** 2 / steps) / 2.0)
