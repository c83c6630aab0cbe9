"""Errors of a predicted motion against the observed one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr, rotation_vector
from geodesic_ocp.blocks import at_rows
from geodesic_ocp.manifold.metric import Metric, speeds_at
from geodesic_ocp.model.model import Model, hand_labels
from geodesic_ocp.synergies.synergy import as_segments
from geodesic_ocp.tables import markdown, new_table
from geodesic_ocp.trajectory.motion import Motion

if TYPE_CHECKING:
    from pandas import DataFrame

_CELLS = 200  # along the curves; the error falls with the square of their number
_ACROSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)  # from one curve to the other
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
class HandErrors(ShortRepr):
    """Mean errors of one of several hands over the samples of a motion.

    Attributes:
        name: what the hand is called in tables, such as "right hand".
        position: distance between the observed and the predicted hand [m].
        orientation: angle of the rotation between them [rad].
    """

    name: str
    position: float
    orientation: float


@dataclass(frozen=True, repr=False)
class MotionErrors(ShortRepr):
    """Mean errors over the samples of a motion.

    Attributes:
        joint: absolute error of a joint coordinate, over samples and joints [rad].
        position: distance between the hands [m]; the mean over the hands, if there are several.
        orientation: angle of the rotation between the hands [rad], likewise.
        hands: hands of each hand, in the order of `Model.hands`; empty for a model with a single
            one.

    The base of a model that includes the trunk is the pelvis; of a hand relative to the pelvis, and
    in the room, the errors are the same.
    """

    joint: float
    position: float
    orientation: float
    hands: tuple[HandErrors, ...] = ()

    @property
    def means(self) -> tuple[float, float, float]:
        """The errors of joints, positions and orientations."""
        return self.joint, self.position, self.orientation


def motion_errors(model: Model, observed: Motion, predicted: Motion) -> MotionErrors:
    """Return mean errors of a predicted motion against the observed one, sample by sample.

    >>> arm, time = go.human_arm(), np.linspace(0.0, 1.0, 11)
    >>> observed = go.Motion(time, np.outer(time, np.full(7, 0.5)), arm.joint_names)
    >>> predicted = go.Motion(time, observed.q + 0.01, arm.joint_names)
    >>> go.synergies.motion_errors(arm, observed, predicted)
    MotionErrors(joint=0.01, position=0.00922838, orientation=0.0395273)

    Args:
        model: model of the arm.
        observed, predicted: motions of its joints at the same sample times.

    Raises:
        ValueError: a joint of the model is missing, or the two differ in their sample times.
    """
    observed, predicted = _comparable(model, observed, predicted)
    return errors_between(model, observed.q, predicted.q)


def errors_between(model: Model, observed: Array, predicted: Array) -> MotionErrors:
    """Return mean errors of predicted configurations (k, n) of the model's joints, over the rows
    that are known: rows of NaN do not count.
    """
    known = np.isfinite(predicted).all(axis=1)
    observed = observed[known]
    predicted = predicted[known]
    hands = []
    for label, hand in zip(hand_labels(model.hands), model.hands, strict=True):
        poses, targets = (model.frame_pose(hand, each) for each in (predicted, observed))
        errors = pose_errors(poses, targets)
        hands.append(HandErrors(label, errors.position, errors.orientation))
    return MotionErrors(
        joint=float(np.mean(np.abs(predicted - observed))),
        position=float(np.mean([each.position for each in hands])),
        orientation=float(np.mean([each.orientation for each in hands])),
        hands=tuple(hands) if len(hands) > 1 else (),
    )


def pose_errors(poses: tuple[Array, Array], targets: tuple[Array, Array]) -> MotionErrors:
    """Return mean errors of k hand poses, (k, 3, 3) and (k, 3) each; the joint error is zero."""
    distances, angles = pose_differences(poses, targets)
    return MotionErrors(0.0, float(np.mean(distances)), float(np.mean(angles)))


def pose_differences(
    poses: tuple[Array, Array], targets: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Get distances (k,) [m] and angles (k,) [rad] between k poses, (k, 3, 3) and (k, 3) each.

    Of h hands, stacked, (k, 3 h, 3) and (k, 3 h): (k, h).
    """
    (turned, places), (wanted, others) = (
        (rotations.reshape(-1, 3, 3), positions.reshape(-1, 3))
        for rotations, positions in (poses, targets)
    )
    distances = np.linalg.norm(places - others, axis=1)
    angles = np.linalg.norm(rotation_vector(turned @ wanted.transpose(0, 2, 1)), axis=1)
    count = poses[1].shape[1] // 3
    shape = (-1,) if count == 1 else (-1, count)
    return distances.reshape(shape), np.asarray(angles).reshape(shape)


@dataclass(frozen=True, repr=False)
class Scores(ShortRepr):
    """Mean errors of a predicted motion against the observed one, over its samples.

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

    def table(self) -> DataFrame:
        """Return all scores, one a row."""
        rows = tuple((label, float(getattr(self, name))) for name, label in SCORES.items())
        return new_table(("score", "value"), rows)

    def _repr_markdown_(self) -> str:
        return markdown(self.table())


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

    >>> arm, time = go.human_arm(), np.linspace(0.0, 1.0, 101)
    >>> observed = go.Motion(time, np.outer(time, np.full(7, 0.5)), arm.joint_names)
    >>> late = go.Motion(time, np.outer(time**2, np.full(7, 0.5)), arm.joint_names)
    >>> scores = go.synergies.score(arm, observed, late)  # the same path at other times
    >>> round(scores.joint_mean, 3), round(scores.path_joint, 3)
    (0.083, 0.0)

    Args:
        model: model whose hand is compared, `Model.hand` of several; its joints are selected from
            the motions by name.
        observed: the recorded motion.
        predicted: at the same times.
        segments: (start, stop) sample indices of the segments, each starting where the one before
            stopped; the whole motion is one by default.

    Raises:
        ValueError: a joint of the model is missing, the two differ in their sample times, or the
            segments do not cover the motion.
    """
    observed, predicted = _comparable(model, observed, predicted)
    pieces = as_segments(observed, [(0, len(observed) - 1)] if segments is None else segments)
    poses = model.hand_pose(observed.q)
    other_poses = model.hand_pose(predicted.q)
    hand = poses[1]
    other_hand = other_poses[1]
    joints = predicted.q - observed.q
    distances, angles = pose_differences(other_poses, poses)
    speed = hand_speeds(model, observed)
    other_speed = hand_speeds(model, predicted)
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


def _comparable(model: Model, observed: Motion, predicted: Motion) -> tuple[Motion, Motion]:
    """Return the joints of the model of two motions with the same sample times."""
    observed, predicted = (motion.select(model.joint_names) for motion in (observed, predicted))
    if not np.array_equal(observed.time, predicted.time):
        raise ValueError("the observed and the predicted motion must have the same sample times")
    return observed, predicted


def action(metric: Metric, motion: Motion) -> float:
    """Return the action int 1/2 |q'|_G^2 dt of a motion, along the chords between its samples.

    With the kinetic-energy metric it is the mean kinetic energy times the duration [J s].

    Raises:
        ValueError: the motion is not of the metric's dimension.
    """
    steps = np.diff(motion.time)
    midpoints = (motion.q[1:] + motion.q[:-1]) / 2.0
    chords = np.diff(motion.q, axis=0)
    if motion.q.shape[1] != metric.dim:
        raise ValueError(
            f"the metric has dimension {metric.dim}, the motion {motion.q.shape[1]} joints"
        )
    return float(np.sum(speeds_at(metric, midpoints, chords) ** 2 / steps) / 2.0)


def area_between(first: Array, second: Array) -> float:
    """Return area of the ruled surface between two curves, polylines through (k, d) and (m, d)
    points.

    Straight lines connect points of equal relative arc length, x(s, u) = (1 - u) a(s) + u b(s),
    and the area is that of these lines, int int |dx/ds x dx/du| du ds. Where plane curves do not
    cross, and the lines do not either, it is the area of the region between them; where they cross,
    both sides count as positive. This is the construction of Jekel, Venter, Venter, Stander, Haftka
    (International Journal of Material Forming 12, 2019), who sum quadrilaterals between plane
    curves, in any dimension.
    """
    a = _evenly_spaced(first)
    b = _evenly_spaced(second)
    across = (b[1:] + b[:-1] - a[1:] - a[:-1]) / 2.0
    u = (_ACROSS[:, None, None] + 1.0) / 2.0
    along = (1.0 - u) * np.diff(a, axis=0) + u * np.diff(b, axis=0)
    # |x|^2 |y|^2 - (x.y)^2, the square of the area spanned by x and y, in any dimension.
    squares = np.sum(along**2, axis=2) * np.sum(across**2, axis=1)
    squares = squares - np.sum(along * across, axis=2) ** 2
    return float(np.sum(_WEIGHTS @ np.sqrt(np.maximum(squares, 0.0))) / 2.0)


def _evenly_spaced(points: Array) -> Array:
    """Return points at equal distances along the polyline; a curve of length zero stays where it
    is.
    """
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    upto = np.concatenate([[0.0], np.cumsum(lengths)])
    wanted = np.linspace(0.0, upto[-1], _CELLS + 1)
    return np.column_stack([np.interp(wanted, upto, column) for column in points.T])


def nearest_on_path(points: Array, path: Array) -> Array:
    """Return the point (k, n) nearest to each of the points (k, n) on the polyline through path (m,
    n).

    On the chord from p_i to p_(i+1) it is p_i + u (p_(i+1) - p_i) with u in [0, 1]; distances are
    Euclidean. Chords rather than samples are searched: the spacing of the samples along the path
    then does not add to the distance.
    """
    chords = np.diff(path, axis=0)
    squares = np.sum(chords**2, axis=1)
    squares[squares == 0.0] = 1.0  # a chord of length zero is the point itself
    nearest = np.empty_like(points)
    for row, point in enumerate(points):
        along = np.clip(np.sum((point - path[:-1]) * chords, axis=1) / squares, 0.0, 1.0)
        candidates = path[:-1] + along[:, None] * chords
        nearest[row] = candidates[np.argmin(np.sum((candidates - point) ** 2, axis=1))]
    return nearest


def hand_twists(model: Model, motion: Motion) -> Array:
    """Return linear [m/s] and angular [rad/s] velocities (k, 6) of the hand, J(q) q', in base axes.

    q' is the motion's velocity, or the derivative of the spline through its samples if it has none.
    """
    velocity = motion(motion.time, 1) if motion.velocity is None else motion.velocity
    return at_rows(_twist(model), motion.q, velocity)


def hand_speeds(model: Model, motion: Motion) -> Array:
    """Return speeds (k,) of the hand's position [m/s]."""
    return np.asarray(np.linalg.norm(hand_twists(model, motion)[:, :3], axis=1))


@lru_cache(maxsize=32)
def _twist(model: Model) -> ca.Function:
    q = ca.SX.sym("q", model.dof)
    v = ca.SX.sym("v", model.dof)
    return ca.Function("twist", [q, v], [ca.densify(model.hand_jacobian(q) @ v)])


def _nearest(observed: Array, predicted: Array, segments: Sequence[tuple[int, int]]) -> Array:
    """Return points (k, n) of the predicted path nearest to the samples, within the same segment.

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
    """Return Pearson's correlation coefficient; NaN if one of them is constant up to rounding."""
    if any(np.ptp(values) <= 1e-12 * np.abs(values).max() for values in (first, second)):
        return float("nan")
    return float(np.corrcoef(first, second)[0, 1])
