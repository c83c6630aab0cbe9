"""The collision and visual geometry of the links in a file, and capsules around them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
import pinocchio as pin
import scipy
from numpy.typing import ArrayLike, NDArray

from geodesic_ocp.arrays import Array, real_array
from geodesic_ocp.model.materials import material_parts
from geodesic_ocp.model.primitives import Ball, Body, Capsule, Point, as_capsule

_COINCIDE = 1e-12  # [m]
_MAX_EVALUATIONS = 1500
GREY = (0.62, 0.65, 0.70)  # colour of shapes without one
_RIM = 24  # corners of the polygon around a circle


def enclosing_capsule(points: ArrayLike, link: str | None = None, name: str = "") -> Capsule:
    """Return a capsule of small, not necessarily minimal, volume that contains all points (k, 3)
    [m].

    The volume is reduced by the Nelder-Mead simplex method from the best of six initial axes: the
    coordinate axes and the principal axes of the points.

    >>> rod = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.3], [0.01, 0.0, 0.15], [-0.01, 0.0, 0.15]]
    >>> enclosing_capsule(rod).radius < 0.011
    True

    Args:
        points: (k, 3) [m].
        link: link in whose frame they are; None: a body in the base frame.
        name: name of the capsule.

    Raises:
        ValueError: there are no points, they are not finite, or they all coincide.
    """
    cloud = real_array(points)
    if cloud.ndim != 2 or cloud.shape[1] != 3 or not len(cloud) or not np.isfinite(cloud).all():
        raise ValueError(f"points must be finite, of shape (k, 3), got {cloud.shape}")
    if float(np.ptp(cloud, axis=0).max()) <= _COINCIDE:
        raise ValueError("points must not all coincide")
    start, end, radius = _fitted(hull_vertices(cloud).tobytes())
    return Capsule(start, end, radius, link, name)


@lru_cache(maxsize=4096)  # a robot is often loaded several times
def _fitted(vertices: bytes) -> tuple[Point, Point, float]:
    """End points and radius [m] of a capsule around the vertices (k, 3)."""
    cloud = np.frombuffer(vertices).reshape(-1, 3)
    size = float(np.ptp(cloud, axis=0).max())
    principal = np.linalg.svd(cloud - cloud.mean(axis=0), full_matrices=True)[2]

    columns = np.ascontiguousarray(cloud.T)
    squares = np.sum(cloud**2, axis=1)

    def volume(ends: Array) -> float:
        start = ends[:3]
        along = ends[3:] - ends[:3]
        length = float(along @ along)
        upto = along @ columns - along @ start  # a few products, as there are many evaluations
        least = np.clip(upto / max(length, np.finfo(float).tiny), 0.0, 1.0)
        apart = squares - 2.0 * (start @ columns) + start @ start
        square = float((apart + least * (least * length - 2.0 * upto)).max())
        radius = float(np.sqrt(max(square, 0.0))) / size
        return np.pi * radius**2 * (float(np.sqrt(length)) / size + 4.0 / 3.0 * radius)

    best = min((_segment_along(cloud, axis) for axis in (*np.eye(3), *principal)), key=volume)
    options = {"maxfev": _MAX_EVALUATIONS, "xatol": 1e-3 * size, "fatol": 1e-5, "adaptive": True}
    found = scipy.optimize.minimize(volume, best, method="Nelder-Mead", options=options)
    ends = min((best, found.x), key=volume)
    start, end = ends.reshape(2, 3)
    # Slightly larger, so that rounding leaves no point outside.
    radius = float(distances_to_segment(cloud, start, end).max()) + 1e-9 * size
    return tuple(start.tolist()), tuple(end.tolist()), radius


def distances_to_segment(points: Array, start: Array, end: Array) -> Array:
    """Return distances (k,) of points (k, 3) to a segment."""
    along = end - start
    fraction = (points - start) @ along / max(float(along @ along), np.finfo(float).tiny)
    nearest = start + np.clip(fraction, 0.0, 1.0)[:, None] * along
    return np.asarray(np.linalg.norm(points - nearest, axis=1))


def hull_vertices(cloud: Array) -> Array:
    """Return the points (k, 3) at the corners of the convex hull of points."""
    try:
        return np.asarray(cloud[scipy.spatial.ConvexHull(cloud).vertices])
    except scipy.spatial.QhullError:  # flat, or fewer than four points
        return cloud


def _segment_along(cloud: Array, axis: Array) -> Array:
    """End points (6,) of a segment along the axis whose round caps just contain the points."""
    middle = (cloud.max(axis=0) + cloud.min(axis=0)) / 2.0
    height = (cloud - middle) @ axis
    radial = cloud - middle - height[:, None] * axis
    radius = np.linalg.norm(radial, axis=1).max()
    cap = np.sqrt(np.maximum(radius**2 - np.sum(radial**2, axis=1), 0.0))
    low = float((height + cap).min())
    high = float((height - cap).max())
    if low > high:
        low = high = (low + high) / 2.0
    return np.concatenate([middle + low * axis, middle + high * axis])


@dataclass(frozen=True, eq=False)
class LinkGeometry:
    """The geometry of the links in a file; calling it reads the collision bodies.

    Attributes:
        pin: the model of the whole file.
        text: text of the file.
        name: name of the file, for messages.
        read: a function that reads the geometry of one of the two kinds, in any format.
        disabled: pairs of links that are not checked for collisions, each with the name of the file
            that says so.
    """

    pin: pin.Model
    text: str = field(repr=False)
    name: str
    read: Callable[[pin.GeometryType], pin.GeometryModel] = field(repr=False)
    disabled: Mapping[frozenset[str], str] = field(default_factory=dict, repr=False)

    def __call__(self) -> tuple[Body, ...]:
        """Return capsules and spheres in the frames of the links.

        Raises:
            ValueError: see `collision`.
        """
        return tuple(enclosing_body(*part) for part in self.collision())

    def collision(self) -> list[tuple[Any, pin.SE3, str]]:
        """Return shapes of coal, each with its placement in the frame of a link, and the link.

        Floors are left out.

        Raises:
            ValueError: a mesh is missing or cannot be read, or no capsule encloses a shape.
        """
        try:
            found = list(self._shapes(pin.GeometryType.COLLISION))
        except Exception as error:
            reason = " ".join(str(error).split())
            what = f"{self.name}: its collision geometry cannot be read"
            raise ValueError(f"{what}: {reason}") from None
        for each, _, link in found:
            kind = type(each.geometry).__name__
            if kind not in ("Sphere", "Capsule") and points_of(each.geometry) is None:
                raise ValueError(
                    f"{self.name}: the collision geometry of {link!r} is a {kind}, which "
                    "cannot be enclosed in a capsule; use Model.with_bodies"
                )
        return [(_with_all_parts(each), at_link, link) for each, at_link, link in found]

    def visual(self) -> Iterator[tuple[pin.GeometryObject, pin.SE3, str]]:
        """Yield visual geometry, each with its placement in the frame of a link, and the link.

        Raises:
            Exception: of any type, from Pinocchio: a mesh is missing or cannot be read.
        """
        return self._shapes(pin.GeometryType.VISUAL)

    def _shapes(self, kind: pin.GeometryType) -> Iterator[tuple[pin.GeometryObject, pin.SE3, str]]:
        for each in self.read(kind).geometryObjects:
            if type(each.geometry).__name__ not in ("Halfspace", "Plane"):  # a floor, not a link
                frame = self.pin.frames[each.parentFrame]
                yield each, frame.placement.actInv(each.placement), str(frame.name)


def enclosing_body(shape: Any, placement: pin.SE3, link: str) -> Body:
    """Get the ball or capsule that a shape of coal is, or a capsule around it, at its placement."""
    kind = type(shape).__name__
    centre = placement.translation
    if kind == "Sphere":
        return Ball(tuple(centre), float(shape.radius), link)
    if kind == "Capsule":
        along = placement.rotation[:, 2] * shape.halfLength
        return Capsule(tuple(centre - along), tuple(centre + along), float(shape.radius), link)
    points = points_of(shape)
    assert points is not None  # as `LinkGeometry.collision` makes sure
    return enclosing_capsule(points @ placement.rotation.T + centre, link)


def shape_of(body: Body) -> tuple[Any, pin.SE3, str]:
    """Return a ball or capsule as a shape of coal with its placement and link."""
    capsule = as_capsule(body)
    start = np.array(capsule.start)
    end = np.array(capsule.end)
    length = float(np.linalg.norm(end - start))
    middle = (start + end) / 2.0
    if length == 0.0:
        return pin.coal.Sphere(body.radius), pin.SE3(np.eye(3), middle), str(body.link)
    placement = pin.SE3(turn_to((end - start) / length), middle)
    return pin.coal.Capsule(body.radius, length), placement, str(body.link)


def turn_to(direction: Array) -> Array:
    """Return a rotation (3, 3) of the z axis to a direction (3,), of any length but zero."""
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), direction)
    return np.array(turn.matrix())


def points_of(shape: Any) -> Array | None:
    """Get points (k, 3) whose convex hull contains a shape of coal; None for an unknown shape."""
    kind = type(shape).__name__
    if kind == "Box":
        return np.asarray(_cube((-1.0, 1.0)) * np.array(shape.halfSide))
    if kind in ("Cylinder", "Cone"):
        angles = 2.0 * np.pi * np.arange(_RIM) / _RIM
        radius = float(shape.radius) / np.cos(np.pi / _RIM)
        half = float(shape.halfLength)
        rim = radius * np.column_stack([np.cos(angles), np.sin(angles)])
        return np.concatenate([np.insert(rim, 2, height, axis=1) for height in (-half, half)])
    if kind == "Ellipsoid":
        directions = _cube((-1.0, 0.0, 1.0))
        ball = directions[np.any(directions != 0.0, axis=1)]
        ball /= np.linalg.norm(ball, axis=1, keepdims=True)
        closest = -scipy.spatial.ConvexHull(ball).equations[:, 3].max()  # of the faces
        return np.asarray(ball / closest * np.array(shape.radii))
    vertices = getattr(shape, "vertices", None)
    if vertices is None:
        return None
    found = np.array(vertices() if callable(vertices) else vertices, dtype=float)
    return found if found.ndim == 2 and found.shape[1] == 3 and len(found) else None


def triangles_of(shape: Any) -> NDArray[np.int64] | None:
    """Get the triangles (m, 3) of a mesh of coal, indices of `points_of`; None for other shapes."""
    if not hasattr(shape, "tri_indices"):
        return None
    corners = (shape.tri_indices(index) for index in range(shape.num_tris))
    listed = [(each[0], each[1], each[2]) for each in corners]
    return np.array(listed, dtype=np.int64).reshape(-1, 3)


def _with_all_parts(given: pin.GeometryObject) -> Any:
    """Return the shape of a geometry, a mesh of several materials with the right triangles."""
    triangles = triangles_of(given.geometry)
    points = points_of(given.geometry)
    if triangles is None or points is None:
        return given.geometry
    points, parts = material_parts(given.meshPath, points, triangles, given.meshScale)
    if len(parts) < 2 or np.array_equal(right := np.concatenate([p for p, *_ in parts]), triangles):
        return given.geometry
    mesh = pin.coal.BVHModelOBBRSS()
    mesh.beginModel(len(right), len(points))
    mesh.addVertices(points)
    mesh.addTriangles(right)
    mesh.endModel()
    mesh.computeLocalAABB()
    return mesh


def _cube(values: tuple[float, ...]) -> Array:
    return np.array(np.meshgrid(values, values, values)).reshape(3, -1).T
