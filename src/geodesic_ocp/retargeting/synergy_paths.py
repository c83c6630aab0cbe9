"""Synergies of a motion on robots: paths of least energy through the hand's poses, all at once.

`paths_program` has the nonlinear program, which is solved in rounds: on grids that resolve the
paths, then with the distances that were too small, at the instants at which they were.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.blocks import in_rounds
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.execution.clearance import Clearance, active_rows, joined_clearance
from geodesic_ocp.manifold.metrics import KineticEnergy, metric_of
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.problem import Equality, Inequality, Problem, key_of
from geodesic_ocp.ocp.refinement import unresolved_energy, worst_by_segment
from geodesic_ocp.ocp.violations import path_samples
from geodesic_ocp.progress import Progress, no_progress
from geodesic_ocp.retargeting.candidates import (
    AT_REST,
    DETOUR,
    Candidates,
    find_start,
    first_candidates,
    least_action,
    off_the_way,
    own_lacks,
)
from geodesic_ocp.retargeting.paths_program import ArmPart, MotionProgram, positions_at
from geodesic_ocp.retargeting.waypoints import ArmWaypoints, ObjectiveWeights
from geodesic_ocp.trajectory.path import Path

# of each movement, on the first grid
_SEGMENTS = 2
_DEGREE = 6
_SIMILAR = 0.1  # [rad or m]
_SAME = 1e-3  # of the objective
_LACKING = 300.0  # of distances below their bounds, in the choice of a solution [1/m]
_ROUNDS = 12
_MOST_SEGMENTS = 400
_RESOLVED = 1e-4  # of the energy
# With distances, which are kept at instants and make corners; and the number of grids on which it
# also counts how well the paths are resolved.
_RESOLVED_APART = 1e-3
_ROUNDS_APART = 3
_TINY = 1e-12
_INSTANTS = 24  # of a movement at which distances are checked
_DISTANCE_ROUNDS = 6
_HOPELESS = 0.8  # of what distances lacked before a round, that they still lack after it
_ROUNDING = 1e-4  # [m] by which a distance may fall below its bound between those instants
_BELOW = 1e-3  # [m] by which a distance falls below its bound before that is reported
# Weight of the squared error of a pose at which links are too near [1/m^2] or [1/rad^2].
_YIELDING = 500.0

# Lower bounds [m] of distances, by their number in the clearance and the time in the recording [s].
Rows = Mapping[tuple[int, float], float]
# Distances below their bounds: name, amount [m], time [s].
_Lacking: TypeAlias = tuple[tuple[str, float, float], ...]


# Of a model, its joints q and v = q'(s), s from 0 to 1 over the time in which the arm moves.
ArmCost: TypeAlias = Callable[[Model, ca.SX, ca.SX], Any]
ArmConstraints: TypeAlias = Callable[[Model, ca.SX, ca.SX], Sequence[Inequality]]


def plan_synergies(
    arms: Sequence[ArmWaypoints],
    candidates: Sequence[tuple[Candidates, ...]] | None = None,
    *,
    clearance: Clearance | None = None,
    stretch: float = 5.0,
    posture: float = 0.0,
    likeness: float = 30.0,
    tolerance: float = 1e-6,
    cost: ArmCost | None = None,
    constraints: ArmConstraints | None = None,
    throw: bool = True,
    progress: Progress | None = None,
) -> PlannedPaths:
    """Plan paths of arms through the poses of a person's hand, all of a motion at once.

    Minimized are the action of all paths, the time that the limits on speed add, and terms of
    posture and of likeness to the person, over the paths and over the configurations in which they
    meet.

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> arm = go.human_arm("left", height=1.78)
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv", arm.joint_names)
    >>> reach = go.Motion(motion.time[270:430], motion.q[270:430], motion.joint_names)
    >>> robot = go.human_arm("left", height=1.95)
    >>> limits = go.execution.joint_limits(robot, velocity=8.0)  # [rad/s]
    >>> found = go.retarget(go.analyse(arm, reach), robot, limits=limits, tolerance=1e-3)
    >>> slow_wrist = lambda model, q, v: 0.1 * v[6] ** 2
    >>> again = go.retargeting.plan_synergies(found.paths.program.arms, cost=slow_wrist)
    >>> again.success
    True

    Args:
        arms: waypoints of each arm, as `retarget` makes them of a person's synergies.
        candidates: for each arm, configurations at each waypoint; None: those that attain its pose.
        clearance: distances to be kept; None: none.
        stretch, posture, likeness: weights, see `RetargetingSettings`.
        tolerance: tolerance of limits and constraints between the nodes, each in its unit.
        cost: running cost that is added to the energy: a function of the model of an arm, its
            joints q and v = q'(s), called for each arm; s goes from 0 to 1 over the time in which
            it moves.
        constraints: likewise a function that returns bounds (lower, expression, upper[, name]) in
            addition to the limits of the joints.
        throw: raise NotConverged if there are no such paths; else the result says so.
        progress: called with the current step, the amount done and the total.

    Raises:
        ValueError: an argument is malformed.
        NotConverged: the program was not solved; its `solution` has the last iterate.
    """
    program = SynergyPaths(
        arms=tuple(arms),
        candidates=None if candidates is None else tuple(candidates),
        clearance=clearance,
        stretch=stretch,
        posture=posture,
        likeness=likeness,
        tolerance=tolerance,
        cost=cost,
        constraints=constraints,
        progress=progress,
    )
    found = program.planned()
    if throw and not found.success:
        raise NotConverged(f"the synergies were not planned: {found.status}", found)
    return found


@dataclass(frozen=True, eq=False, repr=False)
class ArmProblem(Problem):
    """The energy of an arm, and what holds along its paths besides their ends.

    Attributes:
        waypoints: of the arm.
        own_cost, own_constraints: the user's.
    """

    waypoints: ArmWaypoints
    own_cost: ArmCost | None = None
    own_constraints: ArmConstraints | None = None

    @property
    def metric(self) -> KineticEnergy:  # type: ignore[override]
        """Kinetic energy of the arm."""
        return metric_of(self.waypoints.arm)

    @property
    def structure(self) -> Hashable | None:
        """Problems without costs and constraints of their own share the derivatives of energy."""
        is_plain = self.own_cost is None and self.own_constraints is None
        return key_of(self.metric) if is_plain else None

    def boundary(self, q0: ca.SX, q1: ca.SX) -> Sequence[Equality]:
        """Return the configuration to begin in, if one is given."""
        start = self.waypoints.start
        return [] if start is None else [(q0, start, "start")]

    def cost(self, q: ca.SX, v: ca.SX) -> Any:
        """Return the user's running cost."""
        return 0.0 if self.own_cost is None else self.own_cost(self.waypoints.arm, q, v)

    def constraints(self, q: ca.SX, v: ca.SX) -> Sequence[Inequality]:
        """Return limits of the joints, and the user's constraints."""
        given = self.waypoints
        found: list[Inequality] = []
        if given.limited:
            lower, upper = given.path_limits
            if given.start is not None:
                lower = np.minimum(lower, given.start)
                upper = np.maximum(upper, given.start)
            found.append((lower, q, upper, "joint limits"))
        own = self.own_constraints
        return found if own is None else [*found, *own(given.arm, q, v)]


@dataclass(frozen=True, eq=False, repr=False)
class PlannedPaths(ShortRepr):
    """Paths that `plan_synergies` has planned.

    Attributes:
        program: what was planned.
        paths: paths of the movements of each arm.
        within_reach: which poses each arm attains, at its m + 1 waypoints: neither out of reach,
            nor with links too near each other.
        near_misses: which poses each arm misses on purpose, to avoid a detour.
        longer: time added to each interval between `edges`, relative.
        edges: times [s] in the recording at which a movement of any arm begins or ends.
        action: action of all paths at constant speed and in the person's time [J s].
        iterations: iterations of Ipopt, on all grids.
        segments: segments of the last grids.
        success: whether the program is solved.
        status: how Ipopt stopped, a sentence.
        kept: numbers of the distances that entered the program.
        least_distances: along the paths (m,) [m], in the order of the clearance; empty without one.
        too_near: names of the distances that fall below their bounds by more than a millimetre,
            each with by how much [m], and the time in the recording [s].
    """

    program: SynergyPaths
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
    _shown = ("action", "iterations", "segments", "success", "status")


@dataclass(frozen=True, eq=False, repr=False)
class SynergyPaths(ShortRepr):
    """What `plan_synergies` plans: its arguments.

    Attributes:
        arms: waypoints of each.
        candidates: for each arm, configurations at each waypoint; None: those of
            `first_candidates`.
        clearance: distances to be kept; None: none.
        stretch, posture, likeness: weights, see `RetargetingSettings`.
        tolerance: tolerance of limits and constraints between the nodes, each in its unit.
        cost, constraints: the user's own, see `plan_synergies`.
        progress: called with the current step, the amount done and the total.
    """

    arms: tuple[ArmWaypoints, ...]
    candidates: tuple[tuple[Candidates, ...], ...] | None
    clearance: Clearance | None
    stretch: float
    posture: float
    likeness: float
    tolerance: float
    cost: ArmCost | None
    constraints: ArmConstraints | None
    progress: Progress | None
    _shown = ("clearance", "stretch", "posture", "likeness", "tolerance")

    def __post_init__(self) -> None:
        arms = self.arms
        if not isinstance(arms, tuple) or not all(isinstance(each, ArmWaypoints) for each in arms):
            raise ValueError(f"arms must be a tuple of ArmWaypoints, got {arms!r}")
        if not arms:
            raise ValueError("arms must be at least one, got none")
        for name in ("cost", "constraints"):
            given = getattr(self, name)
            if not (given is None or callable(given)):
                raise ValueError(f"{name} must be a function of (model, q, v), got {given!r}")

    def of_arm(self, number: int) -> ArmProblem:
        """Return the energy of one arm and the conditions along its paths."""
        return ArmProblem(self.arms[number], self.cost, self.constraints)

    def planned(self) -> PlannedPaths:
        """Return the best solution, from straight lines between configurations with the poses.

        These are the shortest path through the candidates of each arm. If links cannot be moved
        apart from there, it is tried from the shortest path that keeps distances, and from there
        with those distances from the beginning. Poses are given up last, in the best of these.
        """
        edges = self._edges
        layers = self._layers
        weights = self._weights
        dof = sum(arm.arm.dof for arm in self.arms)
        clearance = self.clearance or joined_clearance([], dof)
        rounds = _Rounds(clearance, edges, weights, self.tolerance)
        report = self.progress or no_progress
        report("choosing configurations", 0, 3)
        found: list[_Apart] = []
        lacking: list[_Lacking] = []  # distances of each
        free: list[float] = []  # objectives without distances
        for number, start in enumerate(self._starts(layers, weights)):
            report("planning all synergies", 1 + number, 3)
            iterate = rounds.refined(start)
            if any(np.isclose(iterate.objective, each, rtol=_SAME) for each in free):
                continue  # it leads to the same paths
            free.append(iterate.objective)
            kept = _Apart(iterate, iterate)
            found.append(rounds.kept_apart(kept) if iterate.success else kept)
            lacking.append(_lacking_distances(clearance, found[-1].paths))
            if iterate.success and not lacking[-1]:
                break
        if found[-1].paths.success and lacking[-1]:
            # From there again, with the distances that were too small kept from the beginning.
            iterate = rounds.refined(start, found[-1].rows)
            kept = replace(found[-1], paths=iterate)
            found.append(rounds.kept_apart(kept) if iterate.success else kept)
            lacking.append(_lacking_distances(clearance, found[-1].paths))
        scores = [
            _score(rounds, each.paths, less) for each, less in zip(found, lacking, strict=True)
        ]
        best = min(range(len(found)), key=scores.__getitem__)
        if found[best].paths.success and lacking[best]:
            found[best] = rounds.kept_apart(found[best], yielding=True)
            lacking[best] = _lacking_distances(clearance, found[best].paths)
        iterations = sum(each.paths.iterations for each in found)
        return _planned(self, found[best].paths, lacking[best], rounds, iterations)

    def least_time(self) -> float:
        """Return the time [s] in which limits of speed and acceleration allow the straight lines at
        which the program starts, without distances, and none in less than the person's time.
        """
        found = []
        for arm, layers in zip(self.arms, self._layers, strict=True):
            q = find_start(arm, self._weights, layers, None).q
            needed = arm.needed_times(np.diff(q, axis=0)).max(axis=1)
            found.append(float(np.maximum(needed, arm.durations).sum()))
        return max(found)

    @property
    def _layers(self) -> tuple[tuple[Candidates, ...], ...]:
        return self.candidates or tuple(map(first_candidates, self.arms))

    @property
    def _edges(self) -> Array:
        return np.unique(np.concatenate([[*arm.begins, *arm.ends] for arm in self.arms]))

    @property
    def _weights(self) -> ObjectiveWeights:
        pairs = zip(self.arms, self._layers, strict=True)
        action = sum(least_action(*pair) for pair in pairs)
        duration = float(np.ptp(self._edges))
        unit = action if action > AT_REST else 1.0
        return ObjectiveWeights(unit, duration, self.stretch, self.posture, self.likeness, DETOUR)

    def _starts(
        self, layers: Sequence[Sequence[Candidates]], weights: ObjectiveWeights
    ) -> Iterator[_Iterate]:
        """Yield straight lines between the best configurations, and between those that keep
        distances.
        """
        definitions = [self.of_arm(number).definition() for number in range(len(self.arms))]
        before: list[Array] = []
        for clearance in dict.fromkeys((None, self.clearance)):
            parts = []
            nodes = []
            lines = []
            for number, arm in enumerate(self.arms):
                lacks = own_lacks(clearance, self.arms, number)
                start = find_start(arm, weights, layers[number], lacks)
                parts.append(
                    ArmPart.evenly(
                        arm, definitions[number], start.missed, _SEGMENTS, _DEGREE, start.allowed
                    )
                )
                nodes.append(parts[-1].nodes_on_lines(start.q))
                lines.append(start.q.ravel())
            q = np.concatenate(lines)
            if all(np.abs(q - others).max() >= _SIMILAR for others in before):
                before.append(q)
                yield _Iterate(
                    tuple(parts), tuple(nodes), near_misses=tuple(part.missed > 0 for part in parts)
                )


@dataclass(frozen=True, eq=False)
class _Iterate:
    """Arms on their grids, positions at the nodes, relative times added, and how it was found."""

    parts: tuple[ArmPart, ...]
    nodes: tuple[Array, ...]
    near_misses: tuple[NDArray[np.bool_], ...]
    longer: Array | None = None
    objective: float = np.inf
    iterations: int = 0
    kept: tuple[int, ...] = ()
    success: bool = False
    status: str = ""


@dataclass(frozen=True, eq=False)
class _Apart:
    """Paths that are kept apart, those without distances, and bounds of the distances kept."""

    paths: _Iterate
    free: _Iterate
    rows: Rows = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Rounds:
    """Rounds of the program: on finer grids, and with distances that were too small."""

    clearance: Clearance
    edges: Array
    weights: ObjectiveWeights
    tolerance: float

    def refined(self, start: _Iterate, rows: Rows | None = None) -> _Iterate:
        """Return the solution on grids that resolve the paths, with these distances at these
        instants.
        """

        def solve(iterate: _Iterate) -> _Iterate:
            program = MotionProgram(
                iterate.parts, self.edges, self.weights, self.clearance, rows or {}
            )
            x = program.guess(iterate.nodes, iterate.longer)
            outcome = program.solve(x, near=iterate.success)
            spent = iterate.iterations + outcome.iterations
            if not outcome.success and (rows or iterate.success):  # from the same start, otherwise
                outcome = program.solve(x, near=not iterate.success)
                spent += outcome.iterations
            ended = replace(
                iterate, iterations=spent, success=outcome.success, status=outcome.status
            )
            if not outcome.success:
                return ended
            nodes, longer = program.split(outcome.x)
            return replace(ended, nodes=tuple(nodes), longer=longer, objective=outcome.objective)

        def examine(number: int, iterate: _Iterate) -> tuple[_Iterate, _Iterate | None]:
            resolved = _RESOLVED
            if rows:  # then joint limits alone
                resolved = _RESOLVED_APART if number < _ROUNDS_APART else np.inf
            if not iterate.success:
                return iterate, None
            pairs = list(zip(iterate.parts, iterate.nodes, strict=True))
            heavy = [part.heavy or part.is_heavy(nodes) for part, nodes in pairs]
            if number + 1 < _ROUNDS and heavy != [part.heavy for part in iterate.parts]:
                parts = zip(iterate.parts, heavy, strict=True)
                return iterate, replace(
                    iterate, parts=tuple(replace(part, heavy=each) for part, each in parts)
                )
            coarse = [_coarse(*pair, self.tolerance, resolved) for pair in pairs]
            if not any(np.any(each) for each in coarse):
                return iterate, None
            segments = sum(part.grid.segments for part in iterate.parts)
            more = sum(int(each.sum()) for each in coarse)
            if segments + more > _MOST_SEGMENTS or number + 1 == _ROUNDS:
                status = f"not solved to {self.tolerance:g} on {segments} segments"
                return replace(iterate, success=False, status=status), None
            finer = [part.halved(each) for part, each in zip(iterate.parts, coarse, strict=True)]
            nodes = [
                part.path(each)(fine.grid.nodes)
                for (part, each), fine in zip(pairs, finer, strict=True)
            ]
            return iterate, replace(iterate, parts=tuple(finer), nodes=tuple(nodes))

        return in_rounds(start, solve, examine, _ROUNDS)

    def kept_apart(self, start: _Apart, yielding: bool = False) -> _Apart:
        """Return the solution with all distances above their bounds, or the last one that was
        found.

        Only those distances enter the program that are below their bounds at some instants, and
        only at these instants.

        Args:
            start: the paths so far.
            yielding: where that has not helped, replace poses at which links are too near by the
                nearest ones at which they are not.
        """
        clearance = self.clearance
        rows = dict(start.rows)
        free = start.free
        lacking = np.inf
        failed = False

        def solve(iterate: _Iterate) -> _Iterate:
            nonlocal failed
            if iterate is start.paths:  # known already
                return iterate
            found = self.refined(replace(iterate, success=False), rows)
            failed = not found.success
            if failed:
                return replace(iterate, iterations=found.iterations)
            return replace(found, kept=tuple(sorted({number for number, _ in rows})))

        def examine(number: int, iterate: _Iterate) -> tuple[_Iterate, _Iterate | None]:
            nonlocal free, lacking
            more, lacks = _too_near(clearance, iterate)
            if not more or failed or number == _DISTANCE_ROUNDS:
                return iterate, None
            following = replace(iterate)
            helped = bool(more.keys() - rows.keys()) and lacks <= _HOPELESS * lacking
            if not helped or (yielding and number == 0):
                if not yielding or (parts := _yielding(clearance, iterate)) is None:
                    return iterate, None
                # From the paths without distances, as poses that cannot be attained led astray.
                pairs = zip(free.parts, parts, strict=True)
                free = replace(
                    free,
                    parts=tuple(
                        replace(one, missed=each.missed, allowed=each.allowed)
                        for one, each in pairs
                    ),
                )
                following = replace(free, iterations=iterate.iterations)
                lacks = np.inf
            rows.update(more)
            lacking = lacks
            return iterate, following

        paths = in_rounds(start.paths, solve, examine, _DISTANCE_ROUNDS + 1)
        return _Apart(paths, free, rows)


def _coarse(part: ArmPart, nodes: Array, tolerance: float, resolved: float) -> NDArray[np.bool_]:
    """Return which segments to halve, (segments,)."""
    path = part.path(nodes)
    unresolved = unresolved_energy(path) / max(path.energy, _TINY)
    violated = worst_by_segment(path, path_samples(part.definition.conditions).excess(path))
    return np.asarray((unresolved > resolved / part.grid.segments) | (violated > tolerance))


def _planned(
    program: SynergyPaths, iterate: _Iterate, lacking: _Lacking, rounds: _Rounds, iterations: int
) -> PlannedPaths:
    pairs = list(zip(iterate.parts, iterate.nodes, strict=True))
    longer = np.zeros(rounds.edges.size - 1) if iterate.longer is None else iterate.longer
    _, q = _positions(iterate)
    return PlannedPaths(
        program=program,
        paths=tuple(tuple(part.paths(each)) for part, each in pairs),
        within_reach=tuple(tuple((part.missed == 0.0).tolist()) for part in iterate.parts),
        near_misses=tuple(tuple(each.tolist()) for each in iterate.near_misses),
        longer=longer,
        edges=rounds.edges,
        action=float(sum(part.path(each).energy / part.moving_time for part, each in pairs)),
        iterations=iterations,
        segments=sum(part.grid.segments for part in iterate.parts),
        success=iterate.success,
        status=iterate.status,
        kept=iterate.kept,
        least_distances=rounds.clearance.at(q).min(axis=0),
        too_near=lacking,
    )


def _score(rounds: _Rounds, iterate: _Iterate, lacking: _Lacking) -> tuple[bool, float]:
    """Return whether it failed, and the objective with detours of the hand and distances below
    their bounds; less is better.
    """
    total = iterate.objective
    for part, nodes in zip(iterate.parts, iterate.nodes, strict=True):
        for number, path in enumerate(part.paths(nodes)):
            middle = np.atleast_2d(path(0.5))
            total += rounds.weights.detour * float(off_the_way(part.waypoints, number, middle)[0])
    total += _LACKING * sum(amount for _, amount, _ in lacking)
    return not iterate.success, total


def _yielding(clearance: Clearance, iterate: _Iterate) -> list[ArmPart] | None:
    """Return the arms with poses missed at which links are too near, first within what is allowed,
    then by any distance; None if there are no new ones.
    """
    every = list[ArmPart]()
    any_new = False
    for part in iterate.parts:
        given = part.waypoints
        times = np.append(given.begins[0], given.ends)
        active = active_rows(clearance, positions_at(iterate.parts, iterate.nodes, times), -_BELOW)
        new = np.zeros(times.size, dtype=bool)
        new[active.samples[active.lacks > 0.0]] = True
        new &= (part.missed != _YIELDING) | part.allowed
        new[0] &= given.start is None
        bounded = np.array([min(each) > 0.0 for each in given.allowed or [(0.0, 0.0)] * times.size])
        bounded &= (part.missed == 0.0) | (part.allowed & (part.missed != _YIELDING))
        missed = np.where(new, _YIELDING, part.missed)
        every.append(replace(part, missed=missed, allowed=np.where(new, bounded, part.allowed)))
        any_new |= bool(new.any())
    return every if any_new else None


def _positions(iterate: _Iterate) -> tuple[Array, Array]:
    """Return instants (k,) [s] within the movements, and the joints of all arms there (k, N)."""
    movements = [
        np.linspace(begin, end, _INSTANTS)
        for part in iterate.parts
        for begin, end in zip(part.waypoints.begins, part.waypoints.ends, strict=True)
    ]
    instants = np.unique(np.concatenate(movements).round(9))
    return instants, positions_at(iterate.parts, iterate.nodes, instants)


def _too_near(
    clearance: Clearance, iterate: _Iterate
) -> tuple[dict[tuple[int, float], float], float]:
    """Return bounds of the distances that enter the program, by number and instant; what they lack
    [m].

    Where each lacks most, and around; the sum is that of the most that each lacks.
    """
    instants, q = _positions(iterate)
    active = active_rows(clearance, q, -_ROUNDING)
    found: dict[tuple[int, float], float] = {}
    total = 0.0
    for row in np.unique(active.rows).tolist():
        here = active.rows == row
        lower, lacks = np.full((2, len(q) + 2), -np.inf)
        lower[active.samples[here] + 1] = active.lower[here]
        lacks[active.samples[here] + 1] = active.lacks[here]
        peaks = (lacks[1:-1] >= lacks[:-2]) & (lacks[1:-1] >= lacks[2:]) & np.isfinite(lower[1:-1])
        around = peaks | np.append(peaks[1:], False) | np.append(False, peaks[:-1])
        for sample in np.flatnonzero(around & np.isfinite(lower[1:-1])).tolist():
            found[row, float(instants[sample])] = float(lower[sample + 1]) + _ROUNDING
        total += float(lacks.max())
    return found, total


def _lacking_distances(clearance: Clearance, iterate: _Iterate) -> _Lacking:
    """Return distances below their bounds, the worst first: name, amount [m], time [s]."""
    instants, q = _positions(iterate)
    active = active_rows(clearance, q, -_BELOW)
    worst: dict[str, tuple[str, float, float]] = {}
    for index in np.argsort(-active.lacks):
        name = clearance.names[int(active.rows[index])]
        time = float(instants[active.samples[index]])
        worst.setdefault(name, (name, float(active.lacks[index]), time))
    return tuple(worst.values())
