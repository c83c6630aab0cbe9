"""Initial guesses of constrained problems: detours pushed out of obstacles, and a sampling planner.

A local solver stays in the homotopy class of its guess, or fails if that leads through an obstacle.
Detours are straight lines through one more configuration, smoothed and moved out of violated
constraints in turn. Where none of them is clear, a rapidly-exploring random tree from either end
finds a path (RRT-Connect: Kuffner and LaValle, ICRA 2000), which is then shortened. Both know the
constraints in the configuration alone, not those on velocities.

All lengths are in sizes of the problem, and configurations y = q / size; violations are in the
scales of the constraints (`scales`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Terms
from geodesic_ocp.manifold.metric import speeds_at
from geodesic_ocp.ocp.conditions import Condition, Group, NodeBounds, stacked
from geodesic_ocp.ocp.nlp import ProblemDefinition, initial_nodes
from geodesic_ocp.ocp.pose_search import pose_steps, search_simultaneously
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

_CLEAR = 1e-6  # violation that a configuration may have
_TINY = 1e-12
# Of a path's extent, at least one size: how far samples of unbounded coordinates lie from it.
_AROUND = 1.5
_OWN = "the initial guess"
# of the search for free ends, and how many of its configurations are kept
_STARTS = 96
_GOALS = 8
# Detours.
_S = np.linspace(0.0, 1.0, 25)  # of their nodes
_BETWEEN = 4  # checks from one node to the next
# deterministic ones that are tried, and random ones
_DETOURS = 2
_BENDS = 24
_OFFSET = 0.3  # of the box, at most one size: how far one leads aside
# of pushing and smoothing; weight of pushed against smooth
_ROUNDS = 8
_FIRM = 30.0
_MARGIN = 0.1  # of the violation on the first path, by which nodes are pushed clear
_LONGEST = 0.3  # step of a node
_DEFORMATIONS = 5  # paths that are checked on the way from one path to another
_SAME = 0.1  # paths nearer than this everywhere lead to the same solution
_LITTLE_MORE = 1.25  # times the energy of the problem's own guess, that another one may have
# The planner.
_SAMPLES = 2000
_PLANS = 20
_SHORTCUTS = 300
_STALE = 3  # paths like others in a row, after which no new one is expected
_AMONG_MANY = 3  # times as many samples among many bodies, where the straight line leads nowhere
_REACH = 1.5  # longest line towards a sample
_NEARBY = 0.2  # of the range of a constraint's values: nearer ones count
_SPACING = 0.05  # between checks along a line
_EACH = 8  # every so many of them become nodes of a tree
# towards a sample, along what blocks, away from that
_LINES = 6
_SLIDE = 0.5
_AWAY = 2e-3


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Configurations y that satisfy the path constraints of a problem that are in q alone."""

    definition: ProblemDefinition
    near: Array | None = None  # configurations (k, n) near which constraints count; None: all

    @cached_property
    def _at_nodes(self) -> NodeBounds:
        return NodeBounds.on_grid(self.definition.conditions, Grid(1, 2))

    @cached_property
    def lower(self) -> Array:
        """Lower bounds (3, n) of the coordinates at the start, in between and at the end."""
        return self._at_nodes.lower / self.definition.size

    @cached_property
    def upper(self) -> Array:
        """Upper bounds (3, n)."""
        return self._at_nodes.upper / self.definition.size

    @cached_property
    def fixed(self) -> Array:
        """Values to which start and end are fixed, (2, n), NaN if free."""
        return self._at_nodes.ends / self.definition.size

    @cached_property
    def _groups(self) -> list[Group]:
        """Groups of the constraints that count."""
        conditions = self.definition.conditions
        if self.near is None:
            return conditions.groups
        found = list[Group]()
        known = dict[Terms, Array]()
        for group in conditions.groups:
            over = np.maximum(*self._sides(group, self.near, known))
            # Compared with how much their values change; NaN is near.
            near = ~(over.max(axis=0) <= -_NEARBY * np.ptp(over, axis=0))
            if np.any(near):
                found.append(group.only(near))
        return found

    def _sides(self, group: Group, q: Array, known: dict[Terms, Array]) -> tuple[Array, Array]:
        """Return how far values at configurations (k, n) lie below and above bounds, (k, rows)."""
        values = group.values(self.definition.size * q, self._p, known) / group.scales
        lower, upper = group.bounds
        return lower - values, values - upper

    @property
    def _p(self) -> Array:
        return self.definition.conditions.p_values

    def excess(self, q: Array) -> Array:
        """Return largest violation of the constraints at configurations (k, n), (k,), negative
        inside; NaN counts as infinite.
        """
        return self._values(q, False)[0]

    def outward(self, q: Array) -> tuple[Array, Array]:
        """Return largest violations (k,), and their gradients (k, n)."""
        return self._values(q, True)

    def _values(self, q: Array, gradients: bool) -> tuple[Array, Array]:
        size = self.definition.size
        excess = np.full(len(q), -np.inf)
        slopes = np.zeros(q.shape)
        known = dict[Terms, Array]()
        for group in self._groups if len(q) else ():
            below, above = self._sides(group, q, known)
            over = np.fmax(below, above)
            over[np.isnan(over)] = np.inf
            worst = over.argmax(axis=1)
            at = np.arange(len(q))
            more = over[at, worst] > excess
            excess[more] = over[at, worst][more]
            if gradients and np.any(more):
                found = np.nan_to_num(group.slopes(size * q[more], self._p, worst[more]))
                is_above = (above > below)[at, worst][more]
                signs = np.where(is_above, 1.0, -1.0) / group.scales[worst[more]]
                slopes[more] = size * signs[:, None] * found
        if gradients:
            return excess, slopes
        outside = np.maximum(self.lower[1] - q, q - self.upper[1]).max(axis=1)
        return np.maximum(excess, outside), slopes

    def is_clear(self, paths: Array) -> NDArray[np.bool_]:
        """Return which polylines (m, k, n) are clear of all constraints, (m,)."""
        parts = np.arange(_BETWEEN)[:, None] / _BETWEEN
        between = paths[:, :-1, None] + parts * np.diff(paths, axis=1)[:, :, None]
        excess = self.excess(between.reshape(-1, paths.shape[2])).reshape(len(paths), -1)
        return np.asarray(excess.max(axis=1) <= _CLEAR)

    def is_free(self, waypoints: Array) -> bool:
        """Return whether straight lines between waypoints (m, n) are free, the first excepted."""
        every = np.vstack([_line(*each) for each in pairwise(waypoints)])
        return self.num_free(every) == len(every)

    def num_free(self, every: Array) -> int:
        """Return the number of configurations (k, n) before the first that is not free."""
        # most lines are blocked soon
        first = 0
        at_once = 4
        while first < len(every):
            q = every[first : first + at_once]
            known = dict[Terms, Array]()
            free = _before(np.maximum(self.lower[1] - q, q - self.upper[1]))
            for group in self._groups if free else ():
                known = {terms: each[:free] for terms, each in known.items()}
                free = _before(np.maximum(*self._sides(group, q[:free], known)))
                if not free:
                    break
            if free < len(q):
                return first + free
            first = first + at_once
            at_once = 2 * at_once
        return len(every)

    def beside(self, free: Array, blocked: Array, q: Array) -> Array | None:
        """Return a configuration beside a blocked one, on the way to q along what blocks it; None
        if it is in the way (retraction: Zhang and Manocha, ICRA 2008).
        """
        excess, slopes = (each[0] for each in self.outward(blocked[None]))
        square = slopes @ slopes
        if not 0.0 < excess < np.inf or square <= _TINY:
            return None
        along = q - free - max(0.0, (q - free) @ slopes) / square * slopes
        length = np.linalg.norm(along)
        if length < _SPACING:
            return None
        end = free + min(1.0, _SLIDE / length) * along - (excess + _AWAY) / square * slopes
        return np.asarray(np.clip(end, self.lower[1], self.upper[1]))

    def ends(self, at_end: bool, rng: np.random.Generator, box: tuple[Array, Array]) -> Array:
        """Return free configurations (k, n) of one end, from random starts if it is not fixed.

        There are none if a condition on it depends on the other end or on velocities.
        """
        c = self.definition.conditions
        side = -1 if at_end else 0
        fixed = self.fixed[side]
        if not np.any(np.isnan(fixed)):
            return np.asarray(fixed[None])
        own, other = (c.q1, c.q0) if at_end else (c.q0, c.q1)
        others = ca.vertcat(other, c.v0, c.v1)
        held = [each for each in c.ends if ca.depends_on(each.expression, own)]
        if any(ca.depends_on(each.expression, others) for each in held):
            return np.zeros((0, fixed.size))
        limits = self.lower[side], self.upper[side]
        steps = _EndSteps(self, own, held, limits)
        starts = rng.uniform(*box, (_STARTS, fixed.size))
        found = search_simultaneously(steps, starts, limits, 2 * _GOALS, np.inf)
        q = found.q[found.errors <= _CLEAR]
        q = q[self.excess(q) <= _CLEAR]
        near = self.fixed[-1 - side]
        distances = np.nansum((q - near) ** 2, axis=1)
        return q[np.argsort(distances)[:_GOALS]]


def _before(excess: Array) -> int:
    """Return the number of rows (k, m) before the first with a violation; NaN is one."""
    blocked = ~np.all(excess <= _CLEAR, axis=1)
    return int(np.argmax(blocked)) if np.any(blocked) else len(blocked)


def _line(start: Array, end: Array) -> Array:
    """Return configurations (k, n) from the start, excluded, to the end."""
    count = max(1, int(np.ceil(np.linalg.norm(end - start) / _SPACING)))
    return np.asarray(start + np.linspace(0.0, 1.0, count + 1)[1:, None] * (end - start))


class _EndSteps:
    """Errors of the conditions on one end and its worst violation of a path constraint, and steps
    within limits that reduce them.
    """

    def __init__(
        self, space: FreeSpace, own: ca.SX, held: Sequence[Condition], limits: tuple[Array, Array]
    ) -> None:
        c = space.definition.conditions
        self._space = space
        self._p = c.p_values
        self._limits = limits
        self._values = np.concatenate([np.zeros(0), *(each.lower for each in held)])
        self._scales = np.concatenate([np.zeros(0), *(each.scales for each in held)])
        self._terms = Terms(own, c.p, 0.0, stacked(held))

    def __call__(self, q: Array) -> tuple[Array, Array, Array]:
        size = self._space.definition.size
        g, jacobians = self._terms.jacobians(size * q, self._p)
        g = (g - self._values) / self._scales
        jacobians = size * jacobians / self._scales[:, None]
        excess, slopes = self._space.outward(q)
        violated = excess > 0.0
        errors = np.column_stack([g, np.where(violated, excess, 0.0)])
        slopes = np.where(violated[:, None], slopes, 0.0)[:, None]
        jacobians = np.concatenate([jacobians, slopes], axis=1)
        return errors, *pose_steps(q, errors, jacobians, self._limits)


class Attempts:
    """Record of the guesses that one search has tried.

    Attributes:
        names: what was tried, in words.
        paths: paths (25, n) of guesses; others like these are not tried.
    """

    def __init__(self) -> None:
        self.names: list[str] = []
        self.paths: list[Array] = []


@dataclass(frozen=True, eq=False)
class Guesses:
    """Guesses for a problem: its own, detours, and paths of a planner.

    Attributes:
        definition: definition of the problem, without via points.
        grid: on which the problem's own guess is evaluated.
    """

    definition: ProblemDefinition
    grid: Grid

    @cached_property
    def _space(self) -> FreeSpace:
        return FreeSpace(self.definition)

    @cached_property
    def _path(self) -> Path:
        """The problem's own guess."""
        nodes = initial_nodes(self.definition, self.definition.bounds(self.grid))
        return Path(self.definition.metric, self.grid, nodes)

    @cached_property
    def _own(self) -> Array:
        """The problem's own guess, (25, n)."""
        return self._sampled(self._path)

    def _sampled(self, path: Path) -> Array:
        """Return configurations (25, n) of a path."""
        return np.asarray(path(_S) / self.definition.size)

    def _through(self, waypoints: Array) -> Path:
        return Path.through(self.definition.metric, self.definition.size * waypoints)

    def simple(self, several: bool, attempts: Attempts) -> Iterator[tuple[str, Path | None]]:
        """Yield the problem's own guess, None, and where there are path constraints in q, or
        `several` are wanted, detours, which come first if the own guess is not clear; with names.
        """
        if not (several or self.definition.conditions.along_q):
            yield _as_own(attempts)
            yield from self._given(self.second, attempts)
            return
        space = self._space
        own = self._own
        if is_clear := space.is_clear(own[None])[0]:
            attempts.paths.append(own)
            yield _as_own(attempts)
            yield from self._given(self.second, attempts)
        box = _box(space, own)
        detours = _clear_detours(space, np.concatenate([own[None], _beside(own, box)]), own)
        detours = [q for q in detours if _is_new(q, attempts.paths)][:_DETOURS]
        for number, q in enumerate(detours):
            attempts.names.append(f"detour {number + 1}")
            yield attempts.names[-1], self._through(q)
        # Among many bodies a guess through them comes last, as it takes long to solve.
        if not is_clear and (detours or several or not self.definition.conditions.are_many):
            yield _as_own(attempts)

    @cached_property
    def _others(self) -> list[tuple[str, Path]]:
        """The problem's other guesses, if it gives several, that are clear: those of least energy
        first, with names.
        """
        given = self.definition.guess(self.grid.nodes)
        if given is None or np.ndim(given) < 3:
            return []
        size = self.definition.size
        metric = self.definition.metric
        seen = [given[0] / size]
        every = [
            Path(metric, self.grid, nodes) for nodes in given[1:] if _is_new(nodes / size, seen)
        ]
        if every and self.definition.conditions.along_q:
            are_clear = self._space.is_clear(np.array([self._sampled(each) for each in every]))
            every = [every[number] for number in np.flatnonzero(are_clear)]
        every.sort(key=lambda each: each.discrete_energy)
        return [(f"initial guess {number}", each) for number, each in enumerate(every, 2)]

    @cached_property
    def second(self) -> list[tuple[str, Path]]:
        """The first of these, if it has little more energy than the problem's own guess."""
        return [
            (name, path)
            for name, path in self._others[:1]
            if path.discrete_energy < _LITTLE_MORE * self._path.discrete_energy
        ]

    def _given(
        self, those: list[tuple[str, Path]], attempts: Attempts
    ) -> Iterator[tuple[str, Path]]:
        """Yield those of the problem's other guesses that have not been tried."""
        for name, path in those:
            if name not in attempts.names:
                attempts.names.append(name)
                attempts.paths.append(self._sampled(path))
                yield name, path

    def last(self, attempts: Attempts) -> Iterator[tuple[str, Path | None]]:
        """Yield the problem's own guess if it was left out, as neither it nor a detour is clear
        and there are many conditions.
        """
        if attempts.names and _OWN not in attempts.names:
            yield _as_own(attempts)

    def deform(self, one: Path, other: Path) -> bool:
        """Return whether straight lines between points of two paths are clear of all constraints
        (visibility deformation: Jaillet and Simeon, Int. J. Robotics Research 27, 2008).
        """
        shares = np.linspace(0.0, 1.0, _DEFORMATIONS + 2)[1:-1, None, None]
        first = self._sampled(one)
        last = self._sampled(other)
        return bool(np.all(self._space.is_clear(first + shares * (last - first))))

    def further(self, several: bool, attempts: Attempts) -> Iterator[tuple[str, Path | None]]:
        """Yield the problem's other guesses, and paths of the planner, after detours from random
        configurations if `several` are wanted.
        """
        yield from self._given(self._others, attempts)
        space = self._space
        own = self._own
        seen = attempts.paths
        if not (several or self.definition.conditions.along_q):
            return
        box = _box(space, own)
        rng = np.random.default_rng(0)
        starts, goals = (space.ends(at_end, rng, box) for at_end in (False, True))
        if not len(starts) or not len(goals):
            attempts.names.append("no end of a path was found that meets the constraints")
            return
        box = _box(space, np.vstack([own, starts, goals]))
        if several:
            middles = rng.uniform(*box, (_BENDS, own.shape[1]))
            ends = goals[np.arange(_BENDS) % len(goals)]
            bends = np.array([_bent(starts[0], *each) for each in zip(middles, ends, strict=True)])
            for number, q in enumerate(_clear_detours(space, bends, own)):
                if _is_new(q, seen):
                    attempts.names.append(f"random detour {number + 1}")
                    yield attempts.names[-1], self._through(q)
        stale = 0
        samples = _SAMPLES * (_AMONG_MANY if self.definition.conditions.are_many else 1)
        for number in range(_PLANS):
            waypoints = connect(space, starts, goals, box, rng, samples)
            if waypoints is None:
                attempts.names.append(f"a sampling planner that found no path in {samples} samples")
                return
            waypoints = shortcut(space, waypoints, rng)
            if np.isfinite(_energy(self.definition, waypoints)):
                path = self._through(waypoints)
                stale += 1
                if _is_new(self._sampled(path), seen):
                    stale = 0
                    attempts.names.append(f"planner {number + 1}")
                    yield attempts.names[-1], path
            if stale == _STALE:
                attempts.names.append(
                    f"a sampling planner whose last {stale} paths were like others"
                )
                return


def _as_own(attempts: Attempts) -> tuple[str, None]:
    attempts.names.append(_OWN)
    return "", None


def _box(space: FreeSpace, own: Array) -> tuple[Array, Array]:
    """Return bounds (n,) of samples: those of the problem, but not far from a path."""
    lower = space.lower[1]
    upper = space.upper[1]
    least = own.min(axis=0)
    most = own.max(axis=0)
    definition = space.definition
    periods = np.array(definition.metric.periods or np.zeros(lower.size)) / definition.size
    around = np.maximum(  # periods are infinite where there are none
        np.where(np.isfinite(periods), periods / 2.0, 0.0),
        max(_AROUND * np.max(most - least), 1.0),
    )
    wide = ~np.isfinite(upper - lower)
    return (
        np.where(wide, np.maximum(lower, least - around), lower),
        np.where(wide, np.minimum(upper, most + around), upper),
    )


def _energy(definition: ProblemDefinition, waypoints: Array) -> float:
    """Return energy of the polyline through points (k, n); infinite where there is no metric, or
    no motion.
    """
    q = definition.size * waypoints
    steps = np.diff(q, axis=0)
    length = float(np.sum(speeds_at(definition.metric, q[:-1] + steps / 2.0, steps)))
    return length**2 / 2.0 if length > 0.0 else np.inf


def _is_new(q: Array, seen: list[Array]) -> bool:
    """Return whether a path (k, n) is none of those seen, and remember it."""
    is_new = all(np.abs(q - each).max() > _SAME for each in seen)
    seen.append(q)
    return is_new


def _bent(start: Array, middle: Array, end: Array) -> Array:
    """Return the path (25, n) along two straight lines."""
    s = _S[:, None]
    return np.asarray(
        np.where(
            s < 0.5, start + 2.0 * s * (middle - start), end + 2.0 * (1.0 - s) * (middle - end)
        )
    )


def _beside(own: Array, box: tuple[Array, Array]) -> Array:
    """Return the straight line between a path's ends, and bends of it to either side in every
    coordinate, (2 n + 1, 25, n).
    """
    start = own[0]
    end = own[-1]
    offsets = np.minimum(_OFFSET * (box[1] - box[0]), 1.0) * np.eye(start.size)
    beside = np.concatenate([0.0 * offsets[:1], offsets, -offsets])
    middles = np.clip((start + end) / 2.0 + beside, *box)
    return np.array([_bent(start, middle, end) for middle in middles])


def _clear_detours(space: FreeSpace, paths: Array, own: Array) -> list[Array]:
    """Return paths (25, n) moved out of violated constraints, that of the least energy first;
    those that do not become clear are left out.
    """
    definition = space.definition
    tensor = definition.metric.matrix(definition.size * own[len(own) // 2])
    paths = _pushed_out(space, paths, tensor / np.trace(tensor))
    free = [(_energy(definition, q), q) for q in paths[space.is_clear(paths)]]
    finite = [each for each in free if np.isfinite(each[0])]
    return [q for _, q in sorted(finite, key=lambda each: each[0])]


def _pushed_out(space: FreeSpace, paths: Array, tensor: Array) -> Array:
    """Return paths (m, k, n) moved out of violated constraints and smoothed in turn.

    Nodes move in the direction of least energy in a constant metric, its matrix (n, n).
    """
    size, n = paths.shape[1:]
    paths = paths.copy()
    margin = 0.0
    # min sum |q_i+1 - q_i|^2 / 2 + firm sum_i pushed_i |q_i - target_i|^2 / 2 with both ends fixed.
    stretch = 2.0 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1)
    rest = np.arange(len(paths))
    space = replace(space, near=paths.reshape(-1, n))
    for _ in range(_ROUNDS):
        q = paths[rest]
        excess, slopes = space.outward(q.reshape(-1, n))
        excess[np.isinf(excess)] = -np.inf  # there is no way out of where it is not defined
        if not margin:
            straight = excess[:size].max()
            every = excess.max()
            margin = _MARGIN * max(straight if straight > 0.0 else every, _CLEAR)
        worst = excess.reshape(len(rest), size)[:, 1:-1].max(axis=1)
        pushed = excess > -1.5 * margin
        raised = np.linalg.solve(tensor, slopes.T).T
        square = np.maximum((raised * slopes).sum(axis=1), _TINY)
        steps = -(np.where(pushed, excess + margin, 0.0) / square)[:, None] * raised
        lengths = np.linalg.norm(steps, axis=1, keepdims=True)
        steps *= np.minimum(1.0, _LONGEST / np.maximum(lengths, _TINY))
        weights = _FIRM * pushed.reshape(len(rest), size)
        matrices = stretch + np.eye(size) * weights[:, None]
        right = weights[:, :, None] * (q + steps.reshape(q.shape))
        right[:, [0, -1]] = q[:, [0, -1]]
        matrices[:, [0, -1]] = np.eye(size)[[0, -1]]
        violated = worst > -0.5 * margin
        rest = rest[violated]
        if not len(rest):
            break
        smooth = np.linalg.solve(matrices[violated], right[violated])
        paths[rest] = np.clip(smooth, space.lower[1], space.upper[1])
    return paths


class _Tree:
    """Configurations q (k, n), each with the index of the one it was reached from."""

    def __init__(self, roots: Array) -> None:
        self.q = roots
        self._parents = [-1] * len(roots)

    def grow(self, space: FreeSpace, q: Array, longest: float) -> tuple[int, bool]:
        """Extend the nearest node towards a configuration, and where that is blocked, along what
        blocks it; its last node, and whether the configuration is reached.
        """
        node = int(np.argmin(np.sum((self.q - q) ** 2, axis=1)))
        reached = False
        distance = float(np.linalg.norm(q - self.q[node]))
        target = q
        if longest < distance:
            target = self.q[node] + longest / distance * (q - self.q[node])
        end: Array | None = target
        for _ in range(_LINES):
            if end is None or reached:
                break
            every = _line(self.q[node], end)
            line = every[: space.num_free(every)]
            new = np.vstack([line[_EACH - 1 : -1 : _EACH], line[-1:]])
            if len(new):
                self._parents += [node, *range(len(self.q), len(self.q) + len(new) - 1)]
                self.q = np.vstack([self.q, new])
                node = len(self.q) - 1
            if len(line) < len(every):
                end = space.beside(self.q[node], every[len(line)], target)
            else:
                reached = end is target
                end = target
        return node, reached and target is q

    def branch(self, node: int) -> list[Array]:
        """Return the configurations from a node to its root."""
        found = []
        while node >= 0:
            found.append(self.q[node])
            node = self._parents[node]
        return found


def connect(
    space: FreeSpace,
    starts: Array,
    goals: Array,
    box: tuple[Array, Array],
    rng: np.random.Generator,
    samples: int,
) -> Array | None:
    """Return free waypoints (m, n) from one of the starts to one of the goals; None if none were
    found with so many samples.
    """
    trees = _Tree(starts), _Tree(goals)
    for number in range(samples):
        one, other = sorted(trees, key=lambda each: len(each.q))  # the smaller one is in narrows
        size = len(one.q)
        sample = rng.uniform(*box) if number else other.q[0]
        node, _ = one.grow(space, sample, _REACH)
        if len(one.q) == size:
            continue
        met, reached = other.grow(space, one.q[node], np.inf)
        if reached:
            first = one.branch(node)
            last = other.branch(met)
            joined = [*first[::-1], *last[1:]]
            return np.array(joined if one is trees[0] else joined[::-1])
    return None


def shortcut(space: FreeSpace, waypoints: Array, rng: np.random.Generator) -> Array:
    """Return free waypoints (m, n), parts of which are replaced by straight lines where these are
    free, in all coordinates or in one (Geraerts and Overmars, Int. J. Robotics Research 26, 2007).
    """
    q = waypoints
    n = q.shape[1]
    for _ in range(_SHORTCUTS):
        if len(q) < 3:
            break
        upto = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
        places = np.sort(rng.uniform(0.0, upto[-1], 2))
        first, last = np.searchsorted(upto, places, side="right")
        if first == last:
            continue
        ends = np.column_stack([np.interp(places, upto, column) for column in q.T])
        if (one := rng.integers(2 * n)) < n:
            ends = np.vstack([ends[0], q[first:last], ends[1]])
            at = [places[0], *upto[first:last], places[1]]
            ends[:, one] = np.interp(at, places, ends[[0, -1], one])
        if space.is_free(ends):
            q = np.vstack([q[:first], ends, q[last:]])
    return q
