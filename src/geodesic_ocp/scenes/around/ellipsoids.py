"""Mobility ellipsoids: the unit ball of a metric, as it appears at the hand."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics.kinetic_energy import KineticEnergy
from geodesic_ocp.model.hands import hand_labels
from geodesic_ocp.model.model import Model
from geodesic_ocp.scenes.markings import EllipsoidTrack

SIZE = 0.15  # largest semi-axis as drawn, as a fraction of the reach
_FLAT = 0.02  # smallest semi-axis as drawn, as a fraction of the largest


def mobility_ellipsoids(
    model: Model, q: Array, metric: Metric | None = None
) -> tuple[EllipsoidTrack, ...]:
    """For every hand, the velocities that it can have at unit length in the metric, around it.

    They are the image J v of the unit ball v' G v <= 1 by the translational Jacobian J of the hand:
    the ellipsoid of J G^-1 J', long in directions in which little energy moves the hand fast. For
    the kinetic energy this is the generalized inertia ellipsoid of Asada, "A Geometrical
    Representation of Manipulator Dynamics and Its Application to Arm Design" (1983). All are drawn
    to the same scale, the longest semi-axis with 0.15 of the model's reach; directions in which the
    hand cannot move, or there is no metric, are drawn thin.

    Args:
        model: whose hands are shown.
        q: configurations (k, n) [rad or m].
        metric: on the model's configurations; None: its kinetic energy.
    """
    chosen = KineticEnergy(model) if metric is None else metric
    inverses = [inverse_tensor(chosen, row) for row in q]
    tracks = []
    for label, hand in zip(hand_labels(model.hands), model.hands, strict=True):
        if not model.moves(hand):
            continue
        one = model if hand == model.hand else model.with_hand(hand)
        jacobians = [one.hand_jacobian(row)[:3] for row in q]
        images = np.array([j @ g @ j.T for j, g in zip(jacobians, inverses, strict=True)])
        centres = np.asarray(model.frame_pose(hand, q)[1])
        tracks.append((f"mobility of the {label}", centres, *principal_axes(images)))
    return scaled_ellipsoids(tracks, SIZE * _extent(model, q))


def scaled_ellipsoids(
    tracks: Sequence[tuple[str, Array, Array, Array]], size: float
) -> tuple[EllipsoidTrack, ...]:
    """Ellipsoids by name, centres (k, 3), directions and lengths of semi-axes, to one scale.

    The longest semi-axis of all has this size [m]; none is drawn thinner than 2% of it.
    """
    longest = max((float(lengths.max()) for *_, lengths in tracks), default=0.0)
    if not (longest > 0.0 and size > 0.0):
        return ()
    return tuple(
        EllipsoidTrack(
            name,
            centres,
            directions * (size * np.maximum(lengths / longest, _FLAT))[:, None],
        )
        for name, centres, directions, lengths in tracks
    )


def inverse_tensor(metric: Metric, q: Array) -> Array:
    """G(q)^-1 (n, n), or zero where the tensor is not positive definite."""
    tensor = np.nan_to_num(np.asarray(metric.matrix(q)))
    if not np.linalg.eigvalsh(tensor)[0] > 0.0:
        return np.zeros_like(tensor)
    return np.asarray(np.linalg.inv(tensor))


def principal_axes(images: Array) -> tuple[Array, Array]:
    """Directions as columns (k, 3, 3) and lengths (k, 3) of the semi-axes of ellipsoids.

    Those of symmetric matrices (k, 3, 3), whose eigenvalues are the squares of the lengths. The
    directions are right-handed, and ordered so that they turn as little as possible over time.
    """
    squares, directions = np.linalg.eigh(images)
    lengths = np.sqrt(np.maximum(squares, 0.0))
    orders = [list(order) for order in permutations(range(3))]
    before = np.eye(3)
    for k, now in enumerate(directions):
        products = np.array([before.T @ now[:, order] for order in orders]).diagonal(
            axis1=1, axis2=2
        )
        best = int(np.abs(products).sum(axis=1).argmax())
        before = now[:, orders[best]] * np.where(products[best] < 0.0, -1.0, 1.0)
        if np.linalg.det(before) < 0.0:
            before[:, int(np.abs(products[best]).argmin())] *= -1.0
        directions[k], lengths[k] = before, lengths[k, orders[best]]
    return directions, lengths


def _extent(model: Model, q: Array) -> float:
    """The model's reach [m], or the range of its hand where sliding joints have no limits."""
    if np.isfinite(model.reach):
        return model.reach
    return float(np.ptp(np.asarray(model.hand_pose(q)[1]), axis=0).max())
