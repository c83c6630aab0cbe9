"""Exact distances between the shapes of links, by coal, which comes with Pinocchio.

Pan, Chitta, Manocha, "FCL: A general purpose library for collision and proximity queries" (2012).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.geometry.link_solids import LinkSolid, Pose
from geodesic_ocp.model.joints import configuration
from geodesic_ocp.model.model import Model


def joint_poses(model: Model, q: Array) -> tuple[Array, Array]:
    """Rotations (k, j, 3, 3) and positions (k, j, 3) [m] of the joints of `pin` at q (k, n)."""
    data = model.pin.createData()
    rotations = np.empty((len(q), model.pin.njoints, 3, 3))
    positions = np.empty((len(q), model.pin.njoints, 3))
    for k, row in enumerate(q):
        pin.forwardKinematics(model.pin, data, configuration(model.pin, row))
        for index, placement in enumerate(data.oMi):
            rotations[k, index], positions[k, index] = placement.rotation, placement.translation
    return rotations, positions


def exact_distance(one: LinkSolid, pose: Pose, other: LinkSolid, other_pose: Pose) -> float:
    """Distance [m] between two links whose joints have these poses; 0 if they touch or overlap."""
    request = pin.coal.DistanceRequest()
    request.enable_signed_distance = False
    least = np.inf
    for shape, placed in _placed(one, pose):
        for second, second_placed in _placed(other, other_pose):
            result = pin.coal.DistanceResult()
            found = pin.coal.distance(shape, placed, second, second_placed, request, result)
            least = min(least, max(0.0, float(found)))
            if least == 0.0:
                return 0.0
    return least


def is_closer(
    one: LinkSolid, pose: Pose, other: LinkSolid, other_pose: Pose, margin: float = 0.0
) -> bool:
    """Whether two links whose joints have these poses are closer than a margin [m], or touch."""
    request = pin.coal.CollisionRequest()
    request.security_margin = margin
    for shape, placed in _placed(one, pose):
        for second, second_placed in _placed(other, other_pose):
            result = pin.coal.CollisionResult()
            pin.coal.collide(shape, placed, second, second_placed, request, result)
            if result.isCollision():
                return True
    return False


def _placed(solid: LinkSolid, pose: Pose) -> list[tuple[Any, Any]]:
    rotation, position = pose
    return [
        (
            shape,
            pin.coal.Transform3s(
                rotation @ placement.rotation, rotation @ placement.translation + position
            ),
        )
        for shape, placement in solid.fast_shapes
    ]
