"""The scores of a predicted motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.model import Model
from geodesic_ocp.rotations import rotation_vector
from geodesic_ocp.synergies.as_segments import as_segments
from geodesic_ocp.synergies.scores.area_between import area_between
from geodesic_ocp.synergies.scores.hand_speed import hand_speeds
from geodesic_ocp.synergies.scores.path_distance import nearest_on_path
from geodesic_ocp.table import Table
from geodesic_ocp.trajectory.motion import Motion

# What each score is called in tables.
SCORES = {
    "joint_mean": "joints [rad]",
    "joint_rms": "joints, RMS [rad]",
    "position_mean": "hand [m]",
    "position_rms": "hand, RMS [m]",
    "rotation_angle": "hand, angle [rad]",
    "quaternion_distance": "hand, S^3 [rad]",
    "speed_rms": "hand speed, RMS [m/s]",
    "speed_correlation": "hand speed, correlation",
    "path_joint": "path only, joints [rad]",
    "path_position": "path only, hand [m]",
    "area": "area [m^2]",
}


@dataclass(frozen=True, repr=False)
class Scores:
    """How far a predicted motion is from the observed one, over its samples.

    Attributes:
        joint_mean, joint_rms: absolute difference of a joint coordinate, mean and root mean square
            over samples and joints [rad, or m of prismatic joints].
        position_mean, position_rms: distance between the hands, mean and root mean square [m].
        rotation_angle: angle of the rotation between the hands, in [0, pi], mean [rad].
        speed_rms: root mean square difference of the hand's speed |p'(t)| [m/s].
        speed_correlation: Pearson's correlation of the two speed profiles, 1 at best; NaN if one
            of the speeds is constant.
        path_joint: as `joint_mean`, against the nearest point on the predicted path [rad].
        path_position: as `position_mean`, against the nearest point on the predicted path [m].
        area: between the observed and the predicted path of the hand, summed over segments [m^2].
    """

    joint_mean: float
    joint_rms: float
    position_mean: float
    position_rms: float
    rotation_angle: float
    speed_rms: float
    speed_correlation: float
    path_joint: float
    path_position: float
    area: float

    @property
    def quaternion_distance(self) -> float:
        """Mean geodesic distance of the orientations on S^3, arccos |<a, b>| [rad].

        It is half of `rotation_angle`: a rotation by an angle is a unit quaternion at half of it.
        """
        return self.rotation_angle / 2.0

    def __repr__(self) -> str:
        return (
            f"Scores(joints {self.joint_mean:.4g} rad, hand {self.position_mean:.4g} m and "
            f"{self.rotation_angle:.4g} rad (angle),\n  path only {self.path_joint:.4g} rad and "
            f"{self.path_position:.4g} m, speed {self.speed_rms:.4g} m/s, area {self.area:.4g} m^2)"
        )

    def table(self) -> Table:
        """All scores, one a row."""
        rows = tuple((label, float(getattr(self, name))) for name, label in SCORES.items())
        return Table(("score", "value"), rows)

    def _repr_markdown_(self) -> str:
        return self.table().markdown()


def score(
    model: Model,
    observed: Motion,
    predicted: Motion,
    segments: Sequence[tuple[int, int]] | None = None,
) -> Scores:
    """Compare a predicted motion with the observed one: in joints, hand, speed, path and area.

    The documentation ("Scores and tests") gives each formula and its source. Speeds are
    |J(q) q'| with the motions' velocities, or those of the spline through the samples of a motion
    that has none. In the scores of the path, timing is removed: every observed sample is compared
    with the nearest point on the chords between the predicted samples of the same segment.

    >>> import geodesic_ocp as go
    >>> import numpy as np
    >>> arm, time = go.human_arm(), np.linspace(0.0, 1.0, 101)
    >>> observed = go.Motion(time, np.outer(time, np.full(7, 0.5)), arm.joint_names)
    >>> late = go.Motion(time, np.outer(time**2, np.full(7, 0.5)), arm.joint_names)
    >>> scores = go.score(arm, observed, late)  # the same path at other times
    >>> round(scores.joint_mean, 3), round(scores.path_joint, 3)
    (0.083, 0.0)

    Args:
        model: whose hand is compared, `Model.hand` of several; its joints are selected from the
            motions by name.
        observed: the recorded motion.
        predicted: at the same times.
        segments: (start, stop) sample indices of the segments, each starting where the one before
            stopped; the whole motion is one by default.

    Raises:
        ValueError: a joint of the model is missing, the two differ in their sample times, or the
            segments do not cover the motion.
    """
    observed, predicted = (motion.select(model.joint_names) for motion in (observed, predicted))
    if not np.array_equal(observed.time, predicted.time):
        raise ValueError("the observed and the predicted motion must have the same sample times")
    pieces = as_segments(observed, [(0, len(observed) - 1)] if segments is None else segments)
    rotations, hand = model.hand_pose(observed.q)
    other_rotations, other_hand = model.hand_pose(predicted.q)
    joints = predicted.q - observed.q
    distances = np.linalg.norm(other_hand - hand, axis=1)
    angles = np.linalg.norm(rotation_vector(other_rotations @ rotations.transpose(0, 2, 1)), axis=1)
    speed, other_speed = hand_speeds(model, observed), hand_speeds(model, predicted)
    nearest_q = _nearest(observed.q, predicted.q, pieces)
    nearest_hand = _nearest(hand, other_hand, pieces)
    area = sum(area_between(hand[i : j + 1], other_hand[i : j + 1]) for i, j in pieces)
    return Scores(
        joint_mean=float(np.mean(np.abs(joints))),
        joint_rms=_rms(joints),
        position_mean=float(np.mean(distances)),
        position_rms=_rms(distances),
        rotation_angle=float(np.mean(angles)),
        speed_rms=_rms(other_speed - speed),
        speed_correlation=_correlation(speed, other_speed),
        path_joint=float(np.mean(np.abs(nearest_q - observed.q))),
        path_position=float(np.mean(np.linalg.norm(nearest_hand - hand, axis=1))),
        area=float(area),
    )


def _nearest(observed: Array, predicted: Array, segments: Sequence[tuple[int, int]]) -> Array:
    """Points (k, n) of the predicted path nearest to the samples, within the same segment.

    A sample that two segments share belongs to the one that starts there.
    """
    nearest = np.empty_like(observed)
    for start, stop in segments:
        samples = slice(start, stop + 1)
        nearest[samples] = nearest_on_path(observed[samples], predicted[samples])
    return nearest


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _correlation(first: Array, second: Array) -> float:
    """Pearson's correlation coefficient; NaN if one of them is constant up to rounding."""
    if any(np.ptp(values) <= 1e-12 * np.abs(values).max() for values in (first, second)):
        return float("nan")
    return float(np.corrcoef(first, second)[0, 1])
