"""The bodies of a model's links as few convex parts, whose projections are quick to outline."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.look import Mesh
from geodesic_ocp.model.meshes import meshes, person_beside
from geodesic_ocp.model.model import Model

_DIRECTIONS = 400  # in which the extreme points of a part are kept
_DENSE = 0.08  # longest edge of the triangles that are divided, relative to the size of the link
_TESTED = 500  # points of the hulls whose volumes are compared
_SMALLER = 0.9  # volume of two halves, relative to the whole, for which a part is divided
_DEPTH = 3  # divisions of a part
_OVERLAP = 0.07  # of two halves, relative to their length


@dataclass(frozen=True, eq=False, repr=False)
class ConvexPart:
    """The extreme points of a convex part of a link.

    Attributes:
        link: name of the frame of the link.
        moves: whether any joint moves the link.
        points: (k, 3) [m], in the frame of the link if it moves, otherwise in the base frame.
    """

    link: str
    moves: bool
    points: Array = field(repr=False)

    def __repr__(self) -> str:
        return f"ConvexPart({self.link!r}, {len(self.points)} points)"


@lru_cache(maxsize=16)  # a figure draws the same model at many instants, and is drawn again
def convex_parts(model: Model) -> tuple[ConvexPart, ...]:
    """Convex parts that together look like the links of a model, as given by `meshes`.

    Beside one or both arms of a person, they show the rest of the person, which does not move.
    A link that is not convex is divided in the middle of its longest principal axis, and its halves
    again, as long as the hulls of the halves are clearly smaller than that of the whole.
    """
    parts = []
    for mesh in _joined(meshes(model)):
        moves = model.moves(mesh.link)
        rotation, position = np.eye(3), np.zeros(3)
        if not moves:
            rotation, position = model.frame_pose(mesh.link, np.zeros(model.dof))
        parts += _placed(mesh, moves, rotation, position)
    beside = person_beside(model)
    if beside is not None:
        for mesh in _joined(beside[0]):
            parts += _placed(mesh, False, *beside[1:])
    return tuple(parts)


def _placed(mesh: Mesh, moves: bool, rotation: Array, position: Array) -> list[ConvexPart]:
    found = _divided(mesh)
    return [ConvexPart(mesh.link, moves, points @ rotation.T + position) for points in found]


def _joined(parts: tuple[Mesh, ...]) -> list[Mesh]:
    """One mesh for each link whose meshes lie within each other or touch, as those of a robot."""
    joined: dict[str, list[Mesh]] = {}
    for part in parts:
        joined.setdefault(part.link, []).append(part)
    result = []
    for link, several in joined.items():
        if len(several) <= _DEPTH:
            result += several
            continue
        starts = np.cumsum([0, *(len(part.vertices) for part in several)])
        triangles = [
            part.triangles + start for part, start in zip(several, starts[:-1], strict=True)
        ]
        vertices = np.concatenate([part.vertices for part in several])
        result.append(Mesh(link, vertices, np.concatenate(triangles), several[0].colour))
    return result


def _divided(mesh: Mesh) -> list[Array]:
    """Extreme points of the convex parts of a mesh."""
    if not len(mesh.vertices):
        return []
    import trimesh  # takes longer to import than most figures take to draw

    whole = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    if abs(whole.volume) > _SMALLER * _volume(mesh.vertices):
        return [extreme_points(mesh.vertices)]
    longest = _DENSE * float(np.ptp(mesh.vertices, axis=0).max())
    divided: Any = trimesh.remesh.subdivide_to_size
    points, _ = divided(mesh.vertices, mesh.triangles, longest, max_iter=9)
    return [extreme_points(part) for part in _halves(np.asarray(points), _DEPTH)]


def _halves(points: Array, depth: int) -> list[Array]:
    if depth == 0 or len(points) < _TESTED // 10:
        return [points]
    centred = points - points.mean(axis=0)
    along = centred @ np.linalg.svd(centred[:: max(1, len(points) // _TESTED)])[2][0]
    middle, length = (along.max() + along.min()) / 2.0, np.ptp(along)
    sides = [
        points[along < middle + _OVERLAP * length],
        points[along > middle - _OVERLAP * length],
    ]
    if min(map(len, sides)) < 4 or sum(map(_volume, sides)) > _SMALLER * _volume(points):
        return [points]
    return [part for side in sides for part in _halves(side, depth - 1)]


def _volume(points: Array) -> float:
    """Volume of the convex hull [m^3] of about as many points as are enough; 0 if it is flat."""
    some = points[:: max(1, len(points) // _TESTED)]
    try:
        return float(scipy.spatial.ConvexHull(some).volume)
    except scipy.spatial.QhullError:
        return 0.0


def extreme_points(points: Array) -> Array:
    """The points (k, 3) that are extreme in any of many directions evenly spread on a sphere."""
    turns = np.arange(_DIRECTIONS) * np.pi * (3.0 - np.sqrt(5.0))  # a Fibonacci lattice
    heights = 1.0 - (2.0 * np.arange(_DIRECTIONS) + 1.0) / _DIRECTIONS
    radii = np.sqrt(1.0 - heights**2)
    directions = np.array([radii * np.cos(turns), radii * np.sin(turns), heights])
    return np.asarray(points[np.unique(np.argmax(points @ directions, axis=0))])
