"""The visual geometry of the links in a file, as meshes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from geodesic_ocp.model.geometry.link_geometry import LinkGeometry
from geodesic_ocp.model.geometry.look.mesh import Colour, Mesh
from geodesic_ocp.model.geometry.look.surfaces import Surface, box, cylinder, ellipsoid, hull, strut
from geodesic_ocp.model.primitives import Body, as_capsule

GREY: Colour = (0.62, 0.65, 0.70)


def visual_geometry(links: LinkGeometry) -> Iterator[Mesh]:
    """Meshes of the visual geometry, not yet simplified.

    Raises:
        Exception: of any type, from Pinocchio: a mesh is missing or cannot be read.
    """
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
    yield from map(body_mesh, capsules)


def body_mesh(body: Body) -> Mesh:
    """A capsule or a ball as a mesh."""
    capsule = as_capsule(body)
    start, end = np.array(capsule.start), np.array(capsule.end)
    return Mesh(str(body.link), *strut(start, end, capsule.radius), GREY)


def _surface(shape: Any, kind: str) -> Surface:
    """Surface of a geometry in its own frame; vertices of a mesh are already scaled."""
    if kind == "Box":
        return box(shape.halfSide)
    if kind in ("Sphere", "Ellipsoid"):
        return ellipsoid(shape.radius if kind == "Sphere" else shape.radii)
    if kind == "Capsule":
        along = np.array([0.0, 0.0, float(shape.halfLength)])
        return strut(-along, along, float(shape.radius))
    if kind in ("Cylinder", "Cone"):
        top = 1.0 if kind == "Cylinder" else 0.0
        return cylinder(float(shape.radius), float(shape.halfLength), top)
    points = np.array(shape.vertices() if callable(shape.vertices) else shape.vertices, dtype=float)
    if not hasattr(shape, "tri_indices"):  # a convex hull
        return hull(points)
    corners = (shape.tri_indices(index) for index in range(shape.num_tris))
    triangles = np.array([(each[0], each[1], each[2]) for each in corners], dtype=np.int64)
    return points, triangles.reshape(-1, 3)
