"""Capsules around the collision geometry of URDF and MJCF files, one for each shape."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.bodies import Ball, Body, Capsule, enclosing_capsule

_RIM = 24  # points of a circle, a little outside of it


@dataclass(frozen=True, eq=False)
class Shapes:
    """The bodies of a file's links, which are read when it is called.

    Attributes:
        pin: the model of the whole file.
        text: of the file, as Pinocchio reads it.
        name: of the file, for messages.
        folder: where the file is; meshes are looked for in it and all folders above.
    """

    pin: pin.Model
    text: str
    name: str
    folder: Path | None

    def __call__(self) -> tuple[Body, ...]:
        """Capsules and spheres in the axes of the links' frames.

        Raises:
            ValueError: a mesh is missing or cannot be read.
        """
        try:
            geometry = self._geometry()
        except Exception as error:
            reason = " ".join(str(error).split())
            raise ValueError(
                f"{self.name}: its collision geometry cannot be read: {reason}"
            ) from None
        return tuple(_bodies(self.pin, geometry, self.name))

    def _geometry(self) -> pin.GeometryModel:
        kind = pin.GeometryType.COLLISION
        if self.text.lstrip().startswith("<mujoco"):
            with tempfile.TemporaryDirectory() as scratch:
                written = Path(scratch) / "model.xml"
                written.write_text(self.text, encoding="utf-8")
                return pin.buildGeomFromMJCF(self.pin, str(written), kind)
        folders = [] if self.folder is None else [self.folder, *self.folder.absolute().parents]
        return pin.buildGeomFromUrdfString(
            self.pin, self.text, kind, package_dirs=[str(each) for each in folders]
        )


def _bodies(model: pin.Model, geometry: pin.GeometryModel, name: str) -> Iterator[Body]:
    for shape in geometry.geometryObjects:
        frame = model.frames[shape.parentFrame]
        link = str(frame.name)
        at_link = frame.placement.actInv(shape.placement)
        kind = type(shape.geometry).__name__
        if kind == "Sphere":
            yield Ball(tuple(at_link.translation), float(shape.geometry.radius), link)
        elif kind == "Capsule":
            along = at_link.rotation[:, 2] * shape.geometry.halfLength
            ends = tuple(at_link.translation - along), tuple(at_link.translation + along)
            yield Capsule(*ends, float(shape.geometry.radius), link)
        else:
            points = _points(shape.geometry, kind)
            if points is None:
                raise ValueError(
                    f"{name}: the collision geometry of {link!r} is a {kind}, of which no capsule "
                    "is made; use Model.with_bodies"
                )
            placed = points @ at_link.rotation.T + at_link.translation
            yield enclosing_capsule(placed, link)


def _points(shape: Any, kind: str) -> Array | None:
    """Points (k, 3) whose convex hull holds the shape; None of a shape that is not known."""
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
        inside = -ConvexHull(ball).equations[:, 3].max()  # distance of the nearest face
        return np.asarray(ball / inside * np.array(shape.radii))
    vertices = getattr(shape, "vertices", None)
    if vertices is None:
        return None
    found = np.array(vertices() if callable(vertices) else vertices, dtype=float)
    return found if found.ndim == 2 and found.shape[1] == 3 and len(found) else None


def _cube(values: tuple[float, ...]) -> Array:
    return np.array(np.meshgrid(values, values, values)).reshape(3, -1).T
