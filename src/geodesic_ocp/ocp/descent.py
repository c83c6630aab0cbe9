"""From a path that is clear of many bodies to one of least energy that is, by short steps.

From one program to the next, nodes move by at most a radius, so that the path neither jumps over
thin bodies between its nodes nor is far from where its rows were chosen (a trust region: Nocedal
and Wright, *Numerical Optimization* (2006), chapter 4).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from geodesic_ocp.ipopt import STOPPED
from geodesic_ocp.ocp.nlp import ProblemDefinition
from geodesic_ocp.ocp.refinement import halved, worst_by_segment
from geodesic_ocp.ocp.solution import Solution, with_effort_of
from geodesic_ocp.ocp.violations import joined, left_out, may_become_active, path_samples
from geodesic_ocp.trajectory.path import Path

_CLEAR, _MET = 1e-2, 1e-3  # violations anywhere on a path, and at the nodes of an unfinished step
_RADIUS, _LEAST, _MOST = 0.15, 0.01, 0.25  # [rad or m], in problems as large as a robot's
_LARGE = 10.0  # extent of a path [rad or m] that is larger than a robot's
_WIDER, _NARROWER = 1.3, 1.5  # factors
_SHARES = 1.0, 0.5, 0.25  # of a step, of which the longest that is clear is taken
_STEPS, _MOST_SEGMENTS = 40, 64
_EDGE = 0.99  # of the radius

# From a problem with some conditions, a path, the radius, and the solution whose path this is, if
# there is one, to the solution, or the last iterate.
Step: TypeAlias = Callable[[ProblemDefinition, Path, float, Solution | None], Solution]


def is_at_edge(before: Path, after: Path, radius: float) -> bool:
    """Return whether a node has moved by the radius [rad or m]."""
    return bool(np.abs(after.nodes - before.nodes).max() > _EDGE * radius)


def still_moving(solution: Solution) -> Solution:
    """Return a solution that is one only because nodes may not move farther, as no success."""
    status = "each program still moves the path by as much as it may"
    return replace(solution, stats=replace(solution.stats, success=False, status=status))


def size_of(path: Path) -> float:
    """Return 1, or the factor by which a path is larger than those of robots."""
    return max(1.0, float(np.ptp(path.nodes, axis=0).max()) / _LARGE)


def descend(definition: ProblemDefinition, solve: Step, path: Path) -> Solution:
    """Return the solution that short steps from a clear path lead to, or the last iterate.

    A step through a body is shortened; if that does not help, it is repeated with the conditions
    that it violates, or with its segments halved where it violates none but those it knows.
    """
    conditions = definition.conditions
    samples = path_samples(conditions)
    size, kept = size_of(path), may_become_active(conditions, path)
    radius = _RADIUS * size
    before: Solution | None = None
    last: Solution | None = None
    is_held = False
    for _ in range(_STEPS):
        found = solve(definition.restricted(kept), path, radius, before)
        last = found if last is None else with_effort_of(last.stats, found)
        stats, is_held = found.stats, is_at_edge(path, found.path, radius)
        if stats.status == STOPPED:
            break
        is_less = found.path.discrete_energy < path.discrete_energy
        usable = stats.success or (stats.max_node_violation <= _MET and is_less)
        missing = left_out(conditions, kept, found.path) if usable else {}
        steps = [(share, _part(path, found.path, share)) for share in _SHARES if usable]
        clear = (each for each in steps if samples.excess(each[1], roughly=True)[1].max() <= _CLEAR)
        before = None
        if (first := next(clear, None)) is not None:
            share, after = first
            path, is_whole = after, share == 1.0
            if is_whole and stats.success and not missing and not is_held:
                break
            if not is_whole:
                radius /= _NARROWER
            elif is_held:
                radius = min(_WIDER * radius, _MOST * size)
            before = found if is_whole and stats.success else None
            kept = joined(missing, may_become_active(conditions, path))
            continue
        if not missing:
            coarse = worst_by_segment(found.path, samples.excess(found.path)) > _CLEAR
            radius /= _NARROWER
            if not usable or path.grid.segments + coarse.sum() > _MOST_SEGMENTS:
                radius /= _NARROWER
            else:
                path = Path(path.metric, grid := halved(path.grid, coarse), path(grid.nodes))
        if radius < _LEAST * size:
            break
        kept = joined(kept, missing, may_become_active(conditions, path))
    assert last is not None
    return still_moving(last) if is_held and last.stats.success else last


def _part(start: Path, end: Path, share: float) -> Path:
    """Return the path that is a share of the way from one to another on the same grid."""
    if share == 1.0:
        return end
    return Path(start.metric, start.grid, start.nodes + share * (end.nodes - start.nodes))
