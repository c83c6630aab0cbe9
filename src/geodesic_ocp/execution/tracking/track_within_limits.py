"""Inverse kinematics that keeps the limits of joints, speed and acceleration: a QP per sample."""

from __future__ import annotations

from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import as_number, as_positive, as_vector
from geodesic_ocp.execution.joint_limits import JointLimits
from geodesic_ocp.execution.tracking.hand_targets import (
    HandTargets,
    jacobian_and_error,
    through_samples,
)
from geodesic_ocp.execution.tracking.pink_step import pink_step
from geodesic_ocp.execution.tracking.speed_bounds import SpeedBounds
from geodesic_ocp.execution.tracking.step import Step, Weights
from geodesic_ocp.model.model import Model
from geodesic_ocp.synergies.baselines.track_hand import Poses
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

Solver: TypeAlias = Literal["built-in", "pink"]
_EVEN = 1e-6  # share of a step
_FEWEST = 3  # steps: at rest, in motion, at rest


def track_within_limits(
    model: Model,
    start: ArrayLike,
    time: ArrayLike,
    poses: Poses | tuple[ArrayLike, ArrayLike],
    limits: JointLimits,
    *,
    rate: float = 200.0,
    posture: ArrayLike | None = None,
    posture_weight: float = 1e-2,
    posture_gain: float = 1.0,
    smoothing: float = 1e-3,
    gain: float = 10.0,
    damping: float = 1e-2,
    turning: bool = True,
    placing: bool = True,
    solver: Solver = "built-in",
) -> JointTrajectory:
    """Track poses of the hand from rest to rest, within the limits of joints, speed, acceleration.

    The constant speeds v of every step minimize

        |J v - w|^2 + posture_weight^2 |v - posture_gain (posture - q)|^2
            + smoothing rate |v - v_before|^2 + (damping^2 + |e|^2) |v|^2

    where w = velocity of the target + gain e and e is the error of the hand's pose: tasks as a
    quadratic program (Kanoun, Lamiraux, Wieber, IEEE Trans. Robotics 27, 2011; here of one priority
    with weights), damped by the error (Sugihara, IEEE Trans. Robotics 27, 2011). Bounds of v keep
    range, speed and acceleration of every joint, and leave room to brake (`SpeedBounds`). Limits on
    jerk and torque are not considered. Where limits or reach do not allow the pose, the hand stays
    behind.

    Args:
        model: a robot arm.
        start: configuration (n,), within the limits.
        time: increasing times (k,) [s], of which a function `poses` needs the first and last only.
        poses: rotations (m, 3, 3) and positions (m, 3) [m] of the hand as a function of m times,
            or the two arrays at the k times.
        limits: of the joints; infinite where there are none.
        rate: of the controller and of the trajectory [Hz].
        posture: configuration (n,) preferred by a redundant arm; None: the start.
        posture_weight: of the speeds towards it [m or rad of the hand per unit of a joint].
        posture_gain: [1/s].
        smoothing: weight of changes of the speeds [s]; like `gain`, the default is the best in hand
            errors and jerk of a few values on recorded motions.
        gain: of the pose error [1/s], at most the rate.
        damping: as `posture_weight`, of the speeds.
        turning, placing: whether it tracks rotations, and positions.
        solver: "built-in", or "pink" for the tasks and the solver of the package of that name.

    Returns:
        Samples at the rate from time 0. Velocities are central differences of the positions, and
        accelerations second differences.

    Raises:
        ValueError: wrong shapes or numbers, a start outside the limits, less than three steps.
        ImportError: solver "pink" without the extra of that name.
    """
    q = as_vector("start", start, model.dof)
    for name, value, low, high in zip(model.joint_names, q, model.lower, model.upper, strict=True):
        if not low <= value <= high:
            raise ValueError(
                f"start: {name} is at {value:.4g}, outside its limits {low:.4g} to {high:.4g}"
            )
    if not isinstance(limits, JointLimits) or limits.velocity.size != model.dof:
        raise ValueError(f"limits must be JointLimits of {model.dof} joints, got {limits!r}")
    if not (turning or placing):
        raise ValueError("turning and placing are both False: there is nothing to track")
    if solver not in get_args(Solver):
        raise ValueError(f"solver must be one of {', '.join(get_args(Solver))}, got {solver!r}")
    preferred = q if posture is None else as_vector("posture", posture, model.dof)
    drift = _not_negative("posture_gain", posture_gain)
    rate = as_positive("rate", rate, "Hz")
    gain = min(as_positive("gain", gain, "1/s"), rate)
    damping = as_positive("damping", damping)
    weights = Weights(
        posture=_not_negative("posture_weight", posture_weight) ** 2,
        change=_not_negative("smoothing", smoothing) * rate,
    )
    duration = 1.0 / rate
    targets = _targets(time, poses, duration)
    rows = (*range(3 * (not placing), 3), *range(3, 3 + 3 * turning))
    bounds = SpeedBounds.of(model, limits, duration)
    by_pink = pink_step(model, rows, duration, weights) if solver == "pink" else None

    count = len(targets.velocities)
    positions, speeds = np.empty((count + 1, model.dof)), np.zeros((count + 2, model.dof))
    positions[0] = q
    for k in range(count):
        jacobian, error = jacobian_and_error(
            model, rows, q, targets.rotations[k], targets.positions[k]
        )
        # At rest in the first and in the last step.
        lower, upper = bounds(q, speeds[k], min(k, count - 1 - k))
        step = Step(
            q=q,
            jacobian=jacobian,
            velocity=targets.velocities[k, list(rows)] + gain * error,
            posture=drift * (preferred - q),
            before=speeds[k],
            damping=damping**2 + float(error @ error),
            lower=lower,
            upper=upper,
        )
        found = step.solve(weights) if by_pink is None else by_pink(step)
        speeds[k + 1] = np.clip(found, lower, upper)
        q = q + duration * speeds[k + 1]
        positions[k + 1] = q
    return JointTrajectory(
        np.arange(count + 1) / rate,
        positions,
        (speeds[1:] + speeds[:-1]) / 2.0,
        np.diff(speeds, axis=0) / duration,
        model.joint_names,
        model.units,
    )


def _targets(
    time: ArrayLike, poses: Poses | tuple[ArrayLike, ArrayLike], step: float
) -> HandTargets:
    """The poses at the ends of steps [s]; after the last time, the last one."""
    given = np.array(time, dtype=float)
    if given.ndim != 1 or given.size < 2 or not np.all(np.diff(given) > 0.0):
        raise ValueError(f"time must be at least two increasing times, got shape {given.shape}")
    if not callable(poses):
        rotations, positions = (np.array(each, dtype=float) for each in poses)
        if rotations.shape != (given.size, 3, 3) or positions.shape != (given.size, 3):
            raise ValueError(
                f"poses must be rotations ({given.size}, 3, 3) and positions ({given.size}, 3) at "
                f"the times, got shapes {rotations.shape} and {positions.shape}"
            )
        poses = through_samples(given, rotations, positions)
    count = int(np.ceil((given[-1] - given[0]) / step - _EVEN))
    if count < _FEWEST:
        raise ValueError(
            f"time must span at least {_FEWEST} steps of {step:.3g} s, got "
            f"{given[-1] - given[0]:.3g} s"
        )
    return HandTargets.at(
        poses, np.minimum(given[0] + step * np.arange(count + 1), given[-1]), step
    )


def _not_negative(name: str, value: float) -> float:
    number = as_number(name, value)
    if number < 0.0:
        raise ValueError(f"{name} must not be negative, got {value!r}")
    return number
