"""From a path that is clear of many bodies to one of less energy that is, by short steps.

Each step is a program of least energy in which the conditions are linear, as they are near the
path, at its nodes and between them, and nodes move by at most a radius (sequential convex
programming: Schulman et al., IJRR 33 (2014); trust regions: Nocedal and Wright, *Numerical
Optimization* (2006), chapter 4). A step is taken, or half of it, if the path stays clear, also
between its nodes, so that it never jumps over thin bodies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import scipy.sparse

from geodesic_ocp.blocks import in_rounds
from geodesic_ocp.ipopt import STOPPED
from geodesic_ocp.ocp.nlp import NLP, ProblemDefinition, build_nlp
from geodesic_ocp.ocp.solution import Solution, with_effort_of
from geodesic_ocp.ocp.violations import PathSamples, path_samples
from geodesic_ocp.trajectory.path import Path

_CLEAR = 3e-3  # violation anywhere on a path
_BETTER = 0.95  # of the violation before, if that was larger
_CORRECTED = 0.2  # of a violation that is larger, by one step
# sizes of the problem
_RADIUS = 0.15
_LEAST = 0.01
_MOST = 0.3
# factors, the one where nodes move by this share of the radius
_WIDER = 1.3
_NARROWER = 1.5
_FAR = 0.7
# relative decrease of the energy by the last step
_STEPS = 80
_LAST = 5e-3
_PRECISION = 3e-3  # of a step, of the decrease of the energy by the one before
# conditions that may count, as in `PathSamples.linearized`
_LEAST_SHARE = 0.1
_REACH = 3.0
_AT_FIRST = 0.1  # of what a step may change: conditions that are part of its first program
# in which others are added; violations of them
_ROUNDS = 6
_NEGLIGIBLE = 1e-5
_EDGE = 0.99  # of the radius

# From a program, the radius, and the tolerance to its solution, or the last iterate.
Solve: TypeAlias = Callable[[NLP, float, float], Solution]


def is_at_edge(before: Path, after: Path, radius: float) -> bool:
    """Return whether a node has moved by the radius [rad or m]."""
    return bool(np.abs(after.nodes - before.nodes).max() > _EDGE * radius)


def still_moving(solution: Solution) -> Solution:
    """Return a solution that is one only because nodes may not move farther, as no success."""
    status = "each program still moves the path by as much as it may"
    return replace(solution, stats=replace(solution.stats, success=False, status=status))


def descend(definition: ProblemDefinition, solve: Solve, path: Path) -> tuple[Path, Solution]:
    """Return the path that short steps from a nearly clear path lead to, which is nearly of least
    energy, and the solution of the last step.
    """
    samples = path_samples(definition.conditions)
    without = replace(definition.restricted({}), key=None)
    size = definition.size
    radius = _RADIUS * size
    energy = path.discrete_energy
    violation = _violation(samples, path)
    decrease = 1.0
    last = None
    for _ in range(_STEPS):
        allowed = max(_CLEAR, _BETTER * violation)
        step = _step(without, samples, path, radius, allowed, _PRECISION * decrease, solve)
        last = step if last is None else with_effort_of(last.stats, step)
        if last.stats.status == STOPPED:
            break
        ends = [step.path, Path(path.metric, path.grid, (path.nodes + step.path.nodes) / 2.0)]
        tried = ((after, _violation(samples, after)) for after in ends if step.stats.success)
        taken, found = next((each for each in tried if each[1] <= allowed), (None, violation))
        is_whole = taken is step.path
        is_last = False
        if not is_whole or step.path.discrete_energy > energy:
            radius /= _NARROWER
        elif is_at_edge(path, step.path, _FAR * radius):
            radius = min(_WIDER * radius, _MOST * size)
        if taken is not None:
            before = decrease
            decrease = abs(energy - taken.discrete_energy) / (energy or 1.0)
            is_last = is_whole and violation <= _CLEAR and max(before, decrease) <= _LAST
            path = taken
            energy = taken.discrete_energy
            violation = found
        if radius < _LEAST * size or is_last:
            break
    assert last is not None
    return path, last


def _violation(samples: PathSamples, path: Path) -> float:
    return float(samples.excess(path)[1].max())


def _step(
    definition: ProblemDefinition,
    samples: PathSamples,
    path: Path,
    radius: float,
    allowed: float,
    tolerance: float,
    solve: Solve,
) -> Solution:
    """Return the solution of one step, of the definition without conditions in q along the path.

    Of the linear conditions, those enter that are nearly met with equality, and then those that the
    solution violates, while the path violates its conditions by more than is allowed.
    """
    nlp = build_nlp(definition, path.grid, path)
    grid = path.grid
    extent = max(float(np.ptp(path.nodes, axis=0).max()), radius)
    s, excess, slopes = samples.linearized(path, max(_LEAST_SHARE, _REACH * radius / extent))
    weights = grid.interpolate(grid.in_segments(np.eye(grid.size)), s)  # of the nodes, at s
    change = radius * np.abs(slopes).sum(axis=1)
    free = np.any(nlp.bounds.lower < nlp.bounds.upper, axis=1)
    near = (excess > -change) & np.any(weights[:, free] != 0.0, axis=1)
    excess, slopes, weights, change = (each[near] for each in (excess, slopes, weights, change))
    most = -np.minimum(excess, np.maximum(_CLEAR, _CORRECTED * excess))
    chosen = excess > -_AT_FIRST * change

    def solve_with(before: Solution | None) -> Solution:
        rows = (weights[chosen][:, :, None] * slopes[chosen][:, None]).reshape(-1, path.nodes.size)
        matrix = scipy.sparse.csr_array(rows * nlp.units.length)
        found = solve(nlp.with_linear(matrix, most[chosen]), radius, tolerance)
        return found if before is None else with_effort_of(before.stats, found)

    def examine(number: int, found: Solution) -> tuple[Solution, Solution | None]:
        nonlocal chosen
        if not found.stats.success or _violation(samples, found.path) <= allowed:
            return found, None
        moved = weights @ (found.path.nodes - path.nodes)
        added = ((slopes * moved).sum(axis=1) > most + _NEGLIGIBLE) & ~chosen
        chosen = chosen | added
        return found, found if np.any(added) else None

    return in_rounds(None, solve_with, examine, _ROUNDS)
