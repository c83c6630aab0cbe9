"""Inverse kinematics from many starts at once: Levenberg-Marquardt steps on all of them together.

Damping in proportion to the squared error converges quadratically, also near singularities
(Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method", IEEE
Trans. Robotics 27, 2011). What the pose leaves free serves to come nearer to a configuration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array

# configurations (k, n) -> weighted pose errors (k, m) and their Jacobians (k, m, n)
PoseErrors: TypeAlias = Callable[[Array], tuple[Array, Array]]

_STEPS, _USUAL_STEPS = 40, 24  # the latter if anything has been found
_PATIENCE = 12  # steps after which starts far from the pose are given up
_FAR, _EXACT = 0.1, 1e-11  # pose errors [m] and [rad]
_DAMPING, _LEAST_DAMPING = 0.05, 1e-12  # of the squared error
_LONGEST = 0.7  # step [rad or m]
_SETTLED = 1e-2  # step [rad or m] along the configurations with the pose
_STUCK = 1e-2  # step relative to the pose error of a search that ends away from the pose
_SLIDE = 0.7  # of the way to the nearest configuration, as the pose's curvature is ignored


@dataclass(frozen=True, eq=False)
class Found:
    """Configurations (k, n), and the largest of their weighted pose errors (k,)."""

    q: Array
    errors: Array


def search_simultaneously(
    pose_errors: PoseErrors,
    starts: Array,
    near: Array | None,
    bounds: tuple[Array, Array],
    enough: int,
    settled: float = _SETTLED,
) -> Found:
    """Configurations within bounds whose pose errors vanish, or are least nearby.

    Args:
        pose_errors: of many configurations.
        starts: configurations (k, n) to search from.
        near: configuration (n,) to come near to, in the directions that the pose leaves free; None:
            each search stays near its start.
        bounds: lower and upper (n,).
        enough: the search ends when so many have attained the pose and no longer move.
        settled: how little they still move [rad or m]; infinite if any configuration will do.
    """
    lower, upper = bounds
    q = np.clip(starts, lower, upper)
    done_q: list[Array] = []
    given_up: list[Array] = []
    for number in range(_STEPS):
        errors, jacobians = pose_errors(q)
        largest = np.abs(errors).max(axis=1, initial=0.0)
        step, slide = _steps(q, errors, jacobians, near, lower, upper)
        done = (largest <= _EXACT) & (slide <= settled)
        if np.any(done):
            done_q += list(q[done])
            if len(done_q) >= enough:
                break
        moves = np.abs(step).max(axis=1) > _STUCK * largest
        keep = ~done & moves & ((number < _PATIENCE) | (largest <= _FAR))
        given_up += list(q[~done & ~keep])
        q = np.clip(q[keep] + step[keep], lower, upper)
        if not len(q) or (done_q and number >= _USUAL_STEPS):
            break
    every = np.array([*done_q, *q, *given_up])
    return Found(every, np.abs(pose_errors(every)[0]).max(axis=1, initial=0.0))


def _steps(
    q: Array, errors: Array, jacobians: Array, near: Array | None, lower: Array, upper: Array
) -> tuple[Array, Array]:
    """Steps (k, n), and the lengths (k,) of their parts along configurations with one pose."""
    free = np.ones_like(q, dtype=bool)
    for _ in range(3):  # joints that would leave their range stay at its end
        step, slide = _free_steps(q, errors, jacobians, near, free)
        pushed: NDArray[np.bool_] = ((q <= lower) & (step < 0.0)) | ((q >= upper) & (step > 0.0))
        if not np.any(pushed & free):
            break
        free &= ~pushed
    return step, slide


def _free_steps(
    q: Array, errors: Array, jacobians: Array, near: Array | None, free: NDArray[np.bool_]
) -> tuple[Array, Array]:
    free_jacobians = jacobians * free[:, None, :]
    transposed = free_jacobians.transpose(0, 2, 1)
    square = (errors * errors).sum(axis=1)
    damping = _DAMPING * square + _LEAST_DAMPING
    matrices = free_jacobians @ transposed
    rows = np.arange(errors.shape[1])
    matrices[:, rows, rows] += damping[:, None]
    closer = np.zeros_like(q) if near is None else _SLIDE * (near - q) * free
    wanted = np.empty((*errors.shape, 2))
    wanted[:, :, 0], wanted[:, :, 1] = errors, (free_jacobians @ closer[:, :, None])[:, :, 0]
    corrections = transposed @ np.linalg.solve(matrices, wanted)
    slide = np.where((square < _FAR**2)[:, None], closer - corrections[:, :, 1], 0.0)
    lengths = np.sqrt((slide * slide).sum(axis=1))
    step = slide - corrections[:, :, 0]
    length = np.sqrt((step * step).sum(axis=1))[:, None]
    return step * (_LONGEST / np.maximum(length, _LONGEST)), lengths
