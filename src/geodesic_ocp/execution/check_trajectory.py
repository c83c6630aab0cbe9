"""check_trajectory: whether a robot can execute a sampled trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_number
from geodesic_ocp.execution.clearance_constraint import Clearance
from geodesic_ocp.execution.joint_limits import JointLimits, joint_limits
from geodesic_ocp.execution.least_clearance import least_clearance
from geodesic_ocp.execution.sample_consistency import sample_consistency
from geodesic_ocp.execution.trajectory_check import TrajectoryCheck
from geodesic_ocp.execution.trajectory_conditions import (
    beyond,
    beyond_positions,
    contradictions,
    magnitudes,
    time_faults,
    unrest,
)
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory


def check_trajectory(
    trajectory: JointTrajectory,
    model: Model | Sequence[Model],
    limits: JointLimits | Sequence[JointLimits] | None = None,
    *,
    gravity: ArrayLike = (0.0, 0.0, -9.81),
    rest: bool = True,
    uniform: bool = True,
    tolerance: float = 1e-3,
    clearance: Clearance | None = None,
) -> TrajectoryCheck:
    """Check whether a robot can execute a sampled trajectory, of whatever origin.

    - Times increase strictly, and evenly unless `uniform` is False.
    - Samples agree with each other: differences of positions with velocities, and differences of
      velocities with accelerations, up to the error of the trapezoidal rule. With steps h it is at
      most J h^3 / 8 and J h^2 / 2, where J is the jerk that the accelerations show nearby.
    - Positions, velocities, accelerations, jerk and torques are within the limits. Means between
      samples count as well, such as the difference of two velocities over their step: what a
      trajectory has in between is at least as large.
    - It is at rest at both ends, unless `rest` is False. Then the accelerations there are jumps
      from zero, which limits on jerk concern as well.

    >>> import geodesic_ocp as go
    >>> import numpy as np
    >>> arm = go.human_arm("right")
    >>> time, zeros = np.arange(5) / 100, np.zeros((5, 7))
    >>> still = go.JointTrajectory(time, zeros, zeros, zeros, arm.joint_names)
    >>> go.check_trajectory(still, arm).passed
    True

    Args:
        trajectory: its joints are those of the model in any order, or in the same order with a
            prefix that ends in a slash.
        model: the robot, payload included, or several whose joints follow each other.
        limits: of the joints of each model; None: `joint_limits(model)`.
        gravity: acceleration of free fall in the axes of each robot's base, (3,) or (robots, 3)
            [m/s^2].
        rest: whether it must begin and end at rest.
        uniform: whether it must be sampled evenly.
        tolerance: by which fraction of a limit a value may exceed it.
        clearance: distances to be kept, of the joints of all models in their order, such as those
            of `clearance_constraint`; None: not checked. They are evaluated every 10 ms, or at
            every sample if there are fewer, and exactly where the function is below its bound.

    Raises:
        ValueError: other joints or units than the model's; limits, gravity or clearance of other
            sizes.
    """
    models = [model] if isinstance(model, Model) else list(model)
    trajectory = _in_order(trajectory, models)
    limit = _joined(limits, models)
    slack = as_number("tolerance", tolerance)
    if slack < 0.0:
        raise ValueError(f"tolerance must not be negative, got {tolerance!r}")
    sentences = [*time_faults(trajectory, uniform)]
    consistency: dict[str, Array] = {}
    if len(trajectory.time) > 1 and np.all(np.diff(trajectory.time) > 0.0):
        found = sample_consistency(trajectory)
        sentences += contradictions(trajectory, found)
        consistency = {"velocity": found.shares()[0], "acceleration": found.shares()[1]}
    lower = np.concatenate([each.lower for each in models])
    upper = np.concatenate([each.upper for each in models])
    sentences += beyond_positions(trajectory, lower, upper)
    values = magnitudes(trajectory, _torques(trajectory, models, gravity), rest)
    usage = {"position": _share_of_range(trajectory.positions, lower, upper)}
    for name, (instants, sizes) in values.items():
        bound = getattr(limit, name)
        usage[name] = np.max(sizes, axis=0, initial=0.0) / bound
        sentences += beyond(trajectory, name, instants, sizes, bound, slack)
    if rest:
        sentences += unrest(trajectory)
    least = None
    if clearance is not None:
        least, found_near = least_clearance(trajectory, clearance)
        sentences += found_near
    largest = {name: np.max(sizes, axis=0, initial=0.0) for name, (_, sizes) in values.items()}
    return TrajectoryCheck(
        tuple(sentences), usage, largest, consistency, trajectory.joint_names, least
    )


def _in_order(trajectory: JointTrajectory, models: Sequence[Model]) -> JointTrajectory:
    """The trajectory with the joints in the order of the models."""
    names = [name for model in models for name in model.joint_names]
    units = [unit for model in models for unit in model.units]
    given = trajectory.joint_names
    same = len(names) == len(given) and all(
        mine == other or mine.endswith(f"/{other}")
        for mine, other in zip(given, names, strict=True)
    )
    order = list(range(len(names)))
    if not same:
        if len(set(names)) < len(names) or set(given) != set(names):
            raise ValueError(
                f"the trajectory moves joints {', '.join(given)}, the model {', '.join(names)}"
            )
        order = [given.index(name) for name in names]
    ordered = replace(
        trajectory,
        positions=trajectory.positions[:, order],
        velocities=trajectory.velocities[:, order],
        accelerations=trajectory.accelerations[:, order],
        joint_names=tuple(given[k] for k in order),
        units=tuple(trajectory.units[k] for k in order),
        efforts=None,
    )
    for joint, mine, other in zip(ordered.joint_names, ordered.units, units, strict=True):
        if mine != other:
            raise ValueError(f"joint {joint!r} moves in {other}, the trajectory is in {mine}")
    return ordered


def _joined(
    limits: JointLimits | Sequence[JointLimits] | None, models: Sequence[Model]
) -> JointLimits:
    """The limits of all models as one record."""
    if limits is None:
        parts = [joint_limits(model) for model in models]
    else:
        parts = [limits] if isinstance(limits, JointLimits) else list(limits)
    count = sum(part.velocity.size for part in parts)
    if count != sum(model.dof for model in models):
        raise ValueError(
            f"limits must be of {sum(model.dof for model in models)} joints, got {count}"
        )
    return JointLimits(
        np.concatenate([part.velocity for part in parts]),
        np.concatenate([part.acceleration for part in parts]),
        np.concatenate([part.jerk for part in parts]),
        np.concatenate([part.torque for part in parts]),
    )


def _torques(trajectory: JointTrajectory, models: Sequence[Model], gravity: ArrayLike) -> Array:
    """Inverse dynamics of all models at the samples (k, n) [N m or N]."""
    falls = np.array(gravity, dtype=float)
    if falls.shape == (3,):
        falls = np.tile(falls, (len(models), 1))
    if falls.shape != (len(models), 3) or not np.all(np.isfinite(falls)):
        raise ValueError(f"gravity must be 3 numbers, or 3 for each robot, got {gravity!r}")
    found, start = [], 0
    for model, fall in zip(models, falls, strict=True):
        joints = slice(start, start + model.dof)
        q, v, a = (
            state[:, joints]
            for state in (trajectory.positions, trajectory.velocities, trajectory.accelerations)
        )
        found.append(model.inverse_dynamics(q, v, a, fall))
        start += model.dof
    return np.hstack(found)


def _share_of_range(positions: Array, lower: Array, upper: Array) -> Array:
    """Largest distance from the middle of the range over half the range (n,); 0 if unlimited."""
    limited = np.isfinite(lower) & np.isfinite(upper)
    low, high = np.where(limited, lower, 0.0), np.where(limited, upper, 0.0)
    middle = (low + high) / 2.0
    half = np.where(limited, np.maximum((high - low) / 2.0, np.finfo(float).tiny), np.inf)
    return np.asarray(np.max(np.abs(positions - middle) / half, axis=0, initial=0.0))
