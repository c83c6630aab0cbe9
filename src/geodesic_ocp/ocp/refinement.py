"""Mesh refinement, and optimal path parameters of via points.

A path is smooth between the points where a constraint becomes active or inactive; there its
acceleration jumps, which no polynomial resolves. Segments are halved where conditions are violated
between the nodes, or where the last terms of the polynomials still carry energy. The energy may
still change by what these carry, or as it did from the grid before, and by Ipopt's distance from
bounds, times multipliers.

The energy of segments of lengths L_k on intervals of widths t_k is at least sum_k L_k^2 / (2 t_k),
which is least where every L_k / t_k is equal. Solving and redistributing s alternate, accelerated
by Anderson's method (J. ACM 12, 1965). The remaining error in s enters the energy squared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import in_rounds
from geodesic_ocp.ipopt import STOPPED
from geodesic_ocp.manifold.metric import speeds_at
from geodesic_ocp.ocp.solution import MeshIteration, Solution, with_effort_of
from geodesic_ocp.ocp.violations import BETWEEN_NODES, PathSamples
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

# Halving has led to a path that jumps through an obstacle if segments are narrower than this.
_NARROWEST = 1e-5
_MAX_ROUNDS = 20
_MAX_SEGMENTS = 400
# Segments are halved whose error exceeds this fraction of the largest.
_FRACTION = 0.02
# Times that a segment is halved in one round; grids have a multiple of this number of segments.
_MOST_LEVELS = 2
_ROUND = 4
# After this many rounds, an objective larger by this factor has diverged.
_PATIENCE = 3
_WORSE = 1.2
_KNOWN = 1e-3  # relative error of the energy by the quadrature of a grid, without a tolerance
_STALE = 6  # rounds in which violations between nodes must halve


class SolveOn(Protocol):
    """Solves on a grid from a path, or from a solution with its multipliers."""

    def __call__(self, grid: Grid, guess: Path | Solution | None) -> Solution:
        """Return the solution, or the last iterate."""


def refine(
    solve_on: SolveOn,
    samples: PathSamples,
    first: Solution,
    tolerance: float | None,
    guess: Path | Solution | None,
    anew: bool = True,
) -> Solution:
    """Return the solution on a grid fine enough for the tolerance.

    Coarse grids admit spurious solutions that jump through obstacles from node to node, from which
    refinement diverges. The search then restarts from polynomials of low degree, which oscillate
    less.

    Args:
        solve_on: solves on a grid.
        samples: of the path constraints along a path.
        first: solution on the first grid.
        tolerance: for violations between nodes, in the scale of the condition, and for the
            relative error of the objective. None: the conditions hold to `BETWEEN_NODES`, and the
            energy of the path is known to `_KNOWN`.
        guess: initial guess.
        anew: whether the search restarts if it diverges.

    If the grid becomes too large or a solve fails, `stats.success` is False.
    """
    if tolerance is None and (not first.stats.success or _suffices(first)):
        return first
    solution = _halved_until_fine(solve_on, samples, _recorded(first), tolerance)
    if solution.stats.success or solution.stats.status == STOPPED or not first.stats.success:
        return solution
    if not anew or (isinstance(guess, Path) and tolerance is None):
        return solution  # it was on finer grids before
    grid = first.path.grid
    path = guess.path if isinstance(guess, Solution) else guess
    rough = _recorded(solve_on(_regrid(grid, 4 * grid.segments, 2), path), solution)
    if not rough.stats.success:
        return solution
    finer = _regrid(rough.path.grid, 2 * grid.segments, grid.degree)
    again = _recorded(solve_on(finer, rough.path), rough)
    again = _halved_until_fine(solve_on, samples, again, tolerance)
    return again if again.stats.success else solution


def meeting_conditions(solution: Solution, advice: str) -> Solution:
    """Get the solution, not successful if it violates a condition by more than `BETWEEN_NODES`."""
    if not _violates(solution):
        return solution
    status = f"it meets its conditions at the nodes, but not between them; {advice}"
    return _failed(solution, status)


def _failed(solution: Solution, status: str) -> Solution:
    """Return the solution as the last iterate of a solve that failed."""
    return replace(solution, stats=replace(solution.stats, success=False, status=status))


def _violates(solution: Solution) -> bool:
    stats = solution.stats
    return stats.success and stats.max_path_violation > BETWEEN_NODES


def _suffices(solution: Solution) -> bool:
    """Return whether a path meets its conditions, and its energy is known, without a tolerance."""
    path = solution.path
    is_known = energy_error(path, False) <= _KNOWN * path.discrete_energy
    return is_known and not _violates(solution)


def _recorded(solution: Solution, before: Solution | None = None) -> Solution:
    """Return the solution with its solve in the history, after those of another solution."""
    stats = solution.stats
    segments = solution.path.grid.segments
    this = MeshIteration(
        segments, stats.iterations, stats.seconds, stats.objective, stats.max_path_violation
    )
    history = () if before is None else before.stats.mesh_history
    return replace(solution, stats=replace(stats, mesh_history=(*history, this)))


def _regrid(grid: Grid, segments: int, degree: int) -> Grid:
    even = Grid(segments, degree)
    return even.with_via_points(grid.via_s.tolist()) if grid.via_segments else even


def _halved_until_fine(
    solve_on: SolveOn, samples: PathSamples, first: Solution, tolerance: float | None
) -> Solution:
    """Return the last solution, on grids whose coarse segments are halved until there are none."""
    c = first.conditions
    is_energy = c.cost.is_zero() and not (c.along_qv or c.via or c.on_end_velocities)

    def solve(start: tuple[Solution, Grid] | None) -> Solution:
        if start is None:
            return first
        before, grid = start
        return _recorded(solve_on(grid, before), before)

    def examine(number: int, found: Solution) -> tuple[Solution, tuple[Solution, Grid] | None]:
        stats = found.stats
        path = found.path
        if not stats.success:
            return found, None
        unresolved = unresolved_energy(path)
        change = abs(stats.objective - stats.mesh_history[-2].objective) if number else np.inf
        error = stats.gap + (min(change, float(unresolved.sum())) if is_energy else change)
        if tolerance is None:
            is_fine = _suffices(found)
            # The energy of a jump doubles as its segment is halved.
            before = stats.mesh_history[-2:][0].objective
            jumps = stats.objective > _WORSE * before > 0.0
            amounts = [each.max_path_violation for each in stats.mesh_history]
            stays = number >= _STALE and amounts[-1] > amounts[-1 - _STALE] / 2.0
            diverged = jumps or stays or min(path.grid.widths) < _NARROWEST
        else:
            most = tolerance * abs(stats.objective)
            is_fine = error <= most and stats.max_path_violation <= tolerance
            if is_fine:
                error += energy_error(path, is_energy)
                is_fine = error <= most
            diverged = stats.objective > _WORSE * first.stats.objective > 0.0
        if is_fine:
            return found, None
        violations = samples.excess(path)
        if tolerance is None:
            levels = _halvings(worst_by_segment(path, violations), BETWEEN_NODES, 2)
            levels = levels if np.any(levels) else np.ones_like(levels)
        else:
            levels = _levels(path, violations, unresolved, tolerance)
        finer = _finer(path.grid, levels, unresolved)
        too_many = finer.segments > (_MAX_SEGMENTS if tolerance else _MAX_SEGMENTS // 4)
        if not (diverged and number >= _PATIENCE) and not too_many and number + 1 < _MAX_ROUNDS:
            return found, (found, finer)
        if tolerance is None:
            if not _violates(found):
                return _failed(
                    found, "the metric varies too fast for any grid that was tried"
                ), None
            return meeting_conditions(found, "no finer grid meets its conditions"), None
        status = (
            f"not solved to {tolerance:g}: on {path.grid.segments} segments conditions are still "
            f"violated by {stats.max_path_violation:.2g}, and the objective's error is "
            f"{error:.2g}"
        )
        return _failed(found, status), None

    return in_rounds(None, solve, examine, _MAX_ROUNDS)


def _levels(
    path: Path, violations: tuple[Array, Array], unresolved: Array, tolerance: float
) -> NDArray[np.int64]:
    """Return how often to halve each segment, (segments,); all of them once if none stands out.

    At a kink of the velocity, violations fall with the square and energies with the cube of the
    width.
    """
    levels = np.zeros(path.grid.segments, dtype=int)
    errors = worst_by_segment(path, violations), unresolved
    allowed = tolerance, tolerance * path.discrete_energy / path.grid.segments
    for error, limit, order in zip(errors, allowed, (2, 3), strict=True):
        coarse = (error > limit) & (error > _FRACTION * error.max())
        levels[coarse] = np.maximum(levels[coarse], _halvings(error[coarse], limit, order))
    return levels if np.any(levels) else np.ones_like(levels)


def _halvings(errors: Array, limit: float, order: int) -> NDArray[np.int64]:
    """Return how often to halve segments with errors that fall with this power of the width."""
    needed = np.ceil(np.log2(np.maximum(errors / limit, 1.0)) / order)
    return np.minimum(needed, _MOST_LEVELS).astype(np.int64)


def _finer(grid: Grid, levels: NDArray[np.int64], errors: Array) -> Grid:
    """Return the grid with its segments halved as often as given, and some more up to a round
    number: on few numbers of segments, few programs are built.
    """
    rest = np.flatnonzero(levels == 0)
    more = -int(np.sum(2**levels)) % _ROUND
    levels = levels.copy()
    levels[rest[np.argsort(errors[rest])[::-1][:more]]] = 1
    while np.any(levels):
        coarse = levels > 0
        grid = halved(grid, coarse)
        levels = np.repeat(np.maximum(levels - 1, 0), 1 + coarse)
    return grid


def worst_by_segment(path: Path, violations: tuple[Array, Array]) -> Array:
    """Return largest violation in each segment, (segments,)."""
    s, amounts = violations
    segment = np.searchsorted(path.breakpoints, s, side="right") - 1
    worst = np.zeros(path.grid.segments)
    np.maximum.at(worst, np.clip(segment, 0, path.grid.segments - 1), amounts)
    return worst


def unresolved_energy(path: Path) -> Array:
    """Return energy (segments,) of the last term of each segment's polynomial velocity."""
    grid = path.grid
    values = grid.in_segments(path.nodes)
    slopes = grid.differentiation @ (values - values[:, :1])
    terms = _last_term(grid.degree) @ slopes
    middle = (path.breakpoints[:-1] + path.breakpoints[1:]) / 2.0
    sizes = speeds_at(path.metric, path(middle), terms)
    return np.asarray(0.5 * grid.widths * np.square(sizes) / (2 * grid.degree - 1))


def energy_error(path: Path, is_energy: bool) -> float:
    """Return the error of the energy of a path on its grid, whether or not the path is the best.

    It is the difference to the energy by a finer quadrature, as a metric that varies between the
    points of the grid's own may not be resolved.

    Args:
        path: the path.
        is_energy: whether all conditions are on positions, and the energy alone is minimized. Such
            paths have constant speed: with less variation, the energy would be less.
    """
    finer = path.grid.gauss(2 * path.grid.degree + 5)
    speeds = path.speeds_at(finer)
    length, twice = (float(np.sum(finer.weights * speeds**power)) for power in (1, 2))
    varies = (twice - length**2) / 2.0 if is_energy else 0.0
    return abs(twice / 2.0 - path.discrete_energy) + varies


@lru_cache
def _last_term(degree: int) -> Array:
    """Return, by the velocities at the nodes, their coefficient of Legendre's P_(degree - 1)."""
    nodes = 2.0 * Grid(1, degree).nodes - 1.0
    return np.asarray(legendre.legfit(nodes, np.eye(degree + 1), degree - 1)[-1])


def halved(grid: Grid, coarse: NDArray[np.bool_]) -> Grid:
    """Return the grid with some of its segments halved."""
    ends = grid.breakpoints
    middle = (ends[:-1] + ends[1:])[coarse] / 2.0
    every = np.sort(np.concatenate([ends, middle]))
    via_segments = tuple(np.searchsorted(every, grid.via_s).tolist())
    return Grid(every.size - 1, grid.degree, tuple(every.tolist()), via_segments)


_RESOLVED = 1e-2
_HALVINGS = 3


def resolving(grid: Grid, guess: Path, samples: PathSamples) -> Grid:
    """Return the grid with segments halved until a guess on it meets the path constraints roughly,
    where the guess itself does.
    """
    if samples.excess(guess, roughly=True)[1].max() > _RESOLVED:
        return grid
    for _ in range(_HALVINGS):
        path = Path(guess.metric, grid, guess(grid.nodes))
        coarse = worst_by_segment(path, samples.excess(path, roughly=True)) > _RESOLVED
        if not np.any(coarse):
            break
        grid = halved(grid, coarse)
    return grid


_MAX_UPDATES = 30
_COINCIDENT = 1e-4  # of the length: via points closer than this coincide
_CONVERGED = 1e-5  # in s; the error of the energy is its square


def with_optimal_via_points(
    solution: Solution, solve_on: Callable[[Grid, Path], Solution]
) -> Solution:
    """Return the solution with its via points at the optimal s.

    Args:
        solution: solution with via points at any s.
        solve_on: solves on another grid, from an initial guess.
    """
    tried: list[Array] = []
    residuals: list[Array] = []
    for _ in range(_MAX_UPDATES):
        grid = solution.path.grid
        if not grid.via_segments:
            return solution
        if close := _coincident(solution.path):
            return _failed(solution, f"{close} have come together: do they coincide?")
        if not solution.stats.success:
            return solution
        tried.append(grid.via_s)
        residuals.append(_balanced_via_s(solution.path) - grid.via_s)
        if np.abs(residuals[-1]).max() <= _CONVERGED:
            return solution
        moved = grid.with_via_points_at(_next(tried, residuals).tolist())
        start = Path(solution.path.metric, moved, solution.path.nodes)
        solution = with_effort_of(solution.stats, solve_on(moved, start))
    return _failed(
        solution, f"the parameters s of the via points did not converge in {_MAX_UPDATES} updates"
    )


def _coincident(path: Path) -> str:
    """Get names of two neighbouring ends or via points that nearly coincide; empty if none do."""
    lengths = _lengths(path)
    shortest = int(np.argmin(lengths))
    if not lengths[shortest] <= _COINCIDENT * lengths.sum():
        return ""
    names = ["the start", *(f"via[{k}]" for k in range(len(lengths) - 1)), "the end"]
    return f"{names[shortest]} and {names[shortest + 1]}"


def _next(tried: list[Array], residuals: list[Array]) -> Array:
    """Return via parameters at which the residual, extrapolated linearly, would be zero."""
    plain = tried[-1] + residuals[-1]
    if len(tried) == 1:
        return plain
    steps, changes = (np.diff(each, axis=0).T for each in (tried, residuals))
    factors = np.linalg.lstsq(changes, residuals[-1], rcond=1e-10)[0]
    better = plain - (steps + changes) @ factors
    gaps = np.diff([0.0, *better, 1.0])
    return better if np.all(gaps > 0.2 * np.diff([0.0, *tried[-1], 1.0])) else plain


def _balanced_via_s(path: Path) -> Array:
    """Return via parameters at which the mean square speed of all pieces would be equal."""
    lengths = _lengths(path)
    return np.asarray(np.cumsum(lengths)[:-1] / lengths.sum())


def _lengths(path: Path) -> Array:
    """Return lengths of the pieces between via points, from their mean square speeds."""
    grid = path.grid
    energies = (grid.quadrature.weights * path.speeds_at_quadrature_points**2).sum(axis=1)
    pieces = np.split(energies, grid.via_segments)
    widths = np.diff([0.0, *grid.via_s, 1.0])
    return np.sqrt([width * piece.sum() for width, piece in zip(widths, pieces, strict=True)])
