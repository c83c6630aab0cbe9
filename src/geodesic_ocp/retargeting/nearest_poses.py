"""How near the hand comes to each of many poses, found for all of them at once."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.pose_search import rotation_log

_LONGEST = 0.7  # step [rad or m]
_DAMPING, _LEAST_DAMPING = 0.05, 1e-10  # of the squared error
_EXACT = 1e-8  # [m] and [rad]
_FEW, _MANY = 32, 256  # configurations that a mapped function takes


class NearestPoses(NamedTuple):
    """The nearest poses found.

    Attributes:
        q: configurations (k, n).
        distances: of the hand from the targets (k,) [m].
        angles: likewise (k,) [rad]; zero if the rotation is free.
    """

    q: Array
    distances: Array
    angles: Array


def nearest_poses(
    robot: Model, rotations: Array | None, positions: Array, starts: Array, steps: int
) -> NearestPoses:
    """Configurations within the limits whose hand poses are nearest to k targets.

    Levenberg-Marquardt steps on |p - position|^2 + angle^2 ([m], [rad]) from m starts for each
    target, on all of them at once; the best of each is kept.

    Args:
        robot: the arm.
        rotations: (k, 3, 3) in its base frame; None leaves them free.
        positions: (k, 3) [m].
        starts: configurations (k, m, n).
        steps: number of steps.
    """
    count, each, n = starts.shape
    rows = 3 if rotations is None else 6
    lower, upper = search_range(robot)
    target = np.repeat(np.arange(count), each)
    turned = np.repeat(np.eye(3)[None], count, axis=0) if rotations is None else rotations
    poses = np.hstack([positions, turned.reshape(count, 9)])
    q = np.clip(starts.reshape(-1, n), lower, upper)
    best = q.copy()
    least = np.full(len(q), np.inf)
    active = np.arange(len(q))
    for number in range(steps + 1):
        errors, jacobians = _errors(robot, rows, q[active], poses[target[active]])
        square = (errors * errors).sum(axis=1)
        better = square < least[active]
        best[active[better]], least[active[better]] = q[active[better]], square[better]
        # A target that one of its starts has reached needs no other.
        reached = np.zeros(count, dtype=bool)
        reached[target[least <= _EXACT**2]] = True
        going = ~reached[target[active]]
        active, errors, jacobians = active[going], errors[going], jacobians[going]
        if not len(active) or number == steps:
            break
        moved = q[active] + _step(q[active], errors, jacobians, lower, upper)
        q[active] = np.clip(moved, lower, upper)
    grouped = least.reshape(count, each)
    chosen = best.reshape(count, each, n)[np.arange(count), grouped.argmin(axis=1)]
    errors, _ = _errors(robot, rows, chosen, poses)
    distances = np.linalg.norm(errors[:, :3], axis=1)
    return NearestPoses(chosen, distances, np.linalg.norm(errors[:, 3:], axis=1))


def search_range(robot: Model) -> tuple[Array, Array]:
    """Lower and upper bounds (n,) of the search: the limits, or half a revolution either way."""
    lower, upper = robot.lower, robot.upper
    wide = ~(upper - lower <= 2.0 * np.pi)
    with np.errstate(invalid="ignore"):
        first = np.clip(-np.pi, lower, upper - 2.0 * np.pi)
    return np.where(wide, first, lower), np.where(wide, first + 2.0 * np.pi, upper)


def _step(q: Array, errors: Array, jacobians: Array, lower: Array, upper: Array) -> Array:
    """Damped steps (k, n); joints at a limit that would leave their range stay."""
    free = np.ones_like(q)
    step = np.zeros_like(q)
    damping = _DAMPING * (errors * errors).sum(axis=1) + _LEAST_DAMPING
    rows = np.arange(errors.shape[1])
    for _ in range(3):
        held = jacobians * free[:, None, :]
        matrices = held @ held.transpose(0, 2, 1)
        matrices[:, rows, rows] += damping[:, None]
        step = -(held.transpose(0, 2, 1) @ np.linalg.solve(matrices, errors[:, :, None]))[:, :, 0]
        leaving = ((q <= lower) & (step < 0.0)) | ((q >= upper) & (step > 0.0))
        if not np.any(leaving & (free > 0.0)):
            break
        free[leaving] = 0.0
    length = np.linalg.norm(step, axis=1)[:, None]
    return np.asarray(step * (_LONGEST / np.maximum(length, _LONGEST)))


def _errors(robot: Model, rows: int, q: Array, poses: Array) -> tuple[Array, Array]:
    """Pose errors (k, rows) and Jacobians (k, rows, n)."""
    count, n = q.shape
    errors, jacobians = np.empty((count, rows)), np.empty((count, rows, n))
    width = _FEW if count <= _FEW else _MANY
    for first in range(0, count, width):
        size = min(width, count - first)
        part = slice(first, first + size)
        padded = np.zeros((width, n)), np.tile(poses[:1], (width, 1))
        padded[0][:size], padded[1][:size] = q[part], poses[part]
        found, sides = _error_function(robot, rows, width)(padded[0].T, padded[1].T)
        errors[part] = found.full().T[:size]
        jacobians[part] = sides.full().reshape(rows, width, n).transpose(1, 0, 2)[:size]
    return errors, jacobians


@lru_cache(maxsize=64)
def _error_function(robot: Model, rows: int, count: int) -> ca.Function:
    """Pose errors and the twists that change them, of many configurations and targets."""
    q, pose = ca.SX.sym("q", robot.dof), ca.SX.sym("pose", 12)
    rotation, position = robot.hand_pose(q)
    jacobian = robot.hand_jacobian(q)
    wanted = ca.reshape(pose[3:], 3, 3).T  # row by row
    errors = ca.vertcat(position - pose[:3], rotation_log(wanted.T @ rotation))
    # The rotation vector changes with the angular velocity in the hand's axes near the target.
    twists = ca.vertcat(jacobian[:3, :], rotation.T @ jacobian[3:, :])
    outputs = ca.cse([errors[:rows], ca.densify(twists[:rows, :])])
    return ca.Function("pose_errors", [q, pose], outputs).map(count)
