"""Meshes of a model's links, and of the rest of a person whose arms alone are a model; fewer
triangles for them.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from weakref import WeakKeyDictionary

import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.look import Indices, Mesh, body_mesh, kinematic_chain, visual_geometry
from geodesic_ocp.drawing.person_look import mirrored, person
from geodesic_ocp.model.anthropometry import PersonArm, person_arms, person_trunks, shoulder_joint
from geodesic_ocp.model.human import human_arm, human_upper_body, stature
from geodesic_ocp.model.joints import pose_at_zero
from geodesic_ocp.model.link_geometry import LinkGeometry
from geodesic_ocp.model.model import Model

MAX_TRIANGLES = 60000  # per model, which keeps a page with four robots below a few MB
_known: WeakKeyDictionary[Model, tuple[Mesh, ...]] = WeakKeyDictionary()
_TALLEST = 3.0  # [m], [kg], of the models of people
_HEAVIEST = 1000.0  # [m], [kg], of the models of people
_WIDTHS = (0.5, 2.0)  # of the shoulders, relative to those of the table
_LEVEL = 0.2  # least distance between shoulders along one axis, over that across it
_OPPOSITE = {"right": "left", "left": "right"}


def meshes(model: Model) -> tuple[Mesh, ...]:
    """Return triangle meshes of the links of a model, for display only.

    They show the visual geometry of the URDF or MJCF file from which the model was loaded; if there
    is none, or with a warning if it cannot be read, its collision bodies. Of a person (`human_arm`,
    `human_upper_body`, also within `combine`) those are drawn as a human body in the proportions of
    the model. Moving links without either are drawn from the kinematic chain: joints along their
    axes, and struts between them. The result is deterministic, and kept as long as the model is.

    >>> from geodesic_ocp.drawing.meshes import meshes
    >>> sorted({mesh.link for mesh in meshes(go.human_arm("right"))})
    ['right forearm', 'right hand', 'right upper arm']
    """
    if model not in _known:
        # Links of other models in the file, such as a robot's second arm, are not in this one.
        found = [mesh for mesh in _geometry(model) if model.pin.existFrame(mesh.link)]
        found += kinematic_chain(model, {model.joint_of(mesh.link) for mesh in found})
        moving = [model.moves(mesh.link) for mesh in found]
        _known[model] = tuple(simplified(found, moving, MAX_TRIANGLES))
    return _known[model]


def _geometry(model: Model) -> list[Mesh]:
    if isinstance(model.shapes, LinkGeometry):
        try:
            if visual := list(visual_geometry(model.shapes)):
                return visual
        except Exception as error:  # from Pinocchio: a mesh is missing, or of an unknown type
            reason = " ".join(str(error).split())
            said = "is drawn without its visual geometry, which cannot be read"
            warnings.warn(f"{model.name} {said}: {reason}", stacklevel=2)
    try:
        bodies = model.bodies
    except ValueError:  # the collision geometry cannot be read either
        return []
    found, replaced = person(model)
    return found + [body_mesh(each) for each in bodies if each.link and each not in replaced]


def person_beside(model: Model) -> tuple[tuple[Mesh, ...], Array, Array] | None:
    """Return trunk, head and, beside a single arm, the other arm, in the base frame of the model,
    at rest.

    The body height is that of `stature`, from the lengths of upper arm and forearm; the mass is
    that of a person whose upper arm has this volume. Trunk and head are those of
    `human_upper_body`, as wide as the shoulders of both arms demand; the other arm is the hanging
    mirror image of the one that the model has.

    Args:
        model: model of `human_arm`, or a right and a left one of `combine` with shoulders side by
            side.

    Returns:
        Meshes, and the rotation (3, 3) and position (3,) [m] of their common frame in the base
        frame; None for a model that is not one or both arms of a person, or that has a trunk.
    """
    arms = person_arms(model)
    height = stature(model)
    sides = {arm.side: arm for arm in arms}
    only_arms = model.dof == 7 * len(arms) == 7 * len(sides) and not person_trunks(model)
    if not arms or not only_arms or height is None or height > _TALLEST:
        return None
    person = _whole(height, _mass(arms[0], height))
    half_width = person_trunks(person)[0].half_width
    rest = {
        side: pose_at_zero(model.pin, shoulder_joint(model, arm)) for side, arm in sides.items()
    }
    turn = rest[arms[0].side][0]
    width = 1.0
    if len(arms) == 2:
        (right_turn, right) = rest["right"]
        (left_turn, left) = rest["left"]
        apart = (right - left) @ right_turn
        width = float(apart[0]) / (2.0 * half_width)
        level = np.abs(apart[1:]).max() <= _LEVEL * np.linalg.norm(apart)
        if not (np.allclose(right_turn, left_turn) and level and _WIDTHS[0] < width < _WIDTHS[1]):
            return None
        collar = (right + left) / 2.0
    else:
        outward = 1.0 if arms[0].side == "right" else -1.0
        collar = rest[arms[0].side][1] - outward * half_width * turn[:, 0]

    own = np.eye(3), pose_at_zero(person.pin, "thorax")[1]
    drawn = {str(body.link) for arm in person_arms(person) for body in arm.bodies}
    parts = [_placed(mesh, person, own) for mesh in meshes(person) if mesh.link not in drawn]
    parts = [
        replace(part, vertices=part.vertices * [1.0 if part.link == "head" else width, 1.0, 1.0])
        for part in parts
    ]
    if len(arms) == 1:
        links = {str(body.link) for body in arms[0].bodies}
        there = [mesh for mesh in meshes(model) if mesh.link in links]
        parts += [_mirrored(_placed(each, model, (turn, collar)), arms[0].side) for each in there]
    return tuple(parts), turn, collar


@lru_cache(maxsize=8)
def _whole(height: float, mass: float) -> Model:
    """Return the person, whose meshes are kept as long as the model is."""
    return human_upper_body(height, mass)


def _mass(arm: PersonArm, height: float) -> float:
    """Return mass [kg] of a person of this height whose upper arm has the volume that the arm's
    has.
    """
    one = human_arm(arm.side, height, 1.0)
    volumes = [each.bodies[0].radius ** 2 * each.lengths[0] for each in (arm, *person_arms(one))]
    return min(float(volumes[0] / volumes[1]), _HEAVIEST)


def _placed(mesh: Mesh, model: Model, origin: tuple[Array, Array]) -> Mesh:
    """Return the mesh at q = 0 in the axes of an origin in the base frame of the model."""
    rotation, position = pose_at_zero(model.pin, mesh.link)
    points = mesh.vertices @ rotation.T + position
    return replace(mesh, vertices=(points - origin[1]) @ origin[0])


def _mirrored(mesh: Mesh, side: str) -> Mesh:
    """Return the mesh on the other side of the sagittal plane."""
    link = mesh.link.replace(side, _OPPOSITE[side]) if side in mesh.link else f"other {mesh.link}"
    return Mesh(link, *mirrored((mesh.vertices, mesh.triangles)), mesh.colour)


_SAME_PLACE = 1e-6  # [size of the mesh]
_FIXED = 0.85  # relative size of meshes that matter less, so that their errors count for less
_SHARE = 0.3  # of the vertices, those that cost least, among which a round chooses
_BORDER = 100.0  # weight of the squares on its edges, which keeps openings and seams round
_EDGE = 1e-4  # [length of an edge] counts as a distance: flat parts keep compact triangles
_TURN = 0.25  # least cosine between the normals of a triangle before and after a collapse


def simplified(found: Sequence[Mesh], matters: Sequence[bool], count: int) -> list[Mesh]:
    """Return the meshes with at most `count` triangles together, without those that are degenerate.

    Coincident vertices become one. If there are too many triangles, vertices move onto neighbours
    where the squared distance to the planes of their triangles and borders, times the area, grows
    least (quadric error metrics: Garland and Heckbert, SIGGRAPH 1997), so that flat and small parts
    get few. Meshes that do not matter, such as those of links that do not move, may change more.
    More triangles than `count` remain only where every collapse would fold a surface.
    """
    welded = [_welded(mesh) for mesh in found]
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in welded)])
    centred = [
        mesh.vertices - mesh.vertices.sum(axis=0) / max(len(mesh.vertices), 1) for mesh in welded
    ]
    triangles = np.concatenate(
        [np.zeros((0, 3), np.int64)]
        + [mesh.triangles + start for mesh, start in zip(welded, starts[:-1], strict=True)]
    )
    if len(triangles) > count:
        scales = np.repeat(np.where(matters, 1.0, _FIXED), np.diff(starts))
        triangles = _collapsed(np.concatenate(centred) * scales[:, None], triangles, count)
    owners = np.searchsorted(starts, triangles[:, 0], side="right") - 1
    result = []
    for number, mesh in enumerate(welded):
        used, corners = np.unique(triangles[owners == number], return_inverse=True)
        vertices = mesh.vertices[used - starts[number]]
        result.append(replace(mesh, vertices=vertices, triangles=corners.reshape(-1, 3)))
    return [mesh for mesh in result if len(mesh.triangles)]


def _welded(mesh: Mesh) -> Mesh:
    """Return the mesh with one vertex at each place, without triangles that are lines or twice."""
    low = mesh.vertices.min(axis=0, initial=np.inf)
    size = np.ptp(mesh.vertices, axis=0).max(initial=0.0) if len(mesh.vertices) else 0.0
    x, y, z = np.rint((mesh.vertices - low) / (_SAME_PLACE * size or 1.0)).astype(np.int64).T
    count = round(1.0 / _SAME_PLACE) + 1  # places along an axis
    _, first, owner = np.unique((x * count + y) * count + z, return_index=True, return_inverse=True)
    triangles = _proper(owner.reshape(-1)[mesh.triangles].reshape(-1, 3))
    a, b, c = np.sort(triangles, axis=1).T  # however they are turned
    _, once = np.unique((a * len(first) + b) * len(first) + c, return_index=True)
    return replace(mesh, vertices=mesh.vertices[first], triangles=triangles[np.sort(once)])


def _proper(triangles: Indices) -> Indices:
    a, b, c = triangles.T
    proper: Indices = triangles[(a != b) & (b != c) & (c != a)]
    return proper


def _collapsed(points: Array, triangles: Indices, count: int) -> Indices:
    """Return at most `count` triangles between points (k, 3), at first those of a welded surface.

    Each round moves vertices of which no two are neighbours, so that the result depends on no
    order, and triangles change by one of their vertices at a time.
    """
    number = len(points)
    quadrics = _quadrics(points, triangles)
    products = _products(points)
    barred = np.zeros(0, np.int64)  # collapses that would fold the surface
    tried = np.zeros(number, dtype=bool)  # their vertices
    while len(triangles) > count:
        low, high, uses = _edges(triangles, number)
        ends = np.concatenate([low[uses != 2], high[uses != 2]])
        at_border = np.bincount(ends, minlength=number)
        start = np.concatenate([low, high])
        stop = np.concatenate([high, low])
        around = np.tile(uses, 2)
        # Vertices of borders, and of edges of three triangles or more, move along these; where
        # such lines meet or end, they stay.
        free = (at_border[start] == 0) | ((at_border[start] == 2) & (around != 2))
        once = np.flatnonzero(tried[start])
        free[once[np.isin(start[once] * number + stop[once], barred)]] = False
        start = start[free]
        stop = stop[free]
        around = around[free]
        along = points.take(stop, axis=0) - points.take(start, axis=0)
        error = _dot(quadrics.take(start, axis=0), products.take(stop, axis=0))
        cost = np.maximum(error, 0.0) + _EDGE**2 * _dot(along, along) ** 2

        least = np.full(number, np.inf)
        np.minimum.at(least, start, cost)
        possible = least[np.isfinite(least)]
        if not len(possible):
            break
        limit = np.quantile(possible, _SHARE)
        best = np.flatnonzero((cost <= limit) & (cost == least[start]))
        best = best[np.unique(start[best], return_index=True)[1]]
        mover = start[best]
        goal = stop[best]
        onto = np.full(number, -1)
        onto[mover] = goal
        folds = _turned(points, triangles, onto)[mover]
        # Neighbours that both ends share are across triangles of the edge, and nowhere else.
        ones = np.ones(2 * len(low), np.int8)
        both = np.concatenate([low, high]), np.concatenate([high, low])
        graph = scipy.sparse.csr_array((ones, both), shape=(number, number))
        folds |= graph[mover].multiply(graph[goal]).sum(axis=1) > around[best]
        barred = np.concatenate([barred, mover[folds] * number + goal[folds]])
        tried[mover[folds]] = True

        mover = mover[~folds]
        goal = goal[~folds]
        price = cost[best[~folds]]
        order = np.lexsort((np.random.default_rng(0).permutation(len(mover)), price))
        # at random among equals, such as in a plane
        mover = mover[order]
        goal = goal[order]
        rank = np.full(number, number)
        rank[mover] = np.arange(len(mover))
        first = np.full(number, number)
        np.minimum.at(first, low, rank[high])
        np.minimum.at(first, high, rank[low])
        chosen = np.flatnonzero(rank[mover] < first[mover])
        chosen = chosen[: max((len(triangles) - count) // 2, 1)]
        mover = mover[chosen]
        goal = goal[chosen]
        np.add.at(quadrics, goal, quadrics[mover])
        onto = np.arange(number)
        onto[mover] = goal
        triangles = _proper(onto[triangles])
    return triangles


def _dot(a: Array, b: Array) -> Array:
    product: Array = np.einsum("ij,ij->i", a, b)
    return product


def _edges(triangles: Indices, number: int) -> tuple[Indices, Indices, Indices]:
    """Return the lower and the higher end of each edge, and of how many triangles it is."""
    one = triangles.reshape(-1)
    other = np.roll(triangles, -1, axis=1).reshape(-1)
    keys = np.minimum(one, other) * number + np.maximum(one, other)
    keys, uses = np.unique(keys, return_counts=True)
    low, high = np.divmod(keys, number)
    return low, high, uses


def _turned(points: Array, triangles: Indices, onto: Indices) -> NDArray[np.bool_]:
    """Return whether a triangle that remains would turn if a vertex moved, (k,)."""
    tip, left, right = (np.roll(triangles, shift, axis=1).reshape(-1) for shift in (0, -1, -2))
    goal = onto[tip]
    remains = (goal >= 0) & (goal != left) & (goal != right)
    tip = tip[remains]
    left = left[remains]
    right = right[remains]
    goal = goal[remains]
    corner = points.take(left, axis=0)
    side = points.take(right, axis=0) - corner
    before = np.cross(side, points.take(tip, axis=0) - corner)
    after = np.cross(side, points.take(goal, axis=0) - corner)
    sizes = _dot(before, before) * _dot(after, after)
    turned = (_dot(before, after) <= _TURN * np.sqrt(sizes)) & (_dot(before, before) > 0.0)
    found = np.zeros(len(points), dtype=bool)
    found[tip[turned]] = True
    return found


def _products(points: Array) -> Array:
    """Return x in (x, 1) Q (x, 1)' = q . x for the ten entries q of a symmetric Q, (k, 10)."""
    x, y, z = points.T
    one = np.ones(len(points))
    squares = [x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z]
    return np.column_stack([*squares, 2 * x, 2 * y, 2 * z, one])


def _quadrics(points: Array, triangles: Indices) -> Array:
    """Return sums of squared distances from planes at points, weighted by areas, (k, 10).

    The planes are those of the triangles, and through their borders at right angles to them.
    """
    a, b, c = points[triangles].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)
    areas = np.linalg.norm(across, axis=1) / 2.0
    one = triangles.reshape(-1)
    other = np.roll(triangles, -1, axis=1).reshape(-1)
    low, high, uses = _edges(triangles, len(points))
    border = np.isin(
        np.minimum(one, other) * len(points) + np.maximum(one, other),
        (low * len(points) + high)[uses != 2],
    )
    one = one[border]
    other = other[border]
    owner = np.flatnonzero(border) // 3
    along = points[other] - points[one]
    quadrics = np.zeros((len(points), 10))
    for normals, where, weight, corners in (
        (across, a, areas, triangles.T),
        (np.cross(along, across[owner]), points[one], _BORDER * _dot(along, along), (one, other)),
    ):
        length = np.linalg.norm(normals, axis=1)
        x, y, z = (normals / np.where(length > 0.0, length, 1.0)[:, None]).T
        d = -_dot(np.column_stack([x, y, z]), where)
        entries = [x * x, y * y, z * z, x * y, x * z, y * z, x * d, y * d, z * d, d * d]
        planes = np.column_stack(entries) * weight[:, None]
        for corner in corners:
            np.add.at(quadrics, corner, planes)
    return quadrics
