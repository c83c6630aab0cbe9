"""Distances between capsules, spheres and half-spaces, as CasADi expressions.

Nearest points of two segments: Ericson, Real-Time Collision Detection (2005), 5.1.9. The distance
is exact, and continuously differentiable but where it is zero or segments are parallel; there a
share of 1e-8 rounds the jump of the nearest point from one end to the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import as_vector
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Ball, Body, Capsule, HalfSpace, Obstacle, as_capsule

_PARALLEL = 1e-8
_TOUCHING = 1e-20  # [m^2]: a distance of 1e-10 m still has a direction


def signed_distances(
    model: Model,
    q: Any,
    obstacles: Sequence[Obstacle] = (),
    *,
    links: Sequence[str] | None = None,
    pairs: Sequence[tuple[str, str]] = (),
) -> dict[str, Any]:
    """Distances [m] of a model's bodies from obstacles and from each other; negative inside.

    Args:
        model: with bodies (`Model.bodies`).
        q: configuration (n,), numbers or symbols.
        obstacles: that stand still, or move with a link that is named in them.
        links: whose bodies are to stay clear of obstacles; None: all that move.
        pairs: of links that are to stay clear of each other. Neighbours do not: their capsules
            overlap at the joint between them (`collision_pairs`).

    Returns:
        By name, as "forearm to table", numbers or expressions. Where there are several of a name,
        as with the heights of both ends of a capsule above a half-space, or several bodies of a
        link, the others are "forearm to table (2)" and so on.

    Raises:
        ValueError: there are no bodies, or none of a link that is named.
    """
    symbolic = isinstance(q, (ca.SX, ca.MX))
    x = q if isinstance(q, ca.SX) else ca.SX.sym("q", model.dof)
    expressions = _expressions(model, x, obstacles, links, pairs)
    if isinstance(q, ca.SX) or not expressions:
        return expressions
    function = ca.Function("signed_distances", [x], [ca.vertcat(*expressions.values())])
    if symbolic:
        return dict(zip(expressions, ca.vertsplit(function(q)), strict=True))
    values = function(as_vector("q", q, model.dof)).full()[:, 0]
    return dict(zip(expressions, values.tolist(), strict=True))


def collision_pairs(model: Model, q: ArrayLike, margin: float = 0.0) -> list[tuple[str, str]]:
    """Pairs of links that move against each other and are apart in a configuration.

    A start for `pairs`: neighbours, whose capsules overlap at their joint, are not among them.

    Args:
        model: with bodies.
        q: a configuration (n,) in which nothing touches.
        margin: least distance [m].

    Raises:
        ValueError: a wrong shape.
    """
    links = list(dict.fromkeys(str(body.link) for body in model.bodies))
    pairs = [
        (one, other)
        for index, one in enumerate(links)
        for other in links[index + 1 :]
        if model.joint_of(one) != model.joint_of(other)
    ]
    return [
        pair
        for pair in pairs
        if min(signed_distances(model, q, pairs=[pair]).values()) > float(margin)
    ]


def _expressions(
    model: Model,
    q: ca.SX,
    obstacles: Sequence[Obstacle],
    links: Sequence[str] | None,
    pairs: Sequence[tuple[str, str]],
) -> dict[str, ca.SX]:
    found: dict[str, ca.SX] = {}
    # Reading a file's bodies takes a while, and is put off until somebody asks.
    moving = _moving(model) if links is None and obstacles else []
    if links is not None:
        moving = _of_links(model, links, "links")
    for number, obstacle in enumerate(obstacles):
        if not isinstance(obstacle, (Capsule, Ball, HalfSpace)):
            raise ValueError(f"obstacles must be Ball, Capsule or HalfSpace, got {obstacle!r}")
        if not moving and links is None:
            raise ValueError(f"{model.name!r} has no bodies; give it some with Model.with_bodies")
        other = obstacle.name or f"obstacle {number}"
        link = None if isinstance(obstacle, HalfSpace) else obstacle.link
        joint = None if link is None else model.joint_of(link)
        for body in moving:
            if joint is not None and joint == model.joint_of(str(body.link)):
                continue  # one rigid body
            for distance in _distances(model, q, body, obstacle):
                _add(found, f"{_name(body)} to {other}", distance)
    for pair in pairs:
        one, other_one = (_of_links(model, [link], "pairs") for link in as_pair(pair))
        for body in one:
            for second in other_one:
                for distance in _distances(model, q, body, second):
                    _add(found, f"{_name(body)} to {_name(second)}", distance)
    return found


def as_pair(pair: Any) -> tuple[str, str]:
    """A pair of two links; ValueError if it is none."""
    if not isinstance(pair, (list, tuple)) or len(pair) != 2 or pair[0] == pair[1]:
        raise ValueError(f"pairs must be a list of pairs of two different links, got {pair!r}")
    return pair[0], pair[1]


def _add(found: dict[str, ca.SX], name: str, distance: ca.SX) -> None:
    own, number = name, 1
    while own in found:
        number += 1
        own = f"{name} ({number})"
    found[own] = distance


def _name(body: Body) -> str:
    return body.name or str(body.link)


def _moving(model: Model) -> list[Body]:
    return [body for body in model.bodies if body.link is not None and model.moves(body.link)]


def _of_links(model: Model, links: Sequence[str], what: str) -> list[Body]:
    found = []
    if isinstance(links, str):
        raise ValueError(f"{what} must be a list of links, got {links!r}")
    for link in links:
        own = [body for body in model.bodies if body.link == link]
        if not own:
            known = ", ".join(dict.fromkeys(str(body.link) for body in model.bodies)) or "none"
            raise ValueError(f"{what}: {model.name!r} has no body at {link!r}; bodies are: {known}")
        found += own
    return found


def _distances(model: Model, q: ca.SX, body: Body, obstacle: Obstacle) -> list[ca.SX]:
    one, radius = _segment(model, q, body), body.radius
    if isinstance(obstacle, HalfSpace):
        # The nearer of the two ends may change on the way: each is a smooth condition.
        ends = [one.start] if one.point else [one.start, one.start + one.along]
        normal, point = ca.DM(obstacle.normal), ca.SX(obstacle.point)
        return [ca.dot(normal, end - point) - radius for end in ends]
    distance = segment_distance(one, _segment(model, q, obstacle))
    return [distance - (radius + obstacle.radius)]


def _segment(model: Model, q: ca.SX, body: Body) -> Segment:
    capsule = as_capsule(body)
    start, along = ca.SX(capsule.start), ca.SX(capsule.end) - ca.SX(capsule.start)
    square = ca.sumsqr(along)  # before it is turned, which keeps it
    if capsule.link is not None:
        rotation, position = model.frame_pose(capsule.link, q)
        start, along = position + rotation @ start, rotation @ along
    return Segment(start, along, square, bool(square.is_zero()))


@dataclass(frozen=True, eq=False)
class Segment:
    """A segment by its start (3, 1), direction (3, 1), length^2, and whether it is a point."""

    start: ca.SX
    along: ca.SX
    square: ca.SX
    point: bool


def segment_distance(one: Segment, other: Segment) -> ca.SX:
    """Distance of two segments."""
    between, u, w = one.start - other.start, one.along, other.along
    if one.point and other.point:
        return _norm(between)
    if one.point:
        return _norm(between - _share(ca.dot(w, between), other.square) * w)
    if other.point:
        return _norm(between + _share(-ca.dot(u, between), one.square) * u)
    a, b, e = one.square, ca.dot(u, w), other.square
    c, f = ca.dot(u, between), ca.dot(w, between)
    s = _share(b * f - c * e, (1.0 + _PARALLEL) * a * e - b * b)
    t = _share(b * s + f, e)
    s = _share(b * t - c, a)
    return _norm(between + s * u - t * w)


def _share(numerator: ca.SX, denominator: ca.SX) -> ca.SX:
    return ca.fmin(ca.fmax(numerator / denominator, 0.0), 1.0)


def _norm(vector: ca.SX) -> ca.SX:
    return ca.sqrt(ca.sumsqr(vector) + _TOUCHING)
