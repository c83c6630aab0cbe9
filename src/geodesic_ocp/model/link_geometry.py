"""The collision and visual geometry of the links in a file, and capsules around them."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import scipy
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, real_array
from geodesic_ocp.model.primitives import Ball, Body, Capsule, Point, as_capsule

_COINCIDE = 1e-12  # [m]
_MAX_EVALUATIONS = 1500
_SUPPORTED = ("box", "cylinder", "sphere", "capsule", "mesh")
_RIM = 24  # corners of the polygon around a circle


def enclosing_capsule(points: ArrayLike, link: str | None = None, name: str = "") -> Capsule:
    """A capsule of small, not necessarily minimal, volume that contains all points (k, 3) [m].

    The volume is reduced by the Nelder-Mead simplex method from the best of six initial axes: the
    coordinate axes and the principal axes of the points.

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
    fits = [_segment_along(cloud, axis) for axis in (*np.eye(3), *principal)]
    best = min(fits, key=lambda ends: _volume(ends, cloud))
    found = scipy.optimize.minimize(
        lambda ends: _volume(ends, cloud) / size**3,
        best,
        method="Nelder-Mead",
        options={"maxfev": _MAX_EVALUATIONS, "xatol": 1e-3 * size, "fatol": 1e-5, "adaptive": True},
    )
    ends = min((best, found.x), key=lambda ends: _volume(ends, cloud))
    start, end = ends.reshape(2, 3)
    # Slightly larger, so that rounding leaves no point outside.
    radius = float(distances_to_segment(cloud, start, end).max()) + 1e-9 * size
    return tuple(start.tolist()), tuple(end.tolist()), radius


def distances_to_segment(points: Array, start: Array, end: Array) -> Array:
    """Distances (k,) of points (k, 3) to a segment."""
    along = end - start
    fraction = (points - start) @ along / max(float(along @ along), np.finfo(float).tiny)
    nearest = start + np.clip(fraction, 0.0, 1.0)[:, None] * along
    return np.asarray(np.linalg.norm(points - nearest, axis=1))


def hull_vertices(cloud: Array) -> Array:
    """The points (k, 3) at the corners of the convex hull of points."""
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
    low, high = float((height + cap).min()), float((height - cap).max())
    if low > high:
        low = high = (low + high) / 2.0
    return np.concatenate([middle + low * axis, middle + high * axis])


def _volume(ends: Array, cloud: Array) -> float:
    start, end = ends.reshape(2, 3)
    radius = float(distances_to_segment(cloud, start, end).max())
    length = float(np.linalg.norm(end - start))
    return np.pi * radius**2 * (length + 4.0 / 3.0 * radius)


@dataclass(frozen=True, eq=False)
class LinkGeometry:
    """The geometry of the links in a file; calling it reads the collision bodies.

    Attributes:
        pin: the model of the whole file.
        text: text of the file, as Pinocchio reads it.
        name: name of the file, for messages.
        folder: folder of the file; meshes are searched for in it and all its parents.
    """

    pin: pin.Model
    text: str = field(repr=False)
    name: str
    folder: Path | None

    def __call__(self) -> tuple[Body, ...]:
        """Capsules and spheres in the frames of the links.

        Raises:
            ValueError: see `collision`.
        """
        return tuple(enclosing_body(*part) for part in self.collision())

    def collision(self) -> list[tuple[Any, pin.SE3, str]]:
        """Shapes of coal, each with its placement in the frame of a link, and the link.

        Floors are left out.

        Raises:
            ValueError: a mesh is missing or cannot be read, or no capsule encloses a shape.
        """
        self._check()
        try:
            geometry = self._geometry()
        except Exception as error:
            reason = " ".join(str(error).split())
            raise ValueError(
                f"{self.name}: its collision geometry cannot be read: {reason}"
            ) from None
        parts = []
        for each in geometry.geometryObjects:
            frame = self.pin.frames[each.parentFrame]
            kind = type(each.geometry).__name__
            if kind in ("Halfspace", "Plane"):  # a floor, not a link
                continue
            if kind not in ("Sphere", "Capsule") and points_of(each.geometry) is None:
                raise ValueError(
                    f"{self.name}: the collision geometry of {frame.name!r} is a {kind}, which "
                    "cannot be enclosed in a capsule; use Model.with_bodies"
                )
            at_link = frame.placement.actInv(each.placement)
            parts.append((each.geometry, at_link, str(frame.name)))
        return parts + [shape_of(body) for body in self._capsules()]

    def visual(self) -> tuple[pin.GeometryModel, tuple[Body, ...]]:
        """Visual geometry of the links, and the capsules of a URDF, which Pinocchio cannot read.

        Raises:
            Exception: of any type, from Pinocchio: a mesh is missing or cannot be read.
        """
        return self._geometry(pin.GeometryType.VISUAL), tuple(self._capsules("visual"))

    def _check(self) -> None:
        root = ET.fromstring(self.text)
        for link, shape in _shapes_of_urdf(root):
            kinds = [child.tag for child in shape.iterfind("geometry/*")]
            if len(kinds) != 1 or kinds[0] not in _SUPPORTED:
                raise ValueError(
                    f"{self.name}: the collision geometry of {link.get('name')!r} is "
                    f"{' and '.join(kinds) or 'empty'}, not one of {', '.join(_SUPPORTED)}"
                )
        for mesh in root.iterfind("asset/mesh"):
            if "refpos" in mesh.attrib or "refquat" in mesh.attrib:
                raise ValueError(f"{self.name}: refpos and refquat of a mesh are not supported")

    def _geometry(self, kind: pin.GeometryType = pin.GeometryType.COLLISION) -> pin.GeometryModel:
        if self.text.lstrip().startswith("<mujoco"):
            with tempfile.TemporaryDirectory() as scratch:
                written = Path(scratch) / "model.xml"
                written.write_text(self.text, encoding="utf-8")
                return pin.buildGeomFromMJCF(self.pin, str(written), kind)
        folders = [] if self.folder is None else [self.folder, *self.folder.parents]
        root = ET.fromstring(self.text)
        tag = "visual" if kind == pin.GeometryType.VISUAL else "collision"
        for link, shape in _shapes_of_urdf(root, tag):
            # urdfdom does not know capsules, and would drop all shapes of the link.
            if shape.find("geometry/capsule") is not None:
                link.remove(shape)
        text = ET.tostring(root, encoding="unicode")
        package_dirs = [str(each) for each in folders]
        return pin.buildGeomFromUrdfString(self.pin, text, kind, package_dirs=package_dirs)

    def _capsules(self, tag: str = "collision") -> Iterator[Body]:
        """Capsules of a URDF: along z, centred at their origin; the length excludes the caps."""
        for link, shape in _shapes_of_urdf(ET.fromstring(self.text), tag):
            if (capsule := shape.find("geometry/capsule")) is not None:
                origin = shape.find("origin")
                values = {} if origin is None else origin.attrib
                position = np.array(values.get("xyz", "0 0 0").split(), dtype=float)
                rotation = pin.rpy.rpyToMatrix(
                    np.array(values.get("rpy", "0 0 0").split(), dtype=float)
                )
                along = rotation[:, 2] * float(capsule.get("length", "nan")) / 2.0
                ends = tuple(position - along), tuple(position + along)
                yield Capsule(*ends, float(capsule.get("radius", "nan")), link.get("name"))


def _shapes_of_urdf(
    root: ET.Element, tag: str = "collision"
) -> list[tuple[ET.Element, ET.Element]]:
    """Links of a URDF and their collision or visual shapes; empty for other formats."""
    links = root.findall("link") if root.tag == "robot" else []
    return [(link, shape) for link in links for shape in link.findall(tag)]


def enclosing_body(shape: Any, placement: pin.SE3, link: str) -> Body:
    """The ball or capsule that a shape of coal is, or a capsule around it, at its placement."""
    kind, centre = type(shape).__name__, placement.translation
    if kind == "Sphere":
        return Ball(tuple(centre), float(shape.radius), link)
    if kind == "Capsule":
        along = placement.rotation[:, 2] * shape.halfLength
        return Capsule(tuple(centre - along), tuple(centre + along), float(shape.radius), link)
    points = points_of(shape)
    assert points is not None  # as `LinkGeometry.collision` makes sure
    return enclosing_capsule(points @ placement.rotation.T + centre, link)


def shape_of(body: Body) -> tuple[Any, pin.SE3, str]:
    """A ball or capsule as a shape of coal with its placement and link."""
    capsule = as_capsule(body)
    start, end = np.array(capsule.start), np.array(capsule.end)
    length, middle = float(np.linalg.norm(end - start)), (start + end) / 2.0
    if length == 0.0:
        shape, rotation = pin.coal.Sphere(body.radius), np.eye(3)
    else:
        z = np.array([0.0, 0.0, 1.0])
        shape = pin.coal.Capsule(body.radius, length)
        rotation = pin.Quaternion.FromTwoVectors(z, (end - start) / length).matrix()
    return shape, pin.SE3(rotation, middle), str(body.link)


def points_of(shape: Any) -> Array | None:
    """Points (k, 3) whose convex hull contains a shape of coal; None for an unknown shape."""
    kind = type(shape).__name__
    if kind == "Box":
        return np.asarray(_cube((-1.0, 1.0)) * np.array(shape.halfSide))
    if kind in ("Cylinder", "Cone"):
        angles = 2.0 * np.pi * np.arange(_RIM) / _RIM
        radius, half = float(shape.radius) / np.cos(np.pi / _RIM), float(shape.halfLength)
        rim = radius * np.column_stack([np.cos(angles), np.sin(angles)])
        return np.concatenate([np.insert(rim, 2, height, axis=1) for height in (-half, half)])
    if kind == "Ellipsoid":
        directions = _cube((-1.0, 0.0, 1.0))
        ball = directions[np.any(directions != 0.0, axis=1)]
        ball /= np.linalg.norm(ball, axis=1, keepdims=True)
        inside = (
            -scipy.spatial.ConvexHull(ball).equations[:, 3].max()
        )  # distance of the closest face
        return np.asarray(ball / inside * np.array(shape.radii))
    vertices = getattr(shape, "vertices", None)
    if vertices is None:
        return None
    found = np.array(vertices() if callable(vertices) else vertices, dtype=float)
    return found if found.ndim == 2 and found.shape[1] == 3 and len(found) else None


def _cube(values: tuple[float, ...]) -> Array:
    return np.array(np.meshgrid(values, values, values)).reshape(3, -1).T
