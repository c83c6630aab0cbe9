"""Paths of all synergies of a motion, for all arms at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.progress import Progress, no_progress
from geodesic_ocp.retargeting.program.keep_apart import (
    keep_apart,
    lacking_distances,
    least_distances,
)
from geodesic_ocp.retargeting.program.motion_program import ArmPart
from geodesic_ocp.retargeting.program.refined import ProgramIterate, refined
from geodesic_ocp.retargeting.program.start import (
    Candidates,
    find_start,
    least_action,
    off_the_way,
    own_distances,
)
from geodesic_ocp.retargeting.program.waypoints import ArmWaypoints, ObjectiveWeights
from geodesic_ocp.trajectory.path import Path


@dataclass(frozen=True, eq=False, repr=False)
class PlannedPaths:
    """The solution of the program.

    Attributes:
        starts: configurations in which the arms begin.
        paths: of the movements of each arm.
        within_reach: which poses each arm attains, at its m + 1 waypoints: neither out of reach,
            nor with links too near each other.
        near_misses: which poses each arm misses on purpose, to avoid a detour.
        longer: time added to each interval between `edges`, relative.
        edges: times [s] in the recording at which a movement of any arm begins or ends.
        action: of all paths at constant speed and in the person's time [J s].
        iterations: of Ipopt, on all grids.
        segments: of the last grids.
        success: whether the program is solved.
        status: how Ipopt stopped, a sentence.
        kept: numbers of the distances that entered the program.
        least_distances: along the paths (m,) [m], in the order of the clearance; empty without one.
        too_near: names of the distances that fall below their bounds by more than a millimetre,
            each with by how much [m], and the time in the recording [s].
    """

    starts: tuple[Array, ...]
    paths: tuple[tuple[Path, ...], ...]
    within_reach: tuple[tuple[bool, ...], ...]
    near_misses: tuple[tuple[bool, ...], ...]
    longer: Array
    edges: Array
    action: float
    iterations: int
    segments: int
    success: bool
    status: str
    kept: tuple[int, ...]
    least_distances: Array
    too_near: tuple[tuple[str, float, float], ...]

    def __repr__(self) -> str:
        count = sum(len(each) for each in self.paths)
        return (
            f"PlannedPaths({count} paths of action {self.action:.4g} J s, {self.iterations} "
            f"iterations on up to {self.segments} segments, {self.status})"
        )


_SEGMENTS, _DEGREE = 2, 6  # of each movement, on the first grid
_DETOUR = 5.0  # weight of the hand's distance from the person's halfway, in the graph
_SIMILAR = 0.1  # [rad or m]
_SAME = 1e-3  # of the objective
_AT_REST = 1e-9  # action [J s]
_TOO_NEAR = 300.0  # of distances below their bounds, in the choice of a solution [1/m]


def plan_paths(
    arms: Sequence[ArmWaypoints],
    layers: Sequence[Sequence[Candidates]],
    *,
    stretch: float,
    posture: float,
    likeness: float,
    tolerance: float,
    clearance: Clearance | None = None,
    progress: Progress = no_progress,
) -> PlannedPaths:
    """Solve the program of all arms, from the shortest path in the graph of each.

    Args:
        arms: waypoints of each.
        layers: for each arm, configurations at each waypoint (`first_candidates`).
        stretch, posture, likeness: weights of `Terms`.
        tolerance: by which joint limits may be exceeded between nodes [rad or m].
        clearance: distances kept above their bounds; None: none.
        progress: called with the current step, the amount done and the total.
    """
    edges = np.unique(np.concatenate([[*arm.begins, *arm.ends] for arm in arms]))
    action = sum(least_action(arm, each) for arm, each in zip(arms, layers, strict=True))
    duration = float(edges[-1] - edges[0])
    unit = action if action > _AT_REST else 1.0
    weights = ObjectiveWeights(unit, duration, stretch, posture, likeness, _DETOUR)
    progress("choosing configurations", 0, 3)
    found: list[ProgramIterate] = []
    free: list[float] = []  # objectives without distances
    for number, start in enumerate(_starts(arms, layers, weights, clearance)):
        progress("planning all synergies", 1 + number, 3)
        iterate = refined(start, edges, weights, tolerance)
        if any(np.isclose(iterate.objective, each, rtol=_SAME) for each in free):
            continue  # it leads to the same paths
        free.append(iterate.objective)
        if clearance is not None and iterate.success:
            iterate = keep_apart(iterate, clearance, edges, weights, tolerance)
        found.append(iterate)
        if iterate.success and not lacking_distances(clearance, iterate):
            break
    iterate = min(found, key=lambda each: (not each.success, _score(each, weights, clearance)))
    pairs = list(zip(iterate.parts, iterate.nodes, strict=True))
    actions = [part.path(each).energy / part.moving_time for part, each in pairs]
    return PlannedPaths(
        starts=tuple(each[0] for each in iterate.nodes),
        paths=tuple(tuple(part.paths(each)) for part, each in pairs),
        within_reach=tuple(part.within_reach for part in iterate.parts),
        near_misses=iterate.near_misses,
        longer=np.zeros(edges.size - 1) if iterate.longer is None else iterate.longer,
        edges=edges,
        action=float(sum(actions)),
        iterations=sum(each.iterations for each in found),
        segments=sum(part.grid.segments for part in iterate.parts),
        success=iterate.success,
        status=iterate.status,
        kept=iterate.kept,
        least_distances=least_distances(clearance, iterate),
        too_near=lacking_distances(clearance, iterate),
    )


def _starts(
    arms: Sequence[ArmWaypoints],
    layers: Sequence[Sequence[Candidates]],
    weights: ObjectiveWeights,
    clearance: Clearance | None,
) -> Iterator[ProgramIterate]:
    """Straight lines between the best configurations, and between those that keep distances.

    The latter are tried if the program cannot move links apart from the former.
    """
    kept: list[list[Array]] = []
    for each in dict.fromkeys((None, clearance)):
        parts, nodes, lines = [], [], []
        for number, (arm, candidates) in enumerate(zip(arms, layers, strict=True)):
            start = find_start(arm, weights, candidates, own_distances(each, arms, number))
            parts.append(ArmPart.evenly(arm, start.missed, _SEGMENTS, _DEGREE))
            nodes.append(parts[-1].nodes_on_lines(start.q))
            lines.append(start.q)
        if not any(all(map(_similar, lines, others)) for others in kept):
            kept.append(lines)
            misses = tuple(tuple((part.missed > 0.0).tolist()) for part in parts)
            yield ProgramIterate(tuple(parts), tuple(nodes), None, near_misses=misses)


def _similar(one: Array, other: Array) -> bool:
    return bool(np.abs(one - other).max() < _SIMILAR)


def _score(
    iterate: ProgramIterate, weights: ObjectiveWeights, clearance: Clearance | None
) -> float:
    """The objective, detours of the hand, and distances below their bounds; less is better."""
    total = iterate.objective
    for part, nodes in zip(iterate.parts, iterate.nodes, strict=True):
        for number, path in enumerate(part.paths(nodes)):
            middle = np.atleast_2d(path(0.5))
            total += weights.detour * float(off_the_way(part.waypoints, number, middle)[0])
    return total + _TOO_NEAR * sum(amount for _, amount, _ in lacking_distances(clearance, iterate))
