"""The pairs of links that have to be kept apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, as_number
from geodesic_ocp.execution.clearance.placed_solids import PlacedSolid, PlacedSolids, place_solids
from geodesic_ocp.execution.clearance.sampled_distances import capsule_distances, pose_at
from geodesic_ocp.model.link_solids import Pose, is_closer
from geodesic_ocp.model.model import Model

MARGIN = 0.01  # [m]
SAMPLES = 256
_ALWAYS, _SOME, _MANY = 0.95, 0.05, 0.25  # shares of the sampled configurations
_KEPT = 0.75  # of an excess, as no sample is the worst case
_MORE_SAMPLES, _ENOUGH = 8, 8  # times as many samples, and close ones, for an excess

Pair = tuple[str, str]


@dataclass(frozen=True, eq=False, repr=False)
class LinkPairs:
    """The pairs of links that have to be kept apart.

    Attributes:
        constrained: pairs that programs keep apart by their capsules.
        excess: by how much [m] the capsules of each of them are closer than its links at least,
            when these are as close as the margin. Not zero only for pairs whose capsules exclude
            more than 5 % of the sampled configurations without contact; found from eight times as
            many samples.
        exact_only: pairs whose capsules are too wide to constrain them: they would exclude more
            than a quarter of the configurations without contact, or, where the links hardly ever
            touch, more than 5 %. Their distance is computed from the exact geometry alone.
        in_contact: pairs of links that touch in nearly every configuration, as neighbours do.
        unknown: what is not known, a sentence each.
        solids: the links that the pairs are of.
    """

    constrained: tuple[Pair, ...]
    excess: tuple[float, ...]
    exact_only: tuple[Pair, ...]
    in_contact: tuple[Pair, ...]
    unknown: tuple[str, ...]
    solids: PlacedSolids = field(repr=False)

    def __repr__(self) -> str:
        counts = len(self.constrained), len(self.exact_only)
        return f"LinkPairs({counts[0]} constrained, {counts[1]} by exact distances only)"

    def __str__(self) -> str:
        parts = [f"{len(self.constrained)} pairs of links are kept apart"]
        if self.exact_only:
            names = ", ".join(f"{one} to {other}" for one, other in self.exact_only)
            parts.append(f"checked and not constrained, as capsules are too wide for them: {names}")
        return "; ".join([*parts, *self.unknown])


def link_pairs(
    arms: Model | Sequence[Model],
    placements: Sequence[Any] | None = None,
    *,
    margin: float = MARGIN,
    samples: int = SAMPLES,
) -> LinkPairs:
    """The pairs of links of one or several arms that have to be kept apart.

    Links that move relative to each other, except neighbours in the chain and those that touch in
    95 % of the sampled configurations. Links that do not move, such as a torso, count as far as the
    arm can reach them. For two arms of one robot file the links of one are paired with those of the
    other; for other arms only with `placements`.

    Args:
        arms: a model, or several.
        placements: of the bases of the arms, see `combine`.
        margin: distance [m] that they will be kept apart.
        samples: number of configurations within the joint limits at which links are compared.

    Raises:
        ValueError: no models, or wrong placements or number of samples.
    """
    if isinstance(samples, bool) or not isinstance(samples, int) or samples < 1:
        raise ValueError(f"samples must be a positive integer, got {samples!r}")
    margin = as_number("margin", margin)
    models = (arms,) if isinstance(arms, Model) else tuple(arms)
    placed = place_solids(models, placements)
    candidates = [
        (one, other)
        for index, one in enumerate(placed.solids)
        for other in placed.solids[index + 1 :]
        if _can_meet(one, other, placed.placed)
    ]
    poses = placed.joint_poses(sampled_configurations(models, samples))
    many = cache(
        lambda: placed.joint_poses(sampled_configurations(models, _MORE_SAMPLES * samples))
    )
    kept: dict[str, dict[Pair, float]] = {"constrained": {}, "exact_only": {}, "in_contact": {}}
    for one, other in candidates:
        if (found := _kind(one, other, margin, poses, many)) is not None:
            kind, excess = found
            kept[kind][one.name, other.name] = excess
    return LinkPairs(
        tuple(kept["constrained"]),
        tuple(kept["constrained"].values()),
        tuple(kept["exact_only"]),
        tuple(kept["in_contact"]),
        placed.unknown,
        placed,
    )


def sampled_configurations(models: Sequence[Model], count: int) -> Array:
    """Configurations (count, N) within the limits of all joints, evenly spread.

    Unlimited joints take one revolution, or 1 m to either side.
    """
    lower, upper = (
        np.concatenate([getattr(m, side) for m in models]) for side in ("lower", "upper")
    )
    units = [unit for model in models for unit in model.units]
    half = np.array([np.pi if unit == "rad" else 1.0 for unit in units])
    lower = np.where(np.isfinite(lower), lower, np.minimum(-half, upper - 2.0 * half))
    upper = np.where(np.isfinite(upper), upper, np.maximum(half, lower + 2.0 * half))
    power = int(np.ceil(np.log2(count)))
    points = scipy.stats.qmc.Sobol(len(lower), seed=0).random_base2(power)[:count]
    return np.asarray(lower + (upper - lower) * points)


def _can_meet(one: PlacedSolid, other: PlacedSolid, placed: bool) -> bool:
    if not (one.moves or other.moves) or (one.arm != other.arm and not placed):
        return False
    if one.arm == other.arm and one.solid.joint == other.solid.joint:
        return False
    return one.name != other.parent and other.name != one.parent


def _kind(
    one: PlacedSolid,
    other: PlacedSolid,
    margin: float,
    few: Sequence[Pose],
    many: Callable[[], Sequence[Pose]],
) -> tuple[str, float] | None:
    """How a pair is treated, and the excess; None if it needs none, as one joint decides it."""
    distances, touching = _compared(one, other, few, 0.0)
    if touching.mean() >= _ALWAYS:
        return "in_contact", 0.0
    if not touching.any() and _one_joint_apart(one, other):
        return None
    if np.mean((distances < margin) & ~touching) <= _SOME:
        return "constrained", 0.0
    distances, close = _compared(one, other, many(), margin)
    if close.sum() < _ENOUGH:
        return "exact_only", 0.0
    excess = _KEPT * max(0.0, margin - float(distances[close].max()))
    excluded = np.mean((distances + excess < margin) & ~close)
    return ("exact_only" if excluded > _MANY else "constrained"), excess


def _compared(
    one: PlacedSolid, other: PlacedSolid, poses: Sequence[Pose], margin: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Distances (k,) [m] of the capsules, and where the links are closer than the margin."""
    distances = capsule_distances(one, other, poses).min(axis=0)
    close = np.zeros(len(distances), dtype=bool)
    for k in np.flatnonzero(distances <= margin).tolist():
        at = pose_at(one, poses, k), pose_at(other, poses, k)
        close[k] = is_closer(one.solid, at[0], other.solid, at[1], margin)
    return distances, close


def _one_joint_apart(one: PlacedSolid, other: PlacedSolid) -> bool:
    """Whether a single joint moves them relative to each other, so that samples are dense."""
    if not (one.moves and other.moves):
        return max(one.solid.parent_joint, other.solid.parent_joint) == 0
    if one.arm != other.arm:
        return False
    first, second = sorted((one.solid, other.solid), key=lambda solid: solid.joint)
    return second.parent_joint == first.joint
