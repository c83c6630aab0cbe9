"""Surroundings of an actor: a moving base, obstacles, clearances and mobility ellipsoids."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_expression, evaluate
from geodesic_ocp.drawing.actors import Actor, model_actor
from geodesic_ocp.drawing.look import Surface, body_mesh, box, moved
from geodesic_ocp.drawing.scene import EllipsoidTrack, Gap, Scene, Solid
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.manifold.metrics import KineticEnergy
from geodesic_ocp.model.distances import has_symbols, nearest_points
from geodesic_ocp.model.link_geometry import turn_to
from geodesic_ocp.model.model import Model, hand_labels
from geodesic_ocp.model.primitives import HalfSpace, Obstacle


def carried(scene: Scene, rotations: Array, positions: Array) -> Scene:
    """Return a scene without points in a frame that is at these poses.

    Args:
        scene: in axes of the frame; if that moves, its paths have a point for each sample, and it
            has no obstacles.
        rotations: rotations of the frame, (k, 3, 3) or (1, 3, 3).
        positions: positions of its origin, (k, 3) or (1, 3) [m].
    """

    def shifted(points: Array) -> Array:
        return np.asarray((rotations @ points[..., None])[..., 0] + positions)

    def turned(axes: Array) -> Array:
        return np.asarray(rotations @ axes)

    places = ("points", "dot", "positions", "centres", "starts", "ends", "vertices")
    ways = dict.fromkeys(places, shifted) | dict.fromkeys(("rotations", "axes"), turned)

    def placed(item: Any) -> Any:
        given = {name: getattr(item, name, None) for name in ways}
        return replace(
            item,
            **{
                name: {link: ways[name](each) for link, each in value.items()}
                if isinstance(value, Mapping)
                else ways[name](value)
                for name, value in given.items()
                if value is not None
            },
        )

    kinds = ("actors", "trails", "solids", "frames", "ellipsoids", "gaps")
    moves: Any = {kind: tuple(map(placed, getattr(scene, kind))) for kind in kinds}
    return replace(scene, **moves)


def upright(scene: Scene, up: Array) -> Scene:
    """Get the scene, turned by the smallest angle that makes the direction `up` (3,) that of z."""
    turn = turn_to(up).T
    return (
        scene if np.array_equal(turn, np.eye(3)) else carried(scene, turn[None], np.zeros((1, 3)))
    )


MOST = 8  # gaps in a scene; with more, none could be read
_NUMBER = re.compile(r" \(\d+\)$")  # at the end of a name that occurs more than once


def clearances(
    model: Model,
    q: Array,
    obstacles: Sequence[Obstacle] = (),
    *,
    links: Sequence[str] | None = None,
    pairs: Sequence[tuple[str, str]] = (),
    names: Collection[str] | None = None,
    most: int = MOST,
) -> tuple[Gap, ...]:
    """Return nearest points and distances between bodies over time, in the model's base frame.

    Of many, the ones that come closest are kept, in the order of the constraints: first of those
    whose names differ in a number only, such as both ends of a capsule above a table, then of all.

    Args:
        model: model with collision bodies; without any, there are no clearances.
        q: configurations (k, n) [rad or m].
        obstacles, links, pairs: see `signed_distances`; obstacles with symbols are left out.
        names: names of those that are wanted, as in the constraints; None, or if there are none of
            these names: all.
        most: largest number of gaps.
    """
    if not model.bodies:
        return ()
    known = [obstacle for obstacle in obstacles if not has_symbols(obstacle)]
    found = nearest_points(model, q, known, links=links, pairs=pairs)
    wanted = {name: found[name] for name in found if names is None or name in names} or found
    closest: dict[str, str] = {}
    if len(wanted) > most:
        for name in sorted(wanted, key=lambda name: float(wanted[name].distances.min())):
            closest.setdefault(_NUMBER.sub("", name), name)
    kept = list(closest.values())[:most] or list(wanted)
    return tuple(
        Gap(name, each.starts, each.ends, each.distances)
        for name, each in wanted.items()
        if name in kept
    )


SIZE = 0.15  # largest semi-axis as drawn, as a fraction of the reach
_FLAT = 0.02  # smallest semi-axis as drawn, as a fraction of the largest
_LONGER = 3.0  # than most: drawn shorter than to scale
_MOST = 1200  # samples at which they are computed: 20 Hz for a minute


def mobility_ellipsoids(
    model: Model, q: Array, metric: Metric | None = None
) -> tuple[EllipsoidTrack, ...]:
    """Return, around every hand, the velocities that it can have at unit length in the metric.

    They are the image J v of the unit ball v' G v <= 1 by the translational Jacobian J of the hand:
    the ellipsoid of J G^-1 J', long in directions in which little energy moves the hand fast. For
    the kinetic energy this is the generalized inertia ellipsoid of Asada, "A Geometrical
    Representation of Manipulator Dynamics and Its Application to Arm Design" (1983). All are drawn
    to the same scale, the longest semi-axis with 0.15 of the model's reach; directions in which the
    hand cannot move, or there is no metric, are drawn thin. Where one is more than three times as
    long as the median, as it is where the metric is nearly singular, it is cut at that length, and
    the others keep their size. Of more than 1200 configurations, J G^-1 J' is computed in 1200, and
    linear between them.

    Args:
        model: model whose hands are shown.
        q: configurations (k, n) [rad or m].
        metric: on the model's configurations; None: its kinetic energy.
    """
    chosen = KineticEnergy(model) if metric is None else metric
    at = np.unique(np.linspace(0, len(q) - 1, min(len(q), _MOST)).round().astype(int))
    inverses = inverse_tensors(chosen, q[at])
    x = ca.SX.sym("q", model.dof)
    tracks = []
    for label, hand in zip(hand_labels(model.hands), model.hands, strict=True):
        if not model.moves(hand):
            continue
        one = model if hand == model.hand else model.with_hand(hand)
        jacobians = _values(x, one.hand_jacobian(x)[:3, :], q[at])
        images = jacobians @ inverses @ jacobians.transpose(0, 2, 1)
        columns = [np.interp(np.arange(len(q)), at, each) for each in images.reshape(-1, 9).T]
        centres = np.asarray(model.frame_pose(hand, q)[1])
        every = np.column_stack(columns).reshape(-1, 3, 3)
        tracks.append((f"mobility of the {label}", centres, every))
    return scaled_ellipsoids(tracks, SIZE * _extent(model, q))


def scaled_ellipsoids(
    tracks: Sequence[tuple[str, Array, Array]], size: float
) -> tuple[EllipsoidTrack, ...]:
    """Return ellipsoids by name, centres (k, 3) and matrices (k, 3, 3), to one scale.

    The eigenvalues of the matrices, which are symmetric, are the squares of the semi-axes. The
    longest semi-axis of all has this size [m], or all of three times the median (see
    `longest_drawn`); none is drawn thinner than 2% of it.
    """
    squares = [np.linalg.eigvalsh(images)[:, -1] for *_, images in tracks]
    longest = longest_drawn(np.concatenate(squares)) if squares else 0.0
    if not (longest > 0.0 and size > 0.0):
        return ()
    return tuple(
        EllipsoidTrack(name, centres, size * _roots(images / longest**2, _FLAT))
        for name, centres, images in tracks
    )


def longest_drawn(squares: Array) -> float:
    """Return the semi-axis that is drawn longest, of those with these squares (k,), zero if there
    is none.

    Usually the longest one, but at most three times the median, so that a nearly singular sample
    does not make all others small.
    """
    lengths = np.sqrt(squares[squares > 0.0])
    return float(min(lengths.max(), _LONGER * np.median(lengths))) if len(lengths) else 0.0


def inverse_tensors(metric: Metric, q: Array) -> Array:
    """Return g(q)^-1 (k, n, n) at q (k, n), or zero where the tensor is not positive definite."""
    x = ca.SX.sym("q", metric.dim)
    tensor = as_expression(f"{type(metric).__name__}.matrix(q)", metric.matrix(x))
    tensors = np.nan_to_num(_values(x, tensor, q))
    regular = np.linalg.eigvalsh(tensors)[:, 0] > 0.0
    inverses = np.zeros_like(tensors)
    inverses[regular] = np.linalg.inv(tensors[regular])
    return inverses


def _values(x: ca.SX, expression: ca.SX, q: Array) -> Array:
    """Return values (k, a, b) of a matrix (a, b) in x at the rows of q (k, n)."""
    matrix = ca.densify(expression)
    function = ca.Function("matrices", [x], [matrix], {"cse": True})
    found = np.asarray(evaluate(function.map(len(q)), q.T))
    return found.reshape(matrix.shape[0], len(q), matrix.shape[1]).transpose(1, 0, 2)


def _roots(images: Array, flat: float) -> Array:
    """Return symmetric square roots (k, 3, 3), which map the unit ball onto the ellipsoids.

    Their eigenvalues, which are the semi-axes, are kept between `flat` and 1. Unlike semi-axes in
    columns, they change continuously also where two semi-axes are equally long.
    """
    squares, directions = np.linalg.eigh(images)
    lengths = np.clip(np.sqrt(np.maximum(squares, 0.0)), flat, 1.0)
    return np.asarray((directions * lengths[:, None]) @ directions.transpose(0, 2, 1))


def _extent(model: Model, q: Array) -> float:
    """Get the model's reach [m], or the range of its hand where sliding joints have no limits."""
    if np.isfinite(model.reach):
        return model.reach
    return float(np.ptp(np.asarray(model.hand_pose(q)[1]), axis=0).max())


COLLISION_BODIES = "collision bodies"
# of the piece of a half-space, relative to the size of the scene
_THICKNESS = 0.01
_MARGIN = 0.15
_CORNERS = np.array(np.meshgrid((0.0, 1.0), (0.0, 1.0), (0.0, 1.0))).reshape(3, -1).T


def obstacle_solids(obstacles: Sequence[Obstacle], low: Array, high: Array) -> tuple[Solid, ...]:
    """Return the obstacles that do not move; those with symbols in place of numbers are left out.

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
            mesh = body_mesh(obstacle)
            found.append(Solid(name, mesh.vertices, mesh.triangles))
    every = np.concatenate([[low, high], *(solid.vertices for solid in found)])
    ends = every.min(axis=0), every.max(axis=0)
    found += [Solid(name, *_slab(plane, *ends), unbounded=True) for name, plane in planes]
    return tuple(found)


def carried_obstacles(model: Model, q: Array, obstacles: Sequence[Obstacle]) -> tuple[Actor, ...]:
    """Return the obstacles that links of the model carry, which move with them, if there are any.

    Args:
        model: model that moves.
        q: configurations (k, n) [rad or m].
        obstacles: those without a link, or with symbols, are left out.
    """
    bodies = (each for each in obstacles if not isinstance(each, HalfSpace))
    meshes = tuple(body_mesh(each) for each in bodies if each.link and not has_symbols(each))
    shown = model_actor(model, q, name="carried obstacles", shown=meshes, layer="obstacles")
    return (shown,) if meshes else ()


def collision_bodies(
    model: Model, q: Array, links: Collection[str] | None = None
) -> tuple[Actor, ...]:
    """Return the capsules and balls around the links, as an overlay, if there are any.

    Args:
        q: configurations (k, n) [rad or m].
        links: links whose bodies are shown; None: all.
    """
    meshes = tuple(body_mesh(each) for each in model.bodies if links is None or each.link in links)
    look: Any = {"name": COLLISION_BODIES, "translucent": True, "layer": COLLISION_BODIES}
    return (model_actor(model, q, shown=meshes, **look),) if meshes else ()


def _slab(space: HalfSpace, low: Array, high: Array) -> Surface:
    """Get a thin plate behind the plane of a half-space, below or beside the box of the scene."""
    point = np.array(space.point)
    turn = turn_to(np.array(space.normal))
    corners = (low + _CORNERS * (high - low) - point) @ turn
    size = float(np.max(high - low))
    least = corners.min(axis=0) - _MARGIN * size
    most = corners.max(axis=0) + _MARGIN * size
    least[2] = -_THICKNESS * size
    most[2] = 0.0
    return moved(box((most - least) / 2.0), turn, point + turn @ (least + most) / 2.0)
