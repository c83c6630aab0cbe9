"""The inverse-kinematics baseline: a controller that tracks the observed hand, or all hands."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import TypeAlias

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_positive, evaluate
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.ik.pose_error import rotation_log
from geodesic_ocp.trajectory.motion import Motion

# Largest displacement of a joint in one step of the controller [rad or m].
_MAX_STEP = 0.05
Poses: TypeAlias = Callable[[Array], tuple[Array, Array]]
Pose: TypeAlias = tuple[ca.SX, ca.SX]


def track_hand(
    model: Model, motion: Motion, *, gain: float = 20.0, damping: float = 0.02
) -> Motion:
    """Track the observed hands (end-effectors) with a damped velocity controller.

    It starts from the first observed configuration; the hand moves along the spline through the
    samples, see `track_poses`. The observed configuration of the redundant arm plays no further
    role. All hands of the model are tracked at once.

    Args:
        model: whose hands track; its joints must be the motion's.
        motion: observed.
        gain: of the pose error [1/s].
        damping: of the Jacobian's small singular values [m or rad per joint unit].

    Returns:
        The controller's motion at the recording's sample times, with its velocities.

    Raises:
        ValueError: the joints are not the model's, or a number is not positive.
    """
    observed = motion.select(model.joint_names)

    def of(hand: str) -> Poses:
        def poses(times: Array) -> tuple[Array, Array]:
            rotations, positions = model.frame_pose(hand, observed(times))
            return rotations, positions

        return poses

    tracked = track_poses(
        model,
        observed.q[0],
        observed.time,
        {hand: of(hand) for hand in model.hands},
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
    poses: Poses | Mapping[str, Poses],
    *,
    gain: float = 20.0,
    damping: float = 0.02,
    counts: Array | None = None,
    turning: bool = True,
    placing: bool = True,
) -> Motion:
    """Track poses of a hand, or of several, with a damped velocity controller.

    q' = J' (J J' + damping^2)^-1 (hand velocity + gain * pose error), of all hands together. Damped
    least squares: Wampler, IEEE Trans. Systems, Man, and Cybernetics 16 (1986); the controller
    ignores joint limits.

    Args:
        model: whose hand tracks.
        start: configuration (n,).
        time: increasing times (k,) [s].
        poses: rotations (m, 3, 3) and positions (m, 3) [m] of the hand at m times, called once; or
            such functions by name of the hand frame.
        gain: of the pose error [1/s].
        damping: of the Jacobian's small singular values [m or rad per joint unit].
        counts: (k - 1,) steps of the controller between the times; one by default.
        turning, placing: whether it tracks rotations, and positions.

    Raises:
        ValueError: a number is not positive.
    """
    gain, damping = as_positive("gain", gain, "1/s"), as_positive("damping", damping)
    counts = np.ones(time.size - 1) if counts is None else counts
    step = np.diff(time) / counts
    interval = np.repeat(np.arange(time.size - 1), counts.astype(int))
    ends = np.cumsum(counts).astype(int)
    within = np.arange(interval.size) - (ends - counts)[interval]
    instants = np.append(time[interval] + within * step[interval], time[-1])
    wanted = dict(poses) if isinstance(poses, Mapping) else {model.hand: poses}
    targets: list[Array] = []
    for rotations, positions in (each(instants) for each in wanted.values()):
        # Rotations side by side, (3, 3 m), as CasADi takes several arguments.
        beside = rotations.transpose(1, 0, 2).reshape(3, -1)
        targets += [beside[:, :-3], positions[:-1].T, beside[:, 3:], positions[1:].T]
    controller = _controller(model, tuple(wanted), turning, placing).mapaccum(interval.size)
    configurations = evaluate(
        controller,
        start,
        *targets,
        step[None, interval],
        # A gain above 1/step would overshoot, above 2/step diverge.
        np.minimum(gain, 1.0 / step)[None, interval],
        np.full((1, interval.size), damping),
    ).T
    q = np.vstack([start, configurations[ends - 1]])
    velocity = np.diff(q, axis=0) / np.diff(time)[:, None]
    return Motion(time, q, model.joint_names, np.vstack([velocity, velocity[-1:]]))


@lru_cache(maxsize=32)
def _controller(model: Model, hands: tuple[str, ...], turning: bool, placing: bool) -> ca.Function:
    """One step: q, pose of each hand now and after the step, step [s], gain, damping -> next q."""
    rows = slice(0 if placing else 3, 6 if turning else 3)
    q, step, gain, damping = ca.SX.sym("q", model.dof), *(ca.SX.sym(name) for name in "hkd")
    targets: list[ca.SX] = []
    twists, jacobians = [], []
    for hand in hands:
        now, after = ((ca.SX.sym("R", 3, 3), ca.SX.sym("p", 3)) for _ in range(2))
        forward, error = _twist(now, after), _twist(model.frame_pose(hand, q), now)
        twists.append((forward / step + gain * error)[rows])
        moved = model if hand == model.hand else model.with_hand(hand)
        jacobians.append(moved.hand_jacobian(q)[rows, :])
        targets += [*now, *after]
    twist, jacobian = ca.vertcat(*twists), ca.vertcat(*jacobians)
    damped = jacobian @ jacobian.T + damping**2 * ca.SX.eye(jacobian.shape[0])
    factors, upper, permutation = ca.ldl(damped, False)  # positive definite: no pivoting
    change = step * (jacobian.T @ ca.ldl_solve(twist, factors, upper, permutation))
    arguments = [q, *targets, step, gain, damping]
    return ca.Function("controller", arguments, [ca.cse(ca.densify(q + change))])


def _twist(pose: Pose, target: Pose) -> ca.SX:
    """Translation and rotation vector (6,) from one pose to the other, in the base frame."""
    return ca.vertcat(target[1] - pose[1], rotation_log(target[0] @ pose[0].T))
