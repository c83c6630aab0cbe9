"""Baselines: predictions of a recorded motion that geodesics are compared with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import TypeAlias

import casadi as ca
import numpy as np
import scipy
from scipy.spatial.transform import Rotation

from geodesic_ocp.arrays import Array, evaluate, rotation_vector
from geodesic_ocp.manifold.metrics import KineticEnergy, with_joint_inertia
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.pose_search import rotation_log
from geodesic_ocp.synergies.scores import hand_twists
from geodesic_ocp.synergies.segment import observed_velocity
from geodesic_ocp.synergies.synergy import as_segments
from geodesic_ocp.trajectory.motion import Motion

__all__ = [
    "distal_inertia",
    "minimum_acceleration",
    "minimum_jerk",
    "minimum_jerk_hand",
    "track_hand",
]

# Largest displacement of a joint in one step of the controller [rad or m].
_MAX_STEP = 0.05
_GAIN = 20.0  # of the pose error [1/s]
_DAMPING = 0.02  # of the Jacobian's small singular values [m or rad per joint unit]
_FOREARM_AND_WRIST = ("Ez_joint", "Wx_joint", "Wy_joint")  # of human_arm, without R or L
Poses: TypeAlias = Callable[[Array], tuple[Array, Array]]


def track_hand(model: Model, motion: Motion) -> Motion:
    """Track the observed hands (end-effectors) with a damped velocity controller.

    It starts from the first observed configuration; the hand moves along the spline through the
    samples, see `_track_poses`. The observed configuration of the redundant arm plays no further
    role. All hands of the model are tracked at once.

    >>> arm, time = go.human_arm(), np.linspace(0.0, 1.0, 101)
    >>> motion = go.Motion(time, np.outer(time**2, np.full(7, 0.5)), arm.joint_names).filtered()
    >>> tracked = go.baselines.track_hand(arm, motion)
    >>> go.synergies.motion_errors(arm, motion, tracked).position < 1e-3
    True

    Args:
        model: model whose hands track; its joints must be the motion's.
        motion: observed.

    Returns:
        The controller's motion at the recording's sample times, with its velocities.

    Raises:
        ValueError: the joints are not the model's.
    """
    observed = motion.select(model.joint_names)

    poses = [lambda t, hand=hand: model.frame_pose(hand, observed(t)) for hand in model.hands]
    return _track_poses(model, observed, poses)


def _track_poses(model: Model, observed: Motion, poses: Sequence[Poses]) -> Motion:
    """Track poses of all hands together, as `track_hand`.

    q' = J' (J J' + damping^2)^-1 (hand velocity + gain * pose error). Damped least squares:
    Wampler, IEEE Trans. Systems, Man, and Cybernetics 16 (1986); the controller ignores joint
    limits.

    Args:
        model: that of `track_hand`.
        observed: motion whose first configuration is the start, and whose sample times are the
            result's; recordings at low sampling rates need many steps between two of them.
        poses: poses of every hand, rotations (m, 3, 3) and positions (m, 3) [m] at m times; called
            once.
    """
    time = observed.time
    start = observed.q[0]
    counts = np.ceil(np.abs(np.diff(observed.q, axis=0)).max(axis=1) / _MAX_STEP)
    counts = np.maximum(1, counts.astype(int))
    step = np.diff(time) / counts
    interval = np.repeat(np.arange(time.size - 1), counts)
    ends = np.cumsum(counts)
    within = np.arange(interval.size) - (ends - counts)[interval]
    instants = np.append(time[interval] + within * step[interval], time[-1])
    targets: list[Array] = []
    for rotations, positions in (each(instants) for each in poses):
        # Rotations side by side, (3, 3 m), as CasADi takes several arguments.
        beside = rotations.transpose(1, 0, 2).reshape(3, -1)
        targets += [beside[:, :-3], positions[:-1].T, beside[:, 3:], positions[1:].T]
    # A gain above 1/step would overshoot, above 2/step diverge.
    gains = np.minimum(_GAIN, 1.0 / step)
    numbers = (each[None, interval] for each in (step, gains))
    controller = _controller(model).mapaccum(interval.size)
    q = np.vstack([start, evaluate(controller, start, *targets, *numbers).T[ends - 1]])
    velocity = np.diff(q, axis=0) / np.diff(time)[:, None]
    velocity = np.vstack([velocity, velocity[-1:]])
    return Motion(time, q, model.joint_names, velocity, observed.subject)


@lru_cache(maxsize=32)
def _controller(model: Model) -> ca.Function:
    """Return one step: q, pose of each hand now and after the step, step [s], gain -> next q."""
    q = ca.SX.sym("q", model.dof)
    step = ca.SX.sym("h")
    gain = ca.SX.sym("k")
    targets: list[ca.SX] = []
    twists = []
    jacobians = []
    for hand in model.hands:
        now, after = ((ca.SX.sym("R", 3, 3), ca.SX.sym("p", 3)) for _ in range(2))
        forward = _twist(now, after)
        error = _twist(model.frame_pose(hand, q), now)
        twists.append(forward / step + gain * error)
        moved = model if hand == model.hand else model.with_hand(hand)
        jacobians.append(moved.hand_jacobian(q))
        targets += [*now, *after]
    twist = ca.vertcat(*twists)
    jacobian = ca.vertcat(*jacobians)
    damped = jacobian @ jacobian.T + _DAMPING**2 * ca.SX.eye(jacobian.shape[0])
    factors, upper, permutation = ca.ldl(damped, False)  # positive definite: no pivoting
    change = step * (jacobian.T @ ca.ldl_solve(twist, factors, upper, permutation))
    arguments = [q, *targets, step, gain]
    return ca.Function("controller", arguments, [ca.cse(ca.densify(q + change))])


def _twist(pose: tuple[ca.SX, ca.SX], target: tuple[ca.SX, ca.SX]) -> ca.SX:
    """Return translation and rotation vector (6,) from one pose to the other, in the base frame."""
    return ca.vertcat(target[1] - pose[1], rotation_log(target[0] @ pose[0].T))


def minimum_acceleration(motion: Motion, segments: Sequence[tuple[int, int]]) -> Motion:
    """Return the motion that minimizes int |q''|^2 dt on every segment, between the observed ends.

    With configurations and velocities given at both ends it is a cubic in every joint. A geodesic
    receives less: two configurations and two speeds, but not the directions of the velocities.

    >>> time = np.linspace(0.0, 1.0, 11)
    >>> cubic = go.Motion(time, time[:, None] ** 3, ("joint",), 3.0 * time[:, None] ** 2)
    >>> predicted = go.baselines.minimum_acceleration(cubic, [(0, 10)])
    >>> bool(np.allclose(predicted.q, cubic.q))
    True

    Args:
        motion: observed, with velocities.
        segments: (start, stop) sample indices, each starting where the one before stopped, from
            the first sample to the last.

    Returns:
        The predicted motion at the recording's own times, with velocities.

    Raises:
        ValueError: the segments do not cover the motion, or there are no velocities.
    """
    return _polynomials(motion, segments, [motion.q, observed_velocity(motion)])


def minimum_jerk(motion: Motion, segments: Sequence[tuple[int, int]]) -> Motion:
    """Return the motion that minimizes int |q'''|^2 dt on every segment, between the observed ends.

    With configurations, velocities and accelerations given at both ends it is a quintic in every
    joint (Flash and Hogan, J. Neuroscience 5, 1985, for a hand that starts and ends at rest).
    Accelerations are central differences of the motion's velocities. A geodesic receives less: two
    configurations and two speeds.

    >>> time = np.linspace(0.0, 1.0, 101)
    >>> q = 10.0 * time**3 - 15.0 * time**4 + 6.0 * time**5  # from rest to rest
    >>> reach = go.Motion(time, q[:, None], ("joint",), 30.0 * (time * (1.0 - time))[:, None] ** 2)
    >>> predicted = go.baselines.minimum_jerk(reach, [(0, 100)])
    >>> bool(np.allclose(predicted.q, reach.q, atol=1e-3))
    True

    Args:
        motion: observed, with velocities, of at least three samples.
        segments: as in `minimum_acceleration`.

    Returns:
        The predicted motion at the recording's own times, with velocities.

    Raises:
        ValueError: the segments do not cover the motion, there are no velocities, or fewer than
            three samples.
    """
    velocity = observed_velocity(motion)
    return _polynomials(motion, segments, [motion.q, velocity, rates(motion, velocity)])


def rates(motion: Motion, values: Array) -> Array:
    """Return derivatives (k, m) of sampled values (k, m) by time: central differences, second
    order.

    Raises:
        ValueError: the motion has fewer than three samples.
    """
    if len(motion) < 3:
        raise ValueError("accelerations need at least three samples, the motion has two")
    return np.asarray(np.gradient(values, motion.time, axis=0, edge_order=2))


def _polynomials(
    motion: Motion, segments: Sequence[tuple[int, int]], derivatives: Sequence[Array]
) -> Motion:
    """Return polynomials on the segments with these derivatives, (k, n) each, at their ends."""
    edges = [0, *(stop for _, stop in as_segments(motion, segments))]
    at_edges = np.stack([values[edges] for values in derivatives], axis=1)
    curve = scipy.interpolate.BPoly.from_derivatives(motion.time[edges], at_edges)
    q = curve(motion.time)
    velocity = curve(motion.time, 1)
    return Motion(motion.time, q, motion.joint_names, velocity, motion.subject)


def minimum_jerk_hand(
    model: Model,
    motion: Motion,
    segments: Sequence[tuple[int, int]],
) -> Motion:
    """Return minimum jerk of the hand on every segment, between the observed ends, and joints that
    track.

    The position of the hand is a quintic with the observed positions, velocities and accelerations
    at both ends (Flash and Hogan, J. Neuroscience 5, 1985). Its orientation turns about the axis of
    the rotation between the observed ones; the angle is a quintic, too, with the components of the
    observed angular velocities and accelerations along the axis. Joints follow by the damped
    velocity controller of `track_hand`, from the observed configuration at the segment's start.

    >>> arm, time = go.human_arm(), np.linspace(0.0, 0.5, 51)
    >>> q = np.array([0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1]) + 0.2 * np.sin(2.0 * time)[:, None]
    >>> motion = go.Motion(time, q, arm.joint_names, 0.4 * np.cos(2.0 * time)[:, None] + 0.0 * q)
    >>> predicted = go.baselines.minimum_jerk_hand(arm, motion, [(0, 50)])
    >>> errors = go.synergies.motion_errors(arm, motion, predicted)
    >>> bool(errors.position < 1e-3)  # mean error of the hand [m]
    True

    Args:
        model: the arm; its joints are selected from the motion by name.
        motion, segments: as in `minimum_jerk`.

    Returns:
        The predicted motion at the recording's own times, with velocities.

    Raises:
        ValueError: a joint of the model is missing, the segments do not cover the motion, there are
            no velocities or fewer than three samples.
    """
    observed = motion.select(model.joint_names)
    pieces = as_segments(observed, segments)
    velocity = observed_velocity(observed)
    hands = [_observed_hand(model, hand, observed) for hand in model.hands]
    q = np.empty_like(observed.q)
    velocity = np.empty_like(velocity)
    for start, stop in pieces:
        ends = [start, stop]
        samples = slice(start, stop + 1)
        times = observed.time[ends]
        poses = [_hand_motion(times, *(values[ends] for values in each)) for each in hands]
        tracked = _track_poses(model, observed.part(start, stop), poses)
        q[samples] = tracked.q
        velocity[samples] = tracked.velocity
    return Motion(observed.time, q, observed.joint_names, velocity, observed.subject)


def _observed_hand(model: Model, hand: str, observed: Motion) -> tuple[Array, Array, Array]:
    """Return rotations (k, 3, 3) of a hand, and derivatives of position and orientation at the
    samples.

    (k, 3 derivatives, 3) of the position, (k, 2, 3) of the orientation.
    """
    model = model if hand == model.hand else model.with_hand(hand)
    rotations, positions = model.hand_pose(observed.q)
    twists = hand_twists(model, observed)
    changes = rates(observed, twists)
    places = np.stack([positions, twists[:, :3], changes[:, :3]], axis=1)
    turns = np.stack([twists[:, 3:], changes[:, 3:]], axis=1)
    return rotations, places, turns


def _hand_motion(time: Array, rotations: Array, places: Array, turns: Array) -> Poses:
    """Return poses over a segment, from times (2,), rotations and derivatives of the pose at both
    ends.
    """
    turn = rotation_vector(rotations[1] @ rotations[0].T)  # in base axes
    size = float(np.linalg.norm(turn))
    axis = turn / size if size > 0.0 else np.zeros(3)
    angles = np.column_stack([[0.0, size], turns @ axis])
    angle = scipy.interpolate.BPoly.from_derivatives(time, angles)
    position = scipy.interpolate.BPoly.from_derivatives(time, places)

    def poses(times: Array) -> tuple[Array, Array]:
        turned = Rotation.from_rotvec(angle(times)[:, None] * axis).as_matrix()
        return turned @ rotations[0], position(times)

    return poses


def distal_inertia(model: Model) -> KineticEnergy:
    """Return the kinetic energy with joint inertia on the distal joints alone, as a control.

    The kinetic energy makes rotations of the forearm and the wrist nearly cost-free. If making
    them costly were all that joint inertia does, G + diag(a) with a on these joints alone would
    explain recordings as well as G + a I. The joint inertia is that of the model, if it has any, or
    else `default_joint_inertia`.

    >>> arm = go.human_arm().with_armature(0.1)
    >>> go.baselines.distal_inertia(arm).model.armature.tolist()
    [0.0, 0.0, 0.0, 0.0, 0.1, 0.1, 0.1]

    Args:
        model: the arm, a `human_arm`.

    Raises:
        ValueError: the model is not a `human_arm`, of which the distal joints are known.
    """
    if not (joints := distal_joints(model)):
        raise ValueError(
            f"the distal joints of {', '.join(model.joint_names)} are not known: forearm rotation "
            "and wrist are those of human_arm"
        )
    distal = [name in joints for name in model.joint_names]
    armature = np.where(distal, with_joint_inertia(model).armature, 0.0)
    return KineticEnergy(model.with_armature(armature))


def distal_joints(model: Model) -> list[str]:
    """Return forearm rotation and wrist of `human_arm`; none of other models."""
    return [name for name in model.joint_names if name[1:] in _FOREARM_AND_WRIST]
