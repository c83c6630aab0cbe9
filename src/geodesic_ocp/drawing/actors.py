"""Actors: models in motion, as figures, pages and videos draw them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.drawing.look import Indices, Mesh
from geodesic_ocp.drawing.meshes import meshes, person_beside
from geodesic_ocp.drawing.styles import Role
from geodesic_ocp.model.model import Model

_DIRECTIONS = 220  # in which extreme points are looked for
REST = "rest of the person"  # name and layer of its actor


@dataclass(frozen=True, eq=False, repr=False)
class Actor(ShortRepr):
    """A model that moves, or stands still, in a scene."""

    name: str  # name of the model, for the legend
    meshes: tuple[Mesh, ...]  # meshes of its links, each in the frame of its link
    # rotations of each link in the scene, (k, 3, 3), or (1, 3, 3) if it does not move
    rotations: Mapping[str, Array]
    positions: Mapping[str, Array]  # positions of each link in the scene, (k, 3) or (1, 3) [m]
    role: Role | None = None  # role whose colour it has; None: the colours of its meshes
    translucent: bool = False  # drawn as an overlay through which others are seen
    layer: str = ""  # name of the switch that shows it; "" if it is always shown

    _shown = ("name", "meshes")

    def links(self) -> Iterator[tuple[str, Array, Indices]]:
        """Yield name, vertices (m, 3) [m] and triangles (n, 3) of each link, in its own frame."""
        parts: dict[str, list[Mesh]] = {}
        for mesh in self.meshes:
            parts.setdefault(mesh.link, []).append(mesh)
        for link, several in parts.items():
            starts = np.cumsum([0, *(len(each.vertices) for each in several[:-1])])
            triangles = [
                each.triangles + start for each, start in zip(several, starts, strict=True)
            ]
            vertices = np.concatenate([each.vertices for each in several])
            yield link, vertices, np.concatenate(triangles)

    def placed(self, link: str, points: Array, samples: Indices | slice = slice(None)) -> Array:
        """Return points (m, 3) of a link in the scene at some samples, (k, m, 3) [m]."""
        poses = self.rotations[link], self.positions[link]
        rotations, positions = (each[samples] if len(each) > 1 else each for each in poses)
        return np.asarray(points @ rotations.transpose(0, 2, 1) + positions[:, None])


def model_actor(
    model: Model,
    q: Array,
    *,
    name: str = "",
    rotation: ArrayLike | None = None,
    position: ArrayLike = (0.0, 0.0, 0.0),
    role: Role | None = None,
    translucent: bool = False,
    layer: str = "",
    hidden: Collection[str] = (),
    shown: tuple[Mesh, ...] | None = None,
) -> Actor:
    """Return the links of a model in configurations q.

    Args:
        model: model whose links are shown.
        q: configurations (k, n) [rad or m].
        name: the model's by default.
        rotation, position: rotation and position of the model's base in the scene, (3, 3) and (3,)
            [m].
        role, translucent, layer: see `Actor`.
        hidden: links that are not drawn.
        shown: meshes; those of `meshes` by default.
    """
    turn = np.eye(3) if rotation is None else np.asarray(rotation, dtype=float)
    parts = meshes(model) if shown is None else shown
    parts = tuple(part for part in parts if part.link not in hidden)
    rotations = {}
    positions = {}
    for link in dict.fromkeys(part.link for part in parts):
        # One pose is enough for a link that does not move.
        turned, moved = model.frame_pose(link, q if model.moves(link) else q[:1])
        rotations[link] = turn @ turned
        positions[link] = moved @ turn.T + np.asarray(position, dtype=float)
    return Actor(name or model.name, parts, rotations, positions, role, translucent, layer)


def is_drawn_by(models: Sequence[Model], number: int, link: str) -> bool:
    """Return whether one of several arms of a robot draws a link: the first one that moves it, or
    the first of all.
    """
    moved = [model.moves(link) for model in models]
    return number == (moved.index(True) if any(moved) else 0)


def rest_of_person(model: Model) -> tuple[Actor, ...]:
    """Return trunk, head and, beside a single arm, the other arm, in the base frame of the model,
    at rest.

    See `person_beside`; there is none for a model that is not one or both arms of a person, or
    that has a trunk.
    """
    found = person_beside(model)
    if found is None:
        return ()
    parts, rotation, position = found
    places = dict.fromkeys(part.link for part in parts)
    turned = dict.fromkeys(places, rotation[None])
    moved = dict.fromkeys(places, position[None])
    return (Actor(REST, parts, turned, moved, layer=REST),)


def extreme_points(points: Array) -> Array:
    """Return the points (k, 3) that are extreme in any of many directions evenly spread on a
    sphere.
    """
    turns = np.arange(_DIRECTIONS) * np.pi * (3.0 - np.sqrt(5.0))  # a Fibonacci lattice
    heights = 1.0 - (2.0 * np.arange(_DIRECTIONS) + 1.0) / _DIRECTIONS
    radii = np.sqrt(1.0 - heights**2)
    directions = np.array([radii * np.cos(turns), radii * np.sin(turns), heights])
    if not len(points):
        return points
    return np.asarray(points[np.unique(np.argmax(points @ directions, axis=0))])
