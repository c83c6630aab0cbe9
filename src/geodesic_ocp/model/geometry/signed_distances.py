"""Distances between capsules, spheres and half-spaces, as CasADi expressions.

Closest points of two segments: Ericson, Real-Time Collision Detection (2005), 5.1.9. The distance
is exact, and continuously differentiable except where it is zero or the segments are parallel;
there a relative term of 1e-8 smooths the jump of the closest point from one end to the other.
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
_TOUCHING = 1e-20  # [m^2]: keeps the distance differentiable at zero


def signed_distances(
    model: Model,
    q: Any,
    obstacles: Sequence[Obstacle] = (),
    *,
    links: Sequence[str] | None = None,
    pairs: Sequence[tuple[str, str]] = (),
) -> dict[str, Any]:
    """Distances [m] of collision bodies from obstacles and each other; negative if they overlap.

    >>> import geodesic_ocp as go
    >>> table = go.HalfSpace(point=(0.0, 0.0, -0.7), normal=(0.0, 0.0, 1.0), name="table")
    >>> distances = go.signed_distances(
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
            joint; `collision_pairs` suggests pairs without them.

    Returns:
        Numbers or expressions by name, such as "forearm to table". If a name occurs more than once,
        as for both ends of a capsule above a half-space or several bodies of a link, a number is
        appended: "forearm to table (2)".

    Raises:
        ValueError: the model, or one of the given links, has no bodies.
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
    """Pairs of links that move relative to each other and are apart in a configuration.

    A suggestion for `pairs` of `signed_distances`: adjacent links, which overlap at their joint,
    are left out.

    Args:
        model: model with collision bodies.
        q: a collision-free configuration (n,).
        margin: smallest distance [m] of the links of a pair.

    Raises:
        ValueError: q has the wrong shape.
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
    for name, body, other in bodies_apart(model, obstacles, links, pairs):
        for distance in _distances(model, q, body, other):
            add_named(found, name, distance)
    return found


def bodies_apart(
    model: Model,
    obstacles: Sequence[Obstacle],
    links: Sequence[str] | None,
    pairs: Sequence[tuple[str, str]],
) -> list[tuple[str, Body, Obstacle]]:
    """Pairs of a body and an obstacle or body whose distance counts, each with a name.

    The arguments and errors are those of `signed_distances`; names may occur more than once.
    """
    found: list[tuple[str, Body, Obstacle]] = []
    # Reading the bodies of a file is slow, so only if they are needed.
    moving = _moving_bodies(model) if links is None and obstacles else []
    if links is not None:
        moving = _bodies_of_links(model, links, "links")
    for number, obstacle in enumerate(obstacles):
        if not isinstance(obstacle, (Capsule, Ball, HalfSpace)):
            raise ValueError(f"obstacles must be Ball, Capsule or HalfSpace, got {obstacle!r}")
        if not moving and links is None:
            raise ValueError(f"{model.name!r} has no bodies; add them with Model.with_bodies")
        other = obstacle.name or f"obstacle {number}"
        link = None if isinstance(obstacle, HalfSpace) else obstacle.link
        joint = None if link is None else model.joint_of(link)
        for body in moving:
            if joint is not None and joint == model.joint_of(str(body.link)):
                continue  # parts of the same rigid body
            found.append((f"{_name(body)} to {other}", body, obstacle))
    for pair in pairs:
        one, other_one = (_bodies_of_links(model, [link], "pairs") for link in as_pair(pair))
        found += [
            (f"{_name(body)} to {_name(second)}", body, second)
            for body in one
            for second in other_one
        ]
    return found


def as_pair(pair: Any) -> tuple[str, str]:
    """The value as a pair of two links; ValueError otherwise."""
    if not isinstance(pair, (list, tuple)) or len(pair) != 2 or pair[0] == pair[1]:
        raise ValueError(f"pairs must be a list of pairs of two different links, got {pair!r}")
    return pair[0], pair[1]


def add_named(found: dict[str, Any], name: str, value: Any) -> None:
    """Add a value under a name, with a number appended if the name is taken."""
    unique, number = name, 1
    while unique in found:
        number += 1
        unique = f"{name} ({number})"
    found[unique] = value


def _name(body: Body) -> str:
    return body.name or str(body.link)


def _moving_bodies(model: Model) -> list[Body]:
    return [body for body in model.bodies if body.link is not None and model.moves(body.link)]


def _bodies_of_links(model: Model, links: Sequence[str], argument: str) -> list[Body]:
    found = []
    if isinstance(links, str):
        raise ValueError(f"{argument} must be a list of links, got {links!r}")
    for link in links:
        own = [body for body in model.bodies if body.link == link]
        if not own:
            known = ", ".join(dict.fromkeys(str(body.link) for body in model.bodies)) or "none"
            raise ValueError(
                f"{argument}: {model.name!r} has no body at {link!r}; links with bodies: {known}"
            )
        found += own
    return found


def _distances(model: Model, q: ca.SX, body: Body, obstacle: Obstacle) -> list[ca.SX]:
    one, radius = _segment(model, q, body), body.radius
    if isinstance(obstacle, HalfSpace):
        # Both ends, as the minimum of the two would not be smooth.
        ends = [one.start] if one.is_point else [one.start, one.end]
        normal, point = ca.DM(obstacle.normal), ca.SX(obstacle.point)
        return [ca.dot(normal, end - point) - radius for end in ends]
    distance = segment_distance(one, _segment(model, q, obstacle))
    return [distance - (radius + obstacle.radius)]


def _segment(model: Model, q: ca.SX, body: Body) -> LineSegment:
    capsule = as_capsule(body)
    if capsule.link is None:
        return line_segment(capsule)
    return line_segment(capsule, *model.frame_pose(capsule.link, q))


def line_segment(
    capsule: Capsule, rotation: ca.SX | None = None, position: ca.SX | None = None
) -> LineSegment:
    """The segment of a capsule, moved by a rotation (3, 3) and a translation (3, 1) [m]."""
    start, along = ca.SX(capsule.start), ca.SX(capsule.end) - ca.SX(capsule.start)
    square = ca.sumsqr(along)  # a simpler expression before the rotation
    if rotation is not None and position is not None:
        start, along = position + rotation @ start, rotation @ along
    return LineSegment(start, along, square, bool(square.is_zero()))


@dataclass(frozen=True, eq=False)
class LineSegment:
    """A segment: start (3, 1), vector to its end (3, 1), squared length."""

    start: ca.SX
    along: ca.SX
    square: ca.SX
    is_point: bool

    @property
    def end(self) -> ca.SX:
        """Its end (3, 1)."""
        return self.start + self.along


def segment_distance(one: LineSegment, other: LineSegment) -> ca.SX:
    """Distance between two segments."""
    between, u, w = one.start - other.start, one.along, other.along
    if one.is_point and other.is_point:
        return _norm(between)
    if one.is_point:
        return _norm(between - _clipped_ratio(ca.dot(w, between), other.square) * w)
    if other.is_point:
        return _norm(between + _clipped_ratio(-ca.dot(u, between), one.square) * u)
    a, b, e = one.square, ca.dot(u, w), other.square
    c, f = ca.dot(u, between), ca.dot(w, between)
    s = _clipped_ratio(b * f - c * e, (1.0 + _PARALLEL) * a * e - b * b)
    t = _clipped_ratio(b * s + f, e)
    s = _clipped_ratio(b * t - c, a)
    return _norm(between + s * u - t * w)


def _clipped_ratio(numerator: ca.SX, denominator: ca.SX) -> ca.SX:
    return ca.fmin(ca.fmax(numerator / denominator, 0.0), 1.0)


def _norm(vector: ca.SX) -> ca.SX:
    return ca.sqrt(ca.sumsqr(vector) + _TOUCHING)
