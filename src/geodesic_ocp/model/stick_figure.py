"""Stick figures: the links of a model as line segments, for drawings."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.joints import frame_index
from geodesic_ocp.model.model import Model

_SHORTEST = 1e-6  # [m]: shorter links are joints that coincide


def stick_figure(model: Model, q: ArrayLike) -> Array:
    """End points of the links of a model in configurations q, in its base frame.

    A link goes from one joint to the next. The last link of every chain ends at its hand, or, in
    chains without one, at the frame that is farthest from the last joint. Joints that coincide,
    such as those of a shoulder, have no link between them.

    Args:
        model: a chain, or a tree such as both arms of a person.
        q: configurations (k, n) [rad or m].

    Returns:
        End points (k, links, 2, 3) [m].
    """
    data = model.pin.createData()
    frames = chain_ends(model)
    figures = []
    for row in np.atleast_2d(np.asarray(q, dtype=float)):
        pin.forwardKinematics(model.pin, data, row)
        pin.updateFramePlacements(model.pin, data)
        joints = [
            (data.oMi[model.pin.parents[index]].translation, data.oMi[index].translation)
            for index in range(1, model.pin.njoints)
            if model.pin.parents[index] > 0
        ]
        ends = [
            (data.oMi[model.pin.frames[frame].parentJoint].translation, data.oMf[frame].translation)
            for frame in frames
        ]
        figures.append(np.array([*joints, *ends]))
    links = np.array(figures)
    lengths = np.linalg.norm(links[:, :, 1] - links[:, :, 0], axis=-1)
    return np.array(links[:, lengths.max(axis=0) > _SHORTEST])


def chain_ends(model: Model) -> list[int]:
    """Indices in `pin` of the hand frames and of the farthest frame of every other chain."""
    ends = [frame_index(model.pin, hand) for hand in model.hands]
    parents = set(model.pin.parents)
    for joint in range(1, model.pin.njoints):
        attached = [
            index for index, frame in enumerate(model.pin.frames) if frame.parentJoint == joint
        ]
        if joint not in parents and not set(ends) & set(attached):
            distances = [
                np.linalg.norm(model.pin.frames[index].placement.translation) for index in attached
            ]
            ends.append(attached[int(np.argmax(distances))])
    return ends
