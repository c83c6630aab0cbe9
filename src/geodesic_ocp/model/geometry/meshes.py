"""Meshes of a model's links for pictures: of its file's visual geometry, or of its capsules."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.geometry.link_geometry import Shapes
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Body, Capsule, as_capsule

Indices: TypeAlias = NDArray[np.int64]
Colour: TypeAlias = tuple[float, float, float]
Surface: TypeAlias = tuple[Array, Indices]  # vertices and triangles

TRIANGLES = 40000  # of a model; a page with four robots then stays below a few MB
_GREY: Colour = (0.62, 0.65, 0.70)
_TURNS = 32  # sides of what is round
_WELD = 1e-5  # share of a mesh's size
_FINEST = 2e-3  # width of cells, as a share of the mesh's size
_STILL = 3.0  # cells of links that stand still, as wide as this many of those that move


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles that are fixed to a link.

    Attributes:
        link: name of its frame.
        vertices: (k, 3) [m], in the axes of the link's frame.
        triangles: (m, 3), numbers of vertices, counter-clockwise as seen from outside.
        colour: red, green and blue, 0 to 1.
    """

    link: str
    vertices: Array
    triangles: Indices
    colour: Colour


def meshes(model: Model) -> tuple[Mesh, ...]:
    """Triangles of the links of a model, about 40000 in all, for pictures and not for distances.

    They are of the visual geometry of the URDF or MJCF file from which the model was loaded; where
    there is none, or some of it cannot be read, of the model's capsules and balls. A model with
    neither has none. The same model gives the same triangles.

    Vertices that are one are welded. Too many triangles are thinned out by clustering (Rossignac
    and Borrel, 1993): vertices within a cell of a grid that face the same octant become one, their
    mean, and triangles go that are left without area. Cells of a mesh are as wide as the root of
    its size, and three times wider where the link stands still.
    """
    found = [mesh for mesh in _drawn(model) if model.pin.existFrame(mesh.link)]
    return tuple(_thinned(found, [model.moves(mesh.link) for mesh in found]))


def _drawn(model: Model) -> list[Mesh]:
    if isinstance(model.shapes, Shapes):
        try:
            drawn = list(_visual(model.shapes))
        except Exception:  # a mesh is missing, or of a kind that nobody reads: Pinocchio's own
            drawn = []
        if drawn:
            return drawn
    try:
        bodies = model.bodies
    except ValueError:  # its collision geometry cannot be read either
        return []
    return [_of_body(body) for body in bodies if body.link is not None]


def _visual(shapes: Shapes) -> Iterator[Mesh]:
    geometry, capsules = shapes.visual()
    for shape in geometry.geometryObjects:
        kind = type(shape.geometry).__name__
        if kind in ("Halfspace", "Plane"):  # of a floor, which no link is
            continue
        frame = shapes.pin.frames[shape.parentFrame]
        at_link = frame.placement.actInv(shape.placement)
        points, triangles = _surface(shape.geometry, kind)
        if np.prod(shape.meshScale) < 0.0:  # a mirror turns the inside out
            triangles = triangles[:, ::-1]
        red, green, blue = np.clip(np.asarray(shape.meshColor, dtype=float)[:3], 0.0, 1.0).tolist()
        placed = points @ at_link.rotation.T + at_link.translation
        yield Mesh(str(frame.name), placed, triangles, (red, green, blue))
    yield from map(_of_body, capsules)


def _surface(shape: Any, kind: str) -> Surface:
    """Of a geometry in its own axes; a mesh's vertices are already to its scale."""
    if kind == "Box":
        return _hull(_corners() * np.array(shape.halfSide))
    if kind in ("Sphere", "Ellipsoid"):
        points, triangles = _round(1.0, 0.0)
        return points * np.array(shape.radius if kind == "Sphere" else shape.radii), triangles
    if kind == "Capsule":
        return _round(float(shape.radius), float(shape.halfLength))
    if kind in ("Cylinder", "Cone"):
        radius, half = float(shape.radius), float(shape.halfLength)
        rims = [(0.0, -half), (radius, -half), (radius, half), (0.0, half)]
        return _turned(np.array(rims if kind == "Cylinder" else [*rims[:2], rims[3]]))
    points = np.array(shape.vertices() if callable(shape.vertices) else shape.vertices, dtype=float)
    if not hasattr(shape, "tri_indices"):  # one that is convex
        return _hull(points)
    corners = (shape.tri_indices(index) for index in range(shape.num_tris))
    triangles = np.array([(each[0], each[1], each[2]) for each in corners], dtype=np.int64)
    return points, triangles.reshape(-1, 3)


def _of_body(body: Body) -> Mesh:
    capsule: Capsule = as_capsule(body)
    start, end = np.array(capsule.start), np.array(capsule.end)
    length = float(np.linalg.norm(end - start))
    turn = np.eye(3)
    if length > 0.0:
        turn = np.array(pin.Quaternion.FromTwoVectors(turn[2], (end - start) / length).matrix())
    points, triangles = _round(capsule.radius, length / 2.0)
    return Mesh(str(body.link), points @ turn.T + (start + end) / 2.0, triangles, _GREY)


def _corners() -> Array:
    return np.array(np.meshgrid((-1.0, 1.0), (-1.0, 1.0), (-1.0, 1.0))).reshape(3, -1).T


def _hull(points: Array) -> Surface:
    hull = ConvexHull(points)
    triangles = hull.simplices.astype(np.int64)
    sides = points[triangles]
    normals = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    inward = np.sum(normals * hull.equations[:, :3], axis=1) < 0.0
    triangles[inward] = triangles[inward, ::-1]
    return points, triangles


def _round(radius: float, half: float) -> Surface:
    """A ball about the origin, or a capsule along z whose segment has this half length."""
    angles = np.linspace(-np.pi / 2.0, np.pi / 2.0, _TURNS // 2 + 1)
    angles = np.insert(angles, len(angles) // 2, 0.0) if half > 0.0 else angles
    side = half * np.where(np.arange(len(angles)) < len(angles) // 2, -1.0, 1.0)
    return _turned(
        radius * np.column_stack([np.cos(angles), np.sin(angles)]) + [0.0, 1.0] * side[:, None]
    )


def _turned(profile: Array) -> Surface:
    """A profile (k, 2) of radii and heights, upwards, turned about z; its ends are on the axis."""
    angles = 2.0 * np.pi * np.arange(_TURNS) / _TURNS
    rings = [
        np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(_TURNS, height)])
        for radius, height in profile[1:-1]
    ]
    poles = [[0.0, 0.0, height] for height in profile[[0, -1], 1]]
    here = np.arange(_TURNS)
    after = (here + 1) % _TURNS
    lowest, highest = len(rings) * _TURNS + np.arange(2)
    triangles = [np.column_stack([np.full(_TURNS, lowest), after, here])]
    for ring in range(len(rings) - 1):
        a, b = here + ring * _TURNS, after + ring * _TURNS
        triangles += [
            np.column_stack([a, b, b + _TURNS]),
            np.column_stack([a, b + _TURNS, a + _TURNS]),
        ]
    top = (len(rings) - 1) * _TURNS
    triangles.append(np.column_stack([here + top, after + top, np.full(_TURNS, highest)]))
    return np.concatenate([*rings, poles]), np.concatenate(triangles).astype(np.int64)


def _thinned(found: list[Mesh], moving: list[bool], most: int = TRIANGLES) -> list[Mesh]:
    """The meshes welded, and with cells just so wide that at most `most` triangles are left."""
    welded = [_clustered(mesh, _WELD * _size(mesh)) for mesh in found]
    result, count = welded, sum(len(mesh.triangles) for mesh in welded)
    largest = max(map(_size, welded), default=0.0)
    # That fingers beside a torso stay what they are, small meshes have smaller cells.
    widths = [
        np.sqrt(_size(mesh) * largest) * (1.0 if moves else _STILL)
        for mesh, moves in zip(welded, moving, strict=True)
    ]
    share = _FINEST
    while count > most:
        cells = [share * width for width in widths]
        result = [_clustered(*each, sides=True) for each in zip(welded, cells, strict=True)]
        count = sum(len(mesh.triangles) for mesh in result)
        # On a surface there are about as many triangles as the square of cells along it.
        share *= max(1.02, min(1.5, float(np.sqrt(count / most))))
    return [mesh for mesh in result if len(mesh.triangles)]


def _size(mesh: Mesh) -> float:
    return float(np.ptp(mesh.vertices, axis=0).max()) if len(mesh.vertices) else 0.0


def _clustered(mesh: Mesh, cell: float, sides: bool = False) -> Mesh:
    """The mesh with one vertex for all within a cell [m]; triangles without area or twice go.

    With `sides` vertices also have to face the same octant: the mean of both sides of a thin wall
    would be a crumpled one.
    """
    if not cell > 0.0:
        return mesh
    places = np.floor(mesh.vertices / cell).astype(np.int64)
    places -= places.min(axis=0)
    wide = places.max(axis=0) + 1
    keys = (places[:, 0] * wide[1] + places[:, 1]) * wide[2] + places[:, 2]
    if sides:
        keys = 8 * keys + (_normals(mesh) > 0.0) @ np.array([4, 2, 1])
    _, owner, counts = np.unique(keys, return_inverse=True, return_counts=True)
    sums = [np.bincount(owner, weights=mesh.vertices[:, axis]) for axis in range(3)]
    vertices = np.column_stack(sums) / counts[:, None]
    corners = owner.reshape(-1)[mesh.triangles]
    a, b, c = corners.T
    corners = corners[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(np.sort(corners, axis=1) @ _places(len(vertices)), return_index=True)
    corners = corners[np.sort(first)]
    used, corners = np.unique(corners, return_inverse=True)
    return Mesh(mesh.link, vertices[used], corners.reshape(-1, 3).astype(np.int64), mesh.colour)


def _normals(mesh: Mesh) -> Array:
    """At the vertices, outward, each as long as the area of its triangles."""
    sides = mesh.vertices[mesh.triangles]
    areas = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    corners, many = mesh.triangles.reshape(-1), np.repeat(areas, 3, axis=0)
    count = len(mesh.vertices)
    return np.column_stack(
        [np.bincount(corners, weights=many[:, axis], minlength=count) for axis in range(3)]
    )


def _places(count: int) -> Indices:
    """Factors (3,) that make one number of three below count."""
    return np.array([count * count, count, 1], dtype=np.int64)
