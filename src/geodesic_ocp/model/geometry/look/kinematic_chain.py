"""Links without geometry, drawn from the kinematic chain: joints and the struts between them."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.geometry.look.mesh import Colour, Mesh
from geodesic_ocp.model.geometry.look.surfaces import (
    Surface,
    box,
    cylinder,
    ellipsoid,
    moved,
    strut,
    turn_to,
)
from geodesic_ocp.model.joints import frame_index, motion_subspace
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.stick_figure import chain_ends

_LINK: Colour = (0.76, 0.78, 0.81)
_JOINT: Colour = (0.38, 0.43, 0.50)
# The radius of a joint is a share of the extent, but fits between the joints of the shortest link.
_RADIUS, _THINNEST, _OF_SHORTEST = 0.035, 0.012, 0.35
# Other sizes, per radius of a joint.
_HALF_LENGTH, _BALL, _STRUT, _HAND = 1.25, 1.15, (0.62, 0.5), 0.8
_SLIDER, _RAIL = (0.95, 0.95, 1.3), 0.4
_SAME_PLACE = 1e-6  # [extent]
_NO_EXTENT = 0.25  # [m], extent of a model whose joints and frames are all at one place


def kinematic_chain(model: Model, drawn: Collection[int] = ()) -> Iterator[Mesh]:
    """Meshes of the links that have no geometry of their own.

    A revolute joint is a cylinder along its axis, a prismatic one a box on a rail as long as its
    limits allow; joints that coincide share a ball. Struts go from a joint to the next ones and, at
    the end of a chain, to its hand, or else to its farthest frame (as in `stick_figure`). Sizes are
    in proportion to the longest chain. The base, and what is between it and the first joints, is
    not drawn.

    Args:
        model: any; its configuration does not matter.
        drawn: indices in `pin` of the joints whose links have geometry: these links, their joints,
            and joints to which no strut leads, are left out.
    """
    struts = [each for each in _struts(model) if each[0] not in drawn]
    extent = _extent(model)
    lengths = [np.linalg.norm(end) for _, _, end in struts]
    radius = float(np.clip(min(lengths, default=extent) * _OF_SHORTEST, *_range(extent)))
    touched = {joint for start, stop, _ in struts for joint in (start, stop)}
    for joint, last, end in struts:
        surface = strut(np.zeros(3), end, (_STRUT[0] * radius, _STRUT[1] * radius))
        yield from _mesh(model, joint, surface, _LINK)
        if last == joint:  # a hand, or the end of a chain
            vertices, triangles = ellipsoid(_HAND * radius)
            yield from _mesh(model, joint, (vertices + end, triangles), _JOINT)
    for joints in _places(model, extent):
        if joints[0] not in drawn and (not drawn or not touched.isdisjoint(joints)):
            yield from _joint(model, joints, radius, extent)


def _range(extent: float) -> tuple[float, float]:
    return _THINNEST * extent, _RADIUS * extent


def _struts(model: Model) -> list[tuple[int, int, Array]]:
    """Joint at the start, joint at the end (or again the same), and end in axes of the start."""
    joints = [
        (
            int(model.pin.parents[index]),
            index,
            np.array(model.pin.jointPlacements[index].translation),
        )
        for index in range(1, model.pin.njoints)
    ]
    frames = [model.pin.frames[index] for index in chain_ends(model)]
    ends = [
        (int(frame.parentJoint), int(frame.parentJoint), np.array(frame.placement.translation))
        for frame in frames
    ]
    found = [each for each in (*joints, *ends) if each[0] > 0]
    least = _SAME_PLACE * max((float(np.linalg.norm(end)) for _, _, end in found), default=0.0)
    return [each for each in found if np.linalg.norm(each[2]) > least]


def _extent(model: Model) -> float:
    """Length [m] of the longest chain of struts, with the ranges of prismatic joints."""
    far = np.zeros(model.pin.njoints)
    for joint in range(1, model.pin.njoints):
        parent = int(model.pin.parents[joint])
        step = np.linalg.norm(model.pin.jointPlacements[joint].translation) if parent else 0.0
        low, high = _travel(model, joint)
        far[joint] = far[parent] + step + max(abs(low), abs(high))
    ends = [
        far[joint] + np.linalg.norm(end) for joint, last, end in _struts(model) if joint == last
    ]
    return float(max([*far, *ends])) or _NO_EXTENT


def _travel(model: Model, joint: int) -> tuple[float, float]:
    """Lower and upper limit [m] of a prismatic joint, 0 where there is none."""
    if _rotates(model, joint):
        return 0.0, 0.0
    index = int(model.pin.joints[joint].idx_v)
    low, high = (float(limits[index]) for limits in (model.lower, model.upper))
    return low if np.isfinite(low) else 0.0, high if np.isfinite(high) else 0.0


def _rotates(model: Model, joint: int) -> bool:
    return bool(np.any(motion_subspace(model.pin, joint)[3:]))


def _places(model: Model, extent: float) -> list[list[int]]:
    """Joints grouped by place; prismatic joints are alone, as they move apart from others."""
    places: list[list[int]] = []
    for joint in range(1, model.pin.njoints):
        parent = int(model.pin.parents[joint])
        offset = np.linalg.norm(model.pin.jointPlacements[joint].translation)
        with_parent = [place for place in places if parent in place]
        turns = _rotates(model, joint) and parent > 0 and _rotates(model, parent)
        if turns and offset <= _SAME_PLACE * extent:
            with_parent[0].append(joint)
        else:
            places.append([joint])
    return places


def _joint(model: Model, joints: list[int], radius: float, extent: float) -> Iterator[Mesh]:
    """The joints at one place."""
    first = joints[0]
    subspace = motion_subspace(model.pin, first)
    if len(joints) > 1:
        yield from _mesh(model, first, ellipsoid(_BALL * radius), _JOINT)
        return
    turn = turn_to(subspace[3:] if _rotates(model, first) else subspace[:3])
    if _rotates(model, first):
        barrel = cylinder(radius, _HALF_LENGTH * radius)
        yield from _mesh(model, first, moved(barrel, turn, np.zeros(3)), _JOINT)
        return
    slider = box(radius * np.array(_SLIDER))
    yield from _mesh(model, first, moved(slider, turn, np.zeros(3)), _JOINT)
    low, high = _travel(model, first)
    if low == high:  # no limits are known
        low, high = -0.25 * extent, 0.25 * extent
    place = model.pin.jointPlacements[first]
    half = np.array([_RAIL * radius, _RAIL * radius, (high - low) / 2.0])
    rail = moved(box(half), turn, turn[:, 2] * (low + high) / 2.0)
    rail = moved(rail, place.rotation, place.translation)
    yield from _mesh(model, int(model.pin.parents[first]), rail, _LINK)


def _mesh(model: Model, joint: int, surface: Surface, colour: Colour) -> Iterator[Mesh]:
    """A surface in axes of a joint as a mesh of a frame that the joint carries, or none."""
    frames = [
        frame
        for index, frame in enumerate(model.pin.frames)
        if frame.parentJoint == joint and frame_index(model.pin, str(frame.name)) == index
    ]
    # The link's frame, if there is one; another may have the name of the only frame of the joint.
    for frame in sorted(frames, key=lambda each: each.type != pin.FrameType.BODY)[:1]:
        inverse = frame.placement.inverse()
        yield Mesh(str(frame.name), *moved(surface, inverse.rotation, inverse.translation), colour)
