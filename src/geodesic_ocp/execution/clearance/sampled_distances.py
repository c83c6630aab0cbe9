"""Distances of capsules of links at sampled configurations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.clearance.placed_solids import PlacedSolid
from geodesic_ocp.model.distances import segment_distances
from geodesic_ocp.model.link_solids import Pose


def capsule_distances(one: PlacedSolid, other: PlacedSolid, poses: Sequence[Pose]) -> Array:
    """Signed distances (c, k) [m] of all pairs of capsules of two links, at k sampled poses."""
    starts, ends, radii = _placed_capsules(one, poses)
    other_starts, other_ends, other_radii = _placed_capsules(other, poses)
    apart = segment_distances(
        starts[:, None], ends[:, None], other_starts[None, :], other_ends[None, :]
    )
    apart -= (radii[:, None] + other_radii[None, :])[..., None]
    return np.asarray(apart.reshape(-1, apart.shape[-1]))


def _placed_capsules(each: PlacedSolid, poses: Sequence[Pose]) -> tuple[Array, Array, Array]:
    """Ends (c, k, 3) of the segments of a link's capsules, and radii (c,)."""
    rotations, positions = poses[each.arm]
    rotation, position = rotations[:, each.solid.joint], positions[:, each.solid.joint]
    capsules = each.solid.capsules
    starts = np.array([capsule.start for capsule in capsules])
    ends = np.array([capsule.end for capsule in capsules])
    radii = np.array([capsule.radius for capsule in capsules])
    return (
        np.einsum("kij,cj->cki", rotation, starts) + position,
        np.einsum("kij,cj->cki", rotation, ends) + position,
        radii,
    )


def pose_at(each: PlacedSolid, poses: Sequence[Pose], sample: int) -> Pose:
    """Rotation (3, 3) and position (3,) [m] of the joint that carries a link, at one sample."""
    rotations, positions = poses[each.arm]
    return rotations[sample, each.solid.joint], positions[sample, each.solid.joint]
