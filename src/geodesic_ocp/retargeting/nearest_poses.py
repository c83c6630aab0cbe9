"""Configurations in which the hand comes nearest to many poses, found all at once."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.pose_search import errors_and_twists, pose_steps, search_bounds

_EXACT = 1e-8  # [m] and [rad]
_FEW, _MANY = 32, 256  # configurations that a mapped function takes


class NearestPoses(NamedTuple):
    """The nearest poses found.

    Attributes:
        q: configurations (k, n).
        distances: distances of the hand from the targets (k,) [m].
        angles: likewise (k,) [rad]; zero if the rotation is free.
    """

    q: Array
    distances: Array
    angles: Array


def nearest_poses(
    robot: Model, rotations: Array | None, positions: Array, starts: Array, steps: int
) -> NearestPoses:
    """Return configurations within the limits whose hand poses are nearest to k targets.

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
    rows = tuple(range(3 if rotations is None else 6))
    lower, upper = search_range(robot)
    target = np.repeat(np.arange(count), each)
    turned = np.repeat(np.eye(3)[None], count, axis=0) if rotations is None else rotations
    by_columns = turned.transpose(0, 2, 1).reshape(count, 9)
    axes = np.tile(np.eye(3).ravel(), (count, 1))
    unused = np.zeros((count, n)), np.zeros((count, 1 + len(rows)))
    poses = np.hstack([unused[0], positions, by_columns, axes, unused[1]])
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
        step, _ = pose_steps(q[active], errors, jacobians, None, lower, upper)
        q[active] = np.clip(q[active] + step, lower, upper)
    grouped = least.reshape(count, each)
    chosen = best.reshape(count, each, n)[np.arange(count), grouped.argmin(axis=1)]
    errors, _ = _errors(robot, rows, chosen, poses)
    distances = np.linalg.norm(errors[:, :3], axis=1)
    return NearestPoses(chosen, distances, np.linalg.norm(errors[:, 3:], axis=1))


def search_range(robot: Model) -> tuple[Array, Array]:
    """Return lower and upper bounds (n,) of the search: the limits, or half a revolution either
    way.
    """
    lower, upper, _ = search_bounds(robot, np.zeros(robot.dof), True)
    return lower, upper


def _errors(robot: Model, rows: tuple[int, ...], q: Array, poses: Array) -> tuple[Array, Array]:
    """Return pose errors (k, rows) and Jacobians (k, rows, n)."""
    count, n = q.shape
    errors, jacobians = np.empty((count, len(rows))), np.empty((count, len(rows), n))
    width = _FEW if count <= _FEW else _MANY
    for first in range(0, count, width):
        size = min(width, count - first)
        part = slice(first, first + size)
        padded = np.zeros((width, n)), np.tile(poses[:1], (width, 1))
        padded[0][:size], padded[1][:size] = q[part], poses[part]
        found, sides = _mapped(robot, rows, width)(padded[0].T, padded[1].T)
        errors[part] = found.full().T[:size]
        jacobians[part] = sides.full().reshape(len(rows), width, n).transpose(1, 0, 2)[:size]
    return errors, jacobians


@lru_cache(maxsize=64)
def _mapped(robot: Model, rows: tuple[int, ...], count: int) -> ca.Function:
    return errors_and_twists(robot, rows).map(count)
