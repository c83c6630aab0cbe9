"""Bodies without a look of their own: obstacles, objects that a robot carries, collision bodies."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.distances import has_symbols
from geodesic_ocp.model.look import Indices, Mesh
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Body, HalfSpace, Obstacle, as_capsule
from geodesic_ocp.scenes.actor import Actor, model_actor
from geodesic_ocp.scenes.markings import Solid

COLLISION_BODIES = "collision bodies"
_GREY = (0.62, 0.65, 0.70)
_SIDES = 32  # of a polygon in place of a circle
_ROUND, _FINE = 3, 4  # subdivisions of an icosahedron in place of a sphere, of many and of few
_FEW = 4
_THICKNESS, _MARGIN = 0.01, 0.15  # of the piece of a half-space, relative to the size of the scene
_CORNERS = np.array(np.meshgrid((0.0, 1.0), (0.0, 1.0), (0.0, 1.0))).reshape(3, -1).T


def obstacle_solids(obstacles: Sequence[Obstacle], low: Array, high: Array) -> tuple[Solid, ...]:
    """The obstacles that do not move; those with symbols in place of numbers are left out.

    Args:
        obstacles: in the base frame of the scene.
        low, high: corners (3,) [m] of the scene; the piece of a half-space that is shown covers
            it, and all other obstacles.
    """
    found: list[Solid] = []
    planes: list[tuple[str, HalfSpace]] = []
    for number, obstacle in enumerate(obstacles):
        name = obstacle.name or f"obstacle {number}"
        if has_symbols(obstacle):
            continue
        if isinstance(obstacle, HalfSpace):
            planes.append((name, obstacle))
        elif obstacle.link is None:
            fine = len(obstacles) <= _FEW
            found.append(Solid(name, *_surface(obstacle, _FINE if fine else _ROUND)))
    every = np.concatenate([[low, high], *(solid.vertices for solid in found)])
    box = every.min(axis=0), every.max(axis=0)
    found += [Solid(name, *_slab(plane, *box), unbounded=True) for name, plane in planes]
    return tuple(found)


def carried_obstacles(model: Model, q: Array, obstacles: Sequence[Obstacle]) -> Actor | None:
    """The obstacles that a link of the model carries, which move with it; None if there are none.

    Args:
        model: that moves.
        q: configurations (k, n) [rad or m].
        obstacles: those without a link, or with symbols, are left out.
    """
    meshes = tuple(
        _mesh(each)
        for each in obstacles
        if not isinstance(each, HalfSpace) and each.link is not None and not has_symbols(each)
    )
    if not meshes:
        return None
    return model_actor(model, q, name="carried obstacles", shown=meshes, layer="obstacles")


def collision_bodies(model: Model, q: Array, links: Collection[str] | None = None) -> Actor | None:
    """The capsules and balls around the links, as an overlay; None if there are none.

    Args:
        model: with collision bodies.
        q: configurations (k, n) [rad or m].
        links: whose bodies are shown; None: all.
    """
    bodies = [body for body in model.bodies if links is None or body.link in links]
    if not bodies:
        return None
    return model_actor(
        *(model, q),
        name=COLLISION_BODIES,
        shown=tuple(map(_mesh, bodies)),
        translucent=True,
        layer=COLLISION_BODIES,
    )


def _mesh(body: Body) -> Mesh:
    return Mesh(str(body.link), *_surface(body), _GREY)


def _surface(body: Body, subdivisions: int = _ROUND) -> tuple[Array, Indices]:
    """Vertices (k, 3) [m] and triangles (m, 3) of a ball or capsule."""
    from trimesh import creation

    capsule = as_capsule(body)
    start, end = np.array(capsule.start), np.array(capsule.end)
    length = float(np.linalg.norm(end - start))
    if length == 0.0:
        return _arrays(creation.icosphere(subdivisions, capsule.radius), np.eye(3), start)
    shape = creation.capsule(length, capsule.radius, count=(_SIDES, _SIDES))
    turn = _axes_with((end - start) / length)
    return _arrays(shape, turn, (start + end) / 2.0)


def _slab(space: HalfSpace, low: Array, high: Array) -> tuple[Array, Indices]:
    """A thin plate behind the plane of a half-space, below or beside the box of the scene."""
    from trimesh import creation

    normal, point = np.array(space.normal), np.array(space.point)
    turn = _axes_with(normal)
    corners = (low + _CORNERS * (high - low) - point) @ turn
    size = float(np.max(high - low))
    least, most = corners.min(axis=0) - _MARGIN * size, corners.max(axis=0) + _MARGIN * size
    least[2], most[2] = -_THICKNESS * size, 0.0
    return _arrays(creation.box(most - least), turn, point + turn @ (least + most) / 2.0)


def _arrays(shape: Any, turn: Array, position: Array) -> tuple[Array, Indices]:
    vertices = np.asarray(shape.vertices, dtype=float) @ turn.T + position
    return vertices, np.asarray(shape.faces, dtype=np.int64)


def _axes_with(z: Array) -> Array:
    """A rotation (3, 3) whose third column is z, and whose others are along axes where z is."""
    across = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    across /= np.linalg.norm(across)
    return np.column_stack([across, np.cross(z, across), z])
