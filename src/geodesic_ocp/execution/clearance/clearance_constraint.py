"""Clearance of links from each other and from obstacles, as a constraint of programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_number
from geodesic_ocp.execution.clearance.link_pairs import MARGIN, LinkPairs, link_pairs
from geodesic_ocp.execution.clearance.placed_solids import PlacedSolid, PlacedSolids, place_solids
from geodesic_ocp.execution.clearance.sampled_distances import pose_at
from geodesic_ocp.execution.clearance_constraint import Clearance
from geodesic_ocp.model.distances import LineSegment, as_pair, line_segment, segment_distance
from geodesic_ocp.model.link_solids import exact_distance
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Ball, Capsule, HalfSpace, Obstacle, as_capsule
from geodesic_ocp.model.rigid_body import Placement, constant, joint_placements


def clearance_constraint(
    arms: Model | Sequence[Model],
    *,
    pairs: LinkPairs | Sequence[tuple[str, str]] | None = None,
    obstacles: Sequence[Obstacle] = (),
    margin: float = MARGIN,
    placements: Sequence[Any] | None = None,
) -> Clearance | None:
    """Distances of the capsules of links from each other and from obstacles; None if there are no.

    The capsules contain the links, so the distances are lower bounds of the exact ones, except for
    pairs with an excess (`LinkPairs.excess`), which is added to them.

    Args:
        arms: a model, or several.
        pairs: of links, as from `link_pairs`, whose `constrained` ones are taken, or by name; None:
            those that `link_pairs` finds.
        obstacles: balls, capsules and half-spaces in the common base frame, which all moving links
            keep clear of.
        margin: smallest distance allowed [m].
        placements: of the bases of the arms, see `link_pairs`.

    Raises:
        ValueError: an unknown link, obstacles that are fixed to a link, or a wrong margin.
    """
    margin = as_number("margin", margin)
    models = (arms,) if isinstance(arms, Model) else tuple(arms)
    placed, named, excess = _pairs(models, pairs, placements, margin)
    by_name = {each.name: each for each in placed.solids}
    q = ca.SX.sym("q", placed.dof)
    segments = _Segments(placed, q)
    distances: list[ca.SX] = []
    names: list[str] = []
    solids: list[tuple[PlacedSolid, PlacedSolid] | None] = []
    for (one, other), wider in zip(named, excess, strict=True):
        pair = by_name[one], by_name[other]
        for first, radius in segments.of(pair[0]):
            for second, other_radius in segments.of(pair[1]):
                apart = segment_distance(first, second) - (radius + other_radius)
                distances.append(apart + wider)
                names.append(f"{one} to {other}")
                solids.append(pair)
    for number, obstacle in enumerate(obstacles):
        fixed = _fixed_obstacle(obstacle)
        for each in (each for each in placed.solids if each.moves):
            for found in _from_obstacle(segments.of(each), fixed):
                distances.append(found)
                names.append(f"{each.name} to {obstacle.name or f'obstacle {number}'}")
                solids.append(None)
    if not distances:
        return None
    function = ca.Function("clearance", [q], [ca.cse(ca.vertcat(*distances))], ["q"], ["d"])
    exact = _Exact(placed, function, tuple(solids))
    return Clearance(function, np.full(len(names), margin), _unique(names), exact)


@dataclass(frozen=True, eq=False)
class _Exact:
    """Exact distances between pairs of links; to obstacles, those of the function."""

    placed: PlacedSolids
    function: ca.Function
    solids: tuple[tuple[PlacedSolid, PlacedSolid] | None, ...]

    def __call__(self, q: Array, index: int) -> float:
        pair = self.solids[index]
        if pair is None:
            return max(0.0, float(self.function(q)[index]))
        one, other = pair
        poses = self.placed.joint_poses(np.asarray(q, dtype=float)[None])
        at = pose_at(one, poses, 0), pose_at(other, poses, 0)
        return exact_distance(one.solid, at[0], other.solid, at[1])


@dataclass(frozen=True, eq=False)
class _Segments:
    """Segments and radii of the capsules of links at symbolic joint angles."""

    placed: PlacedSolids
    q: ca.SX
    _joints: list[list[Placement]] = field(default_factory=list, init=False)
    _found: dict[str, list[tuple[LineSegment, float]]] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        first = 0
        for model, (rotation, position) in zip(self.placed.models, self.placed.bases, strict=True):
            own = self.q[first : first + model.dof]
            chain = [Placement(constant(rotation), constant(position))]
            for index, local in enumerate(joint_placements(model.pin, own)):
                if index > 0:
                    chain.append(chain[model.pin.parents[index]] @ local)
            self._joints.append(chain)
            first += model.dof

    def of(self, each: PlacedSolid) -> list[tuple[LineSegment, float]]:
        """Of each capsule of a link, in the common base frame."""
        if each.name not in self._found:
            joint = self._joints[each.arm][each.solid.joint]
            self._found[each.name] = [
                (line_segment(capsule, joint.rotation, joint.translation), capsule.radius)
                for capsule in each.solid.capsules
            ]
        return self._found[each.name]


def _pairs(
    models: Sequence[Model],
    pairs: LinkPairs | Sequence[tuple[str, str]] | None,
    placements: Sequence[Any] | None,
    margin: float,
) -> tuple[PlacedSolids, Sequence[tuple[str, str]], Sequence[float]]:
    if pairs is None:
        pairs = link_pairs(models, placements, margin=margin)
    if isinstance(pairs, LinkPairs):
        if pairs.solids.models != models:
            raise ValueError("pairs were found for other models than arms")
        return pairs.solids, pairs.constrained, pairs.excess
    placed = place_solids(models, placements)
    named = [as_pair(pair) for pair in pairs]
    known = [each.name for each in placed.solids]
    for link in (link for pair in named for link in pair):
        if link not in known:
            raise ValueError(
                f"pairs: there is no link {link!r} with geometry within reach; there are "
                f"{', '.join(known) or 'none'}"
            )
    return placed, named, [0.0] * len(named)


def _fixed_obstacle(obstacle: Obstacle) -> HalfSpace | Capsule:
    if not isinstance(obstacle, (Capsule, Ball, HalfSpace)):
        raise ValueError(f"obstacles must be Ball, Capsule or HalfSpace, got {obstacle!r}")
    if isinstance(obstacle, HalfSpace):
        return obstacle
    if obstacle.link is not None:
        raise ValueError(
            f"obstacles must not be fixed to a link, as to {obstacle.link!r}; add what a link "
            "carries with Model.with_bodies"
        )
    return as_capsule(obstacle)


def _from_obstacle(
    capsules: Sequence[tuple[LineSegment, float]], obstacle: HalfSpace | Capsule
) -> list[ca.SX]:
    found = []
    for segment, radius in capsules:
        if isinstance(obstacle, HalfSpace):
            normal, point = ca.DM(obstacle.normal), ca.DM(obstacle.point)
            ends = [segment.start] if segment.is_point else [segment.start, segment.end]
            found += [ca.dot(normal, end - point) - radius for end in ends]
        else:
            found.append(
                segment_distance(segment, line_segment(obstacle)) - (radius + obstacle.radius)
            )
    return found


def _unique(names: Sequence[str]) -> tuple[str, ...]:
    """Names with a number appended where one occurs again."""
    seen: dict[str, int] = {}
    result = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        result.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return tuple(result)
