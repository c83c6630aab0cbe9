"""Exact distances between the links of robots over a trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_integer
from geodesic_ocp.execution.link_pairs import (
    LinkPairs,
    PlacedSolid,
    capsule_distances,
    link_pairs,
    pose_at,
)
from geodesic_ocp.model.link_solids import Pose, exact_distance
from geodesic_ocp.model.model import Model
from geodesic_ocp.table import Table
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

_SHOWN = 5
_COARSE, _FINE = 0.05, 0.01  # accuracy of distances, relative
_ABSOLUTE = 1e-4  # [m]


@dataclass(frozen=True)
class ClosestApproach:
    """Where two links are closest.

    Attributes:
        one, other: names of the links.
        distance: between them [m]; 0 if they touch or overlap.
        sample: index of the configuration.
        time: of the sample [s]; None if the trajectory has no times.
    """

    one: str
    other: str
    distance: float
    sample: int
    time: float | None


@dataclass(frozen=True, eq=False, repr=False)
class ClearanceReport:
    """How close the links of robots come to each other over a trajectory.

    Attributes:
        closest: the closest pairs of links, the closest first.
        pairs: number of pairs that were compared.
        samples: number of configurations.
        unknown: what is not known, a sentence each.
    """

    closest: tuple[ClosestApproach, ...]
    pairs: int
    samples: int
    unknown: tuple[str, ...] = field(default=())

    def __repr__(self) -> str:
        if not self.closest:
            return f"ClearanceReport(not known: {'; '.join(self.unknown)})"
        one, other = self.closest[0].one, self.closest[0].other
        found = f"{one} to {other} {self.least:.4g} m, the least of {self.pairs} pairs"
        return f"ClearanceReport({'; '.join([found, *self.unknown])})"

    def __str__(self) -> str:
        return str(self.table())

    @property
    def least(self) -> float | None:
        """Least distance of any two links [m], 0 if some touch; None if it is not known."""
        return self.closest[0].distance if self.closest else None

    @property
    def pair(self) -> tuple[str, str] | None:
        """The links that come closest; None if it is not known."""
        return (self.closest[0].one, self.closest[0].other) if self.closest else None

    @property
    def time(self) -> float | None:
        """When they come closest [s]; None if it is not known."""
        return self.closest[0].time if self.closest else None

    def table(self) -> Table:
        """The closest pairs, with what is not known as a note."""
        rows = tuple(
            (
                f"{each.one} to {each.other}",
                each.distance,
                each.sample if each.time is None else each.time,
            )
            for each in self.closest
        )
        instant = "sample" if any(each.time is None for each in self.closest) else "time [s]"
        note = " ".join(f"{each[:1].upper()}{each[1:]}." for each in self.unknown)
        return Table(("links", "distance [m]", instant), rows, note)

    def _repr_markdown_(self) -> str:
        return self.table().markdown()


def trajectory_clearance(
    arms: Model | Sequence[Model],
    trajectory: JointTrajectory | ArrayLike,
    placements: Sequence[Any] | None = None,
    *,
    pairs: LinkPairs | None = None,
    closest: int = _SHOWN,
) -> ClearanceReport:
    """The closest pairs of links at the samples of a trajectory, by their exact geometry.

    Distances between meshes are computed by coal only where the capsules around the links, and how
    far they have moved since a sample whose distance is known, leave room for a closer approach.

    Args:
        arms: a model, or several.
        trajectory: of the joints of all arms, one after the other, or configurations (k, N).
        placements: of the bases of the arms, see `link_pairs`.
        pairs: the result of `link_pairs` for these arms; None: found here.
        closest: number of pairs to report.

    Returns:
        The least distance to 1 % and 0.1 mm, the others to 5 %; what is not known, as for links
        without geometry, is said there.

    Raises:
        ValueError: not N columns, numbers that are not finite, or pairs of other models.
    """
    models = (arms,) if isinstance(arms, Model) else tuple(arms)
    closest = as_integer("closest", closest, 1)
    if pairs is None:
        pairs = link_pairs(models, placements)
    placed = pairs.solids
    if placed.models != models:
        raise ValueError("pairs were found for other models than arms")
    time = trajectory.time if isinstance(trajectory, JointTrajectory) else None
    given = trajectory.positions if isinstance(trajectory, JointTrajectory) else trajectory
    q = np.asarray(given, dtype=float)
    if q.ndim != 2 or q.shape[1] != placed.dof or not len(q) or not np.isfinite(q).all():
        raise ValueError(f"trajectory must be finite, of shape (k, {placed.dof}), got {q.shape}")
    poses = placed.joint_poses(q)
    by_name = {each.name: each for each in placed.solids}
    candidates = []
    for one, other in (*pairs.constrained, *pairs.exact_only):
        pair = by_name[one], by_name[other]
        candidates.append((capsule_distances(*pair, poses).min(axis=0), pair))
    candidates.sort(key=lambda entry: float(entry[0].min()))
    found: list[_Candidate] = []
    for bounds, pair in candidates:
        if len(found) >= closest and bounds.min() >= found[closest - 1].distance:
            break
        found.append(_Candidate(bounds, pair, *_closest(*pair, poses, bounds, _COARSE)))
        found.sort(key=lambda each: each.distance)
    while found and not found[0].is_fine:
        bounds, pair = found[0].bounds, found[0].pair
        found[0] = _Candidate(bounds, pair, *_closest(*pair, poses, bounds, _FINE), True)
        found.sort(key=lambda each: each.distance)
    approaches = tuple(
        ClosestApproach(
            *(each.pair[0].name, each.pair[1].name),
            each.distance,
            each.sample,
            None if time is None else float(time[each.sample]),
        )
        for each in found[:closest]
    )
    unknown = pairs.unknown or (() if candidates else ("no two links can meet",))
    return ClearanceReport(approaches, len(candidates), len(q), unknown)


class _Candidate(NamedTuple):
    """Two links, lower bounds (k,) [m] of their distance, and the least one that was found."""

    bounds: Array
    pair: tuple[PlacedSolid, PlacedSolid]
    distance: float
    sample: int
    is_fine: bool = False


def _closest(
    one: PlacedSolid, other: PlacedSolid, poses: Sequence[Pose], bounds: Array, accuracy: float
) -> tuple[float, int]:
    """Least distance [m] of two links and the sample at which they have it.

    Args:
        one, other: the links.
        poses: of all joints, see `PlacedSolids.joint_poses`.
        bounds: lower bounds (k,) [m].
        accuracy: of the distance, relative.
    """
    bounds = bounds.copy()
    rotations, positions, extent = _relative_motion(one, other, poses)
    best, where = float(np.finfo(float).max), 0
    while best > 0.0 and bounds.min() < (1.0 - accuracy) * best - _ABSOLUTE:
        sample = int(bounds.argmin())
        distance = exact_distance(
            one.solid, pose_at(one, poses, sample), other.solid, pose_at(other, poses, sample)
        )
        if distance < best:
            best, where = distance, sample
        # No point of the link has moved further than this since the sample.
        turned = np.linalg.norm(rotations - rotations[sample], axis=(1, 2)) / np.sqrt(2.0)
        moved = np.linalg.norm(positions - positions[sample], axis=1) + turned * extent
        bounds = np.maximum(bounds, distance - moved)
        bounds[sample] = np.inf
    return best, where


def _relative_motion(
    one: PlacedSolid, other: PlacedSolid, poses: Sequence[Pose]
) -> tuple[Array, Array, float]:
    """Rotations (k, 3, 3), positions (k, 3) and extent [m] of a link, seen from the other one.

    Of the two links that with the smaller extent is seen from the other.
    """
    seen, seer = sorted((one, other), key=lambda each: each.solid.extent)
    rotation, position = (part[:, seen.solid.joint] for part in poses[seen.arm])
    base, origin = (part[:, seer.solid.joint] for part in poses[seer.arm])
    inverse = base.transpose(0, 2, 1)
    positions = np.einsum("kij,kj->ki", inverse, position - origin)
    return inverse @ rotation, positions, seen.solid.extent
