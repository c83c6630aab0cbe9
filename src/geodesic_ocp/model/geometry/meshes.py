"""Triangle meshes of the links of a model, for display."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.geometry.link_geometry import LinkGeometry
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Body, Capsule, as_capsule

Indices: TypeAlias = NDArray[np.int64]
Colour: TypeAlias = tuple[float, float, float]
Surface: TypeAlias = tuple[Array, Indices]  # vertices and triangles

MAX_TRIANGLES = 40000  # per model, which keeps a page with four robots below a few MB
_GREY: Colour = (0.62, 0.65, 0.70)
_SIDES = 32  # of the polygon in place of a circle
_WELD = 1e-5  # width of cells when welding vertices, relative to the size of the mesh
_FINEST = 2e-3  # smallest width of cells when clustering, relative to the size of the mesh
_FIXED = 3.0  # relative width of the cells of links that do not move


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh that is fixed to a link.

    Attributes:
        link: name of the frame of the link.
        vertices: (k, 3) [m], in the frame of the link.
        triangles: (m, 3), indices of vertices, counter-clockwise seen from outside.
        colour: red, green and blue, from 0 to 1.
    """

    link: str
    vertices: Array = field(repr=False)
    triangles: Indices = field(repr=False)
    colour: Colour


def meshes(model: Model) -> tuple[Mesh, ...]:
    """Triangle meshes of the links of a model, with at most 40000 triangles, for display only.

    They show the visual geometry of the URDF or MJCF file from which the model was loaded; if there
    is none, or it cannot be read, the collision bodies of the model. A model with neither has no
    meshes. The result is deterministic.

    Coincident vertices are welded. If there are too many triangles, vertices are clustered
    (Rossignac and Borrel, 1993): all vertices in a cell of a grid whose normals are in the same
    octant are replaced by their mean, and degenerate triangles are removed. The width of the cells
    grows with the square root of the size of the mesh, and is tripled for links that do not move.
    """
    found = [mesh for mesh in _all_meshes(model) if model.pin.existFrame(mesh.link)]
    return tuple(_decimated(found, [model.moves(mesh.link) for mesh in found]))


def _all_meshes(model: Model) -> list[Mesh]:
    if isinstance(model.shapes, LinkGeometry):
        try:
            visual = list(_visual_meshes(model.shapes))
        except Exception:  # from Pinocchio: a mesh is missing, or of an unknown type
            visual = []
        if visual:
            return visual
    try:
        bodies = model.bodies
    except ValueError:  # the collision geometry cannot be read either
        return []
    return [_body_mesh(body) for body in bodies if body.link is not None]


def _visual_meshes(links: LinkGeometry) -> Iterator[Mesh]:
    geometry, capsules = links.visual()
    for shape in geometry.geometryObjects:
        kind = type(shape.geometry).__name__
        if kind in ("Halfspace", "Plane"):  # a floor, not a link
            continue
        frame = links.pin.frames[shape.parentFrame]
        at_link = frame.placement.actInv(shape.placement)
        points, triangles = _surface(shape.geometry, kind)
        if np.prod(shape.meshScale) < 0.0:  # a reflection reverses the orientation
            triangles = triangles[:, ::-1]
        red, green, blue = np.clip(np.asarray(shape.meshColor, dtype=float)[:3], 0.0, 1.0).tolist()
        placed = points @ at_link.rotation.T + at_link.translation
        yield Mesh(str(frame.name), placed, triangles, (red, green, blue))
    yield from map(_body_mesh, capsules)


def _surface(shape: Any, kind: str) -> Surface:
    """Surface of a geometry in its own frame; vertices of a mesh are already scaled."""
    if kind == "Box":
        return _hull(_cube_corners() * np.array(shape.halfSide))
    if kind in ("Sphere", "Ellipsoid"):
        points, triangles = _capsule_surface(1.0, 0.0)
        return points * np.array(shape.radius if kind == "Sphere" else shape.radii), triangles
    if kind == "Capsule":
        return _capsule_surface(float(shape.radius), float(shape.halfLength))
    if kind in ("Cylinder", "Cone"):
        radius, half = float(shape.radius), float(shape.halfLength)
        rims = [(0.0, -half), (radius, -half), (radius, half), (0.0, half)]
        return _surface_of_revolution(
            np.array(rims if kind == "Cylinder" else [*rims[:2], rims[3]])
        )
    points = np.array(shape.vertices() if callable(shape.vertices) else shape.vertices, dtype=float)
    if not hasattr(shape, "tri_indices"):  # a convex hull
        return _hull(points)
    corners = (shape.tri_indices(index) for index in range(shape.num_tris))
    triangles = np.array([(each[0], each[1], each[2]) for each in corners], dtype=np.int64)
    return points, triangles.reshape(-1, 3)


def _body_mesh(body: Body) -> Mesh:
    capsule: Capsule = as_capsule(body)
    start, end = np.array(capsule.start), np.array(capsule.end)
    length = float(np.linalg.norm(end - start))
    rotation = np.eye(3)
    if length > 0.0:
        z, axis = rotation[2], (end - start) / length
        rotation = np.array(pin.Quaternion.FromTwoVectors(z, axis).matrix())
    points, triangles = _capsule_surface(capsule.radius, length / 2.0)
    return Mesh(str(body.link), points @ rotation.T + (start + end) / 2.0, triangles, _GREY)


def _cube_corners() -> Array:
    return np.array(np.meshgrid((-1.0, 1.0), (-1.0, 1.0), (-1.0, 1.0))).reshape(3, -1).T


def _hull(points: Array) -> Surface:
    hull = scipy.spatial.ConvexHull(points)
    triangles = hull.simplices.astype(np.int64)
    sides = points[triangles]
    normals = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    inward = np.sum(normals * hull.equations[:, :3], axis=1) < 0.0
    triangles[inward] = triangles[inward, ::-1]
    return points, triangles


def _capsule_surface(radius: float, half: float) -> Surface:
    """A ball at the origin, or a capsule along z whose segment has this half length."""
    angles = np.linspace(-np.pi / 2.0, np.pi / 2.0, _SIDES // 2 + 1)
    angles = np.insert(angles, len(angles) // 2, 0.0) if half > 0.0 else angles
    offset = half * np.where(np.arange(len(angles)) < len(angles) // 2, -1.0, 1.0)
    profile = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    return _surface_of_revolution(profile + [0.0, 1.0] * offset[:, None])


def _surface_of_revolution(profile: Array) -> Surface:
    """Rotate a profile (k, 2) of radii and increasing heights about z; its ends are on the axis."""
    angles = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    rings = [
        np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(_SIDES, height)])
        for radius, height in profile[1:-1]
    ]
    poles = [[0.0, 0.0, height] for height in profile[[0, -1], 1]]
    here = np.arange(_SIDES)
    after = (here + 1) % _SIDES
    lowest, highest = len(rings) * _SIDES + np.arange(2)
    triangles = [np.column_stack([np.full(_SIDES, lowest), after, here])]
    for ring in range(len(rings) - 1):
        a, b = here + ring * _SIDES, after + ring * _SIDES
        triangles += [
            np.column_stack([a, b, b + _SIDES]),
            np.column_stack([a, b + _SIDES, a + _SIDES]),
        ]
    top = (len(rings) - 1) * _SIDES
    triangles.append(np.column_stack([here + top, after + top, np.full(_SIDES, highest)]))
    return np.concatenate([*rings, poles]), np.concatenate(triangles).astype(np.int64)


def _decimated(
    found: list[Mesh], moving: list[bool], max_triangles: int = MAX_TRIANGLES
) -> list[Mesh]:
    """The meshes, welded and clustered in cells that are just wide enough for `max_triangles`."""
    welded = [_clustered(mesh, _WELD * _size(mesh)) for mesh in found]
    result, count = welded, sum(len(mesh.triangles) for mesh in welded)
    largest = max(map(_size, welded), default=0.0)
    # Small meshes, such as fingers beside a torso, have smaller cells, to keep their shape.
    widths = [
        np.sqrt(_size(mesh) * largest) * (1.0 if moves else _FIXED)
        for mesh, moves in zip(welded, moving, strict=True)
    ]
    scale = _FINEST
    while count > max_triangles:
        cells = [scale * width for width in widths]
        result = [_clustered(*each, by_normal=True) for each in zip(welded, cells, strict=True)]
        count = sum(len(mesh.triangles) for mesh in result)
        # The number of triangles of a surface is about inversely proportional to scale^2.
        scale *= max(1.02, min(1.5, float(np.sqrt(count / max_triangles))))
    return [mesh for mesh in result if len(mesh.triangles)]


def _size(mesh: Mesh) -> float:
    return float(np.ptp(mesh.vertices, axis=0).max()) if len(mesh.vertices) else 0.0


def _clustered(mesh: Mesh, cell: float, by_normal: bool = False) -> Mesh:
    """The mesh with one vertex per cell [m], without degenerate or duplicate triangles.

    With `by_normal`, only vertices whose normals are in the same octant are merged; otherwise the
    two sides of a thin wall would collapse.
    """
    if not cell > 0.0:
        return mesh
    cells = np.floor(mesh.vertices / cell).astype(np.int64)
    cells -= cells.min(axis=0)
    shape = cells.max(axis=0) + 1
    keys = (cells[:, 0] * shape[1] + cells[:, 1]) * shape[2] + cells[:, 2]
    if by_normal:
        keys = 8 * keys + (_normals(mesh) > 0.0) @ np.array([4, 2, 1])
    _, owner, counts = np.unique(keys, return_inverse=True, return_counts=True)
    sums = [np.bincount(owner, weights=mesh.vertices[:, axis]) for axis in range(3)]
    vertices = np.column_stack(sums) / counts[:, None]
    corners = owner.reshape(-1)[mesh.triangles]
    a, b, c = corners.T
    corners = corners[(a != b) & (b != c) & (c != a)]
    factors = len(vertices) ** np.array([2, 1, 0], dtype=np.int64)  # one integer per triangle
    _, first = np.unique(np.sort(corners, axis=1) @ factors, return_index=True)
    corners = corners[np.sort(first)]
    used, corners = np.unique(corners, return_inverse=True)
    return Mesh(mesh.link, vertices[used], corners.reshape(-1, 3).astype(np.int64), mesh.colour)


def _normals(mesh: Mesh) -> Array:
    """Outward normals at the vertices, weighted by the areas of the adjacent triangles."""
    sides = mesh.vertices[mesh.triangles]
    areas = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    corners, weights = mesh.triangles.reshape(-1), np.repeat(areas, 3, axis=0)
    count = len(mesh.vertices)
    return np.column_stack(
        [np.bincount(corners, weights=weights[:, axis], minlength=count) for axis in range(3)]
    )
