"""The collision geometry of links as shapes of coal, and enclosed in capsules."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.joints import frame_index, motion_subspace
from geodesic_ocp.model.link_geometry import (
    LinkGeometry,
    enclosing_body,
    points_of,
    shape_of,
    triangles_of,
)
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Capsule, as_capsule

_FLAT = 1e-4  # relative to the size of a mesh: rounding of its vertices

Pose = tuple[Array, Array]  # rotation (3, 3), position (3,) [m]


@dataclass(frozen=True, eq=False)
class LinkSolid:
    """The collision geometry of a link, in the frame of the joint that carries it.

    Attributes:
        link: name of its frame.
        joint: index of the joint in `Model.pin`; 0 if the link does not move.
        parent: the nearest link before it that has geometry; "" if there is none or it is unknown.
        parent_joint: index of the joint before `joint`; -1 if the link does not move.
        shapes: shapes of coal, with their placements (pin.SE3).
        at_joint: placement of the link's frame (pin.SE3).
    """

    link: str
    joint: int
    parent: str
    parent_joint: int
    shapes: tuple[tuple[Any, Any], ...] = field(repr=False)
    at_joint: Any = field(repr=False)

    @cached_property
    def capsules(self) -> tuple[Capsule, ...]:
        """Capsules that contain the shapes, one for each: the bodies of `Model.bodies`."""
        into_link = self.at_joint.inverse()
        found = []
        for shape, at in self.shapes:
            body = as_capsule(enclosing_body(shape, into_link * at, self.link))
            start, end = (tuple(self.at_joint.act(np.array(at))) for at in (body.start, body.end))
            found.append(Capsule(start, end, body.radius, None, self.link))
        return tuple(found)

    @cached_property
    def fast_shapes(self) -> tuple[tuple[Any, Any], ...]:
        """The shapes with meshes that are convex as convex bodies, whose distances take less."""
        return tuple((_convex_if_it_is(shape), placement) for shape, placement in self.shapes)

    @cached_property
    def extent(self) -> float:
        """Largest distance [m] of its points from the origin of the joint."""
        return max(
            float(np.linalg.norm(placement.translation)) + _radius(shape)
            for shape, placement in self.shapes
        )

    def least_distance(self, point: Array) -> float:
        """Return a lower bound of its distance [m] from a point in the frame of the joint."""
        return min(
            float(np.linalg.norm(placement.translation - point)) - _radius(shape)
            for shape, placement in self.shapes
        )


def link_solids(model: Model) -> tuple[LinkSolid, ...]:
    """Return the collision geometry of all links of a model; empty if it has none.

    Raises:
        ValueError: the geometry in the file of the model cannot be read, or is of an unknown type.
    """
    of_file = model.shapes if isinstance(model.shapes, LinkGeometry) else None
    found = map(shape_of, model.bodies) if of_file is None else of_file.collision()
    shapes: dict[str, list[tuple[Any, pin.SE3]]] = {}
    for shape, at_link, link in found:
        shapes.setdefault(link, []).append((shape, at_link))
    solids = []
    for link, parts in shapes.items():
        if not model.pin.existFrame(link):
            continue
        frame = model.pin.frames[frame_index(model.pin, link)]
        placed = tuple((shape, frame.placement * at_link) for shape, at_link in parts)
        joint = int(frame.parentJoint)
        before = int(model.pin.parents[joint]) if joint > 0 else -1
        parent = _parent(of_file.pin, link, shapes) if of_file else ""
        solids.append(LinkSolid(link, joint, parent, before, placed, frame.placement.copy()))
    return tuple(solids)


def reach_bound(model: Model, solids: Sequence[LinkSolid]) -> tuple[Array, float]:
    """Return centre (3,) and radius [m] of a ball in the base frame that moving links never leave.

    The radius is the length of the chain of joints with the last link's extent.
    """
    whole = model.pin
    lower = model.lower
    upper = model.upper
    centre = np.array(whole.jointPlacements[1].translation)
    radius = 0.0
    for solid in solids:
        length = solid.extent
        for joint in list(whole.supports[solid.joint])[1:]:
            start = centre if whole.parents[joint] == 0 else np.zeros(3)
            length += float(np.linalg.norm(whole.jointPlacements[joint].translation - start))
            linear = np.linalg.norm(motion_subspace(whole, joint)[:3])
            if linear > 0.0:  # prismatic
                column = whole.joints[joint].idx_v
                length += float(linear * max(abs(lower[column]), abs(upper[column])))
        radius = max(radius, length)
    return centre, radius


def _parent(model: pin.Model, link: str, known: Container[str]) -> str:
    """Return the nearest frame before a link that is known; "" if there is none."""
    index = frame_index(model, link)
    while (index := int(model.frames[index].parentFrame)) > 0:
        if (name := str(model.frames[index].name)) in known:
            return name
    return ""


def _convex_if_it_is(shape: Any) -> Any:
    """Return the convex body of a closed mesh no vertex of which lies in front of a triangle."""
    triangles = triangles_of(shape)
    points = points_of(shape)
    if triangles is None or points is None or len(triangles) != 2 * len(points) - 4:  # Euler
        return shape
    first, second, third = (points[triangles[:, column]] for column in range(3))
    normals = np.cross(second - first, third - first)
    heights = normals @ points.T - np.sum(normals * first, axis=1)[:, None]
    size = np.linalg.norm(normals, axis=1) * np.ptp(points, axis=0).max()
    if np.any(heights.max(axis=1) > _FLAT * size):
        return shape
    shape.buildConvexRepresentation(False)
    return shape.convex


def _radius(shape: Any) -> float:
    """Return radius [m] of a ball about the shape's origin that contains it."""
    if type(shape).__name__ in ("Capsule", "Sphere"):
        return float(shape.radius + getattr(shape, "halfLength", 0.0))
    points = points_of(shape)
    return np.inf if points is None else float(np.linalg.norm(points, axis=1).max())


def joint_poses(model: Model, q: Array) -> tuple[Array, Array]:
    """Get rotations (k, j, 3, 3) and positions (k, j, 3) [m] of the joints of `pin` at q (k, n)."""
    data = model.pin.createData()
    rotations = np.empty((len(q), model.pin.njoints, 3, 3))
    positions = np.empty((len(q), model.pin.njoints, 3))
    for k, row in enumerate(q):
        pin.forwardKinematics(model.pin, data, row)
        for index, placement in enumerate(data.oMi):
            rotations[k, index] = placement.rotation
            positions[k, index] = placement.translation
    return rotations, positions


def exact_distance(one: LinkSolid, pose: Pose, other: LinkSolid, other_pose: Pose) -> float:
    """Return distance [m] between two links whose joints have these poses; 0 if they touch or
    overlap.
    """
    request = pin.coal.DistanceRequest()
    request.enable_signed_distance = False
    least = np.inf
    for first, second in product(_placed(one, pose), _placed(other, other_pose)):
        found = pin.coal.distance(*first, *second, request, pin.coal.DistanceResult())
        least = min(least, max(0.0, float(found)))
        if least == 0.0:
            break
    return least


def is_closer(
    one: LinkSolid, pose: Pose, other: LinkSolid, other_pose: Pose, margin: float = 0.0
) -> bool:
    """Return whether two links, at these poses of their joints, are closer than a margin."""
    request = pin.coal.CollisionRequest()
    request.security_margin = margin
    for first, second in product(_placed(one, pose), _placed(other, other_pose)):
        result = pin.coal.CollisionResult()
        pin.coal.collide(*first, *second, request, result)
        if result.isCollision():
            return True
    return False


def _placed(solid: LinkSolid, pose: Pose) -> list[tuple[Any, Any]]:
    rotation, position = pose
    placed = []
    for shape, at in solid.fast_shapes:
        turn = rotation @ at.rotation
        shift = rotation @ at.translation + position
        placed.append((shape, pin.coal.Transform3s(turn, shift)))
    return placed
