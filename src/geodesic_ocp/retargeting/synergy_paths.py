"""Paths of all synergies of a motion, for all arms at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.clearance import Clearance, active_rows
from geodesic_ocp.ocp.refinement import unresolved_energy
from geodesic_ocp.progress import Progress, no_progress
from geodesic_ocp.retargeting.candidates import (
    Candidates,
    find_start,
    least_action,
    off_the_way,
    own_distances,
)
from geodesic_ocp.retargeting.paths_program import ArmPart, MotionProgram, positions_at
from geodesic_ocp.retargeting.waypoints import ArmWaypoints, ObjectiveWeights
from geodesic_ocp.trajectory.path import Path

_ROUNDS, _MOST_SEGMENTS = 12, 400
_RESOLVED = 1e-5  # of the energy
# With distances, which are kept at instants and make corners; and the number of grids on which it
# also counts how well the paths are resolved.
_RESOLVED_APART, _ROUNDS_APART = 1e-3, 3
_BETWEEN = np.array([0.25, 0.5, 0.75])  # of the way from node to node, where limits are checked
_TINY = 1e-12
_NO_ROWS: Mapping[tuple[int, float], float] = {}


@dataclass(frozen=True, eq=False)
class ProgramIterate:
    """Arms on their grids, positions at the nodes, relative times added, and how it was found."""

    parts: tuple[ArmPart, ...]
    nodes: tuple[Array, ...]
    longer: Array | None
    objective: float = np.inf
    iterations: int = 0
    kept: tuple[int, ...] = ()
    near_misses: tuple[tuple[bool, ...], ...] = ()
    success: bool = False
    status: str = ""


def refined(
    iterate: ProgramIterate,
    edges: Array,
    weights: ObjectiveWeights,
    tolerance: float,
    rows: Mapping[tuple[int, float], float] = _NO_ROWS,
    clearance: Clearance | None = None,
) -> ProgramIterate:
    """The solution on grids that resolve the paths, with these distances at these instants."""
    is_near = iterate.success
    for number in range(_ROUNDS):
        program = MotionProgram(iterate.parts, edges, weights, clearance, rows)
        start = program.guess(iterate.nodes, iterate.longer)
        outcome = program.solve(start, near=is_near)
        spent = iterate.iterations + outcome.iterations
        if not outcome.success and is_near:  # from the same start, with larger steps
            outcome = program.solve(start)
            spent += outcome.iterations
        nodes, longer = program.split(outcome.x)
        iterate = replace(
            iterate,
            nodes=tuple(nodes) if outcome.success else iterate.nodes,
            longer=longer if outcome.success else iterate.longer,
            objective=outcome.objective if outcome.success else iterate.objective,
            iterations=spent,
            success=outcome.success,
            status=outcome.status,
        )
        if not outcome.success:
            return iterate
        resolved = _RESOLVED
        if rows:  # then joint limits alone
            resolved = _RESOLVED_APART if number < _ROUNDS_APART else np.inf
        coarse = [
            _coarse(*pair, tolerance, resolved) for pair in zip(iterate.parts, nodes, strict=True)
        ]
        segments = sum(part.grid.segments for part in iterate.parts)
        if not any(np.any(each) for each in coarse):
            return iterate
        if segments + sum(int(each.sum()) for each in coarse) > _MOST_SEGMENTS:
            break
        finer = tuple(part.halved(each) for part, each in zip(iterate.parts, coarse, strict=True))
        on_finer = tuple(
            part.path(each)(fine.grid.nodes)
            for part, fine, each in zip(iterate.parts, finer, nodes, strict=True)
        )
        iterate, is_near = replace(iterate, parts=finer, nodes=on_finer), True
    status = f"not solved to {tolerance:g} on {segments} segments"
    return replace(iterate, success=False, status=status)


def _coarse(part: ArmPart, nodes: Array, tolerance: float, resolved: float) -> NDArray[np.bool_]:
    """Which segments to halve, (segments,)."""
    path, grid = part.path(nodes), part.grid
    unresolved = unresolved_energy(path) / max(path.energy, _TINY)
    coarse = unresolved > resolved / grid.segments
    if part.waypoints.limited:
        own = grid.nodes[: grid.degree + 1] / grid.widths[0]  # nodes are denser at the ends
        local = (own[:-1, None] + np.diff(own)[:, None] * _BETWEEN).ravel()
        s = (grid.breakpoints[:-1, None] + grid.widths[:, None] * local).ravel()
        q, arm = path(s), part.waypoints.arm
        excess = np.maximum(arm.lower - q, q - arm.upper).max(axis=1)
        coarse |= excess.reshape(grid.segments, -1).max(axis=1) > tolerance
    return np.asarray(coarse)


_INSTANTS = 24  # of a movement at which distances are checked
_DISTANCE_ROUNDS = 6
_HOPELESS = 0.8  # of what distances lacked before a round, that they still lack after it
_ROUNDING = 1e-4  # [m] by which a distance may fall below its bound between those instants
_BELOW = 1e-3  # [m] by which a distance falls below its bound before that is reported
# Weight of the squared error of a pose at which links are too near [1/m^2] or [1/rad^2].
_YIELDING = 50.0


def keep_apart(
    iterate: ProgramIterate,
    clearance: Clearance,
    edges: Array,
    weights: ObjectiveWeights,
    tolerance: float,
) -> ProgramIterate:
    """The solution with all distances above their bounds, or the last one that was found.

    Only those distances enter the program that are below their bounds at some instants, and only
    at these instants. Where that does not help, poses at which links are too near are replaced by
    the nearest ones at which they are not.
    """
    rows: dict[tuple[int, float], float] = {}
    free, lacking = iterate, np.inf
    for _ in range(_DISTANCE_ROUNDS):
        more, lacks = _too_near(clearance, iterate)
        if not more:
            break
        if not more.keys() - rows.keys() or lacks > _HOPELESS * lacking:
            missed = _yielding(clearance, iterate)
            if missed is None:
                break
            # From the paths without distances, as poses that cannot be attained have led astray.
            parts = zip(free.parts, missed, strict=True)
            free = replace(free, parts=tuple(replace(part, missed=each) for part, each in parts))
            iterate, lacks = replace(free, iterations=iterate.iterations), np.inf
        rows, lacking = rows | more, lacks
        found = refined(iterate, edges, weights, tolerance, rows, clearance)
        if not found.success:
            return replace(iterate, iterations=found.iterations)
        iterate = replace(found, kept=tuple(sorted({number for number, _ in rows})))
    return iterate


def _yielding(clearance: Clearance, iterate: ProgramIterate) -> list[Array] | None:
    """Weights of missed poses, with those at which links are too near; None if there are no new."""
    every, any_new = [], False
    for part in iterate.parts:
        given = part.waypoints
        times = np.append(given.begins[0], given.ends)
        q = positions_at(iterate.parts, iterate.nodes, times)
        active = active_rows(clearance, q, -_BELOW)
        found = clearance.function.map(len(q))(q.T).full()[active.rows, active.samples]
        near = np.zeros(times.size, dtype=bool)
        near[active.samples[active.lower - found > 0.0]] = True
        new = near & (part.missed == 0.0)
        new[0] &= given.start is None
        every.append(np.where(new, _YIELDING, part.missed))
        any_new |= bool(new.any())
    return every if any_new else None


def _positions(iterate: ProgramIterate) -> tuple[Array, Array]:
    """Instants (k,) [s] within the movements, and the joints of all arms there (k, N)."""
    instants = np.unique(
        np.concatenate(
            [
                np.linspace(begin, end, _INSTANTS)
                for part in iterate.parts
                for begin, end in zip(part.waypoints.begins, part.waypoints.ends, strict=True)
            ]
        ).round(9)
    )
    return instants, positions_at(iterate.parts, iterate.nodes, instants)


def _too_near(
    clearance: Clearance, iterate: ProgramIterate
) -> tuple[dict[tuple[int, float], float], float]:
    """Bounds of the distances that enter the program, by number and instant; what they lack [m].

    Where each lacks most, and around; the sum is that of the most that each lacks.
    """
    instants, q = _positions(iterate)
    active = active_rows(clearance, q, -_ROUNDING)
    distances = clearance.function.map(len(q))(q.T).full()
    found: dict[tuple[int, float], float] = {}
    total = 0.0
    for row in np.unique(active.rows).tolist():
        here = active.rows == row
        lower = np.full(len(q), -np.inf)
        lower[active.samples[here]] = active.lower[here]
        lacks = np.pad(lower - distances[row], 1, constant_values=-np.inf)
        peaks = (lacks[1:-1] >= lacks[:-2]) & (lacks[1:-1] >= lacks[2:]) & np.isfinite(lower)
        around = peaks | np.append(peaks[1:], False) | np.append(False, peaks[:-1])
        for sample in np.flatnonzero(around & np.isfinite(lower)).tolist():
            found[row, float(instants[sample])] = float(lower[sample]) + _ROUNDING
        total += float(lacks.max())
    return found, total


def lacking_distances(
    clearance: Clearance | None, iterate: ProgramIterate
) -> tuple[tuple[str, float, float], ...]:
    """Distances below their bounds, the worst first: name, amount [m], time [s]."""
    if clearance is None:
        return ()
    instants, q = _positions(iterate)
    active = active_rows(clearance, q, -_BELOW)
    values = clearance.function.map(len(q))(q.T).full()[active.rows, active.samples]
    worst: dict[str, tuple[str, float, float]] = {}
    for index in np.argsort(values - active.lower):
        name = clearance.names[int(active.rows[index])]
        amount = float(active.lower[index] - values[index])
        worst.setdefault(name, (name, amount, float(instants[active.samples[index]])))
    return tuple(worst.values())


def least_distances(clearance: Clearance | None, iterate: ProgramIterate) -> Array:
    """Least distances (m,) along the paths."""
    if clearance is None:
        return np.zeros(0)
    _, q = _positions(iterate)
    return np.asarray(clearance.function.map(len(q))(q.T).full().min(axis=1))


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
_LACKING = 300.0  # of distances below their bounds, in the choice of a solution [1/m]


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
    return total + _LACKING * sum(amount for _, amount, _ in lacking_distances(clearance, iterate))
