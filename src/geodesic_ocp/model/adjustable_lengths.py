"""Forward kinematics of a model whose lengths are symbols, and models with other lengths.

The translation from one joint to the next is multiplied by a factor for each of its components, so
that segments become longer or shorter while the axes of the joints stay as they are.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.joints import frame_index
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Ball
from geodesic_ocp.model.rigid_body import Placement, constant, joint_placements


def joint_poses(model: Model, q: ca.SX, factors: ca.SX) -> list[tuple[ca.SX, ca.SX]]:
    """Return rotation (3, 3) and position (3, 1) [m] of every joint of `pin` in the base frame.

    Args:
        model: model of n joints; index 0 of the result is its base.
        q: configuration (n, 1).
        factors: factors of the translation from the joint before (3, n + 1), column 0 without
            effect.
    """
    poses: list[Placement] = []
    for index, placement in enumerate(joint_placements(model.pin, q)):
        fixed = constant(model.pin.jointPlacements[index].translation)
        stretch = fixed * (factors[:, index] - 1)
        own = Placement(placement.rotation, placement.translation + stretch)
        poses.append(poses[model.pin.parents[index]] @ own if index else own)
    return [(pose.rotation, pose.translation) for pose in poses]


def joint_index(model: Model, name: str) -> int:
    """Return index in `pin` of the joint of that name."""
    return int(model.pin.getJointId(name))


def joint_offset(model: Model, index: int) -> Array:
    """Return translation (3,) [m] from the joint before to this one."""
    return np.array(model.pin.jointPlacements[index].translation)


def frame_place(model: Model, frame: str) -> tuple[int, Array, Array]:
    """Return joint that carries a frame, and the frame's rotation (3, 3) and position (3,) [m] on
    it.

    Raises:
        ValueError: there is no such frame.
    """
    found = model.pin.frames[frame_index(model.pin, frame)]
    placement = found.placement
    return int(found.parentJoint), np.array(placement.rotation), np.array(placement.translation)


def with_lengths(model: Model, factors: Array, bodies: Array) -> Model:
    """Return the model with other lengths, and the masses it has.

    Args:
        model: model of n joints.
        factors: factors of the translation from the joint before, (n + 1, 3), row 0 without effect.
        bodies: for every joint a factor of the size of the body that it carries (n + 1,): of its
            centre of mass, its frames and its capsules; its inertia is multiplied by the square.
            Radii are divided by the root, so that capsules keep their volume.
    """
    scaled = model.pin.copy()
    for index in range(1, scaled.njoints):
        placement = model.pin.jointPlacements[index]
        offset = placement.translation * factors[index]
        scaled.jointPlacements[index] = pin.SE3(placement.rotation, offset)
        body = model.pin.inertias[index]
        size = bodies[index]
        scaled.inertias[index] = pin.Inertia(body.mass, size * body.lever, size**2 * body.inertia)
    for frame in scaled.frames:
        place = frame.placement
        offset = bodies[frame.parentJoint] * place.translation
        frame.placement = pin.SE3(place.rotation, offset)
    shapes = []
    for body in model.bodies:
        size = bodies[model.joint_of(str(body.link))]
        keys = ("centre",) if isinstance(body, Ball) else ("start", "end")
        points: dict[str, Any] = {key: size * np.array(getattr(body, key)) for key in keys}
        shapes.append(replace(body, radius=body.radius / np.sqrt(size), **points))
    return replace(model, pin=scaled, shapes=tuple(shapes))
