"""Mobility ellipsoids: the unit ball of a metric, as it appears at the hand."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_expression, evaluate
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import KineticEnergy
from geodesic_ocp.model.model import Model, hand_labels
from geodesic_ocp.scenes.markings import EllipsoidTrack

SIZE = 0.15  # largest semi-axis as drawn, as a fraction of the reach
_FLAT = 0.02  # smallest semi-axis as drawn, as a fraction of the largest
_LONGER = 3.0  # than most: drawn shorter than to scale
_MOST = 1200  # samples at which they are computed: 20 Hz for a minute


def mobility_ellipsoids(
    model: Model, q: Array, metric: Metric | None = None
) -> tuple[EllipsoidTrack, ...]:
    """For every hand, the velocities that it can have at unit length in the metric, around it.

    They are the image J v of the unit ball v' G v <= 1 by the translational Jacobian J of the hand:
    the ellipsoid of J G^-1 J', long in directions in which little energy moves the hand fast. For
    the kinetic energy this is the generalized inertia ellipsoid of Asada, "A Geometrical
    Representation of Manipulator Dynamics and Its Application to Arm Design" (1983). All are drawn
    to the same scale, the longest semi-axis with 0.15 of the model's reach; directions in which the
    hand cannot move, or there is no metric, are drawn thin. Where one is more than three times as
    long as the median, as it is where the metric is nearly singular, it is cut at that length, and
    the others keep their size. Of more than 1200 configurations, J G^-1 J' is computed in 1200, and
    linear between them.

    Args:
        model: whose hands are shown.
        q: configurations (k, n) [rad or m].
        metric: on the model's configurations; None: its kinetic energy.
    """
    chosen = KineticEnergy(model) if metric is None else metric
    at = np.unique(np.linspace(0, len(q) - 1, min(len(q), _MOST)).round().astype(int))
    inverses = inverse_tensors(chosen, q[at])
    x, tracks = ca.SX.sym("q", model.dof), []
    for label, hand in zip(hand_labels(model.hands), model.hands, strict=True):
        if not model.moves(hand):
            continue
        one = model if hand == model.hand else model.with_hand(hand)
        jacobians = _values(x, one.hand_jacobian(x)[:3, :], q[at])
        images = jacobians @ inverses @ jacobians.transpose(0, 2, 1)
        columns = [np.interp(np.arange(len(q)), at, each) for each in images.reshape(-1, 9).T]
        centres = np.asarray(model.frame_pose(hand, q)[1])
        every = np.column_stack(columns).reshape(-1, 3, 3)
        tracks.append((f"mobility of the {label}", centres, every))
    return scaled_ellipsoids(tracks, SIZE * _extent(model, q))


def scaled_ellipsoids(
    tracks: Sequence[tuple[str, Array, Array]], size: float
) -> tuple[EllipsoidTrack, ...]:
    """Ellipsoids by name, centres (k, 3) and matrices (k, 3, 3), to one scale.

    The eigenvalues of the matrices, which are symmetric, are the squares of the semi-axes. The
    longest semi-axis of all has this size [m], or all of three times the median (see
    `longest_drawn`); none is drawn thinner than 2% of it.
    """
    squares = [np.linalg.eigvalsh(images)[:, -1] for *_, images in tracks]
    longest = longest_drawn(np.concatenate(squares)) if squares else 0.0
    if not (longest > 0.0 and size > 0.0):
        return ()
    return tuple(
        EllipsoidTrack(name, centres, size * _roots(images / longest**2, _FLAT))
        for name, centres, images in tracks
    )


def longest_drawn(squares: Array) -> float:
    """The semi-axis that is drawn longest, of those with these squares (k,), zero if there is none.

    Usually the longest one, but at most three times the median, so that a nearly singular sample
    does not make all others small.
    """
    lengths = np.sqrt(squares[squares > 0.0])
    return float(min(lengths.max(), _LONGER * np.median(lengths))) if len(lengths) else 0.0


def inverse_tensors(metric: Metric, q: Array) -> Array:
    """G(q)^-1 (k, n, n) at q (k, n), or zero where the tensor is not positive definite."""
    x = ca.SX.sym("q", metric.dim)
    tensor = as_expression(f"{type(metric).__name__}.matrix(q)", metric.matrix(x))
    tensors = np.nan_to_num(_values(x, tensor, q))
    regular = np.linalg.eigvalsh(tensors)[:, 0] > 0.0
    inverses = np.zeros_like(tensors)
    inverses[regular] = np.linalg.inv(tensors[regular])
    return inverses


def _values(x: ca.SX, expression: ca.SX, q: Array) -> Array:
    """Values (k, a, b) of a matrix (a, b) in x at the rows of q (k, n)."""
    matrix = ca.densify(expression)
    function = ca.Function("matrices", [x], [matrix], {"cse": True})
    found = np.asarray(evaluate(function.map(len(q)), q.T))
    return found.reshape(matrix.shape[0], len(q), matrix.shape[1]).transpose(1, 0, 2)


def _roots(images: Array, flat: float) -> Array:
    """Symmetric square roots (k, 3, 3), which map the unit ball onto the ellipsoids.

    Their eigenvalues, which are the semi-axes, are kept between `flat` and 1. Unlike semi-axes in
    columns, they change continuously also where two semi-axes are equally long.
    """
    squares, directions = np.linalg.eigh(images)
    lengths = np.clip(np.sqrt(np.maximum(squares, 0.0)), flat, 1.0)
    return np.asarray((directions * lengths[:, None]) @ directions.transpose(0, 2, 1))


def _extent(model: Model, q: Array) -> float:
    """The model's reach [m], or the range of its hand where sliding joints have no limits."""
    if np.isfinite(model.reach):
        return model.reach
    return float(np.ptp(np.asarray(model.hand_pose(q)[1]), axis=0).max())
