"""Triangle meshes: surfaces of solids, and links of models."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.model.joints import frame_index, motion_subspace
from geodesic_ocp.model.link_geometry import GREY, LinkGeometry, points_of, triangles_of, turn_to
from geodesic_ocp.model.materials import material_parts
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Ball, Box, Capsule, as_capsule

Indices: TypeAlias = NDArray[np.int64]
Colour: TypeAlias = tuple[float, float, float]
_SAME_PLACE = 1e-6  # [size of the mesh]
# Vertices (k, 3) and triangles (m, 3), counter-clockwise seen from outside.
Surface: TypeAlias = tuple[Array, Indices]
SIDES = 32  # of the polygon in place of a circle
_LINK: Colour = (0.76, 0.78, 0.81)
_JOINT: Colour = (0.38, 0.43, 0.50)
# The radius of a joint is a share of the extent, but fits between the joints of the shortest link.
_RADIUS = 0.035
_THINNEST = 0.012
_OF_SHORTEST = 0.35
# Other sizes, per radius of a joint.
_HALF_LENGTH = 1.25
_BALL = 1.15
_STRUT = (0.62, 0.5)
_HAND = 0.8
_SLIDER = (0.95, 0.95, 1.3)
_RAIL = 0.4
_NO_EXTENT = 0.25  # [m], extent of a model whose joints and frames are all at one place


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(ShortRepr):
    """A triangle mesh that is fixed to a link.

    Attributes:
        link: name of the frame of the link.
        vertices: (k, 3) [m], in the frame of the link.
        triangles: (m, 3), indices of vertices, counter-clockwise seen from outside.
        colour: red, green and blue, from 0 to 1.
    """

    link: str
    vertices: Array
    triangles: Indices
    colour: Colour

    _shown = ("link", "triangles")


def box(half_sides: ArrayLike) -> Surface:
    """Return a box around the origin with these half lengths of its sides (3,)."""
    import trimesh

    return _of_trimesh(trimesh.creation.box(2.0 * np.asarray(half_sides, dtype=float)))


def ellipsoid(radii: ArrayLike) -> Surface:
    """Return an ellipsoid around the origin with semi-axes (3,), or a ball of this radius."""
    angles = np.linspace(-np.pi / 2.0, np.pi / 2.0, SIDES // 2 + 1)
    vertices, triangles = revolved(np.column_stack([np.cos(angles), np.sin(angles)]))
    return vertices * np.asarray(radii, dtype=float), triangles


def cylinder(radius: float, half_length: float, top: float = 1.0) -> Surface:
    """Get a cylinder along z around the origin, or a cone whose radius at the top is a multiple."""
    rim = [(1.0, -1.0), (top, 1.0)] if top > 0.0 else [(1.0, -1.0)]
    vertices, triangles = revolved([(0.0, -1.0), *rim, (0.0, 1.0)])
    return vertices * [radius, radius, half_length], triangles


def strut(start: Array, end: Array, radii: float | tuple[float, float]) -> Surface:
    """Return a capsule from start to end (3,), whose round ends may have different radii."""
    length = float(np.linalg.norm(end - start))
    first, last = (radii, radii) if isinstance(radii, (int, float)) else radii
    if length <= abs(last - first):  # one ball holds the other, or both are one
        vertices, triangles = ellipsoid(max(first, last))
        return vertices + (start if first > last else end), triangles
    # The cone touches both balls where their normals have this angle to the plane across.
    tilt = np.arcsin((first - last) / length)
    low = np.linspace(-np.pi / 2.0, tilt, SIDES // 4 + 2)
    high = np.linspace(tilt, np.pi / 2.0, SIDES // 4 + 2)
    size = max(first, last)
    radii_of = np.repeat([first, last], len(low))
    angles = np.concatenate([low, high])
    heights = radii_of * np.sin(angles) + np.repeat([0.0, length], len(low))
    vertices, triangles = revolved(np.column_stack([radii_of * np.cos(angles), heights]) / size)
    return moved((size * vertices, triangles), turn_to(end - start), start)


def revolved(profile: ArrayLike, sides: int = SIDES) -> Surface:
    """Return a profile (k, 2) of radii and increasing heights turned about z; its ends are on the
    axis.

    It is of unit size: triangles far smaller than that are lost.
    """
    import trimesh

    return _of_trimesh(trimesh.creation.revolve(np.asarray(profile, dtype=float), sections=sides))


def loft(sections: ArrayLike, caps: tuple[float, float], roundness: float = 2.0) -> Surface:
    """Return a smooth form along z through sections, with rounded ends.

    Args:
        sections: rows (k, 5) of z, increasing; centre x and y; half width along x and half depth
            along y. Between the rows they are interpolated without overshoot.
        caps: lengths of the lower and the upper end that are rounded off.
        roundness: exponent of the superellipses in place of ellipses; above 2 is squarer.
    """
    rows = np.asarray(sections, dtype=float)
    low = rows[0, 0]
    high = rows[-1, 0]
    lower, upper = (np.pi / 2.0 * np.linspace(0.0, 1.0, SIDES // 6) for _ in caps)
    middle = np.linspace(low + caps[0], high - caps[1], SIDES // 4 + 1)[1:-1]
    heights = np.concatenate(
        [low + caps[0] * (1.0 - np.cos(lower)), middle, high - caps[1] * (1.0 - np.sin(upper))]
    )
    shrunk = np.concatenate([np.sin(lower), np.ones(len(middle)), np.cos(upper)])
    levels = np.arange(len(heights)) / (len(heights) - 1.0)
    unit = np.column_stack([np.ones(len(heights)), levels])
    vertices, triangles = revolved([(0.0, 0.0), *unit[1:-1], (0.0, 1.0)], 3 * SIDES // 4)
    level = np.rint(vertices[:, 2] * (len(heights) - 1)).astype(np.int64)
    form = scipy.interpolate.PchipInterpolator(rows[:, 0], rows[:, 1:])(heights)[level]
    around = np.sign(vertices[:, :2]) * np.abs(vertices[:, :2]) ** (2.0 / roundness)
    across = form[:, :2] + around * form[:, 2:] * shrunk[level, None]
    return np.column_stack([across, heights[level]]), triangles


def hull(points: Array) -> Surface:
    """Return the convex hull of points (k, 3)."""
    import trimesh

    return _of_trimesh(trimesh.convex.convex_hull(points))


def moved(surface: Surface, rotation: Array, position: Array) -> Surface:
    """Return the surface turned by a rotation (3, 3), then shifted."""
    vertices, triangles = surface
    return vertices @ rotation.T + position, triangles


def _of_trimesh(mesh: Any) -> Surface:
    return np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.int64)


def visual_geometry(links: LinkGeometry) -> Iterator[Mesh]:
    """Yield meshes of the visual geometry, not yet simplified.

    Raises:
        Exception: of any type, from Pinocchio: a mesh is missing or cannot be read.
    """
    for shape, at_link, link in links.visual():
        points, triangles = _surface(shape.geometry)
        points, parts = material_parts(shape.meshPath, points, triangles, shape.meshScale)
        turn = -1 if np.prod(shape.meshScale) < 0.0 else 1  # a reflection reverses the orientation
        red, green, blue = np.clip(np.asarray(shape.meshColor, dtype=float)[:3], 0.0, 1.0).tolist()
        vertices = points @ at_link.rotation.T + at_link.translation
        given = red, green, blue
        for part, colour, is_texture in parts:
            if colour is None or (shape.overrideMaterial and not is_texture):
                colour = given
            elif shape.overrideMaterial:
                colour = colour[0] * red, colour[1] * green, colour[2] * blue
            yield Mesh(link, vertices, part[:, ::turn], colour)


def body_mesh(body: Capsule | Ball | Box) -> Mesh:
    """Return a capsule, a ball or a box as a mesh."""
    if isinstance(body, Box):
        surface = box(np.array(body.size) / 2.0)
        placed = moved(surface, np.array(body.rotation), np.array(body.centre))
        return Mesh(str(body.link), *placed, GREY)
    capsule = as_capsule(body)
    start = np.array(capsule.start)
    end = np.array(capsule.end)
    return Mesh(str(body.link), *strut(start, end, capsule.radius), GREY)


# Surface of a shape of coal, by the name of its class.
_SURFACES: dict[str, Callable[[Any], Surface]] = {
    "Box": lambda shape: box(shape.halfSide),
    "Sphere": lambda shape: ellipsoid(shape.radius),
    "Ellipsoid": lambda shape: ellipsoid(shape.radii),
    "Cylinder": lambda shape: cylinder(shape.radius, shape.halfLength),
    "Cone": lambda shape: cylinder(shape.radius, shape.halfLength, 0.0),
    "Capsule": lambda shape: strut(
        np.array([0.0, 0.0, -shape.halfLength]),
        np.array([0.0, 0.0, shape.halfLength]),
        float(shape.radius),
    ),
}


def _surface(shape: Any) -> Surface:
    """Return surface of a shape of coal in its own frame; vertices of a mesh are already scaled."""
    if known := _SURFACES.get(type(shape).__name__):
        return known(shape)
    points = points_of(shape)
    triangles = triangles_of(shape)
    if points is None:
        raise ValueError(f"a {type(shape).__name__} has no surface")
    return hull(points) if triangles is None else (points, triangles)


def chain_ends(model: Model) -> list[int]:
    """Return indices in `pin` of the hand frames and of the farthest frame of every other chain."""
    ends = [frame_index(model.pin, hand) for hand in model.hands]
    frames = list(model.pin.frames)
    for joint in sorted(set(range(1, model.pin.njoints)) - set(model.pin.parents)):
        attached = [index for index, frame in enumerate(frames) if frame.parentJoint == joint]
        if not set(ends) & set(attached):
            far = (np.linalg.norm(frames[index].placement.translation) for index in attached)
            ends.append(attached[int(np.argmax(list(far)))])
    return ends


def kinematic_chain(model: Model, drawn: Collection[int] = ()) -> Iterator[Mesh]:
    """Yield meshes of the links that have no geometry of their own.

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
    thin = _THINNEST * extent
    thick = _RADIUS * extent
    radius = float(np.clip(min(lengths, default=extent) * _OF_SHORTEST, thin, thick))
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


def _struts(model: Model) -> list[tuple[int, int, Array]]:
    """Return joint at the start, joint at the end (or again the same), and end in axes of the
    start.
    """
    frames = [model.pin.frames[index] for index in chain_ends(model)]
    places = [
        *zip(model.pin.parents, range(model.pin.njoints), model.pin.jointPlacements, strict=True),
        *((frame.parentJoint, frame.parentJoint, frame.placement) for frame in frames),
    ]
    found = [(int(joint), int(end), np.array(at.translation)) for joint, end, at in places if joint]
    least = _SAME_PLACE * max((float(np.linalg.norm(end)) for _, _, end in found), default=0.0)
    return [each for each in found if np.linalg.norm(each[2]) > least]


def _extent(model: Model) -> float:
    """Return length [m] of the longest chain of struts, with the ranges of prismatic joints."""
    far = np.zeros(model.pin.njoints)
    for joint in range(1, model.pin.njoints):
        parent = int(model.pin.parents[joint])
        step = np.linalg.norm(model.pin.jointPlacements[joint].translation) if parent else 0.0
        low, high = _travel(model, joint)
        far[joint] = far[parent] + step + max(abs(low), abs(high))
    struts = _struts(model)
    ends = (far[joint] + np.linalg.norm(end) for joint, last, end in struts if joint == last)
    return float(max([*far, *ends])) or _NO_EXTENT


def _travel(model: Model, joint: int) -> tuple[float, float]:
    """Return lower and upper limit [m] of a prismatic joint, 0 where there is none."""
    if _rotates(model, joint):
        return 0.0, 0.0
    limits = model.lower[joint - 1], model.upper[joint - 1]
    low, high = np.nan_to_num(limits, posinf=0.0, neginf=0.0).tolist()
    return low, high


def _rotates(model: Model, joint: int) -> bool:
    return model.units[joint - 1] == "rad"


def _places(model: Model, extent: float) -> list[list[int]]:
    """Get joints grouped by place; prismatic joints are alone, as they move apart from others."""
    places: list[list[int]] = []
    for joint in range(1, model.pin.njoints):
        parent = int(model.pin.parents[joint])
        offset = np.linalg.norm(model.pin.jointPlacements[joint].translation)
        turns = _rotates(model, joint) and parent > 0 and _rotates(model, parent)
        if turns and offset <= _SAME_PLACE * extent:
            next(place for place in places if parent in place).append(joint)
        else:
            places.append([joint])
    return places


def _joint(model: Model, joints: list[int], radius: float, extent: float) -> Iterator[Mesh]:
    """Yield the joints at one place."""
    first = joints[0]
    rotates = _rotates(model, joints[0])
    twist = motion_subspace(model.pin, first)
    turn = turn_to(twist[3:] if rotates else twist[:3])
    form = ellipsoid(_BALL * radius)
    if len(joints) == 1:
        barrel = cylinder(radius, _HALF_LENGTH * radius)
        form = moved(barrel if rotates else box(radius * np.array(_SLIDER)), turn, np.zeros(3))
    yield from _mesh(model, first, form, _JOINT)
    if rotates:
        return
    low, high = _travel(model, first)
    if low == high:  # no limits are known
        low = -0.25 * extent
        high = 0.25 * extent
    half = np.array([_RAIL * radius, _RAIL * radius, (high - low) / 2.0])
    along = moved(box(half), turn, turn[:, 2] * (low + high) / 2.0)
    place = model.pin.jointPlacements[first]
    rail = moved(along, place.rotation, place.translation)
    yield from _mesh(model, int(model.pin.parents[first]), rail, _LINK)


def _mesh(model: Model, joint: int, surface: Surface, colour: Colour) -> Iterator[Mesh]:
    """Yield a surface in axes of a joint as a mesh of a frame that the joint carries, or none."""
    frames = [
        frame
        for index, frame in enumerate(model.pin.frames)
        if frame.parentJoint == joint and frame_index(model.pin, str(frame.name)) == index
    ]
    # The link's frame, if there is one; another may have the name of the only frame of the joint.
    for frame in sorted(frames, key=lambda each: each.type.name != "BODY")[:1]:
        inverse = frame.placement.inverse()
        yield Mesh(str(frame.name), *moved(surface, inverse.rotation, inverse.translation), colour)
