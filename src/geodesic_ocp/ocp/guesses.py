"""Initial guesses of constrained problems: detours pushed out of obstacles, and a sampling planner.

A local solver stays in the homotopy class of its guess, or fails if that leads through an obstacle.
Detours are straight lines through one more configuration, smoothed and moved out of violated
constraints in turn. Where none of them is clear, a rapidly-exploring random tree from either end
finds a path (RRT-Connect: Kuffner and LaValle, ICRA 2000), which is then shortened. Both know the
constraints in the configuration alone, not those on velocities.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Terms
from geodesic_ocp.ocp.conditions import Condition, NodeBounds, stacked
from geodesic_ocp.ocp.nlp import ProblemDefinition
from geodesic_ocp.ocp.pose_search import search_simultaneously
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

_CLEAR = 1e-6  # violations, in the unit of the constraint, that a configuration may have
_SPACING = 0.05  # [rad or m] between configurations that are checked along a line
_STARTS, _GOALS = 96, 8  # of the search for free ends, and how many of its configurations are kept

Jacobians: TypeAlias = tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """Configurations that satisfy the path constraints of a problem that are in q alone."""

    definition: ProblemDefinition

    @cached_property
    def bounds(self) -> NodeBounds:
        """Bounds of the coordinates at the start, in between and at the end."""
        return NodeBounds.on_grid(self.definition.conditions, Grid(1, 2))

    @cached_property
    def _terms(self) -> Terms:
        return self.definition.transcription(self.definition.grid).terms.at_nodes

    @cached_property
    def _limits(self) -> tuple[Array, Array]:
        rows = self.definition.conditions.along_q
        none = [np.zeros(0)]
        lower = np.concatenate([*none, *(each.lower for each in rows)])
        return lower, np.concatenate([*none, *(each.upper for each in rows)])

    def excess(self, q: Array) -> Array:
        """Return largest violation of the constraints at configurations (k, n), (k,), negative
        inside; NaN counts as infinite.
        """
        return self._values(q, False)[0]

    def outward(self, q: Array) -> Jacobians:
        """Return largest violations (k,), and their gradients (k, n)."""
        return self._values(q, True)

    def _values(self, q: Array, gradients: bool) -> Jacobians:
        lower, upper = self.bounds.lower[1], self.bounds.upper[1]
        outside = np.maximum(lower - q, q - upper).max(axis=1)
        if not self._terms.size_g:
            return outside, np.zeros_like(q)
        g, entries = _mapped(self._terms, q, self.definition.conditions.p_values)
        below, above = (each[:, None] for each in self._limits)
        excess = np.maximum(below - g, g - above)
        excess[np.isnan(excess)] = np.inf
        if not gradients:
            return np.maximum(excess.max(axis=0), outside), np.zeros_like(q)
        worst = excess.argmax(axis=0)
        at = np.arange(len(q))
        slopes = np.nan_to_num(_jacobians(self._terms, entries)[at, worst])
        sign = np.where(g[worst, at] > self._limits[1][worst], 1.0, -1.0)
        return excess[worst, at], sign[:, None] * slopes

    def is_free(self, start: Array, end: Array) -> bool:
        """Return whether a straight line is free, its ends not counted."""
        return len(self.prefix(start, end)) == _num_steps(start, end)

    def prefix(self, start: Array, end: Array) -> Array:
        """Return configurations (k, n) from the start, excluded, along a line until it is
        blocked.
        """
        count = _num_steps(start, end)
        every = start + np.linspace(0.0, 1.0, count + 1)[1:, None] * (end - start)
        for first in range(0, count, _AT_ONCE):
            blocked = self.excess(every[first : first + _AT_ONCE]) > _CLEAR
            if np.any(blocked):
                every = every[: first + int(np.argmax(blocked))]
                break
        return np.asarray(every)

    def ends(self, at_end: bool, rng: np.random.Generator, box: tuple[Array, Array]) -> Array:
        """Return free configurations (k, n) of one end, from random starts if it is not fixed.

        There are none if a condition on it depends on the other end or on velocities.
        """
        c, side = self.definition.conditions, -1 if at_end else 0
        fixed = self.bounds.ends[side]
        if not np.any(np.isnan(fixed)):
            return np.asarray(fixed[None])
        own, other = (c.q1, c.q0) if at_end else (c.q0, c.q1)
        others = ca.vertcat(other, c.v0, c.v1)
        held = [each for each in c.ends if ca.depends_on(each.expression, own)]
        if any(ca.depends_on(each.expression, others) for each in held):
            return np.zeros((0, fixed.size))
        pose_errors = _EndErrors(self, own, held)
        lower, upper = (np.where(np.isnan(fixed), each, fixed) for each in box)
        given = self.definition.guess(np.array([float(at_end)]))
        starts = rng.uniform(lower, upper, (_STARTS, fixed.size))
        starts = starts if given is None else np.vstack([given, starts])
        found = search_simultaneously(pose_errors, starts, None, (lower, upper), 2 * _GOALS, np.inf)
        q = found.q[found.errors <= _CLEAR]
        return q[self.excess(q) <= _CLEAR]


_AT_ONCE = 32  # configurations of a line that are checked in one call


def _num_steps(start: Array, end: Array) -> int:
    return max(1, int(np.ceil(np.linalg.norm(end - start) / _SPACING)))


def _mapped(terms: Terms, q: Array, p: Array) -> list[Array]:
    """Return values and entries of the Jacobian at configurations (k, n), one column each."""
    arguments = ca.DM(q.T), ca.repmat(ca.DM(p), 1, len(q))
    return [each.full() for each in terms.mapped("jacobian", len(q), arguments)]


def _jacobians(terms: Terms, entries: Array) -> Array:
    found = np.zeros((entries.shape[1], terms.size_g, terms.size))
    rows, columns = terms.jacobian_entries
    found[:, rows, columns] = entries.T
    return found


class _EndErrors:
    """Errors of the conditions on one end, and its worst violation of a path constraint."""

    def __init__(self, space: FreeSpace, own: ca.SX, held: Sequence[Condition]) -> None:
        c = space.definition.conditions
        self._space, self._p = space, c.p_values
        self._values = np.concatenate([np.zeros(0), *(each.lower for each in held)])
        self._terms = Terms(own, c.p, 0.0, stacked(held))

    def __call__(self, q: Array) -> tuple[Array, Array]:
        g, entries = _mapped(self._terms, q, self._p)
        excess, slopes = self._space.outward(q)
        violated = excess > 0.0
        errors = np.column_stack([g.T - self._values, np.where(violated, excess, 0.0)])
        slopes = np.where(violated[:, None], slopes, 0.0)[:, None]
        return errors, np.concatenate([_jacobians(self._terms, entries), slopes], axis=1)


@dataclass(frozen=True, eq=False)
class Guesses:
    """Guesses for a problem, the detours first, then paths of the planner.

    Attributes:
        definition: definition of the problem, without via points.
        tried: what was tried, in words; it grows as `paths` yields.
    """

    definition: ProblemDefinition
    tried: list[str] = field(default_factory=list)

    @property
    def apply(self) -> bool:
        """Whether there are constraints that a path may have to go around."""
        return bool(self.definition.conditions.along_q)

    def paths(self) -> Iterator[tuple[str, Path]]:
        """Yield different paths that meet the path constraints in q, each with its name."""
        metric = self.definition.metric
        space, rng = FreeSpace(self.definition), np.random.default_rng(0)
        box = self._box(space)
        starts, goals = (space.ends(at_end, rng, box) for at_end in (False, True))
        if not len(starts) or not len(goals):
            self.tried.append("no end of a path was found that meets the constraints")
            return
        distances = np.linalg.norm(starts[:, None] - goals[None], axis=2)
        starts = starts[np.argsort(distances.min(axis=1))][:_GOALS]
        goals = goals[np.argsort(distances.min(axis=0))][:_GOALS]
        seen: list[Array] = []
        free = list(_detours(space, starts[0], goals, box, metric))
        self.tried.append(f"{len(free)} detours clear of violated constraints")
        for number, q in enumerate(free):
            if _is_new(q, seen):
                yield f"detour {number + 1}", Path.through(metric, q)
        for seed in range(_SEEDS):
            waypoints = connect(space, starts, goals, box, np.random.default_rng(seed))
            if waypoints is None:
                self.tried.append(f"a sampling planner ({_SAMPLES} samples) that found no path")
                return
            path = Path.through(metric, shortcut(space, waypoints, np.random.default_rng(seed)))
            if _is_new(path(_S), seen):
                self.tried.append(f"a path of a sampling planner (seed {seed})")
                yield f"planner {seed}", path

    def _box(self, space: FreeSpace) -> tuple[Array, Array]:
        """Return bounds (n,) of samples: of the problem, or around both ends."""
        lower, upper = space.bounds.lower[1], space.bounds.upper[1]
        ends = np.nan_to_num(space.bounds.ends)
        least, most = ends.min(axis=0), ends.max(axis=0)
        periods = np.array(self.definition.metric.periods or np.zeros(lower.size))
        around = np.maximum(np.where(periods > 0.0, periods / 2.0, most - least), 1.0)
        return np.maximum(lower, least - around), np.minimum(upper, most + around)


_SEEDS = 20
_S = np.linspace(0.0, 1.0, 25)
_SAME = 0.1  # [rad or m]: paths nearer than this everywhere lead to the same solution


def _is_new(q: Array, seen: list[Array]) -> bool:
    """Return whether a path (k, n) is none of those seen, and remember it."""
    is_new = all(np.abs(q - each).max() > _SAME for each in seen)
    seen.append(q)
    return is_new


_ROUNDS, _FIRM = 12, 30.0  # of pushing and smoothing; weight of pushed against smooth
_OFFSET = 0.3  # of the box, or a radian: how far a detour leads off the straight line


def _detours(
    space: FreeSpace, start: Array, goals: Array, box: tuple[Array, Array], metric: Any
) -> list[Array]:
    """Return paths (25, n) clear of violated constraints, that of the least energy first."""
    middles = (start + goals) / 2.0
    n = start.size
    offsets = np.minimum(_OFFSET * (box[1] - box[0]), 1.0) * np.eye(n)
    corners = [(middles[0], goals[0])]
    corners += [(middle, goal) for middle, goal in zip(middles[1:], goals[1:], strict=True)]
    corners += [(middles[0] + sign * each, goals[0]) for each in offsets for sign in (1.0, -1.0)]
    half = 2.0 * np.minimum(_S, 1.0 - _S)[:, None]
    lines = [start + _S[:, None] * (goal - start) for _, goal in corners]
    paths = np.array(
        [
            line + half * (np.clip(middle, *box) - (start + goal) / 2.0)
            for line, (middle, goal) in zip(lines, corners, strict=True)
        ]
    )
    paths = _pushed_out(space, paths)
    free = [q for q in paths if all(map(space.is_free, q, q[1:]))]
    return sorted(free, key=lambda q: Path.through(metric, q).discrete_energy)


def _pushed_out(space: FreeSpace, paths: Array) -> Array:
    """Return paths (m, k, n) moved out of violated constraints and smoothed in turn."""
    count, size, n = paths.shape
    # min sum |q_i+1 - q_i|^2 / 2 + firm sum_i pushed_i |q_i - target_i|^2 / 2 with both ends fixed.
    stretch = 2.0 * np.eye(size) - np.eye(size, k=1) - np.eye(size, k=-1)
    lower, upper = space.bounds.lower[1], space.bounds.upper[1]
    for _ in range(_ROUNDS):
        excess, slopes = space.outward(paths.reshape(-1, n))
        excess[np.isinf(excess)] = -1.0  # there is no way out of where it is not defined
        violated = excess > -3.0 * _MARGIN
        if not np.any(excess > 0.0):
            break
        square = np.maximum((slopes * slopes).sum(axis=1), 1e-12)
        steps = -((excess + 2.0 * _MARGIN) / square)[:, None] * slopes
        length = np.linalg.norm(steps, axis=1, keepdims=True)
        steps *= np.minimum(1.0, _LONGEST / np.maximum(length, 1e-12))
        steps = np.where(violated[:, None], steps, 0.0).reshape(paths.shape)
        steps[:, [0, -1]] = 0.0
        targets = paths + steps
        weights = _FIRM * violated.reshape(count, size)
        matrices = stretch + np.eye(size) * weights[:, None]
        right = weights[:, :, None] * targets
        right[:, [0, -1]] = paths[:, [0, -1]]
        matrices[:, [0, -1]] = np.eye(size)[[0, -1]]
        paths = np.clip(np.linalg.solve(matrices, right), lower, upper)
    return paths


_MARGIN = 1e-3  # by which nodes are pushed clear of violated constraints
_LONGEST = 0.3  # step of a node [rad or m]

_SAMPLES = 2000
_EACH = 8  # every so many configurations of a line become nodes of a tree
_REACH = 1.5  # [rad or m]: longest line towards a sample


class _Tree:
    """Configurations, each with the index of the one it was reached from."""

    def __init__(self, roots: Array) -> None:
        self._q = list(roots)
        self._parents = [-1] * len(roots)

    def nearest(self, q: Array) -> int:
        return int(np.argmin(np.sum((np.array(self._q) - q) ** 2, axis=1)))

    def grow(self, space: FreeSpace, q: Array, longest: float) -> tuple[int, bool]:
        """Extend the nearest node towards a configuration; its last node, and whether it is
        reached.
        """
        node = self.nearest(q)
        start = self._q[node]
        distance = float(np.linalg.norm(q - start))
        end = start + (q - start) * min(1.0, longest / max(distance, _SPACING))
        line = space.prefix(start, end)
        reached = len(line) == _num_steps(start, end)
        for each in [*line[_EACH - 1 : -1 : _EACH], *line[-1:]]:
            self._q.append(each)
            self._parents.append(node)
            node = len(self._q) - 1
        return node, reached and longest >= distance

    def branch(self, node: int) -> list[Array]:
        """Return the configurations from a node to its root."""
        found = []
        while node >= 0:
            found.append(self._q[node])
            node = self._parents[node]
        return found

    def __getitem__(self, node: int) -> Array:
        return np.asarray(self._q[node])


def connect(
    space: FreeSpace,
    starts: Array,
    goals: Array,
    box: tuple[Array, Array],
    rng: np.random.Generator,
) -> Array | None:
    """Return free waypoints (m, n) from one of the starts to one of the goals; None if none were
    found.
    """
    trees = _Tree(starts), _Tree(goals)
    for number in range(_SAMPLES):
        one, other = trees[number % 2], trees[1 - number % 2]
        sample = rng.uniform(*box) if number > 1 else other[0]
        node, _ = one.grow(space, sample, _REACH)
        met, reached = other.grow(space, one[node], np.inf)
        if reached:
            first, last = one.branch(node), other.branch(met)
            joined = [*first[::-1], *last[1:]]
            return np.array(joined if number % 2 == 0 else joined[::-1])
    return None


_SHORTCUTS = 150


def shortcut(space: FreeSpace, waypoints: Array, rng: np.random.Generator) -> Array:
    """Return free waypoints (m, n) with parts replaced by straight lines where these are free."""
    q = waypoints
    for _ in range(_SHORTCUTS):
        if len(q) < 3:
            break
        upto = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
        places = np.sort(rng.uniform(0.0, upto[-1], 2))
        first, last = np.searchsorted(upto, places, side="right")
        if first == last:
            continue
        ends = np.column_stack([np.interp(places, upto, column) for column in q.T])
        if space.is_free(ends[0], ends[1]):
            q = np.vstack([q[:first], ends, q[last:]])
    return q
