"""Axes of the joints between the base and the hand of a model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.joints import motion_subspace
from geodesic_ocp.model.model import Model

_VERTICAL = 0.9  # cosine of the angle between a lift and the vertical


class JointAxes(NamedTuple):
    """Axes of k joints in one configuration, in the base frame.

    Attributes:
        names: names of the joints.
        coordinates: their indices in the configuration.
        origins: origins of the joints (k, 3) [m].
        directions: unit vectors (k, 3) along the axes.
        rotates: whether they are revolute (k,).
    """

    names: tuple[str, ...]
    coordinates: tuple[int, ...]
    origins: Array
    directions: Array
    rotates: tuple[bool, ...]


def joint_axes(model: Model, q: ArrayLike) -> JointAxes:
    """Return axes of the joints that move the hand, from the base to the hand, at q (n,)."""
    data = model.pin.createData()
    pin.forwardKinematics(model.pin, data, np.asarray(q, dtype=float))
    chain = list(model.pin.supports[model.joint_of(model.hand)])[1:]
    rotates = []
    directions = []
    for index in chain:
        twist = motion_subspace(model.pin, index)
        rotates.append(bool(np.any(twist[3:])))
        axis = twist[3:] if rotates[-1] else twist[:3]
        directions.append(data.oMi[index].rotation @ axis / np.linalg.norm(axis))
    return JointAxes(
        tuple(str(model.pin.names[index]) for index in chain),
        tuple(int(model.pin.joints[index].idx_v) for index in chain),
        np.array([data.oMi[index].translation for index in chain]),
        np.array(directions),
        tuple(rotates),
    )


def upward(model: Model) -> Array:
    """Return the direction (3,) against gravity in the base frame; z if there is no gravity."""
    gravity = np.array(model.pin.gravity.linear, dtype=float)
    size = float(np.linalg.norm(gravity))
    return -gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0])


def upright(model: Model) -> Array:
    """Return the configuration (n,) of a robot that stands upright: zero, or the limit nearest to
    it; lifts of a body with several hands are raised, as those of its arms alone are.
    """
    q = np.clip(np.zeros(model.dof), model.lower, model.upper)
    if not model.shared_joints:
        return q
    axes = joint_axes(model, q)
    ends = (model.lower, model.upper)
    for name, number, direction in zip(axes.names, axes.coordinates, axes.directions, strict=True):
        rises = float(direction @ upward(model))
        if name in model.shared_joints and model.units[number] == "m" and abs(rises) > _VERTICAL:
            end = float(ends[rises > 0.0][number])
            q[number] = end if np.isfinite(end) else q[number]
    return q
