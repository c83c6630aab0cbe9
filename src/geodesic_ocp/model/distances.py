"""Distances of capsules and balls from each other and from obstacles, as expressions or numbers.

Closest points of two segments: Ericson, Real-Time Collision Detection (2005), 5.1.9. The distance
is exact, and continuously differentiable except where it is zero or the segments are parallel;
there a relative term of 1e-8 in expressions smooths the jump of the closest point from one end to
the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, ShortRepr, as_number, as_vector, is_symbolic
from geodesic_ocp.blocks import Instance, Terms
from geodesic_ocp.cells import Indices
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import (
    Ball,
    Body,
    Box,
    Capsule,
    HalfSpace,
    Obstacle,
    as_capsule,
    box_distance,
)

__all__ = ["clearance_constraints", "signed_distances"]

_PARALLEL = 1e-8
_TOUCHING = 1e-20  # [m^2]: keeps the distance differentiable at zero


@dataclass(frozen=True, eq=False)
class LineSegment:
    """A segment: start (3, 1), vector to its end (3, 1), squared length."""

    start: ca.SX
    along: ca.SX
    square: ca.SX

    @property
    def ends(self) -> list[ca.SX]:
        """Both ends, of which the minimum of a distance would not be smooth; one of a point."""
        return [self.start] if self.square.is_zero() else [self.start, self.start + self.along]


def line_segment(
    capsule: Capsule, rotation: ca.SX | None = None, position: ca.SX | None = None
) -> LineSegment:
    """Return the segment of a capsule, moved by a rotation (3, 3) and a translation (3, 1) [m]."""
    start = ca.SX(capsule.start)
    along = ca.SX(capsule.end) - ca.SX(capsule.start)
    square = ca.sumsqr(along)  # a simpler expression before the rotation
    if rotation is not None and position is not None:
        start = position + rotation @ start
        along = rotation @ along
    return LineSegment(start, along, square)


def segment_distance(one: LineSegment, other: LineSegment) -> ca.SX:
    """Return distance between two segments."""
    function = _distance_function(one.square.is_zero(), other.square.is_zero())
    parts = (getattr(each, part) for each in (one, other) for part in ("start", "along", "square"))
    return ca.SX(function(*parts))


@lru_cache(maxsize=4)
def _distance_function(*are_points: bool) -> ca.Function:
    """Return the distance by start, vector to the end and squared length of two segments.

    A call of it is an expression several times faster than the operations one by one.
    """
    symbols = []
    segments = []
    for name, is_point in zip("ab", are_points, strict=True):
        own = [ca.SX.sym(name, 3), ca.SX.sym(f"{name}_along", 3), ca.SX.sym(f"{name}_square")]
        symbols += own
        segments.append(LineSegment(own[0], *((ca.SX.zeros(3), ca.SX(0)) if is_point else own[1:])))
    return ca.Function("distance", symbols, [_distance(*segments)[0]])


def _distance(one: LineSegment, other: LineSegment) -> tuple[ca.SX, list[ca.SX]]:
    """Return the distance of two segments, and its gradients by start and vector of either: those
    for fixed s and t, at which it is least.
    """
    between, s, t = _closest(one, other)
    apart = between + s * one.along - t * other.along
    distance = ca.sqrt(ca.sumsqr(apart) + _TOUCHING)
    normal = apart / distance
    return distance, [normal, s * normal, -normal, -t * normal]


def _closest(one: LineSegment, other: LineSegment) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return the vector (3, 1) from the start of another segment, and where on both, from 0 to 1,
    they come closest.
    """
    between = one.start - other.start
    u = one.along
    w = other.along
    c = ca.dot(u, between)
    f = ca.dot(w, between)
    return between, *_fractions(one.square, ca.dot(u, w), other.square, c, f, _PARALLEL)


def segment_distances(start: Array, end: Array, other_start: Array, other_end: Array) -> Array:
    """Return distances (...) [m] between segments, whose ends are (..., 3) each: numbers, many at
    once.
    """
    u = end - start
    w = other_end - other_start
    between = start - other_start
    products = ((u, u), (u, w), (w, w), (u, between), (w, between))
    s, t = _fractions(*(np.vecdot(*pair) for pair in products))
    return np.asarray(np.linalg.norm(between + s[..., None] * u - t[..., None] * w, axis=-1))


def _fractions(a: Any, b: Any, e: Any, c: Any, f: Any, parallel: float = 0.0) -> tuple[Any, Any]:
    """Return where on two segments, from 0 to 1, they come closest: Ericson's s and t."""
    s = _clipped_ratio(b * f - c * e, (1.0 + parallel) * a * e - b * b)
    t = _clipped_ratio(b * s + f, e)
    return _clipped_ratio(b * t - c, a), t


def _clipped_ratio(numerator: Any, denominator: Any) -> Any:
    """Get the ratio from 0 to 1; 0 where the denominator is zero: points, and parallel segments."""
    if is_symbolic(denominator):
        ratio = ca.SX(0) if denominator.is_zero() else numerator / denominator
        return ca.fmin(ca.fmax(ratio, 0.0), 1.0)
    some = denominator > np.finfo(float).tiny
    ratio = np.divide(numerator, denominator, out=np.zeros(numerator.shape), where=some)
    return np.clip(ratio, 0.0, 1.0)


def signed_distances(
    model: Model,
    q: Any,
    obstacles: Sequence[Obstacle] = (),
    *,
    links: Sequence[str] | None = None,
    pairs: Sequence[tuple[str, str]] = (),
) -> dict[str, Any]:
    """Return distances [m] of collision bodies from obstacles and each other; negative if they
    overlap.

    >>> table = go.HalfSpace(point=(0.0, 0.0, -0.7), normal=(0.0, 0.0, 1.0), name="table")
    >>> distances = go.distances.signed_distances(
    ...     go.human_arm(), [0.5, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0], [table], links=["right hand"]
    ... )
    >>> {name: round(value, 3) for name, value in distances.items()}
    {'right hand to table': 0.249, 'right hand to table (2)': 0.147}

    Args:
        model: model with collision bodies (`Model.bodies`).
        q: configuration (n,), numbers or expressions.
        obstacles: fixed, or moving with the link that they name.
        links: links whose distances to obstacles are computed; None: all that move.
        pairs: pairs of links whose mutual distances are computed. Adjacent links overlap at their
            joint; `execution.link_pairs` finds pairs without them.

    Returns:
        Numbers or expressions by name, such as "forearm to table". If a name occurs more than once,
        as for both ends of a capsule above a half-space or several bodies of a link, a number is
        appended: "forearm to table (2)".

    Raises:
        ValueError: the model, or one of the given links, has no bodies.
    """
    x = q if isinstance(q, ca.SX) else ca.SX.sym("q", model.dof)
    expressions: dict[str, ca.SX] = {}
    apart = bodies_apart(model, obstacles, links, pairs)
    for (name, _, _), found in zip(apart, _distances(model, x, apart), strict=True):
        for distance in found:
            add_named(expressions, name, distance)
    if isinstance(q, ca.SX) or not expressions:
        return expressions
    function = ca.Function("signed_distances", [x], [ca.vertcat(*expressions.values())])
    if isinstance(q, ca.MX):
        return dict(zip(expressions, ca.vertsplit(function(q)), strict=True))
    values = function(as_vector("q", q, model.dof)).full()[:, 0]
    return dict(zip(expressions, values.tolist(), strict=True))


def clearance_constraints(
    model: Model,
    q: ca.SX,
    obstacles: Sequence[Obstacle] = (),
    *,
    links: Sequence[str] | None = None,
    pairs: Sequence[tuple[str, str]] = (),
    margin: float = 0.0,
) -> list[tuple[float, Any, float, str]]:
    """Return path constraints that keep a model's collision bodies apart from obstacles and each
    other.

    >>> import casadi as ca
    >>> arm, ball = go.human_arm(), go.Ball(centre=(0.3, 0.4, -0.1), radius=0.1)
    >>> rows = go.distances.clearance_constraints(arm, ca.SX.sym("q", arm.dof), [ball], margin=0.02)
    >>> [name for *_, name in rows][0]
    'right upper arm to obstacle 0'

    Args:
        model: model with collision bodies (`Model.bodies`).
        q: symbols of the configuration (n, 1).
        obstacles, links, pairs: see `signed_distances`.
        margin: smallest distance allowed [m].

    Raises:
        ValueError: the model, or a named link, has no collision bodies.
    """
    margin = as_number("margin", margin)
    distances = signed_distances(model, q, obstacles, links=links, pairs=pairs)
    return [(margin, distance, np.inf, name) for name, distance in distances.items()]


def bodies_apart(
    model: Model,
    obstacles: Sequence[Obstacle],
    links: Sequence[str] | None,
    pairs: Sequence[tuple[str, str]],
) -> list[tuple[str, Body, Obstacle]]:
    """Return pairs of a body and an obstacle or body whose distance counts, each with a name.

    The arguments and errors are those of `signed_distances`; names may occur more than once.
    """
    found: list[tuple[str, Body, Obstacle]] = []
    moving = [] if links is None else _bodies_of_links(model, links, "links")
    if links is None and obstacles:  # reading the bodies of a file is slow
        moving = [body for body in model.bodies if body.link and model.moves(body.link)]
    for number, obstacle in enumerate(obstacles):
        if not isinstance(obstacle, Obstacle):
            raise ValueError(f"obstacles must be Ball, Capsule, Box or HalfSpace, got {obstacle!r}")
        if not moving and links is None:
            raise ValueError(f"{model.name!r} has no bodies; add them with Model.with_bodies")
        other = obstacle.name or f"obstacle {number}"
        link = None if isinstance(obstacle, HalfSpace) else obstacle.link
        joint = None if link is None else model.joint_of(link)
        for body in moving:
            if joint != model.joint_of(str(body.link)):  # else parts of the same rigid body
                found.append((f"{body.name or body.link} to {other}", body, obstacle))
    for pair in pairs:
        both = (_bodies_of_links(model, [link], "pairs") for link in as_pair(pair))
        for one, two in product(*both):
            found.append((f"{one.name or one.link} to {two.name or two.link}", one, two))
    return found


def as_pair(pair: Any) -> tuple[str, str]:
    """Return the value as a pair of two links; ValueError otherwise."""
    if not isinstance(pair, (list, tuple)) or len(pair) != 2 or pair[0] == pair[1]:
        raise ValueError(f"pairs must be a list of pairs of two different links, got {pair!r}")
    return pair[0], pair[1]


def add_named(found: dict[str, Any], name: str, value: Any) -> None:
    """Add a value under a name, with a number appended if the name is taken."""
    unique = name
    number = 1
    while unique in found:
        number += 1
        unique = f"{name} ({number})"
    found[unique] = value


def _bodies_of_links(model: Model, links: Sequence[str], argument: str) -> list[Body]:
    if isinstance(links, str):
        raise ValueError(f"{argument} must be a list of links, got {links!r}")
    known = list(dict.fromkeys(str(body.link) for body in model.bodies))
    for link in links:
        if link not in known:
            what = f"{argument}: {model.name!r} has no body at {link!r}; links with bodies"
            raise ValueError(f"{what}: {', '.join(known) or 'none'}")
    return [body for link in links for body in model.bodies if body.link == link]


def nearest_to_obstacle(
    segment: LineSegment, radius: float, obstacle: Obstacle, *pose: ca.SX
) -> list[tuple[ca.SX, ca.SX, ca.SX]]:
    """Return points (3, 1) [m] at which a capsule and an obstacle are nearest, and their distance.

    Above a half-space, those of both ends.

    Args:
        segment, radius: the capsule.
        obstacle: the obstacle.
        pose: rotation (3, 3) and position (3, 1) of the frame that it is fixed to, if it moves.
    """
    if isinstance(obstacle, HalfSpace):
        normal = ca.DM(obstacle.normal)
        point = ca.SX(obstacle.point)
        starts = [end - radius * normal for end in segment.ends]
        heights = [ca.dot(normal, end - point) - radius for end in segment.ends]
        return [(at, at - high * normal, high) for at, high in zip(starts, heights, strict=True)]
    if isinstance(obstacle, Box):
        other_radius = 0.0
        distance, here, there, _ = box_distance(segment.start, segment.along, obstacle, *pose)
    else:
        other = line_segment(as_capsule(obstacle), *pose)
        other_radius = obstacle.radius
        _, s, t = _closest(segment, other)
        here = segment.start + s * segment.along
        there = other.start + t * other.along
        distance = segment_distance(segment, other)
    direction = (there - here) / distance
    start = here + radius * direction
    end = there - other_radius * direction
    return [(start, end, distance - (radius + other_radius))]


def _segment(model: Model, q: ca.SX, body: Body) -> LineSegment:
    return line_segment(as_capsule(body), *_pose(model, q, body))


def _pose(model: Model, q: ca.SX, body: Obstacle) -> tuple[ca.SX, ...]:
    if isinstance(body, HalfSpace) or body.link is None:
        return ()
    pose: tuple[ca.SX, ca.SX] = model.frame_pose(body.link, q)
    return pose


@dataclass(frozen=True, eq=False, repr=False)
class NearestPoints(ShortRepr):
    """Points at which two bodies come closest, in k configurations.

    Attributes:
        starts, ends: the points on the surface of either, (k, 3) [m] in the base frame.
        distances: between them, (k,) [m]; negative where the bodies overlap.
    """

    starts: Array
    ends: Array
    distances: Array


def nearest_points(
    model: Model,
    q: Array,
    obstacles: Sequence[Obstacle] = (),
    *,
    links: Sequence[str] | None = None,
    pairs: Sequence[tuple[str, str]] = (),
) -> dict[str, NearestPoints]:
    """Return nearest points by the names of `signed_distances`, whose arguments and errors these
    are.

    Args:
        model, obstacles, links, pairs: see `signed_distances`; obstacles are numbers.
        q: configurations (k, n) [rad or m].

    Raises:
        ValueError: an obstacle depends on symbols, or see `signed_distances`.
    """
    for obstacle in obstacles:
        if has_symbols(obstacle):
            raise ValueError(f"obstacles must be numbers here, got {obstacle!r}")
    x = ca.SX.sym("q", model.dof)
    named = _nearest_by_name(model, x, bodies_apart(model, obstacles, links, pairs))
    outputs = [ca.vertcat(*nearest) for nearest in named.values()]
    values = ca.Function("nearest_points", [x], outputs).map(len(q)).call([q.T])
    parts = (np.split(value.full().T, [3, 6], axis=1) for value in values)
    return {
        name: NearestPoints(starts, ends, distances[:, 0])
        for name, (starts, ends, distances) in zip(named, parts, strict=True)
    }


def has_symbols(obstacle: Obstacle) -> bool:
    """Return whether an obstacle is given by expressions in place of numbers."""
    if isinstance(obstacle, HalfSpace):
        return is_symbolic(obstacle.point)
    if isinstance(obstacle, Box):
        return is_symbolic(obstacle.centre, obstacle.size)
    body = as_capsule(obstacle)
    return is_symbolic(body.start, body.end, body.radius)


def _distances(
    model: Model, q: ca.SX, apart: Sequence[tuple[str, Body, Obstacle]]
) -> Iterator[list[ca.SX]]:
    """Yield distances [m] of bodies from others; from a plane, those of a body's ends."""
    rows: dict[_Place, Indices] = {}
    size = 0
    symbolic = [has_symbols(body) or has_symbols(other) for _, body, other in apart]
    for (_, body, other), as_given in zip(apart, symbolic, strict=True):
        for place in _places(body, other) if not as_given else ():
            if place not in rows:
                rows[place] = size + np.arange(3 if _is_point(place[0]) else 6)
                size += rows[place].size
    inner = _points(model, tuple(rows))
    points = inner.value(q, [])[1]
    for (_, body, other), as_given in zip(apart, symbolic, strict=True):
        if as_given:
            nearest = nearest_to_obstacle(
                _segment(model, q, body), body.radius, other, *_pose(model, q, other)
            )
            yield [distance for _, _, distance in nearest]
            continue
        own = np.concatenate([rows[each] for each in _places(body, other)])
        found = list[ca.SX]()
        terms = _distance_terms(_is_point(body), _kind(other), _moves(other))
        for numbers in _numbers(body, other):
            distance = terms.value(points[own.tolist()], numbers)[1]
            found.append(Instance(distance, terms, numbers, q, inner, own))
        yield found


# A body, and the link in whose frame its points are; None for the base frame.
_Place: TypeAlias = tuple[Body, str | None]


def _places(body: Body, other: Obstacle) -> list[_Place]:
    """Return the bodies whose points the distance depends on: not that of a box, which rests in the
    frame of its link.
    """
    if isinstance(other, Box):
        return [(body, other.link)]
    return [(body, None), (other, None)] if _moves(other) else [(body, None)]  # type: ignore[list-item]


def _moves(other: Obstacle) -> bool:
    return isinstance(other, (Ball, Capsule)) and other.link is not None


@lru_cache(maxsize=64)
def _points(model: Model, places: tuple[_Place, ...]) -> Terms:
    """Return starts and vectors to the ends, or centres, of bodies in the frames of links."""
    q = ca.SX.sym("q", model.dof)
    points = [ca.SX(0, 1)]
    for body, link in places:
        capsule = as_capsule(body)
        rotation, position = _pose(model, q, body) or (ca.SX.eye(3), ca.SX.zeros(3))
        at = position + rotation @ ca.SX(capsule.start)
        along = rotation @ (ca.SX(capsule.end) - ca.SX(capsule.start))
        if link is not None:
            turn, origin = model.frame_pose(link, q)
            at = turn.T @ (at - origin)
            along = turn.T @ along
        points += [at] if _is_point(body) else [at, along]
    return Terms(q, None, 0.0, ca.vertcat(*points), lasting=True)


@lru_cache(maxsize=12)
def _distance_terms(is_point: bool, kind: type, moves: bool) -> Terms:
    """Return the distance of a segment, or a point, from another body with such numbers."""
    variables: list[ca.SX] = []
    numbers: list[ca.SX] = []

    def symbols(listed: list[ca.SX], *shape: int) -> ca.SX:
        listed.append(ca.SX.sym("z", *shape))
        return listed[-1]

    def segment(listed: list[ca.SX], is_point: bool) -> LineSegment:
        start = symbols(listed, 3)
        if is_point:
            return LineSegment(start, ca.SX.zeros(3), ca.SX(0))
        along = symbols(listed, 3)
        return LineSegment(start, along, ca.sumsqr(along))

    one = segment(variables, is_point)
    if kind is HalfSpace:
        normal = symbols(numbers, 3)
        end = symbols(numbers)
        height = symbols(numbers)
        distance = ca.dot(normal, one.start + end * one.along) - height
        slopes = [normal, end * normal]
    elif kind is Box:
        box: Any = Box((0.0, 0.0, 0.0), symbols(numbers, 3))  # type: ignore[arg-type]
        centre = symbols(numbers, 3)
        turn = symbols(numbers, 3, 3)
        distance, _, _, slopes = box_distance(one.start, one.along, box, turn, centre)
    else:
        other = segment(variables if moves else numbers, kind is Ball)
        distance, slopes = _distance(one, other)
        slopes = slopes if kind is Capsule else slopes[:3]
    if is_point:
        slopes = [slopes[0], *slopes[2:]]
    radius = symbols(numbers)
    z, p = (ca.vertcat(*map(ca.vec, each)) for each in (variables, numbers))
    by_z = ca.vertcat(*slopes)[: z.numel()].T
    return Terms(z, p, 0.0, distance - radius, by_z, lasting=True)


def _numbers(body: Body, other: Obstacle) -> list[Array]:
    """Return the numbers of `_distance_terms` of a body and another; of a plane, for each end."""
    if isinstance(other, HalfSpace):
        height = np.dot(other.normal, other.point)
        ends = [0.0] if _is_point(body) else [0.0, 1.0]
        return [np.array([*other.normal, each, height, body.radius]) for each in ends]
    if isinstance(other, Box):
        turn = np.ravel(other.rotation, order="F")
        return [np.array([*other.size, *other.centre, *turn, body.radius])]
    start, end = (np.array(each) for each in (as_capsule(other).start, as_capsule(other).end))
    numbers = [] if _moves(other) else [*start] if _is_point(other) else [*start, *(end - start)]
    return [np.array([*numbers, body.radius + other.radius])]


def _is_point(body: Obstacle) -> bool:
    return isinstance(body, Ball) or (isinstance(body, Capsule) and body.start == body.end)


def _kind(other: Obstacle) -> type:
    return Ball if _is_point(other) else type(other)


def _nearest_by_name(
    model: Model, q: ca.SX, apart: Sequence[tuple[str, Body, Obstacle]]
) -> dict[str, tuple[ca.SX, ca.SX, ca.SX]]:
    """Get points on the surface of either body (3, 1), and their distance; of a plane, for each
    end.
    """
    found: dict[str, tuple[ca.SX, ca.SX, ca.SX]] = {}
    for name, body, other in apart:
        pose = _pose(model, q, other)
        for nearest in nearest_to_obstacle(_segment(model, q, body), body.radius, other, *pose):
            add_named(found, name, nearest)
    return found
