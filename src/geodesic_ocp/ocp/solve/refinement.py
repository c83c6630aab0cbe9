"""Refinement: a solution on grids that are divided where they are too coarse, until it holds.

A path is smooth between the places where a constraint begins or ceases to hold it back; there its
acceleration jumps, and no polynomial follows. Segments are halved where conditions are violated
between the nodes, or where the polynomials' last terms still carry energy.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, as_positive
from geodesic_ocp.ipopt import STOPPED
from geodesic_ocp.ocp.nlp.violations import Misses
from geodesic_ocp.ocp.solve.solution import MeshIteration, Solution
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path

_ROUNDS = 20
_MOST_SEGMENTS = 400
# Halved are the segments that carry the larger part of what is too much, and this share of it.
_SHARE = 0.1
# After so many history an objective that is larger by so much is astray.
_PATIENCE, _WORSE = 3, 1.2


class SolveOn(Protocol):
    """The solution on a grid, from a path to start from; `near` tells that it is nearly one."""

    def __call__(self, grid: Grid, guess: Path | None, near: bool) -> Solution:
        """The solution, or the record of an attempt."""


def refined(
    solve_on: SolveOn, misses: Misses, grid: Grid, tolerance: float, guess: Path | None
) -> Solution:
    """The solution on a grid on which it holds to the tolerance.

    On a coarse grid there are solutions that no path is like: they leap from node to node. Finer
    grids then lead on to ever worse ones, and polynomials of low degree, which leap less, are tried
    for a start.

    Args:
        solve_on: the solution on a grid.
        misses: by how much a path violates the conditions, and where.
        grid: the first.
        tolerance: of violations between nodes, in the condition's unit, and of the objective,
            relative, from one grid to the next.
        guess: to start from.

    Where the grid became too large or a solve failed, `stats.success` is False.
    """
    tolerance = as_positive("tolerance", tolerance)
    solution = _divided(solve_on, misses, grid, tolerance, guess)
    stopped = solution.stats.status == STOPPED
    if (
        solution.stats.success or stopped or len(solution.stats.mesh_history) == 1
    ):  # none on any grid
        return solution
    rough = solve_on(_regrid(grid, 4 * grid.segments, 2), guess, False)
    if not rough.stats.success:
        return solution
    finer = _regrid(rough.path.grid, 2 * grid.segments, grid.degree)
    again = _divided(solve_on, misses, finer, tolerance, rough.path)
    if not again.stats.success:
        return solution
    history = (*solution.stats.mesh_history, _mesh_iteration(rough), *again.stats.mesh_history)
    return replace(again, stats=replace(again.stats, mesh_history=history))


def _regrid(grid: Grid, segments: int, degree: int) -> Grid:
    even = Grid(segments, degree)
    return even.with_via_points(grid.via_s.tolist()) if grid.via_segments else even


def _mesh_iteration(solution: Solution) -> MeshIteration:
    stats, segments = solution.stats, solution.path.grid.segments
    return MeshIteration(
        segments, stats.iterations, stats.seconds, stats.objective, stats.max_path_violation
    )


def _divided(
    solve_on: SolveOn, misses: Misses, grid: Grid, tolerance: float, guess: Path | None
) -> Solution:
    history: list[MeshIteration] = []
    for turn in range(_ROUNDS):
        solution = solve_on(grid, guess, turn > 0)
        stats, grid = solution.stats, solution.path.grid  # whose via points may have moved
        history.append(_mesh_iteration(solution))
        solution = replace(solution, stats=replace(stats, mesh_history=tuple(history)))
        if not stats.success:
            return solution
        settled = turn > 0 and (
            abs(stats.objective - history[-2].objective) <= tolerance * abs(stats.objective)
        )
        if settled and stats.max_path_violation <= tolerance:
            return solution
        coarse = _coarse(solution.path, misses(solution.path), tolerance)
        astray = turn >= _PATIENCE and stats.objective > _WORSE * history[0].objective > 0.0
        if astray or grid.segments + int(coarse.sum()) > _MOST_SEGMENTS:
            break
        grid, guess = _halved(grid, coarse), solution.path
    change = abs(history[-1].objective - history[-2].objective)
    status = (
        f"not solved to {tolerance:g}: on {history[-1].segments} segments conditions are still "
        f"missed by {stats.max_path_violation:.2g}, and the objective has changed by {change:.2g}"
    )
    return replace(solution, stats=replace(solution.stats, success=False, status=status))


def _coarse(path: Path, missed: tuple[Array, Array], tolerance: float) -> NDArray[np.bool_]:
    """Which segments are to be halved, (segments,); all, if none stands out."""
    places, amounts = missed
    segment = np.searchsorted(path.breakpoints, places, side="right") - 1
    segment = np.clip(segment, 0, path.grid.segments - 1)
    worst = np.zeros(path.grid.segments)
    np.maximum.at(worst, segment, amounts)
    unresolved = _last_terms(path)
    allowed = tolerance * path.energy / path.grid.segments
    coarse = (worst > tolerance) & (worst > _SHARE * worst.max())
    coarse |= (unresolved > allowed) & (unresolved > _SHARE * unresolved.max())
    return coarse if np.any(coarse) else np.ones_like(coarse)


def _last_terms(path: Path) -> Array:
    """Energy (segments,) of the last term of each polynomial's velocity."""
    grid = path.grid
    values = grid.in_segments(path.nodes)
    slopes = grid.differentiation @ (values - values[:, :1])
    # The velocity is of degree d - 1: its coefficient of Legendre's polynomial P_(d-1).
    last = np.eye(grid.degree)[-1]
    local = np.cos(np.pi * (np.arange(grid.degree) + 0.5) / grid.degree)[::-1]
    s = path.breakpoints[:-1, None] + grid.widths[:, None] * (local + 1.0) / 2.0
    velocity = grid.interpolate(slopes, s.ravel()).reshape(grid.segments, grid.degree, -1)
    to_terms = np.linalg.inv(legendre.legvander(local, grid.degree - 1))
    terms = np.einsum("j,jk,skn->sn", last, to_terms, velocity)
    middle = (path.breakpoints[:-1] + path.breakpoints[1:]) / 2.0
    sizes = [path.metric.norm(q, term) for q, term in zip(path(middle), terms, strict=True)]
    return np.asarray(0.5 * grid.widths * np.square(sizes) / (2 * grid.degree - 1))


def _halved(grid: Grid, coarse: NDArray[np.bool_]) -> Grid:
    ends = grid.breakpoints
    middle = (ends[:-1] + ends[1:])[coarse] / 2.0
    every = np.sort(np.concatenate([ends, middle]))
    stations = tuple(np.searchsorted(every, grid.via_s).tolist())
    return Grid(every.size - 1, grid.degree, tuple(every.tolist()), stations)
