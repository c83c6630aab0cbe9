"""The links of one or several arms in a common base frame, and the pairs to be kept apart."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geodesic_ocp.arrays import Array, ShortRepr, as_number
from geodesic_ocp.model.combine import base_placements
from geodesic_ocp.model.distances import segment_distances
from geodesic_ocp.model.link_geometry import LinkGeometry
from geodesic_ocp.model.link_solids import (
    LinkSolid,
    Pose,
    exact_distance,
    is_closer,
    joint_poses,
    link_solids,
    reach_bound,
)
from geodesic_ocp.model.model import Model

Pair = tuple[str, str]
MARGIN = 0.01  # [m]
# configurations within the limits; the latter for an excess
_SAMPLES = 256
_MORE_SAMPLES = 2048
# shares of the sampled configurations
_ALWAYS = 0.95
_SOME = 0.05
_MANY = 0.25
_KEPT = 0.75  # of an excess, as no sample is the worst case
_ENOUGH = 8  # close ones, for an excess
_SAME = 1e-9  # [m]: rounding
_CAP = 0.5  # of the largest distance of a pair, that it can be kept apart
_CLOSEST = 4e-3  # [m]: links that are never farther apart are those of a joint, as if in contact


@dataclass(frozen=True, eq=False, repr=False)
class LinkPairs(ShortRepr):
    """The pairs of links that have to be kept apart.

    Attributes:
        constrained: pairs that programs keep apart by their capsules.
        excess: distance [m] by which the capsules of a pair are closer than its links at least,
            when these are as close as the margin. Not zero only for pairs whose capsules exclude
            more than 5 % of the sampled configurations without contact; found from eight times as
            many samples.
        exact_only: pairs whose capsules are too wide to constrain them: they would exclude more
            than a quarter of the configurations without contact, or, where the links hardly ever
            touch, more than 5 %. Their distance is computed from the exact geometry alone.
        in_contact: pairs of links that touch in nearly every configuration, as neighbours do, or
            are never more than 4 mm apart.
        exempt: pairs whose collisions a file disables (`disable_collisions` of an SRDF), each with
            its name. They are neither kept apart nor checked.
        reach: the largest distance [m] in the sampled configurations of each pair that never comes
            as far apart as twice the margin. Half of it is the margin of that pair.
        unknown: what is not known, a sentence each.
        solids: the links that the pairs are of.
    """

    constrained: tuple[Pair, ...]
    excess: tuple[float, ...]
    exact_only: tuple[Pair, ...]
    in_contact: tuple[Pair, ...]
    exempt: Mapping[Pair, str]
    reach: Mapping[Pair, float]
    unknown: tuple[str, ...]
    solids: PlacedSolids
    _shown = ("constrained", "exact_only", "unknown")

    def __str__(self) -> str:
        parts = [f"{len(self.constrained)} pairs of links are kept apart"]
        if self.exact_only:
            names = ", ".join(f"{one} to {other}" for one, other in self.exact_only)
            parts.append(f"capsules are too wide for the exact distances of {names}")
        for (one, other), reach in self.reach.items():
            away = f"{one} to {other}, which are at most {1e3 * reach:.3g} mm apart"
            parts.append(f"kept apart by {1e3 * _CAP * reach:.2g} mm: {away}")
        for file, count in Counter(self.exempt.values()).items():
            parts.append(f"{count} pairs are exempt, as {file} disables their collisions")
        return "; ".join([*parts, *self.unknown])

    def margin(self, one: str, other: str, margin: float) -> float:
        """Return the margin [m] of a pair: no more than half the largest distance it can have."""
        return min(margin, _CAP * self.reach.get((one, other), np.inf))


def link_pairs(
    arms: Model | Sequence[Model],
    placements: Sequence[Any] | None = None,
    *,
    margin: float = MARGIN,
) -> LinkPairs:
    """Return the pairs of links of one or several arms that have to be kept apart.

    Links that move relative to each other, except neighbours in the chain, those that touch in
    95 % of the sampled configurations, and those whose collisions the SRDF of the robot disables
    for another reason than "Default". Links that do not move, such as a torso, count as far as the
    arm can reach them. For two arms of one robot file the links of one are paired with those of the
    other; for other arms only with `placements`.

    >>> import geodesic_ocp as go
    >>> body = go.human_upper_body()
    >>> go.execution.link_pairs(body)
    LinkPairs(constrained=<30 entries>)

    Args:
        arms: a model, or several.
        placements: placements of the bases of the arms, see `combine`.
        margin: distance [m] that they will be kept apart.

    Raises:
        ValueError: no models, or wrong placements.
    """
    margin = as_number("margin", margin)
    placed = place_solids(arms, placements)
    models = placed.models
    poses = placed.joint_poses(sampled_configurations(models, _SAMPLES))
    many = cache(lambda: placed.joint_poses(sampled_configurations(models, _MORE_SAMPLES)))
    kept: dict[str, dict[Pair, float]] = {"constrained": {}, "exact_only": {}, "in_contact": {}}
    exempt = dict[Pair, str]()
    reaches = dict[Pair, float]()
    for one, other in combinations(placed.solids, 2):
        if not _can_meet(one, other, placed.placed):
            continue
        pair = one.name, other.name
        if file := _disabled_by(one, other, placed):
            exempt[pair] = file
            continue
        reach = _reach(one, other, margin / _CAP, poses)
        kind, excess = _kind(one, other, min(margin, _CAP * reach), poses, many)
        if reach <= _CLOSEST:
            kind = "in_contact"
        kept.setdefault(kind, {})[pair] = excess
        if kind in ("constrained", "exact_only") and reach < np.inf:
            reaches[pair] = reach
    return LinkPairs(
        tuple(kept["constrained"]),
        tuple(kept["constrained"].values()),
        tuple(kept["exact_only"]),
        tuple(kept["in_contact"]),
        exempt,
        reaches,
        placed.unknown,
        placed,
    )


def pairs_of(
    arms: Model | Sequence[Model],
    placements: Sequence[Any] | None,
    pairs: LinkPairs | None,
    margin: float = MARGIN,
) -> LinkPairs:
    """Return the given pairs, or those that `link_pairs` finds.

    Raises:
        ValueError: the pairs are those of other models.
    """
    if pairs is None:
        return link_pairs(arms, placements, margin=margin)
    if pairs.solids.models != ((arms,) if isinstance(arms, Model) else tuple(arms)):
        raise ValueError("pairs were found for other models than arms")
    return pairs


def _can_meet(one: PlacedSolid, other: PlacedSolid, placed: bool) -> bool:
    if not (one.moves or other.moves) or (one.arm != other.arm and not placed):
        return False
    if one.arm == other.arm and one.solid.joint == other.solid.joint:
        return False
    return one.name != other.parent and other.name != one.parent


def _disabled_by(one: PlacedSolid, other: PlacedSolid, placed: PlacedSolids) -> str:
    """Return the file that disables the collisions of two links; "" if none does."""
    geometry = placed.models[one.arm].shapes
    if not isinstance(geometry, LinkGeometry) or not (one.arm == other.arm or placed.one_robot):
        return ""
    return geometry.disabled.get(frozenset((one.solid.link, other.solid.link)), "")


def _reach(one: PlacedSolid, other: PlacedSolid, enough: float, poses: Sequence[Pose]) -> float:
    """Return the largest distance [m] of two links; infinite if it is enough."""
    distances = capsule_distances(one, other, poses).min(axis=0)
    farthest_first = np.argsort(-distances).tolist()
    if distances.max() > enough or not all(
        is_closer_at(one, other, poses, k, enough) for k in farthest_first
    ):
        return np.inf
    return max(exact_distance_at(one, other, poses, k) for k in range(len(distances)))


def _kind(
    one: PlacedSolid,
    other: PlacedSolid,
    margin: float,
    few: Sequence[Pose],
    many: Callable[[], Sequence[Pose]],
) -> tuple[str, float]:
    """Return how a pair is treated, and the excess."""
    distances = capsule_distances(one, other, few).min(axis=0)
    if np.mean(distances < margin) <= _SOME and not _one_joint_apart(one, other):
        return "constrained", 0.0  # whichever of them touch
    touching = _closer(one, other, few, distances, 0.0)
    if touching.mean() >= _ALWAYS:
        return "in_contact", 0.0
    if not touching.any() and _one_joint_apart(one, other):
        return "apart", 0.0
    if np.mean((distances < margin) & ~touching) <= _SOME:
        return "constrained", 0.0
    distances = capsule_distances(one, other, many()).min(axis=0)
    close = _closer(one, other, many(), distances, margin)
    if close.sum() < _ENOUGH:
        return "exact_only", 0.0
    excess = _KEPT * max(0.0, margin - float(distances[close].max()))
    excluded = np.mean((distances + excess < margin) & ~close)
    return ("exact_only" if excluded > _MANY else "constrained"), excess


def _closer(
    one: PlacedSolid, other: PlacedSolid, poses: Sequence[Pose], distances: Array, margin: float
) -> NDArray[np.bool_]:
    """Return where the links (k,) are closer than the margin, from the distances of capsules."""
    close = np.zeros(len(distances), dtype=bool)
    for k in np.flatnonzero(distances <= margin).tolist():
        close[k] = is_closer_at(one, other, poses, k, margin)
    return close


def _one_joint_apart(one: PlacedSolid, other: PlacedSolid) -> bool:
    """Return whether a single joint moves them relative to each other."""
    if not (one.moves and other.moves):
        return max(one.solid.parent_joint, other.solid.parent_joint) == 0
    if one.arm != other.arm:
        return False
    first, second = sorted((one.solid, other.solid), key=lambda solid: solid.joint)
    return second.parent_joint == first.joint


def sampled_configurations(models: Sequence[Model], count: int) -> Array:
    """Return configurations (count, N) within the limits of all joints.

    Unlimited joints take one revolution, or 1 m to either side.
    """
    lower, upper = (
        np.concatenate([getattr(m, side) for m in models]) for side in ("lower", "upper")
    )
    units = [unit for model in models for unit in model.units]
    half = np.array([np.pi if unit == "rad" else 1.0 for unit in units])
    lower = np.where(np.isfinite(lower), lower, np.minimum(-half, upper - 2.0 * half))
    upper = np.where(np.isfinite(upper), upper, np.maximum(half, lower + 2.0 * half))
    return np.random.default_rng(0).uniform(lower, upper, (count, lower.size))


@dataclass(frozen=True, eq=False)
class PlacedSolid:
    """A link with geometry.

    Attributes:
        arm: index of the model that has it.
        name: name of the link, unique among all arms.
        parent: name of the nearest link before it that has geometry; "" if there is none.
        solid: its geometry.
    """

    arm: int
    name: str
    parent: str
    solid: LinkSolid = field(repr=False)

    @property
    def moves(self) -> bool:
        """True if one of the joints moves it."""
        return self.solid.joint > 0

    def posed(self, poses: Sequence[Pose], sample: int) -> tuple[LinkSolid, Pose]:
        """Return the link with the pose of the joint that carries it, at one sample."""
        joint = self.solid.joint
        (rotations, positions) = poses[self.arm]
        return self.solid, (rotations[sample, joint], positions[sample, joint])


@dataclass(frozen=True, eq=False)
class PlacedSolids:
    """The links of one or several arms in a common base frame.

    Attributes:
        models: the arms.
        bases: poses of their bases in the common base frame.
        solids: their links with geometry; what several arms of one robot share is there once.
        placed: whether it is known where the arms are relative to each other.
        one_robot: whether they are different joints of one file.
        unknown: what is not known, a sentence each.
    """

    models: tuple[Model, ...]
    bases: tuple[Pose, ...]
    solids: tuple[PlacedSolid, ...] = field(repr=False)
    placed: bool
    one_robot: bool
    unknown: tuple[str, ...]

    @property
    def dof(self) -> int:
        """Number N of joints of all arms."""
        return sum(model.dof for model in self.models)

    @cached_property
    def by_name(self) -> dict[str, PlacedSolid]:
        """The links by their names."""
        return {each.name: each for each in self.solids}

    def joint_poses(self, q: Array) -> list[Pose]:
        """Return joint rotations (k, j, 3, 3) and positions (k, j, 3) of each arm at q (k, N)."""
        columns = np.split(q, np.cumsum([model.dof for model in self.models])[:-1], axis=1)
        own = [joint_poses(*each) for each in zip(self.models, columns, strict=True)]
        pairs = zip(self.bases, own, strict=True)
        return [(base @ turns, places @ base.T + at) for (base, at), (turns, places) in pairs]


def place_solids(
    arms: Model | Sequence[Model], placements: Sequence[Any] | None = None
) -> PlacedSolids:
    """Return the links of arms, placed as in `combine`.

    Args:
        arms: a model, or several.
        placements: for each the position of its base in the common base frame, (3,) [m], or a pair
            of rotation (3, 3) and position. None: known only if the arms are of one robot, that is
            of the same file, with different joints and the same base.

    Raises:
        ValueError: no arms, or wrong placements.
    """
    models = (arms,) if isinstance(arms, Model) else tuple(arms)
    if not models or not all(isinstance(model, Model) for model in models):
        raise ValueError(f"arms must be one or more models, got {models!r}")
    bases = base_placements(placements, len(models), "arms")
    names = [model.name for model in models]
    titles = [
        f"{name} {names[: k + 1].count(name)}" if names.count(name) > 1 else name
        for k, name in enumerate(names)
    ]
    found: list[tuple[int, LinkSolid]] = []
    unknown = []
    for arm, (model, title) in enumerate(zip(models, titles, strict=True)):
        solids: tuple[LinkSolid, ...] = ()
        reason = "its links have no geometry"
        try:
            solids = link_solids(model)
        except ValueError as error:
            reason = str(error)
        found += [(arm, solid) for solid in solids]
        if not any(solid.joint > 0 for solid in solids):
            unknown.append(f"clearance of {title} is not known: {reason}")
    is_one_robot = _is_one_robot(models, bases, found)
    if is_one_robot:
        # What they share is with the arm that moves it, or with the first one.
        owners: dict[str, int] = {}
        for arm, solid in found:
            if solid.joint > 0 or solid.link not in owners:
                owners[solid.link] = arm
        found = [(arm, solid) for arm, solid in found if owners[solid.link] == arm]
    placed = placements is not None or len(models) == 1 or is_one_robot
    if not placed:
        unknown.append(
            f"clearance between {' and '.join(titles)} is not known without the placements of "
            "their bases"
        )
    counts = Counter(solid.link for _, solid in found)

    def name(link: str, arm: int) -> str:
        return f"{titles[arm]}/{link}" if counts[link] > 1 else link

    named = [
        PlacedSolid(arm, name(solid.link, arm), name(solid.parent, arm), solid)
        for arm, solid in found
    ]
    reached = _within_reach(models, bases, named, placed)
    return PlacedSolids(models, bases, reached, placed, is_one_robot, tuple(unknown))


def _is_one_robot(
    models: Sequence[Model], bases: Sequence[Pose], found: Sequence[tuple[int, LinkSolid]]
) -> bool:
    """Return whether the models are different joints of one file, whose fixed links coincide."""
    shapes = [model.shapes for model in models]
    texts = {each.text if isinstance(each, LinkGeometry) else None for each in shapes}
    joints = [name for model in models for name in model.joint_names]
    if len(texts) != 1 or None in texts or len(set(joints)) < len(joints):
        return False
    places: dict[str, list[Array]] = {}
    for arm, solid in found:
        if solid.joint == 0:
            (base, origin) = bases[arm]
            own = solid.at_joint
            place = np.column_stack([base @ own.rotation, base @ own.translation + origin])
            places.setdefault(solid.link, []).append(place)
    shared = [each for each in places.values() if len(each) == len(models)]
    return all(np.ptp(each, axis=0).max() <= _SAME for each in shared)


def _within_reach(
    models: Sequence[Model], bases: Sequence[Pose], solids: Sequence[PlacedSolid], placed: bool
) -> tuple[PlacedSolid, ...]:
    """Return all links but the fixed ones that no moving link can reach, by the lengths of all
    links.
    """
    balls = []
    for arm, (model, (base, origin)) in enumerate(zip(models, bases, strict=True)):
        if moving := [each.solid for each in solids if each.arm == arm and each.moves]:
            centre, radius = reach_bound(model, moving)
            balls.append((arm, base @ centre + origin, radius))

    def is_reached(each: PlacedSolid) -> bool:
        rotation, position = bases[each.arm]
        return any(
            each.solid.least_distance(rotation.T @ (centre - position)) <= radius
            for arm, centre, radius in balls
            if placed or arm == each.arm
        )

    return tuple(each for each in solids if each.moves or is_reached(each))


def capsule_distances(one: PlacedSolid, other: PlacedSolid, poses: Sequence[Pose]) -> Array:
    """Get signed distances (c, k) [m] of all pairs of capsules of two links, at k sampled poses."""
    starts, ends, radii = _placed_capsules(one, poses)
    other_starts, other_ends, other_radii = _placed_capsules(other, poses)
    apart = segment_distances(
        starts[:, None], ends[:, None], other_starts[None, :], other_ends[None, :]
    )
    apart -= (radii[:, None] + other_radii[None, :])[..., None]
    return np.asarray(apart.reshape(-1, apart.shape[-1]))


def _placed_capsules(each: PlacedSolid, poses: Sequence[Pose]) -> tuple[Array, Array, Array]:
    """Return ends (c, k, 3) of the segments of a link's capsules, and radii (c,)."""
    rotation, position = (part[:, each.solid.joint] for part in poses[each.arm])
    capsules = each.solid.capsules
    ends = np.array([[capsule.start, capsule.end] for capsule in capsules])
    placed = np.einsum("kij,cej->ecki", rotation, ends) + position
    return placed[0], placed[1], np.array([capsule.radius for capsule in capsules])


def exact_distance_at(
    one: PlacedSolid, other: PlacedSolid, poses: Sequence[Pose], sample: int
) -> float:
    """Get distance [m] of two links at one sample, of their exact geometry; 0 if they overlap."""
    return exact_distance(*one.posed(poses, sample), *other.posed(poses, sample))


def is_closer_at(
    one: PlacedSolid, other: PlacedSolid, poses: Sequence[Pose], sample: int, margin: float
) -> bool:
    """Return whether two links are closer than a margin [m] at one sample, by exact geometry."""
    return is_closer(*one.posed(poses, sample), *other.posed(poses, sample), margin)


def as_configurations(name: str, value: ArrayLike, dof: int) -> Array:
    """Get the value as finite configurations (k, dof); ValueError names the argument otherwise."""
    q = np.asarray(value, dtype=float)
    if q.ndim != 2 or q.shape[1] != dof or not np.isfinite(q).all():
        raise ValueError(f"{name} must be finite, of shape (k, {dof}), got {q.shape}")
    return q
